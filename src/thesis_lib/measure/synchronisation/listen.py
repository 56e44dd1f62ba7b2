"""When each camera started, from the sound that all of them recorded (thesis 5.1.2, eq. 5.2).

The force signal s is fed to every camera's audio input. Camera i, started at world time Tᵢ, records
xᵢ(t) = s(t + Tᵢ). Its *delay* is Tᵢ minus the start of the first camera, so that
xᵢ(t) = x_first(t + delayᵢ), and what happens at T appears in recording i at T − Tᵢ. A tone gives
the frequency and the phase of the force, too.

Tracks are read block by block, as often as it takes, and of each only a bounded part is held, at a
few kHz: memory does not grow with the length. What follows from that for long recordings:

- Delays come from spans of 2²¹ samples, nine minutes of the force's signal, two of a room's sound:
  the first in which the recordings match without doubt, of a room's those within ten minutes. The
  recordings may start half a span apart.
- The tone is fitted in as many samples from the rest at the start on, two hours of 4 Hz; beyond it
  is not said to be steady.
- One delay and one frequency serve all of a recording. Clocks of cameras differ by some 10⁻⁵: the
  delay is that in the middle, and the images tell the rest. A room's sounds are compared window
  by window, as ``thesis sync`` does.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from thesis_lib.arrays import Array, IntArray
from thesis_lib.measure.recordings.manifest import Manifest, ManifestError
from thesis_lib.measure.recordings.validation import check_excitation, clock_of
from thesis_lib.measure.synchronisation.audio import (
    AudioSource,
    LoadedAudio,
    load_audio,
    low_part,
    low_track,
    match_recordings,
)
from thesis_lib.measure.synchronisation.delays import (
    CORRELATION_RATE,
    MIN_CORRELATION,
    Match,
    phase_delays,
)
from thesis_lib.measure.synchronisation.drift import MAX_DRIFT, Drift, beside_first, unmatched_error
from thesis_lib.measure.synchronisation.tones import (
    MAX_SLIP_TURNS,
    MIN_SAMPLES_PER_PERIOD,
    Interval,
    SynchronisationError,
    check_tone,
    find_tone,
    fit_tone,
    frequency_deviation,
    settle_interval,
    tone_frequency,
)
from thesis_lib.web.html import render_lines

MIN_DRIFT_SIGMAS = 4.0  # standard errors from which on clocks drift apart
MAX_MIDDLE_OFFSET_S = 1e-3  # s that the delay in the middle may be from that of the whole


@dataclass(frozen=True)
class Synchronisation:
    """Starts of all cameras."""

    delays: Array  #: Start of each camera minus that of the first, s, shape (cameras,)
    frame_rate: float  #: Frames per second
    #: ``phase`` of a tone, ``room``: correlation of what microphones hear, or ``none``: nothing was
    #: heard, and the delays are 0
    method: str
    match: Match | None = None  #: The most doubtful of all cameras with the first one
    frequency: float | None = None  #: Of the tone, Hz; whole periods are what may be in doubt
    #: Signal-to-noise power ratio up to half of the correlation's rate, the smallest of all
    snr: float = np.nan
    #: Of recordings whose clocks drift too far for one delay, which is then that in the middle
    drifts: Mapping[int, Drift] = field(default_factory=dict)
    #: Which track, channels and pace each one's sound has, empty where all is as stated
    sources: tuple[str, ...] = ()

    @property
    def frames(self) -> IntArray:
        """Return the delays in whole frames (eq. 5.2), shape (cameras,)."""
        return whole_frames(self.delays, self.frame_rate)

    @property
    def ambiguous(self) -> bool:
        """Return whether two delays cannot be told apart; then the shortest are given."""
        return self.match is not None and self.match.ambiguous

    def describe(self, names: Sequence[str]) -> list[str]:
        """Describe what was found, its uncertainty, and what sound cannot show."""
        frequency = self.frequency
        return render_lines(
            "measure/synchronisation/templates/starts.txt.j2",
            found=self,
            names=names,
            starts=[*zip(names, self.delays, self.frames, strict=True)][1:],
            sources=[one for one in zip(names, self.sources, strict=False) if one[1]],
            snr_db=10 * np.log10(self.snr),
            below_hz=CORRELATION_RATE // 2,
            shift_frames=self.frame_rate * coupling_delay(frequency) if frequency else np.nan,
        )


def coupling_delay(frequency: float) -> float:
    """Return delay in s of a tone between first-order high-passes with corners of 2 and 3 Hz."""
    return float((np.arctan(3 / frequency) - np.arctan(2 / frequency)) / (2 * np.pi * frequency))


def whole_frames(delays: ArrayLike, frame_rate: float) -> IntArray:
    """Return the delays in whole frames, N = Δt · fps (eq. 5.2), rounded to the nearest."""
    return np.rint(np.asarray(delays, float) * frame_rate).astype(np.int64)


def synchronise_cameras(
    recordings: Sequence[AudioSource],
    heard: LoadedAudio,
    frame_rate: float,
    frequency: float | None,
    steady: Interval | None = None,
) -> Synchronisation:
    """Estimate the starts of all cameras from their sound.

    Parameters
    ----------
    recordings : sequence of AudioSource
        Of each camera.
    heard : LoadedAudio
        What :func:`~thesis_lib.measure.synchronisation.audio.load_audio` read of them.
    frame_rate : float
        Frames per second.
    frequency : float or None
        Frequency of the force's tone in Hz; None for what microphones hear in a room.
    steady : tuple of float, optional
        From when to when the tone is steady, s after the first sample of the first one that is
        held; if not given, it is where the tone has settled.

    Raises
    ------
    MediaError, SynchronisationError
        In one line: the recording and what is wrong with it.
    """
    matches = match_recordings(recordings, frequency)
    drifts = {} if frequency is not None else _find_drifts(recordings, heard, matches)
    names = [one.name for one in recordings]
    for i, one in matches.items():
        if frequency is None and not one.certain:
            raise unmatched_error(names[i], names[0])
        if frequency is not None and one.peak < MIN_CORRELATION:
            raise SynchronisationError(
                f"{names[i]}: correlation of {one.peak:.2f} with {names[0]}, allowed: "
                f"at least {MIN_CORRELATION}; do both hold the same sound?"
            )
    delays = np.array([0.0, *(matches[i].delay for i in range(1, len(recordings)))])
    if frequency is not None:
        for tone, name, delay in zip(heard.tones, names, delays, strict=True):
            own = steady and (steady[0] - float(delay), steady[1] - float(delay))
            check_tone(tone, heard.tone_rate, frequency, name, own)
        delays = phase_delays(heard.tones, heard.tone_rate, frequency, delays, steady)
    return Synchronisation(
        delays=delays - (heard.starts - heard.starts[0]),
        frame_rate=frame_rate,
        method="room" if frequency is None else "phase",
        match=max(matches.values(), key=lambda one: (one.ambiguous, one.ratio)),
        frequency=frequency,
        snr=min(one.snr for one in matches.values()),
        drifts=drifts,
        sources=heard.sources,
    )


def _find_drifts(
    recordings: Sequence[AudioSource], heard: LoadedAudio, matches: dict[int, Match]
) -> dict[int, Drift]:
    """Replace the matches of clocks that have no one delay by that in the middle."""
    known = {i: one.delay if one.certain else None for i, one in matches.items()}
    drifts = {}
    for i, one in beside_first(recordings, known).items():
        middle = one.delay - float(np.nan_to_num(one.drift)) * heard.ends[i] / 2
        delay = middle + float(heard.starts[i] - heard.starts[0])
        sure = known[i]
        drifting = abs(one.drift) > MIN_DRIFT_SIGMAS * one.drift_deviation  # not, if it is unknown
        clock = min(abs(one.drift), abs(one.sample_drift))  # stamps may run at another pace
        if clock < MAX_DRIFT and (
            sure is None or (drifting and abs(delay - sure) < MAX_MIDDLE_OFFSET_S)
        ):
            match = matches[i]
            matches[i] = replace(match, delay=delay, ambiguous=False, least=match.peak)
            drifts[i] = one
    return drifts


@dataclass(frozen=True)
class Sound:
    """What the audio tracks tell."""

    synchronisation: Synchronisation  #: When each camera started
    frequency: float | None  #: Of the force in Hz: the given one, else the one that was found
    #: Its amplitude over full scale, time factor e^{+jωt}, on the reference camera's clock; None
    #: where microphones hear a room
    force: complex | None
    steady: Interval  #: From when to when it is steady on that clock, s
    #: Frequency of the force's signal in Hz, by the clock of the reference camera's sound
    found_frequency: float | None = None
    #: Its standard error in Hz; that the clock is off, by some 10⁻⁵, is not in it
    frequency_deviation: float | None = None


def estimate_delays(manifest: Manifest, folder: Path) -> Sound:
    """Return the delays, and the force's frequency and phase.

    Raises
    ------
    ManifestError
        If the frequency is not one that the cameras can film, or the steady part is not one that
        all of them recorded.
    MediaError, SynchronisationError
        If a track is missing, silent, clipped or unlike the others, or holds no steady tone of the
        frequency where it should carry the force.
    """
    for problem in check_excitation(manifest):
        raise ManifestError(problem)
    excitation, rate = manifest.excitation, manifest.cameras[0].frame_rate_hz
    if excitation.sound == "none":
        zeros = np.zeros(len(manifest.cameras))
        found = Synchronisation(zeros, rate, "none")
        begin, end = 0.0, min(float(clock_of(one, folder)[-1]) for one in manifest.cameras)
    else:
        recordings = [AudioSource(one.name, folder / one.video) for one in manifest.cameras]
        if excitation.sound == "force" and excitation.behaviour.has_one_frequency:
            return _of_the_force(manifest, recordings)
        heard = load_audio(recordings, None, 0.0)
        found = synchronise_cameras(recordings, heard, rate, None)
        begin, end = _common(found, heard)
    _check_steady(manifest, begin, end)
    rest = excitation.rest_duration_s
    if excitation.steady_interval_s is None and begin + rest >= end:
        raise ManifestError(
            f"excitation.rest_duration_s: given {rest:.6g}, allowed: less than the "
            f"{end - begin:.3f} s that all cameras recorded"
        )
    steady = excitation.steady_interval_s or (begin + rest, end)
    return Sound(found, excitation.frequency_hz, None, steady)


def _of_the_force(manifest: Manifest, recordings: list[AudioSource]) -> Sound:
    """Return starts and steady interval from the force's signal."""
    excitation, rate = manifest.excitation, manifest.cameras[0].frame_rate_hz
    steady = excitation.steady_interval_s
    skip = steady[0] if steady else excitation.rest_duration_s
    frequency = excitation.frequency_hz or _tone_of_all(manifest, recordings, skip)
    heard = load_audio(recordings, frequency, skip)
    _check_steady(manifest, 0.0, float(heard.ends[0]))
    zero = float(heard.starts[0]) + heard.tone_start
    own = steady and (steady[0] - zero, steady[1] - zero)
    found = synchronise_cameras(recordings, heard, rate, frequency, own)
    _check_steady(manifest, *_common(found, heard))
    tone, rate = heard.tones[0], heard.tone_rate
    begin, end = own or settle_interval(tone, rate, frequency)
    part = tone[max(round(begin * rate), 0) : round(end * rate)]
    measured = tone_frequency(part, rate, frequency)
    used = excitation.frequency_hz or measured
    low_rate = heard.low.rate
    zero = float(heard.starts[0]) + heard.low.cut
    later = heard.tone_start - heard.low.cut
    first, last = max(round((begin + later) * low_rate), 0), round((end + later) * low_rate)
    begin, end = zero + first / low_rate, zero + (last - 1) / low_rate
    blocks = low_part(recordings[0], heard.low, first, last)
    force, _ = fit_tone(blocks, low_rate, used, -begin)
    deviation = frequency_deviation(part, rate, measured)
    return Sound(found, used, force, steady or (begin, end), measured, deviation)


