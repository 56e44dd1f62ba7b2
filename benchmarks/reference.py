"""Reference implementations: the direct, slow way, for tests and benchmark."""

from __future__ import annotations

import numpy as np

from thesis_lib.acoustics.radiation import Medium, Pistons
from thesis_lib.arrays import Array, ComplexArray


def svd_triangulate(
    P: Array, uv: Array, steps: int = 3, full_matrices: bool = True, block: int = 10_000
) -> Array:
    """Homogeneous SVD and Gauss–Newton steps, batched over points (thesis 3.2.1, 3.2.2).

    Parameters
    ----------
    P : ndarray, shape (cameras, 3, 4)
        Projection matrices.
    uv : ndarray, shape (cameras, 2, points)
        Image coordinates in px.
    steps : int
        Gauss–Newton steps.
    full_matrices : bool
        As in :func:`numpy.linalg.svd`: the default builds a left factor that nobody reads.
    block : int
        Points at a time, which bounds the memory.

    Returns
    -------
    ndarray, shape (3, points)
        Points in m.
    """
    parts = [
        _svd_triangulate(P, uv[:, :, start : start + block], steps, full_matrices)
        for start in range(0, uv.shape[2], block)
    ]
    return np.concatenate(parts, axis=1)


def _svd_triangulate(P: Array, uv: Array, steps: int, full_matrices: bool) -> Array:
    image = uv.transpose(2, 0, 1)  # points first, as numpy.linalg wants it
    m, n = image.shape[:2]
    rows = image[..., None] * P[:, None, 2] - P[:, :2]
    right = np.linalg.svd(rows.reshape(m, 2 * n, 4), full_matrices=full_matrices)[2][:, -1]
    X = right[:, :3] / right[:, 3:]
    for _ in range(steps):
        homogeneous = np.concatenate([X, np.ones((m, 1))], axis=1) @ P.reshape(-1, 4).T
        homogeneous = homogeneous.reshape(m, n, 3)
        depth = homogeneous[:, :, 2:]
        projected = homogeneous[:, :, :2] / depth
        J = (P[:, :2, :3] - projected[..., None] * P[:, None, 2, :3]) / depth[..., None]
        J = J.reshape(m, 2 * n, 3)
        residual = (image - projected).reshape(m, 2 * n, 1)
        JT = J.transpose(0, 2, 1)
        X = X + np.linalg.solve(JT @ J, JT @ residual)[:, :, 0]
    return X.T


def hartley_sturm(P1: Array, P2: Array, uv: Array) -> Array:
    """Optimal triangulation from two images by the roots of a polynomial of degree six.

    R. I. Hartley and P. Sturm, "Triangulation", Computer Vision and Image Understanding 68 (1997):
    the global minimum of the squared reprojection error. Points one by one.

    Parameters
    ----------
    P1, P2 : ndarray, shape (3, 4)
        Projection matrices.
    uv : ndarray, shape (2, 2, points)
        Image coordinates in px.

    Returns
    -------
    ndarray, shape (3, points)
        Points in m.
    """
    F = _fundamental_matrix(P1, P2)
    P = np.stack([P1, P2])
    corrected = np.stack([_correct(F, m1, m2) for m1, m2 in uv.transpose(2, 0, 1)], axis=2)
    return svd_triangulate(P, corrected, steps=0)  # the corrected rays meet


def _fundamental_matrix(P1: Array, P2: Array) -> Array:
    centre = np.linalg.svd(P1)[2][-1]
    F: Array = _cross_matrix(P2 @ centre) @ P2 @ np.linalg.pinv(P1)
    return F / np.linalg.norm(F)


def _cross_matrix(v: Array) -> Array:
    x, y, z = v
    return np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])


def _epipole(F: Array) -> Array:
    """Right null vector, scaled so that its first two entries have length one."""
    e: Array = np.linalg.svd(F)[2][-1]
    return e / np.hypot(e[0], e[1])


def _rotation_to_x(e: Array) -> Array:
    return np.array([[e[0], e[1], 0], [-e[1], e[0], 0], [0, 0, 1]])


def _nearest_to_origin(line: Array) -> Array:
    a, b, c = line
    return np.array([-a * c, -b * c, a * a + b * b])


def _correct(F: Array, m1: Array, m2: Array) -> Array:
    """The images nearest to `m1` and `m2` that meet the epipolar constraint, shape (2, 2)."""
    to_m1, to_m2 = np.eye(3), np.eye(3)  # from coordinates about the measured points
    to_m1[:2, 2], to_m2[:2, 2] = m1, m2
    F = to_m2.T @ F @ to_m1
    e1, e2 = _epipole(F), _epipole(F.T)
    R1, R2 = _rotation_to_x(e1), _rotation_to_x(e2)
    F = R2 @ F @ R1.T
    f1, f2 = float(e1[2]), float(e2[2])
    (a, b), (c, d) = F[1:, 1:].tolist()

    ab, cd, linear = np.poly1d([a, b]), np.poly1d([c, d]), np.poly1d([1, 0])
    weight = np.poly1d([f1 * f1, 0, 1])
    first = linear * (ab * ab + f2 * f2 * cd * cd) ** 2
    second = (a * d - b * c) * weight * weight * ab * cd

    def cost(t: Array) -> Array:
        result: Array = t**2 / weight(t) + cd(t) ** 2 / (ab(t) ** 2 + f2 * f2 * cd(t) ** 2)
        return result

    candidates = np.real((first - second).roots)
    t = candidates[np.argmin(cost(candidates))]
    lines = (
        np.array([t * f1, 1, -t]),
        np.array([-f2 * cd(t), ab(t), cd(t)]),
    )
    if 1 / f1**2 + c**2 / (a**2 + f2**2 * c**2) < cost(t):  # t → ∞
        lines = np.array([f1, 0, -1]), np.array([-f2 * c, a, c])
    x1 = to_m1 @ R1.T @ _nearest_to_origin(lines[0])
    x2 = to_m2 @ R2.T @ _nearest_to_origin(lines[1])
    return np.stack([x1[:2] / x1[2], x2[:2] / x2[2]])


def distances(pistons: Pistons, points: Array) -> Array:
    """Distances R in m from `points` (3, ...) to the pistons, shape (..., pistons)."""
    X, Y, Z = points[..., None]
    x, y = pistons.centres
    return np.asarray(np.sqrt((X - x) ** 2 + (Y - y) ** 2 + Z**2))


def field_of_distances(
    pistons: Pistons, R: Array, velocity: ComplexArray, omega: float, medium: Medium
) -> ComplexArray:
    """Rayleigh's integral as it is written, jωρ₀A_e/2π Σ v e^{−jkR}/R (eq. 6.7)."""
    k = omega / medium.speed_of_sound
    scale = 1j * omega * medium.density * pistons.area / (2 * np.pi)
    return np.asarray(scale * (np.exp(-1j * k * R) / R @ velocity))
