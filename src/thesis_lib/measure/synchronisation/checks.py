"""What sound must be to synchronise by: long enough, not silent or clipped, with a steady tone."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np
from numpy.typing import ArrayLike

from thesis_lib.arrays import Array
from thesis_lib.measure.recordings.audio import MAX_SILENT_RMS
from thesis_lib.measure.synchronisation.decimation import decimate_signal
from thesis_lib.measure.synchronisation.tones import (
    MAX_FREQUENCY_ERROR,
    MAX_SLIP_TURNS,
    MIN_EXPLAINED_SHARE,
    MIN_SAMPLES_PER_PERIOD,
    MIN_SETTLED_PERIODS,
    SPECTRUM_SAMPLES,
    TONE_RATE,
    SynchronisationError,
    settle_interval,
    strongest_frequency,
    tone_frequency,
    tone_share,
)

FULL_SCALE = 1 - 1e-4  # from here on a sample counts as clipped
MAX_CLIPPED_SHARE = 0.02  # share of such samples that is refused; a tone that just fits has 0.009


def same_rate(rates: Sequence[float], names: Sequence[str]) -> None:
    """Refuse recordings of different sample rates, naming the first."""
    for rate, name in zip(rates, names, strict=True):
        if rate != rates[0]:
            raise SynchronisationError(
                f"{name}: sample rate {rate:g} Hz, allowed: {rates[0]:g} Hz as {names[0]}"
            )


def shortest_of(frequency: float | None) -> float:
    """Return the length in s that a recording must have."""
    return 0.5 if frequency is None else 2.5 / frequency


def check_blocks(
    blocks: Iterable[ArrayLike], rate: float, shortest: float, name: str
) -> Iterator[Array]:
    """Yield the blocks of a recording as they come; refuse at its end one that cannot be used.

    Parameters
    ----------
    blocks : iterable of array_like, shape (samples,)
        The recording, −1…1.
    rate : float
        Its sample rate in Hz.
    shortest : float
        Length in s that it must have.
    name : str
        Its name, for errors.

    Raises
    ------
    SynchronisationError
        Naming it, if it is too short, clipped or silent.
    """
    count, mean, squares, clipped = 0, 0.0, 0.0, 0
    for block in blocks:
        x = np.asarray(block, float)
        if x.ndim != 1 or not np.isfinite(x).all():
            raise SynchronisationError(f"{name}: audio of shape {x.shape}, allowed: finite, mono")
        if len(x):
            off, n = float(x.mean()) - mean, count + len(x)
            squares += float(np.var(x)) * len(x) + off**2 * count * len(x) / n
            count, mean = n, mean + off * len(x) / n
            clipped += int(np.count_nonzero(np.abs(x) >= FULL_SCALE))
        yield x
    if not count or count < shortest * rate:
        raise SynchronisationError(
            f"{name}: {count / rate:.3f} s of audio, allowed: at least {shortest:.3f} s"
        )
    level = float(np.sqrt(squares / count))
    if level < MAX_SILENT_RMS:
        raise SynchronisationError(
            f"{name}: silent audio (rms {level:.1e} of full scale), allowed: at least "
            f"{MAX_SILENT_RMS}"
        )
    if clipped > MAX_CLIPPED_SHARE * count:
        raise SynchronisationError(
            f"{name}: clipped audio ({100 * clipped / count:.1f} % of the samples at full scale), "
            f"allowed: at most {100 * MAX_CLIPPED_SHARE:g} %"
        )


def check_signals(
    signals: Sequence[ArrayLike], rates: Sequence[float], shortest: float, names: Sequence[str]
) -> None:
    """Refuse recordings of other rates, too short, clipped or silent ones.

    Raises
    ------
    SynchronisationError
        Naming the first such recording.
    """
    if len(signals) < 2:
        raise SynchronisationError(f"given {len(signals)} recordings, allowed: at least 2")
    same_rate(rates, names)
    for signal, rate, name in zip(signals, rates, names, strict=True):
        for _ in check_blocks([signal], rate, shortest, name):
            pass


def check_tone(
    signal: ArrayLike,
    rate: float,
    frequency: float,
    name: str,
    steady: tuple[float, float] | None = None,
) -> None:
    """Refuse a recording that holds no steady tone of that frequency, or too little of it.

    Only what lies below half of `TONE_RATE` samples per period counts. It is sought where it has
    settled, or from `steady[0]` to `steady[1]` s after the first sample.

    Raises
    ------
    SynchronisationError
        Naming it.
    """
    x, low_rate = decimate_signal(signal, rate, TONE_RATE * frequency)
    start, end = settle_interval(x, low_rate, frequency)
    if steady is not None:
        start, end = max(steady[0], 0.0), min(steady[1], len(x) / low_rate)
    if not (end - start) * frequency > MIN_SETTLED_PERIODS - 0.1:
        raise SynchronisationError(
            f"{name}: {max(end - start, 0):.3f} s of steady tone of {frequency:g} Hz, allowed: at "
            f"least {MIN_SETTLED_PERIODS / frequency:.3f} s, {MIN_SETTLED_PERIODS} periods"
        )
    part = x[round(start * low_rate) : round(end * low_rate)]
    found = tone_frequency(part, low_rate, frequency)
    share = tone_share(part, low_rate, found)
    if share < MIN_EXPLAINED_SHARE:
        raise SynchronisationError(
            f"{name}: a tone near {frequency:g} Hz is {100 * share:.0f} % of the sound, allowed: "
            f"at least {100 * MIN_EXPLAINED_SHARE:g} %"
        )
    off = abs(found / frequency - 1) > max(
        MAX_FREQUENCY_ERROR, MAX_SLIP_TURNS / ((end - start) * frequency)
    )
    if off or tone_share(part, low_rate, frequency) < MIN_EXPLAINED_SHARE:
        digits = 1 + max(0, int(np.ceil(np.log10(end - start))))
        raise SynchronisationError(
            f"excitation.frequency_hz: given {frequency:g}, but the sound of {name} has "
            f"{round(found, 1 + digits):g} Hz"
        )


def find_tone(
    signal: ArrayLike, rate: float, name: str, steady: tuple[float, float] | None = None
) -> tuple[float, float]:
    """Estimate the steady tone of a recording.

    That of the highest line of the spectrum, up to an eighth of the rate; its frequency is that
    which explains most of the part in which the tone has settled.

    Parameters
    ----------
    signal : array_like, shape (samples,)
        The recording.
    rate : float
        Its sample rate in Hz.
    name : str
        Its name, for errors.
    steady : tuple of float, optional
        Used instead of the settled part, s after the first sample.

    Returns
    -------
    frequency : float
        In Hz.
    seconds : float
        Length of the part in s.

    Raises
    ------
    SynchronisationError
        If there is no such tone, or it explains less than `EXPLAINED` of the sound.
    """
    x = np.asarray(signal)
    if steady is not None:
        x = x[max(round(steady[0] * rate), 0) : max(round(steady[1] * rate), 0)]
    share, guess, seconds = 0.0, 0.0, len(x) / rate
    if seconds * rate > MIN_SAMPLES_PER_PERIOD * MIN_SETTLED_PERIODS:
        guess = strongest_frequency(
            x, rate, MIN_SETTLED_PERIODS / seconds, rate / MIN_SAMPLES_PER_PERIOD, SPECTRUM_SAMPLES
        )
        tone, low_rate = decimate_signal(x, rate, TONE_RATE * guess)
        start, end = (
            (0.0, len(tone) / low_rate) if steady else settle_interval(tone, low_rate, guess)
        )
        if (end - start) * guess > MIN_SETTLED_PERIODS - 0.1:
            part = tone[round(start * low_rate) : round(end * low_rate)]
            guess, seconds = tone_frequency(part, low_rate, guess), end - start
            share = tone_share(part, low_rate, guess)
    if share < MIN_EXPLAINED_SHARE:
        raise SynchronisationError(
            f"{name}: no steady tone below {rate / MIN_SAMPLES_PER_PERIOD:g} Hz in the sound, of "
            "which it must be "
            f"{100 * MIN_EXPLAINED_SHARE:g} % (that of {guess:.4g} Hz is {100 * share:.0f} %); "
            "give "
            "excitation.frequency_hz, or sound: room"
        )
    return guess, seconds
