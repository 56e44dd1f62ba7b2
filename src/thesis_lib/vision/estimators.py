"""What an estimator of points gets out of whole pixels: one measurement for all of them.

Cameras stand at given distances, in directions drawn evenly over the hemisphere; markers near the
origin move along Z; every image is rounded to whole pixels. The estimators are

* ``linear``: the linear equations of the thesis (3.2.1) alone,
* ``least-squares``: refined by Gauss–Newton steps (3.2.2),
* ``analytic-centre``: the centre of the slabs that the pixels leave
  (:mod:`thesis_lib.vision.analytic_centre`),
* ``joint``: the same with x and y common to rest and motion,
* ``interval``, ``joint-interval``: the mean of all points that noise and rounding allow
  (:mod:`thesis_lib.vision.interval`), which must be told the noise.

The linear equations weigh a camera's residual in pixels with its depth. With D the depths and J
the derivative of the images, the first-order response to the images is (JᵀD²J)⁻¹JᵀD² in place of
(JᵀJ)⁻¹Jᵀ: the same at equal depths, where refinement therefore gains nothing, and worse the more
the distances differ.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from thesis_lib.arrays import Array
from thesis_lib.vision.analytic_centre import analytic_centre, joint_centre
from thesis_lib.vision.interval import interval_estimate, joint_interval
from thesis_lib.vision.pinhole import CameraArray, hemisphere_cameras, project
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
ESTIMATORS = ("linear", "least-squares", "analytic-centre", "joint")  # that ask for no noise
CHECK_SIZE_PX, CHECK_FOCAL_PX = (
    (320, 180),
    24 / 36 * 320,
)  # the thesis's smallest sensor and its lens
CHECK_EXTENT_M = (0.05, 0.05)  # markers: |x|, |y| up to this, in m
CHECK_MOTION_M = 0.01  # displacements: up to this, in m


def random_hemisphere(
    rng: np.random.Generator,
    distances: ArrayLike,
    focal_px: float = CHECK_FOCAL_PX,
    size: tuple[int, int] = CHECK_SIZE_PX,
) -> CameraArray:
    """Return cameras at given distances (cameras,) in m, directions even over the hemisphere."""
    distances = np.asarray(distances, float)
    azimuth = rng.uniform(-np.pi, np.pi, len(distances))
    elevation = np.arcsin(rng.uniform(0, 1, len(distances)))
    return hemisphere_cameras(distances, azimuth, elevation, focal_px, size)


def move_markers(rng: np.random.Generator, markers: int) -> Array:
    """Return the markers at rest and moved along Z by up to ±MOTION, shape (3, 2, markers), m."""
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
    """Return the rms errors of deflections rebuilt from whole pixels, by layout and estimator.

    Parameters
    ----------
    distances : sequence of float
        Distance of each camera from the origin in m.
    layouts, markers : int
        Number of random layouts, and of markers for each.
    noise_px : float
        Standard deviation of Gaussian noise added to every coordinate before it is rounded.
    focal_px : float
        Focal length in px.
    size : tuple of int
        Sensor width and height in px.
    seed : int
        Layout i is a function of the seed, i and the number of cameras alone, so that layouts at
        other distances, or with other noise, have the same directions and markers.
    rules : sequence of str
        Estimators, of ``RULES``.

    Returns
    -------
    ndarray, shape (layouts, estimators)
        Root mean square over the markers in m, estimators as in `rules`.
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
    """Return the rms of independent draws and its standard error.

    Parameters
    ----------
    errors : array_like, shape (draws, ...)
        Errors of any distribution, in any unit.

    Returns
    -------
    tuple of ndarray, shape (...)
        Root mean square over the draws, and the standard error that its mean square implies: the
        standard deviation of the squares over 2 √draws rms. NaN for one draw, 0 for no error.
    """
    squares = np.square(np.asarray(errors, float))
    rms = np.sqrt(np.mean(squares, axis=0))
    if len(squares) < 2:
        return rms, np.full_like(rms, np.nan)
    spread = np.std(squares, axis=0, ddof=1) / (2 * np.sqrt(len(squares)))
    return rms, np.divide(spread, rms, out=np.zeros_like(rms), where=rms > 0)


def over_layouts(errors: Array) -> Array:
    """Return the root mean square over the layouts of errors (layouts, ...)."""
    return np.asarray(np.sqrt(np.mean(np.square(errors), axis=0)))


def fit_exponent(counts: ArrayLike, errors: ArrayLike) -> Array:
    """Fit exponents p of errors ~ Nᵖ in logarithms, errors (counts, ...), shape (...)."""
    slope = np.polyfit(np.log(np.asarray(counts, float)), np.log(np.asarray(errors, float)), 1)[0]
    return np.asarray(slope)
