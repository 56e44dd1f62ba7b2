"""Recordings of other kinds than the thesis's, from the folder to the shape, against the truth."""

import warnings

import numpy as np
import pytest
import xarray as xr
from scenes import own

from thesis_lib.facts import setups
from thesis_lib.laboratory.render import Sensor
from thesis_lib.measure.pipeline import STEPS_FOLDER, measure_recordings
from thesis_lib.measure.recordings.board import Board, Markers
from thesis_lib.measure.recordings.manifest import read_manifest, write_manifest
from thesis_lib.measure.recordings.media import write_png
from thesis_lib.measure.report.warnings import check_shape
from thesis_lib.measure.steps import calibrate_rig
from thesis_lib.vibration.motion import Component

pytestmark = pytest.mark.slow  # for the report of conformance

BEAM, PLATE = setups.thesis_beam(), setups.thesis_plate()


def scattered(n, apart, rng):
    """Places on the plate, none within a distance of another."""
    places = []
    while len(places) < n:
        place = rng.uniform([0.03, 0.03], [0.638, 0.413])
        if all(np.hypot(*(place - other)) > apart for other in places):
            places.append(place)
    return np.array(places).T


def compare(conforms, data, rig, allowed):
    """The shape against the truth: rms error over the largest deflection, and in its errors."""
    part = rig.motion.components[0]
    true = part.amplitude * part.shape(rig.motion.structure, rig.markers.centres)
    shape = data["deflection"].values
    shape = shape * np.sign(shape @ true)
    error = np.sqrt(np.mean((shape - true) ** 2))
    conforms.closed_form(error, below=allowed * np.abs(true).max())
    return error / np.sqrt(np.mean(data["standard_error"].values ** 2))


@pytest.mark.nightly
def test_bright_points_anywhere_on_a_plate(conforms, tmp_path):
    markers = Markers(PLATE.extent, scattered(40, 0.045, np.random.default_rng(2)), 0.012, None,
                      bright=True)  # fmt: skip
    rig = own.short_rig(
        PLATE, [(20, 50), (140, 50), (260, 50)], Component("bending", 2, 11.5, 0.002),
        markers=markers, distance=0.95, sensor=Sensor(white=40, dark=210, samples=3),
    )  # fmt: skip
    rig = own.replace(rig, board=Board(8, 6, 0.05, 0.05))
    manifest = own.make(tmp_path, rig, {}, corners=True, board_sensor=Sensor())
    data = own.shape_of(manifest, tmp_path / "steps")
    assert data.attrs["most_similar"] == "mode (2, 1)"
    conforms.sampled(compare(conforms, data, rig, 0.01), below=3)
    assert data.sizes["marker"] == 40


@pytest.fixture(scope="module")
def silent(tmp_path_factory):
    """A vibration that two industrial cameras film without sound, never at rest, poses mixed up."""
    folder = tmp_path_factory.mktemp("silent")
    rig = own.short_rig(BEAM, [(12, 30), (-150, 35)], Component(amplitude=0.003, frequency=6.3),
                        steady=1.2)  # fmt: skip
    excitation = {"sound": "none", "rest_duration_s": 0.0, "steady_interval_s": (0.45, 1.5),
                  "force_per_full_scale_n": None}  # fmt: skip
    path = own.make(folder, rig, excitation, sound=lambda rig, index: np.zeros(48))
    manifest = read_manifest(path)
    pictures = [folder / camera.board_images for camera in manifest.cameras]
    for place in pictures:  # one pose that is seen by none, and two that one camera has exchanged
        write_png(place / "02.png", np.full((540, 960), 90, np.uint8))
    one, other = pictures[1] / "05.png", pictures[1] / "06.png"
    first, second = one.read_bytes(), other.read_bytes()
    one.write_bytes(second)
    other.write_bytes(first)
    cameras = [
        camera.model_copy(update={"name": name})
        for camera, name in zip(manifest.cameras, ("左", "右"), strict=True)
    ]
    write_manifest(manifest.model_copy(update={"cameras": tuple(cameras)}), path)
    return rig, path


@pytest.mark.nightly
def test_a_steady_vibration_needs_no_sound(conforms, silent):
    rig, manifest = silent
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)  # letters that the figures' font lacks
        report = measure_recordings(manifest, manifest.parent / "out", lambda line: None).page
    data = xr.load_dataset(manifest.parent / "out" / "measured.nc")
    conforms.sampled(compare(conforms, data, rig, 0.01), below=3)
    assert abs(float(data["lag"][1])) > 0.01
    assert "No sound was used" in report
    assert "start of camera" not in " ".join(note.text for note in check_shape(data))


@pytest.mark.nightly
def test_a_pose_that_no_camera_can_use_is_left_out(silent):
    """By the calibration that the measurement has stored, if it ran before."""
    _, manifest = silent
    steps = manifest.parent / "out" / STEPS_FOLDER
    calibration = calibrate_rig(read_manifest(manifest), manifest.parent, steps)
    told = calibration.attrs["notes"].splitlines()
    assert "pose 3 (02.png, 02.png): no camera sees the board; it is left out" in told
    assert sum("off the rig of the others; it is left out" in line for line in told) == 2
    seen = np.isfinite(calibration["corners"]).all(("side", "corner")).any("camera").values
    np.testing.assert_array_equal(np.flatnonzero(~seen), [2, 5, 6])
    assert float(calibration["reprojection_rms"]) < 0.1


@pytest.mark.nightly
def test_a_vibration_too_fast_for_the_frames_is_measured_by_its_known_frequency(conforms, tmp_path):
    part = Component("bending", 2, 39.6, 0.0008)
    rig = own.short_rig(BEAM, [(12, 30), (-12, 30), (170, 30)], part, steady=0.9,
                        sensor=Sensor(exposure=1 / 500, samples=4))  # fmt: skip
    manifest = own.make(tmp_path, rig, {"undersampled": True})
    data = own.shape_of(manifest, tmp_path / "steps")
    assert data.attrs["most_similar"] == "bending 2"
    conforms.closed_form(float(data["frequency"]), 39.6, atol=0.01)
    conforms.sampled(compare(conforms, data, rig, 0.02), below=3)
