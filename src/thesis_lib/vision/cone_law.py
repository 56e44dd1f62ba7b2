"""Closed-form errors of camera layouts, at the centre at which all cameras look.

An error σⱼ of the image coordinate j moves the refined point by gⱼ σⱼ, with gⱼ = ∂X/∂mⱼ. With
JᵀJ = (f/R)² Σ (I − e eᵀ), for cameras in unit directions e at distance R with a focal length of f
px, the response along the normal is

    pair at elevation φ, azimuths α apart:   g_v = R / (2 f cos φ),  g_u = ± tan φ cot(α/2) R / 2f,
    N cameras on a cone, θ from the normal:  g_v = R / (N f sin θ),  g_u = 0,

and Var z = Σ gⱼ² σⱼ². The size of σⱼ depends on the source of the error:

* *Independent noise* gives all coordinates the same σ, whether they move or not.
* *Rounding* gives a coordinate that moves by δ px the variance f(1 − f), f = frac |δ|, of
  :mod:`thesis_lib.vision.rounding`: 1/6 px² averaged over amplitudes, and nothing if it does not
  move. A deflection of the centre moves v alone, so u adds no error to it, even for a narrow pair.

The gains are those of the centre, so the forms hold for motions up to 1 % of the distance. There
they are within 1 % of :func:`thesis_lib.vision.rounding.deflection_variance`, which has the gains
of the moved point; at 2 % of the distance a narrow pair is off by up to 4 %, at 6 % by up to 28 %.

Throughout, `distance` R is in m, `focal_px` f and `sigma_px` σ of an image coordinate in px, angles
are in rad. Arrays broadcast.
"""

import numpy as np

from thesis_lib.arrays import Array, ArrayLike, NDArray
from thesis_lib.vision.pinhole import CameraArray, hemisphere_cameras

MOTION_PX = np.sqrt(1 / 6)  # rms rounding error of a motion, averaged over amplitudes
# Cone angle at which the error is equal in all directions
ISOTROPIC_ANGLE_RAD = np.arcsin(np.sqrt(2 / 3))
# Largest motion for which the closed forms hold, as a fraction of the distance: up to it they are
# within 1 % of the law of rounding with the gains of the moved point, for pairs at elevations of
# 5° to 85° and apertures of 8° to 180°.
MAX_MOTION_FRACTION = 0.01


def cone_directions(angle: float, n_cameras: int) -> tuple[Array, Array]:
    """Return the azimuths and elevations in rad of cameras at equal steps on a cone, from +Y on."""
    azimuth = 2 * np.pi * np.arange(n_cameras) / n_cameras
    return azimuth, np.full(n_cameras, np.pi / 2 - angle)


def cone_cameras(
    distance: float, angle: float, n_cameras: int, focal_px: float, size: tuple[int, int]
) -> CameraArray:
    """Return equal cameras on a cone about the normal, at equal steps of azimuth from +Y on.

    `angle` θ is that between optical axes and normal, π/2 less the elevation; `size` is that of the
    sensors in px.
    """
    return hemisphere_cameras(distance, *cone_directions(angle, n_cameras), focal_px, size)


def cone_deflection_error(
    distance: ArrayLike,
    focal_px: ArrayLike,
    n_cameras: ArrayLike,
    angle: ArrayLike,
    sigma_px: float = MOTION_PX,
) -> Array:
    """Return R σ / (f √N sin θ), the standard deviation in m along the normal at a cone's centre.

    It holds for independent noise and for rounded deflections, as u does not contribute: g_u = 0.
    N cameras, 2 or more, stand at an `angle` θ from the normal.

    Raises
    ------
    ValueError
        If there are fewer than two cameras.
    """
    n = np.asarray(n_cameras, float)
    if not np.all(n >= 2):
        raise ValueError(f"n_cameras: given {np.min(n):g}, allowed: 2 or more")
    scale = np.asarray(distance, float) * sigma_px / np.asarray(focal_px, float)
    return np.asarray(scale / (np.sqrt(n) * np.sin(angle)))


