"""Simulated deflection measurements in whole pixels, by several estimators, and their errors.

The estimators of :data:`ESTIMATOR_RULES` are

* ``linear``: the linear equations of the thesis (3.2.1) alone,
* ``least-squares``: refined by Gauss–Newton steps (3.2.2),
* ``analytic-centre``: the centre of the polytope that the pixels allow
  (:mod:`thesis_lib.vision.analytic_centre`),
* ``joint``: the same with x and y common to rest and motion,
* ``interval``, ``joint-interval``: the posterior mean under noise and rounding
  (:mod:`thesis_lib.vision.interval`), which needs the noise.

The linear equations weigh a camera's residual in pixels with its depth. With D the depths and J
the derivative of the images, the first-order response to the images is (JᵀD²J)⁻¹JᵀD² in place of
(JᵀJ)⁻¹Jᵀ: the same at equal depths, where refinement therefore gains nothing, and worse the more
the distances differ.

:func:`deflection_errors` compares them with cameras at given distances, in directions uniform over
the hemisphere, and markers near the origin that move along Z.
"""

from collections.abc import Callable, Sequence

import numpy as np

from thesis_lib.arrays import Array, ArrayLike
from thesis_lib.vision.analytic_centre import analytic_centre, joint_centre
from thesis_lib.vision.interval import interval_estimate, joint_interval
from thesis_lib.vision.pinhole import CameraArray, hemisphere_cameras, pixelate, project
from thesis_lib.vision.triangulation import triangulate

# Points (3, ...) from projection matrices, images (cameras, 2, ...) and their noise in px.
ESTIMATOR_RULES: dict[str, Callable[[Array, Array, float], Array]] = {
    "linear": lambda P, uv, noise: triangulate(P, uv, steps=0),
    "least-squares": lambda P, uv, noise: triangulate(P, uv),
    "analytic-centre": lambda P, uv, noise: analytic_centre(P, uv).points,
    "joint": lambda P, uv, noise: joint_centre(P, uv).points,
    "interval": lambda P, uv, noise: interval_estimate(P, uv, noise).points,
    "joint-interval": lambda P, uv, noise: joint_interval(P, uv, noise).points,
}
ESTIMATORS = ("linear", "least-squares", "analytic-centre", "joint")  # that need no noise
CHECK_SIZE_PX, CHECK_FOCAL_PX = (320, 180), 24 / 36 * 320  # the thesis's smallest sensor, its lens
CHECK_EXTENT_M = (0.05, 0.05)  # markers: |x|, |y| up to this, in m
CHECK_MOTION_M = 0.01  # displacements: up to this, in m


def random_hemisphere(
    rng: np.random.Generator,
    distances: ArrayLike,
    focal_px: float = CHECK_FOCAL_PX,
    size: tuple[int, int] = CHECK_SIZE_PX,
) -> CameraArray:
    """Return cameras at given distances (cameras,) in m, uniform over the hemisphere."""
    distances = np.asarray(distances, float)
    azimuth = rng.uniform(-np.pi, np.pi, len(distances))
    elevation = np.arcsin(rng.uniform(0, 1, len(distances)))
    return hemisphere_cameras(distances, azimuth, elevation, focal_px, size)


def move_markers(rng: np.random.Generator, markers: int) -> Array:
    """Return markers at rest and moved along Z by up to ±:data:`CHECK_MOTION_M`.

    The shape is (3, 2, markers), in m.
    """
    points = np.zeros((3, 2, markers))
    points[:2] = rng.uniform(-1, 1, (2, 1, markers)) * np.array(CHECK_EXTENT_M)[:, None, None]
    points[2, 1] = rng.uniform(-CHECK_MOTION_M, CHECK_MOTION_M, markers)
    return points


def estimate_points(
    P: Array, uv: Array, rules: Sequence[str] = ESTIMATORS, noise_px: float = 0.0
) -> Array:
    """Estimate points from images (cameras, 2, 2, ...) in px: (estimators, 3, 2, ...)."""
    return np.stack([ESTIMATOR_RULES[rule](P, uv, noise_px) for rule in rules])


def deflection_errors(
    distances: Sequence[float],
    layouts: int = 100,
    markers: int = 100,
    noise_px: float = 0.0,
    focal_px: float = CHECK_FOCAL_PX,
    size: tuple[int, int] = CHECK_SIZE_PX,
    seed: int = 0,
    rules: Sequence[str] = ESTIMATORS,
) -> Array:
    """Return the rms errors in m of deflections from whole pixels, (layouts, estimators).

    Each is over all `markers` of a random layout of cameras at the given distances from the origin
    in m. Gaussian noise of `noise_px` is added to every coordinate before it is rounded; `rules`
    are estimators of :data:`ESTIMATOR_RULES`. Layout i is a function of the seed, i and the number
    of cameras alone, so that layouts at other distances, or with other noise, have the same
    directions and markers.
    """
    errors = np.empty((layouts, len(rules)))
    for layout in range(layouts):
        rng = np.random.default_rng([seed, layout, len(distances)])
        P = random_hemisphere(rng, distances, focal_px, size).P
        points = move_markers(rng, markers)
        uv = project(P, points)
        uv += noise_px * rng.standard_normal(uv.shape)
        height = estimate_points(P, np.rint(uv), rules, noise_px)[:, 2]
        wrong = height[:, 1] - height[:, 0] - (points[2, 1] - points[2, 0])
        errors[layout] = np.sqrt(np.mean(wrong**2, axis=-1))
    return errors


