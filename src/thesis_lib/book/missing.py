"""What stands in the book where a figure set did not run: its page says so, the rest is built."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from thesis_lib.figure_sets.display import list_captions
from thesis_lib.figure_sets.registry import STUDIES
from thesis_lib.files import whole_file, whole_text
from thesis_lib.runs.postprocess import figure_cell, figure_metadata
from thesis_lib.templates import render
from thesis_lib.web.markdown import escape_markdown

_PLACEHOLDER_TEXT = "This picture is missing: its run failed."


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


def write_page(source: Path, name: str, reason: str, place: Path) -> None:
    """Put :func:`build_failure_page` where the executed notebook would be."""
    import nbformat

    stub = build_failure_page(source, name, reason)
    whole_file(place, lambda part: nbformat.write(stub, part))


def write_placeholder(path: Path, task: str) -> None:
    """Put words in the place of a piece of prose, or of a picture, that could not be made."""
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
