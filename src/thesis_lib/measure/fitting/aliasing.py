"""Frequencies that are too high for the frames: where they show, and what mistaking them costs.

Frames at a rate r cannot tell a frequency f from |f − kr|, k = 1, 2 …, and mirror it where it lies
above half of the rate.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from thesis_lib.arrays import Array

TRIALS_PER_LINE = 8  # trial frequencies in one over the length of the recording


def fold_frequency(frequency: ArrayLike, rate: ArrayLike) -> Array:
    """Return the frequency in Hz at which another appears below half of the frame rate.

    Examples
    --------
    >>> [float(fold_frequency(hertz, 60.0)) for hertz in (110.0, 40.0, 25.0)]
    [10.0, 20.0, 25.0]
    """
    f, rate = np.asarray(frequency, float), np.asarray(rate, float)
    return np.asarray(np.abs(f - rate * np.rint(f / rate)), float)


def list_aliases(alias_hz: float, rate: float, highest_hz: float) -> Array:
    """List the frequencies in Hz, up to a highest, that frames at a rate show alike."""
    k = np.arange(int(np.ceil(highest_hz / rate)) + 1)
    every = np.unique(np.abs(np.concatenate([alias_hz + k * rate, alias_hz - k * rate])))
    kept: Array = every[every <= highest_hz]
    return kept


def alias_clearance(frequency: float, rate: float, frames: int) -> float:
    """Return by how many periods an alias stays away from 0 and half of the rate.

    Below a half, frames hardly tell the vibration's two parts, in phase and in quadrature, from
    each other or from rest.
    """
    shown = float(fold_frequency(frequency, rate))
    return min(shown, rate / 2 - shown) * frames / rate


def scan_frequencies(rate: float, frames: int) -> Array:
    """Return frequencies to scan in Hz, half a period away from 0 and from half of the rate."""
    least = 0.5 * rate / frames
    return np.linspace(least, rate / 2 - least, TRIALS_PER_LINE * frames // 2)


def detuning_loss(cycles: ArrayLike, frames: int) -> Array:
    """Return the share of an amplitude lost by a frequency wrong by cycles per recording.

    The mean of e^{2πjcn/N} over N frames, one less its modulus; near 1 − sinc(c).
    """
    c = np.asarray(cycles, float)
    n = np.arange(frames) - (frames - 1) / 2
    return np.asarray(1 - np.abs(np.mean(np.exp(2j * np.pi * c[..., None] * n / frames), -1)))
