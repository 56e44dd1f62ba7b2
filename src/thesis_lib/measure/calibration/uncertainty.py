"""Uncertainty of a calibration, from its calibration images alone.

The covariance of a bundle adjustment takes every corner for an independent witness. Corners of one
image are not: the board is not quite flat, the lens not quite its model. Images are, so what
each of them contributes says how far the cameras would have been off with others (the jackknife;
Efron & Stein 1981). Nothing is adjusted again: with gₛ and Nₛ what shot s adds to the right side
and the matrix of the normal equations, its board's pose eliminated, cameras change without it by

    δₛ = −(N − Nₛ)⁻¹ gₛ,   N = Σ Nₛ,   Σ gₛ = 0,

to first order, and their covariance is (n − 1)/n Σ δₛ δₛᵀ (Cook's distance has the same δₛ).

Some parameters, as k₂ of a long lens, rest on two or three of the shots. The variance of so few is
often too small by chance, as Student's t has it; on the other hand the jackknife's is too large on
average. The deviation of each parameter is widened by what the one exceeds the other.

What all images share, as a board that is bent alike in all of them, is seen only as far as its
effect differs from pose to pose: deviations grow in proportion to the bend, but may be several
times smaller than the errors.
"""

from dataclasses import replace

import numpy as np
import scipy

from thesis_lib.arrays import Array, Mask
from thesis_lib.measure.calibration import bundle_adjustment as bundle
from thesis_lib.measure.recordings.board import Board

# Shots that the jackknife needs: with fewer, a direction often has too little by chance
MIN_JACKKNIFE_IMAGES = 5
_COVERED_PROBABILITY = 0.97725  # of the distribution of an error, below two standard deviations


def jackknife_cameras(
    observations: Array, points: Array, adjustment: bundle.Adjustment
) -> bundle.Adjustment:
    """Return the cameras of an adjustment, with deviations that hold for the images as they are.

    With fewer than :data:`MIN_JACKKNIFE_IMAGES` shots, or one that nothing can do without, the
    adjustment's own covariance is widened by as much as shots differ more than independent corners
    would: how errors of corners go together is then taken to be the same in all directions.

    Parameters
    ----------
    observations : ndarray, shape (cameras, shots, 2, points)
        Pixels that the adjustment fits.
    points : ndarray, shape (3, points) or (cameras, shots, 3, points)
        The board's corners, m.
    adjustment : Adjustment

    Returns
    -------
    Adjustment
        Without boards: its ``covariance`` is that of the cameras alone, poses before lenses, up to
        a datum (see :func:`~.bundle_adjustment.camera_deviations`), its
        ``deviations`` are from there, widened so that twice them cover 95 %.
    """
    n, own = len(adjustment.cameras), of_cameras(adjustment)
    boards = {name: getattr(adjustment, name)[:0] for name in ("rotations", "translations")}
    alone = replace(adjustment, covariance=own, **boards)
    free = np.diag(own) > 0
    units = np.sqrt(np.diag(own)[free])
    matrices, sides = _image_contributions(observations, points, adjustment)
    parts = matrices[:, free][:, :, free] * units[:, None] * units
    right = sides[:, free] * units
    gauge, _ = np.linalg.qr(bundle.gauge_directions(alone)[free] / units[:, None])
    widths = np.ones(bundle.LENS_UNKNOWNS * n)
    rest = parts.sum(axis=0) + gauge @ gauge.T - parts  # without each image; the gauge stays still
    if (
        len(parts) < MIN_JACKKNIFE_IMAGES
        or np.linalg.eigvalsh(rest)[:, 0].min() < bundle.MIN_EIGENVALUE
    ):
        covariance = own * _variance_factor(parts, right, gauge, adjustment.sigma)
    else:
        changes, m = -np.linalg.solve(rest, right[..., None])[..., 0] * units, len(parts)
        covariance = np.zeros_like(own)
        covariance[np.ix_(free, free)] = (m - 1) / m * changes.T @ changes
        adjusted = int(free[-bundle.LENS_UNKNOWNS * n :].sum())
        widths[free[-bundle.LENS_UNKNOWNS * n :]] = _widening_factors(parts, gauge, adjusted)
    deviations = widths * np.sqrt(np.diag(covariance)[-bundle.LENS_UNKNOWNS * n :])
    return replace(
        alone, covariance=covariance, deviations=deviations.reshape(-1, bundle.LENS_UNKNOWNS)
    )


def of_cameras(adjustment: bundle.Adjustment) -> Array:
    """Return an adjustment's own covariance of the cameras: poses, then lenses, (14 n, 14 n)."""
    n = len(adjustment.cameras)
    which = bundle.camera_unknowns(np.arange(n), n, len(adjustment.rotations))
    return adjustment.covariance[np.ix_(which, which)]


