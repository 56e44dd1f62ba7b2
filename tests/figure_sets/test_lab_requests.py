"""Requests: what says nothing is refused by each figure set, and what is rendered again."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from refused import refusal
from scenes.changes import PAIR

from thesis_lib.facts import setups
from thesis_lib.figure_sets.experiment.figure_set import ExperimentCameras, ExperimentResolution
from thesis_lib.figure_sets.lab_layout.figure_set import LabLayout
from thesis_lib.figure_sets.registry import validate_request
from thesis_lib.studies.request import ParameterError
from thesis_lib.vibration.structure import resonance_frequency

RESOLUTION, CAMERAS = "experiment-resolution", "experiment-cameras"
ELEVATION, LAYOUT = "lab-elevation", "lab-layout"
DISTANCE, ARRAYS, LAW = "beam-distance", "beam-arrays", "design-law"
REFUSED = [  # a row of each kind
    (RESOLUTION, {"frequency_hz": 24.1}, ["frequency_hz: given 24.1", "0.4 of the frame rate"]),
    (RESOLUTION, {"exposure_ms": 17}, ["exposure_ms: given 17", "time between frames", "ms"]),
    (CAMERAS, {"distance_mm": 312}, ["distance_mm: given 312", "see the whole structure"]),
    (CAMERAS, {"distance_mm": 212, "focal_length_mm": 5.72}, ["distance_mm", "structure's reach"]),
    (ELEVATION, {"frequency_hz": 8}, ["frequency_hz: given 8", "0.125 of the frame rate"]),
    (LAYOUT, {"directions_deg": [[10, 20], [350, 20], [-10, 20]]}, ["given [[350", "different"]),
    (LAYOUT, {"elevation_deg": 60}, ["see the whole structure", "azimuth"]),
    ("lab-modes", {"frame_rates_hz": [79.1]}, ["frame_rates_hz: given 79.1", "mode 2", "Hz"]),
    ("lab-modes", {"exposure_ms": 8, "frame_rates_hz": [60]}, ["exposure_ms", "7.225 ms"]),
    ("lab-modes", {"amplitude_mm": 2}, ["amplitude_mm: given 2", "change places"]),
    ("lab-modes", {"amplitude_mm": [1]}, ["amplitude_mm: given [1.0]", "one for each mode"]),
    ("lab-modes", {"width_px": 320}, ["width_px: given 320", "1 px high"]),
    ("lab-modes", {"highest_hz": 100}, ["highest_hz: given 100", "above the highest mode"]),
    ("lab-plate", {"elevations_deg": [60], "distance_mm": 850}, ["elevations_deg: given 60"]),
    ("lab-plate", {"frame_rate_hz": 101.8}, ["frame_rate_hz: given 101.8", "mode 1"]),
    ("lab-plate", {"exposure_ms": 2}, ["exposure_ms: given 2", "0.8 of the shortest period"]),
    ("lab-plate", {"plane_top_mm": 40}, ["plane_top_mm: given 40", "above plane_bottom_mm"]),
    ("lab-plate", {"speed_of_sound_m_s": 30}, ["modes: given 3", "size of a piston"]),
    ("lab-equal-pixels", {"exposure_ms": 30.0}, ["at most 2.083 ms"]),
    ("lab-equal-pixels", {"duration_s": 0.1, "frequency_hz": 12.0}, ["8 frames"]),
    ("lab-equal-pixels", {"diameters_mm": [60]}, ["diameters_mm"]),
    ("lab-radiation", {"frame_rate_hz": 46.3}, ["frame_rate_hz", "show the tone"]),
    ("lab-radiation", {"azimuths_deg": [-180, 180, 0]}, ["azimuths_deg", "[180.0", "same place"]),
    (CAMERAS, {"azimuth_deg": 1e-9}, ["azimuth_deg: given [[1e-09, 22.0], ", "same place"]),
    ("shape-l", {"outline_mm": [[0, 0], [9, 4], [9, 0], [0, 4]]}, ["outline_mm", "common corners"]),
    ("shape-l", {"outline_mm": [[9, 0], [600, 0], [600, 400]]}, ["outline_mm", "(0, 0)"]),
    ("shape-l", {"circles_mm": [[600, 400, 20]]}, ["circles_mm: given [[600.0", "inside"]),
    ("shape-l", {"circles_mm": [[100, 100, 30], [140, 100, 30]]}, ["circles_mm", "not touch"]),
    ("shape-l", {"support": "free"}, ["edge_supports", "clamped"]),
    ("shape-l", {"edge_supports": {"7": "free"}}, ["edge_supports", "1 to 6"]),
    ("shape-l", {"force_mm": [600, 400]}, ["force_mm: given [600.0, 400.0]", "on the panel"]),
    ("shape-l", {"element_mm": 200}, ["element_mm: given 200", "200 to 60000"]),
    ("cameras", {"focal_length_mm": 500},
     ["cameras: focal_length_mm: given 500.0, allowed: less than the nearest "]),
    # Values that do not go with others.
    (DISTANCE, {"amplitude_mm": [5.5, 5.5]},
     ["amplitude_mm: given ", "a list with one for each mode"]),
    (ARRAYS, {"cases": []}, ["cases: given ", "at least one, or layouts"]),
    (ARRAYS, {"layouts": {"4a": [PAIR]}},
     ["layouts: given ", "new names, each with sets that grow"]),
    ("sound-aperture", {"plane_top_mm": 44.5},
     ["plane_top_mm: given ", "a number above plane_bottom_mm, in mm"]),
    (LAW, {"frame_rates_hz": [60, 50_000]},
     ["frame_rates_hz: given ", "a sensor 16 to 20000 px wide"]),
    (LAW, {"frequency_hz": 24.1},
     ["frequency_hz: given ", "1 to 24 Hz, from one over the duration"]),
]  # fmt: skip


@pytest.mark.parametrize(("name", "values", "words"), REFUSED)
def test_what_says_nothing_is_refused_in_one_line(name, values, words):
    message = refusal(name, **values)
    assert [word for word in words if word not in message] == [], message


def test_bounds_and_cases_that_are_not_run_refuse_nothing():
    at_bounds = {"frequency_hz": 24.0, "exposure_ms": 1000 / 60, "distance_mm": 480}
    validate_request(RESOLUTION, at_bounds)
    validate_request(CAMERAS, {"width_px": 160, "amplitude_mm": 6})
    validate_request(LAYOUT, {"cases": ["subsets"], "distances_mm": [420]})
    validate_request(LAYOUT, {"cases": ["distance"], "distance_mm": 330, "elevation_deg": 30})


@pytest.mark.parametrize(
    ("name", "same", "others"),
    [
        (CAMERAS, {"trials": 7, "cases": ["literal"]},
         [{"seed": 1}, {"frequency_hz": 5.0}, {"codec": "h264"}, {"lens_k1": 0.0}]),
        (ELEVATION, {"trials": 99, "cube": "a.nc"}, [{"seed": 1}]),
        ("lab-modes", {"trials": 3, "cases": ["read"], "highest_hz": 200.0},
         [{"seed": 1}, {"frames": 30}, {"starts": "together"}, {"torsion_mm": 0.0}]),
        ("lab-plate", {"trials": 3, "plane_top_mm": 400.0, "air_density_kg_m3": 1.0},
         [{"amplitude_mm": 2.0}]),
    ],
)  # fmt: skip
def test_what_is_rendered_does_not_depend_on_what_is_made_of_it(name, same, others):
    rendering = validate_request(name, {}).recordings.rendering
    for field, value in same.items():
        assert validate_request(name, {field: value}).recordings.rendering == rendering
    for values in others:
        assert validate_request(name, values).recordings.rendering != rendering


def test_studies_and_settings_share_recordings():
    one, other = ExperimentResolution(), ExperimentCameras()
    assert one.recordings.rendering == other.recordings.rendering
    assert ExperimentCameras(width_px=800).recordings.widths_px == [320, 640, 800, 1280, 1920]
    assert len(LabLayout().rendered_settings()) == 9
    assert len(LabLayout().settings()) == 255


@settings(max_examples=40)
@given(st.floats(10, 600), st.integers(8, 60))
def test_a_rate_that_is_allowed_has_a_fit_that_knows_its_parts(rate, frames):
    values = {"frame_rates_hz": [rate], "frames": frames, "exposure_ms": 0.1}
    try:
        validate_request("lab-modes", values)
    except ParameterError:
        return
    for mode in (2, 3):
        turns = resonance_frequency(setups.thesis_beam(), mode) * np.arange(frames) / rate
        A = np.stack([np.ones(frames), np.cos(turns), np.sin(turns)], 1)
        inverse = np.linalg.inv(A.T @ A)
        assert frames / 4 * (inverse[1, 1] + inverse[2, 2]) < 8  # 1 where nothing interferes
