"""Amplitude, frequency, explained variance and steady-state interval of a sine ("tone").

A sine is fitted at tens of samples per period, which is cheap. The force signal of a harmonic
excitation must contain one.
"""

from collections.abc import Iterable

import numpy as np
import scipy

from thesis_lib.arrays import Signal
from thesis_lib.measure.synchronisation.audio import SynchronisationError, decimate_signal

Interval = tuple[float, float]

TONE_RATE = 64  # samples per period at which a sine's phase is fitted
MIN_SAMPLES_PER_PERIOD = 8  # fewest samples per period for a fit
MIN_SETTLED_PERIODS = 3  # shortest steady-state interval in periods
MIN_LOUD_RATIO = 0.5  # of the 95 % quantile of amplitudes, above which an amplitude is loud
MIN_EXPLAINED_SHARE = 0.8  # share of the variance, up to some harmonics, a sine must explain
MAX_FREQUENCY_ERROR = 0.01  # largest accepted relative error of a given frequency
MAX_SLIP_TURNS = 0.16  # or largest accepted phase error over the whole length, in turns
FITTED_SAMPLES = 1 << 16  # samples per step of a fit
SPECTRUM_SAMPLES = 1 << 18  # samples per spectrum


def fit_tone(
    blocks: Iterable[Signal], rate: float, frequency: float, centre: float
) -> tuple[complex, float]:
    """Fit a sine plus a constant to a signal in blocks by least squares.

    The signal (samples,) has a rate in Hz. Return the complex amplitude, time factor e^{+jωt}, at
    `centre` s after the first sample, and the share of the variance that the sine explains.
    """
    normal, right, squares, count = np.zeros((3, 3)), np.zeros(3), 0.0, 0
    for block in blocks:
        for k in range(0, len(x := np.asarray(block, float)), FITTED_SAMPLES):
            part = x[k : k + FITTED_SAMPLES]
            w = 2 * np.pi * frequency * ((count + np.arange(len(part))) / rate - centre)
            basis = np.stack([np.cos(w), np.sin(w), np.ones_like(w)])
            normal, right = normal + basis @ basis.T, right + basis @ part
            squares, count = squares + float(part @ part), count + len(part)
    fit, *_ = np.linalg.lstsq(normal, right, rcond=None)
    n = max(count, 1)
    explained = fit @ normal @ fit / n - (normal[2] @ fit / n) ** 2
    variance = squares / n - (right[2] / n) ** 2
    return complex(fit[0], -fit[1]), float(explained / max(variance, 1e-300))


def _tone_share(signal: Signal, rate: float, frequency: float) -> float:
    """Return the share of a signal's variance that a sine explains."""
    return fit_tone([signal], rate, frequency, len(signal) / rate / 2)[1]


