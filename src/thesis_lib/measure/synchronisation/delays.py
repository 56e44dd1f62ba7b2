"""Estimators of the delay between recordings of one signal: correlation, and phase of a tone.

Recording i is xᵢ(t) = x_ref(t + delayᵢ). Correlation works at a few kHz, which keeps a clap sharp;
the phase of a tone at tens of samples per period, which keeps it cheap.

Peaks of correlation coefficients are found between samples.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.fft import irfft, rfft
from scipy.signal import find_peaks

from thesis_lib.arrays import Array, IntArray
from thesis_lib.measure.synchronisation.decimation import decimate_signal
from thesis_lib.measure.synchronisation.tones import (
    TONE_RATE,
    SynchronisationError,
    check_rate,
    settle_interval,
    tone_at,
)

NORMALISED_LAGS = 1 << 18  # that are normalised at once
CORRELATION_RATE = 4000  # Hz at which signals are correlated
MIN_CORRELATION = 0.3  # correlation below which two recordings have nothing in common
MIN_PEAK_SIGMAS = 5.0  # standard deviations by which one peak must beat the other
# Ratio of peaks from which on they are alike, as recordings never are quite
MAX_PEAK_RATIO = 0.9998


def correlation_coefficient(a: ArrayLike, b: ArrayLike, most: int) -> tuple[IntArray, Array]:
    """Return the correlation coefficient of a[j + lag] and b[j] over the j that both have.

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
        IntArray in samples, and −1…1.
    """
    n_x, n_y = len(np.asarray(a)), len(np.asarray(b))
    first, last = max(-most, 1 - n_y), min(most, n_x - 1)
    size = 1 << (max(n_x, n_y) + most - 1).bit_length()
    size = size // 4 * 3 if max(n_x, n_y) + most <= size // 4 * 3 else size
    product, other = rfft(_subtract_mean(a), size), rfft(_subtract_mean(b), size)
    product *= np.conj(other, out=other)
    del other
    values = irfft(product, size, overwrite_x=True)
    del product
    c = np.concatenate([values[first:] if first else values[:0], values[: last + 1]])
    del values
    sums_x, sums_y = _running(_subtract_mean(a)), _running(_subtract_mean(b))
    for k in range(0, len(c), NORMALISED_LAGS):
        lag = np.arange(first + k, min(first + k + NORMALISED_LAGS, last + 1))
        low, high = np.maximum(lag, 0), np.minimum(n_y + lag, n_x)  # the overlap, in x
        sum_x, energy_x = _energy(sums_x, low, high)
        sum_y, energy_y = _energy(sums_y, low - lag, high - lag)
        energy = np.sqrt(energy_x * energy_y)
        covariance = c[k : k + NORMALISED_LAGS] - sum_x * sum_y / (high - low)
        c[k : k + NORMALISED_LAGS] = np.divide(
            covariance, energy, out=np.zeros_like(energy), where=energy > 0
        )
    del sums_x, sums_y
    return np.arange(first, last + 1), c


def _subtract_mean(v: ArrayLike) -> Array:
    """Return a copy less its mean."""
    x = np.array(v, float)
    x -= x.mean()
    return x


def _running(v: Array) -> tuple[Array, Array]:
    """Return sums of the values and of their squares up to each sample."""
    first, second = np.zeros((2, len(v) + 1))
    np.cumsum(v, out=first[1:])
    np.cumsum(np.square(v, out=second[1:]), out=second[1:])
    return first, second


def _energy(sums: tuple[Array, Array], low: IntArray, high: IntArray) -> tuple[Array, Array]:
    """Return sum, and energy about the mean, of the samples from `low` to `high`."""
    total = sums[0][high] - sums[0][low]
    return total, np.maximum(sums[1][high] - sums[1][low] - total**2 / (high - low), 0)


def interpolate_peak(lags: IntArray, c: Array, top: int) -> float:
    """Return the lag of a peak between samples, by a polynomial through its cap.

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


def peak_heights(c: Array, tops: IntArray) -> Array:
    """Return heights of peaks between samples, by a parabola through the three highest of each."""
    left, middle, right = (c[np.clip(tops + k, 0, len(c) - 1)] for k in (-1, 0, 1))
    bend = np.maximum(2 * middle - left - right, 1e-15)
    return middle + np.minimum((right - left) ** 2 / bend, bend) / 8


@dataclass(frozen=True)
class Match:
    """Where one recording lies on another: delay in s, other peaks, certainty.

    `ratio`, `threshold`, `period`, `ambiguous` and `snr` are as in :class:`Synchronisation`, `peak`
    is the highest correlation, `least` what it must be.
    """

    delay: float
    peak: float
    ratio: float
    threshold: float
    period: float | None
    ambiguous: bool
    snr: float
    least: float = MIN_CORRELATION

    @property
    def certain(self) -> bool:
        """Return whether the recordings are alike, and in one place only."""
        return not self.ambiguous and self.peak >= self.least


