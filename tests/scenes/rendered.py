"""Recordings of a beam that is tapped: rendered to video files, with claps."""

import json

import numpy as np
from scenes.driven import write_wav
from scenes.modes import BEAM

from thesis_lib.laboratory.recording_files import SAMPLE_RATE_HZ, manifest_of
from thesis_lib.laboratory.render import BeamView, Sensor, collect_light
from thesis_lib.laboratory.rig import default_rig
from thesis_lib.measure.exchange.cameras import write_cameras
from thesis_lib.measure.recordings.board import on_surface
from thesis_lib.measure.recordings.manifest import Manifest, write_manifest
from thesis_lib.measure.recordings.media import write_video
from thesis_lib.studies.workers import map_in_pairs
from thesis_lib.vision import pinhole

CLAPS = (0.4, 0.47, 0.61, 1.05, 1.5)  # s of the world
DIRECTIONS = [(-10.0, 22.0), (10.0, 22.0), (170.0, 22.0)]  # three of chapter 5


def beam_rig():
    """The thesis's beam before three of the cameras of chapter 5, of 1280 × 720 px."""
    sensor = Sensor(exposure=1 / 1000, samples=3, shot=0.02, read=0.7)
    return default_rig(BEAM, DIRECTIONS, size=(1280, 720), sensor=sensor)


def heard(times, seed):
    """What a microphone hears at times of the world: claps, and a little noise."""
    length = SAMPLE_RATE_HZ // 100
    fades = np.exp(-np.arange(length) / 80)
    room, clock = np.zeros(2 * SAMPLE_RATE_HZ), np.random.default_rng(5)
    for at in CLAPS:
        first = int(at * SAMPLE_RATE_HZ)
        room[first : first + length] = 0.6 * clock.standard_normal(length) * fades
    sound = np.interp(times, np.arange(len(room)) / SAMPLE_RATE_HZ, room)
    noise = np.random.default_rng(seed).standard_normal(len(times))
    return np.clip(sound, -0.9, 0.9) + 1e-3 * noise


def force_heard(rig, folder, place):
    """Write the force beside what a microphone hears; returns what a manifest says of it."""
    world = np.arange(int((rig.duration + 0.5) * SAMPLE_RATE_HZ)) / SAMPLE_RATE_HZ
    newtons = rig.motion.force(world)
    full_scale = 2 * float(np.abs(newtons).max())
    write_wav(folder / "force.wav", newtons / full_scale, heard(world, 99), rate=SAMPLE_RATE_HZ)
    at = [1000 * x for x in place]
    return {"file": "force.wav", "full_scale_n": full_scale, "sound_channel": 2, "at_mm": at}


class RollingView(BeamView):
    """A camera whose rows are exposed one after the other: each point at the time of its row."""

    def __init__(self, camera, markers, motion, sensor, readout):
        super().__init__(camera, markers, motion, sensor)
        self.readout = readout
        rest = pinhole.project_points(camera, on_surface(markers.extent, self.points))
        self.late = readout * (rest[1] / camera.size[1] - 0.5)

    def collect_light(self, time):
        """Collect the light around a time in s of the motion, that of the middle row."""
        samples, late = self.sensor.samples, self.late
        within = ((np.arange(samples) + 0.5) / samples - 0.5) * self.sensor.exposure
        for _ in range(2):  # a moving point is seen at the time of the row where it is then
            at = time + within[:, None] + late
            deflection = np.einsum("kn,ksn->sn", self.shapes, self.motion.coordinates(at))
            world = on_surface(self.markers.extent, self.points[:, None], deflection)
            uv = pinhole.project_points(self.camera, world)
            late = self.readout * (uv[1].mean(axis=0) / self.camera.size[1] - 0.5)
        return collect_light(uv, self.polygons, self.camera.size, self.sensor)


def rolling_frames(rig, index, readout):
    """Render the frames of one camera whose rows are read in `readout` s."""
    station = rig.stations[index]
    view = RollingView(station.camera, rig.markers, rig.motion, station.sensor, readout)
    for k in range(int(rig.duration * station.frame_rate)):
        yield view.frame(station.start + k / station.frame_rate, rig.generator(1, index, k))


def written(rig, folder, readout, **changes):
    """Write videos, the true cameras and a manifest with changes; returns the latter."""

    def one(index):
        station = rig.stations[index]
        times = station.start + np.arange(int(rig.duration * SAMPLE_RATE_HZ)) / SAMPLE_RATE_HZ
        path = folder / f"{station.camera.name}.mkv"
        frames = rolling_frames(rig, index, readout)
        write_video(path, frames, station.frame_rate, heard(times, index), SAMPLE_RATE_HZ)

    map_in_pairs(one, range(len(rig.stations)))
    write_cameras(folder / "cameras.yaml", rig.cameras)
    values = manifest_of(rig).model_dump(mode="json")
    for camera in values["cameras"]:
        camera |= {"board_images": None, "readout_s": readout}
    values |= {"calibration": "cameras.yaml", **changes}
    write_manifest(Manifest.model_validate_json(json.dumps(values)), folder / "manifest.yaml")
    return folder / "manifest.yaml"
