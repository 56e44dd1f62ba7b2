"""Sweeps: from which frequency to which a force goes, and whether slowly enough.

A resonance at f with damping ratio ζ answers within 1 / (2πζf) s; a sweep is in its half-power
band, 2ζf wide, for 2ζf over its speed. If that is not some times longer, it does not settle.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.signal import ShortTimeFFT

from thesis_lib.arrays import Array
from thesis_lib.measure.recordings.excitation import Sweep

SETTLED = 4.0  # times the resonance's time constant in which it settles: to e⁻⁴, 2 %
LOUD = 0.03  # of the largest power of a segment; weaker ones are before or after the sweep
PARTS = 100  # segments of a recording in which the frequency is sought


def found_sweep(newtons: Array, rate: float, given: Sweep) -> Sweep:
    """A sweep, with what is not given found in the force's strongest line over time."""
    length = max(len(newtons) // PARTS * 2, 16)
    made = ShortTimeFFT(np.hanning(length), length // 2, rate, mfft=8 * length)
    power = np.abs(made.stft_detrend(newtons, "constant")) ** 2
    loud = power.max(axis=0)
    on = np.flatnonzero(loud > LOUD * loud.max())
    line = made.f[np.argmax(power[:, on], axis=0)]
    return Sweep(
        from_hz=given.from_hz or max(float(line[0]), 1e-3),
        to_hz=given.to_hz or max(float(line[-1]), 2e-3),
        duration_s=given.duration_s or max(float(made.delta_t * (on[-1] - on[0])), 1e-3),
    )


def dwell(sweep: Sweep, frequency: float, damping: float) -> float:
    """How long a sweep of even speed is in a resonance's half-power band, s."""
    begin, end, seconds = (float(x or np.nan) for x in sweep.model_dump().values())
    return 2 * damping * frequency * seconds / abs(end - begin)


def settling(frequency: float, damping: float) -> float:
    """How long a resonance takes to settle, s."""
    return SETTLED / (2 * math.pi * damping * frequency)
