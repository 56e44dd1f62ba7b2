"""What a figure shows of many trials: best and worst by their median, and far errors in decades."""

import numpy as np
import xarray as xr

from thesis_lib.plotting.selection import best_and_worst
from thesis_lib.studies import cubes
from thesis_lib.studies.schema import extreme_settings

LITERAL = [9.0, 1.0, 5.0]  # which would have the second setting best and the first worst
DRAWN = [[2.0, 3.0, 4.0], [7.0, 8.0, 90.0], [1.0, 5.0, 6.0]]  # the first is best, the second worst


def errors(trials=3):
    values = np.array([[one, *drawn[:trials]] for one, drawn in zip(LITERAL, DRAWN, strict=True)])
    return xr.DataArray(values, dims=("setting", "trial"))


def test_settings_are_ranked_by_the_median_over_the_trials_if_there_are_any():
    part = xr.Dataset({"mean_error": errors()})
    np.testing.assert_array_equal(cubes.typical_error(part["mean_error"]), [3.0, 8.0, 5.0])
    assert best_and_worst(part) == [0, 1]
    alone = xr.Dataset({"mean_error": errors(0)})
    np.testing.assert_array_equal(cubes.typical_error(alone["mean_error"]), LITERAL)
    assert best_and_worst(alone) == [1, 0]


def test_the_sound_is_of_the_same_settings():
    cube = xr.Dataset({"mean_error": errors().expand_dims("mode", axis=1)})
    assert extreme_settings(cube.assign_coords(case=("setting", ["a", "a", "b"]))) == {
        "a": [(0, 1)],
        "b": [(2, 2)],
    }
