"""The law of rounding: what whole pixels do to a displacement, in expectation (beyond the thesis).

Let a coordinate be rounded on a grid that is shifted by a random fraction of a pixel, uniform over
one pixel. Each rounding error then has variance 1/12 px². Two images of one marker that lie δ px
apart on the same grid have errors whose difference has variance f(1 − f), f the fractional part of
|δ|: the difference of the rounded values is one of the two whole numbers next to δ, the upper with
probability f. Whole-pixel motion is measured without error.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from thesis_lib.cameras import project
from thesis_lib.triangulation import gain

Array = NDArray[np.float64]


def grid_shifts(seed: int, trials: int, n_cameras: int) -> Array:
    """Shifts of the cameras' pixel grids, a function of (seed, trial, camera) alone.

    Returns
    -------
    ndarray, shape (trials + 1, n_cameras, 2)
        Shifts in px, uniform in ±½; trial 0 is the literal run and has none.
    """
    shifts = np.zeros((trials + 1, n_cameras, 2))
    for trial in range(1, trials + 1):
        # Philox is counter-based: the trial is its own stream, the camera the place in it.
        stream = np.random.Generator(np.random.Philox(key=[seed, trial]))
        shifts[trial] = stream.random((n_cameras, 2)) - 0.5
    return shifts


def difference_variance(displacement_px: ArrayLike) -> Array:
    """Variance f(1 − f) in px² of the rounding error of a displacement, f = frac |δ|."""
    f = np.mod(np.abs(np.asarray(displacement_px, float)), 1.0)
    return f * (1 - f)


def deflection_variance(
    P: ArrayLike, rest: ArrayLike, deflected: ArrayLike, rest_is_known: bool = False
) -> Array:
    """First-order variance of the measured deflection Z − Z_rest over random grid shifts.

    With g = ∂Z/∂m of the refined point at rest (r) and deflected (d), a coordinate adds
    Var(g_d ε_d − g_r ε_r) = (g_d − g_r)²/12 + g_d g_r f(1 − f), and g_d²/12 if the rest position
    is known.

    Parameters
    ----------
    P : array_like, shape (cameras, 3, 4)
        Projection matrices.
    rest, deflected : array_like, shape (3, ...)
        World points in m.
    rest_is_known : bool
        Whether the rest position is known rather than rebuilt from rounded pixels.

    Returns
    -------
    ndarray, shape (...)
        Variance in m².
    """
    g_d = gain(P, deflected)[2]
    if rest_is_known:
        return np.asarray(np.sum(g_d**2, axis=(0, 1)) / 12)
    g_r = gain(P, rest)[2]
    f = difference_variance(project(P, deflected) - project(P, rest))
    return np.asarray(np.sum((g_d - g_r) ** 2 / 12 + g_d * g_r * f, axis=(0, 1)))
