"""The figures of chapters are drawn from their cubes, with the law between."""

import numpy as np
import pytest

from thesis_lib.book.pieces import illustrations
from thesis_lib.figure_sets.cube_file import cube_of
from thesis_lib.figure_sets.parametric.figure_set import camera_study
from thesis_lib.plotting.style import in_style


@pytest.mark.parametrize("of", ["distance", "aperture", "resolution", "arrays"])
def test_curves_are_the_rms_of_the_trials_and_the_law(of):
    cases = {"cases": ["4a"]} if of == "arrays" else {"cases": ["2b"]} if of == "aperture" else {}
    cube = cube_of(camera_study(f"beam-{of}", {"trials": 9, "modes": [3], **cases}))
    with in_style():
        axes = illustrations.draw_varied(of, cube).axes[0]
    part = cube.sel(mode=3).sortby("value")
    rms = ((part["mean_error"].isel(trial=slice(1, None)) ** 2).mean("trial")) ** 0.5
    dots, law = axes.lines
    assert dots.get_ydata() == pytest.approx(rms.values)
    at = np.interp(part["value"], *law.get_data())
    if of == "arrays":  # there are no cameras between
        assert law.get_linestyle() == "None"
        assert at == pytest.approx(part["predicted_error"].values)
    else:
        assert len(law.get_xdata()) >= 50
        assert at == pytest.approx(part["predicted_error"].values, rel=0.02)
