"""Index of the thesis's figures, tables and equations, and the assumptions in its gaps."""

import re
from collections.abc import Callable
from functools import partial
from typing import Any

from thesis_lib.facts import claims, setups
from thesis_lib.figure_sets.registry import STUDIES
from thesis_lib.files import project_root
from thesis_lib.templates import render

CHAPTER_FILES = {**{number: number for number in "123456"}, "appendices": "ABCDEF"}


def tabulate_chapter(name: str) -> str:
    """Tabulate the figures, tables and equations of a chapter of :data:`CHAPTER_FILES`."""
    kinds: dict[str, list[tuple[Any, ...]]] = {"figure": [], "table": [], "equation": []}
    for entry in claims.read_index():
        kind, number = entry.item.split()
        if number[0] in CHAPTER_FILES[name]:
            errata = [one.removeprefix("errata#errata-") for one in entry.errata]
            page = _link_document(entry.page) if entry.page else entry.reason
            kinds[kind].append((number, entry, errata, page))
    return render(__file__, "thesis-index", kinds=kinds)


def _link_document(page: str) -> str:
    """Return a link to a document of the book, or to an equation, label or heading in it."""
    document, _, anchor = page.partition("#")
    if document.startswith("executed/"):
        return f"[{STUDIES[document.removeprefix('executed/')].title}]({anchor or document})"
    text = (project_root() / "book" / f"{document}.md").read_text(encoding="utf-8")
    title = text.splitlines()[0].removeprefix("# ")
    if anchor.startswith("eq-"):
        return f"[{title}]({document}.md), equation {{eq}}`{anchor}`"
    label = re.search(rf"^(\({anchor}\)=|:name: {anchor})$", text, re.MULTILINE)
    return f"[{title}]({anchor if label else page.replace('#', '.md#')})"


CHAPTER_SUBJECTS = {  # subjects by piece; a gap goes to the first match
    "assumptions-simulation": ("beam", "plate"),
    "assumptions-sound": ("sound",),
    "assumptions-experiment": ("experiment", "lab"),
}


def format_assumptions(piece: str) -> str:
    """List the gaps of a piece: question, assumption, reason, and the parameter to vary it."""
    items = [
        item
        for item in setups.list_assumptions()
        if piece == next(k for k, of in CHAPTER_SUBJECTS.items() if {*of} & {*item["subjects"]})
    ]
    return render(__file__, "assumptions", items=items)


PIECES: dict[str, Callable[[], str]] = {
    **{f"thesis-index-{name}": partial(tabulate_chapter, name) for name in CHAPTER_FILES},
    **{name: partial(format_assumptions, name) for name in CHAPTER_SUBJECTS},
}
