"""Chapter 7: slopes, ends and counts by closed forms, and a page that does without some cubes."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import xarray as xr
from scenes.laboratory import replicates

from thesis_lib.book.pieces import conclusions, factors, write as pieces_write
from thesis_lib.book.pieces.factors import FACTORS
from thesis_lib.figure_sets import cube_file
from thesis_lib.figure_sets.experiment import compute as experiment
from thesis_lib.figure_sets.parametric import compute as studies
from thesis_lib.figure_sets.registry import validate_request
from thesis_lib.studies import storage
from thesis_lib.studies.schema import with_provenance


def sources_of(names):
    """The factors with those of their sources alone that are of some figure sets."""
    return {
        key: replace(one, sources=tuple(source for source in one.sources if source[1] in names))
        for key, one in FACTORS.items()
    }


def effects(name, cube, knob):
    """The effects in the cube of one figure set."""
    return factors.estimate_effects({name: cube}, sources_of([name])[knob])


def power_law(name, power):
    """A cube whose errors are exactly a power of what is varied, in every trial."""
    cube = cube_file.cube_of(validate_request(name, {"trials": 5, "modes": [1, 2]}))
    x = xr.DataArray(cube["value"].values.astype(float), dims="setting") ** power
    one = xr.ones_like(cube["mean_error"])
    return cube.assign(
        mean_error=3 * one * x, predicted_error=xr.ones_like(cube["predicted_error"]) * x
    )


@pytest.mark.parametrize(
    ("knob", "name", "power", "ratio"),
    [
        ("closer", "beam-distance", 1.0, 500 / 1500),
        ("closer", "plate-distance", 2.0, (650 / 1500) ** 2),
        ("finer", "beam-resolution", -1.0, 320 / 1920),
    ],
)
def test_exponents_and_factors_of_a_power_law(conforms, knob, name, power, ratio):
    (one,) = effects(name, power_law(name, power), knob)
    conforms.closed_form(one.exponents, power, rtol=1e-7)
    conforms.closed_form(one.predicted, power, rtol=1e-7)
    conforms.closed_form(one.ratios, ratio, rtol=1e-7)
    assert (one.confident, one.opposite, one.single) == (2, 0, 1)


@pytest.mark.parametrize(
    ("power", "counted", "told"),
    [
        (-0.5, (0, 2, 0, 0), "0 of 2 (2 opposite)"),
        (np.log(0.95) / np.log(500 / 1500), (0, 0, 2, 0), "0 of 2 (2 no material change)"),
    ],
)
def test_what_does_not_support_a_conclusion_is_seen(monkeypatch, power, counted, told):
    monkeypatch.setattr(factors, "FACTORS", sources_of(["beam-distance"]))
    cube = power_law("beam-distance", power)
    (one,) = effects("beam-distance", cube, "closer")
    assert (one.confident, one.opposite, one.unchanged, one.single) == counted
    assert told in plain(conclusions.PIECES["conclusions-closer"]({"beam-distance": cube}))


@cache
def matched():
    """Return a request for the experiment's own chain, and its cube from synthetic recordings."""
    request = validate_request("experiment-resolution", {"trials": 3, "cases": ["matched"]})
    return request, experiment.run(request, replicates(request.recordings, 4, sigma=0.02))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("errors", "held"),
    [
        ([1, 0.8, 0.5], "yes"),
        ([1, 0.98, 0.97], "no material change"),
        ([1, 1.5, 2], "the opposite"),
        ([2.80, 2.16, 2.41], "not monotonic, best at 1280×720"),
    ],
)
def test_the_experiment_confirms_what_changes_by_more_than_a_tenth(errors, held):
    request, cube = matched()
    by_width = xr.DataArray(np.array(errors, float), dims="setting")
    error = by_width * xr.ones_like(cube["mean_error"])
    cube = with_provenance(cube.assign(mean_error=error), request, 0.0)
    both = {"experiment-resolution": cube, "experiment-cameras": cube}
    text = conclusions.PIECES["conclusions-experiment"](both)
    row = next(line for line in text.splitlines() if "| matched |" in line)
    assert f"| ×{errors[-1] / errors[0]:.2f} |" in row
    assert plain(row).endswith(f"| {held} |")


