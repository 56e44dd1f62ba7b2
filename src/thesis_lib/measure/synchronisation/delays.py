"""Delays between recordings of one signal, from correlation, sine phase and transients.

Recording i is xᵢ(t) = x_ref(t + delayᵢ). Signals are correlated at a few kHz, which keeps a clap
sharp; the phase of a sine is fitted at tens of samples per period, which is cheap. Peaks of the
correlation coefficient are interpolated between samples.

A steady sine matches itself at every period. The longer it lasts, the less weight has the moment
that distinguishes the periods: its onset, a clap, a voice. A second comparison therefore removes
the sine and all sound that does not exceed the background. Each of these steps treats a recording
by a rule that does not depend on time, and so does not change the delays.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy

from thesis_lib.arrays import Array, ArrayLike, IntArray, Signal
from thesis_lib.measure.synchronisation import audio, tones
from thesis_lib.measure.synchronisation.tones import Interval

MIN_ENERGY_SHARE = 1e-9  # share of a signal's energy below which an overlap's is rounding error
CORRELATION_RATE = 4000  # Hz at which signals are correlated
MIN_CORRELATION = 0.3  # correlation below which two recordings have nothing in common
MIN_PEAK_SIGMAS = 5.0  # standard deviations by which one peak must exceed the other
# Peak height ratio from which on two peaks are ambiguous; recordings never match perfectly
MAX_PEAK_RATIO = 0.9998
ROOM_RATE = 16000  # Hz at which the sound of microphones is correlated: a clap is 5 ms
ENERGY_SPAN_S = 0.01  # s over which the energy of possible transients is averaged
MIN_ONSET_RATIO = 12  # least excess over the median energy, relative to the upper quartile's
MIN_ONSET_CORRELATION = 0.5  # smallest accepted correlation of transients
MAX_ONSET_PEAK_RATIO = 0.95  # peak height ratio from which on onsets are ambiguous
MAX_CLAP_PEAK_RATIO = 0.9  # likewise for claps
MAX_ROOM_PEAK_RATIO = 0.6  # likewise for all sound in a room
# Standard deviations of chance that the correlation of all room sound must reach
MIN_ROOM_CORRELATION_SIGMAS = 9.0
WHITENING_BINS = 1024  # samples of a short spectrum, and taps, of the whitening filter
# Samples by which a whitened signal starts later
WHITENING_DELAY = WHITENING_BINS - 1 - WHITENING_BINS // 2
SPECTRUM_PIECES = 32  # pieces of a long sound from which its spectrum is estimated
MIN_POWER_RATIO = 1e-6  # of the highest power; weaker lines are not amplified to the same level


def correlation_coefficient(a: ArrayLike, b: ArrayLike, most: int) -> tuple[IntArray, Array]:
    """Return lags and correlation coefficients of a[j + lag] and b[j] over their overlap.

    Each lag is normalised by the means and energies of its own overlap; otherwise the shrinking
    overlap would pull the peak to lag zero. Lags (lags,) are in samples, up to ±`most`;
    coefficients (lags,) are in −1…1. The signals (samples,) may differ in length.
    """
    x, y = (v - v.mean() for v in (np.asarray(a, float), np.asarray(b, float)))
    n_x, n_y = len(x), len(y)
    lag = np.arange(max(-most, 1 - n_y), min(most, n_x - 1) + 1)
    size = 1 << (max(n_x, n_y) + most - 1).bit_length()
    size = size // 4 * 3 if max(n_x, n_y) + most <= size // 4 * 3 else size
    c = scipy.fft.irfft(scipy.fft.rfft(x, size) * np.conj(scipy.fft.rfft(y, size)), size)[lag]
    low, high = np.maximum(lag, 0), np.minimum(n_y + lag, n_x)  # the overlap, in x
    sum_x, energy_x = _energy(x, low, high)
    sum_y, energy_y = _energy(y, low - lag, high - lag)
    energy = np.sqrt(energy_x * energy_y)
    covariance = c - sum_x * sum_y / (high - low)
    return lag, np.divide(covariance, energy, out=np.zeros_like(energy), where=energy > 0)


def count_overlap(lags: ArrayLike, a: ArrayLike, b: ArrayLike) -> Array:
    """Count the samples that a[j + lag] and b[j] have in common at each lag."""
    lag = np.asarray(lags)
    return np.minimum(lag + len(np.asarray(b)), len(np.asarray(a))) - np.maximum(lag, 0)


def _energy(x: Array, low: IntArray, high: IntArray) -> tuple[Array, Array]:
    """Return the sum and the energy about the mean of the samples from `low` to `high`."""
    sums, squares = (np.concatenate([[0], np.cumsum(part)]) for part in (x, np.square(x)))
    total = sums[high] - sums[low]
    energy = squares[high] - squares[low] - total**2 / (high - low)
    return total, np.where(energy > MIN_ENERGY_SHARE * squares[-1], energy, 0)


def interpolate_peak(lags: IntArray, c: Array, top: int) -> float:
    """Interpolate the lag of a peak by a polynomial through the samples above 80 % of it.

    A slow sine's peak is so flat that noise would decide among three samples; a clap has no more.
    """
    below = np.flatnonzero(np.concatenate([[True], c < 0.8 * c[top], [True]])) - 1
    reach = int(min(top - below[below < top].max(), below[below > top].min() - top)) - 1
    if reach < 1:
        return float(lags[top])
    u = np.arange(-reach, reach + 1) / reach
    cap = c[top - reach : top + reach + 1]
    fit = np.polynomial.Polynomial.fit(u, cap, 2 if reach < 4 else 4, domain=[-1, 1])
    roots = fit.deriv().roots()
    real = roots[np.abs(roots.imag) < 1e-9].real
    real = real[np.abs(real) <= 1]
    shift = real[np.argmax(fit(real))] if len(real) else 0.0
    return float(lags[top] + reach * shift)


def _peak_heights(c: Array, tops: IntArray) -> Array:
    """Interpolate the heights of peaks by a parabola through the three highest samples of each."""
    left, middle, right = (c[np.clip(tops + k, 0, len(c) - 1)] for k in (-1, 0, 1))
    bend = np.maximum(2 * middle - left - right, 1e-15)
    return middle + np.minimum((right - left) ** 2 / bend, bend) / 8


@dataclass(frozen=True)
class Match:
    """Delay of one recording relative to another, with its ambiguity."""

    delay: float  #: s
    peak: float  #: Highest correlation
    ratio: float  #: Second highest peak over the highest
    threshold: float  #: Ratio from which on the two peaks are ambiguous
    ambiguous: bool  #: Whether the ratio reaches it; then the delay is the shortest possible one
    snr: float  #: Signal-to-noise power ratio up to half of the correlation's rate
    least: float = MIN_CORRELATION  #: Smallest accepted peak correlation

    @property
    def certain(self) -> bool:
        """Return whether the recordings match at one delay only."""
        return not self.ambiguous and self.peak >= self.least


def _compare_signals(
    a: ArrayLike,
    b: ArrayLike,
    rate: float,
    *,
    same: float = MAX_PEAK_RATIO,
    telling: int | None = None,
    least: float = 0.0,
    by_noise: bool = True,
    either_sign: bool = False,
) -> Match:
    """Return the delay by the highest peak of the normalised cross-correlation, at the given rate.

    Where two recordings match, 1 minus their correlation is the energy of their noises over that of
    the signal, ε; over n samples it scatters by ε √(2/n). Two peaks are ambiguous if their heights
    differ by less than `MIN_PEAK_SIGMAS` standard deviations of such a difference, plus the part of
    ε that the change of overlap may cause. The shortest delay of ambiguous peaks is used.

    `same` is the height ratio from which on peaks are ambiguous in any case, `by_noise` whether
    noise lowers it, and `telling` the number n of samples with signal (None: the overlap). Peaks
    closer than `least` s to the highest are ignored. With `either_sign` one recording may be
    inverted, as microphones are. At least half of the shorter recording has to overlap.
    """
    shorter, longer = sorted((len(np.asarray(a)), len(np.asarray(b))))
    least_overlap = shorter - shorter // 2
    lags, c = correlation_coefficient(a, b, longer - least_overlap)
    enough = count_overlap(lags, a, b) >= least_overlap
    lags, c = lags[enough], c[enough]
    if either_sign and -c.min() > c.max():
        c = -c
    best = int(np.argmax(c))
    peak = float(c[best])
    tops = _other_peaks(c, best)
    tops = tops[np.abs(lags[tops] - lags[best]) > least * rate]
    if not len(tops) or peak <= 0:  # one peak, or nothing in common
        snr = peak / max(1 - peak, 1e-12)
        return Match(interpolate_peak(lags, c, best) / rate, peak, 0.0, 1.0, False, snr)
    overlap = count_overlap(lags[best], a, b)
    noise = max(1 - peak, 1e-12) / max(peak, 1e-12)
    apart = np.abs(lags[tops] - lags[best])
    scatter = MIN_PEAK_SIGMAS * 2 / np.sqrt(telling or overlap)
    thresholds = np.minimum(same, 1 - by_noise * noise * (scatter + apart / overlap))
    ratios = _peak_heights(c, tops) / _peak_heights(c, np.array([best]))
    doubtful = ratios >= thresholds
    second = int(np.argmax(ratios))
    alike = np.append(tops[doubtful], best)
    chosen = int(alike[np.argmin(np.abs(lags[alike]))])
    return Match(
        interpolate_peak(lags, c, chosen) / rate,
        peak,
        float(ratios[second]),
        float(thresholds[second]),
        bool(doubtful.any()),
        1 / noise,
    )


def _other_peaks(c: Array, best: int) -> IntArray:
    """Find other peaks: at least half as high as the best, prominent by a tenth of it."""
    steps = np.diff(c, prepend=-1, append=-1)
    tops = np.flatnonzero((steps[:-1] > 0) & (steps[1:] <= 0) & (c >= 0.5 * c[best]))
    if not np.any(tops != best):  # SciPy's signals take half a second to import
        return tops[:0]
    high = {"height": 0.5 * c[best], "prominence": 0.1 * c[best]}
    found = scipy.signal.find_peaks(np.pad(c, 1, constant_values=-1), **high)[0] - 1
    return np.asarray(found[found != best])


def phase_delays(
    signals: Sequence[Signal], rate: float, frequency: float, guess: Array, steady: Interval | None
) -> Array:
    """Estimate delays from a sine's phase, each nearest to a guess, shape (recordings,), s.

    Every recording is fitted with cos, sin and a constant over the same interval of the signal: the
    reference's steady-state interval, as far as all recordings contain it, in whole periods. Other
    sound thus disturbs all phases alike, and a slightly wrong frequency does no harm.

    The signals (samples,) have some tens of samples per period, rate and frequency are in Hz, and
    the guess (recordings,) in s is right to within half a period. `steady`, in s after the
    reference's first sample, replaces the detected steady-state interval.
    """
    near = guess - guess[0]
    start, end = steady or tones.settle_interval(signals[0], rate, frequency)
    start = max(start, float(near.max()))
    end = min([end, *(float(len(x) / rate + g) for x, g in zip(signals, near, strict=True))])
    periods = int((end - start) * frequency)
    if periods < 1:
        raise audio.SynchronisationError(
            f"the recordings share {max(end - start, 0):.3f} s of steady tone, allowed: at least "
            f"a period of {1 / frequency:.3f} s"
        )
    length = round(periods / frequency * rate)
    phases, centres = [], []
    for x, g in zip(signals, near, strict=True):
        first = max(0, min(round((start - g) * rate), len(x) - length))
        centre = (first + (length - 1) / 2) / rate
        part = x[first : first + length]
        amplitude, _ = tones.fit_tone([part], rate, frequency, centre - first / rate)
        phases.append(np.angle(amplitude))
        centres.append(centre)
    turn = (np.array(phases) - phases[0]) / (2 * np.pi * frequency)
    delays = centres[0] - np.array(centres) + turn
    return delays - np.rint((delays - near) * frequency) / frequency


def remove_sine(x: Signal, rate: float, frequency: float) -> Signal:
    """Remove a steady sine by subtracting the signal of one period before.

    Unlike a fitted sine, this needs no steady-state interval and leaves no step at its ends; it
    also removes harmonics and offsets, and tolerates a frequency that drifts. The period need not
    be whole samples: two neighbours are weighted so that the fundamental is removed exactly. The
    residual is one period shorter than the signal (samples,), and starts one period later.
    """
    m = int(rate / frequency)
    w = 2 * np.pi * frequency / rate * np.array([m, m + 1])
    near, far = np.linalg.solve([np.cos(w), np.sin(w)], [1.0, 0.0])
    rest = np.array(x[m + 1 :], float)
    rest -= near * x[1 : len(x) - m]
    rest -= far * x[: len(x) - m - 1]
    return rest


def design_whitening(x: Signal, rate: float) -> Signal:
    """Design a filter that makes the background of a signal equally strong at all frequencies.

    The background is the median over time of short spectra. Hum and rumble then weigh no more than
    their share of the band, and a clap is preserved. The gain falls to zero from 0.7 to 0.95 of the
    Nyquist frequency. The taps (WHITENING_BINS,) delay by :data:`WHITENING_DELAY` samples.
    """
    step = len(x) // SPECTRUM_PIECES
    if step > 2 * WHITENING_BINS:
        starts = step * np.arange(SPECTRUM_PIECES)
        pieces = x[starts[:, None] + np.arange(2 * WHITENING_BINS)].ravel()
        x = pieces if pieces.any() else x
    f, power = scipy.signal.welch(x, rate, nperseg=WHITENING_BINS, average="median")
    if not power.any():  # silent for most of the time
        f, power = scipy.signal.welch(x, rate, nperseg=WHITENING_BINS)
    gain = 1 / np.sqrt(power + MIN_POWER_RATIO * power.max())
    gain *= np.clip((0.95 - 2 * f / rate) / 0.25, 0, 1)
    gain[0] = 0
    taps = np.roll(np.fft.irfft(gain), WHITENING_BINS // 2) * np.hanning(WHITENING_BINS + 1)[:-1]
    return (taps / np.abs(taps).max()).astype(x.dtype)


def _keep_transients(x: Signal, rate: float) -> tuple[Signal, int]:
    """Return the transients of a signal, 0 elsewhere, and the number of their samples.

    The threshold is the median energy over :data:`ENERGY_SPAN_S` plus :data:`MIN_ONSET_RATIO` times
    the upper quartile's distance from it, about eight standard deviations. Each sample is weighted
    by the share of the energy around it that exceeds the threshold.
    """
    n = max(1, round(ENERGY_SPAN_S * rate))
    energy = scipy.ndimage.uniform_filter1d(x * x, n)
    middle, upper = np.quantile(energy[:: max(1, n // 4)], [0.5, 0.75])
    background = middle + MIN_ONSET_RATIO * (upper - middle)
    weight = 1 - background / np.maximum(energy, max(background, 1e-300))
    weight *= x
    return weight.astype(np.float32), int(np.count_nonzero(weight))


def _match_transients(a: Signal, b: Signal, rate: float, **how: Any) -> Match | None:
    """Match the transients of two signals by :func:`_compare_signals`; None if uncertain."""
    (loud_a, n_a), (loud_b, n_b) = (_keep_transients(x, rate) for x in (a, b))
    if not n_a or not n_b:
        return None
    found = _compare_signals(loud_a, loud_b, rate, telling=min(n_a, n_b), **how)
    found = replace(found, least=MIN_ONSET_CORRELATION)
    return found if found.certain else None


def force_match(reference: Signal, other: Signal, rate: float, frequency: float) -> Match:
    """Estimate the delay between recordings (samples,) of the force signal, at a rate in Hz.

    The rate is about :data:`CORRELATION_RATE`. The signals are correlated; if the result is
    ambiguous, so are the transients after :func:`remove_sine`: onset or end of the sine, or a
    clap. Peaks within half a period of the highest are then ignored, since the sine's phase decides
    between them. The sine's frequency in Hz is known to within 1 %.
    """
    whole = _compare_signals(reference, other, rate)
    if whole.certain or tones.MIN_SAMPLES_PER_PERIOD * frequency > rate:
        return whole
    shorter = min(len(reference), len(other))
    if shorter < 2 * tones.MIN_SETTLED_PERIODS * rate / frequency:
        return whole
    tone, tone_rate = audio.decimate_signal(reference, rate, tones.TONE_RATE * frequency)
    start, end = tones.settle_interval(tone, tone_rate, frequency)
    if (end - start) * frequency > tones.MIN_SETTLED_PERIODS - 0.1:
        part = tone[round(start * tone_rate) : round(end * tone_rate)]
        frequency = tones.tone_frequency(part, tone_rate, frequency)
    a, b = (remove_sine(x, rate, frequency) for x in (reference, other))
    loud = _match_transients(a, b, rate, same=MAX_ONSET_PEAK_RATIO, least=0.5 / frequency)
    return replace(loud, snr=whole.snr) if loud else whole


def room_match(reference: Signal, other: Signal, rate: float) -> Match:
    """Estimate the delay between microphone recordings (samples,) in a room, at a rate in Hz.

    The rate is about :data:`ROOM_RATE`. The whitened signals (:func:`design_whitening`) are
    correlated. The result is certain if the highest correlation is far above 1/√n, the scatter for
    unrelated sounds of n samples, and no other peak comes near it. Otherwise the transients, such
    as claps, are correlated.

    Two similar knocks, each recorded by one camera only, cannot be distinguished from one knock
    that both recorded; several claps at irregular intervals can.
    """
    both = reference, other
    a, b = (scipy.signal.oaconvolve(x, design_whitening(x, rate), "valid") for x in both)
    whole = _compare_signals(a, b, rate, same=MAX_ROOM_PEAK_RATIO, by_noise=False, either_sign=True)
    n = count_overlap(whole.delay * rate, a, b)
    whole = replace(whole, least=float(MIN_ROOM_CORRELATION_SIGMAS / np.sqrt(n)))
    if whole.certain:
        return whole
    return _match_transients(a, b, rate, same=MAX_CLAP_PEAK_RATIO, either_sign=True) or whole
