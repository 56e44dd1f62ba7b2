"""What all figure sets keep: figures from their cubes alone, and texts with the cubes' numbers.

And what all results keep: each variable has a unit and a long name.
"""

import json
import pkgutil
from collections import defaultdict
from dataclasses import fields
from functools import cache
from importlib import import_module
from itertools import combinations

import numpy as np
import pytest
import xarray as xr
from matplotlib.container import BarContainer
from scenes.ledger import own_cube
from scenes.small import OF_LEDGER, REQUESTS, small_cube

from conftest import PROJECT
from thesis_lib import figure_sets, measure
from thesis_lib.figure_sets import cube_file, display
from thesis_lib.figure_sets.registry import FIGURE_SETS, STUDIES
from thesis_lib.ledger.entries import LEDGER_COLUMNS, Entry
from thesis_lib.planning import planner as plan_cube
from thesis_lib.plotting.panels import case_captions
from thesis_lib.plotting.style import figure_svg, find_panels
from thesis_lib.studies import cubes, schema, storage
from thesis_lib.studies.schema import Variable

LARGE = ("design-law", "planner")  # whose small cubes take half a minute, too


def each(cases):
    """Mark the cases of large cubes as slow; a case is a name, or begins with one."""
    tuples = [(case,) if isinstance(case, str) else case for case in cases]
    slow = [pytest.mark.slow]
    return [pytest.param(*one, marks=slow if one[0] in LARGE else []) for one in tuples]


WHICH = {("claims", "chapter"): [(n,) for n in (3, 4, 5, 6)], ("lab-modes", "aliases"): [(2,)]}


def drawings(cube):
    """Return the figures of a cube: those shown by name, and the first and last of its cases."""
    name = cube.attrs["figure_set"]
    found = {
        f"{one} {which}": display.draw_named_figure(cube, one, *which)
        for one in display.read_captions(name)
        for which in WHICH.get((name, one), [()])
    }
    if FIGURE_SETS[name].figure:
        cases = list(case_captions(cube))
        found |= {str(one): display.draw_figure(cube, *one) for one in (cases[0], cases[-1])}
    return {one: drawing for one, drawing in found.items() if drawing is not None}


# No bar where its length means nothing, no two names that look alike, and no panel over another.


def misleading(drawing):
    """Return what a reader of a figure would read wrongly."""
    faults = []
    for axes in drawing.axes:
        for bars in (one for one in axes.containers if isinstance(one, BarContainer)):
            scale = axes.get_yscale() if bars.orientation == "vertical" else axes.get_xscale()
            if scale == "log":
                faults.append("bars on a logarithmic axis")
            inks = {patch.get_facecolor() for patch in bars}
            if len(inks) not in (1, len(bars)):
                faults.append("bars of one colour that are not one setting")
        looks = defaultdict(set)
        for line in axes.get_lines():
            if not (label := str(line.get_label())).startswith("_"):
                style = line.get_linestyle(), line.get_marker(), line.get_linewidth()
                sizes = line.get_markersize(), str(line.get_markerfacecolor()), line.get_alpha()
                looks[(str(line.get_color()), *style, *sizes)].add(label)
        faults += [f"alike: {sorted(names)}" for names in looks.values() if len(names) > 1]
    if drawing.get_layout_engine():
        return faults
    for axes in drawing.axes:  # panels stand where they were put, and a phone cuts them apart
        legend = axes.get_legend()
        if legend and legend.get_window_extent().width > axes.get_window_extent().width:
            faults.append("a legend wider than its panel")
    boxes = [
        [float(side) for side in box.split()] for box in find_panels(drawing).split(";") if box
    ]
    for (x, y, w, h), (u, v, p, q) in combinations(boxes, 2):
        if min(x + w, u + p) - max(x, u) > 0.3 and min(y + h, v + q) - max(y, v) > 0.3:
            faults.append("panels that overlap")
    return faults


# Figures and texts are made from the cube alone, and hold its numbers.


@pytest.mark.slow
@pytest.mark.few(1)
@pytest.mark.parametrize("name", REQUESTS)
def test_figures_are_drawn_from_the_cube_alone(name):
    cube = small_cube(name)
    bare = cube.drop_attrs().assign_attrs(
        figure_set=name, parameters=cube.attrs["parameters"], cost_is="pixels per second"
    )
    for one in display.read_captions(name):
        texts = {figure_svg(display.draw_named_figure(part, one)) for part in (cube, cube, bare)}
        assert len(texts) == 1, one


FROM = {
    "cameras": {
        "angles": "angle_of_view", "sensors": "crop_factor", "lens": "angle_of_view",
        "formats": "format_height", "projections": "projection_error", "pixels": "marker_contrast",
        "colours": "centre_shift", "focus": "far_limit", "stereo": "rounded_depth_error",
        "horizons": "vanishing_point",
    },
    "design-law": {
        "motion": "motion_error", "settings": "law_error", "cone": "cone_error",
        "exponents": "small_exponent", "findings": "best_aperture", "pairs": "pair_error",
        "shares": "frame_error", "few-shares": "frame_error", "noisy": "noisy_share_error",
        "few-noisy": "noisy_share_error", "estimators": "equidistant_rig_error",
        "mistakes": "mistaken_error", "refined": "unequal_distance_error",
        "dither": "fitted_amplitude_error",
    },
    "planner": {
        "thesis": "bound", "limits": "expected_error", "front": "predicted_error",
        "targets": "cost", "verification": "simulated_error", "sound": "sound_error",
    },
}  # fmt: skip


