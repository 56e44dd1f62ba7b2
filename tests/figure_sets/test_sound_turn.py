"""Turned pairs in the cube of ``sound-aperture``: the law beside trials, and what can be asked."""

import numpy as np
import pytest

from thesis_lib.figure_sets.cube_file import cube_of
from thesis_lib.figure_sets.registry import validate_request

FEW = {"trials": 400, "cases": ["2d"], "elevations_deg": [40], "plane_shape": [31, 21]}


@pytest.fixture(scope="module")
def cube():
    return cube_of(validate_request("sound-aperture", FEW))


@pytest.mark.slow
def test_pairs_that_are_not_turned_are_case_2d(conforms, cube):
    own = cube["predicted_error"].transpose("setting", ...).values
    found = cube["turned_error"].values[0]
    there = np.isfinite(own)
    np.testing.assert_array_equal(there, np.isfinite(found))
    conforms.invariance(found[there], own[there], rtol=1e-9)


def test_law_of_turned_pairs_is_what_trials_show(conforms, cube):
    there = np.isfinite(cube["turned_error"].values)
    ratio = cube["turned_error"].values[there] / cube["turned_simulated"].values[there]
    conforms.sampled(ratio, 1, atol=0.13)  # 400 trials know an rms to 4 %


def test_a_few_degrees_take_what_markers_share_and_leave_the_shape(conforms, cube):
    first, turned = cube.sel(turn=0, mode=1), cube.sel(turn=2, mode=1)
    shape = turned["turned_deflection"] / first["turned_deflection"]
    conforms.sampled(shape, 1, atol=0.04)
    conforms.sampled((turned["turned_error"] / first["turned_error"]).max(), below=0.5)
    assert np.all(first["turned_coherence"] > 1.5)
    assert np.all(turned["turned_coherence"] < 1)
    assert np.all(first["turned_share"] > turned["turned_share"])


def test_law_over_turns_is_that_of_the_turned_pairs_where_both_are(conforms, cube):
    fine = cube["turned_law_error"].sel(law_turn=cube["turn"].values).values
    there = np.isfinite(cube["turned_error"].values)
    np.testing.assert_array_equal(there, np.isfinite(fine))
    conforms.independent(fine[there], cube["turned_error"].values[there], rtol=1e-9)
    assert cube.sizes["law_turn"] >= 50  # a line between fewer is not the law