def compare_signals(
    a: ArrayLike,
    b: ArrayLike,
    rate: float,
    max_delay: float | None,
    *,
    same: float = MAX_PEAK_RATIO,
    telling: int | None = None,
    least: float = 0.0,
    by_noise: bool = True,
    either_sign: bool = False,
) -> Match:
    """Return the delay by the highest peak of the normalised cross-correlation, at the given rate.

    Where two recordings match, 1 minus their correlation is the energy of their noises over that of
    the signal, ε; over n samples it scatters by ε √(2/n). Two peaks cannot be told apart if their
    heights differ by less than `DOUBT` standard deviations of such a difference, and the part of
    ε that the change of overlap may cause. Of such peaks that of the shortest delay is taken.

    Parameters
    ----------
    a, b : array_like, shape (samples of each,)
        The reference and the other recording.
    rate : float
        Their sample rate in Hz.
    max_delay : float or None
        Largest delay looked for in s; half of the shorter recording if not given.
    same : float
        Ratio of peaks from which on they are alike in any case.
    telling : int, optional
        Samples n in which there is anything; those that overlap if not given.
    least : float
        Other peaks nearer than this many s do not count.
    by_noise : bool
        Whether noise lowers the ratio from which on peaks are alike.
    either_sign : bool
        Whether one of the recordings may be inverted, as microphones are.
    """
    shorter = min(len(np.asarray(a)), len(np.asarray(b)))
    most = shorter // 2 if max_delay is None else min(int(max_delay * rate), shorter - 2)
    lags, c = correlation_coefficient(a, b, most)
    if either_sign and -c.min() > c.max():
        c = -c
    best = int(np.argmax(c))
    peak = float(c[best])
    tops, _ = find_peaks(np.concatenate([[-1], c, [-1]]), height=0.5 * peak, prominence=0.1 * peak)
    tops = tops[tops != best + 1] - 1
    tops = tops[np.abs(lags[tops] - lags[best]) > least * rate]
    if not len(tops):
        snr = peak / max(1 - peak, 1e-12)
        return Match(interpolate_peak(lags, c, best) / rate, peak, 0.0, 1.0, None, False, snr)
    overlap = shorter - np.abs(lags[best])
    noise = max(1 - peak, 1e-12) / max(peak, 1e-12)
    apart = np.abs(lags[tops] - lags[best])
    scatter = MIN_PEAK_SIGMAS * 2 / np.sqrt(telling or overlap)
    thresholds = np.minimum(same, 1 - by_noise * noise * (scatter + apart / overlap))
    ratios = peak_heights(c, tops) / peak_heights(c, np.array([best]))
    doubtful = ratios >= thresholds
    second = int(np.argmax(ratios))
    alike = np.append(tops[doubtful], best)
    chosen = int(alike[np.argmin(np.abs(lags[alike]))])
    others = np.abs(lags[alike[alike != chosen]] - lags[chosen])
    period = float(others.min() if len(others) else apart[second])
    return Match(
        interpolate_peak(lags, c, chosen) / rate,
        peak,
        float(ratios[second]),
        float(thresholds[second]),
        period / rate,
        bool(doubtful.any()),
        1 / noise,
    )


def match_signals(
    reference: ArrayLike, other: ArrayLike, rate: float, max_delay: float | None
) -> Match:
    """Return the delay of one recording after another; see :func:`compare_signals`."""
    a, low_rate = decimate_signal(reference, rate, CORRELATION_RATE)
    b, _ = decimate_signal(other, rate, CORRELATION_RATE)
    return compare_signals(a, b, low_rate, max_delay)


def phase_delays(
    signals: Sequence[ArrayLike],
    rate: float,
    frequency: float,
    guess: ArrayLike,
    reference: int = 0,
    steady: tuple[float, float] | None = None,
) -> Array:
    """Return delays from a sine's phase, each nearest to a guess, shape (recordings,), s.

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
    steady : tuple of float, optional
        Used instead of the reference's settled part, s after its first sample.

    Raises
    ------
    SynchronisationError
        If the recordings have less than one period of the steady tone in common, or a period has
        too few samples.
    """
    check_rate(rate, frequency)
    near = np.asarray(guess, float)
    near = near - near[reference]
    parts = [decimate_signal(x, rate, TONE_RATE * frequency) for x in signals]
    low_rate = parts[0][1]
    start, end = steady or settle_interval(parts[reference][0], low_rate, frequency)
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
        phases.append(np.angle(tone_at(part, low_rate, frequency, centre - first / low_rate)))
        centres.append(centre)
    turn = (np.array(phases) - phases[reference]) / (2 * np.pi * frequency)
    delays = centres[reference] - np.array(centres) + turn
    return delays - np.rint((delays - near) * frequency) / frequency


def delay_deviation(frequency: float, snr: float, samples: int) -> float:
    """Return least standard deviation of a delay from the phases of two tones in white noise, s.

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