@pytest.mark.parametrize(
    ("name", "text", "variable"),
    each((name, *one) for name, texts in FROM.items() for one in texts.items()),
)
def test_texts_have_the_numbers_of_the_cube(name, text, variable):
    cube = small_cube(name)
    told = display.fill_text(cube, text)
    assert "nan" not in told
    factor = xr.DataArray(1.5 + 0.1 * np.arange(cube.sizes.get("question", 1)), dims="question")
    changed = cube[variable] * (factor if "question" in cube[variable].dims else 1.5)
    assert display.fill_text(cube.assign({variable: changed}), text) != told


@pytest.mark.slow
@pytest.mark.parametrize("text", FROM["planner"])
def test_texts_of_plans_do_not_hang_on_last_digits(text):
    cube, rng = small_cube("planner"), np.random.default_rng(0)
    expected = display.fill_text(cube, text)
    for _ in range(5):
        other = cube.copy()
        for name in ("expected_error", "predicted_error", "simulated_error", "bound"):
            noise = 1 + 1e-13 * rng.uniform(-1, 1, cube[name].shape)
            other[name] = cube[name] * xr.DataArray(noise, dims=cube[name].dims)
        assert display.fill_text(other, text) == expected


# Cubes of single quantities are compared by them.


@pytest.mark.slow
@pytest.mark.parametrize("name", REQUESTS)
def test_cube_reads_back_and_is_compared_by_its_quantities(name, tmp_path, monkeypatch):
    cube, path = small_cube(name), tmp_path / "cube.nc"
    storage.write_netcdf(cube, path, compact=True)
    table = cubes.summarise_errors(cube_file.read_cube(path))
    assert list(table) == ["quantity", "value", "unit"]
    assert table["quantity"].is_unique
    monkeypatch.setattr(cubes, "summary_path", lambda name: tmp_path / f"{name}.csv")
    assert cubes.difference_lines(cube) == ["nothing is published yet to compare with"]
    cubes.publish_errors(cube)
    number = cube.sizes["quantity"]
    same = [f"no difference from published ({number} quantities compared)"]
    assert cubes.difference_lines(cube) == same
    first = cube["quantity"].values[0]
    changed = cube.assign(value=cube["value"].where(cube["quantity"] != first, 1e9))
    (line,) = cubes.difference_lines(changed)
    assert line.startswith(f"{first}: ")
    storage.write_netcdf(cube.drop_vars("quantity"), path)
    with pytest.raises(cubes.CubeError, match="it lacks quantity"):
        cube_file.read_cube(path)


# Each variable of a result has a unit and a long name that is understood alone.


@cache
def declared():
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


def faults(variables):
    """Return the variables that lack a unit or a long name."""
    wanted = "units", "long_name"
    return [name for name, has in variables.items() if not all(has.get(key) for key in wanted)]


def attributes_of(cube):
    return {
        name: {"units": v.encoding.get("units", "")} | v.attrs for name, v in cube.variables.items()
    }


def test_declared_variables_have_units_and_long_names():
    assert len(declared()) > 300
    said = {n: {"units": v.units, "long_name": v.long_name} for n, v in declared().items()}
    assert faults(said) == []
    assert list(LEDGER_COLUMNS) == [field.name for field in fields(Entry)]


SMALL = [*REQUESTS, *OF_LEDGER, "claims-layouts"]


def small(name):
    return own_cube() if name == "claims-layouts" else small_cube(name)


@pytest.mark.parametrize("name", each(SMALL))
def test_small_cubes_have_units_and_long_names(name):
    assert faults(attributes_of(small(name))) == []


# Chapter 5 declares some variables by other dimensions: those of its recordings.
@pytest.mark.parametrize("name", each(sorted({*SMALL} - {"experiment-cameras"})))
def test_variables_are_numbers_or_words_along_the_declared_dimensions(name):
    known = {}
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


@pytest.mark.parametrize("name", each([*REQUESTS, *OF_LEDGER]))
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
def test_cubes_of_the_book_have_units_and_long_names_and_markers_on_the_structure(name):
    cube = cube_file.read_built(STUDIES[name]())
    assert not isinstance(cube, str), cube
    assert faults(attributes_of(cube)) == []
    if {"x", "y", "outline"} <= set(cube.coords):  # markers are on the structure that is drawn
        for axis, size in zip("xy", schema.structure_extent(cube), strict=True):
            assert 0 < cube[axis].min() <= cube[axis].max() < size


@pytest.mark.book
@pytest.mark.few(9)
@pytest.mark.parametrize("name", STUDIES)
def test_no_figure_of_the_book_misleads(name):
    cube = cube_file.read_built(STUDIES[name]())
    found = {one: misleading(drawing) for one, drawing in drawings(cube).items()}
    assert {one: wrong for one, wrong in found.items() if wrong} == {}


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