def cone_covariance(
    distance: float, focal_px: float, n_cameras: int, angle: float, sigma_px: float = MOTION_PX
) -> Array:
    """Return the covariance (3, 3) in m² of a point at the centre of a cone of 3 or more cameras.

    Since Σ e eᵀ = N diag(½ sin²θ, ½ sin²θ, cos²θ) it is diagonal, with
    σ_x = σ_y = R σ / (f √(N (1 − ½ sin²θ))), σ_z = R σ / (f √N sin θ): equal at sin²θ = ⅔.
    It holds for independent noise. For rounding, averaged over amplitudes, each variance is that
    of a motion along its axis: coordinates that this motion does not move do not contribute.

    Raises
    ------
    ValueError
        If there are fewer than three cameras, which have no axis of symmetry.
    """
    if n_cameras < 3:
        raise ValueError(f"n_cameras: given {n_cameras}, allowed: 3 or more")
    sine2 = np.sin(angle) ** 2
    across = 1 - sine2 / 2
    information = n_cameras * np.array([across, across, sine2]) * (focal_px / distance) ** 2
    return np.diag(sigma_px**2 / information)


def pair_deflection_error(
    distance: ArrayLike,
    focal_px: ArrayLike,
    aperture: ArrayLike,
    elevation: ArrayLike,
    sigma_px: ArrayLike = MOTION_PX,
    sideways_px: ArrayLike = 0.0,
) -> Array:
    """Return the standard deviation in m along the normal, of two cameras that share an elevation.

    R / (f √2) · √(σ_v² / cos²φ + σ_u² tan²φ / tan²(α/2)), with the elevation φ, the difference α
    of the azimuths (`aperture`), and the standard deviations σ_v (`sigma_px`) and σ_u
    (`sideways_px`) of the image coordinates down and to the right. A rounded deflection of the
    centre has σ_u = 0, which gives R σ_v / (f √2 cos φ), independent of the aperture.
    """
    upright = np.asarray(sigma_px, float) / np.cos(elevation)
    across = sideways_px * np.tan(elevation) / np.tan(np.asarray(aperture, float) / 2)
    scale = np.asarray(distance, float) / np.asarray(focal_px, float)
    return np.asarray(scale * np.sqrt((upright**2 + across**2) / 2))


def pair_noise_error(
    distance: ArrayLike,
    focal_px: ArrayLike,
    aperture: ArrayLike,
    elevation: ArrayLike,
    sigma_px: float = MOTION_PX,
) -> Array:
    """Return the error in m of a pair with independent noise, equal in all coordinates.

    R σ / (f √2) · √(1 + tan²φ / sin²(α/2)); for opposite cameras R σ / (f √2 cos φ), as for
    rounding.
    """
    angles = aperture, elevation
    return pair_deflection_error(distance, focal_px, *angles, sigma_px, sigma_px)


def error_of_sum(positions_px: ArrayLike, weights: ArrayLike) -> Array:
    """Return the rms of weighted sums of rounding errors on one randomly shifted grid, shape (...).

    It is the square root of wᵀ C w with the covariance C of
    :func:`thesis_lib.vision.rounding.error_covariance`. As the grid moves, the sum rises evenly by
    Σ w per pixel, and falls by w_t where it passes x_t. Exact coordinates x_t (..., n) are in px;
    weights w_t (..., n), such as a row of a fit's pseudo-inverse, give the result its unit.
    """
    x, w = np.broadcast_arrays(np.asarray(positions_px, float) % 1, np.asarray(weights, float))
    order = np.argsort(x, axis=-1)
    end = [(0, 0)] * (x.ndim - 1)
    passed = np.pad(np.cumsum(np.take_along_axis(w, order, -1), axis=-1), [*end, (1, 0)])
    grid = np.pad(np.take_along_axis(x, order, -1), [*end, (1, 1)], constant_values=(0, 1))
    step = np.diff(grid)
    total = passed[..., -1:]
    begin, stop = total * grid[..., :-1] - passed, total * grid[..., 1:] - passed
    mean = np.sum(step * (begin + stop) / 2, axis=-1, keepdims=True)
    begin, stop = begin - mean, stop - mean
    return np.asarray(np.sqrt(np.sum(step * (begin**2 + begin * stop + stop**2), axis=-1) / 3))


def equal_pixel_rate(
    pixels_per_second: float, n_cameras: ArrayLike, frame_rate: ArrayLike
) -> tuple[NDArray[np.int_], NDArray[np.int_], Array]:
    """Return the 16:9 sensors of cameras that share a number of pixels per second.

    Sizes are whole pixels; the frame rate compensates for that, so that N W H r is equal for all.
    For `n_cameras` at about a `frame_rate` each: width and height in px, and frames per second.
    """
    n = np.asarray(n_cameras, float)
    width = np.rint(np.sqrt(pixels_per_second * 16 / 9 / (n * np.asarray(frame_rate, float))))
    height = np.rint(width * 9 / 16)
    with np.errstate(divide="ignore"):  # for a sensor without pixels, which callers refuse
        rate = pixels_per_second / (n * width * height)
    return width.astype(int), height.astype(int), rate
