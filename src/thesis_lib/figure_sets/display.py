"""Figures and texts of any cube, by case and mode or by name."""

import json
import re
import tomllib
from collections.abc import Iterator, Mapping
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from thesis_lib.figure_sets.registry import FIGURE_SETS
from thesis_lib.plotting import panels, style
from thesis_lib.studies.cubes import iterate_slices, trials_are
from thesis_lib.studies.request import Study
from thesis_lib.studies.schema import describe_study
from thesis_lib.templates import render

_PICTURE_CALL = re.compile(r'notebook\.picture\(result, "(\w+)"(?:, (\d+))?\)')


def draw_figure(cube: xr.Dataset, case: str, mode: int) -> Figure:
    """Draw the figure of one case, or layout, and mode of a cube."""
    name = cube.attrs["figure_set"]
    with style.in_style():
        return getattr(figures_module(name), FIGURE_SETS[name].figure)(cube, case, mode)


def as_svg(cube: xr.Dataset, case: str, mode: int) -> str:
    """Return the figure of one case and mode as SVG; the same cube gives the same text."""
    return style.figure_svg(draw_figure(cube, case, mode))


def draw_named_figure(cube: xr.Dataset, name: str, *which: int) -> Figure | None:
    """Draw a cube with the function `name` of its figure set's module `figures`.

    `which` are further arguments, such as a mode; the result is None for a mode that was not run.
    """
    of = str(cube.attrs["figure_set"])
    with style.in_style(figure_style(of)):
        return getattr(figures_module(of), name)(cube, *which)


def fill_text(cube: xr.Dataset, name: str, *which: int) -> str:
    """Fill in a template of a cube's figure set: a table or a paragraph, as Markdown.

    Functions in ``TEXTS`` of its module `figures` compute what a template needs besides the cube.
    `which` are further arguments of such a function, such as a mode.
    """
    figures = figures_module(str(cube.attrs["figure_set"]))
    compute = getattr(figures, "TEXTS", {}).get(name)
    values = compute(cube, *which) if compute else {}
    shared = {"cube": cube, "slices": iterate_slices, "trials_are": trials_are(cube)}
    shared["asked"] = json.loads(cube.attrs.get("parameters", "{}"))
    return render(str(figures.__file__), name, **shared, **values)


def read_caption(figure_set: str, name: str, *which: int) -> panels.Caption:
    """Return the caption of a figure; empty if ``captions.toml`` in its set's folder has none."""
    words = read_captions(figure_set).get(name, {})
    return panels.Caption(**{key: text.format(*which) for key, text in words.items()})


def read_captions(figure_set: str) -> dict[str, dict[str, str]]:
    """Return the captions in ``captions.toml`` of a figure set's folder, by drawing function."""
    file = Path(str(figures_module(figure_set).__file__)).with_name("captions.toml")
    text = file.read_text(encoding="utf-8") if file.is_file() else ""
    return tomllib.loads(text).get(figure_set, {})


def figure_style(figure_set: str) -> Mapping[str, Any]:
    """Return the Matplotlib parameters of a figure set, ``STYLE`` of its module `figures`."""
    return getattr(figures_module(figure_set), "STYLE", {})


def list_captions(study: Study, source: str) -> Iterator[panels.Caption]:
    """List the captions that a notebook cell with this `source` will show, without running it."""
    if "notebook.figures(result)" in source:
        cases = [setting.case for setting in study.settings()]
        modes = np.array(getattr(study, "modes", []), int)
        known = xr.Dataset(coords={"case": ("setting", cases), "mode": modes})
        cube = describe_study(known.assign_attrs(figure_set=study.name), study)
        yield from panels.case_captions(cube).values()
    for name, which in _PICTURE_CALL.findall(source):
        yield read_caption(study.name, name, *([int(which)] if which else []))


def figures_module(figure_set: str) -> ModuleType:
    """Return the module `figures` of a figure set; the templates are in the same folder."""
    return import_module(f"{FIGURE_SETS[figure_set].package}.figures")
