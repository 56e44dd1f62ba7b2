"""Figures of the executed notebooks that stand in the chapters that argue with them.

A page that includes ``executed/fig-NAME.md`` shows the figure of that name, with its caption and
its words for those who cannot see it, and a link to where its numbers are. A chapter in the place
of a notebook's page includes ``executed/provenance-SET.md``, too.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator
from pathlib import Path

from thesis_lib import files
from thesis_lib.book.pieces.opened import write_placeholder
from thesis_lib.templates import render

SETS_IN_CHAPTERS = {
    "design-law": "design-law",
    "lab-radiation": "video-to-sound",
    "planner": "planner",
}
"""Figure sets that have no page of their own, and the chapter that shows all their figures."""
_INCLUDE_PATTERN = re.compile(r"executed/(fig-[\w-]+)\.md")
_DOWNLOADS_MARK = '<a class="tl-download"'


def find_figure_names(pages: Iterable[Path]) -> list[str]:
    """Return names of the figures that `pages` show."""
    texts = (page.read_text(encoding="utf-8") for page in pages if page.suffix == ".md")
    return sorted({name for text in texts for name in _INCLUDE_PATTERN.findall(text)})


def write_shown_figures(wanted: Iterable[str], notebooks: Iterable[Path], folder: Path) -> None:
    """Write each wanted figure into `folder`: its SVG, and what a page includes."""
    found = {name: one for notebook in notebooks for name, one in _read_figures(notebook)}
    for name in wanted:
        picture, words = folder / f"{name}.svg", folder / f"{name}.md"
        if name in found:
            files.whole_text(picture, found[name]["picture"])
            page = found[name]["set"] not in SETS_IN_CHAPTERS
            text = render(__file__, "figure", name=name, figure=found[name], page=page)
            files.whole_text(words, text)
        else:  # its set is of another chapter, or was run without this mode
            write_placeholder(picture, name)
            write_placeholder(words, name)


def write_provenance(notebook: Path, folder: Path) -> None:
    """Write what a chapter takes of a notebook without a page: its viewers, and the fold-out."""
    cells = json.loads(notebook.read_text(encoding="utf-8"))["cells"]
    shown = [output.get("data", {}) for cell in cells for output in cell.get("outputs", [])]
    viewers = ["".join(one["text/html"]) for one in shown if "text/html" in one]
    raw = "".join(f"```{{raw}} html\n{viewer}\n```\n\n" for viewer in viewers)
    _, found, block = "".join(cells[-1]["source"]).partition("<details")
    own = (
        f'<a class="tl-download" download="{notebook.name}" '
        f'href="_sources/executed/{notebook.name}">Executed notebook</a> '
    )
    block = block.replace("../", "").replace(_DOWNLOADS_MARK, own + _DOWNLOADS_MARK, 1)
    text = f"{raw}(data-of-{notebook.stem})=\n## Data and provenance\n\n{found}{block}\n"
    files.whole_text(folder / f"provenance-{notebook.stem}.md", text)


def _read_figures(notebook: Path) -> Iterator[tuple[str, dict[str, str]]]:
    for cell in json.loads(notebook.read_text(encoding="utf-8"))["cells"]:
        about = cell["metadata"].get("mystnb", {})
        pictures = [
            "".join(output["data"]["image/svg+xml"])
            for output in cell.get("outputs", [])
            if "image/svg+xml" in output.get("data", {})
        ]
        if "figure" in about and pictures:
            words = {"alt": about.get("image", {}).get("alt", ""), "set": notebook.stem}
            words |= {"picture": pictures[0], "caption": about["figure"]["caption"]}
            yield about["figure"]["name"], words
