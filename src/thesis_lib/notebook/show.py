"""What the notebooks call: parameters in, cube out, tables and figures to show."""

from __future__ import annotations

import ast
import base64
import html
import sys
from collections.abc import Iterable, Mapping
from importlib import import_module
from typing import Any

import xarray as xr
from IPython.display import HTML, SVG, Markdown, display

from thesis_lib import files
from thesis_lib.figure_sets import outside, run
from thesis_lib.figure_sets.display import as_svg
from thesis_lib.figure_sets.registry import FIGURE_SETS, STUDIES, validate
from thesis_lib.plotting.selection import has
from thesis_lib.plotting.style import in_style, svg
from thesis_lib.plotting.viewer_data import viewer_data
from thesis_lib.studies import schedulers, storage
from thesis_lib.studies.request import ParameterError, Study
from thesis_lib.web.markdown import escape
from thesis_lib.web.viewer import Viewer


def checked(name: str, namespace: Mapping[str, Any]) -> Any:
    """The request that a notebook's variables make, checked.

    Parameters
    ----------
    name : str
        Name of the figure set.
    namespace : mapping
        The notebook's ``globals()``.

    Raises
    ------
    ParameterError
        If a value is refused, or papermill has injected a parameter that there is not.
    """
    if not outside.is_known(name):
        validate(name, {})  # which says so
    fields = STUDIES[name].model_fields
    for variable in _injected(namespace.get("In", [])):
        if variable not in fields:
            validate(name, {variable: None})  # which says what is wrong with the name
    return validate(name, {field: namespace[field] for field in fields if field in namespace})


def cube_of(asked: Study) -> xr.Dataset:
    """The cube of a request; also written to the file that its parameter `cube` names, if any."""
    result = run.cube_of(asked, _scheduler(asked))
    if asked.cube:  # an absolute path stands
        storage.write(result, files.workplace() / asked.cube, compact=True)
    return result


def study(name: str, namespace: Mapping[str, Any]) -> xr.Dataset:
    """The cube for a notebook's variables: :func:`checked`, then :func:`cube_of`."""
    return cube_of(checked(name, namespace))


def _injected(inputs: Iterable[str]) -> list[str]:
    """Names that the cell which papermill injects has set, from a kernel's history of inputs."""
    return [
        target.id
        for source in inputs
        if source.startswith("# Parameters\n")
        for statement in ast.parse(source).body
        if isinstance(statement, ast.Assign)
        for target in statement.targets
        if isinstance(target, ast.Name)
    ]


def _scheduler(request: Study) -> str:
    """What ``THESIS_SCHEDULER`` asks for, if the study can be cut into pieces."""
    try:
        scheduler = schedulers.from_environment()
    except ValueError as error:
        raise ParameterError(str(error)) from None
    if scheduler and not FIGURE_SETS[request.name].in_pieces:
        print(schedulers.alone(request.name), file=sys.stderr)
        return ""
    return scheduler


def viewer(cube: xr.Dataset) -> Viewer:
    """The interactive viewer, in a live notebook and in the static page alike."""
    data = viewer_data(cube)
    return Viewer(data=data, case=data["cases"][0]["name"], mode=data["modes"][0]["mode"])


def figure(cube: xr.Dataset, case: str, mode: int) -> SVG | None:
    """The four-panel figure of a case and mode, or nothing if it was not run."""
    if not has(cube, case, mode):
        return None
    return SVG(as_svg(cube, case, mode), metadata={"case": case, "mode": mode})


def picture(cube: xr.Dataset, name: str) -> SVG:
    """What a function of the module `figures` of a cube's figure set draws of it.

    Parameters
    ----------
    cube : xarray.Dataset
        Cube of the figure set.
    name : str
        Name of the function, from cube to figure.
    """
    package = FIGURE_SETS[cube.attrs["figure_set"]].module.rpartition(".")[0]
    with in_style():
        drawing = getattr(import_module(f"{package}.figures"), name)(cube)
    return SVG(svg(drawing))


def other_figures(cube: xr.Dataset, shown: Iterable[str], modes: Iterable[int] = (1, 2, 3)) -> None:
    """Display the figures of cases, layouts and modes that have no cell of their own."""
    own = {(case, mode) for case in shown for mode in modes}
    for case in dict.fromkeys(cube["case"].values.tolist()):
        for mode in cube["mode"].values.tolist():
            if (case, mode) not in own:
                display(Markdown(f"**{escape(case)}, mode {mode}**"))
                picture = base64.b64encode(as_svg(cube, case, mode).encode()).decode()
                words = html.escape(f"The figure of {case} in mode {mode}, with the same panels")
                picture = f'<img alt="{words}" src="data:image/svg+xml;base64,{picture}">'
                display(HTML(picture, metadata={"case": case, "mode": mode}))
