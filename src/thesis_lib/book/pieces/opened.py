"""Cubes that pages are made of, opened when first asked for, and what stands where one is missing.

The page of a figure set that did not run says so; the rest of the book is built.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import xarray as xr

from thesis_lib.figure_sets import cube_file
from thesis_lib.figure_sets.display import list_captions
from thesis_lib.figure_sets.registry import STUDIES
from thesis_lib.files import whole_file, whole_text
from thesis_lib.runs.postprocess import figure_cell, figure_metadata
from thesis_lib.templates import escape_markdown, render

_PLACEHOLDER_TEXT = "This figure is missing: its run failed."


def write_texts(folder: Path, pieces: Mapping[str, Callable[[], str]]) -> None:
    """Write pieces of pages that are made of no cube into a folder, as ``NAME.md``."""
    for name, piece in pieces.items():
        whole_text(folder / f"{name}.md", piece())


def describe_missing(names: Iterable[str]) -> str:
    """Return the words in place of numbers that some figure sets should have given."""
    sets = ", ".join(f"`{name}`" for name in sorted(names))
    return f"*Missing here, since it did not run: {sets}. `thesis book` adds it once it does.*\n"


def build_failure_page(source: Path, name: str, reason: str) -> Any:
    """Return a notebook for the page of a figure set that failed, from the parameterised one.

    The prose stands, and so does every figure's place with its name and caption, so that what
    points at them leads somewhere. Of the reason it tells the first line, without the place of the
    traceback.
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
        for number, caption in enumerate(list_captions(STUDIES[name](), cell.source), 1):
            words = figure_metadata(caption.name, caption.text, _PLACEHOLDER_TEXT)
            place = figure_cell(f"{cell.id}-{number}", mystnb=words)
            place.outputs = [nbformat.v4.new_output("display_data", {"image/svg+xml": image})]
            cells.append(place)
    if not cells or not cells[0].source.startswith("# "):
        cells.insert(0, nbformat.v4.new_markdown_cell(f"# {name}", id=f"{name}-title"))
    cells.insert(1, nbformat.v4.new_markdown_cell(warning, id=f"{name}-missing"))
    return nbformat.v4.new_notebook(cells=cells, metadata=given.metadata)


def write_placeholder(path: Path, task: str) -> None:
    """Put words in the place of a piece of prose, or of a figure, that could not be made."""
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


def of_subject(opened: Cubes, subject: str) -> list[xr.Dataset]:
    """Return the cubes of a subject, such as ``beam``."""
    return [opened[name] for name in opened if STUDIES[name].subject == subject]


def of_chapter(opened: Cubes, subject: str) -> list[xr.Dataset]:
    """Return the cubes of a subject, all of which the chapter needs."""
    if isinstance(opened, Opened):
        opened.wanted |= {name for name in opened.without if STUDIES[name].subject == subject}
    return of_subject(opened, subject)


class Opened(Mapping[str, xr.Dataset]):
    """Cubes by name, which remember what a piece used, and what it would have used."""

    def __init__(self, made: Iterable[Path], without: Iterable[str]) -> None:
        self._files = {path.stem: path for path in made}
        self._read: dict[str, xr.Dataset] = {}
        self.derived: dict[Any, Any] = {}  #: What was computed of them, by what was asked
        self.without = frozenset(without)
        self.forget()

    def forget(self) -> None:
        """Begin another piece."""
        self.used, self.wanted = set[str](), set[str]()

    def __getitem__(self, name: str) -> xr.Dataset:
        if name not in self._files:
            self.wanted.add(name)
            raise KeyError(name)
        self.used.add(name)
        if name not in self._read:
            self._read[name] = cube_file.read_cube(self._files[name])
        return self._read[name]

    def __contains__(self, name: object) -> bool:
        return name in self._files

    def __iter__(self) -> Iterator[str]:
        return iter(self._files)

    def __len__(self) -> int:
        return len(self._files)
