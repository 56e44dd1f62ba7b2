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

import numpy as np

from thesis_lib.arrays import Array, ArrayLike, Mask

UPPER_INDICES = np.triu_indices(3)  # xx, xy, xz, yy, yz, zz
# Most points, and camera × point values, per block. From some 28,000 values on they exceed the 1 MB
# cache of a processor core: twice the time, and up to ten times with a second process running.
_BLOCK_POINTS, _BLOCK_VALUES = 6000, 24000
_COLUMNS = 8  # points that BLAS multiplies at a time: blocks begin at multiples of them
# Motion over depth in a step below which JᵀJ is reused: its change is of second order
_MAX_FIXED_MOTION = 1e-5
# Determinant over cubed trace up to which a normal matrix counts as singular: of two rays at an
# angle of 6 µrad. Round-off gives 1e-16 to those in one line
_MAX_SINGULAR_RATIO = 1e-12


def triangulate(P: ArrayLike, uv: ArrayLike, steps: int = 3) -> Array:
    """Return world points that fit their images best, by linear start and Gauss–Newton refinement.

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
    P, uv = check_arrays(P, uv)
    n = len(P)
    pixels = uv.reshape(n, 2, -1)
    points = np.empty((3, pixels.shape[2]))
    block = min(_BLOCK_POINTS, max(1, _BLOCK_VALUES // n // _COLUMNS) * _COLUMNS)
    solver = _NormalEquations(P, min(block, points.shape[1]))
    with np.errstate(divide="ignore", invalid="ignore"):  # degenerate rays end as NaN or inf
        for start in range(0, points.shape[1], block):
            part = slice(start, start + block)
            points[:, part] = solver.solve(pixels[:, :, part], steps)
    return points.reshape((3,) + uv.shape[2:])


def check_arrays(P: ArrayLike, uv: ArrayLike) -> tuple[Array, Array]:
    """Return both as arrays of floats; raise ValueError for a wrong shape."""
    P, uv = _check_cameras(P), np.asarray(uv, float)
    if uv.shape[:2] != (len(P), 2):
        raise ValueError(f"uv: given shape {uv.shape}, needs ({len(P)}, 2, ...) to match P")
    return P, uv


def _check_cameras(P: ArrayLike) -> Array:
    """Return projection matrices as an array; raise ValueError for fewer than two."""
    P = np.asarray(P, float)
    if P.ndim != 3 or P.shape[1:] != (3, 4) or len(P) < 2:
        raise ValueError(f"P: given shape {P.shape}, needs (cameras, 3, 4) with 2 or more cameras")
    return P


def check_frames(P: ArrayLike, uv: ArrayLike) -> tuple[Array, Array]:
    """Check projections and pixels of several images of every point."""
    P, uv = check_arrays(P, uv)
    if uv.ndim < 3 or uv.shape[2] < 1:
        raise ValueError(f"uv: given shape {uv.shape}, needs (cameras, 2, frames, ...)")
    return P, uv


def image_jacobian(P: ArrayLike, points: ArrayLike) -> Array:
    """Return the derivative of the image coordinates with respect to the world point.

    `P` and `points` are as for :func:`thesis_lib.vision.pinhole.project`, the result is
    ∂(u, v)/∂(X, Y, Z) in px/m, shape (cameras, 2, 3, ...).
    """
    P, X = np.asarray(P, float), np.asarray(points, float)
    image = P[:, :, :3] @ X.reshape(3, -1) + P[:, :, 3:]
    w = 1 / image[:, 2:]
    uv = image[:, :2] * w
    a, depth = P[:, :2, :3, None], P[:, 2:, :3, None]
    J: Array = w[:, :, None] * (a - uv[:, :, None] * depth)
    return J.reshape((len(P), 2, 3) + X.shape[1:])


def triangulation_gain(P: ArrayLike, points: ArrayLike) -> Array:
    """Return the first-order response of the refined point to its image coordinates, (JᵀJ)⁻¹Jᵀ.

    `P` and `points` are as for :func:`image_jacobian`, of two cameras or more; the result is
    ∂(X, Y, Z)/∂(u, v) in m/px, shape (3, cameras, 2, ...), and NaN where all rays to a point are
    in one line.
    """
    J = image_jacobian(_check_cameras(P), points)
    trailing = J.shape[3:]
    rows = np.moveaxis(J.reshape(2 * len(J), 3, -1), 2, 0)
    columns = np.swapaxes(rows, 1, 2)
    normal = columns @ rows
    _, _, regular = expand_determinant(normal.T[UPPER_INDICES])
    normal[~regular] = np.eye(3)  # LAPACK may stop at zeros or NaN
    G = np.linalg.solve(normal, columns)
    G[~regular] = np.nan
    return np.asarray(np.moveaxis(G, 0, 2), float).reshape((3, len(J), 2) + trailing)


def expand_determinant(matrix: Array) -> tuple[Array, Array, Mask]:
    """Return minor xx·yy − xy², determinant, and whether it is regular, of each symmetric matrix.

    `matrix` holds upper triangles (6, ...).
    """
    xx, xy, xz, yy, yz, zz = matrix
    minor = xx * yy - xy**2
    determinant = zz * minor - (yy * xz**2 - 2 * xy * xz * yz + xx * yz**2)
    trace = xx + yy + zz
    # trace**3 takes longer than all this
    return minor, determinant, determinant > _MAX_SINGULAR_RATIO * (trace * trace * trace)


def point_covariance(P: ArrayLike, points: ArrayLike, sigma_px: float = 1.0) -> Array:
    """Return first-order covariance σ² (JᵀJ)⁻¹ of the refined points for independent pixel noise.

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
        Covariance in m², NaN where all rays to a point are in one line.
    """
    G = triangulation_gain(P, points)
    return sigma_px**2 * np.einsum("ick...,jck...->ij...", G, G)


def centre_projections(P: Array) -> tuple[Array, Array]:
    """Return the projection matrices for pixels counted from the principal point, and that point.

    The point is in px, shape (2, cameras, 1).
    """
    P = P / np.linalg.norm(P[:, 2:, :3], axis=2, keepdims=True)
    middle = P[:, :2, :3] @ P[:, 2, :3, None]
    return np.concatenate([P[:, :2] - middle * P[:, 2:], P[:, 2:]], axis=1), middle.swapaxes(0, 1)


class _NormalEquations:
    """Constant matrices of the normal equations of a set of cameras, and buffers for one block."""

    def __init__(self, P: Array, block: int) -> None:
        n = len(P)
        P, self.middle = centre_projections(P)
        a, b = P[:, :, :3], P[:, :, 3:]
        outer = np.einsum("nik,njl->nijkl", a, a)[..., UPPER_INDICES[0], UPPER_INDICES[1]]
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
        self.room = np.empty(10 * n * block)

    def solve(self, pixels: Array, steps: int) -> Array:
        """Return the points (3, m) from images (cameras, 2, m) in px."""
        n, m = len(pixels), pixels.shape[2]
        room = self.room[: 10 * n * m].reshape(10, n, m)
        # One buffer holds in turn the features of the linear start, the images, and the features of
        # JᵀJ and of Jᵀr. The smaller it is, the more of it stays in cache.
        uv, hg, w = room[:2], room[2:4], room[4]
        squares, image = room[2], room[2:5].reshape(3 * n, m)
        w2, w2hg, w2s, spare = room[5], room[6:8], room[8], room[8:]
        residual, turned = room[5:7], room[7]
        for_linear, for_hessian, for_gradient = (
            part.reshape(-1, m) for part in (room[:3], room[5:9], room[5:8])
        )

        np.subtract(pixels.swapaxes(0, 1), self.middle, out=uv)
        np.multiply(uv, uv, out=spare)
        np.add(spare[0], spare[1], out=squares)
        system = self.linear @ for_linear
        system += self.linear_constant
        x = np.ones((4, m))  # homogeneous
        x[:3] = _solve(_factorise(system[:6]), system[6:])

        nearest = moved = np.inf  # largest inverse depth, longest step
        for step in range(steps):
            np.matmul(self.rows, x, out=image)
            np.divide(1.0, w, out=w)
            hg *= w
            if step == 0:
                nearest = np.fmax.reduce(np.abs(w), axis=None)
            if step == 0 or moved * nearest > _MAX_FIXED_MOTION:
                np.multiply(w, w, out=w2)
                np.multiply(w2, hg, out=w2hg)
                np.multiply(w2hg, hg, out=spare)
                w2s += spare[1]
                factors = _factorise((self.hessian @ for_hessian)[:6])
            np.subtract(uv, hg, out=residual)
            residual *= w
            hg *= residual
            np.add(hg[0], hg[1], out=turned)
            change = _solve(factors, (self.gradient @ for_gradient)[:3])
            moved = np.fmax.reduce(np.abs(change), axis=None)
            x[:3] += change
        return x[:3]


def _factorise(matrix: Array) -> tuple[Array, ...]:
    """Factorise symmetric 3×3 matrices as LDLᵀ, upper triangles (6, m): D's entries, then L's."""
    xx, xy, xz, yy, yz, zz = matrix
    yx, zx = xy / xx, xz / xx
    dy = yy - yx * xy
    rest = yz - yx * xz
    zy = rest / dy
    dz = zz - zx * xz - zy * rest
    return xx, dy, dz, yx, zx, zy


def _solve(factors: tuple[Array, ...], right: Array) -> Array:
    """Return the solutions (3, m) of factorised systems with right sides (3, m)."""
    dx, dy, dz, yx, zx, zy = factors
    x, y, z = right
    y = y - yx * x
    z = (z - zx * x - zy * y) / dz
    y = y / dy - zy * z
    x = x / dx - yx * y - zx * z
    return np.stack([x, y, z])
