"""Clocks by several modes: starts that are off, and clocks that run fast.

A camera that starts later than was thought sees every mode late, by a phase that grows with its
frequency. Several modes tell how much, beyond the period of any one of them.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from thesis_lib.arrays import Array
from thesis_lib.measure.fitting.clocks import CERTAIN, LEAST_TURN
from thesis_lib.measure.modes.poles import Poles
from thesis_lib.measure.modes.shapes import Shape

THOUGHT = 0.01  # s by which starts are thought to be off at most, rather
WORST = 100.0  # of a phase's square over its error's that counts: one mode alone decides nothing
ROUGH = 0.003  # rad by which phases are off beside what noise does


def lags(found: Sequence[Shape], poles: Poles) -> tuple[Array, Array]:
    """By how much cameras start later than was thought, where that is certain, and errors, s."""
    omega = poles.rates[:, 1]
    turn = np.array([shape.turn for shape in found])
    error = np.hypot([shape.turn_deviation for shape in found], ROUGH)
    best = np.zeros(turn.shape[1])
    for c in range(1, turn.shape[1]):
        known = np.isfinite(turn[:, c]) & np.isfinite(error[:, c])
        w, phase, sigma = omega[known], turn[known, c], error[known, c]
        if not known.any():
            continue
        periods = np.arange(-20, 21)
        trials = ((phase[:, None] + 2 * np.pi * periods) / w[:, None]).ravel()
        off = (phase - np.outer(trials, w) + np.pi) % (2 * np.pi) - np.pi
        cost = np.sum(np.minimum((off / sigma) ** 2, WORST), axis=1) + (trials / THOUGHT) ** 2
        k = int(np.argmin(cost))
        best[c] = trials[k] + np.sum(w * off[k] / sigma**2) / np.sum((w / sigma) ** 2)
    with np.errstate(divide="ignore"):
        errors = 1 / np.sqrt(np.nansum((omega[:, None] / error) ** 2, axis=0))
    errors[0] = 0.0
    certain = np.abs(best) > np.maximum(CERTAIN * errors, LEAST_TURN / omega.max())
    return np.where(certain, best, 0.0), errors


def paces(poles: Poles, span: float) -> Array:
    """How much faster than the first camera's the clocks run, where that is certain; relative.

    All modes are higher by the same share to a camera whose clock runs slow.
    """
    omega = poles.rates[:, 1]
    change, error = poles.each[:, 1::2] / omega, poles.each_deviation[:, 1::2] / omega
    weight = 1 / error**2
    high = np.sum(weight * change, axis=1) / np.sum(weight, axis=1)
    deviation = 1 / np.sqrt(np.sum(weight, axis=1))
    fast = high[0] - high
    enough = np.maximum(
        CERTAIN * np.hypot(deviation, deviation[0]), LEAST_TURN / omega.max() / span
    )
    return np.where(np.abs(fast) > enough, fast, 0.0)
