"""Estimators of the delay between recordings of one signal: correlation, and phase of a tone.

Recording i is xᵢ(t) = x_ref(t + delayᵢ). Correlation works at a few kHz, which keeps a clap sharp;
the phase of a tone at tens of samples per period, which keeps it cheap.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import minimize_scalar
from scipy.signal import find_peaks, resample_poly

Array = NDArray[np.float64]
Lags = NDArray[np.int64]

CORRELATION_RATE = 4000  # Hz at which signals are correlated
TONE_RATE = 64  # samples per period at which a tone's phase is fitted
FEWEST = 8  # samples per period from which on one is fitted
EDGE = 10  # samples that the low-pass reaches to either side
DOUBT = 5.0  # standard deviations by which one peak must beat the other
SAME = 0.9998  # ratio of peaks from which on they are alike, as recordings never are quite


class SynchronisationError(ValueError):
    """Recordings that cannot be synchronised; the message is one line."""


@dataclass(frozen=True)
class Match:
    """Where one recording lies on another: delay in s, other peaks, certainty.

    `ratio`, `threshold`, `period`, `ambiguous` and `snr` are as in :class:`Synchronisation`.
    """

    delay: float
    peak: float
    ratio: float
    threshold: float
    period: float | None
    ambiguous: bool
    snr: float


def decimated(signal: ArrayLike, rate: float, wanted: float) -> tuple[Array, float]:
    """The signal low-passed at the lowest rate above `wanted`, and that rate in Hz.

    Where the filter reaches beyond its ends the signal is cut: it starts later, but that of all
    recordings alike, which leaves their delays.
    """
    x = np.asarray(signal, float)
    step = max(1, int(rate // wanted))
    return (resample_poly(x, 1, step)[EDGE:-EDGE] if step > 1 else x), rate / step


def cut_off(rate: float, low_rate: float) -> float:
    """How much later in s a signal starts that was :func:`decimated` from one rate to another."""
    return EDGE / low_rate if low_rate < rate else 0.0


def normalised_correlation(a: ArrayLike, b: ArrayLike, most: int) -> tuple[Lags, Array]:
    """Correlation coefficient of a[j + lag] and b[j] over the j that both have.

    Each lag is normalised by the means and energies of its own overlap: without, the shrinking
    overlap would pull the peak to lag zero.

    Parameters
    ----------
    a, b : array_like, shape (samples of each,)
        Two signals at the same rate.
    most : int
        Largest lag in samples.

    Returns
    -------
    lags, coefficients : ndarray, shape (lags,)
        Lags in samples, and −1…1.
    """
    x, y = np.asarray(a, float), np.asarray(b, float)
    x, y = x - x.mean(), y - y.mean()
    lags = np.arange(max(-most, 1 - len(y)), min(most, len(x) - 1) + 1)
    size = 1 << (len(x) + len(y) - 1).bit_length()
    product = np.fft.irfft(np.fft.rfft(x, size) * np.conj(np.fft.rfft(y, size)), size)[lags]
    low, high = np.maximum(lags, 0), np.minimum(len(y) + lags, len(x))  # the overlap, in x
    n = high - low

    def sums(v: Array, low: Lags, high: Lags) -> tuple[Array, Array]:
        first, second = (np.concatenate([[0.0], np.cumsum(w)]) for w in (v, v * v))
        total = first[high] - first[low]
        return total, np.maximum(second[high] - second[low] - total**2 / n, 0)

    (sum_x, energy_x), (sum_y, energy_y) = sums(x, low, high), sums(y, low - lags, high - lags)
    energy, covariance = np.sqrt(energy_x * energy_y), product - sum_x * sum_y / n
    return lags, np.divide(covariance, energy, out=np.zeros_like(energy), where=energy > 0)


def _summit(lags: Lags, c: Array, top: int) -> float:
    """Lag of a peak between samples, by a polynomial through its cap.

    A slow tone's peak is so flat that noise decides among three samples; a clap's has no more.
    """
    below = np.flatnonzero(np.concatenate([[True], c < 0.8 * c[top], [True]])) - 1
    reach = int(min(top - below[below < top].max(), below[below > top].min() - top)) - 1
    if reach < 1:
        return float(lags[top])
    u = np.arange(-reach, reach + 1) / reach
    cap = c[top - reach : top + reach + 1]
    fit = np.polynomial.Polynomial.fit(u, cap, 2 if reach < 4 else 4, domain=[-1, 1])
    slope = fit.deriv()
    roots = slope.roots()
    real = roots[np.abs(roots.imag) < 1e-9].real
    real = real[np.abs(real) <= 1]
    shift = real[np.argmax(fit(real))] if len(real) else 0.0
    return float(lags[top] + reach * shift)


def _heights(c: Array, tops: Lags) -> Array:
    """Heights of peaks between samples, by a parabola through the three highest of each."""
    left, middle, right = (c[np.clip(tops + k, 0, len(c) - 1)] for k in (-1, 0, 1))
    bend = np.maximum(2 * middle - left - right, 1e-15)
    return middle + np.minimum((right - left) ** 2 / bend, bend) / 8


def match(reference: ArrayLike, other: ArrayLike, rate: float, max_delay: float | None) -> Match:
    """Delay of one recording by the highest peak of the normalised cross-correlation.

    Where two recordings match, 1 minus their correlation is the energy of their noises over that of
    the signal, ε; over n samples it scatters by ε √(2/n). Two peaks cannot be told apart if their
    heights differ by less than `DOUBT` standard deviations of such a difference, and the part of
    ε that the change of overlap may cause. Of such peaks that of the shortest delay is taken.
    """
    a, low_rate = decimated(reference, rate, CORRELATION_RATE)
    b, _ = decimated(other, rate, CORRELATION_RATE)
    shorter = min(len(a), len(b))
    most = shorter // 2 if max_delay is None else min(int(max_delay * low_rate), shorter - 2)
    lags, c = normalised_correlation(a, b, most)
    best = int(np.argmax(c))
    peak = float(c[best])
    tops, _ = find_peaks(np.concatenate([[-1], c, [-1]]), height=0.5 * peak, prominence=0.1 * peak)
    tops = tops[tops != best + 1] - 1
    if not len(tops):
        snr = peak / max(1 - peak, 1e-12)
        return Match(_summit(lags, c, best) / low_rate, peak, 0.0, 1.0, None, False, snr)
    n = shorter - np.abs(lags[best])
    noise = max(1 - peak, 1e-12) / max(peak, 1e-12)
    apart = np.abs(lags[tops] - lags[best])
    thresholds = np.minimum(SAME, 1 - noise * (DOUBT * 2 / np.sqrt(n) + apart / n))
    ratios = _heights(c, tops) / _heights(c, np.array([best]))
    doubtful = ratios >= thresholds
    second = int(np.argmax(ratios))
    alike = np.append(tops[doubtful], best)
    chosen = int(alike[np.argmin(np.abs(lags[alike]))])
    others = np.abs(lags[alike[alike != chosen]] - lags[chosen])
    period = float(others.min() if len(others) else apart[second])
    return Match(
        _summit(lags, c, chosen) / low_rate, peak, float(ratios[second]),
        float(thresholds[second]), period / low_rate, bool(doubtful.any()), 1 / noise,
    )  # fmt: skip


def cross_correlation_delays(
    signals: Sequence[ArrayLike], rate: float, reference: int = 0, max_delay: float | None = None
) -> Array:
    """Delays of all recordings by cross-correlation, shape (recordings,), s.

    Parameters
    ----------
    signals : sequence of array_like
        The recordings.
    rate : float
        Their sample rate in Hz.
    reference : int
        Recording whose delay is 0.
    max_delay : float, optional
        Largest delay looked for in s; half of the shorter recording if not given.
    """
    return np.array(
        [
            0.0 if i == reference else match(signals[reference], x, rate, max_delay).delay
            for i, x in enumerate(signals)
        ]
    )


def tone_at(signal: Array, rate: float, frequency: float, centre: float) -> tuple[complex, float]:
    """Complex amplitude at time `centre` of a tone plus a constant, and its share of the energy."""
    t = np.arange(len(signal)) / rate - centre
    w = 2 * np.pi * frequency * t
    basis = np.stack([np.cos(w), np.sin(w), np.ones_like(w)], axis=1)
    fit, *_ = np.linalg.lstsq(basis, signal, rcond=None)
    explained = float(np.var(basis @ fit) / max(np.var(signal), 1e-300))
    return complex(fit[0], -fit[1]), explained


def tone_share(signal: Array, rate: float, frequency: float) -> float:
    """Share of a signal's variance that a tone explains."""
    return tone_at(signal, rate, frequency, len(signal) / rate / 2)[1]


