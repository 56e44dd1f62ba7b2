"""Where modes may be: the spectrum of all cameras together, over true frequencies.

A tone of f shows in a camera's frames at its alias. Taken at the times of the frames, e^{−2πjft}
finds it there whatever f is; so all cameras, even of unlike rates, have a line at the true
frequency, and there alone: the geometric mean of their powers over noise tells. Times are put on a
grid so fine that an ordinary Fourier transform serves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.fft import next_fast_len, rfft

from thesis_lib.arrays import Array
from thesis_lib.measure.modes.poles import Block, left_of

FINE = 8  # grid points between frames; and in a period of the highest frequency
TINY = 1e-12
SERIES = 16  # principal motions of a camera's markers whose powers are summed
PAD = 4  # points of the spectrum in one over the length of the recording


@dataclass(frozen=True)
class Spectrum:
    """Power over frequency of what is left."""

    frequency: Array  #: Hz
    power: Array  #: Over the noise, each camera's median; the geometric mean of all cameras

    @property
    def peak(self) -> tuple[float, float]:
        """Frequency of the strongest line in Hz, the lowest of equals, and its power over noise."""
        top = float(self.power.max())
        first = int(np.flatnonzero(self.power >= 0.98 * top)[0])
        last = first
        while last + 1 < len(self.power) and self.power[last + 1] >= self.power[last]:
            last += 1
        return float(self.frequency[last]), top


def spectrum(blocks: Sequence[Block], rates: Array, band: tuple[float, float]) -> Spectrum:
    """The spectrum in a band in Hz of what the poles leave of the tracks."""
    span = max(float(np.ptp(block.times)) for block in blocks)
    even = np.arange(band[0], band[1], 1 / (PAD * span))
    logs = np.zeros_like(even)
    for block in blocks:
        left = left_of(block, rates)
        left = left @ np.linalg.eigh(left.T @ left)[1][:, -SERIES:]  # the strongest motions
        step = float(np.median(np.diff(block.times))) / FINE
        step /= max(1, int(np.ceil(band[1] * FINE * step)))
        place = np.rint((block.times - block.times[0]) / step).astype(int)
        length = next_fast_len(max(int(PAD * span / step), place[-1] + 1))
        lines = np.zeros(length // 2 + 1)
        for series in left.T:
            grid = np.bincount(place, series, length).astype(np.float32)
            lines += np.abs(rfft(grid)) ** 2 / len(block.times)
        own = np.interp(even, np.arange(len(lines)) / (length * step), lines)
        logs += np.log(np.maximum(own / max(float(np.median(own)), TINY), TINY))
    return Spectrum(even, np.exp(logs / len(blocks)))
