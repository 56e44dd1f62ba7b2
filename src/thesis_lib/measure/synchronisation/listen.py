"""What the audio tracks of a folder of recordings tell: starts, frequency, phase of the force.

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

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from thesis_lib.measure.recordings.manifest import ManifestError
from thesis_lib.measure.recordings.manifest_model import Manifest
from thesis_lib.measure.recordings.validation import check_excitation, clock_of
from thesis_lib.measure.synchronisation.audio import (
    AudioSource,
    Heard,
    load_audio,
    low_part,
    low_track,
    match_recordings,
)
from thesis_lib.measure.synchronisation.checks import find_tone
from thesis_lib.measure.synchronisation.drift import MAX_DRIFT
from thesis_lib.measure.synchronisation.pairs import beside_first
from thesis_lib.measure.synchronisation.synchronise import Synchronisation, combine_matches
from thesis_lib.measure.synchronisation.tones import (
    MAX_SLIP_TURNS,
    MIN_SAMPLES_PER_PERIOD,
    SynchronisationError,
    fit_tone,
    frequency_deviation,
    settle_interval,
    tone_frequency,
)

Interval = tuple[float, float]
MIN_DRIFT_SIGMAS = 4.0  # standard errors from which on clocks drift apart
MAX_MIDDLE_OFFSET_S = 1e-3  # s that the delay in the middle may be from that of the whole


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
    if manifest.excitation.sound == "none":
        return _unheard(manifest, folder)
    recordings = [AudioSource(camera.name, folder / camera.video) for camera in manifest.cameras]
    one_tone = manifest.excitation.behaviour.has_one_frequency
    if manifest.excitation.sound == "room" or not one_tone:
        return _in_a_room(manifest, recordings)
    return _of_the_force(manifest, recordings)


def _unheard(manifest: Manifest, folder: Path) -> Sound:
    """Return starts of 0 without sound, and all cameras' common time after the rest."""
    excitation, count = manifest.excitation, len(manifest.cameras)
    zeros = np.zeros(count)
    nothing = Synchronisation(
        delays=zeros,
        frames=zeros.astype(np.int64),
        frame_rate=manifest.cameras[0].frame_rate_hz,
        reference=0,
        method="none",
        period=None,
        ratio=0.0,
        threshold=1.0,
        ambiguous=False,
        snr=np.nan,
    )
    end = min(float(clock_of(camera, folder)[-1]) for camera in manifest.cameras)
    if excitation.steady_interval_s is not None:
        _check_steady(manifest, 0.0, end)
    steady = excitation.steady_interval_s or _after_rest(excitation.rest_duration_s, 0.0, end)
    return Sound(nothing, excitation.frequency_hz, None, steady)


def _in_a_room(manifest: Manifest, recordings: list[AudioSource]) -> Sound:
    """Return starts from microphones, and all cameras' common time after the rest."""
    excitation = manifest.excitation
    heard = load_audio(recordings, None, 0.0)
    matched = match_recordings(recordings, None, room=True)
    known = {i: one.delay if one.certain else None for i, one in matched.items()}
    drifts = beside_first(recordings, known)
    for i, one in list(drifts.items()):  # clocks that drift apart have no one delay
        middle = one.delay - float(np.nan_to_num(one.drift)) * heard.ends[i] / 2
        delay = middle + float(heard.starts[i] - heard.starts[0])
        sure = known[i]
        drifting = abs(one.drift) > MIN_DRIFT_SIGMAS * one.drift_deviation  # not, if it is unknown
        clock = min(abs(one.drift), abs(one.sample_drift))  # stamps may run at another pace
        if clock < MAX_DRIFT and (
            sure is None or (drifting and abs(delay - sure) < MAX_MIDDLE_OFFSET_S)
        ):
            matched[i] = replace(matched[i], delay=delay, ambiguous=False, least=matched[i].peak)
        else:
            del drifts[i]
    found = combine_matches(
        matched,
        [],
        heard.low.rate,
        manifest.cameras[0].frame_rate_hz,
        None,
        names=[one.name for one in recordings],
        sound="room",
        starts=heard.starts,
    )
    found = replace(found, drifts=drifts, sources=heard.sources)
    begin, end = _common(found, heard)
    if excitation.steady_interval_s is not None:
        _check_steady(manifest, begin, end)
    steady = excitation.steady_interval_s or _after_rest(excitation.rest_duration_s, begin, end)
    return Sound(found, excitation.frequency_hz, None, steady)


def _after_rest(rest: float, begin: float, end: float) -> Interval:
    """Return the time after the rest that all cameras share, s."""
    if begin + rest >= end:
        raise ManifestError(
            f"excitation.rest_duration_s: given {rest:.6g}, allowed: less than the "
            f"{end - begin:.3f} s that all cameras recorded"
        )
    return begin + rest, end


def _of_the_force(manifest: Manifest, recordings: list[AudioSource]) -> Sound:
    """Return starts and steady interval from the force's signal."""
    excitation = manifest.excitation
    skip = (
        excitation.steady_interval_s[0]
        if excitation.steady_interval_s
        else excitation.rest_duration_s
    )
    frequency = excitation.frequency_hz or _tone_of_all(manifest, recordings)
    heard = load_audio(recordings, frequency, skip)
    steady = None
    if excitation.steady_interval_s is not None:
        _check_steady(manifest, 0.0, float(heard.ends[0]))
        zero = float(heard.starts[0]) + heard.tone_start
        steady = excitation.steady_interval_s[0] - zero, excitation.steady_interval_s[1] - zero
    found = combine_matches(
        match_recordings(recordings, frequency, room=False),
        heard.tones,
        heard.tone_rate,
        manifest.cameras[0].frame_rate_hz,
        frequency,
        names=[one.name for one in recordings],
        starts=heard.starts,
        steady=steady,
    )
    found = replace(found, sources=heard.sources)
    if excitation.steady_interval_s is not None:
        _check_steady(manifest, *_common(found, heard))
    tone, rate = heard.tones[0], heard.tone_rate
    begin, end = steady or settle_interval(tone, rate, frequency)
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
    return Sound(
        found,
        used,
        force,
        excitation.steady_interval_s or (begin, end),
        measured,
        frequency_deviation(part, rate, measured),
    )


def _tone_of_all(manifest: Manifest, recordings: list[AudioSource]) -> float:
    """Return the frequency in Hz of the tone that all tracks hold."""
    excitation, slowest = manifest.excitation, min(c.frame_rate_hz for c in manifest.cameras)
    skip = (
        excitation.steady_interval_s[0]
        if excitation.steady_interval_s
        else excitation.rest_duration_s
    )
    tones = []
    for recording in recordings:
        track, rate, start = low_track(recording, MIN_SAMPLES_PER_PERIOD * slowest / 2, skip)
        begin, end = excitation.steady_interval_s or (start, start)
        part = (begin - start, end - start) if excitation.steady_interval_s else None
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


def _common(found: Synchronisation, heard: Heard) -> Interval:
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
