"""Notebook post-processing: figures in cells of their own, and provenance of the results.

After its run, an executed notebook gets a fold-out at its end and a line under each figure; the
source notebook does not change. In the book, files are in its folder ``data``. A stand-alone page
has the cube next to it and contains the small tables.
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
    """Remove the cube's temporary path from the parameters in the notebook."""
    recorded = notebook.metadata["papermill"]
    recorded.update(input_path=f"notebooks/{name}.ipynb", output_path=f"{name}.ipynb")
    recorded["parameters"].pop("cube")
    for cell in notebook.cells:
        if "injected-parameters" in cell.metadata.get("tags", []):
            lines = cell.source.splitlines()
            cell.source = "\n".join(line for line in lines if not line.startswith("cube = "))
    notebook.cells = [cell for cell in notebook.cells if cell.source != "# Parameters"]


def cut_links(notebook: Any) -> None:
    """Remove the links of the ledger's rows: their pages are only in the book."""
    for cell in notebook.cells:
        for output in cell.get("outputs", []):
            data = output.get("data", {})
            if "text/html" in data:
                data["text/html"] = re.sub(r'"href":"[^"]*"', '"href":""', data["text/html"])


def place_figures(notebook: Any) -> None:
    """Give each displayed figure a cell of its own, with its caption and alternative text."""
    cells = []
    for cell in notebook.cells:
        cells.append(cell)
        shown = [output for output in cell.get("outputs", []) if _read_figure_words(output)]
        more = [figure_cell(f"{cell.id}-{n}") for n in range(2, len(shown) + 1)]
        for place, output in zip([cell, *more], shown, strict=False):
            del output.data["text/html"]  # only for front ends
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
    """Return the metadata that turn a cell's image into a figure."""
    words = (
        {"figure": {"name": name, "caption": templates.escape_markdown(caption)}} if caption else {}
    )
    return {**words, "image": {"alt": alt}}


def _read_figure_words(output: Any) -> dict[str, Any]:
    """Return the figure metadata of a cell's output; empty if it is no figure."""
    about = output.get("metadata", {}).get("image/svg+xml", {})
    return dict(about) if {"name", "caption", "alt"} <= set(about) else {}


def add_provenance(
    notebook: Any, study: Study, cube: xr.Dataset, digest: str, cost: Effort, in_book: bool
) -> None:
    """Add the provenance at the end of an executed notebook, and a line under each figure.

    The page is one of the book, or stands alone next to its cube, and then contains the tables.
    `digest` is the SHA-256 of the cube's file, `cost` that of the run.
    """
    import nbformat

    name, anchor = study.name, f"provenance-{study.name}"  # anchor of the fold-out on its page
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
