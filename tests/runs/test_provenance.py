"""Fold-outs, tables behind figures and efforts: complete, true to the cube, and only text."""

import base64
import io

import nbformat
import numpy as np
import pandas as pd
import pytest
from lxml.html import document_fromstring
from notebook_pages import add_provenance, build_figures_cell, display_figures

from thesis_lib.figure_sets import cube_file
from thesis_lib.figure_sets.registry import validate_request
from thesis_lib.plotting import selection as plotted
from thesis_lib.runs import postprocess
from thesis_lib.studies import storage


@pytest.fixture(scope="module")
def cube():
    return cube_file.cube_of(validate_request("beam-distance", {"trials": 4}))


# Tables.


def test_errors_table_has_every_setting_mode_and_error_once(cube):
    table = plotted.errors_table(cube)
    assert len(table) == cube.sizes["setting"] * cube.sizes["mode"] * 2
    assert not table.duplicated(["case", "setting", "mode", "error"]).any()
    row = table[(table["value"] == 750) & (table["mode"] == 2) & (table["error"] == "mean_error")]
    s = cube["value"].values.tolist().index(750)
    drawn = cube["mean_error"].sel(mode=2).values[s]
    assert row["trial_0"].item() == drawn[0]
    assert row["median"].item() == np.median(drawn[1:])
    assert row["high_95"].item() == np.quantile(drawn[1:], 0.95)
    assert row["predicted"].item() == cube["predicted_error"].sel(mode=2).values[s]
    table = table.set_index(["value", "mode", "error"])  # and what the thesis states
    first = table.loc[(500, 1, "mean_error")]
    assert (first["stated_low"], first["stated_high"], first["stated"]) == (10, 10, "10 %")
    bound = table.loc[(500, 1, "max_point_error")]
    assert np.isnan(bound["stated_low"])
    assert bound["stated_high"] == 30
    assert pd.isna(table.loc[(750, 1, "mean_error")]["stated"])
    assert np.isnan(table.loc[(500, 1, "max_point_error")]["predicted"])


def test_figure_table_is_what_is_drawn(cube):
    errors = plotted.errors_table(cube)
    text = plotted.as_csv(plotted.figure_table(cube, errors, "1", 3))
    table = pd.read_csv(io.StringIO(text))
    part = cube.sel(mode=3)
    bars = table[(table["quantity"] == "mean_error") & (table["statistic"] == "trial_0")]
    np.testing.assert_allclose(bars["value"], part["mean_error"].values[:, 0], rtol=1e-5)
    best = int(np.argmin(part["mean_error"].values[:, 0]))
    label = part["label"].values[best]
    shape = table[(table["quantity"] == "measured_deflection") & (table["setting"] == label)]
    np.testing.assert_allclose(
        shape["value"], part["measured_deflection"].values[best, 0], rtol=1e-5
    )
    np.testing.assert_allclose(shape["x_mm"], part["x"].values * 1000, rtol=1e-5)
    assert set(shape["unit"]) == {"m"}
    assert len(table[table["quantity"] == "reference_deflection"]) == cube.sizes["point"]


# The fold-out.


def test_downloads_of_a_page_of_its_own_are_in_it(cube, tmp_path):
    cell = build_figures_cell(display_figures(cube.sel(mode=[1, 2])))
    page = nbformat.v4.new_notebook(cells=[nbformat.v4.new_markdown_cell("# Page"), cell])
    postprocess.place_figures(page)
    request = validate_request("beam-distance", {"trials": 4})
    add_provenance(page, request, cube, tmp_path / "cube.nc")
    sources = [document_fromstring(one.source) for one in page.cells if "<a " in one.source]
    links = [link for one in sources for link in one.xpath("//a/@href")]
    inside = [link for link in links if link.startswith("data:text/csv")]
    assert len(inside) == 3
    last = base64.b64decode(inside[-1].partition("base64,")[2]).decode()
    assert last == plotted.as_csv(plotted.errors_table(cube))
    assert [link for link in links if link not in inside] == [
        "#provenance-beam-distance", "#provenance-beam-distance", "beam-distance.nc",
    ]  # fmt: skip


# Cubes and what they cost.


@pytest.mark.slow
def test_compact_cube_keeps_small_ones_exactly_and_large_ones_nearly(tmp_path, monkeypatch):
    """To thirteen bits what is drawn, others to 23; large fields to 2⁻¹² of their largest value.

    Unknown values are included.
    """
    monkeypatch.setattr(storage, "MIN_QUANTISED_BYTES", 0)
    monkeypatch.setattr(storage, "_SMALL_BYTES", 1000)
    cube = cube_file.cube_of(validate_request("beam-distance", {"trials": 100}))
    fields = cube["measured_deflection"].isel(trial=0, drop=True)
    fields[0, 0, :3] = np.nan
    cube = cube.assign(drawn=fields)
    storage.write_netcdf(cube, tmp_path / "plain.nc")
    storage.write_netcdf(cube, tmp_path / "compact.nc", compact=True)
    plain, compact = (cube_file.read_cube(tmp_path / f"{n}.nc") for n in ("plain", "compact"))
    for name, values in plain.variables.items():
        assert compact[name].dtype == values.dtype
        if values.dtype == np.float32:
            absolute = 2.0**-12 * float(abs(values).max()) if name == "drawn" else 0
            np.testing.assert_allclose(compact[name], values, rtol=2.0**-14, atol=absolute)
        elif values.dtype == np.float64 and values.nbytes > 1000:
            np.testing.assert_allclose(compact[name], values, rtol=2.0**-24)
        else:
            np.testing.assert_array_equal(compact[name], values)
    assert compact["mean_error"].nbytes > 1000
    assert not np.allclose(compact["drawn"], plain["drawn"], rtol=2.0**-14, equal_nan=True)
    assert (tmp_path / "compact.nc").stat().st_size < (tmp_path / "plain.nc").stat().st_size
    storage.write_netcdf(cube, tmp_path / "again.nc", compact=True)
    assert (tmp_path / "again.nc").read_bytes() == (tmp_path / "compact.nc").read_bytes()
    storage.write_netcdf(compact, tmp_path / "again.nc", compact=True)  # what is rounded stays
    np.testing.assert_array_equal(
        cube_file.read_cube(tmp_path / "again.nc")["drawn"], compact["drawn"]
    )