def with_lenses(
    observations: Array, points: Array, adjustment: bundle.Adjustment, held: Array, poses: Array
) -> Array:
    """Return covariance of cameras whose lenses were held fixed, errors of these lenses included.

    An error of the lenses moves the poses by −N_pp⁻¹ N_pl of it. `held` (8 n, 8 n) is the lenses'
    covariance, `poses` what :func:`jackknife_cameras` says of the poses alone; it and the result
    are (14 n, 14 n).
    """
    cut = bundle.POSE_UNKNOWNS * len(adjustment.cameras)
    units = np.sqrt(np.diag(poses)[:cut])
    N = _image_contributions(observations, points, adjustment)[0].sum(axis=0)
    own = N[:cut, :cut] * units[:, None] * units
    gauge = bundle.gauge_directions(bundle.without_boards(adjustment.cameras))[:cut]
    Q, _ = np.linalg.qr(gauge / units[:, None])
    moved = -np.linalg.solve(own + Q @ Q.T, units[:, None] * N[:cut, cut:]) * units[:, None]
    T = np.concatenate([moved, np.eye(len(held))])
    return np.asarray(poses + T @ held @ T.T)


def _image_contributions(
    observations: Array, points: Array, network: bundle.Network
) -> tuple[Array, Array]:
    """Return each image's normal equations: Nₛ (shots, 14 n, 14 n) and gₛ (shots, 14 n)."""
    seen: Mask = np.any(np.isfinite(observations), axis=(2, 3))
    points = bundle.spread_points(points, observations)
    n, shots = seen.shape
    sides = np.zeros((shots, (bundle.POSE_UNKNOWNS + bundle.LENS_UNKNOWNS) * n))
    matrices = np.zeros((*sides.shape, sides.shape[1]))
    for s in range(shots):
        views = np.flatnonzero(seen[:, s])
        cameras = tuple(network.cameras[c] for c in views)
        one = bundle.Network(cameras, network.rotations[[s]], network.translations[[s]])
        uv, X = observations[views, s : s + 1], points[views, s : s + 1]
        N, g, _ = bundle.normal_equations(uv, X, one)
        board = bundle.POSE_UNKNOWNS * len(views) + np.arange(bundle.POSE_UNKNOWNS)
        both = np.column_stack([N, g])
        both = both - N[:, board] @ np.linalg.solve(N[np.ix_(board, board)], both[board])
        both = np.delete(np.delete(both, board, axis=0), board, axis=1)
        index = bundle.camera_unknowns(views, n)
        matrices[s][np.ix_(index, index)] = both[:, :-1]
        sides[s, index] = both[:, -1]
    return matrices, sides


def _widening_factors(parts: Array, gauge: Array, count: int) -> Array:
    """Return factors that widen the last unknowns' deviations, which rest on few images.

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
    wider = scipy.special.stdtrit(freedom, _COVERED_PROBABILITY)  # quantiles: Student, normal
    wider /= scipy.special.ndtri(_COVERED_PROBABILITY)
    return np.maximum(wider / np.sqrt(excess), 1.0)


def _variance_factor(parts: Array, right: Array, gauge: Array, sigma: float) -> float:
    """Return the factor of the variances by which shots differ more than independent corners would.

    The sum of gₛᵀ N⁻¹ gₛ over all shots is then σ² (p − Σ tr (N⁻¹ Nₛ)²) on average, p being the
    number of unknowns besides the gauge.
    """
    inverse = np.linalg.inv(parts.sum(axis=0) + gauge @ gauge.T)
    shares = inverse @ parts
    expected = np.subtract(*gauge.shape) - np.einsum("sij,sji->", shares, shares)
    found = np.einsum("si,ij,sj->", right, inverse, right)
    return float(max(found / (sigma**2 * expected), 1.0))


def jackknife_rig(
    corners: Array, board: Board, full: bundle.Adjustment, lens_covariance: Array | None = None
) -> bundle.Adjustment:
    """Return calibrated cameras with deviations by :func:`jackknife_cameras`, lenses included.

    The corners (cameras, shots, 2, corners), and the adjustment `full` of these, are those of
    :func:`~thesis_lib.measure.calibration.rig.adjust_cameras`. Lenses that it held fixed are as
    uncertain as each camera's own images leave them, or as their covariance (8 n, 8 n) from before
    states; NaN where that is not known.
    """
    used = corners[:, np.isfinite(corners).any(axis=(0, 2, 3))]
    points = bundle.spread_points(board.corners_in_images(used), used)
    if full.deviations.any():  # the lenses are adjusted, too: once more, from where they are now
        return jackknife_cameras(used, points, bundle.adjust_bundle(used, points, full.cameras))
    cameras = jackknife_cameras(used, points, full)
    if lens_covariance is None:
        blocks = []
        for k, camera in enumerate(full.cameras):
            seen = np.isfinite(used[k]).any(axis=(1, 2))
            uv, X = used[k : k + 1, seen], points[k : k + 1, seen]
            alone = jackknife_cameras(uv, X, bundle.adjust_bundle(uv, X, [camera]))
            blocks.append(alone.covariance[bundle.POSE_UNKNOWNS :, bundle.POSE_UNKNOWNS :])
        lens_covariance = np.asarray(scipy.linalg.block_diag(*blocks))
    if np.isfinite(lens_covariance).all():
        covariance = with_lenses(used, points, full, lens_covariance, cameras.covariance)
        cameras = replace(cameras, covariance=covariance)
    deviations = np.sqrt(np.diag(lens_covariance)).reshape(-1, bundle.LENS_UNKNOWNS)
    return replace(cameras, deviations=deviations)
