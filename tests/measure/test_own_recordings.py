"""Recordings of other kinds than the thesis's, from the folder to the shape, against the truth."""

import numpy as np
import pytest
import xarray as xr
from scenes import own

from thesis_lib.facts import setups
from thesis_lib.laboratory.render import Sensor
from thesis_lib.measure.pipeline import measure
from thesis_lib.measure.recordings.board import Board
from thesis_lib.measure.recordings.markers import Markers
from thesis_lib.vibration.motion import Component

pytestmark = pytest.mark.slow  # for the report of conformance

BEAM, PLATE = setups.beam(), setups.plate()


def scattered(n, apart, rng):
    """Places on the plate, none within a distance of another."""
    places = []
    while len(places) < n:
        place = rng.uniform([0.03, 0.03], [0.638, 0.413])
        if all(np.hypot(*(place - other)) > apart for other in places):
            places.append(place)
    return np.array(places).T


def measured(manifest, folder):
    """The cube of a measurement; what it says on the way is thrown away."""
    report = measure(manifest, folder, lambda line: None)
    assert report.is_file()
    with xr.open_dataset(folder / "measured.nc") as data:
        return data.load()


def compare(conforms, data, rig, allowed):
    """The shape against the truth: rms error over the largest deflection, and in its errors."""
    part = rig.motion.components[0]
    true = part.amplitude * part.shape(rig.motion.structure, rig.markers.centres)
    shape = data["deflection"].values
    shape = shape * np.sign(shape @ true)
    error = np.sqrt(np.mean((shape - true) ** 2))
    conforms.closed_form(error, below=allowed * np.abs(true).max())
    return error / np.sqrt(np.mean(data["standard_error"].values ** 2))


def test_bright_points_anywhere_on_a_plate(conforms, tmp_path):
    markers = Markers(PLATE.extent, scattered(40, 0.045, np.random.default_rng(2)), 0.012, None,
                      bright=True)  # fmt: skip
    rig = own.short_rig(
        PLATE, [(20, 50), (140, 50), (260, 50)], Component("bending", 2, 11.5, 0.002),
        markers=markers, distance=0.95, sensor=Sensor(white=40, dark=210, samples=3),
    )  # fmt: skip
    rig = own.replace(rig, board=Board(8, 6, 0.05, 0.05))
    manifest = own.make(tmp_path, rig, {}, corners=True, board_sensor=Sensor())
    data = measured(manifest, tmp_path / "out")
    assert data.attrs["most_similar"] == "mode (2, 1)"
    conforms.sampled(compare(conforms, data, rig, 0.01), below=3)
    assert data.sizes["marker"] == 40


def test_colour_videos_and_a_clap_in_a_room(conforms, tmp_path):
    rig = own.short_rig(BEAM, [(12, 30), (-150, 35)], Component(amplitude=0.003, frequency=6.3),
                        steady=1.7)  # fmt: skip
    excitation = {"sound": "room", "frequency_hz": None, "steady_s": (0.45, 2.0),
                  "force_per_full_scale_n": None}  # fmt: skip
    manifest = own.make(tmp_path, rig, excitation, colour=True,
                        sound=lambda rig, index: own.room(rig, index, 0.9))  # fmt: skip
    data = measured(manifest, tmp_path / "out")
    assert data.attrs["most_similar"] == "bending 1"
    compare(conforms, data, rig, 0.02)
    conforms.closed_form(float(data["frequency"]), 6.3, atol=0.02)
    assert np.isnan(data["phase"]).all()
    starts = [station.start for station in rig.stations]
    conforms.closed_form(data["delay"], np.subtract(starts, starts[0]), atol=0.1 / 60)


def test_a_vibration_too_fast_for_the_frames_is_measured_by_its_known_frequency(conforms, tmp_path):
    part = Component("bending", 2, 39.6, 0.0008)
    rig = own.short_rig(BEAM, [(12, 30), (-12, 30), (170, 30)], part, steady=0.9,
                        sensor=Sensor(exposure=1 / 500, samples=4))  # fmt: skip
    manifest = own.make(tmp_path, rig, {"undersampled": True})
    data = measured(manifest, tmp_path / "out")
    assert data.attrs["most_similar"] == "bending 2"
    conforms.closed_form(float(data["frequency"]), 39.6, atol=0.01)
    conforms.sampled(compare(conforms, data, rig, 0.02), below=3)
