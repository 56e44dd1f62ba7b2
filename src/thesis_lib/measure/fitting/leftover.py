"""What one vibration leaves of the tracks: another tone, a camera that was touched."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce
from operator import add

import numpy as np

from thesis_lib.measure.fitting.frequency import FrequencyError, liveliest
from thesis_lib.measure.fitting.harmonics import Harmonics, basis, fit_harmonics
from thesis_lib.measure.tracking.tracks import Recording

TELLING = 40.0  # times the mean power of what is left that a tone's must be
ENOUGH = 2048  # frames in which another tone is sought
FEW = 8  # image coordinates of each camera that are looked at
BUMP = 0.1  # px by which a whole picture must jump
CLEAR = 8.0  # standard errors that it must jump by
MOST = 4096  # frames that are looked at
EDGE = 5  # frames before and after a jump, at least
NOTHING = 0.05  # share of the motion below which a frequency explains none of it


@dataclass(frozen=True)
class Share:
    """How much of the motion one frequency explains, and where the rest is."""

    explained: float  #: Share of the variance of the image coordinates that move most
    frequency: float  #: Of the strongest other tone, Hz; NaN if there is none
    ratio: float  #: Its amplitude over that of the vibration; 0 if there is none


def share(
    recordings: Sequence[Recording], begin: float, end: float, frequency: float, order: int
) -> Share:
    """What a frequency and its harmonics explain of the motion in the steady part."""
    series = []
    for own in recordings:
        with contextlib.suppress(FrequencyError):  # one that lost its markers
            t, values = liveliest(own, begin, end, ENOUGH)
            series.append((t, values[:, -FEW:].copy()))
    if not series:
        return Share(np.nan, np.nan, 0.0)
    total = left = 0.0
    length = min(float(times[-1] - times[0]) for times, _ in series)
    highest = 0.5 * min(own.rate for own in recordings)
    grid = np.arange(1 / length, highest, 1 / (4 * length))
    power, counted = np.zeros_like(grid), 0
    for times, values in series:
        fit = fit_harmonics(2 * np.pi * frequency, times, values, order)
        rest = np.nan_to_num(values - fit.at(2 * np.pi * frequency, times))
        values = np.nan_to_num(values)
        total += float(np.sum((values - values.mean(axis=0)) ** 2)) / len(times)
        left += float(np.sum(rest**2)) / len(times)
        step = (times[-1] - times[0]) / (len(times) - 1)
        n = 1 << int(np.ceil(np.log2(8 * len(times))))
        lines = (np.abs(np.fft.rfft(one, n)) ** 2 for one in rest.T)  # one at a time, for memory
        spectrum = reduce(add, lines) / len(times) ** 2
        power += np.interp(grid, np.fft.rfftfreq(n, step), spectrum)
        counted = max(counted, len(times))
    if not total or not len(grid):
        return Share(np.nan, np.nan, 0.0)
    explained = 1 - left / total
    peak = int(np.argmax(power))
    tone = 4 * float(power[peak]) / 2  # variance of a sinusoid from its line in the spectrum
    if tone < TELLING * left / counted:
        return Share(explained, np.nan, 0.0)
    fitted = max(total - left, 1e-4 * tone)  # what fits by chance, if nothing else does
    return Share(explained, float(grid[peak]), float(np.sqrt(tone / fitted)))


def bump(
    own: Recording, fit: Harmonics, omega: float, begin: float, end: float
) -> tuple[float, float]:
    """By how much all that a camera sees jumped, px, and when, s; 0 and NaN if it did not."""
    order = (len(fit.coefficients) - 1) // 2
    first, last = own.between(begin, end)
    every = -(-(last - first) // MOST)  # of a long recording some frames tell
    times, common = [], []
    for t, uv in ((t[::every], uv[::every]) for t, uv in own.parts(begin, end)):
        rest = uv - np.tensordot(basis(omega, t, order), fit.coefficients, axes=1)
        seen = np.isfinite(rest).any(axis=(1, 2))
        times.append(t[seen])
        common.append(np.nanmedian(rest[seen], axis=2))
    moved = np.concatenate(common) if common else np.zeros((0, 2))
    known = np.isfinite(moved).all(axis=1)
    when, moved = np.concatenate(times)[known] if times else np.zeros(0), moved[known]
    n = len(moved)
    if n < 4 * EDGE:
        return 0.0, np.nan
    before = np.arange(EDGE, n - EDGE)
    sums = np.cumsum(moved, axis=0)
    jump = (sums[-1] - sums[before - 1]) / (n - before)[:, None] - sums[before - 1] / before[
        :, None
    ]
    size = np.hypot(*jump.T)
    weight = np.sqrt(before * (n - before) / n)
    k = int(np.argmax(size * weight))
    white = 1.05 * np.median(np.hypot(*np.diff(moved, axis=0).T)) / np.sqrt(2)
    if size[k] < max(BUMP, CLEAR * white / weight[k]):
        return 0.0, np.nan
    return float(size[k]), float(when[before[k]])


def check_explained(tone: Share, given: float) -> None:
    """Refuse a frequency in Hz that is given and explains nothing of a motion that has another.

    Raises
    ------
    FrequencyError
        If it does, with the other frequency.
    """
    if tone.explained < NOTHING and tone.ratio > 1:
        raise FrequencyError(
            f"excitation.frequency_hz: given {given:.6g}, which explains "
            f"{max(tone.explained, 0):.1%} of the motion; most of it is near {tone.frequency:.3g} "
            "Hz: allowed: the frequency of the motion, or null"
        )
