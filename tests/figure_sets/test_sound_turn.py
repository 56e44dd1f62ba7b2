"""Turned pairs in the cube of ``sound-aperture``: the law beside trials, and what can be asked."""

import numpy as np
import pytest

from thesis_lib.figure_sets.parametric import figures, sound_turn
from thesis_lib.figure_sets.registry import validate
from thesis_lib.figure_sets.run import cube_of

FEW = {"trials": 400, "cases": ["2d"], "elevations_deg": [20, 40], "plane_shape": [31, 21]}


@pytest.fixture(scope="module")
def cube():
    return cube_of(validate("sound-aperture", FEW))


def test_pairs_that_are_not_turned_are_case_2d(conforms, cube):
    own = cube["predicted_error"].transpose("setting", ...).values
    found = cube["turned_error"].values[0]
    there = np.isfinite(own)
    np.testing.assert_array_equal(there, np.isfinite(found))
    conforms.invariance(found[there], own[there], rtol=1e-9)
    assert cube["turn"].values.tolist() == [0, 0.5, 1, 2, 5]
    assert cube["elevation"].values.tolist() == [20, 40]


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


def test_table_and_figure_show_the_planes_with_a_reference(cube):
    rows = sound_turn.turn_table(cube).split("\n\n")[0].splitlines()[2:]
    heard = ["1, XZ", "1, YZ", "2, XZ", "3, YZ"]
    assert [row.split("|")[1].strip() for row in rows] == [one for one in heard for _ in range(2)]
    titles = [axes.get_title() for axes in figures.turn(cube).axes]
    assert titles == [f"mode {one}" for one in heard]


def test_turned_pairs_take_no_more_trials_than_an_rms_needs():
    for trials, taken in ((12, 12), (10**6, sound_turn.ENOUGH)):
        asked = validate("sound-aperture", FEW | {"trials": trials, "azimuth_zero": "X"})
        turned = sound_turn.turned(asked)
        assert turned.trials == taken
        same = ("azimuth_zero", "distance_mm", "plane_shape", "seed", "resolution_px")
        assert all(getattr(turned, name) == getattr(asked, name) for name in same)


def test_without_trials_there_is_the_law_alone():
    cube = cube_of(validate("sound-aperture", FEW | {"trials": 0, "cases": ["2a"], "modes": [1]}))
    assert np.all(np.isfinite(cube["turned_error"]))
    assert np.all(np.isnan(cube["turned_simulated"]))