def _strongest_frequency(
    x: Signal, rate: float, low: float, high: float, most: int | None = None
) -> float:
    """Return the frequency in Hz from `low` to `high` at which a signal's spectrum is highest.

    Its error is at most a quarter of 1 / length; if `most` is given, spectra of parts of so many
    samples are added, and the length is that of a part.
    """
    n = len(x) if most is None else min(len(x), most)
    size = scipy.fft.next_fast_len(4 * n, real=True)
    window, power = np.hanning(n), np.zeros(size // 2 + 1)
    for k in range(0, len(x) - n + 1, n):
        part = x[k : k + n]
        power += np.abs(scipy.fft.rfft((part - part.mean(dtype=float)) * window, size)) ** 2
    near = np.arange(int(low * size / rate) + 1, min(high * size / rate, len(power)), dtype=int)
    return float(near[np.argmax(power[near])] * rate / size) if len(near) else low


def tone_frequency(x: Signal, rate: float, guess: float) -> float:
    """Estimate the frequency in Hz, within 10 % of a guess, that explains most of a signal.

    The signal has some tens of samples per period.
    """
    resolution, low, high = rate / len(x), 0.9 * guess, 1.1 * guess
    coarse = x, rate
    if len(x) > SPECTRUM_SAMPLES:
        coarse = decimate_signal(x, rate, MIN_SAMPLES_PER_PERIOD * guess)
    best = _strongest_frequency(*coarse, low, high)
    bounds = max(-resolution / 2, low - best), min(resolution / 2, high - best)
    found = scipy.optimize.minimize_scalar(
        lambda off: -_tone_share(x, rate, best + off),
        bounds=bounds,
        options={"xatol": 1e-6 * resolution},
    )
    return best + float(found.x)


def frequency_deviation(x: Signal, rate: float, frequency: float) -> float:
    """Return the standard error in Hz of :func:`tone_frequency` from the noise near the sine.

    It is the Cramér–Rao bound of a frequency, √(3 / (SNR · N)) / (π T) (Rife and Boorstyn 1974),
    with the noise of the residual from half to twice the frequency. The error of the sample clock,
    some 10⁻⁵ in cameras, is not included.
    """
    amplitude, _ = fit_tone([x], rate, frequency, 0.0)
    n = min(len(x), SPECTRUM_SAMPLES)
    f, window, powers = np.fft.rfftfreq(n, 1 / rate), np.hanning(n), []
    near = (f > 0.5 * frequency) & (f < 2 * frequency)
    for k in range(0, len(x) - n + 1, n):
        w = 2 * np.pi * frequency / rate * np.arange(k, k + n)
        left = x[k : k + n] - amplitude.real * np.cos(w) + amplitude.imag * np.sin(w)
        spectrum = scipy.fft.rfft((left - left.mean()) * window)
        powers.append(np.mean(np.abs(spectrum[near]) ** 2) / (window @ window))
    noise = float(np.mean(powers))
    seconds = len(x) / rate
    return float(np.sqrt(6 * noise / (abs(amplitude) ** 2 * len(x))) / (np.pi * seconds))


def settle_interval(x: Signal, rate: float, frequency: float) -> Interval:
    """Detect start and end of a sine's steady-state interval in s.

    It is the longest interval in which the amplitude is constant within 15 %, less its first
    period, and less its last unless the recording ends with it. Amplitudes of whole periods are
    compared with the median of the louder half; if that leaves too few, since the sine lasts for
    less than a quarter of the recording, with the median of the loud ones (`MIN_LOUD_RATIO`).
    """
    period = rate / frequency
    n = round(period)
    edges = np.rint(np.arange(0, len(x) / period, 0.25) * period).astype(int)
    edges = edges[edges + n <= len(x)]
    if not len(edges):
        return 1 / frequency, len(x) / rate
    w = 2 * np.pi * np.arange(n) / period
    fit = np.linalg.pinv(np.stack([np.cos(w), np.sin(w), np.ones_like(w)], axis=1))[:2]
    amplitudes = np.array([np.hypot(*(fit @ x[e : e + n])) for e in edges])
    tries = []
    for least in (np.median(amplitudes), MIN_LOUD_RATIO * np.quantile(amplitudes, 0.95)):
        loud = np.median(amplitudes[amplitudes >= least])
        steady = np.abs(amplitudes - loud) < 0.15 * loud
        changes = np.diff(steady.astype(int), prepend=0, append=0)
        starts, ends = np.flatnonzero(changes > 0), np.flatnonzero(changes < 0) - 1
        start = end = 0.0
        if len(starts):
            k = int(np.argmax(ends - starts))
            start, end = float(edges[starts[k]] / rate), float((edges[ends[k]] + n) / rate)
        fades = end < len(x) / rate - 0.5 / frequency
        tries.append((start + 1 / frequency, end - fades / frequency))
    enough = (MIN_SETTLED_PERIODS - 0.1) / frequency
    return next((one for one in tries if one[1] - one[0] > enough), tries[0])


def check_tone(
    x: Signal, rate: float, frequency: float, name: str, steady: Interval | None = None
) -> None:
    """Refuse a recording without a sine of that frequency, or with too short a one.

    It has some tens of samples per period. The sine is fitted in its steady-state interval, or from
    `steady[0]` to `steady[1]` s after the first sample.
    """
    start, end = settle_interval(x, rate, frequency)
    if steady is not None:
        start, end = max(steady[0], 0.0), min(steady[1], len(x) / rate)
    if not (end - start) * frequency > MIN_SETTLED_PERIODS - 0.1:
        raise SynchronisationError(
            f"{name}: {max(end - start, 0):.3f} s of steady tone of {frequency:g} Hz, allowed: at "
            f"least {MIN_SETTLED_PERIODS / frequency:.3f} s, {MIN_SETTLED_PERIODS} periods"
        )
    part = x[round(start * rate) : round(end * rate)]
    found = tone_frequency(part, rate, frequency)
    share = _tone_share(part, rate, found)
    if share < MIN_EXPLAINED_SHARE:
        raise SynchronisationError(
            f"{name}: a tone near {frequency:g} Hz is {100 * share:.0f} % of the sound, allowed: "
            f"at least {100 * MIN_EXPLAINED_SHARE:g} %"
        )
    most = max(MAX_FREQUENCY_ERROR, MAX_SLIP_TURNS / ((end - start) * frequency))
    if (
        abs(found / frequency - 1) > most
        or _tone_share(part, rate, frequency) < MIN_EXPLAINED_SHARE
    ):
        digits = 1 + max(0, int(np.ceil(np.log10(end - start))))
        raise SynchronisationError(
            f"excitation.frequency_hz: given {frequency:g}, but the sound of {name} has "
            f"{round(found, 1 + digits):g} Hz"
        )


def find_tone(
    x: Signal, rate: float, name: str, steady: Interval | None = None
) -> tuple[float, float]:
    """Estimate the frequency in Hz of a recording's strongest sine, and the sine's length in s.

    The search starts at the highest line of the spectrum below an eighth of the rate. The frequency
    is the one that explains most of the steady-state interval, or of that from `steady[0]` to
    `steady[1]` s after the first sample. A sine that explains too little of the sound is refused.
    """
    if steady is not None:
        x = x[max(round(steady[0] * rate), 0) : max(round(steady[1] * rate), 0)]
    share, guess, seconds = 0.0, 0.0, len(x) / rate
    if seconds * rate > MIN_SAMPLES_PER_PERIOD * MIN_SETTLED_PERIODS:
        guess = _strongest_frequency(
            x, rate, MIN_SETTLED_PERIODS / seconds, rate / MIN_SAMPLES_PER_PERIOD, SPECTRUM_SAMPLES
        )
        tone, low_rate = decimate_signal(x, rate, TONE_RATE * guess)
        whole = 0.0, len(tone) / low_rate
        start, end = whole if steady else settle_interval(tone, low_rate, guess)
        if (end - start) * guess > MIN_SETTLED_PERIODS - 0.1:
            part = tone[round(start * low_rate) : round(end * low_rate)]
            guess, seconds = tone_frequency(part, low_rate, guess), end - start
            share = _tone_share(part, low_rate, guess)
    if share < MIN_EXPLAINED_SHARE:
        raise SynchronisationError(
            f"{name}: no steady tone below {rate / MIN_SAMPLES_PER_PERIOD:g} Hz in the sound, of "
            f"which it must be {100 * MIN_EXPLAINED_SHARE:g} % (that of {guess:.4g} Hz is "
            f"{100 * share:.0f} %); give excitation.frequency_hz, or sound: room"
        )
    return guess, seconds
