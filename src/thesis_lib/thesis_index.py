"""Every figure, table and equation of the thesis: where this project has it, or why it has not."""

from __future__ import annotations

import csv
import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from thesis_lib.files import project_root, whole_text
from thesis_lib.markdown import table
from thesis_lib.parameters import STUDIES
from thesis_lib.setups import data_folder

ALLOWED = {  # in each column: a value as a pattern, and in words
    "item": (r"(figure|table|equation) \w\.\d+[ab]?", "figure, table or equation and a number"),
    "what": (r"\S.*", "a few words"),
    "page": (r"([\w/-]+(#[\w-]+)?)?", "a document of the book, perhaps with #anchor"),
    "function": (r"thesis_lib(\.\w+)+", "thesis_lib.module.name; …"),
    "cube": (r"[\w-]+: \w+(, \w+)*", "figure-set: variable, …; …"),
    "test": (r"tests/test_\w+\.py::test_\w+", "tests/test_file.py::test_name; …"),
    "reason": (r"(\S.*)?", "a few words"),
    "errata": (r"errata#errata-[a-e]\d+", "errata#errata-b2; …"),
}
SEVERAL = ("function", "cube", "test", "errata")
CHAPTERS = {**{number: number for number in "123456"}, "appendices": "ABCDEF"}


@dataclass(frozen=True)
class Entry:
    """One figure, table or equation of the thesis.

    Parameters
    ----------
    item, what : str
        Its name there, such as ``figure 3.4``, and what it shows, in our words.
    page, reason : str
        Document of the book, such as ``beam#eq-modal``; or why nothing here is about it.
    function, cube, test, errata : tuple of str
        Names in the library, variables of figure sets, tests, and what is wrong with it.
    """

    item: str
    what: str
    page: str
    function: tuple[str, ...]
    cube: tuple[str, ...]
    test: tuple[str, ...]
    reason: str
    errata: tuple[str, ...]


def read_index() -> list[Entry]:
    """The index, from ``data/thesis/index.csv``.

    Raises
    ------
    ValueError
        Naming the line and the field of a malformed row.
    """
    with (data_folder() / "index.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.reader(file))
    for line, row in enumerate(rows, 1):
        if rows[0] != list(ALLOWED) or len(row) != len(ALLOWED):
            raise _refusal(line, "columns", ",".join(row), ",".join(ALLOWED))
    return [_entry(line, row) for line, row in enumerate(rows[1:], 2)]


def _refusal(line: int, column: str, given: object, allowed: str) -> ValueError:
    return ValueError(f"index.csv, line {line}: {column}: given {given!r}, allowed: {allowed}")


def _entry(line: int, cells: list[str]) -> Entry:
    values: dict[str, object] = {}
    for column, text in zip(ALLOWED, cells, strict=True):
        parts = (text.split("; ") if text else []) if column in SEVERAL else [text]
        if not all(re.fullmatch(ALLOWED[column][0], part) for part in parts):
            raise _refusal(line, column, text, ALLOWED[column][1])
        values[column] = tuple(parts) if column in SEVERAL else text
    if bool(values["reason"]) == any(values[c] for c in ("page", "function", "cube", "test")):
        words = "one if there is no page, function, cube or test, else none"
        raise _refusal(line, "reason", values["reason"], words)
    return Entry(**values)  # type: ignore[arg-type]


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


def _what(entry: Entry) -> str:
    ids = [anchor.removeprefix("errata#errata-") for anchor in entry.errata]
    links = ", ".join(f"[{one.upper()}](errata-{one})" for one in ids)
    return f"{entry.what} (errata {links})" if ids else entry.what


def _where(entry: Entry) -> str:
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
    """A name in the library, linked to the library's page if it stands there."""
    short = name.removeprefix("thesis_lib.")
    api = (project_root() / "book" / "api.md").read_text(encoding="utf-8")
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
