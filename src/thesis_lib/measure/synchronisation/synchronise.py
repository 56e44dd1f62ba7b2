"""When each camera started, from the sound that all of them recorded (thesis 5.1.2, eq. 5.2).

The force signal s is fed to every camera's audio input. Camera i, started at world time Tᵢ, records
xᵢ(t) = s(t + Tᵢ). Its *delay* is Tᵢ minus the start of the reference camera, so that
xᵢ(t) = x_ref(t + delayᵢ), and what happens at T appears in recording i at T − Tᵢ.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from thesis_lib.arrays import Array, IntArray
from thesis_lib.measure.synchronisation.checks import check_signals, check_tone, shortest_of
from thesis_lib.measure.synchronisation.decimation import decimate_signal
from thesis_lib.measure.synchronisation.delays import (
    CORRELATION_RATE,
    MIN_CORRELATION,
    Match,
    phase_delays,
)
from thesis_lib.measure.synchronisation.drift import Drift
from thesis_lib.measure.synchronisation.tones import TONE_RATE, SynchronisationError, check_rate
from thesis_lib.measure.synchronisation.transients import ROOM_RATE, force_match, room_match

Kind = Literal["force", "room"]

BLIND_SPOTS = (
    "Sound alone does not show an offset between a camera's image and its sound.",
    "Nor does it show whether the clocks of image and sound drift apart.",
)
IN_A_ROOM = (
    "Sound takes 2.9 ms per metre through air: a camera that is further from it seems to start "
    "earlier.",
    "A single knock that only one camera heard cannot be told from one like it that another "
    "heard; several claps at irregular intervals can.",
)
UNHEARD_TEXT = (
    "No sound was used: every recording counts from its own start.",
    "The images tell by how much of a period the cameras are then apart, and are put in step by "
    "it. What is not steady, as the start of the vibration, is not.",
)


@dataclass(frozen=True)
class Synchronisation:
    """Starts of all cameras."""

    delays: Array  #: Start of each camera minus that of the reference, s, shape (cameras,)
    frames: IntArray  #: The same in whole frames (eq. 5.2), shape (cameras,)
    frame_rate: float  #: Frames per second
    reference: int  #: Index of the reference camera
    #: ``phase`` of a tone of known frequency, ``correlation``, ``room``: correlation of what
    #: microphones hear, or ``none``: nothing was heard, and the delays are 0
    method: str
    #: Whole multiples of this many seconds are in doubt, or would be for a pure tone; None if
    #: nothing in the signal repeats
    period: float | None
    #: Second highest peak of the correlation over the highest, the largest of all cameras
    ratio: float
    threshold: float  #: Ratio from which on the two cannot be told apart
    #: Whether `ratio` reaches `threshold`; then the shortest possible delays are given
    ambiguous: bool
    #: Signal-to-noise power ratio up to half of the correlation's rate, the smallest of all
    snr: float
    #: Of recordings whose clocks drift too far for one delay, which is then that in the middle
    drifts: Mapping[int, Drift] = field(default_factory=dict)
    #: Which track, channels and pace each one's sound has, empty where all is as stated
    sources: tuple[str, ...] = ()

    def describe(self, names: Sequence[str] | None = None) -> list[str]:
        """Describe what was found, its uncertainty, and what sound cannot show."""
        if self.method == "none":
            return [*UNHEARD_TEXT]
        numbers = [str(i) for i in range(len(self.delays))]
        what, named = ("Recording", numbers) if names is None else ("Camera", list(names))
        others = [i for i in range(len(self.delays)) if i != self.reference]
        lines = [
            f"{what} {named[i]} started {self.delays[i]:+.6f} s after {what.lower()} "
            f"{named[self.reference]}: "
            f"{self.delays[i] * self.frame_rate:+.3f} frames, {self.frames[i]:+d} in whole frames."
            for i in others
        ]
        lines += [
            f"{what} {named[i]}'s sound: {source}."
            for i, source in enumerate(self.sources)
            if source
        ]
        lines += [
            f"By windows of its sound {what.lower()} {named[i]}'s clock is fast by "
            f"{1e6 * one.fast:+.1f} ± {1e6 * one.drift_deviation:.1f} ppm; its start is given as "
            "in the middle of the recording."
            for i, one in self.drifts.items()
        ]
        how = {
            "phase": "the phase of the tone",
            "correlation": "the peak of the correlation",
            "room": "the peak of the correlation of what microphones heard.",
        }[self.method]
        if self.method != "room":
            how += (
                f"; the signal is at least {10 * np.log10(self.snr):.0f} dB above the noise "
                f"(below {CORRELATION_RATE // 2} Hz)."
            )
        lines.append(f"Delays come from {how}")
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
        more = IN_A_ROOM if self.method == "room" else (self._coupling(),)
        return [*lines, *BLIND_SPOTS, *more]

    def _coupling(self) -> str:
        """Return a hint about AC-coupled inputs."""
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
    """Return delay in s of a tone between first-order high-passes with corners of 2 and 3 Hz."""
    return float((np.arctan(3 / frequency) - np.arctan(2 / frequency)) / (2 * np.pi * frequency))


def whole_frames(delays: ArrayLike, frame_rate: float) -> IntArray:
    """Return the delays in whole frames, N = Δt · fps (eq. 5.2), rounded to the nearest."""
    return np.rint(np.asarray(delays, float) * frame_rate).astype(np.int64)


def synchronise_cameras(
    signals: Sequence[ArrayLike],
    rate: float | Sequence[float],
    frame_rate: float,
    frequency: float | None = None,
    *,
    sound: Kind = "force",
    starts: ArrayLike = 0.0,
    reference: int = 0,
    max_delay: float | None = None,
    names: Sequence[str] | None = None,
) -> Synchronisation:
    """Estimate the starts of all cameras from their sound.

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
    sound : str
        ``force`` for the force's signal, ``room`` for what microphones hear: then there need not be
        a tone, and `frequency` is not used.
    starts : array_like, shape (recordings,) or ()
        Time of each first sample after the first frame, s.
    reference : int
        Recording whose delay is 0.
    max_delay : float, optional
        Largest delay looked for in s; half of the shorter recording if not given.
    names : sequence of str, optional
        Names of the recordings for errors.

    Raises
    ------
    SynchronisationError
        In one line: the recording and what is wrong with it.
    """
    names = names or [f"recording {i}" for i in range(len(signals))]
    rates = [float(r) for r in np.broadcast_to(np.asarray(rate, float), len(signals))]
    frequency = None if sound == "room" else frequency
    check_signals(signals, rates, shortest_of(frequency), names)
    if frequency is not None:
        check_rate(rates[0], frequency)
    low = [
        decimate_signal(x, rates[0], ROOM_RATE if sound == "room" else CORRELATION_RATE)
        for x in signals
    ]
    first, low_rate = low[reference]
    matches = {
        i: room_match(first, x, low_rate, max_delay)
        if sound == "room"
        else force_match(first, x, low_rate, frequency, max_delay)
        for i, (x, _) in enumerate(low)
        if i != reference
    }
    tones, tone_rate = [], rates[0]
    if frequency is not None:
        both = [decimate_signal(x, rates[0], TONE_RATE * frequency) for x in signals]
        tones, tone_rate = [x for x, _ in both], both[0][1]
    return combine_matches(
        matches,
        tones,
        tone_rate,
        frame_rate,
        frequency,
        sound=sound,
        starts=starts,
        reference=reference,
        names=names,
    )


def combine_matches(
    matches: Mapping[int, Match],
    tones: Sequence[ArrayLike],
    rate: float,
    frame_rate: float,
    frequency: float | None,
    *,
    names: Sequence[str],
    sound: Kind = "force",
    starts: ArrayLike = 0.0,
    reference: int = 0,
    steady: tuple[float, float] | None = None,
) -> Synchronisation:
    """Combine each camera's match with the reference and the phase of a tone into starts.

    Parameters
    ----------
    matches : mapping
        Of each recording but the reference.
    tones : sequence of array_like
        The recordings, or as much of them as the tone is sought in; all begin as much later.
    rate : float
        Sample rate of the tones in Hz.
    frame_rate, frequency, names, sound, starts, reference
        As of :func:`synchronise_cameras`.
    steady : tuple of float, optional
        From when to when the tone is steady, s after the first sample of the reference's; if not
        given, it is where the tone has settled.

    Raises
    ------
    SynchronisationError
        In one line: the recording and what is wrong with it.
    """
    for i, found in matches.items():
        if sound == "room" and not found.certain:
            raise SynchronisationError(
                f"{names[i]}: no sound in it matches that of {names[reference]} beyond doubt; clap "
                "a few times where all cameras hear it, within a minute of the first one's start"
            )
        if sound == "force" and found.peak < MIN_CORRELATION:
            raise SynchronisationError(
                f"{names[i]}: correlation of {found.peak:.2f} with {names[reference]}, allowed: "
                f"at least {MIN_CORRELATION}; do both hold the same sound?"
            )
    count = len(names)
    delays = np.array([matches[i].delay if i in matches else 0.0 for i in range(count)])
    if frequency is not None:
        for tone, name, delay in zip(tones, names, delays, strict=True):
            own = steady and (steady[0] - float(delay), steady[1] - float(delay))
            check_tone(tone, rate, frequency, name, own)
        delays = phase_delays(tones, rate, frequency, delays, reference, steady)
    worst = max(matches.values(), key=lambda found: (found.ambiguous, found.ratio))
    shift = np.broadcast_to(np.asarray(starts, float), count)
    delays = delays - (shift - shift[reference])
    method = "room" if sound == "room" else "correlation" if frequency is None else "phase"
    return Synchronisation(
        delays=delays,
        frames=whole_frames(delays, frame_rate),
        frame_rate=frame_rate,
        reference=reference,
        method=method,
        period=1 / frequency if frequency is not None else worst.period,
        ratio=worst.ratio,
        threshold=worst.threshold,
        ambiguous=worst.ambiguous,
        snr=min(found.snr for found in matches.values()),
    )
