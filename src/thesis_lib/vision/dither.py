"""Reduction of rounding errors by motion, camera shake and larger markers (beyond the thesis).

The rounding error of a coordinate x is a sawtooth with a period of one pixel,

    rint(x) − x = Σ_k (−1)ᵏ sin(2πkx) / (πk),    k = 1, 2, …

An average over frames in which x moves multiplies each sine by the characteristic function of the
motion: J₀(2πka) for a sinusoid of amplitude a sampled evenly over its phases, exp(−2π²k²s²) for
Gaussian shake of standard deviation s. Over random positions of the pixel grid each harmonic adds
half the square of its remaining amplitude.

All lengths are in px: amplitudes a of a coordinate's motion, and the standard deviation s of a
camera's shake, independent from frame to frame. Variances are over random pixel grids; arrays
broadcast.
"""

from collections.abc import Callable

import numpy as np
from scipy.special import j0, j1, jv

from thesis_lib.arrays import Array, ArrayLike
from thesis_lib.vision.pinhole import project
from thesis_lib.vision.triangulation import triangulation_gain

FRAME_VARIANCE_PX2 = 1 / 12  # variance of one rounded coordinate in px²
_HARMONIC_COUNT = 2000  # without motion or shake a mean lacks 1/(2π²k) = 2.5e-5 px²
_HARMONICS_PER_PASS = 100  # harmonics at a time, which bounds the memory
_LATTICE_RADIUS = 60  # harmonics of the plane within it are summed one by one, others on average


def mean_variance(amplitude_px: ArrayLike = 0.0, shake_px: ArrayLike = 0.0) -> Array:
    """Return the variance in px² of a rounded sinusoid's mean over infinitely many shaken frames.

    It is Σ_k J₀(2πka)² exp(−4π²k²s²) / (2π²k²), or 1/12 without motion and shake. Its root falls
    as 1/√a, and with shake soon as exp(−2π²s²) / (√2 π).
    """
    return _sum_harmonics(lambda k, a: j0(2 * np.pi * k * a) ** 2 / 2, amplitude_px, shake_px)


def amplitude_variance(amplitude_px: ArrayLike, shake_px: ArrayLike = 0.0) -> Array:
    """Return variance of a rounded sinusoid's amplitude 2⟨u cos θ⟩ from infinitely many frames.

    J₁ replaces the J₀ of the mean: Σ_k 2 J₁(2πka)² exp(−4π²k²s²) / (π²k²) px². Below half a pixel
    most grids show no motion at all, and the others too much: without shake the sum is
    16 a / (3π²) − a². It is near ζ(3) / (π⁴ a) for amplitudes of some pixels. A shake below 1e-3 px
    needs more harmonics than are summed.
    """
    total = _sum_harmonics(lambda k, a: 2 * j1(2 * np.pi * k * a) ** 2, amplitude_px, shake_px)
    a = np.abs(np.asarray(amplitude_px, float))
    closed = (a <= 0.5) & (np.asarray(shake_px) == 0)
    return np.where(closed, 16 * a / (3 * np.pi**2) - a**2, total)


def useful_frames(amplitudes_px: ArrayLike) -> Array:
    """Return the useful number of frames: 1/6 px² over the mean of :func:`amplitude_variance`.

    An amplitude fitted to n independent roundings has the variance 1/(6n) px². At this n, about
    π⁴ a / (6 ζ(3)) or 13.5 a, it equals the variance that repeated roundings leave for any n; both
    together are about twice as large. The mean is over the last axis of the amplitudes
    (..., vibrations).
    """
    return np.asarray(1 / (6 * np.mean(amplitude_variance(amplitudes_px), axis=-1)))


def shaken_variance(frames: int, shake_px: ArrayLike) -> Array:
    """Return variance of the mean over some frames of a marker at rest, seen by a shaking camera.

    One frame has the variance s² + 1/12. The part b² = Σ_k exp(−4π²k²s²) / (2π²k²) is common to all
    frames, and the remainder is averaged: b² + (s² + 1/12 − b²) / frames, in px². The shake of
    single frames is unknown.
    """
    if frames < 1:
        raise ValueError(f"frames: given {frames}, allowed: a whole number from 1")
    common = mean_variance(0.0, shake_px)
    return common + (np.square(np.asarray(shake_px, float)) + FRAME_VARIANCE_PX2 - common) / frames


def deflection_variance(
    P: ArrayLike, rest: ArrayLike, deflected: ArrayLike, shake_px: float = 0.0
) -> Array:
    """Return first-order variance in m² of an amplitude in Z from infinitely many rounded frames.

    It is Σ_j g_j² Var(a_j) over all coordinates, with the gain g_j = ∂Z/∂m_j at rest and the
    amplitude a_j of the image's motion. Points (3, ...) at rest and at the peak are in m,
    projections P have the shape (cameras, 3, 4). For one frame at rest and one deflected see
    :func:`thesis_lib.vision.rounding.deflection_variance`.
    """
    motion = np.abs(project(P, deflected) - project(P, rest))
    variance = triangulation_gain(P, rest)[2] ** 2 * amplitude_variance(motion, shake_px)
    return np.asarray(np.sum(variance, axis=(0, 1)))


def disc_variance(diameter_px: float) -> float:
    """Return the variance in px² along one axis of a black-or-white disc's centroid.

    Over random positions of the disc on the grid, to first order in its number of pixels, it is
    Σ_k J₂(πD|k|)² / (2π²|k|²) over the whole numbers k ≠ 0 of the plane. It oscillates with D;
    averaged over large D it is (0.215)² / D, where a single rounded coordinate has (0.289)².

    Raises
    ------
    ValueError
        If the diameter D is below 2.
    """
    if not 2 <= diameter_px < np.inf:
        raise ValueError(f"diameter_px: given {diameter_px}, allowed: a number from 2, in px")
    line = np.arange(-_LATTICE_RADIUS, _LATTICE_RADIUS + 1.0)
    k = np.hypot(line, line[:, None])
    k = k[(k > 0) & (k <= _LATTICE_RADIUS)]
    near = np.sum((jv(2, np.pi * diameter_px * k) / k) ** 2) / (2 * np.pi**2)
    far = 1 / (np.pi**3 * diameter_px * _LATTICE_RADIUS)  # J₂² is 1/(π²D|k|) on average
    return float(near + far)


def _sum_harmonics(
    square: Callable[[Array, Array], Array], amplitude_px: ArrayLike, shake_px: ArrayLike
) -> Array:
    """Return Σ_k square(k, a) exp(−4π²k²s²) / (π²k²)."""
    a, s = np.broadcast_arrays(np.asarray(amplitude_px, float), np.asarray(shake_px, float))
    total = np.zeros(a.shape)
    for first in range(1, _HARMONIC_COUNT + 1, _HARMONICS_PER_PASS):
        k = np.arange(first, first + _HARMONICS_PER_PASS, dtype=float).reshape(-1, *[1] * a.ndim)
        left = np.exp(-((2 * np.pi * k * s) ** 2))
        total += np.sum(square(k, a) * left / (np.pi * k) ** 2, axis=0)
    return total
