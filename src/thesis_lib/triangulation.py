"""Points from their images in any number of cameras (thesis 3.2.1, 3.2.2).

Least squares on the linear equations of 3.2.1 gives a start; Gauss–Newton steps on the squared
reprojection error (eq. 3.19) refine it. Both are sums over cameras of a few fixed matrices times
a few numbers per camera and point, so one matrix product over a block of points forms the normal
equations of all of them; the 3×3 systems are solved in closed form.

With a_k the first three entries of row k of P, w the inverse depth and (h, g) the reprojection,

    JᵀJ = Σ w² [Q₀₀ − h Q₀ − g Q₁ + (h² + g²) Q₂],
    Q₀₀ = a₁a₁ᵀ + a₂a₂ᵀ,  Q₀ = a₁a₃ᵀ + a₃a₁ᵀ,  Q₁ = a₂a₃ᵀ + a₃a₂ᵀ,  Q₂ = a₃a₃ᵀ.

Images are ``(cameras, 2, ...)`` in px, points ``(3, ...)`` in m.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

_UPPER = np.triu_indices(3)  # xx, xy, xz, yy, yz, zz
_BLOCK_VALUES = 48000  # camera × point values per block: the features of a block stay in cache


def triangulate(P: ArrayLike, uv: ArrayLike, steps: int = 3) -> Array:
    """World points that fit their images best, by linear start and Gauss–Newton refinement.

    Parameters
    ----------
    P : array_like, shape (cameras, 3, 4)
        Projection matrices.
    uv : array_like, shape (cameras, 2, ...)
        Image coordinates in px. NaN in any camera gives NaN.
    steps : int
        Gauss–Newton steps; 0 leaves the linear estimate.

    Returns
    -------
    ndarray, shape (3, ...)
        Points in m.

    Raises
    ------
    ValueError
        If fewer than two cameras are given, or the shapes do not match.
    """
    P, uv = np.asarray(P, float), np.asarray(uv, float)
    if P.ndim != 3 or P.shape[1:] != (3, 4) or len(P) < 2:
        raise ValueError(f"P: given shape {P.shape}, needs (cameras, 3, 4) with 2 or more cameras")
    if uv.shape[:2] != (len(P), 2):
        raise ValueError(f"uv: given shape {uv.shape}, needs ({len(P)}, 2, ...) to match P")
    n = len(P)
    pixels = uv.reshape(n, 2, -1)
    points = np.empty((3, pixels.shape[2]))
    normalised, shift, scale = _normalise(P)
    block = max(1, min(_BLOCK_VALUES // n, pixels.shape[2]))
    solver = _NormalEquations(normalised, block)
    with np.errstate(divide="ignore", invalid="ignore"):  # degenerate rays end as NaN or inf
        for start in range(0, points.shape[1], block):
            part = slice(start, start + block)
            image = pixels[:, :, part] - shift[:, :, None]
            image /= scale
            points[:, part] = solver.solve(image[:, 0], image[:, 1], steps)
    return points.reshape((3,) + uv.shape[2:])


def jacobian(P: ArrayLike, points: ArrayLike) -> Array:
    """Derivative of the image coordinates with respect to the world point.

    Returns
    -------
    ndarray, shape (cameras, 2, 3, ...)
        ∂(u, v)/∂(X, Y, Z) in px/m.
    """
    P, X = np.asarray(P, float), np.asarray(points, float)
    flat = X.reshape(3, -1)
    image = P[:, :, :3] @ flat + P[:, :, 3:]
    w = 1 / image[:, 2:]
    uv = image[:, :2] * w
    a, depth = P[:, :2, :3, None], P[:, 2:, :3, None]
    J: Array = w[:, :, None] * (a - uv[:, :, None] * depth)
    return J.reshape((len(P), 2, 3) + X.shape[1:])


def gain(P: ArrayLike, points: ArrayLike) -> Array:
    """First-order response of the refined point to its image coordinates, (JᵀJ)⁻¹Jᵀ.

    Returns
    -------
    ndarray, shape (3, cameras, 2, ...)
        ∂(X, Y, Z)/∂(u, v) in m/px.
    """
    J = jacobian(P, points)
    trailing = J.shape[3:]
    rows = np.moveaxis(J.reshape(2 * len(J), 3, -1), 2, 0)
    columns = np.swapaxes(rows, 1, 2)
    G = np.moveaxis(np.linalg.solve(columns @ rows, columns), 0, 2)
    return np.asarray(G, float).reshape((3, len(J), 2) + trailing)


def covariance(P: ArrayLike, points: ArrayLike, sigma_px: float = 1.0) -> Array:
    """First-order covariance σ² (JᵀJ)⁻¹ of the refined points for independent pixel noise.

    Parameters
    ----------
    P : array_like, shape (cameras, 3, 4)
        Projection matrices.
    points : array_like, shape (3, ...)
        World points in m.
    sigma_px : float
        Standard deviation of every image coordinate in px.

    Returns
    -------
    ndarray, shape (3, 3, ...)
        Covariance in m².
    """
    G = gain(P, points)
    result: Array = sigma_px**2 * np.einsum("ick...,jck...->ij...", G, G)
    return result


def _normalise(P: Array) -> tuple[Array, Array, float]:
    """Projection matrices for pixels counted from the principal point in focal lengths.

    One scale serves all cameras, so that the cost remains the one in pixels.
    """
    depth = P[:, 2:, :3]
    P = P / np.linalg.norm(depth, axis=2, keepdims=True)
    depth = P[:, 2:, :3]
    shift = (P[:, :2, :3] @ np.swapaxes(depth, 1, 2))[:, :, 0]
    image = P[:, :2] - shift[:, :, None] * P[:, 2:]
    scale = float(np.sqrt(np.mean(image[:, :, :3] ** 2) * 3))
    return np.concatenate([image / scale, P[:, 2:]], axis=1), shift, scale


class _NormalEquations:
    """The fixed matrices of the normal equations of some cameras, and room for one block."""

    def __init__(self, P: Array, block: int) -> None:
        n = len(P)
        a, b = P[:, :, :3], P[:, :, 3:]
        outer = np.einsum("nik,njl->nijkl", a, a)[..., _UPPER[0], _UPPER[1]]
        constant = outer[:, 0, 0] + outer[:, 1, 1]
        varying = [
            -(outer[:, 0, 2] + outer[:, 2, 0]),
            -(outer[:, 1, 2] + outer[:, 2, 1]),
            outer[:, 2, 2],
        ]
        right = [
            a[:, 2] * b[:, 0] + a[:, 0] * b[:, 2],
            a[:, 2] * b[:, 1] + a[:, 1] * b[:, 2],
            -a[:, 2] * b[:, 2],
        ]
        right_constant = -(a[:, 0] * b[:, 0] + a[:, 1] * b[:, 1])
        # Linear start: matrix (6 rows) over right side (3), both linear in u, v and u² + v².
        self.linear = np.hstack([np.concatenate(varying), np.concatenate(right)]).T.copy()
        self.linear_constant = np.hstack([constant.sum(0), right_constant.sum(0)])[:, None]
        # Refinement: the same matrices weighted with w², and Jᵀr linear in three features.
        # Padded to 8 and 4 rows, which BLAS multiplies faster than 6 and 3.
        self.hessian = np.pad(np.concatenate([constant, *varying]).T, ((0, 2), (0, 0)))
        self.gradient = np.pad(np.hstack([a[:, 0].T, a[:, 1].T, -a[:, 2].T]), ((0, 1), (0, 0)))
        self.rows = np.concatenate([P[:, 0], P[:, 1], P[:, 2]])
        self.room = np.empty((10, n * block))

    def solve(self, u: Array, v: Array, steps: int) -> Array:
        """Points (3, m) from normalised images (cameras, m)."""
        n, m = u.shape
        room = self.room.reshape(-1)[: 10 * n * m].reshape(10 * n, m)
        image, residual, features = room[: 3 * n], room[3 * n : 6 * n], room[6 * n :]

        f0, f1, f2 = residual.reshape(3, n, m)
        f0[:], f1[:] = u, v
        np.multiply(u, u, out=f2)
        f2 += np.multiply(v, v, out=image[:n])
        system = self.linear @ residual
        system += self.linear_constant
        x = np.ones((4, m))  # homogeneous
        x[:3] = _multiply_symmetric(_invert_symmetric(system[:6]), system[6:])

        h, g, w = image.reshape(3, n, m)
        ru, rv, rs = residual.reshape(3, n, m)
        w2, w2h, w2g, w2s = features.reshape(4, n, m)
        for step in range(steps):
            np.matmul(self.rows, x, out=image)
            np.divide(1.0, w, out=w)
            h *= w
            g *= w
            if step < 2:  # the point then moves too little for JᵀJ to change
                np.multiply(w, w, out=w2)
                np.multiply(w2, h, out=w2h)
                np.multiply(w2, g, out=w2g)
                np.multiply(w2h, h, out=w2s)
                w2s += np.multiply(w2g, g, out=rs)
                inverse = _invert_symmetric((self.hessian @ features)[:6])
            np.subtract(u, h, out=ru)
            np.subtract(v, g, out=rv)
            ru *= w
            rv *= w
            h *= ru
            g *= rv
            np.add(h, g, out=rs)
            x[:3] += _multiply_symmetric(inverse, (self.gradient @ residual)[:3])
        return x[:3]


def _invert_symmetric(matrix: Array) -> Array:
    """Inverses of symmetric 3×3 matrices, upper triangles (6, m) to upper triangles."""
    xx, xy, xz, yy, yz, zz = matrix
    inverse = np.empty_like(matrix)
    inverse[0] = yy * zz - yz * yz
    inverse[1] = xz * yz - xy * zz
    inverse[2] = xy * yz - xz * yy
    inverse[3] = xx * zz - xz * xz
    inverse[4] = xy * xz - xx * yz
    inverse[5] = xx * yy - xy * xy
    inverse /= xx * inverse[0] + xy * inverse[1] + xz * inverse[2]
    return inverse


def _multiply_symmetric(matrix: Array, vector: Array) -> Array:
    """Products of symmetric 3×3 matrices (6, m) and vectors (3, m)."""
    xx, xy, xz, yy, yz, zz = matrix
    x, y, z = vector
    return np.stack([xx * x + xy * y + xz * z, xy * x + yy * y + yz * z, xz * x + yz * y + zz * z])
