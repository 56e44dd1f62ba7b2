"""The law of rounding: expected errors of displacements in whole pixels (beyond the thesis).

Let a coordinate be rounded on a grid that is shifted by a random fraction of a pixel, uniform over
one pixel. Each rounding error then has variance 1/12 px². Two images of one marker that lie δ px
apart on the same grid have errors whose difference has variance f(1 − f), f the fractional part of
|δ|: the difference of the rounded values is one of the two whole numbers next to δ, the upper with
probability f. Whole-pixel motion is measured without error.

Gaussian noise of σ px in every image before it is rounded adds its own 2σ², and blurs f(1 − f) with
the standard deviation √2 σ of a motion: each cosine of its Fourier series 1/6 − Σ cos(2πkδ) / (πk)²
is multiplied by exp(−4π²k²σ²).
"""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from thesis_lib.arrays import Array, ArrayLike
from thesis_lib.vision.pinhole import project
from thesis_lib.vision.triangulation import triangulation_gain

_SERIES_TERMS = 1000  # of a Fourier series


def grid_shifts(seed: int, trials: int, n_cameras: int, first: int = 0) -> Array:
    """Return the shifts of the cameras' pixel grids, a function of (seed, trial, camera) alone.

    Parameters
    ----------
    seed, trials, n_cameras : int
        Seed, last trial, number of cameras.
    first : int
        First trial to return.

    Returns
    -------
    ndarray, shape (trials + 1 - first, n_cameras, 2)
        Shifts in px, uniform in ±½; trial 0 is the nominal run and has none.
    """
    return _cached_shifts(seed, trials, n_cameras, first).copy()


@lru_cache(maxsize=32)
def _cached_shifts(seed: int, trials: int, n_cameras: int, first: int) -> Array:
    """Return the shifts, cached as settings with equally many cameras share them."""
    shifts = np.zeros((trials + 1 - first, n_cameras, 2))
    for trial in range(max(first, 1), trials + 1):
        # Philox is counter-based: each trial has its own stream, each camera a position in it.
        stream = np.random.Generator(np.random.Philox(key=[seed, trial]))
        shifts[trial - first] = stream.random((n_cameras, 2)) - 0.5
    return shifts


def image_noise(
    seed: int, trials: int, modes: Sequence[int], n_cameras: int, markers: int, first: int = 0
) -> Array:
    """Draw standard normal image noise, a function of (seed, trial, mode) and array index alone.

    The frames are at rest and in the modes of given numbers, the trials from `first` to the last:
    shape (trials + 1 - first, n_cameras, 2, 1 + modes, markers). The nominal run has noise, too.
    """
    frames = [0, *modes]
    noise = np.empty((trials + 1 - first, n_cameras, 2, len(frames), markers))
    for trial, part in enumerate(noise, start=first):
        for i, frame in enumerate(frames):
            # a part of the trial's stream that the shifts do not use, one for each frame
            stream = np.random.Philox(key=[seed, trial], counter=[0, 0, 0, 1 + frame])
            part[:, :, i] = np.random.Generator(stream).standard_normal((n_cameras, 2, markers))
    return noise


def difference_variance(displacement_px: ArrayLike) -> Array:
    """Return the variance f(1 − f) in px² of the rounding error of a displacement, f = frac |δ|."""
    delta = np.asarray(displacement_px, float)
    f = np.abs(delta - np.rint(delta))  # or 1 − f, which gives the same
    return f * (1 - f)


def noisy_difference_variance(displacement_px: ArrayLike, noise_px: float) -> Array:
    """Average f(1 − f) in px² over the noise of both images, without the noise's own 2σ².

    For noise below 1/1000 px the truncated series omits 1e-4 px².
    """
    if noise_px == 0:
        return difference_variance(displacement_px)
    k = np.arange(1, min(np.ceil(1 / noise_px), _SERIES_TERMS) + 1)
    terms = -np.exp(-((2 * np.pi * k * noise_px) ** 2)) / (np.pi * k) ** 2
    cosine = np.cos(2 * np.pi * np.asarray(displacement_px, float))
    return np.asarray(np.polynomial.chebyshev.chebval(cosine, [1 / 6, *terms]))


def mean_difference_variance(displacement_px: ArrayLike, least: float, most: float) -> Array:
    """Average f(1 − f) in px² over motions from `least` to `most` times a displacement.

    It tends to 1/6 for a range of many pixels, and to 0 without motion. It uses the integral of
    f(1 − f) from 0 to x, ⌊x⌋/6 + f²/2 − f³/3.
    """
    delta = np.abs(np.asarray(displacement_px, float))

    def total(x: Array) -> Array:
        whole = np.floor(x)
        f = x - whole
        return np.asarray(whole / 6 + f**2 / 2 - f**3 / 3)

    span = (most - least) * delta
    rise = total(most * delta) - total(least * delta)
    # Over a narrow range the difference of integrals is round-off, and f(1 − f) nearly constant.
    small = span < 1e-6
    middle = difference_variance((least + most) / 2 * delta)
    return np.where(small, middle, rise / np.where(small, 1, span))


