"""Delays from what does not repeat: the onset of a tone, a clap, a voice.

A steady tone matches itself at every period, and the longer it lasts the less weighs the one moment
that tells the periods apart. So a second look is taken at signals from which it has been removed
and in which only what stands out against the background is left. All of it treats each recording by
a rule that does not depend on time, and so leaves the delays.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.ndimage import uniform_filter1d
from scipy.signal import oaconvolve, welch

from thesis_lib.arrays import Signal
from thesis_lib.measure.synchronisation.decimation import decimate_signal
from thesis_lib.measure.synchronisation.delays import (
    CORRELATION_RATE,
    Match,
    compare_signals,
    match_signals,
)
from thesis_lib.measure.synchronisation.tones import (
    MIN_SAMPLES_PER_PERIOD,
    MIN_SETTLED_PERIODS,
    TONE_RATE,
    settle_interval,
    tone_frequency,
)

ROOM_RATE = 16000  # Hz at which the sound of microphones is correlated: a clap is 5 ms
ENERGY_SPAN_S = 0.01  # s over which the energy is averaged of what may stand out
MIN_ONSET_RATIO = 12  # times the upper quartile's distance from the median that it must stand out
MIN_ONSET_CORRELATION = 0.5  # correlation that what stands out must reach
ONSET_SAME = 0.95  # ratio of peaks from which on onsets are alike
CLAP_SAME = 0.9  # and claps
ROOM_SAME = 0.6  # and the whole sound of a room
FAR_ABOVE = 9.0  # times its scatter that the correlation of the whole sound must reach
WHITENING_BINS = 1024  # of the spectrum by which a room's sound is made white
WHITENING_DELAY = (
    WHITENING_BINS - 1 - WHITENING_BINS // 2
)  # samples that what is whitened starts later
SPECTRUM_PIECES = 32  # of a long sound that its spectrum is taken from
MIN_POWER_RATIO = 1e-6  # of the highest power; what is below is left as weak as it is


def without_tone(x: Signal, rate: float, frequency: float) -> Signal:
    """Return a signal less itself one period before, which cancels a steady tone.

    Unlike a fitted sinusoid, it needs no stretch over which the tone is steady and leaves no step
    at its ends; it removes harmonics and offsets, too, and forgives a frequency that drifts. Of an
    onset it leaves how much the tone grows in each period. The period need not be whole samples:
    two neighbours are weighted so that the tone itself is removed exactly.

    Parameters
    ----------
    x : ndarray, shape (samples,)
        The signal.
    rate, frequency : float
        Its sample rate and the tone's frequency in Hz.

    Returns
    -------
    ndarray, shape (samples less a period,)
        The rest; it starts a period later.
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

    The background is the median over time of short spectra, so that hum and rumble weigh no more
    than their share of the band and a clap stays what it is. Beyond 0.7 of the highest frequency
    less and less is left. Of a long signal `PIECES` pieces are looked at.

    Returns
    -------
    ndarray, shape (BINS,)
        Taps of a filter whose delay is `LATE` samples.
    """
    step = len(x) // SPECTRUM_PIECES
    if step > 2 * WHITENING_BINS:
        pieces = np.concatenate(
            [x[k * step : k * step + 2 * WHITENING_BINS] for k in range(SPECTRUM_PIECES)]
        )
        x = pieces if pieces.any() else x
    f, power = welch(x, rate, nperseg=WHITENING_BINS, average="median")
    if not power.any():  # silent for most of the time
        f, power = welch(x, rate, nperseg=WHITENING_BINS)
    gain = 1 / np.sqrt(power + MIN_POWER_RATIO * power.max())
    gain *= np.clip((0.95 - 2 * f / rate) / 0.25, 0, 1)
    gain[0] = 0
    taps = np.roll(np.fft.irfft(gain), WHITENING_BINS // 2) * np.hanning(WHITENING_BINS + 1)[:-1]
    return (taps / np.abs(taps).max()).astype(x.dtype)


def whiten_signal(x: Signal, rate: float) -> Signal:
    """Make the background of a signal equally strong at all frequencies, :func:`design_whitening`.

    Where the filter reaches beyond the ends of `x` at `rate` Hz nothing is left: `BINS` samples
    less.
    """
    return oaconvolve(x, design_whitening(x, rate), "valid")


def standing_out(x: Signal, rate: float) -> tuple[Signal, int]:
    """Return the part of a signal that is louder than its background ever gets by chance.

    Energies over `SPAN` s scatter; what counts as background is the median and, from the quartile,
    eight standard deviations. Each sample is weighed by how much of the energy around it is above.

    Returns
    -------
    ndarray, shape (samples,)
        The signal `x` at `rate` Hz, 0 where nothing stands out.
    int
        Number of samples where something does.
    """
    n = max(1, round(ENERGY_SPAN_S * rate))
    energy = uniform_filter1d(x * x, n)
    middle, upper = np.quantile(energy[:: max(1, n // 4)], [0.5, 0.75])
    background = middle + MIN_ONSET_RATIO * (upper - middle)
    weight = 1 - background / np.maximum(energy, max(background, 1e-300))
    weight *= x
    return weight.astype(np.float32), int(np.count_nonzero(weight))


def _largest(a: Signal, b: Signal, rate: float, max_delay: float | None) -> float:
    """Return the largest delay, s, as the whole recordings allow it."""
    half = min(len(a), len(b)) / 2 / rate
    return half if max_delay is None else min(max_delay, 2 * half)


def force_match(
    reference: ArrayLike,
    other: ArrayLike,
    rate: float,
    frequency: float | None,
    max_delay: float | None = None,
) -> Match:
    """Return the delay between recordings of the force's signal.

    By correlation; where that leaves doubt and the tone's frequency is known, by that of its onset,
    end, or a clap: :func:`without_tone`, :func:`standing_out`. Peaks within half a period of the
    highest do not count there, as the tone's phase tells between them.

    Parameters
    ----------
    reference, other : array_like, shape (samples of each,)
        The recordings.
    rate : float
        Their sample rate in Hz.
    frequency : float or None
        Frequency of the tone in Hz, to within 1 %.
    max_delay : float, optional
        Largest delay looked for in s; half of the shorter recording if not given.
    """
    a, low_rate = decimate_signal(reference, rate, CORRELATION_RATE)
    b, _ = decimate_signal(other, rate, CORRELATION_RATE)
    whole = match_signals(a, b, low_rate, max_delay)
    if whole.certain or frequency is None or MIN_SAMPLES_PER_PERIOD * frequency > low_rate:
        return whole
    if min(len(a), len(b)) < 2 * MIN_SETTLED_PERIODS * low_rate / frequency:
        return whole
    most = _largest(a, b, low_rate, max_delay)
    tone, tone_rate = decimate_signal(a, low_rate, TONE_RATE * frequency)
    start, end = settle_interval(tone, tone_rate, frequency)
    if (end - start) * frequency > MIN_SETTLED_PERIODS - 0.1:
        part = tone[round(start * tone_rate) : round(end * tone_rate)]
        frequency = tone_frequency(part, tone_rate, frequency)
    loud_a, n_a = standing_out(without_tone(a, low_rate, frequency), low_rate)
    loud_b, n_b = standing_out(without_tone(b, low_rate, frequency), low_rate)
    if not n_a or not n_b:
        return whole
    loud = compare_signals(
        loud_a,
        loud_b,
        low_rate,
        most,
        same=ONSET_SAME,
        telling=min(n_a, n_b),
        least=0.5 / frequency,
    )
    loud = replace(loud, least=MIN_ONSET_CORRELATION, snr=whole.snr)
    return loud if loud.certain else whole


def room_match(
    reference: ArrayLike, other: ArrayLike, rate: float, max_delay: float | None = None
) -> Match:
    """Return the delay between recordings of sound in a room; not certain if in doubt.

    First by all that they hear, :func:`whiten_signal`: certain if the highest correlation is far
    above the 1/√n by which unlike sounds of n samples scatter, and no other comes near it. Else by
    what stands out, as claps, which must be alike.

    Two single knocks that are alike, each heard by one camera alone, cannot be told from one that
    both hear: several claps at irregular intervals can.

    Parameters
    ----------
    reference, other : array_like, shape (samples of each,)
        The recordings.
    rate : float
        Their sample rate in Hz.
    max_delay : float, optional
        Largest delay looked for in s; half of the shorter recording if not given.
    """
    a, low_rate = decimate_signal(reference, rate, ROOM_RATE)
    b, _ = decimate_signal(other, rate, ROOM_RATE)
    most = _largest(a, b, low_rate, max_delay)
    a, b = whiten_signal(a, low_rate), whiten_signal(b, low_rate)
    whole = compare_signals(a, b, low_rate, most, same=ROOM_SAME, by_noise=False, either_sign=True)
    n = min(len(a), len(b)) - abs(whole.delay) * low_rate
    whole = replace(whole, least=float(FAR_ABOVE / np.sqrt(n)))
    if whole.certain:
        return whole
    (loud_a, n_a), (loud_b, n_b) = standing_out(a, low_rate), standing_out(b, low_rate)
    if not n_a or not n_b:
        return whole
    loud = compare_signals(
        loud_a,
        loud_b,
        low_rate,
        most,
        same=CLAP_SAME,
        telling=min(n_a, n_b),
        either_sign=True,
    )
    loud = replace(loud, least=MIN_ONSET_CORRELATION)
    return loud if loud.certain else whole