def tone_frequency(signal: ArrayLike, rate: float, guess: float) -> float:
    """Frequency in Hz, within 10 % of a guess, of the tone that explains most of a signal."""
    x, low_rate = decimated(signal, rate, TONE_RATE * guess)
    resolution = low_rate / len(x)

    def missed(frequency: float) -> float:
        return -tone_share(x, low_rate, frequency)

    size = 1 << (8 * len(x)).bit_length()
    near = np.arange(int(0.9 * guess * size / low_rate) + 1, 1.1 * guess * size / low_rate)
    spectrum = np.abs(np.fft.rfft((x - x.mean()) * np.hanning(len(x)), size))
    best = near[np.argmax(spectrum[near.astype(int)])] * low_rate / size
    bounds = max(best - resolution / 2, 0.9 * guess), min(best + resolution / 2, 1.1 * guess)
    return float(minimize_scalar(missed, bounds=bounds, options={"xatol": 1e-9}).x)


def check_rate(rate: float, frequency: float) -> None:
    """Refuse a tone that has too few samples per period."""
    if not 0 < FEWEST * frequency <= rate:
        raise SynchronisationError(
            f"excitation.frequency_hz: given {frequency:g}, allowed: at most {rate / FEWEST:g} Hz, "
            f"{FEWEST} samples of the sound per period"
        )


