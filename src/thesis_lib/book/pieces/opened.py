"""Cubes and figures that pages are made of, and placeholders for missing ones.

A cube is opened at its first use. The page of a figure set that did not run says so; the rest of
the book is built.

Chapters can show figures of the executed notebooks: a page that includes ``executed/fig-NAME.md``
shows the figure of that name, with its caption, its alternative text and a link to its numbers. A
chapter that replaces a notebook's page also includes ``executed/provenance-SET.md``.
"""

import json
from collections.abc import Callable, Iterable, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import xarray as xr

from thesis_lib.figure_sets import cube_file, display, registry
from thesis_lib.files import stat_file, whole_file, whole_text
from thesis_lib.runs.postprocess import figure_cell, figure_metadata
from thesis_lib.templates import escape_markdown, render

_PLACEHOLDER_TEXT = "This figure is missing: its run failed."


def write_texts(folder: Path, pieces: Mapping[str, Callable[[], str]], suffix: str = ".md") -> None:
    """Write pieces of pages that need no cube into a folder, as ``NAME.md``."""
    for name, piece in pieces.items():
        whole_text(folder / f"{name}{suffix}", piece())


def build_failure_page(source: Path, name: str, reason: str) -> Any:
    """Return a notebook for the page of a figure set that failed, from the parameterised one.

    It keeps the prose and, so that links lead somewhere, a placeholder for every figure with its
    name and caption. It gives the reason without the path of the traceback.
    """
    import nbformat

    why = " ".join(reason.partition("; the traceback")[0].split()).removeprefix(f"{name}: ")
    warning = render(__file__, "missing-set", why=escape_markdown(why), name=name).strip()
    image = _draw_placeholder()
    given = nbformat.read(source, as_version=4)
    cells = []
    for cell in given.cells:
        if cell.cell_type == "markdown":
            cells.append(cell)
            continue
        for number, caption in enumerate(
            display.list_captions(registry.STUDIES[name](), cell.source), 1
        ):
            words = figure_metadata(caption.name, caption.text, _PLACEHOLDER_TEXT)
            place = figure_cell(f"{cell.id}-{number}", mystnb=words)
            place.outputs = [nbformat.v4.new_output("display_data", {"image/svg+xml": image})]
            cells.append(place)
    cells.insert(1, nbformat.v4.new_markdown_cell(warning, id=f"{name}-missing"))
    return nbformat.v4.new_notebook(cells=cells, metadata=given.metadata)


def write_placeholder(path: Path, task: str) -> None:
    """Write a placeholder for a text or a figure that could not be made."""
    if path.suffix == ".md":
        whole_text(path, f"*Missing here, since the step “{escape_markdown(task)}” failed.*\n")
    elif path.suffix == ".svg":
        whole_text(path, _draw_placeholder())
    elif path.suffix == ".webp":
        from PIL import Image, ImageDraw

        picture = Image.new("RGB", (600, 60), "#f4f4f4")
        ImageDraw.Draw(picture).text((20, 24), _PLACEHOLDER_TEXT, fill="#555")
        whole_file(path, lambda part: picture.save(part, "WEBP"))


def _draw_placeholder() -> str:
    return render(__file__, "missing-picture.svg", words=_PLACEHOLDER_TEXT)


Cubes = Mapping[str, xr.Dataset]


class MissingCubeError(KeyError):
    """A piece needs a cube that does not exist; the argument is the name of the figure set."""


def select_subject(opened: Cubes, subject: str) -> list[xr.Dataset]:
    """Return the cubes of a subject, such as ``beam``."""
    return [opened[name] for name, study in registry.STUDIES.items() if study.subject == subject]


def read_once(path: Path) -> xr.Dataset:
    """Read a cube once for all steps of a build, and again if its file has changed."""
    return _read_cube(path, stat_file(path)).copy()


@cache
def _read_cube(path: Path, _as_it_is: tuple[int, ...]) -> xr.Dataset:
    return cube_file.read_cube(path)


class Opened(dict[str, xr.Dataset]):
    """Cubes by name, read at their first use."""

    def __init__(self, made: Iterable[Path]) -> None:
        super().__init__()
        self._files = {path.stem: path for path in made}
        self.derived: dict[Any, Any] = {}  #: Cache of values computed from the cubes

    def __missing__(self, name: str) -> xr.Dataset:
        if name not in self._files:
            raise MissingCubeError(name)
        self[name] = read_once(self._files[name])
        return self[name]


SETS_IN_CHAPTERS = {
    "design-law": "design-law",
    "lab-radiation": "video-to-sound",
    "planner": "planner",
}
"""Figure sets without a page of their own, and the chapters that show all their figures."""
_DOWNLOADS_MARK = '<a class="tl-download"'


def write_shown_figures(wanted: Iterable[str], notebooks: Iterable[Path], folder: Path) -> None:
    """Write each wanted figure into `folder`: its SVG, and the Markdown that a page includes."""
    found = {}
    for notebook in notebooks:
        for cell in json.loads(notebook.read_text(encoding="utf-8"))["cells"]:
            about = cell["metadata"].get("mystnb", {})
            shown = [output.get("data", {}) for output in cell.get("outputs", [])]
            drawn = next((one["image/svg+xml"] for one in shown if "image/svg+xml" in one), None)
            if "figure" in about and drawn is not None:
                found[about["figure"]["name"]] = notebook.stem, about, "".join(drawn)
    for name in wanted:
        picture, words = folder / f"{name}.svg", folder / f"{name}.md"
        if name in found:
            of, about, drawn = found[name]
            page = of not in SETS_IN_CHAPTERS
            whole_text(picture, drawn)
            whole_text(words, render(__file__, "figure", **about, figure_set=of, page=page))
        else:  # its set was run without this mode
            write_placeholder(picture, name)
            write_placeholder(words, name)


def write_provenance(notebook: Path, folder: Path) -> None:
    """Write the viewers and the provenance of a notebook without a page, for its chapter."""
    cells = json.loads(notebook.read_text(encoding="utf-8"))["cells"]
    shown = [output.get("data", {}) for cell in cells for output in cell.get("outputs", [])]
    viewers = ["".join(one["text/html"]) for one in shown if "text/html" in one]
    _, found, block = "".join(cells[-1]["source"]).partition("<details")
    downloads = block.replace("../", "").partition(_DOWNLOADS_MARK)
    values = {"name": notebook.stem, "viewers": viewers, "found": found, "downloads": downloads}
    text = render(__file__, "provenance", **values)
    whole_text(folder / f"provenance-{notebook.stem}.md", text)
