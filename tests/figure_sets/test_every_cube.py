"""The contract of all results: each variable has a unit and a long name understood alone."""

import json
import pkgutil
import re
from functools import cache
from importlib import import_module

import pytest
import xarray as xr
from scenes.ledger import own_cube
from scenes.small import OF_LEDGER, REQUESTS, small_cube

from conftest import PROJECT
from thesis_lib import figure_sets, measure
from thesis_lib.figure_sets import cube_file
from thesis_lib.figure_sets.registry import STUDIES
from thesis_lib.planning import planner as plan_cube
from thesis_lib.studies import schema, storage
from thesis_lib.studies.schema import Variable

# Words that point to another variable, which is not beside this one in a list of variables.
POINTING = re.compile(r"^that\b|\b(it|its|they|their|them|these|this|those|the same)\b", re.I)


@cache
def declared() -> dict[str, Variable]:
    """Return what figure sets and `measure` declare for their results, by module and name."""
    found = [
        one
        for package in (figure_sets, measure)
        for one in pkgutil.walk_packages(package.__path__, f"{package.__name__}.")
    ]
    tables = [
        (module.__name__, table)
        for module in (plan_cube, schema, *(import_module(one.name) for one in found))
        for table in vars(module).values()
        if isinstance(table, dict) and all(isinstance(one, Variable) for one in table.values())
    ]
    return {f"{module}.{name}": one for module, table in tables for name, one in table.items()}


def faults(variables: dict[str, dict[str, str]]) -> list[str]:
    """Return the variables that lack a unit or whose words need another variable's."""
    return [
        f"{name}: {attributes}"
        for name, attributes in variables.items()
        if not (attributes.get("units") and attributes.get("long_name"))
        or POINTING.search(attributes["long_name"])
    ]


def attributes_of(cube: xr.Dataset) -> dict[str, dict[str, str]]:
    units = {name: v.encoding.get("units", "") for name, v in cube.variables.items()}
    return {
        str(name): {"units": units[name]} | dict(variable.attrs)
        for name, variable in cube.variables.items()
    }


@pytest.mark.parametrize(
    ("attributes", "faulty"),
    [
        ({"units": "m", "long_name": "deflection of the markers"}, False),
        ({"units": "m"}, True),
        ({"long_name": "deflection of the markers"}, True),
        ({"units": "W", "long_name": "that of the true motion"}, True),
    ],
)
def test_what_a_fault_is(attributes, faulty):
    assert bool(faults({"a": attributes})) == faulty


def test_declared_variables_are_understood_alone():
    assert len(declared()) > 300
    assert faults({name: one.attributes for name, one in declared().items()}) == []


SMALL = [*REQUESTS, *OF_LEDGER, "claims-layouts"]


def small(name: str) -> xr.Dataset:
    return own_cube() if name == "claims-layouts" else small_cube(name)


@pytest.mark.parametrize("name", SMALL)
def test_small_cubes_have_units_and_long_names(name):
    assert faults(attributes_of(small(name))) == []


# Chapter 5 declares some variables by other dimensions: those of its recordings.
@pytest.mark.parametrize("name", sorted({*SMALL} - {"experiment-cameras"}))
def test_variables_are_numbers_or_words_along_the_declared_dimensions(name):
    known: dict[str, list[tuple[tuple[str, ...], str]]] = {}
    for path, one in declared().items():
        known.setdefault(path.rpartition(".")[2], []).append((tuple(one.dims), one.units))
    cube = small(name)
    for variable, values in cube.data_vars.items():
        assert values.dtype.kind in "fiuU", variable  # no complex numbers, no objects
        over = {"setting", "question"}  # a table may be of one setting, or one question
        dims, units = tuple(map(str, values.dims)), values.attrs["units"]
        told = known.get(str(variable), [(dims, units)])  # some are declared by other means
        kept = tuple(dim for dim in dims if dim not in over)
        assert any(
            kept == tuple(dim for dim in own if dim not in over) and units == unit
            for own, unit in told
        ), variable


@pytest.mark.parametrize("name", [*REQUESTS, *OF_LEDGER])
def test_file_opens_without_options_and_holds_the_cube(tmp_path, name):
    cube, path = small_cube(name), tmp_path / "new" / "cube.nc"
    storage.write_netcdf(cube, path)
    with xr.open_dataset(path) as opened:
        xr.testing.assert_identical(opened.load(), cube)
        assert opened.attrs["Conventions"] == "CF-1.11"
        assert opened.attrs["figure_set"] == name
        assert {"title", "source", "references", "parameters_hash"} <= set(opened.attrs)
    assert [one.name for one in path.parent.iterdir()] == ["cube.nc"]  # nothing temporary is left
    xr.testing.assert_identical(cube_file.read_cube(path), cube)


@pytest.mark.book
@pytest.mark.parametrize("name", STUDIES)
def test_cubes_of_the_book_have_units_and_long_names(name):
    cube = cube_file.read_built(STUDIES[name]())
    assert not isinstance(cube, str), cube
    assert faults(attributes_of(cube)) == []


def test_cubes_of_version_0_are_read_under_todays_names():
    names = json.loads((PROJECT / "data/published/renamed-variables.json").read_text("utf-8"))
    old = xr.Dataset(
        {"swing_error": ("swing", [0.5])}, {"swing": [1.0]},
        {"source": "simulation by thesis_lib 0.1.0, figure set design-law"},
    )  # fmt: skip
    new = cube_file.rename_variables(old)
    assert new["fitted_amplitude_error"].dims == ("fitted_amplitude",)
    own = old.assign_attrs(source="simulation by thesis_lib 1.0.0, figure set mine")
    assert cube_file.rename_variables(own) is own
    declared_names = {name.rpartition(".")[2] for name in declared()}
    assert set(names.values()) <= declared_names
    assert not set(names) & declared_names