def _tone_of_all(manifest: Manifest, recordings: list[AudioSource], skip: float) -> float:
    """Return the frequency in Hz of the tone that all tracks hold."""
    excitation, slowest = manifest.excitation, min(c.frame_rate_hz for c in manifest.cameras)
    tones = []
    for recording in recordings:
        track, rate, start = low_track(recording, MIN_SAMPLES_PER_PERIOD * slowest / 2, skip)
        steady = excitation.steady_interval_s
        part = steady and (steady[0] - start, steady[1] - start)
        tones.append(find_tone(track, rate, recording.name, part))
        (first, _), (tone, seconds) = tones[0], tones[-1]
        if abs(tone - first) * seconds > max(MAX_SLIP_TURNS, MAX_DRIFT * first * seconds):
            raise SynchronisationError(
                f"{recording.name}: its tone has {tone:.7g} Hz, that of {recordings[0].name} "
                f"{first:.7g} Hz, allowed: the same, to within {MAX_SLIP_TURNS / seconds:.1g} Hz"
            )
    if first >= slowest / 2:
        raise ManifestError(
            f"excitation.frequency_hz: given null, and the sound has {first:.6g} Hz, allowed: "
            f"below half of the frame rate, {slowest / 2:g} Hz, unless it is given and undersampled"
        )
    return first


def _common(found: Synchronisation, heard: LoadedAudio) -> Interval:
    """Return from when to when all cameras recorded, on the reference camera's clock, s."""
    return max(float(found.delays.max()), 0.0), float((found.delays + heard.ends).min())


def _check_steady(manifest: Manifest, begin: float, end: float) -> None:
    """Refuse a steady part that is not in the recordings; their sound may be a frame shorter."""
    steady = manifest.excitation.steady_interval_s
    frame = 1 / manifest.cameras[0].frame_rate_hz
    if steady is not None and not begin <= steady[0] < steady[1] <= end + frame:
        raise ManifestError(
            f"excitation.steady_interval_s: given [{steady[0]:g}, {steady[1]:g}], allowed: "
            f"within the recordings, from {begin:.3f} to {end:.3f} s"
        )
