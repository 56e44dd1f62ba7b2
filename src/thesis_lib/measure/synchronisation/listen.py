"""Estimate the start of each camera from its sound track (thesis 5.1.2, eq. 5.2).

The force signal s is fed to every camera's audio input. Camera i, started at world time Tᵢ, records
xᵢ(t) = s(t + Tᵢ). Its *delay* is Tᵢ minus the start of the first camera, so that
xᵢ(t) = x_first(t + delayᵢ), and an event at T appears in recording i at T − Tᵢ. A sine also yields
the frequency and the phase of the force.

Limits for long recordings:

- Delays are estimated in spans of 2²¹ samples: nine minutes of the force signal, two minutes of
  room sound. The first span with a reliable match is used; room sound is searched for ten minutes.
  The recordings may start half a span apart, or, if they are shorter, so far apart that half of the
  shorter one overlaps.
- One delay and one frequency apply to a whole recording. Clocks of cameras differ by some 10⁻⁵: the
  delay is that in the middle, and the images yield the clock rates. Room sound is compared window
  by window, as in ``thesis sync``.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from thesis_lib.arrays import Array, ArrayLike, IntArray
from thesis_lib.measure.recordings.manifest import Manifest, ManifestError
from thesis_lib.measure.recordings.validation import check_excitation, clock_of
from thesis_lib.measure.synchronisation import audio, delays as matching, tones
from thesis_lib.measure.synchronisation.drift import (
    MAX_DRIFT,
    Drift,
    estimate_drifts,
    unmatched_error,
)
from thesis_lib.measure.synchronisation.tones import MAX_SLIP_TURNS, Interval
from thesis_lib.studies.schema import label_values, read_variables
from thesis_lib.web.html import render_lines

ROOM_SPANS = 8  # half-overlapping spans in which room sound is compared: ten minutes
MIN_AUDIO_S = 0.5  # shortest sound track in s in which a sine is searched for
BUTTON_SOUND_S = 0.5  # s at either end of a room recording with the sound of pressed buttons
MIN_DRIFT_SIGMAS = 4.0  # standard errors from which on a clock drift is significant
MAX_MIDDLE_OFFSET_S = 1e-3  # largest difference in s of the delays in the middle and of the whole
VARIABLES = read_variables(__file__, "synchronisation")


@dataclass(frozen=True)
class LoadedAudio:
    """Sound tracks of all recordings, and their sines at a low sample rate."""

    sounds: audio.Sounds  #: At the rate at which the force is measured
    #: Each recording at some tens of samples per period, shape (samples,); empty in a room
    tones: list[audio.Track]
    tone_rate: float  #: Sample rate of `tones` in Hz
    tone_start: float  #: Time from the first sample of a file to that of its `tones`, s

    @property
    def starts(self) -> Array:
        """Return the start of each sound after the first frame, s, shape (recordings,)."""
        return np.array([one.start for one in self.sounds.tracks])

    @property
    def ends(self) -> Array:
        """Return the end of each sound after the first frame, s, shape (recordings,)."""
        return np.array([one.start + one.samples / one.rate for one in self.sounds.tracks])


def load_audio(recordings: Sequence[audio.AudioSource], frequency: float | None) -> LoadedAudio:
    """Check all sound tracks, and load their sine at a frequency in Hz (None: room sound).

    A track that is missing, too short, silent or clipped raises an error.
    """
    shortest = 4 * BUTTON_SOUND_S if frequency is None else 2.5 / frequency
    wanted = tones.TONE_RATE * (frequency or 0.0)
    sounds = audio.Sounds(recordings, max(matching.CORRELATION_RATE, wanted))
    low, held = sounds.low, []
    slow = audio.common_rate([low.rate], wanted or low.rate)
    for recording, track in zip(recordings, sounds.tracks, strict=True):
        audio.check_sound(track, shortest, recording.name)
    if frequency is not None:
        fastest = min(sounds.rates) / tones.MIN_SAMPLES_PER_PERIOD
        if not 0 < frequency <= fastest:
            raise audio.SynchronisationError(
                f"excitation.frequency_hz: given {frequency:g}, allowed: at most {fastest:g} Hz, "
                f"{tones.MIN_SAMPLES_PER_PERIOD} samples of the sound per period"
            )
        every = [sounds.blocks(k) for k in range(len(recordings))]
        held = [audio.join_blocks(slow.reduce(blocks, low.rate)) for blocks in every]
    return LoadedAudio(sounds, held, slow.rate, low.cut + slow.cut)


def match_recordings(
    recordings: Sequence[audio.AudioSource], frequency: float | None
) -> dict[int, matching.Match]:
    """Match each other recording to the first, by a sine's frequency in Hz (None: room sound).

    The first span with a reliable match is used, or else the one with the best match. Spans overlap
    by half, so that recordings that started less than that apart have a common span. In a room only
    the first `ROOM_SPANS` are compared, without the sound of the buttons.
    """
    half, every = audio.SPAN_SAMPLES // 2, range(len(recordings))
    if frequency is None:
        sounds = audio.Sounds(recordings, matching.ROOM_RATE)
        edge = round(BUTTON_SOUND_S * sounds.low.rate)
        last = (ROOM_SPANS + 1) * half + 2 * edge
        heard = [sounds.read(k, edge, last)[:-edge] for k in every]
    else:
        sounds = audio.Sounds(recordings, matching.CORRELATION_RATE)
        heard = [sounds.read(k) for k in every]
    end = min(len(heard[0]), max(map(len, heard[1:])))  # end of the first, or of all others
    found: dict[int, matching.Match] = {}
    for start in range(0, max(end - half, 1), half):
        span = [one[start : start + 2 * half] for one in heard]
        for i, other in enumerate(span[1:], 1):
            if i in found and (found[i].certain or len(other) < half // 2):
                continue
            if frequency is None:
                match = matching.room_match(span[0], other, sounds.low.rate)
            else:
                match = matching.force_match(span[0], other, sounds.low.rate, frequency)
            found[i] = max(found.get(i, match), match, key=lambda one: (one.certain, one.peak))
        if all(match.certain for match in found.values()):
            break
    return found


@dataclass(frozen=True)
class Synchronisation:
    """Starts of all cameras."""

    delays: Array  #: Start of each camera minus that of the first, s, shape (cameras,)
    #: The least certain match of a camera with the first one; None without sound
    match: matching.Match | None = None
    frequency: float | None = None  #: Of the sine, Hz; None in a room
    snr: float = np.nan  #: Smallest :attr:`~.delays.Match.snr` of all
    #: Drift of each recording whose delay is that in its middle
    drifts: Mapping[int, Drift] = field(default_factory=dict)
    sources: Sequence[str] = ()  #: Remark on each sound track; empty if it is as its file states

    @property
    def ambiguous(self) -> bool:
        """Return whether several delays match equally well; then the shortest are used."""
        return self.match is not None and self.match.ambiguous

    def describe(self, names: Sequence[str], frame_rate: float) -> list[str]:
        """Describe delays, uncertainty and limits of audio synchronisation; frame rate in Hz."""
        frames = whole_frames(self.delays, frame_rate)
        omega = 2 * np.pi * (self.frequency or np.nan)
        corners = 2 * np.pi * np.array([2, 3])  # rad/s, of the first-order high-passes of inputs
        return render_lines(
            "measure/synchronisation/templates/starts.txt.j2",
            found=self,
            frame_rate=frame_rate,
            names=names,
            starts=[*zip(names, self.delays, frames, strict=True)][1:],
            sources=[one for one in zip(names, self.sources, strict=False) if one[1]],
            snr_db=10 * np.log10(self.snr),
            below_hz=matching.CORRELATION_RATE // 2,
            shift_frames=frame_rate * float(np.diff(np.arctan(corners / omega))[0] / omega),
        )


def whole_frames(delays: ArrayLike, frame_rate: float) -> IntArray:
    """Return the delays in whole frames, N = Δt · fps (eq. 5.2), rounded to the nearest."""
    return np.rint(np.asarray(delays, float) * frame_rate).astype(np.int64)


def synchronise_cameras(
    recordings: Sequence[audio.AudioSource],
    heard: LoadedAudio,
    frequency: float | None,
    steady: Interval | None = None,
) -> Synchronisation:
    """Estimate the starts of all cameras from their sound, loaded by :func:`load_audio`.

    The frequency of the force's sine is in Hz, or None for microphones in a room. The sine is
    steady from `steady[0]` to `steady[1]` s after the first sample of the first of `heard.tones`;
    by default its steady-state interval is detected. A :class:`~.audio.SynchronisationError` names
    the recording without such a sound.
    """
    matches = match_recordings(recordings, frequency)
    drifts = {} if frequency is not None else _find_drifts(recordings, heard, matches)
    names = [one.name for one in recordings]
    for i, one in matches.items():
        if frequency is None and not one.certain:
            raise unmatched_error(names[i], names[0])
        if frequency is not None and one.peak < matching.MIN_CORRELATION:
            raise audio.SynchronisationError(
                f"{names[i]}: correlation of {one.peak:.2f} with {names[0]}, allowed: "
                f"at least {matching.MIN_CORRELATION}; do both hold the same sound?"
            )
    delays = np.array([0.0, *(matches[i].delay for i in range(1, len(recordings)))])
    if frequency is not None:
        for tone, name, delay in zip(heard.tones, names, delays, strict=True):
            own = steady and (steady[0] - float(delay), steady[1] - float(delay))
            tones.check_tone(tone, heard.tone_rate, frequency, name, own)
        delays = matching.phase_delays(heard.tones, heard.tone_rate, frequency, delays, steady)
    return Synchronisation(
        delays=delays - (heard.starts - heard.starts[0]),
        match=max(matches.values(), key=lambda one: (one.ambiguous, one.ratio)),
        frequency=frequency,
        snr=min(one.snr for one in matches.values()),
        drifts=drifts,
        sources=[one.source for one in heard.sounds.tracks],
    )


def _find_drifts(
    recordings: Sequence[audio.AudioSource], heard: LoadedAudio, matches: dict[int, matching.Match]
) -> dict[int, Drift]:
    """Replace the delays of recordings whose clocks drift by those in their middle."""
    known = {i: one.delay if one.certain else None for i, one in matches.items()}
    drifts = {}
    for i, one in estimate_drifts(recordings, known).items():
        middle = one.delay - float(np.nan_to_num(one.drift)) * heard.ends[i] / 2
        delay = middle + float(heard.starts[i] - heard.starts[0])
        sure = known[i]
        drifting = abs(one.drift) > MIN_DRIFT_SIGMAS * one.drift_deviation  # False if NaN
        clock = min(abs(one.drift), abs(one.sample_drift))  # time stamps may have another rate
        if clock < MAX_DRIFT and (
            sure is None or (drifting and abs(delay - sure) < MAX_MIDDLE_OFFSET_S)
        ):
            match = matches[i]
            matches[i] = replace(match, delay=delay, ambiguous=False, least=match.peak)
            drifts[i] = one
    return drifts


def estimate_delays(manifest: Manifest, folder: Path) -> xr.Dataset:
    """Estimate the delays, and the force's frequency and phase, as :data:`VARIABLES`.

    Raises a :class:`ManifestError` if the cameras cannot resolve the frequency, or if not all of
    them recorded the steady-state interval; other errors are those of the files and sounds.
    """
    for problem in check_excitation(manifest):
        raise ManifestError(problem)
    excitation, cameras = manifest.excitation, manifest.cameras
    recordings = [audio.AudioSource(one.name, folder / one.video) for one in cameras]
    tone: dict[str, Any] = {"of_sound": np.nan, "of_sound_deviation": np.nan, "force": [0.0, 0.0]}
    if excitation.sound == "force" and excitation.behaviour.has_one_frequency:
        found, steady, tone = _analyse_force(manifest, recordings)
    else:
        if excitation.sound == "none":
            found = Synchronisation(np.zeros(len(cameras)))
            begin, end = 0.0, min(float(clock_of(one, folder)[-1]) for one in cameras)
        else:
            heard = load_audio(recordings, None)
            found = synchronise_cameras(recordings, heard, None)
            begin, end = _common(found, heard)
        _check_steady(manifest, begin, end)
        rest = excitation.rest_duration_s
        if excitation.steady_interval_s is None and begin + rest >= end:
            raise ManifestError(
                f"excitation.rest_duration_s: given {rest:.6g}, allowed: less than the "
                f"{end - begin:.3f} s that all cameras recorded"
            )
        steady = excitation.steady_interval_s or (begin + rest, end)
    values = {
        "delay": found.delays,
        "frequency": excitation.frequency_hz or tone["of_sound"],
        **tone,
        "steady": steady,
        "ambiguous": int(found.ambiguous),
        "signal_to_noise": found.snr,
    }
    lines = found.describe([camera.name for camera in cameras], cameras[0].frame_rate_hz)
    return xr.Dataset(label_values(values, VARIABLES), attrs={"synchronisation": "\n".join(lines)})


def _analyse_force(
    manifest: Manifest, recordings: list[audio.AudioSource]
) -> tuple[Synchronisation, Interval, dict[str, Any]]:
    """Return starts, steady-state interval and variables of the sine from the force signal."""
    excitation = manifest.excitation
    steady = excitation.steady_interval_s
    frequency = excitation.frequency_hz or _tone_of_all(manifest, recordings)
    heard = load_audio(recordings, frequency)
    _check_steady(manifest, 0.0, float(heard.ends[0]))
    zero = float(heard.starts[0]) + heard.tone_start
    own = steady and (steady[0] - zero, steady[1] - zero)
    found = synchronise_cameras(recordings, heard, frequency, own)
    _check_steady(manifest, *_common(found, heard))
    tone, rate = heard.tones[0], heard.tone_rate
    begin, end = own or tones.settle_interval(tone, rate, frequency)
    part = tone[max(round(begin * rate), 0) : round(end * rate)]
    measured = tones.tone_frequency(part, rate, frequency)
    used = excitation.frequency_hz or measured
    low = heard.sounds.low
    zero, later = float(heard.starts[0]) + low.cut, heard.tone_start - low.cut
    first, last = max(round((begin + later) * low.rate), 0), round((end + later) * low.rate)
    begin, end = zero + first / low.rate, zero + (last - 1) / low.rate
    blocks = audio.part_of(heard.sounds.blocks(0), first, last)
    force, _ = tones.fit_tone(blocks, low.rate, used, -begin)
    most, rest = max(begin - max(float(found.delays.max()), 0.0), 0.0), excitation.rest_duration_s
    if steady is None and rest > most + 1e-6:
        raise ManifestError(
            f"excitation.rest_duration_s: given {rest:.6g}, allowed: at most the {most:.3f} s "
            "after which the vibration is steady"
        )
    deviation, parts = tones.frequency_deviation(part, rate, measured), [force.real, force.imag]
    told = {"of_sound": measured, "of_sound_deviation": deviation, "force": parts}
    return found, steady or (begin, end), told


def _tone_of_all(manifest: Manifest, recordings: list[audio.AudioSource]) -> float:
    """Estimate the frequency in Hz of the sine in all sound tracks."""
    steady = manifest.excitation.steady_interval_s
    slowest = min(camera.frame_rate_hz for camera in manifest.cameras)
    wanted = max(matching.CORRELATION_RATE, tones.MIN_SAMPLES_PER_PERIOD * slowest / 2)
    found = []
    for recording in recordings:
        sounds = audio.Sounds([recording], wanted)
        audio.check_sound(sounds.tracks[0], MIN_AUDIO_S, recording.name)
        track, rate, start = sounds.read(0), sounds.low.rate, sounds.starts[0]
        part = steady and (steady[0] - start, steady[1] - start)
        try:
            found.append(tones.find_tone(track, rate, recording.name, part))
        except audio.SynchronisationError:
            if not found or part is None:
                raise
            # The interval is on the first camera's clock; the start of this one is not known yet.
            found.append(tones.find_tone(track, rate, recording.name))
        (first, _), (tone, seconds) = found[0], found[-1]
        if abs(tone - first) * seconds > max(MAX_SLIP_TURNS, MAX_DRIFT * first * seconds):
            raise audio.SynchronisationError(
                f"{recording.name}: its tone has {tone:.7g} Hz, that of {recordings[0].name} "
                f"{first:.7g} Hz, allowed: the same, to within "
                f"{max(MAX_SLIP_TURNS / seconds, MAX_DRIFT * first):.1g} Hz"
            )
    if first >= slowest / 2:
        raise ManifestError(
            f"excitation.frequency_hz: given null, and the sound has {first:.6g} Hz, allowed: "
            f"below half of the frame rate, {slowest / 2:g} Hz, unless it is given and undersampled"
        )
    return first


def _common(found: Synchronisation, heard: LoadedAudio) -> Interval:
    """Return begin and end of the common recording time on the reference camera's clock, s."""
    return max(float(found.delays.max()), 0.0), float((found.delays + heard.ends).min())


def _check_steady(manifest: Manifest, begin: float, end: float) -> None:
    """Refuse a steady-state interval outside the recordings; sound may be a frame shorter."""
    steady = manifest.excitation.steady_interval_s
    frame = 1 / manifest.cameras[0].frame_rate_hz
    if steady is not None and not begin <= steady[0] < steady[1] <= end + frame:
        raise ManifestError(
            f"excitation.steady_interval_s: given [{steady[0]:g}, {steady[1]:g}], allowed: "
            f"within the recordings, from {begin:.3f} to {end:.3f} s"
        )
