"""Estimate starts and clock drifts of recordings relative to the first one.

With Tᵢ the start of a recording and δ the share by which its clock is fast, an event at T has the
time t = (1 + δ)(T − Tᵢ) in it, and t + delay − dt, d = δ / (1 + δ), in the reference. A straight
line through the delays of windows thus yields delay and drift.

A window's correlation has several peaks where sound reverberates or repeats. The line is the one
on which most windows have a peak. Windows are whitened by
:func:`~thesis_lib.measure.synchronisation.delays.design_whitening`, so that neither hum nor a note
has a peak at each of its periods.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import scipy

from thesis_lib.arrays import Array, IntArray, Signal
from thesis_lib.measure.synchronisation import audio, delays as matching

WINDOW_S = 1.0  # length of a window in s
HOP_S = 0.005  # time step of the loudness in s
MAX_LOUDNESS_S = 300.0  # length in s, from the start, whose loudness is compared
MIN_COMMON_S = 3.0  # shortest overlap of two sounds in s
# A peak this far in s from the highest, and higher than this share of it, is a rival
MIN_PEAK_DISTANCE_S, MAX_SECOND_PEAK_RATIO = 0.05, 0.7
MAX_CANDIDATES = 12  # largest number of loudness correlation peaks that are examined
WINDOW_SEARCH_S = 0.05  # half of the range in s, about the common delay, searched in a window
MAX_DRIFT = 2e-4  # largest relative difference of camera clocks
MAX_SHORT_DRIFT = 1e-3  # largest drift searched for in short sounds
# Smallest accepted correlation over 1/√n, its standard deviation for unrelated sounds
MIN_CORRELATION_SIGMAS = 6.0
PEAKS_PER_WINDOW = 3  # candidate peaks of each window for the line
# Largest distance in s of a window's peak from the line: 9 cm of sound travel
MAX_LINE_DISTANCE_S = 2.5e-4
MAX_LINE_DEVIATIONS = 4.0  # robust standard deviations beyond which a delay is an outlier
MIN_WINDOWS = 3  # smallest number of windows for a drift
INTERPOLATION_FACTOR = 16  # points per sample at which a peak is interpolated
INTERPOLATION_SAMPLES = 12  # samples on either side used for interpolation
MIN_PEAK_STD_SAMPLES = 0.005  # smallest standard uncertainty of an interpolated peak, in samples

_NEAR_SAMPLES = np.arange(-INTERPOLATION_SAMPLES, INTERPOLATION_SAMPLES + 1)
_FINE_SAMPLES = np.arange(-INTERPOLATION_FACTOR, INTERPOLATION_FACTOR + 1) / INTERPOLATION_FACTOR
_INTERPOLATION_POINTS = _FINE_SAMPLES[:, None] - _NEAR_SAMPLES
_INTERPOLATION_WEIGHTS = (
    np.sinc(_INTERPOLATION_POINTS)
    * np.cos(np.pi * _INTERPOLATION_POINTS / (2 * INTERPOLATION_SAMPLES + 4)) ** 2
)


@dataclass(frozen=True)
class Drift:
    """Start and clock drift of a recording relative to the reference."""

    delay: float  #: Start after the reference's, s
    delay_deviation: float = np.nan  #: Its standard error, s; NaN with too few windows
    #: Share by which its seconds are too short; NaN with too few windows
    drift: float = np.nan
    drift_deviation: float = np.nan  #: Its standard error
    #: Middles of the windows on the line, on its own clock, s, shape (windows,)
    times: Array = field(default_factory=lambda: np.empty(0))
    #: Delays of these windows, s, shape (windows,)
    delays: Array = field(default_factory=lambda: np.empty(0))
    agreement: float = 0.0  #: Share of the windows with a peak that have one on the line
    #: Sum of the correlations of the windows on the line, over the root of all windows' number
    score: float = 0.0
    #: Drift at the sample rates stated in the files, which may differ from the time stamps
    sample_drift: float = np.nan

    @property
    def fast(self) -> float:
        """Return the relative excess of its clock rate over the reference's."""
        return self.drift / (1 - self.drift)


