"""Recordings as someone else would make them: other structures, markers, boards and sound."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import xarray as xr
from scenes.sounds import write_film

from thesis_lib.laboratory import recording_files as laboratory_film
from thesis_lib.laboratory.recording_files import manifest_of, render_board_images
from thesis_lib.laboratory.render import Sensor
from thesis_lib.laboratory.rig import Rig, default_poses, default_rig
from thesis_lib.measure.pipeline import fit_deflection, record_tracks
from thesis_lib.measure.recordings import media
from thesis_lib.measure.recordings.board import on_surface
from thesis_lib.measure.recordings.manifest import read_manifest, write_manifest
from thesis_lib.measure.recordings.media import write_png
from thesis_lib.vibration.motion import Motion
from thesis_lib.vision.pinhole import project_points

REST = 0.25  # s at rest on the clock of the camera that starts last
STARTS = (0.02, 0.0, 0.05, 0.013)
SHOTS = 10
RATE = 48000


def short_rig(structure, directions, component, steady=0.6, **given) -> Rig:
    """A rig that films a rest, a short rise and a steady part of so many seconds."""
    rig = default_rig(structure, directions, components=(component,), size=(960, 540), **given)
    rotations, translations = default_poses()
    chosen = np.linspace(0, len(rotations) - 1, SHOTS).round().astype(int)
    motion = Motion(structure, (component,), REST + max(STARTS) + 0.02, 0.1)
    stations = tuple(
        replace(station, start=start) for station, start in zip(rig.stations, STARTS, strict=False)
    )
    return replace(rig, stations=stations, motion=motion, duration=motion.steady + steady,
                   rotations=rotations[chosen], translations=translations[chosen])  # fmt: skip


def corners_px(rig: Rig, index: int) -> tuple[tuple[float, float], ...]:
    """The structure's corners as a person would read them off a picture, to whole pixels."""
    length, width = rig.markers.extent
    plane = np.array([[0, length, length, 0], [0, 0, width, width]])
    uv = project_points(rig.stations[index].camera, on_surface(rig.markers.extent, plane))
    return tuple((float(round(u)), float(round(v))) for u, v in uv.T)


def room(rig: Rig, index: int, clap: float) -> np.ndarray:
    """What a camera's microphone hears: a clap at a world time, a hum, and its own noise."""
    rng = np.random.default_rng([7, index])
    times = rig.stations[index].start + np.arange(int(rig.duration * RATE)) / RATE
    since = times - clap
    burst = np.random.default_rng(8).standard_normal(int(0.02 * RATE))
    sound = 0.004 * rng.standard_normal(len(times)) + 0.01 * np.sin(2 * np.pi * 50 * times)
    first = int(np.argmin(np.abs(since)))
    sound[first : first + len(burst)] += 0.3 * burst * np.exp(-np.arange(len(burst)) / 200)
    return np.clip(sound, -0.99, 0.99)


def make(
    folder: Path, rig: Rig, excitation: dict, *, sound=None, corners=False, board_sensor=None,
    colour=False,
) -> Path:  # fmt: skip
    """Write videos, pictures of the board and the manifest, of one's own making."""
    cameras = []
    manifest = manifest_of(rig)
    for index, (station, files) in enumerate(zip(rig.stations, manifest.cameras, strict=True)):
        name = station.camera.name
        audio = laboratory_film.render_sound(rig, index) if sound is None else sound(rig, index)
        frames = laboratory_film.render_frames(rig, index)
        if colour:
            write_colour(folder / f"{name}.mp4", frames, station.frame_rate, audio)
            files = files.model_copy(update={"video": f"{name}.mp4"})
        else:
            media.write_video(folder / f"{name}.mkv", frames, station.frame_rate, audio, RATE)
        sensor = board_sensor or Sensor()
        plain = replace(rig, stations=tuple(replace(s, sensor=sensor) for s in rig.stations))
        for k, shot in enumerate(render_board_images(plain, index)):
            write_png(folder / name / f"{k:02d}.png", shot)
        if corners:
            files = files.model_copy(update={"corners_px": corners_px(rig, index)})
        cameras.append(files)
    driven = manifest.excitation.model_copy(update={"rest_duration_s": REST, **excitation})
    manifest = manifest.model_copy(update={"cameras": tuple(cameras), "excitation": driven})
    write_manifest(manifest, folder / "manifest.yaml")
    return folder / "manifest.yaml"


def shape_of(manifest: Path, steps: Path) -> xr.Dataset:
    """What a measurement finds, without its report and the other files."""
    given = read_manifest(manifest)
    return fit_deflection(given, record_tracks(given, manifest.parent, steps, lambda line: None))[0]


def write_colour(path: Path, frames, rate: float, audio: np.ndarray) -> None:
    """A colour video of a phone's kind: H.264 in 4:2:0 and AAC sound, slightly reddish."""
    path.parent.mkdir(parents=True, exist_ok=True)
    tinted = (
        np.stack([image, 0.95 * image, 0.9 * image], axis=-1).astype(np.uint8) for image in frames
    )
    write_film(path, [audio], RATE, frames=tinted, frame_rate=rate, pictures="libx264",
               options={"crf": "14"})  # fmt: skip
