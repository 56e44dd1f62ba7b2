"""How the clocks of two recordings drift apart, from windows of their sound.

With Tᵢ the start of a recording and δ the share by which its clock is fast, what happens at T has
the time t = (1 + δ)(T − Tᵢ) in it. So what is at t in the one is at t + delay − δt in the
reference: a straight line through the delays of windows tells both.

A window's correlation has several peaks where sound reverberates or repeats; the line is that
which most of the windows have a peak on. Windows are compared as they are left by
:func:`~thesis_lib.measure.synchronisation.transients.design_whitening`, so that neither hum nor a
note has a peak at each of its periods.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import oaconvolve

from thesis_lib.arrays import Array, IntArray, Signal
from thesis_lib.measure.synchronisation.delays import (
    Match,
    correlation_coefficient,
    interpolate_peak,
)
from thesis_lib.measure.synchronisation.transients import (
    WHITENING_BINS,
    WHITENING_DELAY,
    design_whitening,
)

WINDOW_S = 1.0  # s
HOP_S = 0.005  # s of a step of loudness
MAX_COMPARED_S = 300.0  # s from the start whose loudness is compared
MIN_COMMON_S = 3.0  # s that sounds have in common at least
MIN_PEAK_DISTANCE_S, MAX_SECOND_PEAK_RATIO = (
    0.05,
    0.7,
)  # s from the highest peak, and share of it, that no other may reach
MAX_CANDIDATES = 12  # peaks of the loudness's correlation that are looked into at most
WINDOW_SEARCH_S = 0.05  # s about the delay that was found, in which a window's is sought
MAX_DRIFT = 2e-4  # most that clocks of cameras are apart, relative
MAX_SHORT_DRIFT = 1e-3  # most that is looked for where the sounds are short
# Times 1/√n, by which unlike sounds correlate, that a window's correlation must be
MIN_CORRELATION_SIGMAS = 6.0
PEAKS_PER_WINDOW = 3  # of each window that the line is sought through
ON_LINE = 2.5e-4  # s that a window's peak may be from the line: 9 cm of a sound's way
MAX_LINE_DEVIATIONS = 4.0  # times the middle deviation from the line
MIN_WINDOWS = 3  # windows that a drift is told from
INTERPOLATION_FACTOR = 16  # times finer than samples at which a peak is interpolated
INTERPOLATION_SAMPLES = 12  # samples on either side that it is interpolated from
MIN_PEAK_STD_SAMPLES = 0.005  # samples by which a peak between samples errs at least

_INTERPOLATION_POINTS = np.arange(-INTERPOLATION_FACTOR, INTERPOLATION_FACTOR + 1)[
    :, None
] / INTERPOLATION_FACTOR - np.arange(-INTERPOLATION_SAMPLES, INTERPOLATION_SAMPLES + 1)
_INTERPOLATION_WEIGHTS = (
    np.sinc(_INTERPOLATION_POINTS)
    * np.cos(np.pi * _INTERPOLATION_POINTS / (2 * INTERPOLATION_SAMPLES + 4)) ** 2
)


@dataclass(frozen=True)
class Drift:
    """Start and clock of a recording, beside those of the reference."""

    delay: float  #: Start after the reference's, s
    delay_deviation: float  #: Its standard error, s; NaN if it rests on too few windows
    #: By how much its seconds are too short, relative; NaN if it rests on too few windows
    drift: float
    drift_deviation: float  #: Its standard error
    times: Array  #: Middles of the windows that count, on its own clock, s, shape (windows,)
    delays: Array  #: What they show, s, shape (windows,)
    agreement: float = 0.0  #: Share of the windows with a peak that have one on the line
    #: Sum of the correlations of the windows on the line, over the root of all windows' number
    score: float = 0.0
    #: The drift of the samples at the rates that the files state; their time stamps tell another
    sample_drift: float = np.nan

    @property
    def fast(self) -> float:
        """By how much its clock is fast in its seconds per one of the reference's, relative."""
        return self.drift / (1 - self.drift)


