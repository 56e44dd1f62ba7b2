"""Functions for notebooks: check parameters, compute cubes, show tables, figures and forms.

A page has a form of parameters for one figure set, above its viewer, or for all of them. The form
is generated from the models of :mod:`thesis_lib.figure_sets.registry`, so it accepts and refuses
the same values as the ``thesis`` command. For beam and plate the page also computes the results.
"""

import base64
import html
import json
import os
import re
import sys
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import astuple, dataclass, field
from typing import Any

import xarray as xr
from IPython.display import Markdown, display
from matplotlib.figure import Figure

from thesis_lib import files
from thesis_lib.figure_sets import cube_file, display as figure_sets, registry
from thesis_lib.figure_sets.parametric import in_page
from thesis_lib.plotting import panels, selection
from thesis_lib.plotting.style import figure_svg
from thesis_lib.studies import effort, request, storage, workers
from thesis_lib.studies.fields import describe_permitted
from thesis_lib.studies.request import ParameterError, Study, check_names, validate_values
from thesis_lib.text import one_line, parse_json
from thesis_lib.web.viewer import Viewer

_SVG_MIME = "image/svg+xml"


def checked(name: str, namespace: Mapping[str, Any]) -> Any:
    """Validate a notebook's variables, its ``globals()``, as a request.

    Raises
    ------
    ParameterError
        If a value is refused, or papermill has injected an unknown parameter.
    """
    registry.is_known(name, here=True)  # loads it
    model = registry.model_of(name)
    injected = [  # names set by papermill's cell, from the kernel's history
        key
        for source in namespace.get("In", [])
        if source.startswith("# Parameters\n")
        for key in re.findall(r"^(\w+) = ", source, re.MULTILINE)
    ]
    check_names(model, injected)
    values = {key: namespace[key] for key in model.model_fields if key in namespace}
    for key in injected:  # papermill's ``-p`` passes lists and objects on as text
        value = values[key]
        if isinstance(value, str) and value.lstrip().startswith(("[", "{")):
            try:
                values[key] = parse_json(value)
            except KeyError as error:
                why = f"{one_line(repr(error.args[0]))} is given twice, allowed: once"
                raise ParameterError(f"{name}: {key}: {why}") from None
    return validate_values(model, values)


def cube_of(asked: Study) -> xr.Dataset:
    """Return the cube of a request, and write it to the file of its parameter `cube`.

    If the study can be cut into blocks, the scheduler in ``THESIS_SCHEDULER`` computes them.
    """
    if scheduler := os.environ.get(workers.SCHEDULER_VARIABLE, ""):
        workers.check_address(scheduler, workers.SCHEDULER_VARIABLE)
    if scheduler and not registry.FIGURE_SETS[asked.name].in_pieces:
        print(workers.describe_unsupported(asked.name), file=sys.stderr)
        scheduler = ""
    result = cube_file.cube_of(asked, scheduler)
    if asked.cube:  # an absolute path stays
        storage.write_netcdf(result, files.workplace() / asked.cube, compact=True)
    return result


def study(name: str, namespace: Mapping[str, Any]) -> xr.Dataset:
    """Compute the cube for a notebook's variables: :func:`checked`, then :func:`cube_of`."""
    return cube_of(checked(name, namespace))


def viewer(cube: xr.Dataset) -> Viewer:
    """Return the interactive viewer, for a live notebook and for the static page."""
    data, form = selection.viewer_data(cube), dict[str, Any]()
    name = str(cube.attrs["figure_set"])
    if name in in_page.COMPUTED_SETS:  # the page can change their parameters
        form = form_of(registry.validate_request(name, json.loads(cube.attrs["parameters"])))
    first = {"case": data["cases"][0]["name"], "mode": data["modes"][0]["mode"]}
    return Viewer(data=data, form=form, **first)


@dataclass(frozen=True)
class DisplayedFigure:
    """A figure with its caption: SVG for pages, image and caption for front ends."""

    svg: str = field(repr=False)  #: The drawing
    #: Its ``name``, ``caption`` and ``alt``, and ``case`` and ``mode`` if it has them
    about: Mapping[str, Any] = field(repr=False)

    def _repr_mimebundle_(self, **_: Any) -> tuple[dict[str, str], dict[str, Any]]:
        alt, caption = (html.escape(self.about[key]) for key in ("alt", "caption"))
        source = f"data:image/svg+xml;base64,{base64.b64encode(self.svg.encode()).decode()}"
        image = f'<img alt="{alt}" src="{source}">'
        words = f"<figure>{image}<figcaption>{caption}</figcaption></figure>"
        return {_SVG_MIME: self.svg, "text/html": words}, {_SVG_MIME: dict(self.about)}


def figures(cube: xr.Dataset) -> None:
    """Display the figure of each case and mode, one after the other."""
    for (case, mode), caption in panels.case_captions(cube).items():
        drawing = figure_sets.draw_figure(cube, case, mode)
        display(_show_figure(cube, drawing, caption, case=case, mode=mode))


def picture(cube: xr.Dataset, name: str, *which: int) -> DisplayedFigure | None:
    """Show a figure of :mod:`thesis_lib.figure_sets.display`; None if the mode is missing."""
    drawing = figure_sets.draw_named_figure(cube, name, *which)
    if drawing is None:
        return None
    of = str(cube.attrs["figure_set"])
    caption, style = figure_sets.read_caption(of, name, *which), figure_sets.figure_style(of)
    return _show_figure(cube, drawing, caption, style)


