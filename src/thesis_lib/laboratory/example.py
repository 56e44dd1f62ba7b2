"""A small rendered recording, to start from: three cameras, a beam, a board, a manifest."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import cv2

from thesis_lib.arrays import Image
from thesis_lib.facts import setups
from thesis_lib.files import staging
from thesis_lib.laboratory import film as laboratory_film
from thesis_lib.laboratory.film import SAMPLE_RATE, frames, manifest_of, shots
from thesis_lib.laboratory.render import Sensor
from thesis_lib.laboratory.rig import Rig, default_rig
from thesis_lib.measure.recordings import media
from thesis_lib.measure.recordings.manifest import write_manifest
from thesis_lib.measure.recordings.manifest_model import Manifest
from thesis_lib.studies.parallel import abreast
from thesis_lib.vibration.motion import Component

DIRECTIONS = ((12.0, 26.0), (-10.0, 25.0), (175.0, 27.0))  # azimuth and elevation, °
AMPLITUDE = 0.003  # m at the tip
SIZE = (1280, 720)
CRF = 18  # of H.264
QUALITY = 92  # of the board's pictures, JPEG
FOCAL_MM, SENSOR_MM = 24.0, 36.0


def example_rig() -> Rig:
    """What the example shows."""
    return default_rig(
        setups.beam(),
        DIRECTIONS,
        focal_length=FOCAL_MM / 1000,
        sensor_width=SENSOR_MM / 1000,
        size=SIZE,
        sensor=Sensor(exposure=1 / 500, samples=4, shot=0.02, read=0.7),
        seed=11,
        components=(Component(amplitude=AMPLITUDE),),
    )


def example_manifest(rig: Rig) -> Manifest:
    """The manifest of the example, with what the warnings before measuring ask for."""
    manifest = manifest_of(rig)
    cameras = tuple(
        camera.model_copy(
            update={
                "video": f"{camera.name}.mkv",
                "shots": f"board/{camera.name}-*.jpg",
                "focal_length_mm": FOCAL_MM,
                "sensor_width_mm": SENSOR_MM,
                "f_number": 11.0,
                "distance_mm": 570.0,
                "azimuth_deg": azimuth,
                "elevation_deg": elevation,
            }
        )
        for camera, (azimuth, elevation) in zip(manifest.cameras, DIRECTIONS, strict=True)
    )
    excitation = manifest.excitation.model_copy(update={"amplitude_mm": 1000 * AMPLITUDE})
    return manifest.model_copy(update={"cameras": cameras, "excitation": excitation})


def write_example(folder: Path, say: Callable[[str], object] = print) -> Path:
    """Render the example into a folder, which must not hold anything yet; whole or not at all.

    Returns
    -------
    Path
        The manifest.

    Raises
    ------
    FileExistsError
        If the folder is a file, or not empty.
    """
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise FileExistsError(f"{folder}: is there already, allowed: a new or empty folder")
    rig, stop = example_rig(), threading.Event()
    folder.parent.mkdir(parents=True, exist_ok=True)
    with staging(folder.parent) as part:
        (part / "board").mkdir()

        def until_stopped(pictures: Iterator[Image]) -> Iterator[Image]:
            for picture in pictures:
                if stop.is_set():
                    raise KeyboardInterrupt
                yield picture

        def one(index: int) -> None:
            station = rig.stations[index]
            name = station.camera.name
            say(f"rendering camera {name}, {index + 1} of {len(rig.stations)}")
            media.write_video(
                part / f"{name}.mkv",
                until_stopped(frames(rig, index)),
                station.frame_rate,
                laboratory_film.sound(rig, index),
                SAMPLE_RATE,
                "h264",
                CRF,
            )
            for k, shot in enumerate(until_stopped(shots(rig, index))):
                _, data = cv2.imencode(".jpg", shot, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
                (part / "board" / f"{name}-{k:02d}.jpg").write_bytes(data.tobytes())

        abreast(one, range(len(rig.stations)), stop.set)
        write_manifest(example_manifest(rig), part / "manifest.yaml")
        if folder.exists():
            folder.rmdir()
        part.rename(folder)
    return folder / "manifest.yaml"