def rms_with_std(errors: ArrayLike) -> tuple[Array, Array]:
    """Return the rms of independent draws (draws, ...) and its standard error, both (...).

    The standard error follows from that of the mean square: the standard deviation of the
    squares over 2 √draws rms. NaN for one draw, 0 for no error.
    """
    squares = np.square(np.asarray(errors, float))
    rms = np.sqrt(np.mean(squares, axis=0))
    if len(squares) < 2:
        return rms, np.full_like(rms, np.nan)
    spread = np.std(squares, axis=0, ddof=1) / (2 * np.sqrt(len(squares)))
    return rms, np.divide(spread, rms, out=np.zeros_like(rms), where=rms > 0)


def rms_over_layouts(errors: Array) -> Array:
    """Return the root mean square over the layouts of errors (layouts, ...)."""
    return np.asarray(np.sqrt(np.mean(np.square(errors), axis=0)))


def fit_exponent(counts: ArrayLike, errors: ArrayLike) -> Array:
    """Fit exponents p of errors ~ Nᵖ in logarithms, errors (counts, ...), shape (...)."""
    slope = np.polyfit(np.log(np.asarray(counts, float)), np.log(np.asarray(errors, float)), 1)[0]
    return np.asarray(slope)


LEAST_SQUARES = "least-squares"


def assurance_criterion(measured: Array, reference: Array) -> Array:
    """Return modal assurance criterion of shapes (..., markers) over the markers that are not NaN.

    (Σ w φ)² / (Σ w² Σ φ²): 1 for shapes that differ in size alone; NaN if none moves or is known.
    """
    known = np.isfinite(measured)
    m, r = np.where(known, measured, 0), np.where(known, reference, 0)
    with np.errstate(invalid="ignore"):
        return np.asarray(np.sum(m * r, -1) ** 2 / (np.sum(m * m, -1) * np.sum(r * r, -1)))


def measure_deflections(
    cameras: CameraArray,
    points: Array,
    shifts: Array,
    rest_is_known: bool = False,
    estimator: str = LEAST_SQUARES,
    normals: Array | None = None,
    noise: Array | None = None,
    noise_px: float = 0.0,
) -> Array:
    """Return the deflections that cameras with whole pixels measure.

    Parameters
    ----------
    points : ndarray, shape (3, 1 + modes, markers)
        Marker positions in m: at rest, then deflected.
    shifts : ndarray, shape (trials, cameras, 2)
        Shift of each camera's pixel grid in px.
    rest_is_known : bool
        Subtract the true rest position instead of the triangulated one.
    estimator : str
        One of :data:`ESTIMATOR_RULES`. Slabs of rounded images move along with a shifted grid.
    normals : ndarray, shape (3, markers), optional
        Unit vectors along which deflections are measured, in place of Z.
    noise : ndarray, shape (trials, cameras, 2, 1 + modes, markers), optional
        Noise of the images before they are rounded, in px.
    noise_px : float
        Standard deviation of the noise, which the estimator is given.

    Returns
    -------
    ndarray, shape (modes, trials, markers)
        Measured deflections in m.
    """
    P = cameras.P
    shift = np.moveaxis(shifts, 0, 2)[:, :, None, :, None]
    seen = slice(1, None) if rest_is_known else slice(None)
    images = project(P, points[:, seen])[:, :, :, None] + shift
    if noise is not None:
        images += np.moveaxis(noise[:, :, :, seen], 0, 3)
    found = ESTIMATOR_RULES[estimator](P, pixelate(images) - shift, noise_px)
    height = found[2] if normals is None else np.einsum("k...m,km->...m", found, normals)
    if not rest_is_known:
        return height[1:] - height[0]
    return height - (points[2, 0] if normals is None else np.sum(points[:, 0] * normals, axis=0))


def percent_errors(measured: Array, reference: Array) -> tuple[Array, Array, Array]:
    """Return the point, mean (rms) and largest error in % of the largest reference deflection.

    Equations 3.22 and 3.23; `measured` is (modes, trials, markers), `reference` (modes, markers).
    """
    scale = 100 / np.max(np.abs(reference), axis=-1)
    point = np.abs(measured - reference[:, None]) * scale[:, None, None]
    return point, np.sqrt(np.mean(point**2, axis=-1)), np.max(point, axis=-1)
