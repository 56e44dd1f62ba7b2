"""What a figure shows of many trials: best and worst by their median, and far errors in decades."""

import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure

from thesis_lib.plotting.panels import bar_panel
from thesis_lib.plotting.selection import Bars, best_and_worst, rank_settings
from thesis_lib.studies import cubes
from thesis_lib.studies.schema import extreme_settings

LITERAL = [9.0, 1.0, 5.0]  # which would have the second setting best and the first worst
DRAWN = [[2.0, 3.0, 4.0], [7.0, 8.0, 90.0], [1.0, 5.0, 6.0]]  # the first is best, the second worst


def errors(trials: int = 3) -> xr.DataArray:
    values = np.array([[one, *drawn[:trials]] for one, drawn in zip(LITERAL, DRAWN, strict=True)])
    return xr.DataArray(values, dims=("setting", "trial"))


def test_settings_are_ranked_by_the_median_over_the_trials() -> None:
    part = xr.Dataset({"mean_error": errors()})
    np.testing.assert_array_equal(cubes.typical_error(part["mean_error"]), [3.0, 8.0, 5.0])
    assert best_and_worst(part) == [0, 1]
    assert rank_settings(part) == ("best by median", "worst by median")


def test_without_trials_the_one_run_ranks_them_and_no_median_is_named() -> None:
    part = xr.Dataset({"mean_error": errors(0)})
    np.testing.assert_array_equal(cubes.typical_error(part["mean_error"]), LITERAL)
    assert best_and_worst(part) == [1, 0]
    assert rank_settings(part) == ("best", "worst")


def test_the_sound_is_of_the_same_settings() -> None:
    cube = xr.Dataset({"mean_error": errors().expand_dims("mode", axis=1)})
    assert extreme_settings(cube.assign_coords(case=("setting", ["a", "a", "b"]))) == {
        "a": [(0, 1)],
        "b": [(2, 2)],
    }


@pytest.mark.parametrize(
    ("far", "scale"), [(19.0, "linear"), (21.0, "log"), (0.0, "linear"), (np.nan, "linear")]
)
def test_an_axis_is_logarithmic_where_errors_are_far_apart(far: float, scale: str) -> None:
    part = xr.Dataset(
        {"label": ("setting", ["p", "q"]), "in_view": ("setting", [1.0, 1.0])},
        attrs={"trial_0": "nominal run", "predicts": "law"},
    )
    low = np.array([1.0, far])
    axes = Figure().subplots()
    bar_panel(axes, part, [Bars(low, low, np.array([low, low, low]), [None, None])])
    assert axes.get_yscale() == scale
    assert bool(axes.patches) == (scale == "linear")  # a bar's length means nothing on a log axis
    bottom, top = axes.get_ylim()
    assert bottom <= min(1.0, np.nan_to_num(far)) or bottom == 0
    assert top > np.nanmax(low)
