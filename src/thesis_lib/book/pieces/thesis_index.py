"""The pages of the index: tables of what of the thesis is where."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import partial
from pathlib import Path

from thesis_lib.facts.claims import IndexEntry, read_index
from thesis_lib.figure_sets.registry import STUDIES
from thesis_lib.files import project_root, whole_text
from thesis_lib.web.markdown import table

CHAPTERS = {**{number: number for number in "123456"}, "appendices": "ABCDEF"}


def chapter(name: str) -> str:
    """Markdown tables of the figures, tables and equations of a chapter of ``CHAPTERS``."""
    rows: dict[str, list[list[str]]] = {"figure": [], "table": [], "equation": []}
    for entry in read_index():
        kind, number = entry.item.split()
        if number[0] in CHAPTERS[name]:
            tests = "<br>".join(map(_code, entry.test)) or "–"
            rows[kind].append([number, _what(entry), _where(entry), tests])
    words = ("what", "where", "checked by")
    return "\n".join(table([kind, *words], of_kind) for kind, of_kind in rows.items() if of_kind)


def _what(entry: IndexEntry) -> str:
    ids = [anchor.removeprefix("errata#errata-") for anchor in entry.errata]
    links = ", ".join(f"[{one.upper()}](errata-{one})" for one in ids)
    return f"{entry.what} (errata {links})" if ids else entry.what


def _where(entry: IndexEntry) -> str:
    page = _link(entry.page) if entry.page else entry.reason
    lines = [page, *map(_reference, entry.function), *map(_code, entry.cube)]
    return "<br>".join(filter(None, lines))


def _code(text: str) -> str:
    """Program text whose long names may break after underscores and colons."""
    return f"<code>{text.replace('_', '_<wbr>').replace('::', '::<wbr>')}</code>"


def _link(page: str) -> str:
    """A link to a document of the book, or to an equation, label or heading in it."""
    document, _, anchor = page.partition("#")
    if document.startswith("executed/"):
        return f"[{STUDIES[document.removeprefix('executed/')].title}]({anchor or document})"
    text = (project_root() / "book" / f"{document}.md").read_text(encoding="utf-8")
    title = text.splitlines()[0].removeprefix("# ")
    if anchor.startswith("eq-"):
        return f"[{title}]({document}.md), equation {{eq}}`{anchor}`"
    label = re.search(rf"^(\({anchor}\)=|:name: {anchor})$", text, re.MULTILINE)
    return f"[{title}]({anchor if label else page.replace('#', '.md#')})"


def _reference(name: str) -> str:
    """A name in the library, linked to its room's page if it stands there."""
    short = name.removeprefix("thesis_lib.")
    room = project_root() / "book" / "api" / f"{short.split('.')[0].replace('_', '-')}.rst"
    api = room.read_text(encoding="utf-8") if room.is_file() else ""
    directive = r"^\.\. auto(?:module|class):: ([\w.]+).*\n((?:   :.*\n)*)"
    for target, options in re.findall(directive, api, re.MULTILINE):
        member = name.removeprefix(f"{target}.").split(".")[0]
        members = re.search(rf":members:( *$|.*\b{member}\b)", options, re.MULTILINE)
        if name == target or (name.startswith(f"{target}.") and members):
            return f"{{py:obj}}`{short} <{name}>`"
    return _code(short)


PIECES: dict[str, Callable[[], str]] = {f"thesis-index-{n}": partial(chapter, n) for n in CHAPTERS}


def write(folder: Path) -> None:
    """Write every piece of ``PIECES`` into a folder, as ``NAME.md``."""
    for name, piece in PIECES.items():
        whole_text(folder / f"{name}.md", piece())
