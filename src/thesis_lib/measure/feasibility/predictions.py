"""Closed forms for what cameras can show: alias, errors of deflections."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from thesis_lib.arrays import Array, Mask
from thesis_lib.vision.rounding import deflection_variance
from thesis_lib.vision.triangulation import gain


def alias(frequency: float, rate: float) -> float:
    """Frequency |f − r round(f/r)| in Hz at which frames of rate r show f."""
    return float(abs(frequency - rate * np.rint(frequency / rate)))


def noise_errors(
    P: ArrayLike, points: ArrayLike, sigma: ArrayLike, seen: Mask | None = None
) -> Array:
    """Standard errors √Σ (∂Z/∂m σ)² of heights for centre noise, shape (n,), m.

    For the amplitude of a harmonic fit to N frames, σ is √(2/N) times that of one.

    Parameters
    ----------
    P : array_like, shape (cameras, 3, 4)
        Projection matrices.
    points : array_like, shape (3, n)
        World points, m.
    sigma : array_like, shape (cameras,)
        Noise of each camera's coordinates, px.
    seen : ndarray of bool, shape (cameras, n), optional
        Which camera sees which point; NaN where fewer than two do.
    """

    def errors(P: Array, X: Array, which: Mask) -> Array:
        each = gain(P, X)[2] * np.asarray(sigma, float)[which, None, None]
        return np.asarray(np.sqrt(np.sum(each**2, axis=(0, 1))))

    return _by_view(P, points, seen, errors)


def rounding_errors(
    P: ArrayLike, points: ArrayLike, amplitude: float, turn: float = 0.0, seen: Mask | None = None
) -> Array:
    """Root mean square errors of whole-pixel centres by the law of rounding, shape (n,), m.

    The frame nearest to a maximum shows A cos ψ, with ψ uniform in ±turn/2.

    Parameters
    ----------
    P, points, seen
        As in :func:`noise_errors`.
    amplitude : float
        A, m.
    turn : float
        Angle of the vibration from frame to frame, rad.
    """
    up = np.zeros((3, 16, 1))
    up[2, :, 0] = amplitude * np.cos((np.arange(16) + 0.5) / 16 * turn / 2)

    def errors(P: Array, X: Array, which: Mask) -> Array:
        variance = deflection_variance(P, X[:, None], X[:, None] + up).mean(axis=0)
        return np.asarray(np.sqrt(np.maximum(variance, 0)))

    return _by_view(P, points, seen, errors)


def _by_view(
    P: ArrayLike,
    points: ArrayLike,
    seen: Mask | None,
    errors: Callable[[Array, Array, Mask], Array],
) -> Array:
    """Errors of points, each from the cameras that see it; infinite where these stand in line."""
    P, X = np.asarray(P, float), np.asarray(points, float)
    visible = np.ones((len(P), X.shape[1]), bool) if seen is None else seen
    result = np.full(X.shape[1], np.nan)
    for pattern in np.unique(visible, axis=1).T:
        if np.count_nonzero(pattern) >= 2:
            where = (visible == pattern[:, None]).all(axis=0)
            try:
                result[where] = errors(P[pattern], X[:, where], pattern)
            except np.linalg.LinAlgError:
                result[where] = np.inf
    return result
