"""How exact a calibration is, as its pictures of the board tell by themselves.

The covariance of a bundle adjustment takes every corner for an independent witness. Corners of one
picture are not: the board is not quite flat, the lens not quite its model. Pictures are, so what
each of them contributes says how far the cameras would have been off with others (the jackknife;
Efron & Stein 1981). Nothing is adjusted anew: with gₛ and Nₛ what shot s adds to the right side and
the matrix of the normal equations, its board's pose eliminated, the cameras change without it by

    δₛ = −(N − Nₛ)⁻¹ gₛ,   N = Σ Nₛ,   Σ gₛ = 0,

to first order, and their covariance is (n − 1)/n Σ δₛ δₛᵀ (Cook's distance has the same δₛ).

Some parameters, as k₂ of a long lens, rest on two or three of the shots. The variance of so few is
often too small by chance, as Student's t has it; on the other hand the jackknife's is too large on
average. The deviation of each parameter is widened by what the one exceeds the other.

What all images share, as a board that is bent alike in all of them, is seen only as far as its
effect differs from pose to pose: deviations grow in proportion to the bend, but may be several
times smaller than the errors.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.stats import norm, t

from thesis_lib.arrays import Array, Mask
from thesis_lib.measure.calibration import reprojection
from thesis_lib.measure.calibration.bundle_adjustment import Adjustment
from thesis_lib.measure.calibration.reprojection import LENS, POSE, Network

FEWEST = 5  # shots that the jackknife needs: with fewer, a direction often has too little by chance
_COVERED = 0.97725  # of the distribution of an error, below two standard deviations
_DETERMINED = 1e-11  # least eigenvalue of scaled normal equations, as of a bundle adjustment


def jackknife(observations: Array, points: Array, adjustment: Adjustment) -> Adjustment:
    """The cameras of an adjustment, with deviations that hold for the shots as they are.

    With fewer than :data:`FEWEST` shots, or one that nothing can do without, the adjustment's own
    covariance is widened by as much as shots differ more than independent corners would: how errors
    of corners go together is then taken to be the same in all directions.

    Parameters
    ----------
    observations : ndarray, shape (cameras, shots, 2, points)
        Pixels that the adjustment fits.
    points : ndarray, shape (3, points) or (cameras, shots, 3, points)
        The board's corners, m.
    adjustment : Adjustment
        Of these.

    Returns
    -------
    Adjustment
        Without boards: its ``covariance`` is that of the cameras alone, poses before lenses, up to
        a datum (see :func:`~thesis_lib.measure.calibration.alignment.camera_deviations`), its
        ``deviations`` are from there, widened so that twice them cover 95 %.
    """
    n, own = len(adjustment.cameras), of_cameras(adjustment)
    alone = replace(
        adjustment,
        rotations=adjustment.rotations[:0],
        translations=adjustment.translations[:0],
        covariance=own,
    )
    free = np.diag(own) > 0
    units = np.sqrt(np.diag(own)[free])
    matrices, sides = _contributions(observations, points, adjustment)
    parts = matrices[:, free][:, :, free] * units[:, None] * units
    right = sides[:, free] * units
    gauge, _ = np.linalg.qr(reprojection.gauge(alone)[free] / units[:, None])
    widths = np.ones(LENS * n)
    changes = _changes(parts, right, gauge) if len(parts) >= FEWEST else None
    if changes is None:
        covariance = own * _widening(parts, right, gauge, adjustment.sigma)
    else:
        changes, m = changes * units, len(changes)
        covariance = np.zeros_like(own)
        covariance[np.ix_(free, free)] = (m - 1) / m * changes.T @ changes
        adjusted = int(free[-LENS * n :].sum())
        widths[free[-LENS * n :]] = _widths(parts, gauge, adjusted)
    deviations = (widths * np.sqrt(np.diag(covariance)[-LENS * n :])).reshape(-1, LENS)
    return replace(alone, covariance=covariance, deviations=deviations)


def of_cameras(adjustment: Adjustment) -> Array:
    """An adjustment's own covariance of the cameras: their poses, then their lenses, (14 n, 14 n).

    It takes every corner for an independent witness.
    """
    n = len(adjustment.cameras)
    which = np.r_[: POSE * n, len(adjustment.covariance) - LENS * n : len(adjustment.covariance)]
    return adjustment.covariance[np.ix_(which, which)]


def with_lenses(
    observations: Array, points: Array, adjustment: Adjustment, held: Array, poses: Array
) -> Array:
    """Covariance of cameras whose lenses were held fixed, errors of these lenses included.

    An error of the lenses moves the poses by −N_pp⁻¹ N_pl of it.

    Parameters
    ----------
    observations, points, adjustment
        As of :func:`jackknife`, the lenses held fixed.
    held : ndarray, shape (8 n, 8 n)
        Covariance of the lenses.
    poses : ndarray, shape (14 n, 14 n)
        What :func:`jackknife` says of the poses alone.

    Returns
    -------
    ndarray, shape (14 n, 14 n)
    """
    cut = POSE * len(adjustment.cameras)
    units = np.sqrt(np.diag(poses)[:cut])
    N = _contributions(observations, points, adjustment)[0].sum(axis=0)
    own = N[:cut, :cut] * units[:, None] * units
    bare = Network(adjustment.cameras, np.zeros((0, 3, 3)), np.zeros((0, 3)))
    Q, _ = np.linalg.qr(reprojection.gauge(bare)[:cut] / units[:, None])
    moved = -np.linalg.solve(own + Q @ Q.T, units[:, None] * N[:cut, cut:]) * units[:, None]
    T = np.concatenate([moved, np.eye(len(held))])
    return np.asarray(poses + T @ held @ T.T)


def _contributions(observations: Array, points: Array, network: Network) -> tuple[Array, Array]:
    """What each shot says of the cameras: Nₛ, shape (shots, 14 n, 14 n), and gₛ, (shots, 14 n)."""
    seen: Mask = np.any(np.isfinite(observations), axis=(2, 3))
    n, shots = seen.shape
    sides = np.zeros((shots, (POSE + LENS) * n))
    matrices = np.zeros((*sides.shape, sides.shape[1]))
    for s in range(shots):
        views = np.flatnonzero(seen[:, s])
        cameras = tuple(network.cameras[c] for c in views)
        one = Network(cameras, network.rotations[[s]], network.translations[[s]])
        uv = observations[views][:, [s]]
        own = reprojection.of_pictures(points, np.ix_(views, np.array([s])))
        N, g, _ = reprojection.normal_equations(uv, seen[views][:, [s]], own, one)
        board = POSE * len(views) + np.arange(POSE)
        both = np.column_stack([N, g])
        both = both - N[:, board] @ np.linalg.solve(N[np.ix_(board, board)], both[board])
        both = np.delete(np.delete(both, board, axis=0), board, axis=1)
        of_poses = POSE * views[:, None] + np.arange(POSE)
        of_lenses = POSE * n + LENS * views[:, None] + np.arange(LENS)
        index = np.r_[of_poses.ravel(), of_lenses.ravel()]
        matrices[np.ix_([s], index, index)] = both[:, :-1]
        sides[s, index] = both[:, -1]
    return matrices, sides


def _changes(parts: Array, right: Array, gauge: Array) -> Array | None:
    """How the cameras change without each shot, (shots, unknowns); None if one is needed.

    The gauge's directions, orthonormal here, are kept still.
    """
    rest = parts.sum(axis=0) + gauge @ gauge.T - parts
    if np.linalg.eigvalsh(rest)[:, 0].min() < _DETERMINED:
        return None
    return -np.linalg.solve(rest, right[..., None])[..., 0]


def _widths(parts: Array, gauge: Array, count: int) -> Array:
    """Factors by which deviations of the last unknowns are widened, as they rest on few shots.

    With independent shots alike in all but Nₛ, the jackknife's variance of an unknown is on average
    ρ = (m − 1)/m Σ vₛ / v of the true one, vₛ being the diagonal of (N − Nₛ)⁻¹ Nₛ (N − Nₛ)⁻¹ and v
    that of N⁻¹, and has ν = (Σ vₛ)² / Σ vₛ² degrees of freedom (Welch and Satterthwaite).
    """
    whole = parts.sum(axis=0)
    inverse, others = (np.linalg.inv(N + gauge @ gauge.T) for N in (whole, whole - parts))
    last = np.s_[..., len(whole) - count :]
    single = np.einsum("sij,sjk,ski->si", others, parts, others, optimize=True)[last]
    total, m = single.sum(axis=0), len(parts)
    true = np.einsum("ij,jk,ki->i", inverse, whole, inverse, optimize=True)[last]
    excess = (m - 1) / m * total / true
    freedom = np.maximum(total**2 / np.sum(single**2, axis=0), 1.0)
    return np.maximum(t.ppf(_COVERED, freedom) / norm.ppf(_COVERED) / np.sqrt(excess), 1.0)


def _widening(parts: Array, right: Array, gauge: Array, sigma: float) -> float:
    """Factor of the variances by which shots differ more than independent corners would.

    The sum of gₛᵀ N⁻¹ gₛ over all shots is then σ² (p − Σ tr (N⁻¹ Nₛ)²) on average, p being the
    number of unknowns besides the gauge.
    """
    inverse = np.linalg.inv(parts.sum(axis=0) + gauge @ gauge.T)
    shares = inverse @ parts
    expected = np.subtract(*gauge.shape) - np.einsum("sij,sji->", shares, shares)
    found = np.einsum("si,ij,sj->", right, inverse, right)
    return float(max(found / (sigma**2 * expected), 1.0))