def text(cube: xr.Dataset, name: str, *which: int) -> Markdown:
    """Show a table or paragraph of :func:`thesis_lib.figure_sets.display.fill_text`."""
    return Markdown(figure_sets.fill_text(cube, name, *which))


def _show_figure(
    cube: xr.Dataset, drawing: Figure, caption: panels.Caption, style: Any = None, **which: Any
) -> DisplayedFigure:
    """Return a drawing with its caption, which notes if parameters are not the thesis's."""
    svg = figure_svg(drawing, style)
    ours = cube.attrs["in_the_thesis"] or registry.FIGURE_SETS[cube.attrs["figure_set"]].reads()
    after = "" if ours or not caption.text else "With the parameters of this run, after: "
    alt = caption.alt or panels.describe_panels(drawing)
    about = {"name": caption.name, "caption": after + caption.text, "alt": alt} | which
    return DisplayedFigure(svg[svg.index("<svg") :], about)


def form_data(names: Iterable[str] = tuple(registry.STUDIES)) -> dict[str, Any]:
    """Return the data of a form for some figure sets, as JSON values.

    ``fields`` lists the distinct parameters: name, meaning, unit, allowed values in words and as
    JSON schema, the end of a refusal, and the default as typed text. ``sets`` and ``chapters`` have
    by name a title, indices of fields in the order of display, and a sentence on the cost of the
    published run; a set also has indices in the order of checking, a chapter its sets and the names
    of parameters in which they differ. ``here`` is the data for computing in the page,
    :func:`thesis_lib.figure_sets.parametric.in_page.page_facts`.
    """
    fields: list[dict[str, Any]] = []
    sets: dict[str, dict[str, Any]] = {}
    for name in names:
        study, numbers = registry.STUDIES[name], {}
        schema = study.model_json_schema()["properties"]
        for row in request.describe_parameters(study):
            if row["name"] == "cube":  # output of a notebook: not of the command
                continue
            listed = {"title", "description", "default", "allowed"}  # keys of the row itself
            plain = {key: of for key, of in schema[row["name"]].items() if key not in listed}
            field = {
                **{key: row[key] for key in ("name", "meaning", "unit", "allowed")},
                "schema": plain,
                "permitted": describe_permitted(study, row["name"]),
                "typed": _format_typed(row["default"]),
            }
            if field not in fields:
                fields.append(field)
            numbers[row["name"]] = fields.index(field)
        sets[name] = {
            "title": study.title,
            "shown": list(numbers.values()),
            "checked": [numbers[key] for key in study.model_fields if key in numbers],
            "takes": _describe_cost([name]),
        }
    chapters = registry.CHAPTER_SETS.items()
    whole = [name for name, members in chapters if sets.keys() >= set(members)]
    return {
        "fields": fields,
        "sets": sets,
        "chapters": {name: _describe_chapter(name, fields, sets) for name in whole},
        "here": in_page.page_facts([name for name in in_page.COMPUTED_SETS if name in sets]),
    }


def form_of(request: Study) -> dict[str, Any]:
    """Return the form of one figure set, filled with the values of a request."""
    data = form_data([request.name])
    default, values = type(request)().request, request.request
    start = {name: _format_typed(one) for name, one in values.items() if one != default[name]}
    return data | {"start": start}


def _format_typed(value: Any) -> str:
    """Format a value as a user would type it.

    Examples
    --------
    >>> [_format_typed(one) for one in (24.0, "known", [500.0, 750.5], [[10.0, 22.0]])]
    ['24', 'known', '500, 750.5', '[[10, 22]]']
    """
    if isinstance(value, str):
        return value
    text = json.dumps(request.whole_numbers(value), ensure_ascii=False)
    flat = isinstance(value, list) and not any(isinstance(one, list) for one in value)
    return text[1:-1] if flat else text


def _describe_chapter(
    name: str, fields: list[dict[str, Any]], sets: dict[str, dict[str, Any]]
) -> dict[str, Any]:
    """Describe the parameters that sets of a chapter share, common ones first."""
    members = registry.CHAPTER_SETS[name]
    held = Counter(number for one in members for number in sets[one]["shown"])
    numbers = sorted(held, key=lambda number: held[number] < len(members))
    names = [fields[number]["name"] for number in numbers]
    return {
        "title": registry.TITLES[name],
        "sets": members,
        "shown": [n for n in numbers if names.count(fields[n]["name"]) == 1],
        "differ": [one for one in dict.fromkeys(names) if names.count(one) > 1],
        "takes": _describe_cost(members),
    }


def _describe_cost(names: list[str]) -> str:
    """Describe the measured cost of figure sets, an upper bound for several; empty if unknown."""
    known = effort.read_efforts()
    if not set(names) <= set(known):
        return ""
    seconds, peaks, sizes = zip(*(astuple(known[name]) for name in names), strict=True)
    two = sum(sorted(peaks)[-2:])  # that run at a time
    total = effort.Effort(sum(seconds), two, sum(sizes))
    takes = f"{'up to ' * (len(names) > 1)}{total.time} and {total.memory}"
    return f"With the defaults it takes {takes}, in a clean run on two cores."
