"""Other readings of what the thesis leaves open: what each changes, and what it must not."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

from thesis_lib.facts import claims
from thesis_lib.facts.setups import ADOPTED_READING, READINGS
from thesis_lib.figure_sets.claims import compute
from thesis_lib.figure_sets.claims.figure_set import Claims
from thesis_lib.figure_sets.parametric import compute as studies
from thesis_lib.figure_sets.parametric.figure_set import CAMERA_STUDIES
from thesis_lib.figure_sets.registry import STUDIES, validate_request
from thesis_lib.ledger.verdicts import VERDICTS, Check
from thesis_lib.vibration.structure import deflection_shape, world_points
from thesis_lib.vision.pinhole import intrinsics
from thesis_lib.vision.simulation import measure_deflections

TRIALS = 12
FEW = ("beam-distance", "plate-distance", "sound-distance")


@pytest.fixture
def few(monkeypatch):
    """Only some of the figure sets, one of each chapter."""
    monkeypatch.setattr(compute, "CAMERA_STUDIES", {name: STUDIES[name] for name in FEW})


def cube_of(name, **values):
    return studies.run(validate_request(name, {"trials": TRIALS, **values}))


def run(*names, **draws):
    return compute.run_readings(Claims(**{"trials": TRIALS, "readings": list(names), **draws}))


# -- How readings are compared --


def test_counts_are_those_of_the_checks(few):
    made = run("rest known")
    adopted = compute.judge_interpretation(READINGS[ADOPTED_READING], 0, TRIALS, {})
    met = {check.claim.id for check in adopted if check.inside}
    for name in made["reading"].values:
        found = compute.judge_interpretation(READINGS[str(name)], 0, TRIALS, {})
        now = {check.claim.id for check in found if check.inside}
        row = made.sel(reading=name)
        assert (row["gained"], row["lost"]) == (len(now - met), len(met - now))
        for chapter in (3, 4, 6):
            part = [check for check in found if check.claim.chapter == chapter]
            here = row.sel(chapter=chapter)
            assert here["reading_inside"] == sum(check.inside for check in part)
            for verdict in VERDICTS[:3]:
                count = sum(check.verdict == verdict for check in part)
                assert here["reading_claims"].sel(outcome=verdict) == count
            stated = [claim for claim in claims.read_claims() if claim.chapter == chapter]
            assert here["reading_claims"].sum() == len(stated)  # the others are undefined
    assert made["gained"].sum() + made["lost"].sum() > 0


def test_readings_do_not_depend_on_each_other(monkeypatch):
    monkeypatch.setattr(compute, "CAMERA_STUDIES", {name: STUDIES[name] for name in FEW[:2]})
    several = run("rest known", "20 mm lens", "1 N")
    for name in ("1 N", "rest known"):
        alone = run(name)
        xr.testing.assert_identical(alone, several.sel(reading=[ADOPTED_READING, name]))


def test_every_reading_has_a_place_in_at_least_one_set_and_no_unknown_parameter():
    for reading_name, reading in READINGS.items():
        taken = [compute.reading_parameters(reading, one) for one in CAMERA_STUDIES]
        assert {key for values in taken for key in values} == set(reading)
        for one, values in zip(CAMERA_STUDIES, taken, strict=True):
            request = validate_request(one, values)
            assert (request.digest == STUDIES[one]().digest) == (not values)
        assert bool(reading) == (reading_name != ADOPTED_READING)


def test_log_residual_counts_what_is_stated_as_a_value_or_an_interval():
    """Rms logarithm: of ratios e and 1/e it is 1; bounds do not count."""
    claim = claims.read_claims()[0]

    def check(median, relation="about"):
        one = replace(claim, relation=relation, low=10.0, high=10.0)
        return Check(one, median, median, median, median, False, False)

    assert compute.log_residual([check(10 * np.e), check(10 / np.e)]) == pytest.approx(1)
    assert compute.log_residual([check(99, "max"), check(30, "range")]) == pytest.approx(np.log(3))
    assert np.isnan(compute.log_residual([check(99, "max")]))


# -- Focal length and amplitude --


def test_with_a_known_rest_errors_go_as_one_over_the_focal_length(conforms):
    """Exactly, by the law: each coordinate has a variance of 1/12 px², a pixel is 1/f wide."""
    one, other = (
        cube_of("beam-aperture", rest="known", focal_length_mm=f)["predicted_error"]
        for f in (24, 36)
    )
    conforms.closed_form(other, one * 24 / 36, rtol=1e-9)


def test_a_longer_lens_before_fewer_pixels_measures_the_same(conforms):
    """Focal length in px is the same, and the picture's middle is still a whole pixel."""
    values = {"distance_mm": 500, "cases": ["2a", "2b"]}
    one = cube_of("beam-aperture", **values)
    other = cube_of("beam-aperture", **values, focal_length_mm=48, resolution_px=[160, 90])
    for name in ("measured_deflection", "mean_error", "max_point_error", "predicted_error"):
        conforms.invariance(other[name], one[name], rtol=1e-5, atol=1e-10)


