"""A force as it was recorded: read, checked, and put on the first camera's clock.

A resonance at f with damping ratio ζ answers within 1 / (2πζf) s; a sweep is in its half-power
band, 2ζf wide, for 2ζf over its speed. If that is not some times longer, it does not settle.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.signal import ShortTimeFFT

from thesis_lib.arrays import Array
from thesis_lib.measure.recordings.audio import MAX_SILENT_RMS
from thesis_lib.measure.recordings.force_table import ForceError, read_force_table
from thesis_lib.measure.recordings.manifest import Manifest
from thesis_lib.measure.recordings.manifest_parts import Force, Sweep
from thesis_lib.measure.synchronisation import audio
from thesis_lib.measure.synchronisation.audio import AudioSource, SynchronisationError
from thesis_lib.measure.synchronisation.drift import COMPARED_RATE_HZ, beside_first

# Times the resonance's time constant in which it settles: to e⁻⁴, 2 %
SETTLING_TIME_CONSTANTS = 4.0
# Of the largest power of a segment; weaker ones are before or after the sweep
MIN_SEGMENT_POWER_RATIO = 0.03
SWEEP_SEGMENTS = 100  # segments of a recording in which the frequency is sought


def find_sweep(newtons: Array, rate: float, given: Sweep) -> Sweep:
    """Return a sweep, with missing fields estimated from the force's strongest line over time."""
    length = max(len(newtons) // SWEEP_SEGMENTS * 2, 16)
    made = ShortTimeFFT(np.hanning(length), length // 2, rate, mfft=8 * length)
    power = np.abs(made.stft_detrend(newtons, "constant")) ** 2
    loud = power.max(axis=0)
    on = np.flatnonzero(loud > MIN_SEGMENT_POWER_RATIO * loud.max())
    line = made.f[np.argmax(power[:, on], axis=0)]
    return Sweep(
        from_hz=given.from_hz or max(float(line[0]), 1e-3),
        to_hz=given.to_hz or max(float(line[-1]), 2e-3),
        duration_s=given.duration_s or max(float(made.delta_t * (on[-1] - on[0])), 1e-3),
    )


def dwell_time(sweep: Sweep, frequency: float, damping: float) -> float:
    """Return the time that a sweep of even speed spends in a resonance's half-power band, s."""
    begin, end, seconds = (float(x or np.nan) for x in sweep.model_dump().values())
    return 2 * damping * frequency * seconds / abs(end - begin)


def settling_time(frequency: float, damping: float) -> float:
    """Return the time that a resonance takes to settle, s."""
    return SETTLING_TIME_CONSTANTS / (2 * math.pi * damping * frequency)


FORCE_RATE_RATIO = 10  # times the frame rate to which a fast recording of a force is reduced
MIN_CLIPPED_SAMPLES = 3  # samples at full scale from which on a force counts as clipped


@dataclass(frozen=True)
class Clock:
    """What of a force's file is at which time of the first camera's clock."""

    delay: float  #: When the file begins, s
    delay_deviation: float  #: Its standard error, s; 0 if it was given
    pace: float = 1.0  #: Seconds of the first camera's clock for one of the file's


@dataclass(frozen=True)
class RecordedForce:
    """A force over time."""

    times: Array  #: On the first camera's clock, s, shape (samples,)
    newtons: Array  #: N, shape (samples,)
    clock: Clock  #: How the times were found
    source: str = ""  #: Which columns of a table, or which channel, it is

    @property
    def rate(self) -> float:
        """Return the samples per second."""
        return (len(self.times) - 1) / float(self.times[-1] - self.times[0])


def read_force(
    manifest: Manifest, folder: Path, delays: Array, paces: Sequence[float] = ()
) -> RecordedForce:
    """Return the force of a manifest.

    Parameters
    ----------
    manifest : Manifest
        With a force.
    folder : Path
        The manifest's.
    delays : ndarray, shape (cameras,)
        When each camera started, on the first one's clock, s.
    paces : sequence of float
        Seconds of the first camera's clock for one of each camera's; one if there are none.

    Raises
    ------
    ForceError
        If it is silent, clipped, no table of numbers, or no sound tells when it began.
    MediaError
        If the file is none that can be read.
    """
    given = manifest.force
    assert given is not None
    path = folder / given.file
    if given.is_table:
        table = read_force_table(path)
        own, newtons, source = table.times, table.newtons, table.source
    else:
        fastest = max(camera.frame_rate_hz for camera in manifest.cameras)
        own, newtons = _sound(path, given, FORCE_RATE_RATIO * fastest)
        source = f"channel {given.channel}, {given.full_scale_n:g} N at full scale"
    if not np.ptp(newtons) > 0:
        raise ForceError(f"{path}: silent, allowed: a force that changes")
    clock = _clock(manifest, folder, delays, paces or np.ones(len(delays)))
    return RecordedForce(own * clock.pace + clock.delay, newtons, clock, f"{path.name}: {source}")


def _sound(path: Path, given: Force, wanted: float) -> tuple[Array, Array]:
    """Read times in s and forces in N of a sound file, at the lowest rate above one in Hz."""
    assert given.full_scale_n is not None
    largest: list[float] = []
    full: list[int] = []

    def noted(blocks: Iterator[Array]) -> Iterator[Array]:
        for block in blocks:
            largest.append(float(np.abs(block).max(initial=0.0)))
            full.append(int(np.count_nonzero(np.abs(block) >= audio.FULL_SCALE)))
            yield block

    with AudioSource("the force", path, given.channel).opened() as file:
        step = audio.step_to(file.rate, wanted)
        rate = file.rate / step
        values = np.concatenate([np.empty(0), *audio.decimate_blocks(noted(file.blocks), step)])
        start = file.start + audio.cut_off(file.rate, rate)
    peak = max(largest, default=0.0)
    if peak < MAX_SILENT_RMS:
        raise ForceError(
            f"{path}: channel {given.channel} is silent (at most {peak:.1e} of full scale), "
            f"allowed: at least {MAX_SILENT_RMS}"
        )
    if sum(full) >= MIN_CLIPPED_SAMPLES:
        raise ForceError(
            f"{path}: channel {given.channel} is clipped ({sum(full)} samples at full scale), "
            "allowed: none; turn its gain down"
        )
    return start + np.arange(len(values)) / rate, values * given.full_scale_n


def _clock(manifest: Manifest, folder: Path, delays: Array, paces: Iterable[float]) -> Clock:
    """Return the given clock, that of the camera whose sound it is, or the one found by sound."""
    given = manifest.force
    assert given is not None
    if given.offset_s is not None:
        return Clock(given.offset_s, 0.0)
    path, first = folder / given.file, manifest.cameras[0]
    for camera, delay, pace in zip(manifest.cameras, delays, paces, strict=True):
        if (folder / camera.video).resolve() == path.resolve():
            return Clock(float(delay), 0.0, pace)
    channel = given.sound_channel or given.channel
    both = AudioSource(first.name, folder / first.video), AudioSource("the force", path, channel)
    try:
        found = beside_first(both, {1: None})[1]
    except SynchronisationError:
        raise ForceError(
            f"{path}: no sound in channel {channel} matches that of camera {first.name} beyond "
            "doubt; record a microphone beside the force and name its channel as "
            "force.sound_channel, or give force.offset_s"
        ) from None
    if not np.isfinite(found.delay_deviation):
        return Clock(found.delay, 1 / COMPARED_RATE_HZ)
    pace = 1 - found.drift if abs(found.drift) > 2 * found.drift_deviation else 1.0
    middle = float(found.times.mean())  # where the line is best known
    return Clock(found.delay + (1 - found.drift - pace) * middle, found.delay_deviation, pace)
