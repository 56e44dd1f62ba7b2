"""Every figure, table and equation of the thesis: where this project has it, or why it has not."""

from __future__ import annotations

import csv
import re
from dataclasses import dataclass

from thesis_lib.facts.setups import data_folder

ALLOWED = {  # in each column: a value as a pattern, and in words
    "item": (r"(figure|table|equation) \w\.\d+[ab]?", "figure, table or equation and a number"),
    "what": (r"\S.*", "a few words"),
    "page": (r"([\w/-]+(#[\w-]+)?)?", "a document of the book, perhaps with #anchor"),
    "function": (r"thesis_lib(\.\w+)+", "thesis_lib.module.name; …"),
    "cube": (r"[\w-]+: \w+(, \w+)*", "figure-set: variable, …; …"),
    "test": (r"tests/(\w+/)*test_\w+\.py::test_\w+", "tests/room/test_file.py::test_name; …"),
    "reason": (r"(\S.*)?", "a few words"),
    "errata": (r"errata#errata-[a-e]\d+", "errata#errata-b2; …"),
}
SEVERAL = ("function", "cube", "test", "errata")


@dataclass(frozen=True)
class Entry:
    """One figure, table or equation of the thesis."""

    item: str  #: Its name there, such as ``figure 3.4``
    what: str  #: What it shows, in our words
    page: str  #: Document of the book, such as ``beam#eq-modal``
    function: tuple[str, ...]  #: Names in the library
    cube: tuple[str, ...]  #: Variables of figure sets
    test: tuple[str, ...]  #: Names of tests
    reason: str  #: Why nothing here is about it
    errata: tuple[str, ...]  #: What is wrong with it


def read_index() -> list[Entry]:
    """Read the index, from ``data/thesis/index.csv``.

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
