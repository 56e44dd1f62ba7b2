"""When each camera started, from the sound that all of them recorded (thesis 5.1.2, eq. 5.2).

The force signal s is fed to every camera's audio input. Camera i, started at world time Tᵢ, records
xᵢ(t) = s(t + Tᵢ). Its *delay* is Tᵢ minus the start of the reference camera, so that
xᵢ(t) = x_ref(t + delayᵢ), and what happens at T appears in recording i at T − Tᵢ.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from thesis_lib.experiment.delays import (
    CORRELATION_RATE,
    TONE_RATE,
    SynchronisationError,
    check_rate,
    cross_correlation_delays,
    decimated,
    delay_deviation,
    match,
    normalised_correlation,
    phase_delays,
    settled_part,
    tone_frequency,
    tone_share,
)

__all__ = ["Synchronisation", "SynchronisationError", "check_signal", "check_signals",
           "check_tone", "coupling_delay", "cross_correlation_delays", "delay_deviation",
           "normalised_correlation", "phase_delays", "same_rate", "synchronise", "tone_frequency",
           "whole_frames"]  # fmt: skip

Array = NDArray[np.float64]

FULL_SCALE = 1 - 1e-4  # from here on a sample counts as clipped
CLIPPED = 0.02  # share of such samples that is refused; a tone that just fits has 0.009
SILENCE = 1e-4  # rms below which there is no signal: three steps of 16 bits
UNLIKE = 0.3  # correlation below which two recordings have nothing in common
PERIODS = 3  # of the settled tone that a recording must hold
EXPLAINED = 0.8  # share of its variance, up to some harmonics, that the tone must explain
OFF = 0.01  # relative error of the frequency that is not refused
SLIP = 0.16  # turns over the length that are not, either
BLIND_SPOTS = (
    "Sound alone does not show an offset between a camera's picture and its sound.",
    "Nor does it show whether the clocks of picture and sound drift apart.",
)


@dataclass(frozen=True)
class Synchronisation:
    """Starts of all cameras.

    Parameters
    ----------
    delays : ndarray, shape (cameras,)
        Start of each camera minus that of the reference, s.
    frames : ndarray of int, shape (cameras,)
        The same in whole frames (eq. 5.2).
    frame_rate : float
        Frames per second.
    reference : int
        Index of the reference camera.
    method : str
        ``phase`` of a tone of known frequency, or ``correlation``.
    period : float or None
        Whole multiples of this many seconds are in doubt, or would be for a pure tone; None if
        nothing in the signal repeats.
    ratio : float
        Second highest peak of the correlation over the highest, the largest of all cameras.
    threshold : float
        Ratio from which on the two cannot be told apart.
    ambiguous : bool
        Whether `ratio` reaches `threshold`; then the shortest possible delays are given.
    snr : float
        Signal-to-noise power ratio up to half of the correlation's rate, the smallest of all.
    """

    delays: Array
    frames: NDArray[np.int64]
    frame_rate: float
    reference: int
    method: str
    period: float | None
    ratio: float
    threshold: float
    ambiguous: bool
    snr: float

    def describe(self) -> list[str]:
        """Sentences for a report: what was found, how sure it is, and what sound cannot show."""
        others = [i for i in range(len(self.delays)) if i != self.reference]
        lines = [
            f"Recording {i} started {self.delays[i]:+.6f} s after recording {self.reference}: "
            f"{self.delays[i] * self.frame_rate:+.3f} frames, {self.frames[i]:+d} in whole frames."
            for i in others
        ]
        how = {"phase": "the phase of the tone", "correlation": "the peak of the correlation"}
        lines.append(
            f"Delays come from {how[self.method]}; the signal is at least "
            f"{10 * np.log10(self.snr):.0f} dB above the noise (below {CORRELATION_RATE // 2} Hz)."
        )
        if self.ambiguous:
            assert self.period is not None
            lines.append(
                f"Ambiguous by whole periods of {self.period:.4f} s: another peak of the "
                f"correlation is {self.ratio:.5f} of the highest (from {self.threshold:.5f} on the "
                "two cannot be told apart); the shortest delays were taken."
            )
        else:
            lines.append(
                f"Not ambiguous: the second peak of the correlation is {self.ratio:.5f} of the "
                f"highest, below {self.threshold:.5f}."
            )
        return [*lines, *BLIND_SPOTS, self._coupling()]

    def _coupling(self) -> str:
        """What AC-coupled inputs may do."""
        what = "tones are shifted"
        if self.period is not None:
            shift = self.frame_rate * coupling_delay(1 / self.period)
            what = (
                f"a tone of {1 / self.period:.4g} Hz is shifted by {shift:.2g} frame of "
                f"1/{self.frame_rate:g} s"
            )
        return (
            f"Audio inputs are AC-coupled: {what} between corners of 2 and 3 Hz, so recordings of "
            "different inputs need something broadband, as a clap."
        )


def coupling_delay(frequency: float) -> float:
    """Delay in s of a tone between first-order high-passes with corners of 2 and 3 Hz."""
    return float((np.arctan(3 / frequency) - np.arctan(2 / frequency)) / (2 * np.pi * frequency))


def whole_frames(delays: ArrayLike, frame_rate: float) -> NDArray[np.int64]:
    """Delays in whole frames, N = Δt · fps (eq. 5.2), rounded to the nearest."""
    return np.rint(np.asarray(delays, float) * frame_rate).astype(np.int64)


def same_rate(rates: Sequence[float], names: Sequence[str]) -> None:
    """Refuse recordings of different sample rates, naming the first."""
    for rate, name in zip(rates, names, strict=True):
        if rate != rates[0]:
            raise SynchronisationError(
                f"{name}: sample rate {rate:g} Hz, allowed: {rates[0]:g} Hz as {names[0]}"
            )


def shortest_of(frequency: float | None) -> float:
    """Length in s that a recording must have."""
    return 0.5 if frequency is None else 2.5 / frequency


def check_signal(signal: ArrayLike, rate: float, shortest: float, name: str) -> None:
    """Refuse a recording that is too short, clipped or silent.

    Raises
    ------
    SynchronisationError
        Naming it.
    """
    x = np.asarray(signal, float)
    if x.ndim != 1 or not np.isfinite(x).all():
        raise SynchronisationError(f"{name}: audio of shape {x.shape}, allowed: finite, mono")
    if len(x) < shortest * rate:
        raise SynchronisationError(
            f"{name}: {len(x) / rate:.3f} s of audio, allowed: at least {shortest:.3f} s"
        )
    level = float(np.std(x))
    if level < SILENCE:
        raise SynchronisationError(
            f"{name}: silent audio (rms {level:.1e} of full scale), allowed: at least {SILENCE}"
        )
    clipped = float(np.mean(np.abs(x) >= FULL_SCALE))
    if clipped > CLIPPED:
        raise SynchronisationError(
            f"{name}: clipped audio ({100 * clipped:.1f} % of the samples at full scale), "
            f"allowed: at most {100 * CLIPPED:g} %"
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
        check_signal(signal, rate, shortest, name)


def check_tone(signal: ArrayLike, rate: float, frequency: float, name: str) -> None:
    """Refuse a recording that holds no steady tone of that frequency, or too little of it.

    Only what lies below half of `TONE_RATE` samples per period counts.

    Raises
    ------
    SynchronisationError
        Naming it.
    """
    x, low_rate = decimated(signal, rate, TONE_RATE * frequency)
    start, end = settled_part(x, low_rate, frequency)
    if not (end - start) * frequency > PERIODS - 0.1:
        raise SynchronisationError(
            f"{name}: {max(end - start, 0):.3f} s of steady tone of {frequency:g} Hz, allowed: at "
            f"least {PERIODS / frequency:.3f} s, {PERIODS} periods"
        )
    part = x[round(start * low_rate) : round(end * low_rate)]
    found = tone_frequency(part, low_rate, frequency)
    share = tone_share(part, low_rate, found)
    if share < EXPLAINED:
        raise SynchronisationError(
            f"{name}: a tone near {frequency:g} Hz is {100 * share:.0f} % of the sound, allowed: "
            f"at least {100 * EXPLAINED:g} %"
        )
    off = abs(found / frequency - 1) > max(OFF, SLIP / ((end - start) * frequency))
    if off or tone_share(part, low_rate, frequency) < EXPLAINED:
        digits = 1 + max(0, int(np.ceil(np.log10(end - start))))
        raise SynchronisationError(
            f"excitation.frequency_hz: given {frequency:g}, but the sound of {name} has "
            f"{round(found, 1 + digits):g} Hz"
        )


def synchronise(
    signals: Sequence[ArrayLike],
    rate: float | Sequence[float],
    frame_rate: float,
    frequency: float | None = None,
    *,
    starts: ArrayLike = 0.0,
    reference: int = 0,
    max_delay: float | None = None,
    names: Sequence[str] | None = None,
    checked: bool = False,
) -> Synchronisation:
    """Starts of all cameras from their sound.

    Parameters
    ----------
    signals : sequence of array_like
        Sound of each recording, −1…1.
    rate : float or sequence of float
        Sample rate in Hz; if one is given for each, they must be equal.
    frame_rate : float
        Frames per second.
    frequency : float, optional
        Frequency of a steady tone in Hz; without one, correlation alone is used.
    starts : array_like, shape (recordings,) or ()
        Time of each first sample after the first frame, s.
    reference : int
        Recording whose delay is 0.
    max_delay : float, optional
        Largest delay looked for in s; half of the shorter recording if not given.
    names : sequence of str, optional
        Names of the recordings for errors.
    checked : bool
        Whether :func:`check_signal` has been done, as it must be before they are decimated.

    Raises
    ------
    SynchronisationError
        In one line: the recording and what is wrong with it.
    """
    names = names or [f"recording {i}" for i in range(len(signals))]
    rates = [float(r) for r in np.broadcast_to(np.asarray(rate, float), len(signals))]
    if not checked:
        check_signals(signals, rates, shortest_of(frequency), names)
    if frequency is not None:
        check_rate(rates[0], frequency)
    matches = {
        i: match(signals[reference], x, rates[0], max_delay)
        for i, x in enumerate(signals)
        if i != reference
    }
    for i, found in matches.items():
        if found.peak < UNLIKE:
            raise SynchronisationError(
                f"{names[i]}: correlation of {found.peak:.2f} with {names[reference]}, allowed: "
                f"at least {UNLIKE}; do both hold the same sound?"
            )
    delays = np.array([matches[i].delay if i in matches else 0.0 for i in range(len(signals))])
    if frequency is not None:
        for signal, name in zip(signals, names, strict=True):
            check_tone(signal, rates[0], frequency, name)
        delays = phase_delays(signals, rates[0], frequency, delays, reference)
    worst = max(matches.values(), key=lambda found: (found.ambiguous, found.ratio))
    shift = np.broadcast_to(np.asarray(starts, float), len(signals))
    delays = delays - (shift - shift[reference])
    repeats = 1 / frequency if frequency is not None else worst.period
    return Synchronisation(
        delays=delays,
        frames=whole_frames(delays, frame_rate),
        frame_rate=frame_rate,
        reference=reference,
        method="correlation" if frequency is None else "phase",
        period=repeats,
        ratio=worst.ratio,
        threshold=worst.threshold,
        ambiguous=worst.ambiguous,
        snr=min(found.snr for found in matches.values()),
    )
