"""Notebook post-processing: figures in cells of their own, and where their results come from.

An executed notebook gets one fold-out and a line under each figure after its run, so that notebooks
stay as they are. In the book the files stand in its folder ``data``; on a page of its own the cube
stands next to it, and small tables are in the page itself.
"""

import base64
import json
import re
from typing import Any
from urllib.parse import quote

import xarray as xr

from thesis_lib import __version__, templates
from thesis_lib.plotting import selection as plotted
from thesis_lib.studies.effort import Effort
from thesis_lib.studies.request import Study, changed_parameters, study_command
from thesis_lib.web.html import render_html

DATA_FOLDER = "data"
"""Folder of the rendered book that holds the cubes and the numbers of the figures."""


def hide_staging(notebook: Any, name: str) -> None:
    """Leave the reader's parameters in the notebook, without the place of the cube."""
    recorded = notebook.metadata["papermill"]
    recorded.update(input_path=f"notebooks/{name}.ipynb", output_path=f"{name}.ipynb")
    recorded["parameters"].pop("cube")
    for cell in notebook.cells:
        if "injected-parameters" in cell.metadata.get("tags", []):
            lines = cell.source.splitlines()
            cell.source = "\n".join(line for line in lines if not line.startswith("cube = "))
    notebook.cells = [cell for cell in notebook.cells if cell.source != "# Parameters"]


def cut_links(notebook: Any) -> None:
    """Remove the links of the ledger's rows: their pages are in the book alone."""
    for cell in notebook.cells:
        for output in cell.get("outputs", []):
            data = output.get("data", {})
            if "text/html" in data:
                data["text/html"] = re.sub(r'"href":"[^"]*"', '"href":""', data["text/html"])


def place_figures(notebook: Any) -> None:
    """Give each figure that cells have shown a cell of its own, with its caption and its words."""
    cells = []
    for cell in notebook.cells:
        cells.append(cell)
        shown = [output for output in cell.get("outputs", []) if _read_figure_words(output)]
        more = [figure_cell(f"{cell.id}-{n}") for n in range(2, len(shown) + 1)]
        for place, output in zip([cell, *more], shown, strict=False):
            del output.data["text/html"]  # for front ends
            place.outputs = [one for one in place.outputs if one not in shown] + [output]
            place.metadata["mystnb"] = figure_metadata(**_read_figure_words(output))
        cells += more
    notebook.cells = cells


def figure_cell(name: str, **metadata: Any) -> Any:
    """Return a cell for a figure that another cell has shown; the book leaves out empty cells."""
    import nbformat

    cell = nbformat.v4.new_code_cell("# shown above", id=name)
    cell.metadata.update(tags=["remove-input"], **metadata)
    return cell


def figure_metadata(name: str, caption: str, alt: str, **_: Any) -> dict[str, Any]:
    """Return the metadata that make a figure of a cell's picture."""
    words = (
        {"figure": {"name": name, "caption": templates.escape_markdown(caption)}} if caption else {}
    )
    return {**words, "image": {"alt": alt}}


def _read_figure_words(output: Any) -> dict[str, Any]:
    """Return what the output of a cell says about its figure; nothing if it is none."""
    about = output.get("metadata", {}).get("image/svg+xml", {})
    return dict(about) if {"name", "caption", "alt"} <= set(about) else {}


def add_provenance(
    notebook: Any, study: Study, cube: xr.Dataset, digest: str, cost: Effort, in_book: bool
) -> None:
    """Put the fold-out at the end of an executed notebook, and a line under each figure.

    The page is one of the book, or stands alone next to its cube, and then holds the tables.
    `digest` is the SHA-256 of the cube's file, `cost` that of the run.
    """
    import nbformat

    name, anchor = study.name, f"provenance-{study.name}"  # of the fold-out in its page
    files = plotted.figure_names(cube)
    tables = {} if in_book else plotted.tabulate_cube(cube, name)

    def link(table: str) -> str:
        if in_book:
            return f"../{DATA_FOLDER}/{quote(table)}.csv"
        text = base64.b64encode(plotted.as_csv(tables[table]).encode()).decode()
        return f"data:text/csv;charset=utf-8;base64,{text}"

    cells = []
    for cell in notebook.cells:
        cells.append(cell)
        for about in filter(None, map(_read_figure_words, cell.get("outputs", []))):
            which = about.get("case", ""), about.get("mode", 0)
            file = address = ""
            if which in files:
                file = f"{files[which]}.csv"
                address = link(f"{name}/{files[which]}")
            elif not about["caption"]:
                continue
            values = {"address": address, "file": file, "case": which[0], "mode": which[1]}
            line = render_html("runs/templates/under_figure.html.j2", anchor=anchor, **values)
            cells.append(nbformat.v4.new_markdown_cell(line.strip(), id=f"{cell.id}-data"))
    given = changed_parameters(study).items()
    block = render_html(
        "runs/templates/provenance.html.j2",
        study=study,
        anchor=anchor,
        given={key: json.dumps(value, ensure_ascii=False) for key, value in given},
        version=__version__,
        commit=str(cube.attrs["commit"]).strip(),
        created=str(cube.attrs["created"]).strip(),
        digest=digest,
        cost=cost,
        command=study_command(study),
        cube=f"../{DATA_FOLDER}/{name}.nc" if in_book else f"{name}.nc",
        numbers=link(name),
    )
    text = f"## Data and provenance\n\n{block.strip()}"
    cells.append(nbformat.v4.new_markdown_cell(text, id=f"{name}-provenance"))
    notebook.cells = cells