def _match_loudness(reference: Signal, other: Signal, rate: float) -> tuple[list[float], bool]:
    """Find the delays in s at which the loudness of two sounds matches, the likeliest first.

    Loudness varies so slowly that clock drift does not blur it. Correlations are ranked by their
    standard deviations above chance. Also return whether the first delay is certain.
    """
    a, b = (_loudness(sound, rate) for sound in (reference, other))
    most = max(len(a), len(b)) - min(len(a), len(b), round(MIN_COMMON_S / HOP_S))
    lags, c = matching.correlation_coefficient(a, b, most)
    step = round(HOP_S * rate) / rate  # whole samples, s
    overlap = matching.count_overlap(lags, a, b)
    enough = overlap > round(MIN_COMMON_S / HOP_S) / 2
    height = np.where(enough, c * np.sqrt(np.maximum(overlap, 0)), 0.0)
    highest, found = float(height.max(initial=0.0)), list[float]()
    while len(found) < MAX_CANDIDATES and height.max(initial=0.0) > MAX_SECOND_PEAK_RATIO * highest:
        top = int(np.argmax(height))
        found.append(float(step * matching.interpolate_peak(lags, c, top)))
        height[np.abs(lags - lags[top]) <= round(MIN_PEAK_DISTANCE_S / HOP_S)] = 0.0
    return found, len(found) == 1 and highest >= MIN_CORRELATION_SIGMAS


