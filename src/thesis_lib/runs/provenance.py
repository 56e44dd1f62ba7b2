"""Under each figure set, where it comes from: one fold-out a page, and a line under each figure.

They are put into an executed notebook after its run, so that notebooks stay as they are. In the
book the files stand in its folder ``data``; on a page of its own the cube stands beside it, and
what is small is in the page itself.
"""

from __future__ import annotations

import base64
import json
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any
from urllib.parse import quote

import xarray as xr

from thesis_lib import __version__
from thesis_lib.files import sha256
from thesis_lib.plotting import selection as plotted
from thesis_lib.studies.commands import command, given
from thesis_lib.studies.effort import Effort
from thesis_lib.studies.request import Study

FOLDER = "data"
"""Folder of the rendered book that holds the cubes and the numbers of the figures."""


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
        """The fold-out's name in its page."""
        return f"provenance-{self.study.name}"


def record(study: Study, cube: xr.Dataset, file: Path, effort: Effort) -> Record:
    """What there is to tell of a cube and the file that holds it."""
    commit, created = (str(cube.attrs[name]).strip() for name in ("commit", "created"))
    return Record(study, sha256(file), commit, created, effort)


def add(notebook: Any, about: Record, cube: xr.Dataset, in_book: bool) -> None:
    """Put the fold-out at the end of an executed notebook, and a line under each figure.

    The page is one of the book, or stands alone beside its cube, whose numbers are offered.
    """
    import nbformat

    name = about.study.name
    files = plotted.figure_names(cube)
    errors = plotted.errors_table(cube)

    def link(table: Any, file: str) -> str:
        if in_book:
            return f"../{FOLDER}/{quote(file)}"
        text = base64.b64encode(plotted.as_csv(table).encode()).decode()
        return f"data:text/csv;charset=utf-8;base64,{text}"

    cells = []
    for cell in notebook.cells:
        cells.append(cell)
        lines = [
            under_figure(about, link(plotted.figure_table(cube, errors, *which), file), file, which)
            for which in figures_of(cell)
            if which in files
            for file in [f"{name}/{files[which]}.csv"]
        ]
        if not lines and "figure" in cell.metadata.get("mystnb", {}) and cell.get("outputs"):
            lines = [under_figure(about)]
        if lines:
            new = nbformat.v4.new_markdown_cell("\n".join(lines), id=f"{cell.id}-data")
            cells.append(new)
    place = f"../{FOLDER}/{name}.nc" if in_book else f"{name}.nc"
    text = fold_out(about, place, link(errors, f"{name}.csv"))
    heading = f"## Data and provenance\n\n{text}"
    cells.append(nbformat.v4.new_markdown_cell(heading, id=f"{name}-provenance"))
    notebook.cells = cells


def figures_of(cell: Any) -> list[tuple[str, int]]:
    """Case and mode of each figure that a cell shows, which their outputs say."""
    found = []
    for output in cell.get("outputs", []):
        for said in output.get("metadata", {}).values():
            if isinstance(said, dict) and {"case", "mode"} <= set(said):
                found.append((str(said["case"]), int(said["mode"])))
    return found


def under_figure(
    about: Record, address: str = "", file: str = "", which: tuple[str, int] | None = None
) -> str:
    """The line under a figure: a link to the fold-out, and the figure's own numbers."""
    opens = f"document.getElementById('{about.anchor}').open = true"
    of = ""
    words = (
        f'<a class="tl-to-data" href="#{about.anchor}" onclick="{opens}">data and provenance</a>'
    )
    if address and which:
        of = f' data-case="{escape(which[0])}" data-mode="{which[1]}"'
        label = escape(f"numbers of {which[0]}, mode {which[1]}, as CSV")
        words += f" · {_download(address, Path(file).name, 'numbers (CSV)', label)}"
    return f'<p class="tl-under-figure"{of}>{words}</p>'


def fold_out(about: Record, cube: str, numbers: str) -> str:
    """The fold-out as one block of HTML, without an empty line in it.

    `cube` and `numbers` are addresses of the cube and of the table of all errors.
    """
    study, effort = about.study, about.effort
    changed = "; ".join(
        f"{k} = {json.dumps(v, ensure_ascii=False)}" for k, v in given(study).items()
    )
    rows = [
        ("Figure set", escape(study.name)),
        ("Parameters", escape(changed or "defaults") + f" (hash {_code(study.digest)})"),
        ("Cube", f"{_code(study.name + '.nc')}, {effort.cube_mb:.1f} MB"),
        ("SHA-256", _code(about.sha256)),
        ("Library", f"thesis_lib {escape(__version__)}, commit {_code(about.commit)}"),
        ("Run", f"{escape(about.created)}; {effort.time} and {effort.memory} from nothing"),
        ("Command", _code(command(study))),
    ]
    body = "".join(f"<dt>{name}</dt><dd>{words}</dd>" for name, words in rows)
    offered = [
        _download(cube, f"{study.name}.nc", "Cube (netCDF)"),
        _download(numbers, f"{study.name}.csv", "All errors (CSV)"),
    ]
    return (
        f'<details class="tl-provenance" id="{about.anchor}">'
        f"<summary>Where these results come from, and the data to download</summary>"
        f"<dl>{body}</dl><p>{' '.join(offered)}</p></details>"
    )


def _code(text: str) -> str:
    return f"<code>{escape(text)}</code>"


def _download(address: str, name: str, words: str, label: str = "") -> str:
    told = f' aria-label="{label}"' if label else ""
    return (
        f'<a class="tl-download"{told} download="{escape(name)}" href="{escape(address)}">'
        f"{escape(words)}</a>"
    )