def loudness_match(reference: Signal, other: Signal, rate: float) -> Match:
    """Return the delay in s between sounds by their loudness.

    Loudness is so slow that clocks which drift apart do not blur it.
    """
    lags, c, height = _loudness_heights(reference, other, rate)
    top = int(np.argmax(height))
    rest = np.abs(lags - lags[top]) > round(MIN_PEAK_DISTANCE_S / HOP_S)
    second = float(height[rest].max(initial=0.0))
    ratio = second / max(float(height[top]), 1e-12)
    return Match(
        delay=float(HOP_S * interpolate_peak(lags, c, top)),
        peak=float(height[top]),
        ratio=ratio,
        threshold=MAX_SECOND_PEAK_RATIO,
        period=None,
        ambiguous=ratio >= MAX_SECOND_PEAK_RATIO,
        snr=np.nan,
        least=MIN_CORRELATION_SIGMAS,
    )


def loudness_candidates(reference: Signal, other: Signal, rate: float) -> list[float]:
    """Find the delays in s at which the loudness of two sounds is alike, the likeliest first."""
    lags, c, height = _loudness_heights(reference, other, rate)
    found: list[float] = []
    least = MAX_SECOND_PEAK_RATIO * float(height.max(initial=0.0))
    while len(found) < MAX_CANDIDATES and height.max(initial=0.0) > least:
        top = int(np.argmax(height))
        found.append(float(HOP_S * interpolate_peak(lags, c, top)))
        height[np.abs(lags - lags[top]) <= round(MIN_PEAK_DISTANCE_S / HOP_S)] = 0.0
    return found


def _loudness_heights(
    reference: Signal, other: Signal, rate: float
) -> tuple[IntArray, Array, Array]:
    """Return lags, correlation of the loudness, and how far that is above chance."""
    a, b = (_loudness(sound, rate) for sound in (reference, other))
    most = max(len(a), len(b)) - min(len(a), len(b), round(MIN_COMMON_S / HOP_S))
    lags, c = correlation_coefficient(a, b, most)
    overlap = np.minimum(lags + len(b), len(a)) - np.maximum(lags, 0)
    enough = overlap > round(MIN_COMMON_S / HOP_S) / 2
    return lags, c, np.where(enough, c * np.sqrt(np.maximum(overlap, 0)), 0.0)