def test_an_error_that_neither_surely_falls_nor_rises_is_not_told_apart():
    cube = power_law("beam-distance", 0.0)
    scatter = 1 + 0.5 * np.random.default_rng(0).standard_normal(cube["mean_error"].shape)
    cube = cube.assign(mean_error=cube["mean_error"] * scatter)
    (one,) = effects("beam-distance", cube, "closer")
    assert (one.confident, one.opposite) == (0, 0)


def plain(text):
    return text.replace("\N{NO-BREAK SPACE}", " ").replace("\N{WORD JOINER}", "")


def test_the_elevation_is_that_of_the_cameras_and_its_law_a_power_of_the_cosine(conforms):
    cube = power_law("beam-aperture", 1.0)
    elevation = np.radians(cube["camera_elevation"].isel(camera=0).values.astype(float))
    cosine = xr.DataArray(1 / np.cos(elevation), dims="setting")
    one = xr.ones_like(cube["mean_error"])
    cube = cube.assign(mean_error=one * cosine)
    (lower,) = effects("beam-aperture", cube, "lower")
    assert lower.ends == (60, 5)
    assert len(lower.ratios) == 4  # cases 2b and 2d, two modes
    conforms.closed_form(lower.exponents, -1, rtol=1e-6)
    conforms.closed_form(lower.ratios, np.cos(np.radians(60)) / np.cos(np.radians(5)), rtol=1e-6)


def test_settings_without_a_result_are_left_out():
    cube = power_law("beam-distance", 1.0)
    cube = cube.assign(mean_error=cube["mean_error"].where(cube["value"] > 600))
    (one,) = effects("beam-distance", cube, "closer")
    assert one.ends == (1500, 750)
    np.testing.assert_allclose(one.exponents, 1)


def test_a_piece_without_its_cube_names_it_and_the_others_stand(tmp_path):
    pieces_write.write_pieces([], tmp_path, ["rounding-example", "beam-model"])
    assert "did not run: `beam-distance`" in (tmp_path / "rounding-example.md").read_text()
    assert "did not run" not in (tmp_path / "beam-model.md").read_text()


@pytest.mark.slow
def test_the_figure_draws_the_rms_and_is_the_same_each_time(tmp_path, monkeypatch):
    names = ("beam-distance", "plate-distance", "beam-resolution", "beam-arrays")
    monkeypatch.setattr(factors, "FACTORS", sources_of(names))
    opened = {name: cube_file.cube_of(validate_request(name, {"trials": 4})) for name in names}
    files = [tmp_path / f"{name}.nc" for name in names]
    for file in files:
        storage.write_netcdf(opened[file.stem], file)
    lines = factors.draw_summary(opened).axes[0].lines
    beam = next(line for line in lines if line.get_linestyle() != "None")
    rms = np.sqrt((opened["beam-distance"]["mean_error"][:, :, 1:] ** 2).mean("trial"))
    np.testing.assert_allclose(beam.get_ydata(), np.exp(np.log(rms).mean("mode")), rtol=1e-6)
    written = []
    for _ in range(2):
        factors.write_summary_figure(files, tmp_path)
        written.append((tmp_path / factors.FIGURE_FILE).read_bytes())
    assert written[0] == written[1]


def test_equal_pixels_are_equal_and_the_law_is_that_of_the_study(conforms):
    found = {(one.structure, one.case): one for one in conclusions.equal_pixels().itertuples()}
    assert len(found) == 12
    for structure in ("beam", "plate"):
        cube = studies.run(validate_request(f"{structure}-arrays", {"trials": 1, "cases": ["4b"]}))
        law = np.sqrt(np.mean(cube["predicted_error"].values[-1] ** 2))
        one = found[structure, "4b"]
        conforms.independent(one.array, law, rtol=1e-3)
        # Twice as many pixels across as the first pair alone: by the law, at eight cameras.
        finer = {"trials": 1, "cases": ["4b"], "resolution_px": [640, 360]}
        pair = studies.run(validate_request(f"{structure}-arrays", finer))
        pair = pair["predicted_error"].values[0]
        assert one.n_cameras == 8
        conforms.closed_form(one.pair / np.sqrt(np.mean(pair**2)), below=1 + 1e-3)
    worse = [key for key, one in found.items() if one.ratio > 1.1]
    assert worse == [("beam", "4b")]
    text = " ".join(conclusions.tabulate_equal_pixels({}).split())
    assert "1 is worse by more than 10%, beam 4b" in text
