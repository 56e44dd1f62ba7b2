"""What the audio tracks of a folder of recordings tell: starts, frequency, phase of the force.

Tracks are read one at a time and kept at a few kHz, so that long recordings fit into memory.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from thesis_lib.experiment import media
from thesis_lib.experiment.delays import (
    CORRELATION_RATE,
    TONE_RATE,
    check_rate,
    cut_off,
    decimated,
    settled_part,
    tone_at,
)
from thesis_lib.experiment.manifest import Manifest, ManifestError, check_excitation
from thesis_lib.experiment.synchronisation import (
    Synchronisation,
    check_signal,
    same_rate,
    shortest_of,
    synchronise,
)


@dataclass(frozen=True)
class Sound:
    """What the audio tracks tell.

    Parameters
    ----------
    synchronisation : Synchronisation
        When each camera started.
    frequency : float
        Of the force in Hz.
    force : complex
        Its amplitude over full scale, time factor e^{+jωt}, on the reference camera's clock.
    steady : tuple of float
        From when to when it is steady on that clock, s.
    """

    synchronisation: Synchronisation
    frequency: float
    force: complex
    steady: tuple[float, float]


def listen(manifest: Manifest, folder: Path) -> Sound:
    """Delays, and the force's frequency and phase.

    Raises
    ------
    ManifestError
        If the frequency is not given, or not one that the cameras can film.
    MediaError, SynchronisationError
        If a track is missing, silent, clipped or unlike the others, or holds no steady tone of the
        frequency.
    """
    for problem in check_excitation(manifest):
        raise ManifestError(problem)
    frequency = manifest.excitation.frequency_hz
    assert frequency is not None
    names = [camera.name for camera in manifest.cameras]
    tracks, rates, starts = [], [], []
    low_rate = 0.0
    for camera in manifest.cameras:
        samples, rate, start = media.read_audio(folder / camera.video)
        rates.append(rate)
        same_rate(rates, names[: len(rates)])
        check_rate(rate, frequency)
        check_signal(samples, rate, shortest_of(frequency), camera.name)
        wanted = max(CORRELATION_RATE, TONE_RATE * frequency)
        track, low_rate = decimated(samples, rate, wanted)
        tracks.append(track)
        starts.append(start + cut_off(rate, low_rate))
        del samples
    found = synchronise(
        tracks,
        low_rate,
        manifest.cameras[0].frame_rate_hz,
        frequency,
        starts=starts,
        names=names,
        checked=True,
    )
    x, tone_rate = decimated(tracks[0], low_rate, TONE_RATE * frequency)
    begin, end = settled_part(x, tone_rate, frequency)
    later = cut_off(low_rate, tone_rate)
    first, last = round((begin + later) * low_rate), round((end + later) * low_rate)
    steady = starts[0] + first / low_rate, starts[0] + (last - 1) / low_rate
    force, _ = tone_at(tracks[0][first:last], low_rate, frequency, -steady[0])
    return Sound(found, frequency, force, steady)
