"""Uncertainty of a calibration, estimated from its calibration images alone.

The covariance of a bundle adjustment assumes independent corners. The errors of corners in one
image are correlated: the board is not quite flat, and the lens deviates from its model. Board poses
are independent; the jackknife (Efron & Stein 1981) therefore estimates the covariance from the
effect of leaving out one pose. No adjustment is repeated: let gₛ and Nₛ be the contributions of
pose s to the right side and the matrix of the normal equations, after elimination of the board's
pose. Without pose s the cameras change to first order by

    δₛ = −(N − Nₛ)⁻¹ gₛ,   N = Σ Nₛ,   Σ gₛ = 0,

and their covariance is (n − 1)/n Σ δₛ δₛᵀ (Cook's distance has the same δₛ).

Some parameters, such as k₂ of a long lens, depend on two or three of the poses. A variance from so
few is often too small by chance (Student's t), while the jackknife's variance is too large on
average. The ratio of the two factors, if above 1, widens each parameter's standard deviation.

Of errors that all images share, such as those of a bent board, the jackknife sees only differences
between poses: standard deviations grow with the bend, but may be several times below the errors.
"""

from dataclasses import replace

import numpy as np
import scipy

from thesis_lib.arrays import Array, Mask
from thesis_lib.measure.calibration import bundle_adjustment as bundle
from thesis_lib.measure.recordings.board import Board

# With fewer board poses the variance of some direction is often too small by chance
MIN_JACKKNIFE_POSES = 5
_COVERED_PROBABILITY = 0.97725  # of a normal distribution, below two standard deviations


def jackknife_cameras(
    observations: Array, points: Array, adjustment: bundle.Adjustment
) -> bundle.Adjustment:
    """Estimate the uncertainty of an adjustment's cameras by a jackknife over board poses.

    With fewer than :data:`MIN_JACKKNIFE_POSES` poses, or if one of them is indispensable, the
    adjustment's own covariance is scaled by the variance between poses over that of independent
    corners. This assumes that errors of corners are correlated equally in all directions.

    Parameters
    ----------
    observations : ndarray, shape (cameras, poses, 2, points)
        Pixels to which the adjustment was fitted.
    points : ndarray, shape (3, points) or (cameras, poses, 3, points)
        The board's corners, m.
    adjustment : Adjustment

    Returns
    -------
    Adjustment
        Without boards. ``covariance`` is that of the cameras alone, poses before lenses, up to a
        datum (see :func:`~.bundle_adjustment.camera_deviations`). ``deviations`` are its standard
        deviations of the lenses, widened so that ± 2 of them cover 95 %.
    """
    n, own = len(adjustment.cameras), camera_covariance(adjustment)
    boards = {name: getattr(adjustment, name)[:0] for name in ("rotations", "translations")}
    alone = replace(adjustment, covariance=own, **boards)
    free = np.diag(own) > 0
    units = np.sqrt(np.diag(own)[free])
    matrices, sides = _image_contributions(observations, points, adjustment)
    parts = matrices[:, free][:, :, free] * units[:, None] * units
    right = sides[:, free] * units
    gauge, _ = np.linalg.qr(bundle.gauge_directions(alone)[free] / units[:, None])
    widths = np.ones(bundle.LENS_UNKNOWNS * n)
    rest = parts.sum(axis=0) + gauge @ gauge.T - parts  # without each pose, in a fixed gauge
    if (
        len(parts) < MIN_JACKKNIFE_POSES
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


def camera_covariance(adjustment: bundle.Adjustment) -> Array:
    """Return the cameras' covariance in an adjustment, (14 n, 14 n): poses, then lenses."""
    n = len(adjustment.cameras)
    which = bundle.camera_unknowns(np.arange(n), n, len(adjustment.rotations))
    return adjustment.covariance[np.ix_(which, which)]


def add_lens_covariance(
    observations: Array, points: Array, adjustment: bundle.Adjustment, held: Array, poses: Array
) -> Array:
    """Add the uncertainty of lenses that were held fixed to the covariance of the cameras.

    An error ε of the lenses moves the poses by −N_pp⁻¹ N_pl ε. `held` (8 n, 8 n) is the lenses'
    covariance. `poses` (14 n, 14 n) is the covariance from :func:`jackknife_cameras` with fixed
    lenses; the result has the same shape.
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
    """Return each board pose's contributions Nₛ (poses, 14 n, 14 n) and gₛ (poses, 14 n)."""
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
    """Return factors that widen the standard deviations of the last `count` unknowns.

    For m independent board poses that differ only in Nₛ, the jackknife's variance of an unknown is
    on average ρ = (m − 1)/m Σ vₛ / v times the true variance, with vₛ from the diagonal of
    (N − Nₛ)⁻¹ Nₛ (N − Nₛ)⁻¹ and v from that of N⁻¹, and has ν = (Σ vₛ)² / Σ vₛ² degrees of freedom
    (Welch and Satterthwaite).
    """
    whole = parts.sum(axis=0)
    inverse, others = (np.linalg.inv(N + gauge @ gauge.T) for N in (whole, whole - parts))
    last = np.s_[..., len(whole) - count :]
    single = np.einsum("sij,sjk,ski->si", others, parts, others, optimize=True)[last]
    total, m = single.sum(axis=0), len(parts)
    true = np.einsum("ij,jk,ki->i", inverse, whole, inverse, optimize=True)[last]
    excess = (m - 1) / m * total / true
    freedom = np.maximum(total**2 / np.sum(single**2, axis=0), 1.0)
    wider = scipy.special.stdtrit(freedom, _COVERED_PROBABILITY)  # Student's over normal quantile
    wider /= scipy.special.ndtri(_COVERED_PROBABILITY)
    return np.maximum(wider / np.sqrt(excess), 1.0)


def _variance_factor(parts: Array, right: Array, gauge: Array, sigma: float) -> float:
    """Return the ratio, at least 1, of the variance between poses to that of independent corners.

    For independent corners the sum of gₛᵀ N⁻¹ gₛ over all poses is σ² (p − Σ tr (N⁻¹ Nₛ)²) on
    average, where p is the number of unknowns without the gauge.
    """
    inverse = np.linalg.inv(parts.sum(axis=0) + gauge @ gauge.T)
    shares = inverse @ parts
    expected = np.subtract(*gauge.shape) - np.einsum("sij,sji->", shares, shares)
    found = np.einsum("si,ij,sj->", right, inverse, right)
    return float(max(found / (sigma**2 * expected), 1.0))


def jackknife_rig(
    corners: Array, board: Board, full: bundle.Adjustment, lens_covariance: Array | None = None
) -> bundle.Adjustment:
    """Estimate the uncertainty of calibrated cameras by :func:`jackknife_cameras`, with lenses.

    The corners (cameras, poses, 2, corners) and their adjustment `full` are those of
    :func:`~thesis_lib.measure.calibration.rig.adjust_cameras`. For lenses that it held fixed, the
    covariance is `lens_covariance` (8 n, 8 n) of an earlier calibration, NaN if unknown; by default
    it is estimated from each camera's own images.
    """
    used = corners[:, np.isfinite(corners).any(axis=(0, 2, 3))]
    points = bundle.spread_points(board.corners_in_images(used), used)
    if full.deviations.any():  # the lenses were adjusted: once more, starting from the result
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
        covariance = add_lens_covariance(used, points, full, lens_covariance, cameras.covariance)
        cameras = replace(cameras, covariance=covariance)
    deviations = np.sqrt(np.diag(lens_covariance)).reshape(-1, bundle.LENS_UNKNOWNS)
    return replace(cameras, deviations=deviations)