def _loudness(sound: Signal, rate: float) -> Array:
    """Return the log energy of a sound's high frequencies in steps of :data:`HOP_S`."""
    n = round(HOP_S * rate)
    high = np.diff(sound[: round(MAX_LOUDNESS_S * rate)].astype(float))
    energy = np.square(high[: len(high) // n * n]).reshape(-1, n).mean(axis=1)
    level = np.log(energy + 1e-3 * energy.mean() + 1e-30)
    return np.asarray(level - level.mean(), float)


def fit_drift(
    reference: Signal, other: Signal, rate: float, starts: tuple[float, float], delay: float
) -> Drift:
    """Fit a line through the delays of windows of two sounds (samples,).

    The sample rate is in Hz; `starts` are the times of the first samples in the recordings, and
    `delay` is the start of the other after the reference, as estimated from the whole sounds, s.
    """
    if min(len(reference), len(other)) <= 2 * matching.WHITENING_BINS:
        return Drift(delay)
    taps = matching.design_whitening(reference, rate), matching.design_whitening(other, rate)
    n = round(WINDOW_S * rate)
    most = round((WINDOW_SEARCH_S + MAX_DRIFT * len(other) / rate) * rate)
    peaks: list[tuple[int, float, float]] = []  # window, delay, correlation
    times: list[float] = []
    for first in range(0, len(other) - n - matching.WHITENING_BINS + 2, n):
        at = round((starts[1] + first / rate + delay - starts[0]) * rate)
        low, high = at - most, at + n + matching.WHITENING_BINS - 1 + most
        if low < 0 or high > len(reference):
            continue
        one = scipy.signal.oaconvolve(reference[low:high], taps[0], "valid")
        two = scipy.signal.oaconvolve(
            other[first : first + n + matching.WHITENING_BINS - 1], taps[1], "valid"
        )
        lags, c = matching.correlation_coefficient(one, two, 2 * most)
        whole = (lags >= 0) & (lags <= 2 * most)  # full overlap
        lags, c = lags[whole], c[whole]
        size, least = np.abs(c), MIN_CORRELATION_SIGMAS / np.sqrt(n)
        inner = size[1:-1]
        tops = 1 + np.flatnonzero((inner >= size[:-2]) & (inner > size[2:]) & (inner >= least))
        for top in tops[np.argsort(size[tops])[::-1][:PEAKS_PER_WINDOW]]:
            here = low + int(lags[top]) + _vertex(np.sign(c[top]) * c, top)
            own = starts[0] + here / rate - (starts[1] + first / rate)
            peaks.append((len(times), own, float(c[top])))
        times.append(starts[1] + (first + matching.WHITENING_DELAY + n / 2) / rate)
    if not peaks:
        return Drift(delay)
    window = np.array([peak[0] for peak in peaks])
    late, height = np.array([peak[1:] for peak in peaks]).T
    when = np.array(times)[window]
    on = _on_line(window, when, late - delay, height)
    weights = np.abs(height[on])
    return replace(
        _line(when[on], late[on], weights, delay, MIN_PEAK_STD_SAMPLES / rate),
        agreement=len(on) / len(np.unique(window)),
        score=float(weights.sum() / np.sqrt(len(times))),
    )


def _on_line(window: IntArray, when: Array, late: Array, height: Array) -> IntArray:
    """Return the peaks, at most one per window and of one sign, on the line with most of them."""
    span = max(float(np.ptp(when)), WINDOW_S)
    middle, turn = when.mean(), min(WINDOW_SEARCH_S + MAX_DRIFT * span, MAX_SHORT_DRIFT * span)
    slopes = np.arange(-turn, turn + MAX_LINE_DISTANCE_S, MAX_LINE_DISTANCE_S) / span
    best, chosen = -1.0, np.array([], int)
    for sign in (1.0, -1.0):
        own = np.flatnonzero(sign * height > 0)
        if not len(own):
            continue
        for slope in slopes:
            off = late[own] - slope * (when[own] - middle)
            order = np.argsort(off)
            sums = np.concatenate([[0], np.cumsum(np.abs(height[own])[order])])
            ends = np.searchsorted(off[order], off[order] + 2 * MAX_LINE_DISTANCE_S, "right")
            inside = sums[ends] - sums[:-1]
            if inside.max() > best:
                k = int(np.argmax(inside))
                best, chosen = float(inside[k]), own[order[k : ends[k]]]
    highest = chosen[np.argsort(-np.abs(height[chosen]), kind="stable")]
    _, first = np.unique(window[highest], return_index=True)
    return highest[first]


def _vertex(c: Array, top: int) -> float:
    """Return the offset of a band-limited peak from its sample `top`, in samples.

    A parabola through three samples alone errs by up to 0.05 samples.
    """
    fine = _INTERPOLATION_WEIGHTS @ c[np.clip(top + _NEAR_SAMPLES, 0, len(c) - 1)]
    k = int(np.clip(np.argmax(fine), 1, len(fine) - 2))
    left, middle, right = fine[k - 1 : k + 2]
    bend = left - 2 * middle + right
    shift = (left - right) / (2 * bend) if bend else 0.0
    return float((k - len(fine) // 2 + shift) / INTERPOLATION_FACTOR)


def _line(times: Array, delays: Array, weights: Array, delay: float, least: float) -> Drift:
    """Fit a line through delays without outliers, with standard errors.

    `least` is the smallest standard uncertainty of a delay, s.
    """
    kept = np.ones(len(times), bool)
    for _ in range(5):
        if kept.sum() < MIN_WINDOWS or np.ptp(times[kept]) < WINDOW_S:
            return Drift(delay, times=times, delays=delays)
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


COMPARED_RATE_HZ = 16000.0  # sample rate at which windows are compared
MAX_COMPARED_S = 1800.0  # longest compared sound in s, from the start
MIN_AGREEING_SHARE = 0.5  # smallest share of windows that must agree on a delay
MIN_DECIDING_WINDOWS = 6  # windows that suffice alone; unrelated sounds had at most four


def estimate_drifts(
    recordings: Sequence[audio.AudioSource], others: Mapping[int, float | None]
) -> dict[int, Drift]:
    """Estimate start and clock drift of each of `others` relative to the first recording.

    Where time stamps and stated sample rate disagree, either may be right. The sounds are then
    compared at both rates, and the result is converted to the time stamps. `others` maps the index
    of each recording to the delay of its sound in s, or None if that is to be estimated. Sounds
    without a match raise a :class:`~.audio.SynchronisationError`.
    """
    found: dict[int, Drift] = {}
    stamped, stated = (_Compared(recordings, COMPARED_RATE_HZ, by) for by in (False, True))
    # Seconds of the time stamps per second at the stated sample rate
    paces = [one.stated_rate / one.rate for one in stamped.tracks]
    for k, known in others.items():
        first, own = starts = stamped.starts[0], stamped.starts[k]
        if known is not None:
            signals, rate = (stamped.first, stamped.compared(k)), stamped.low.rate
            found[k] = fit_drift(*signals, rate, starts, known + first - own)
        else:
            tries = [_find_start(stamped, k)]
            if paces[k] != paces[0] and (one := _find_start(stated, k)) is not None:
                cut = stamped.low.cut
                tries.append(_by_stamps(one, (first - cut, own - cut), (paces[0], paces[k])))
            sure = [one for one in tries if one is not None]
            if not sure:
                raise unmatched_error(recordings[k].name, recordings[0].name)
            found[k] = max(sure, key=lambda one: one.score)
        kept = (1 - found[k].drift) * paces[k] / paces[0]
        found[k] = replace(found[k], sample_drift=1 - kept)
    return found


def unmatched_error(name: str, first: str) -> audio.SynchronisationError:
    """Return the error for a sound that matches nothing in the first one."""
    return audio.SynchronisationError(
        f"{name}: no sound in it matches that of {first} beyond doubt; clap a few times where all "
        "cameras hear it, within a minute of the first one's start"
    )


class _Compared(audio.Sounds):
    """Sounds to compare, the first of which is cached."""

    def compared(self, k: int) -> Signal:
        """Read the compared part of a sound, of at most :data:`MAX_COMPARED_S`."""
        return self.read(k, 0, round(MAX_COMPARED_S * self.low.rate))

    @cached_property
    def first(self) -> Signal:
        """The compared part of the first sound."""
        return self.compared(0)


def _find_start(sounds: _Compared, k: int) -> Drift | None:
    """Estimate start and clock drift of a sound whose delay is unknown; None if uncertain.

    Candidate delays come from the loudness and the waveform of the first minutes. Windows of the
    whitened waveform decide: the best delay is certain if no rival comes near its score, and if the
    whole waveform confirms it or enough windows agree (fewer suffice if the loudness confirms it).
    """
    one, other, rate = sounds.first, sounds.compared(k), sounds.low.rate
    starts = sounds.starts[0], sounds.starts[k]
    if min(len(one), len(other)) <= 2 * matching.WHITENING_BINS:
        return None
    loud, is_clear = _match_loudness(one, other, rate)
    room = matching.room_match(one[: audio.SPAN_SAMPLES], other[: audio.SPAN_SAMPLES], rate)
    delays = loud
    if room.certain:
        apart = [delay for delay in loud if abs(delay - room.delay) > MIN_PEAK_DISTANCE_S]
        delays = [room.delay, *apart]
    found = [fit_drift(one, other, rate, starts, delay + starts[0] - starts[1]) for delay in delays]
    if not found:
        return None
    best, *rest = sorted(found, key=lambda one: -one.score)
    if any(
        abs(rival.delay - best.delay) > MIN_PEAK_DISTANCE_S
        and rival.score > MAX_SECOND_PEAK_RATIO * best.score
        for rival in rest
    ):
        return None
    sound_delay = best.delay + starts[1] - starts[0]
    by_room = room.certain and abs(sound_delay - room.delay) < WINDOW_SEARCH_S
    by_loudness = is_clear and abs(sound_delay - loud[0]) < WINDOW_SEARCH_S
    agreeing = best.agreement >= MIN_AGREEING_SHARE
    enough = MIN_WINDOWS if by_loudness else MIN_DECIDING_WINDOWS
    return best if by_room or (agreeing and len(best.times) >= enough) else None


def _by_stamps(found: Drift, starts: tuple[float, float], paces: tuple[float, float]) -> Drift:
    """Convert a drift between samples at their stated rates to one between time stamps."""
    (begin, its_begin), (first, own) = starts, paces
    times = its_begin + own * found.times
    there = begin + first * (found.times + found.delays)
    kept = first * (1 - found.drift) / own  # seconds of the first clock per second of the other
    pace = kept if np.isfinite(kept) else first / own
    return replace(
        found,
        delay=begin + first * found.delay - pace * its_begin,
        delay_deviation=first * found.delay_deviation,
        drift=1 - kept,
        drift_deviation=first / own * found.drift_deviation,
        times=times,
        delays=there - times,
    )