def deflection_variance(
    P: ArrayLike,
    rest: ArrayLike,
    deflected: ArrayLike,
    rest_is_known: bool = False,
    normals: ArrayLike | None = None,
    noise_px: float = 0.0,
) -> Array:
    """Return first-order variance of the measured deflection Z − Z_rest over random grid shifts.

    With g = ∂Z/∂m of the refined point at rest (r) and deflected (d), a coordinate adds
    Var(g_d ε_d − g_r ε_r) = (g_d − g_r)²/12 + g_d g_r f(1 − f), or g_d²/12 if the rest position
    is known.

    Parameters
    ----------
    P : array_like, shape (cameras, 3, 4)
        Projection matrices.
    rest, deflected : array_like, shape (3, ...)
        World points in m.
    rest_is_known : bool
        Whether the rest position is known rather than triangulated from rounded pixels.
    normals : array_like, shape (3, ...), optional
        Unit vectors along which deflections are measured, in place of Z.
    noise_px : float
        Standard deviation σ of every image before it is rounded; it adds g_d² σ² + g_r² σ².

    Returns
    -------
    ndarray, shape (...)
        Variance in m².
    """
    g_d = _project_gains(triangulation_gain(P, deflected), normals)
    if rest_is_known:
        squares = np.sum(g_d**2, axis=(0, 1))
        return np.asarray(squares / 12 + noise_px**2 * squares)
    g_r = _project_gains(triangulation_gain(P, rest), normals)
    f = noisy_difference_variance(project(P, deflected) - project(P, rest), noise_px)
    rounded = np.sum((g_d - g_r) ** 2 / 12 + g_d * g_r * f, axis=(0, 1))
    return np.asarray(rounded + noise_px**2 * np.sum(g_d**2 + g_r**2, axis=(0, 1)))


def _project_gains(gains: Array, normals: ArrayLike | None) -> Array:
    """Project points' gains (3, cameras, 2, ...) on Z or on normals."""
    if normals is None:
        return np.asarray(gains[2])
    return np.asarray(np.sum(gains * np.asarray(normals, float)[:, None, None], axis=0))


def error_covariance(distance_px: ArrayLike, noise_px: float = 0.0) -> Array:
    """Return 1/12 − f(1 − f)/2 in px², the covariance of two rounding errors on one grid.

    `distance_px` is the distance of their coordinates, f its fractional part: both errors are the
    same sawtooth of the grid's shift, with an offset. Noise is independent between coordinates.
    """
    return 1 / 12 - noisy_difference_variance(distance_px, noise_px) / 2


def deflection_covariance(
    P: ArrayLike,
    rest: ArrayLike,
    deflected: ArrayLike,
    rest_is_known: bool = False,
    noise_px: float = 0.0,
) -> Array:
    """Return the markers' deflection covariance over random grid shifts, to first order.

    All images in one coordinate of one camera share its shift, so their rounding errors are
    correlated; this matters where markers are summed, as for sound. The diagonal is
    :func:`deflection_variance`.

    Parameters
    ----------
    P : array_like, shape (cameras, 3, 4)
        Projection matrices.
    rest, deflected : array_like, shape (3, markers)
        World points in m.
    rest_is_known : bool
        Whether the rest position is known rather than triangulated from rounded pixels.
    noise_px : float
        Standard deviation of every image before it is rounded.

    Returns
    -------
    ndarray, shape (markers, markers)
        Covariance in m².
    """
    points = np.stack([np.asarray(deflected, float), np.asarray(rest, float)], axis=1)
    signs = np.array([1.0, -1.0])
    if rest_is_known:
        points, signs = points[:, :1], signs[:1]
    n_markers = points.shape[2]
    images = project(P, points).reshape(-1, len(signs) * n_markers)
    gains = (triangulation_gain(P, points)[2] * signs[:, None]).reshape(images.shape)
    total = np.zeros((images.shape[1],) * 2)
    for a, g in zip(images, gains, strict=True):
        total += error_covariance(a[:, None] - a, noise_px) * (g[:, None] * g)
    if noise_px:  # on the diagonal an error is correlated with itself, noise included
        own = noise_px**2 + noisy_difference_variance(0.0, noise_px) / 2
        total += np.diag(own * np.sum(gains**2, axis=0))
    return total.reshape(len(signs), n_markers, len(signs), n_markers).sum(axis=(0, 2))
