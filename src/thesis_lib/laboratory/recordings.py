"""Recordings of fast vibrations: rigs that the parameters describe, rendered and tracked at once.

Each camera is at rest for a few frames and then, after half a period that no frame needs, films
the steady vibration. A real structure takes its time to get there; frames before that are useless.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import xarray as xr

from thesis_lib.laboratory import direct
from thesis_lib.laboratory.direct import Seen
from thesis_lib.laboratory.filming import Film
from thesis_lib.laboratory.render import Sensor
from thesis_lib.laboratory.rig import Rig, default_rig
from thesis_lib.studies.parallel import abreast
from thesis_lib.studies.variables import declared, labelled
from thesis_lib.vibration.motion import Component, Motion
from thesis_lib.vibration.structure import Structure

REST = 4  # frames at rest
RAMP = 0.5  # periods in which the vibration takes up
SAMPLES = 3  # of the motion within an exposure
TRACKS = declared("""
    tracks(camera, frame, axis, marker) [px] marker centres, lens distortion included
    truth(camera, frame, axis, marker) [px] where they were at the middle of the exposure
    quiet(camera, frame, axis, marker) [px] centres in frames without noise
    time(camera, frame) [s] middle of the exposure
""")


def sensor(film: Film) -> Sensor:
    """The sensor, with the positions in an exposure so spread that their variance is the light's.

    n positions in the middle of equal parts of a time T have the variance T² (1 − 1/n²) / 12.
    """
    exposure = film.exposure_ms / 1000 / np.sqrt(1 - 1 / SAMPLES**2)
    return Sensor(exposure, SAMPLES, shot=film.shot_noise, read=film.read_noise)


def film_seed(seed: int, *what: object) -> int:
    """A seed of its own for what is rendered, whatever else is."""
    text = repr((seed, *what)).encode()
    return int.from_bytes(hashlib.sha256(text).digest()[:6], "big")


def settled(rig: Rig, offsets: Sequence[float], frames: int) -> Rig:
    """The rig with frames at rest, then so many of the steady vibration.

    Camera i starts `offsets[i]` of a frame after time 0.
    """
    rate = rig.stations[0].frame_rate
    stations = tuple(
        replace(station, start=offset / rate)
        for station, offset in zip(rig.stations, offsets, strict=True)
    )
    components = rig.motion.components
    ramp = RAMP / min(part.frequency for part in components)
    motion = Motion(rig.motion.structure, components, (REST + 1) / rate, ramp)
    count = int(np.ceil(motion.steady * rate)) + frames
    return replace(rig, stations=stations, motion=motion, duration=(count + 0.5) / rate)


def film_rig(
    film: Film,
    structure: Structure,
    directions: Sequence[tuple[float, float]],
    distance_mm: float,
    width: int,
    rate: float,
    components: tuple[Component, ...],
    seed: int,
) -> Rig:
    """A rig that renders a structure so many frames per second, from some directions."""
    return default_rig(
        structure,  # type: ignore[arg-type]
        directions,
        focal_length=film.focal_length_mm / 1000,
        sensor_width=film.sensor_width_mm / 1000,
        distance=distance_mm / 1000,
        size=(width, round(width * 9 / 16)),
        sensor=sensor(film),
        frame_rate=rate,
        components=components,
        lens_k1=film.lens_k1,
        seed=seed,
    )


def record(
    rigs: Sequence[Rig], frames: int, look: Callable[[Rig], list[Seen]] = direct.seen
) -> xr.Dataset:
    """What the cameras of some rigs see at rest and in the last `frames` frames.

    Two rigs at a time; `look` films a rig and tracks its markers.

    Returns
    -------
    xarray.Dataset
        ``tracks``, ``truth`` and ``time`` of :data:`TRACKS`, along ``rig``, too.
    """
    every = abreast(look, rigs)
    every = [[kept(own, frames) for own in found] for found in every]
    of = {"tracks": "centres", "truth": "truth", "time": "times"}
    values = {
        name: [[getattr(own, field) for own in found] for found in every]
        for name, field in of.items()
    }
    return xr.Dataset(labelled(values, TRACKS, ["rig"]))


def kept(own: Seen, frames: int) -> Seen:
    """Of what a camera saw, the rest and the last `frames` frames."""
    chosen = np.r_[:REST, len(own.times) - frames : len(own.times)]
    return Seen(own.times[chosen], own.centres[chosen], own.truth[chosen])


def found_in(data: xr.Dataset, rig: int) -> list[Seen]:
    """What the cameras of one rig saw."""
    part = data.isel(rig=rig)
    return [
        Seen(times, centres, truth)
        for times, centres, truth in zip(
            part["time"].values, part["tracks"].values, part["truth"].values, strict=True
        )
    ]
