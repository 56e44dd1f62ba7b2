"""Recordings as someone else would make them: other structures, markers, boards and sound."""

from dataclasses import replace

import numpy as np

from thesis_lib.laboratory import recording_files as laboratory_film
from thesis_lib.laboratory.recording_files import manifest_of, render_board_images
from thesis_lib.laboratory.render import Sensor
from thesis_lib.laboratory.rig import default_poses, default_rig
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


def short_rig(structure, directions, component, steady=0.6, **given):
    """A rig that films a rest, a short rise and a steady part of so many seconds."""
    rig = default_rig(structure, directions, components=(component,), size=(960, 540), **given)
    rotations, translations = default_poses()
    chosen = np.linspace(0, len(rotations) - 1, SHOTS).round().astype(int)
    motion = Motion(structure, (component,), REST + max(STARTS) + 0.02, 0.1)
    pairs = zip(rig.stations, STARTS, strict=False)
    stations = tuple(replace(station, start=start) for station, start in pairs)
    return replace(rig, stations=stations, motion=motion, duration=motion.steady + steady,
                   rotations=rotations[chosen], translations=translations[chosen])  # fmt: skip


def corners_px(rig, index):
    """The structure's corners as a person would read them off a picture, to whole pixels."""
    length, width = rig.markers.extent
    plane = np.array([[0, length, length, 0], [0, 0, width, width]])
    uv = project_points(rig.stations[index].camera, on_surface(rig.markers.extent, plane))
    return tuple((float(round(u)), float(round(v))) for u, v in uv.T)


def make(folder, rig, excitation, *, sound=None, corners=False, board_sensor=None):
    """Write videos, pictures of the board and the manifest, of one's own making."""
    cameras, manifest = [], manifest_of(rig)
    sensor = board_sensor or Sensor()
    plain = replace(rig, stations=tuple(replace(s, sensor=sensor) for s in rig.stations))
    for index, (station, files) in enumerate(zip(rig.stations, manifest.cameras, strict=True)):
        name = station.camera.name
        audio = laboratory_film.render_sound(rig, index) if sound is None else sound(rig, index)
        frames = laboratory_film.render_frames(rig, index)
        media.write_video(folder / f"{name}.mkv", frames, station.frame_rate, audio, RATE)
        for k, shot in enumerate(render_board_images(plain, index)):
            write_png(folder / name / f"{k:02d}.png", shot)
        if corners:
            files = files.model_copy(update={"corners_px": corners_px(rig, index)})
        cameras.append(files)
    driven = manifest.excitation.model_copy(update={"rest_duration_s": REST, **excitation})
    manifest = manifest.model_copy(update={"cameras": tuple(cameras), "excitation": driven})
    write_manifest(manifest, folder / "manifest.yaml")
    return folder / "manifest.yaml"


def shape_of(manifest, steps):
    """What a measurement finds, without its report and the other files."""
    given = read_manifest(manifest)
    return fit_deflection(given, record_tracks(given, manifest.parent, steps, lambda line: None))[0]
