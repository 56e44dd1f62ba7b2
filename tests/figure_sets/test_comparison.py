"""Comparing cubes: what is compared, what is not, and what is no cube at all."""

import json

import numpy as np
import pytest
import xarray as xr

from thesis_lib.figure_sets import cube_file
from thesis_lib.figure_sets.cube_file import cube_of
from thesis_lib.figure_sets.parametric.figure_set import camera_study
from thesis_lib.files import project_root
from thesis_lib.studies import cubes
from thesis_lib.studies.cubes import CubeError


@pytest.fixture(scope="module")
def cube():
    given = {"trials": 2, "modes": [1, 2], "distances_mm": [500, 800]}
    return cube_of(camera_study("beam-distance", given))


@pytest.fixture(scope="module")
def other():
    given = {"trials": 4, "modes": [2, 3], "distances_mm": [800, 1000], "seed": 1}
    return cube_of(camera_study("beam-distance", given))


def parameters(**changed):
    def change(cube):
        values = json.loads(cube.attrs["parameters"]) | changed
        return cube.assign_attrs(parameters=json.dumps(values))

    return change


DOCTORED = {
    "modes that are none": lambda c: c.assign_coords(mode=[1.5, 2.5]),
    "a setting twice": lambda c: c.isel(setting=[0, 1, 1]),
    "a setting nobody asked for": lambda c: c.assign_coords(value=("setting", [500.0, 801.0])),
    "no mode": lambda c: c.isel(mode=[]),
    "other markers": lambda c: c.assign_coords(x=c["x"] * 2),
    "other parameters": parameters(focal_length_mm=25.0),
    "parameters that are refused": parameters(trials=-1),
    "no hash": lambda c: c.drop_attrs(deep=False).assign_attrs(
        {k: v for k, v in c.attrs.items() if k != "parameters_hash"}
    ),
    "another set": lambda c: c.assign_attrs(figure_set="plate-distance"),
    "errors that are words": lambda c: c.assign(mean_error=c["mean_error"].astype(str)),
    "errors without trials": lambda c: c.assign(mean_error=c["mean_error"].isel(trial=0)),
    "no case": lambda c: c.drop_vars("case"),
}


@pytest.mark.few(6)
@pytest.mark.parametrize("kind", DOCTORED)
def test_what_is_no_cube_of_its_set_is_refused_in_one_line(cube, tmp_path, kind):
    path = tmp_path / "doctored.nc"
    DOCTORED[kind](cube).to_netcdf(path)
    with pytest.raises(CubeError, match=r"not a cube of this project") as refused:
        cube_file.read_cube(path)
    assert str(refused.value).startswith(str(path))
    assert str(refused.value).isprintable()


def test_part_of_a_cube_is_a_cube(cube, tmp_path):
    path = tmp_path / "part.nc"
    cube.isel(setting=[1], mode=[0], trial=[0, 1]).to_netcdf(path)
    *_, last = cubes.all_difference_lines(cube_file.read_cube(path), cube, "whole")
    assert last.startswith("no difference from whole in 28")


def test_one_value_that_differs_is_told_with_its_variable(cube):
    for name in ("measured_deflection", "camera_azimuth"):
        changed = cube.copy(deep=True)
        changed[name].values.flat[-1] += 1
        lines = cubes.all_difference_lines(changed, cube, "old")
        assert sum(line.startswith(f"{name}(") and "1 of" in line for line in lines) == 1
        assert lines[-1].startswith("no difference from old in 27 variables")
    lines = cubes.all_difference_lines(cube, cube.pad(camera=(0, 1)), "wide")
    assert lines[-1].startswith("not compared, since of another shape: camera_azimuth, ")


def test_only_what_both_have_is_compared_and_the_rest_is_told(cube, other):
    here = cube.drop_vars("mac").assign(own=("setting", [1.0, 2.0]))
    lines = cubes.all_difference_lines(here, other, "other")
    text = "\n".join(lines)
    assert "not compared, since only in the first: own" in text
    assert "not compared, since only in the second: mac" in text
    assert "parameter seed: 1 → 0" in text
    assert "parameter modes: [2, 3] → [1, 2]" in text
    assert "camera_azimuth" not in text  # the same where both have settings
    assert "measured_deflection(" in text  # another seed


def test_as_much_as_machines_differ_is_no_difference(cube):
    near = cube.assign(camera_azimuth=cube["camera_azimuth"] * (1 + 1e-13))
    assert len(cubes.all_difference_lines(near, cube, "old")) == 2
    far = cube.assign(camera_azimuth=cube["camera_azimuth"] * (1 + 1e-6))
    assert len(cubes.all_difference_lines(far, cube, "old")) == 3


# The published run.

GOOD = (project_root() / "data" / "published" / "beam-distance.csv").read_text(encoding="utf-8")
LINES = GOOD.splitlines(keepends=True)
DAMAGED = {
    "empty": ("", "No columns"),
    "another header": (GOOD.replace("median", "mean", 1), "needs the columns"),
    "cut in a number": ("".join(LINES[:3]) + LINES[3][:30], "could not convert"),
    "a row twice": ("".join([*LINES[:3], LINES[1], *LINES[3:]]), "needs the columns"),
    "a quote without end": (LINES[0] + '"' + "".join(LINES[1:]), "EOF inside string"),
    "a value too many": (LINES[0] + "".join(f",{line}" for line in LINES[1:]), "needs the columns"),
    "a conflict": ("".join([*LINES[:2], "<<<<<<< HEAD\n", *LINES[2:]]), "could not convert"),
}


@pytest.mark.parametrize("kind", DAMAGED)
def test_damaged_published_file_is_named_with_its_fault(cube, tmp_path, monkeypatch, kind):
    text, fault = DAMAGED[kind]
    path = tmp_path / "beam-distance.csv"
    path.write_text(text, encoding="utf-8")
    monkeypatch.setattr(cubes, "summary_path", lambda _: path)
    with pytest.raises(CubeError, match=rf"damaged \(.*{fault}") as refused:
        cubes.difference_lines(cube)
    assert str(refused.value).startswith(str(path))
    assert "git checkout" in str(refused.value)
    assert str(refused.value).isprintable()


def test_all_published_files_are_whole():
    for path in (project_root() / "data" / "published").glob("*.csv"):
        if path.stem != "effort":
            assert len(cubes.read_published(path.stem)) > 0


def test_errors_of_a_run_stand_next_to_the_published_ones(cube):
    lines = cubes.error_lines(cube)
    rows = [line.split("|") for line in lines if "mean |" in line]
    assert [(*row[0].split(), row[3].strip() == "—") for row in rows] == [
        ("1", value, "mm", str(mode), "mean", value == "800")
        for value in ("500", "800")
        for mode in (1, 2)
    ]
    nominal = cube["mean_error"].isel(trial=0).values.ravel()
    np.testing.assert_allclose([float(row[1]) for row in rows], nominal, rtol=0.02)
    assert cubes.error_lines(xr.Dataset({"share": ((), 1.0)}, attrs=cube.attrs)) == []
