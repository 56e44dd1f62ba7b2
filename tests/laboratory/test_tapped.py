"""A tapped structure against its equation of motion, rolling shutters, and modes found in it."""

import json
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from scenes.driven import write_wav
from scenes.modes import BEAM
from scipy.integrate import quad, solve_ivp

from thesis_lib.laboratory.recording_files import SAMPLE_RATE_HZ, manifest_of
from thesis_lib.laboratory.render import BeamView, Sensor, collect_light
from thesis_lib.laboratory.rig import default_rig
from thesis_lib.laboratory.tracking import add_impact
from thesis_lib.measure.exchange.cameras import write_cameras
from thesis_lib.measure.modes.identify import modal_assurance
from thesis_lib.measure.pipeline import measure_recordings
from thesis_lib.measure.recordings.board import on_surface, rows_on
from thesis_lib.measure.recordings.manifest import Manifest, write_manifest
from thesis_lib.measure.recordings.media import write_video
from thesis_lib.studies.workers import map_in_two_threads
from thesis_lib.vision import pinhole

POINT = (0.3 * BEAM.length, BEAM.width / 2)
DAMPING = (0.012, 0.006, 0.002)
CLAPS = (0.4, 0.47, 0.61, 1.05, 1.5)  # s of the world
DIRECTIONS = [(-10.0, 22.0), (10.0, 22.0), (170.0, 22.0)]  # three of chapter 5


def tapped(markers=None, **given):
    """The thesis's beam, tapped before three of the cameras of chapter 5, of 1280 × 720 px."""
    sensor = Sensor(exposure=1 / 1000, samples=3, shot=0.02, read=0.7)
    own = default_rig(BEAM, DIRECTIONS, size=(1280, 720), sensor=sensor, markers=markers)
    return add_impact(own, DAMPING, POINT, **given)


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


def written(rig, folder, readout, **changes):
    """Write videos, the true cameras and a manifest with changes; returns the latter."""

    def one(index):
        station = rig.stations[index]
        times = station.start + np.arange(int(rig.duration * SAMPLE_RATE_HZ)) / SAMPLE_RATE_HZ
        view = RollingView(station.camera, rig.markers, rig.motion, station.sensor, readout)
        frames = (
            view.frame(station.start + k / station.frame_rate, rig.generator(1, index, k))
            for k in range(int(rig.duration * station.frame_rate))
        )
        path, sound = folder / f"{station.camera.name}.mkv", heard(times, index)
        write_video(path, frames, station.frame_rate, sound, SAMPLE_RATE_HZ)

    map_in_two_threads(one, range(len(rig.stations)))
    write_cameras(folder / "cameras.yaml", rig.cameras)
    values = manifest_of(rig).model_dump(mode="json")
    for camera in values["cameras"]:
        camera |= {"board_images": None, "readout_s": readout}
    values |= {"calibration": "cameras.yaml", **changes}
    write_manifest(Manifest.model_validate_json(json.dumps(values)), folder / "manifest.yaml")
    return folder / "manifest.yaml"


def test_a_tap_against_its_equation_of_motion():
    few = rows_on(replace(BEAM, n_markers=12, marker_spacing=0.05), diameter=0.008, hole=None)
    motion = tapped(few, impulse=0.02, pulse=0.004).motion
    shapes = BEAM.mode_shapes([1, 2, 3], np.array(POINT)[:, None])[:, 0]
    omega = BEAM.angular_frequencies(3)
    times = motion.start + np.linspace(0, 0.2, 50)

    def moves(t, y):
        force = float(motion.force(np.array(t)))
        pull = shapes * force / BEAM.mass - 2 * np.array(DAMPING) * omega * y[3:]
        return np.concatenate([y[3:], pull - omega**2 * y[:3]])

    found = solve_ivp(moves, (times[0], times[-1]), np.zeros(6), t_eval=times, max_step=5e-4,
                      rtol=1e-9, atol=1e-14)  # fmt: skip
    points = np.array([[0.2, BEAM.length], [0.01, 0.02]])
    expected = found.y[:3].T @ BEAM.mode_shapes([1, 2, 3], points)
    most = 1e-6 * np.abs(expected).max()
    np.testing.assert_allclose(motion.deflection(points, times), expected, atol=most)
    force, _ = quad(lambda t: float(motion.force(np.array(t))), motion.start, motion.steady)
    assert force == pytest.approx(0.02, rel=1e-6)
    assert np.all(motion.coordinates(motion.start - np.array([1.0, 0.01])) == 0)


@pytest.mark.nightly
def test_three_modes_of_a_rendered_beam_from_video_files(tmp_path):
    """By the whole chain: the thesis's markers, whose rows lie 5 px apart, move 2 px a frame."""
    rates, readout = (60.0, 50.0, 29.97), 0.008
    own = tapped(rates=rates, impulse=0.02, seconds=2.6, rest=0.6)
    sought = {"from_hz": 4.0, "to_hz": 130.0, "count": 3}
    excitation = {"kind": "free_decay", "sound": "room", "rest_duration_s": 0.55, "modes": sought}
    force = force_heard(own, tmp_path, POINT)
    manifest = written(own, tmp_path, readout, excitation=excitation, force=force)
    measure_recordings(manifest, tmp_path / "out", str)
    text = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "<h2>Mode 3: 110.76 Hz</h2>" in text
    assert "<h2>Motion over force</h2>" in text
    assert "still-ringing" in text  # two seconds are no answer to the tap as a whole
    found = xr.load_dataset(tmp_path / "out" / "modes.nc")
    motion = own.motion
    hertz = [part.frequency for part in motion.components]
    np.testing.assert_allclose(found["frequency"], hertz, rtol=1e-4)
    np.testing.assert_allclose(found["damping"], DAMPING, rtol=0.01)
    shapes = found["amplitude_real"].values + 1j * found["amplitude_imag"].values
    true = motion.amplitudes(own.markers.centres, float(found["zero"]) + own.stations[0].start)
    for measured, expected in zip(shapes, true, strict=True):
        assert modal_assurance([measured, expected])[0, 1] > 0.9995
        assert np.nanmax(np.abs(measured - expected)) < 0.02 * np.abs(expected).max()
    assert found["missing"].max() < 0.05