def _loudness(sound: Signal, rate: float) -> Array:
    """Return the logarithm of the energy of what is high in a sound, in steps of `HOP`."""
    n = round(HOP_S * rate)
    high = np.diff(sound[: round(MAX_COMPARED_S * rate)].astype(float))
    energy = np.square(high[: len(high) // n * n]).reshape(-1, n).mean(axis=1)
    level = np.log(energy + 1e-3 * energy.mean() + 1e-30)
    return np.asarray(level - level.mean(), float)


def drift_of(
    reference: Signal, other: Signal, rate: float, starts: tuple[float, float], delay: float
) -> Drift:
    """Return the line through the delays of windows.

    Parameters
    ----------
    reference, other : ndarray, shape (samples of each,)
        The sounds.
    rate : float
        Their sample rate in Hz.
    starts : tuple of float
        Times of their first samples in the recordings, s.
    delay : float
        Start of the other after the reference, as found from the whole, s.

    Returns
    -------
    Drift
    """
    if min(len(reference), len(other)) <= 2 * WHITENING_BINS:
        return _nothing(delay)
    taps = design_whitening(reference, rate), design_whitening(other, rate)
    n = round(WINDOW_S * rate)
    most = round((WINDOW_SEARCH_S + MAX_DRIFT * len(other) / rate) * rate)
    peaks: list[tuple[int, float, float]] = []  # window, delay, correlation
    times: list[float] = []
    for first in range(0, len(other) - n - WHITENING_BINS + 2, n):
        at = round((starts[1] + first / rate + delay - starts[0]) * rate)
        low, high = at - most, at + n + WHITENING_BINS - 1 + most
        if low < 0 or high > len(reference):
            continue
        one = oaconvolve(reference[low:high], taps[0], "valid")
        two = oaconvolve(other[first : first + n + WHITENING_BINS - 1], taps[1], "valid")
        lags, c = correlation_coefficient(one, two, 2 * most)
        whole = (lags >= 0) & (lags <= 2 * most)  # where the window is inside
        lags, c = lags[whole], c[whole]
        for top in _tops(np.abs(c), MIN_CORRELATION_SIGMAS / np.sqrt(n)):
            here = low + int(lags[top]) + _vertex(np.sign(c[top]) * c, top)
            own = starts[0] + here / rate - (starts[1] + first / rate)
            peaks.append((len(times), own, float(c[top])))
        times.append(starts[1] + (first + WHITENING_DELAY + n / 2) / rate)
    if not peaks:
        return _nothing(delay)
    window = np.array([peak[0] for peak in peaks])
    late, height = np.array([peak[1:] for peak in peaks]).T
    when = np.array(times)
    on = _on_line(window, when[window], late - delay, height)
    found = _line(
        when[window[on]], late[on], np.abs(height[on]), delay, MIN_PEAK_STD_SAMPLES / rate
    )
    return replace(
        found,
        agreement=len(on) / len(np.unique(window)),
        score=float(np.abs(height[on]).sum() / np.sqrt(len(times))),
    )


def _nothing(delay: float) -> Drift:
    return Drift(delay, np.nan, np.nan, np.nan, np.array([]), np.array([]))


def _tops(c: Array, least: float) -> IntArray:
    """Find the highest peaks of a window's correlation that are above chance."""
    inner = c[1:-1]
    peak = (inner >= c[:-2]) & (inner > c[2:]) & (inner >= least)
    places = np.flatnonzero(peak) + 1
    return places[np.argsort(c[places])[::-1][:PEAKS_PER_WINDOW]]


def _on_line(window: IntArray, when: Array, late: Array, height: Array) -> IntArray:
    """Choose a peak of each window that has one on the line with most of them; one sign alone."""
    span = max(float(np.ptp(when)), WINDOW_S)
    middle, turn = when.mean(), min(WINDOW_SEARCH_S + MAX_DRIFT * span, MAX_SHORT_DRIFT * span)
    slopes = np.arange(-turn, turn + ON_LINE, ON_LINE) / span
    best, chosen = -1.0, np.array([], int)
    for sign in (1.0, -1.0):
        own = np.flatnonzero(sign * height > 0)
        if not len(own):
            continue
        for slope in slopes:
            off = late[own] - slope * (when[own] - middle)
            order = np.argsort(off)
            sums = np.concatenate([[0], np.cumsum(np.abs(height[own])[order])])
            ends = np.searchsorted(off[order], off[order] + 2 * ON_LINE, "right")
            inside = sums[ends] - sums[:-1]
            if inside.max() > best:
                k = int(np.argmax(inside))
                best, chosen = float(inside[k]), own[order[k : ends[k]]]
    highest = chosen[np.argsort(-np.abs(height[chosen]), kind="stable")]
    _, first = np.unique(window[highest], return_index=True)
    return highest[first]


def _vertex(c: Array, top: int) -> float:
    """Find where a peak of a band-limited signal is highest, from its sample `top`, in samples.

    A parabola through three samples alone errs by up to 0.05 of them.
    """
    near = np.clip(
        top + np.arange(-INTERPOLATION_SAMPLES, INTERPOLATION_SAMPLES + 1), 0, len(c) - 1
    )
    fine = _INTERPOLATION_WEIGHTS @ c[near]
    k = int(np.clip(np.argmax(fine), 1, len(fine) - 2))
    left, middle, right = fine[k - 1 : k + 2]
    bend = left - 2 * middle + right
    shift = (left - right) / (2 * bend) if bend else 0.0
    return float((k - len(fine) // 2 + shift) / INTERPOLATION_FACTOR)


def _line(times: Array, delays: Array, weights: Array, delay: float, least: float) -> Drift:
    """Fit a line through delays without those that lie far off, with standard errors.

    A peak between samples errs by `least` s at least.
    """
    kept = np.ones(len(times), bool)
    nothing = Drift(delay, np.nan, np.nan, np.nan, times, delays)
    for _ in range(5):
        if kept.sum() < MIN_WINDOWS or np.ptp(times[kept]) < WINDOW_S:
            return nothing
        A = np.column_stack([np.ones(kept.sum()), times[kept]])
        w = weights[kept, None]
        normal = A.T @ (w**2 * A)
        line = np.linalg.solve(normal, A.T @ (w[:, 0] ** 2 * delays[kept]))
        off = delays - line[0] - line[1] * times
        limit = MAX_LINE_DEVIATIONS * 1.4826 * max(float(np.median(np.abs(off[kept]))), least)
        kept = np.abs(off) <= limit
    part, w = off[kept], weights[kept]
    freedom = max(len(part) - 2, 1)
    inverse = np.linalg.inv(normal)
    scatter = float(np.sum((w * part) ** 2) / freedom)
    spread = inverse * max(scatter, float(np.mean(w**2)) * least**2)
    deviations = np.sqrt(np.diag(spread))
    return Drift(
        float(line[0]),
        float(np.hypot(deviations[0], least)),
        float(-line[1]),
        float(deviations[1]),
        times[kept],
        delays[kept],
    )