# -- Markers --


def test_the_first_marker_moves_the_row_from_the_clamp_to_the_tip(conforms):
    for first in (0.0, 23.0):
        cube = cube_of("beam-distance", first_marker_mm=first)
        conforms.closed_form(1000 * cube["x"], first + 25 * np.arange(25), rtol=1e-7)
        deflection = cube["reference_deflection"].sel(mode=1).values
        if first == 0:
            conforms.closed_form(deflection[0], 0, atol=1e-12)
            assert not cube["measured_deflection"][:, :, :, 0].values.any()
        else:
            conforms.closed_form(abs(deflection[-1]), 5.5e-3, rtol=1e-7)


# -- Azimuth --


def test_azimuths_from_x_are_layouts_with_90_degrees_less_them():
    name, cases = "plate-arrays", ["4a", "4b", "4d"]
    turned = cube_of(name, cases=cases, azimuth_zero="X")
    plain = validate_request(name, {"cases": cases}).settings()
    layouts = {}
    for setting in plain:
        cameras = [[90 - azimuth, elevation] for azimuth, elevation in setting.directions_deg]
        layouts.setdefault(f"by hand {setting.case}", []).append(cameras)
    by_hand = cube_of(name, cases=[], layouts=layouts)
    for variable in ("measured_deflection", "mean_error", "max_point_error", "predicted_error",
                     "camera_azimuth", "in_view"):  # fmt: skip
        np.testing.assert_array_equal(turned[variable], by_hand[variable])


# -- Principal point --


def test_nominal_run_is_that_of_cameras_with_the_principal_point_moved(conforms):
    offset = -0.3
    study = validate_request("beam-aperture", {"trials": 0, "principal_offset_px": offset})
    structure, cube = study.structure, studies.run(study)
    shapes = [deflection_shape(structure, mode, structure.markers, 5.5e-3)
              for mode in study.modes]  # fmt: skip
    points = world_points(structure, np.array([np.zeros(25), *shapes]))
    for number, setting in enumerate(study.settings()):
        cameras = setting.cameras(study.focal_length_mm, study.sensor_width_mm)
        K = np.stack([intrinsics(K[0, 0], cameras.size) for K in cameras.K])
        K[:, :2, 2] += offset
        moved = replace(cameras, K=K)
        shifts = np.zeros((1, len(cameras), 2))
        alone = measure_deflections(moved, points, shifts)
        shifted = measure_deflections(cameras, points, shifts + offset)
        conforms.independent(shifted, alone, atol=1e-12)
        conforms.independent(
            cube["measured_deflection"][number, :, 0], alone[:, 0], rtol=1e-7, atol=1e-12
        )  # the cube has single precision
