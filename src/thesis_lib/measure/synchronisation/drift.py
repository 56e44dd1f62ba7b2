"""How the clocks of two recordings drift apart, from windows of their sound.

With Tᵢ the start of a recording and δ the share by which its clock is fast, what happens at T has
the time t = (1 + δ)(T − Tᵢ) in it. So what is at t in the one is at t + delay − δt in the
reference: a straight line through the delays of windows tells both.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from thesis_lib.arrays import Array, Signal
from thesis_lib.measure.synchronisation.correlation import normalised_correlation, summit
from thesis_lib.measure.synchronisation.delays import Match

WINDOW = 1.0  # s
HOP = 0.005  # s of a step of loudness
HELD = 300.0  # s from the start whose loudness is compared
LEAST = 3.0  # s that sounds have in common at least
NEXT, SECOND = 0.05, 0.7  # s from the highest peak, and share of it, that no other may reach
REACH = 0.02  # s about the delay that was found, in which a window's is sought
FASTEST = 2e-4  # most that clocks of cameras are apart, relative
TELLING = 6.0  # times 1/√n, by which unlike sounds correlate, that a window's correlation must be
OUTLYING = 4.0  # times the middle deviation from the line
FEWEST = 3  # windows that a drift is told from


@dataclass(frozen=True)
class Drift:
    """Start and clock of a recording, beside those of the reference."""

    delay: float  #: Start after the reference's, s
    delay_deviation: float  #: Its standard error, s; NaN if it rests on too few windows
    drift: float  #: By how much its clock is fast, relative; NaN if it rests on too few windows
    drift_deviation: float  #: Its standard error
    times: Array  #: Middles of the windows that count, on its own clock, s, shape (windows,)
    delays: Array  #: What they show, s, shape (windows,)


def loudness_match(reference: Signal, other: Signal, rate: float) -> Match:
    """Delay in s between sounds by their loudness.

    Loudness is so slow that clocks which drift apart do not blur it.
    """
    a, b = (_loudness(sound, rate) for sound in (reference, other))
    most = max(len(a), len(b)) - min(len(a), len(b), round(LEAST / HOP))
    lags, c = normalised_correlation(a, b, most)
    overlap = np.minimum(lags + len(b), len(a)) - np.maximum(lags, 0)
    height = np.where(overlap > round(LEAST / HOP) / 2, c * np.sqrt(np.maximum(overlap, 0)), 0.0)
    top = int(np.argmax(height))
    rest = np.abs(lags - lags[top]) > round(NEXT / HOP)
    second = float(height[rest].max(initial=0.0))
    ratio = second / max(float(height[top]), 1e-12)
    return Match(
        delay=float(HOP * summit(lags, c, top)),
        peak=float(height[top]),
        ratio=ratio,
        threshold=SECOND,
        period=None,
        ambiguous=ratio >= SECOND,
        snr=np.nan,
        least=TELLING,
    )


def _loudness(sound: Signal, rate: float) -> Array:
    """Logarithm of the energy of what is high in a sound, in steps of `HOP`."""
    n = round(HOP * rate)
    high = np.diff(sound[: round(HELD * rate)].astype(float))
    energy = np.square(high[: len(high) // n * n]).reshape(-1, n).mean(axis=1)
    level = np.log(energy + 1e-3 * energy.mean() + 1e-30)
    return np.asarray(level - level.mean(), float)


def drift_of(
    reference: Signal, other: Signal, rate: float, starts: tuple[float, float], delay: float
) -> Drift:
    """Line through the delays of windows.

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
    n = round(WINDOW * rate)
    most = round((REACH + FASTEST * len(other) / rate) * rate)
    times, found, weights = [], [], []
    for first in range(0, len(other) - n + 1, n):
        at = round((starts[1] + first / rate + delay - starts[0]) * rate)
        low, high = at - most, at + n + most
        if low < 0 or high > len(reference):
            continue
        lags, c = normalised_correlation(reference[low:high], other[first : first + n], 2 * most)
        whole = (lags >= 0) & (lags <= 2 * most)  # where the window is inside
        lags, c = lags[whole], c[whole]
        top = int(np.argmax(c))
        if c[top] < TELLING / np.sqrt(n) or top in (0, len(c) - 1):
            continue
        times.append(starts[1] + (first + n / 2) / rate)
        here = low + int(lags[top]) + _vertex(*c[top - 1 : top + 2])
        found.append(starts[0] + here / rate - (starts[1] + first / rate))
        weights.append(float(c[top]))
    return _line(np.array(times), np.array(found), np.array(weights), delay)


def _vertex(left: float, middle: float, right: float) -> float:
    """Where a parabola through three neighbours is highest, from the middle one, in samples.

    A clap's peak is too sharp for :func:`~thesis_lib.measure.synchronisation.correlation.summit`.
    """
    return float((left - right) / (2 * (left - 2 * middle + right)))


def _line(times: Array, delays: Array, weights: Array, delay: float) -> Drift:
    """The line through delays without those that lie far off, with standard errors."""
    kept = np.ones(len(times), bool)
    nothing = Drift(delay, np.nan, np.nan, np.nan, times, delays)
    for _ in range(5):
        if kept.sum() < FEWEST or np.ptp(times[kept]) < WINDOW:
            return nothing
        A = np.column_stack([np.ones(kept.sum()), times[kept]])
        w = weights[kept, None]
        normal = A.T @ (w**2 * A)
        line = np.linalg.solve(normal, A.T @ (w[:, 0] ** 2 * delays[kept]))
        off = delays - line[0] - line[1] * times
        limit = OUTLYING * 1.4826 * max(float(np.median(np.abs(off[kept]))), 1e-9)
        kept = np.abs(off) <= limit
    part, w = off[kept], weights[kept]
    freedom = max(len(part) - 2, 1)
    inverse = np.linalg.inv(normal)
    spread = inverse * float(np.sum((w * part) ** 2) / freedom)
    deviations = np.sqrt(np.diag(spread))
    return Drift(
        float(line[0]),
        float(deviations[0]),
        float(-line[1]),
        float(deviations[1]),
        times[kept],
        delays[kept],
    )