def steady_part(x: Array, rate: float, frequency: float) -> tuple[float, float]:
    """Start and end in s of the longest part in which a tone keeps its amplitude within 15 %.

    Amplitudes are those of whole periods, compared with the median of the louder half.
    """
    check_rate(rate, frequency)
    period = rate / frequency
    n = round(period)
    edges = np.rint(np.arange(0, len(x) / period, 0.25) * period).astype(int)
    edges = edges[edges + n <= len(x)]
    if not len(edges):
        return 0.0, len(x) / rate
    w = 2 * np.pi * np.arange(n) / period
    fit = np.linalg.pinv(np.stack([np.cos(w), np.sin(w), np.ones_like(w)], axis=1))[:2]
    amplitudes = np.array([np.hypot(*(fit @ x[e : e + n])) for e in edges])
    loud = np.median(amplitudes[amplitudes >= np.median(amplitudes)])
    changes = np.diff(
        np.concatenate([[0], np.abs(amplitudes - loud) < 0.15 * loud, [0]]).astype(int)
    )
    starts, ends = np.flatnonzero(changes > 0), np.flatnonzero(changes < 0) - 1
    if not len(starts):
        return 0.0, 0.0
    longest = int(np.argmax(ends - starts))
    return float(edges[starts[longest]] / rate), float((edges[ends[longest]] + n) / rate)


def settled_part(x: Array, rate: float, frequency: float) -> tuple[float, float]:
    """The steady part without what is left in it of a tone that grows before or fades after it.

    That is its first period, and its last unless the recording ends with it.
    """
    start, end = steady_part(x, rate, frequency)
    fades = end < len(x) / rate - 0.5 / frequency
    return start + 1 / frequency, end - fades / frequency


def phase_delays(
    signals: Sequence[ArrayLike],
    rate: float,
    frequency: float,
    guess: ArrayLike,
    reference: int = 0,
) -> Array:
    """Delays from the phase of a tone, each the one nearest to a guess, shape (recordings,), s.

    Every recording is fitted with cos, sin and a constant over the same stretch of the signal: the
    reference's settled part, as far as all recordings hold it, in whole periods. So what is not a
    tone disturbs all phases alike, and a frequency that is slightly off does no harm.

    Parameters
    ----------
    signals : sequence of array_like
        The recordings.
    rate : float
        Their sample rate in Hz.
    frequency : float
        The tone's frequency in Hz.
    guess : array_like, shape (recordings,)
        Delays to within half a period, s.
    reference : int
        Recording whose delay is 0.

    Raises
    ------
    SynchronisationError
        If the recordings have less than one period of the steady tone in common, or a period has
        too few samples.
    """
    check_rate(rate, frequency)
    near = np.asarray(guess, float)
    near = near - near[reference]
    parts = [decimated(x, rate, TONE_RATE * frequency) for x in signals]
    low_rate = parts[0][1]
    start, end = settled_part(parts[reference][0], low_rate, frequency)
    start = max(start, float(near.max()))
    end = min([end, *(float(len(x) / low_rate + g) for (x, _), g in zip(parts, near, strict=True))])
    periods = int((end - start) * frequency)
    if periods < 1:
        raise SynchronisationError(
            f"the recordings share {max(end - start, 0):.3f} s of steady tone, allowed: at least "
            f"a period of {1 / frequency:.3f} s"
        )
    length = round(periods / frequency * low_rate)
    phases, centres = [], []
    for (x, _), g in zip(parts, near, strict=True):
        first = max(0, min(round((start - g) * low_rate), len(x) - length))
        centre = (first + (length - 1) / 2) / low_rate
        part = x[first : first + length]
        phases.append(np.angle(tone_at(part, low_rate, frequency, centre - first / low_rate)[0]))
        centres.append(centre)
    turn = (np.array(phases) - phases[reference]) / (2 * np.pi * frequency)
    delays = centres[reference] - np.array(centres) + turn
    return delays - np.rint((delays - near) * frequency) / frequency


def delay_deviation(frequency: float, snr: float, samples: int) -> float:
    """Least standard deviation of a delay from the phases of two tones in white noise, s.

    The Cramér–Rao bound of a phase, with frequency known, is 1 / (SNR · N) (Rife and Boorstyn
    1974); a delay has two of them.

    Parameters
    ----------
    frequency : float
        Frequency of the tone in Hz.
    snr : float
        Power of the tone over that of the noise.
    samples : int
        Samples N of each recording.
    """
    return float(np.sqrt(2 / (snr * samples)) / (2 * np.pi * frequency))
