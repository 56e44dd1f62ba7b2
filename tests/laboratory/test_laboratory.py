"""The laboratory filmed and measured, end to end: two cameras, half the size, known truth."""

from dataclasses import replace

import numpy as np
import pytest

from thesis_lib.facts import setups
from thesis_lib.figure_sets.experiment import compute as filmed, methods as chain
from thesis_lib.laboratory import recording_files as laboratory_film
from thesis_lib.laboratory.recording_files import SAMPLE_RATE_HZ, write_recording
from thesis_lib.laboratory.rig import MAX_START_S, REST_S, default_rig
from thesis_lib.measure.recordings.manifest import read_manifest
from thesis_lib.measure.steps import calibrate_rig
from thesis_lib.vibration.motion import Component, Motion
from thesis_lib.vision import pinhole

pytestmark = pytest.mark.slow  # films first

BEAM = setups.thesis_beam()
SIZE = (960, 540)
OPPOSITE = [(10, 22), (190, 22)]
BENDING, TORSION = Component(), Component("torsion", 1, 8.5, 0.0005, 0.7)


def small_rig():
    """A and C of the default rig, eight shots, no longer than it takes."""
    rig = default_rig(BEAM, OPPOSITE, size=SIZE, components=(BENDING, TORSION), seed=3)
    motion = Motion(BEAM, rig.motion.components, REST_S + MAX_START_S, 0.3)
    return replace(rig, motion=motion, duration=2.8, rotations=rig.rotations[:8],
                   translations=rig.translations[:8])  # fmt: skip


@pytest.fixture(scope="module")
def rig():
    return small_rig()


@pytest.fixture(scope="module")
def recordings(tmp_path_factory, rig):
    folder = tmp_path_factory.mktemp("laboratory")
    write_recording(rig, folder)
    return folder


@pytest.fixture(scope="module")
def steps(tmp_path_factory):
    return tmp_path_factory.mktemp("steps")


@pytest.fixture(scope="module")
def measured(recordings, steps):
    before = contents(recordings)
    manifest = read_manifest(recordings / "manifest.yaml")
    data = chain.measure_recordings(manifest, recordings, steps, SIZE[:1])
    assert contents(recordings) == before
    return data


@pytest.fixture(scope="module")
def truth(measured, recordings, steps, rig):
    manifest = read_manifest(recordings / "manifest.yaml")
    data = measured.copy()
    filmed._add_truth(data, rig, calibrate_rig(manifest, recordings, steps))
    return data


def contents(folder):
    found = {path: path.stat() for path in folder.rglob("*")}
    return {path: (status.st_size, status.st_mtime_ns) for path, status in found.items()}


# The rig.


def test_the_rig_s_cameras_are_alike_look_at_the_beam_and_are_not_the_same(conforms):
    angles = [(10, 22), (-10, 22), (190, 22), (170, 22)]
    cameras = default_rig(BEAM, angles).cameras
    assert [camera.name for camera in cameras] == list("ABCD")
    conforms.closed_form([np.linalg.norm(c.centre) for c in cameras], 0.57, rtol=1e-7)
    for camera in cameras:
        middle = pinhole.undistort_pixels(camera, pinhole.project_points(camera, np.zeros(3)))
        conforms.closed_form(middle, camera.K[:2, 2], atol=1e-6)
        assert np.abs(camera.K[:2, 2] - [960, 540]).max() < 8
        conforms.closed_form(camera.K[0, 0], 1280, rtol=0.0051)
    assert len({camera.K[0, 0] for camera in cameras}) == 4
    assert len({tuple(camera.distortion) for camera in cameras}) == 4


def test_frames_are_made_one_by_one_with_noise_of_the_seed(rig):
    frames = [
        next(laboratory_film.render_frames(r, 0))
        for r in (replace(rig, duration=1e6), small_rig(), replace(rig, seed=4))
    ]
    np.testing.assert_array_equal(frames[0], frames[1])
    assert np.any(frames[0] != frames[2])


def test_the_sound_is_the_force_at_the_camera_s_own_start(conforms, rig):
    for index, station in enumerate(rig.stations):
        sound = laboratory_film.render_sound(rig, index)
        times = station.start + np.arange(len(sound)) / SAMPLE_RATE_HZ
        force = rig.motion.force(times) / rig.full_scale
        noise = sound - force
        tone = force[times > rig.motion.steady]
        conforms.sampled(20 * np.log10(tone.std() / noise.std()), 20, atol=0.1)
        assert np.abs(sound).max() < 1
        conforms.sampled(abs(np.corrcoef(noise[1:], noise[:-1])[0, 1]), below=0.02)
    conforms.closed_form(np.abs(force).max(), 0.5, rtol=1e-3)


# What is measured.


@pytest.mark.nightly
def test_cameras_delays_and_markers_are_the_true_ones(conforms, truth):
    conforms.closed_form(np.abs(truth["focal_error_single"]).max(), below=0.2)
    conforms.closed_form(np.abs(truth["focal_error_full"]).max(), below=0.03)
    conforms.closed_form(truth["centre_error_full"].max(), below=2e-4)
    conforms.closed_form(truth["centre_error_literal"].max(), below=2e-4)
    assert (truth["shots_used"] == 8).all()
    true = truth["true_delay"] * 60
    assert abs(true[1]) > 0.5
    conforms.closed_form(np.abs(truth["delay"] * 60 - true).max(), below=0.02)
    conforms.closed_form(np.abs(truth["delay_frames"] - true).max(), below=0.5)
    conforms.closed_form(float(truth["missing_share"][0]), below=0.002)
    assert float(truth["wrong_share"][0]) == 0
    conforms.closed_form(float(truth["centre_error"][0]), below=0.02)


@pytest.mark.nightly
def test_the_force_is_the_one_that_moves_the_beam(conforms, measured, rig):
    assert float(measured["frequency"]) == 4.25
    begin, end = measured["steady"].values
    start = rig.stations[0].start
    assert begin >= rig.motion.steady - start
    assert end <= rig.duration
    assert end - begin > 2 / 4.25
    period = start + begin + np.arange(1000) / 1000 / 4.25
    clock = period - start
    force = 2 * np.mean(rig.motion.force(period) * np.exp(-2j * np.pi * 4.25 * clock))
    found = complex(*measured["force"].values) * rig.full_scale
    conforms.closed_form(abs(found / force - 1), below=0.003)
