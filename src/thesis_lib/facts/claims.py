"""Claims of the thesis, read from tables of ``data/thesis``: values, trends, reasons.

Each field of a row is read by its kind; a malformed one is refused with its line. The rules for
judging values stand in :mod:`thesis_lib.ledger.verdicts`, those for trends in
:mod:`thesis_lib.ledger.trends`.
"""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

from thesis_lib.facts.setups import data_folder

Kind = Callable[[str], object]
"""What a field's text means; it raises an error for what means nothing."""


def read_rows(name: str, kinds: Mapping[str, Kind], key: str = "id") -> Iterator[dict[str, Any]]:
    """Read the rows of a table of which no two share a key.

    Parameters
    ----------
    name : str
        The file.
    kinds : mapping
        Kind of each of its columns, in their order.
    key : str
        Column whose fields all differ.

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
            if values[key] in seen:
                raise ValueError(f"{name}, line {line}: {key}: given {row[key]!r} a second time")
            seen.add(values[key])
            yield values


def _text(text: object) -> str:
    if not isinstance(text, str):  # of a row that is too short or too long
        raise TypeError
    return text


def read_text(text: str) -> str:
    """Read a text that is not empty."""
    if not text:
        raise ValueError
    return text


def read_number(text: str) -> float:
    """Read a finite number."""
    if not math.isfinite(float(text)):
        raise ValueError
    return float(text)


def read_names(text: str) -> tuple[str, ...]:
    """Read names with semicolons between them, or none."""
    return tuple(filter(None, text.split(";")))


def one_of(allowed: Collection[str]) -> Callable[[str], str]:
    """Return a reader of one of some texts."""

    def checked(text: str) -> str:
        if text not in allowed:
            raise ValueError
        return text

    return checked


def pattern_reader(pattern: str) -> Callable[[str], str]:
    """Return a reader of texts that match a regular expression."""

    def checked(text: str) -> str:
        if not re.fullmatch(pattern, text):
            raise ValueError
        return text

    return checked


def list_reader(pattern: str) -> Callable[[str], tuple[str, ...]]:
    """Return a reader of texts with "; " between them that all match a regular expression."""
    one = pattern_reader(pattern)
    return lambda text: tuple(map(one, text.split("; "))) if text else ()


RELATIONS = ("about", "range", "max", "less_than", "min")
QUANTITIES = ("mean_error", "max_point_error", "plane_error_xz", "plane_error_yz")


@dataclass(frozen=True)
class Claim:
    """One figure that the thesis states."""

    #: Where it stands
    id: str
    figure_set: str
    section: str
    figure: str
    panel: str
    case: str
    mode: int  #: Mode it speaks of
    quantity: str  #: ``mean_error``, ``max_point_error``, ``plane_error_xz`` or ``plane_error_yz``
    #: Values of the varied parameter; empty if it speaks of all settings of the case
    values: tuple[float, ...]
    relation: str  #: ``about``, ``range``, ``max``, ``less_than`` or ``min``
    #: The stated interval in %; equal for a single value
    low: float
    high: float
    excepted: int  #: How many markers the text leaves out
    #: Order of adding pairs that it speaks of; empty for the one that the study runs
    pair_order: str = ""
    #: Half a unit of the last printed digit of `low` and of `high`
    rounding: tuple[float, float] = (0.0, 0.0)
    conflicts: tuple[str, ...] = ()  #: Ids of claims that cannot be true together with this one
    conflict_why: str = ""  #: Why not

    @property
    def chapter(self) -> int:
        """Return the chapter of the thesis."""
        return int(self.section[0])

    @property
    def ends(self) -> tuple[float | None, float | None]:
        """The stated interval in %, with None at the open end of a bound."""
        upper, lower = self.relation in ("max", "less_than"), self.relation == "min"
        return None if upper else self.low, None if lower else self.high

    def speaks_of(self, case: str, value: float, pair_order: str) -> bool:
        """Return whether a setting with this case, varied value and order of pairs is meant."""
        return (
            case == self.case
            and (not self.values or value in self.values)
            and (not self.pair_order or pair_order == self.pair_order)
        )

    @property
    def stated(self) -> str:
        """The claim in a few characters, such as ``10–15 %`` or ``≤ 40 %``."""
        sign = {"max": "≤ ", "less_than": "< ", "min": "≥ "}.get(self.relation, "")
        interval = f"{self.low:g}" if self.low == self.high else f"{self.low:g}–{self.high:g}"
        return f"{sign}{interval} %"


def read_claims() -> list[Claim]:
    """Read the claimed values, from ``data/thesis/claims.csv``.

    Raises
    ------
    ValueError
        Naming the line and the field of a malformed row.
    """
    claims = []
    for row in read_rows("claims.csv", _CLAIM_KINDS):
        row["values"] = row.pop("value")
        (row["low"], low), (row["high"], high) = row["low"], row["high"]
        claims.append(Claim(**row, rounding=(low, high)))
    return claims


def half_digit(text: str) -> float:
    """Return half a unit of the last digit of a number as it is printed.

    Examples
    --------
    >>> half_digit("10"), half_digit("1.2")
    (0.5, 0.05)
    """
    return 0.5 * 10.0 ** -len(text.partition(".")[2])


def _values(text: str) -> tuple[float, ...]:
    return () if text == "all" else tuple(map(read_number, text.split(";")))


def _read_printed(text: str) -> tuple[float, float]:
    """Read a number, and half a unit of its last digit."""
    return read_number(text), half_digit(text)


_CLAIM_KINDS: dict[str, Kind] = {
    "id": read_text,
    "figure_set": read_text,
    "section": read_text,
    "figure": str,
    "panel": str,
    "case": str,
    "mode": int,
    "quantity": one_of(QUANTITIES),
    "value": _values,
    "relation": one_of(RELATIONS),
    "low": _read_printed,
    "high": _read_printed,
    "excepted": int,
    "pair_order": str,
    "conflicts": read_names,
    "conflict_why": str,
}


@cache
def claims_of(name: str) -> tuple[Claim, ...]:
    """Return the claims about a figure set."""
    return tuple(claim for claim in read_claims() if claim.figure_set == name)


_NUMBER_PATTERN = r"\d+(\.\d+)?"
_INTERVALS_PATTERN = (
    rf"{_NUMBER_PATTERN} {_NUMBER_PATTERN}(?: {_NUMBER_PATTERN} {_NUMBER_PATTERN})*"
)
_ONE_SIDED = rf"{_NUMBER_PATTERN}( first| last)?"
RELATION_WORDS = {  # what is stated, and what has to be said with it
    "falls": "", "rises": "", "falls_steadily": "", "falls_irregularly": "",
    "flat": rf"({_INTERVALS_PATTERN})?", "within": _INTERVALS_PATTERN,
    "no_trend": "", "mostly_no_trend": "", "same_pattern": "", "same_trends": "",
    "below": _ONE_SIDED, "at_most": _ONE_SIDED, "above": rf"{_NUMBER_PATTERN} first",
    "peaks": _NUMBER_PATTERN, "highest_last": "", "modes_alike": "",
    "worst_mode": r"\d+", "best_mode": r"\d+", "planes_alike": r"((XZ|YZ) \d \d)?",
    "like_case": r"\S+( last)?", "below_case": r"\S+ (first|common)", "gentler": r"\S+",
    "best_case": r".+", "unrelated": r"\w+",
}  # fmt: skip


@dataclass(frozen=True)
class Trend:
    """One trend that the thesis states."""

    id: str  #: Its name
    chapter: int  #: Chapter of the thesis
    section: str  #: Section of the thesis
    cases: tuple[str, ...]  #: Cases it speaks of; none means all of the source
    modes: tuple[int, ...]  #: Modes it speaks of
    quantities: tuple[str, ...]  #: Errors it speaks of
    kind: str  #: How it goes, such as ``increasing_with``
    parameter: str  #: What varies
    words: str  #: What it says
    source: tuple[str, ...]  #: Figure sets, or runs of the ledger's own, that it is judged by
    test: str  #: One of ``WORDS``, and its argument


def read_trends() -> list[Trend]:
    """Read the stated trends, from ``data/thesis/trends.csv``, refused line by line."""
    kinds: dict[str, Kind] = {
        "id": read_text,
        "chapter": int,
        "section": read_text,
        "cases": read_names,
        "modes": _numbers,
        "quantities": _some_of,
        "kind": str,
        "parameter": str,
        "words": read_text,
        "source": _some_of,
        "test": _read_known,
    }
    return [Trend(**row) for row in read_rows("trends.csv", kinds)]


def _some_of(text: str) -> tuple[str, ...]:
    return read_names(read_text(text))


def _numbers(text: str) -> tuple[int, ...]:
    return tuple(map(int, _some_of(text)))


def _read_known(text: str) -> str:
    name, _, argument = text.partition(" ")
    if name not in RELATION_WORDS or not re.fullmatch(RELATION_WORDS[name], argument):
        raise ValueError(text)
    return text


_PAGE_PATTERN = r"[\w/-]+(#[\w-]+)?"  # a document of the book, perhaps with an anchor


@dataclass(frozen=True)
class Reason:
    """Why the book gets something else than a claim of the thesis."""

    id: str  #: Name of the claim
    reason: str  #: One sentence
    page: str  #: Document of the book that tells more, such as ``errata#errata-a6``


def read_reasons() -> dict[str, Reason]:
    """Read the reasons by the names of their claims, from ``data/thesis/reasons.csv``.

    Raises
    ------
    ValueError
        Naming the line and the field of a malformed row.
    """
    kinds: dict[str, Kind] = {
        "id": read_text,
        "reason": pattern_reader(r"\S.*\."),
        "page": pattern_reader(_PAGE_PATTERN),
    }
    return {row["id"]: Reason(**row) for row in read_rows("reasons.csv", kinds)}


@dataclass(frozen=True)
class IndexEntry:
    """One figure, table or equation of the thesis: its place here, or why it has none."""

    item: str  #: Name in the thesis, such as ``figure 3.4``
    what: str  #: Subject, in our words
    page: str  #: Document of the book, such as ``beam#eq-modal``
    function: tuple[str, ...]  #: Names in the library
    cube: tuple[str, ...]  #: Variables of figure sets, such as ``beam-distance: mean_error``
    test: tuple[str, ...]  #: Names of tests
    reason: str  #: Why nothing here is about it
    errata: tuple[str, ...]  #: Errata on it


def read_index() -> list[IndexEntry]:
    """Read the index, from ``data/thesis/index.csv``, refused line by line."""
    kinds: dict[str, Kind] = {
        "item": pattern_reader(r"(figure|table|equation) \w\.\d+[ab]?"),
        "what": pattern_reader(r"\S.*"),
        "page": pattern_reader(rf"({_PAGE_PATTERN})?"),
        "function": list_reader(r"thesis_lib(\.\w+)+"),
        "cube": list_reader(r"[\w-]+: \w+(, \w+)*"),
        "test": list_reader(r"tests/(\w+/)*test_\w+\.py::test_\w+"),
        "reason": pattern_reader(r"(\S.*)?"),
        "errata": list_reader(r"errata#errata-[a-e]\d+"),
    }
    entries = [IndexEntry(**row) for row in read_rows("index.csv", kinds, "item")]
    for one in entries:
        if bool(one.reason) == any((one.page, one.function, one.cube, one.test)):
            allowed = "one if there is no page, function, cube or test, else none"
            raise ValueError(
                f"index.csv, {one.item}: reason: given {one.reason!r}, allowed: {allowed}"
            )
    return entries
