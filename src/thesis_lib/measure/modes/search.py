"""One mode after the other: the strongest line of what is left, until only noise is left."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from thesis_lib.arrays import Array
from thesis_lib.measure.modes.poles import Block, Poles, fitted, left_of
from thesis_lib.measure.modes.spectra import Spectrum, spectrum

STANDS_OUT = 4.0  # power of a line over the noise about it, from which on it is a mode
DECAYS = (0.3, 1.0, 3.0, 10.0, 30.0)  # trial decays over the length of the recording
WITHIN = 0.01  # of a given frequency, within which its line is sought
NEAR = 1.0  # of one over that length, within which two modes are not told apart


def search(
    blocks: Sequence[Block],
    band: tuple[float, float],
    most: int,
    damped: bool,
    given: Sequence[float] = (),
) -> list[Poles]:
    """Fits with one mode, two modes, … in a band in Hz, each started from the one before.

    Parameters
    ----------
    blocks : sequence of Block
        The tracks.
    band : tuple of float
        Where modes are sought, Hz.
    most : int
        Modes at most.
    damped : bool
        Whether they decay.
    given : sequence of float
        Frequencies in Hz near which modes are sought first; one that is not there is passed over.

    Returns
    -------
    list of Poles
        Empty if no line stands out of the noise.
    """
    found: list[Poles] = []
    rates = np.empty((0, 2))
    for near in (*given[:most], *[None] * most):
        line = strongest(blocks, rates, band, near)
        if len(found) < most and line is not None:
            rates = np.vstack([rates, _start(blocks, rates, 2 * np.pi * line, damped)])
            found.append(fitted(blocks, rates, damped))
            rates = found[-1].rates
        elif near is None:
            break
    return found


def reach(frequency: float, seconds: float) -> float:
    """How far in Hz from a given frequency its line is sought in a recording of some seconds."""
    return max(2 * NEAR / seconds, WITHIN * frequency)


def strongest(
    blocks: Sequence[Block], rates: Array, band: tuple[float, float], near: float | None = None
) -> float | None:
    """Frequency in Hz of the strongest line beside the poles, of those near a frequency if given.

    None if none stands out.
    """
    seen = spectrum(blocks, rates, band)
    apart = NEAR / span_of(blocks)
    clear = np.all(np.abs(seen.frequency[:, None] - rates[:, 1] / (2 * np.pi)) > apart, axis=1)
    if near is not None:
        clear &= np.abs(seen.frequency - near) <= reach(near, span_of(blocks))
    power = np.where(clear, seen.power, 0.0)
    if not power.size or not power.max() > STANDS_OUT:
        return None
    return Spectrum(seen.frequency, power).peak[0]


def beside(after: Spectrum, poles: Poles, seconds: float) -> tuple[Array, Array]:
    """Power over the noise of what is left within reach of each mode: the most, and the mean.

    Much of it tells of another mode that the recording is too short to tell apart, or of a tone
    that is not steady. What is left there disturbs a mode, not the noise at other frequencies.
    Both have the shape (modes,); of noise alone the mean is about one.
    """
    near = np.abs(after.frequency[:, None] - poles.frequency) <= 2 * NEAR / seconds
    power = after.power[:, None]
    mean = np.sum(np.where(near, power, 0.0), axis=0) / np.maximum(near.sum(axis=0), 1)
    return np.max(np.where(near, power, 0.0), axis=0), mean


def span_of(blocks: Sequence[Block]) -> float:
    """Length of the part that is fitted, s."""
    return max(float(np.ptp(block.times)) for block in blocks)


def _start(blocks: Sequence[Block], rates: Array, omega: float, damped: bool) -> Array:
    """A pole to start from: of some decays the one that leaves least."""
    if not damped:
        return np.array([0.0, omega])
    trials = [np.array([decay / span_of(blocks), omega]) for decay in DECAYS]
    left = [
        sum(float(np.sum(left_of(block, np.vstack([rates, trial])) ** 2)) for block in blocks)
        for trial in trials
    ]
    return trials[int(np.argmin(left))]
