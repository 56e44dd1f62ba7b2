"""Recordings of a beam that is tapped or driven: rendered to video files, with claps."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from scenes.modes import BEAM

from thesis_lib.arrays import Array
from thesis_lib.laboratory.film import SAMPLE_RATE, manifest_of
from thesis_lib.laboratory.render import Sensor
from thesis_lib.laboratory.rig import Rig, default_rig
from thesis_lib.laboratory.tapped import rolling_frames
from thesis_lib.measure.exchange.cameras import write_opencv
from thesis_lib.measure.recordings.manifest import write_manifest
from thesis_lib.measure.recordings.manifest_model import Manifest
from thesis_lib.measure.recordings.media import write_video
from thesis_lib.studies.parallel import abreast

CLAPS = (0.4, 0.47, 0.61, 1.05, 1.5)  # s of the world
DIRECTIONS = [(-10.0, 22.0), (10.0, 22.0), (170.0, 22.0), (190.0, 22.0)]  # those of chapter 5


def beam_rig(cameras: int = 3, exposure: float = 1 / 1000) -> Rig:
    """The thesis's beam before some of the cameras of chapter 5, of 1280 × 720 px."""
    sensor = Sensor(exposure=exposure, samples=3, shot=0.02, read=0.7)
    return default_rig(BEAM, DIRECTIONS[:cameras], size=(1280, 720), sensor=sensor)


def heard(times: Array, seed: int) -> Array:
    """What a microphone hears at times of the world: claps, and a little noise."""
    length = SAMPLE_RATE // 100
    fades = np.exp(-np.arange(length) / 80)
    room, clock = np.zeros(2 * SAMPLE_RATE), np.random.default_rng(5)
    for at in CLAPS:
        first = int(at * SAMPLE_RATE)
        room[first : first + length] = 0.6 * clock.standard_normal(length) * fades
    sound = np.interp(times, np.arange(len(room)) / SAMPLE_RATE, room)
    return np.clip(sound, -0.9, 0.9) + 1e-3 * np.random.default_rng(seed).standard_normal(
        len(times)
    )


def written(rig: Rig, folder: Path, readout: float, **changes: Mapping[str, Any]) -> Path:
    """Write videos, the true cameras and a manifest with changes; returns the latter."""

    def one(index: int) -> None:
        station = rig.stations[index]
        times = station.start + np.arange(int(rig.duration * SAMPLE_RATE)) / SAMPLE_RATE
        path = folder / f"{station.camera.name}.mkv"
        frames = rolling_frames(rig, index, readout)
        write_video(path, frames, station.frame_rate, heard(times, index), SAMPLE_RATE)

    abreast(one, range(len(rig.stations)))
    write_opencv(folder / "cameras.yaml", rig.cameras)
    values = manifest_of(rig).model_dump(mode="json")
    for camera in values["cameras"]:
        camera |= {"shots": None, "readout_s": readout}
    values |= {"calibration": "cameras.yaml", **changes}
    write_manifest(Manifest.model_validate_json(json.dumps(values)), folder / "manifest.yaml")
    return folder / "manifest.yaml"
