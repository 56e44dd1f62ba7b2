"""Rows of the thesis's facts: tables of ``data/thesis``, each field read by its kind."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Collection, Iterator, Mapping
from typing import Any

from thesis_lib.facts.setups import data_folder

Kind = Callable[[str], object]
"""What a field's text means; it raises an error for what means nothing."""


def read_rows(name: str, kinds: Mapping[str, Kind]) -> Iterator[dict[str, Any]]:
    """Rows of a table whose field `id` no two rows share.

    Parameters
    ----------
    name : str
        The file.
    kinds : mapping
        Kind of each of its columns, in their order.

    Raises
    ------
    ValueError
        Naming the line and the field of a malformed row.
    """
    with (data_folder() / name).open(encoding="utf-8", newline="") as file:
        rows, seen = csv.DictReader(file, restkey="more"), set[str]()
        if rows.fieldnames != list(kinds):
            given = ", ".join(rows.fieldnames or ())
            raise ValueError(f"{name}, line 1: given {given}, allowed: {', '.join(kinds)}")
        for line, row in enumerate(rows, 2):
            values: dict[str, Any] = {}
            for field, text in row.items():
                given = f"{name}, line {line}: {field}: given {text!r}"
                try:
                    values[field] = kinds[field](_text(text))
                except (ArithmeticError, LookupError, TypeError, ValueError):
                    raise ValueError(given) from None
            if values["id"] in seen:
                raise ValueError(f"{name}, line {line}: id: given {row['id']!r} a second time")
            seen.add(values["id"])
            yield values


def _text(text: object) -> str:
    if not isinstance(text, str):  # of a row that is too short or too long
        raise TypeError
    return text


def some(text: str) -> str:
    """Any text but none."""
    if not text:
        raise ValueError
    return text


def finite(text: str) -> float:
    """A finite number."""
    if not math.isfinite(float(text)):
        raise ValueError
    return float(text)


def several(text: str) -> tuple[str, ...]:
    """Names with semicolons between them, or none."""
    return tuple(filter(None, text.split(";")))


def one_of(allowed: Collection[str]) -> Callable[[str], str]:
    """One of some texts."""

    def checked(text: str) -> str:
        if text not in allowed:
            raise ValueError
        return text

    return checked
