"""The book's own recordings of chapter 5, which are data: held to their bounds."""

import re

import numpy as np
import pytest

from thesis_lib.figure_sets.experiment import compute as study, walk
from thesis_lib.figure_sets.registry import validate_request


@pytest.fixture(scope="module")
def data():
    return study.EXPERIMENT.load(validate_request("experiment-resolution", {}).recordings)


@pytest.fixture(scope="module")
def results(data):
    names = ("experiment-resolution", "experiment-cameras")
    return {name: study.run(validate_request(name, {}), data) for name in names}


# The chain, step by step, against the truth.


def test_cameras_are_where_they_are(data):
    assert np.abs(data["focal_error_single"]).max() < 0.2
    assert np.abs(data["focal_error_full"]).max() < 0.03
    assert data["centre_error_full"].max() < 0.2e-3
    assert data["centre_error_literal"].max() < 0.2e-3
    # Of the size that the adjustment predicts from its residuals alone.
    ratio = np.sqrt(np.mean(data["centre_error_full"] ** 2 / data["centre_deviation"] ** 2))
    assert 0.5 < ratio < 2


def test_clocks_are_aligned(data):
    frames = (data["delay"] - data["true_delay"]).values * data["frame_rate"].values
    assert np.abs(frames).max() < 0.02
    whole = data["delay_frames"] - data["true_delay"].values * data["frame_rate"].values
    assert np.abs(whole).max() <= 0.5 + np.abs(frames).max()


def test_markers_are_found_but_at_320_pixels(data):
    by_width = {int(width): data.sel(width=width) for width in data["width"].values}
    for width in (640, 1280, 1920):
        assert by_width[width]["missing_share"] == 0
        assert by_width[width]["wrong_share"] == 0
        assert by_width[width]["centre_error"] < 0.03
    assert by_width[320]["missing_share"] > 0.4
    assert "320 px" in data.attrs["notes"]


# What comes out.


def test_the_thesis_to_the_letter_has_errors_of_its_size(results):
    cube = results["experiment-cameras"]
    part = cube.isel(setting=np.flatnonzero(cube["case"].values == "matched"), mode=0)
    medians = part["mean_error"][:, 1:].median("trial").values
    assert (np.diff(medians) < 0).all()
    assert 1 < medians[-1] < 4
    # The chain's own result is one of what the trials draw.
    low, high = part["mean_error"][:, 1:].quantile([0.001, 0.999], dim="trial").values
    assert (part["mean_error"][:, 0] > 0.8 * low).all()
    assert (part["mean_error"][:, 0] < 1.2 * high).all()


@pytest.mark.parametrize("case", ["aligned", "harmonic"])
def test_with_aligned_clocks_more_pixels_and_more_cameras_help(results, case):
    for name, labels in (
        ("experiment-resolution", ["640×360", "1280×720", "1920×1080"]),
        ("experiment-cameras", ["A–B", "A–B–C", "A–B–C–D"]),
    ):
        cube = results[name].isel(mode=0, trial=slice(1, None))
        of_case = cube.isel(setting=cube["case"].values == case).set_xindex("label")
        medians = of_case["mean_error"].sel(label=labels).median("trial")
        assert (medians.diff("setting") < 0).all()


# What is shown of it.


def test_numbers_of_the_walk_through_are_numbers(data):
    for name in walk.TEXT_VALUES:
        text = walk.fill_text(data, name)
        assert re.search(r"\d", text), name
        assert "nan" not in text, name
