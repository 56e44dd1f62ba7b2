"""What the audio tracks of a folder of recordings tell: starts, frequency, phase of the force."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from thesis_lib.experiment import media
from thesis_lib.experiment.delays import steady_part
from thesis_lib.experiment.manifest import Manifest, ManifestError
from thesis_lib.experiment.synchronisation import Synchronisation, synchronise


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
    MediaError, SynchronisationError
        If a track is missing, silent, clipped or unlike the others.
    """
    names = [camera.name for camera in manifest.cameras]
    tracks = [media.read_audio(folder / camera.video) for camera in manifest.cameras]
    rates = [rate for _, rate, _ in tracks]
    found = synchronise(
        [samples for samples, _, _ in tracks],
        rates,
        manifest.cameras[0].frame_rate_hz,
        manifest.excitation.frequency_hz,
        starts=[start for *_, start in tracks],
        names=names,
    )
    samples, rate, start = tracks[0]
    frequency = manifest.excitation.frequency_hz
    if frequency is None:
        raise ManifestError("excitation.frequency_hz: given null, allowed here: a number, in Hz")
    begin, end = steady_part(samples, rate, frequency)
    begin += 1 / frequency  # what follows the force's change has settled, too
    first, last = round(begin * rate), round(end * rate)
    times = start + np.arange(first, last) / rate
    omega = 2 * np.pi * frequency
    A = np.stack([np.cos(omega * times), -np.sin(omega * times), np.ones_like(times)], axis=1)
    real, imaginary, _ = np.linalg.lstsq(A, samples[first:last], rcond=None)[0]
    return Sound(found, frequency, complex(real, imaginary), (times[0], times[-1]))
