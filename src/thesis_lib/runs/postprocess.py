"""Notebook post-processing: figures in cells of their own, and where their results come from.

An executed notebook gets one fold-out and a line under each figure after its run, so that notebooks
stay as they are. In the book the files stand in its folder ``data``; on a page of its own the cube
stands next to it, and small tables are in the page itself.
"""

import base64
import json
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import quote

import xarray as xr

from thesis_lib import __version__
from thesis_lib.files import sha256
from thesis_lib.plotting import selection as plotted
from thesis_lib.studies.effort import Effort
from thesis_lib.studies.request import Study, changed_parameters, study_command
from thesis_lib.templates import escape_markdown
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
    words = {"figure": {"name": name, "caption": escape_markdown(caption)}} if caption else {}
    return {**words, "image": {"alt": alt}}


def _read_figure_words(output: Any) -> dict[str, Any]:
    """Return what the output of a cell says about its figure; nothing if it is none."""
    about = output.get("metadata", {}).get("image/svg+xml", {})
    return dict(about) if {"name", "caption", "alt"} <= set(about) else {}


@dataclass(frozen=True)
class Record:
    """Where the results of a figure set come from."""

    study: Study  #: What was asked for
    sha256: str  #: Of the cube's file
    #: Commit of the library, and when the cube was made
    commit: str
    created: str
    effort: Effort  #: What the run cost

    @property
    def anchor(self) -> str:
        """Return the name of the fold-out in its page."""
        return f"provenance-{self.study.name}"


def trace_results(study: Study, cube: xr.Dataset, file: Path, effort: Effort) -> Record:
    """Return the origin of a cube and of the file that holds it."""
    commit, created = (str(cube.attrs[name]).strip() for name in ("commit", "created"))
    return Record(study, sha256(file), commit, created, effort)


def add_provenance(notebook: Any, about: Record, cube: xr.Dataset, in_book: bool) -> None:
    """Put the fold-out at the end of an executed notebook, and a line under each figure.

    The page is one of the book, or stands alone next to its cube, and then holds the tables.
    """
    import nbformat

    name = about.study.name
    files = plotted.figure_names(cube)
    errors = plotted.errors_table(cube)

    def link(table: Any, file: str) -> str:
        if in_book:
            return f"../{DATA_FOLDER}/{quote(file)}"
        text = base64.b64encode(plotted.as_csv(table).encode()).decode()
        return f"data:text/csv;charset=utf-8;base64,{text}"

    def line_under(address: str = "", file: str = "", case: str = "", mode: int = 0) -> str:
        values = {"address": address, "file": file, "case": case, "mode": mode}
        template = "runs/templates/under_figure.html.j2"
        return render_html(template, anchor=about.anchor, **values).strip()

    def lines_under(cell: Any) -> list[str]:
        shown = [which for which in figures_of(cell) if which in files]
        if not shown and "figure" in cell.metadata.get("mystnb", {}) and cell.get("outputs"):
            return [line_under()]
        lines = []
        for which in shown:
            file = f"{files[which]}.csv"
            address = link(plotted.figure_table(cube, errors, *which), f"{name}/{file}")
            lines.append(line_under(address, file, *which))
        return lines

    cells = []
    for cell in notebook.cells:
        cells.append(cell)
        if lines := lines_under(cell):
            cells.append(nbformat.v4.new_markdown_cell("\n".join(lines), id=f"{cell.id}-data"))
    place = f"../{DATA_FOLDER}/{name}.nc" if in_book else f"{name}.nc"
    text = f"## Data and provenance\n\n{fold_out(about, place, link(errors, f'{name}.csv'))}"
    cells.append(nbformat.v4.new_markdown_cell(text, id=f"{name}-provenance"))
    notebook.cells = cells


def figures_of(cell: Any) -> list[tuple[str, int]]:
    """Return case and mode of each figure that a cell shows, as its outputs state them."""
    found = []
    for output in cell.get("outputs", []):
        for said in output.get("metadata", {}).values():
            if isinstance(said, dict) and {"case", "mode"} <= set(said):
                found.append((str(said["case"]), int(said["mode"])))
    return found


def fold_out(about: Record, cube: str, numbers: str) -> str:
    """Return the fold-out as one block of HTML.

    `cube` and `numbers` are addresses of the cube and of the table of all errors.
    """
    changed = changed_parameters(about.study).items()
    parameters = {key: json.dumps(value, ensure_ascii=False) for key, value in changed}
    block = render_html(
        "runs/templates/provenance.html.j2",
        about=about,
        study=about.study,
        given=parameters,
        version=__version__,
        command=study_command(about.study),
        cube=cube,
        numbers=numbers,
    )
    return block.strip()
