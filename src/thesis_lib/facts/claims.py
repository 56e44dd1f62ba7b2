"""Claims of the thesis, read from tables of ``data/thesis``: values, trends, reasons.

A row is a dataclass, whose types say what its fields may be; a malformed one is refused with its
line. The rules for judging values stand in :mod:`thesis_lib.ledger.verdicts`, those for trends in
:mod:`thesis_lib.ledger.trends`.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, fields
from functools import cache
from typing import Annotated, Literal, TypeVar

from pydantic import AfterValidator, BeforeValidator, Field, TypeAdapter, ValidationError

from thesis_lib.facts.setups import data_folder

Row = TypeVar("Row")
Text = Annotated[str, Field(min_length=1)]
Integer = Annotated[int, BeforeValidator(int)]  # of digits alone: pydantic takes 1.0, too
Number = Annotated[float, Field(allow_inf_nan=False)]
Names = Annotated[tuple[str, ...], BeforeValidator(lambda text: [*filter(None, text.split(";"))])]
SomeNames = Annotated[Names, Field(min_length=1)]


def matching(pattern: str) -> AfterValidator:
    """Return the check that a text matches a regular expression."""

    def check(text: str) -> str:
        if not re.fullmatch(pattern, text):
            raise ValueError(text)
        return text

    return AfterValidator(check)


def list_of(pattern: str) -> BeforeValidator:
    """Return the reader of texts with "; " between them that all match a regular expression."""
    check = matching(pattern).func
    return BeforeValidator(lambda text: [*map(check, text.split("; "))] if text else [])  # type: ignore[arg-type]


def read_rows(
    name: str,
    model: type[Row],
    derived: Mapping[str, Callable[[Mapping[str, str]], object]] | None = None,
) -> Iterator[Row]:
    """Read the rows of a table of ``data/thesis``, of which no two share the first field.

    Parameters
    ----------
    name : str
        The file.
    model : type
        Dataclass of a row; its fields are the columns in their order, and their types what is
        allowed.
    derived : mapping, optional
        Fields that are no columns, and how they follow from a row.

    Raises
    ------
    ValueError
        Naming the line and the field of a malformed row.
    """
    derived = derived or {}
    columns = [COLUMN_NAMES.get(f.name, f.name) for f in fields(model) if f.name not in derived]  # type: ignore[arg-type]
    check = TypeAdapter(model).validate_python
    with (data_folder() / name).open(encoding="utf-8", newline="") as file:
        rows, seen = csv.DictReader(file, restkey="more"), set[str]()
        if rows.fieldnames != columns:
            given = ", ".join(rows.fieldnames or ())
            raise ValueError(f"{name}, line 1: given {given}, allowed: {', '.join(columns)}")
        for line, row in enumerate(rows, 2):
            # A row that is too short has no text for a column; one that is too long has more.
            bad = next((f for f, text in row.items() if not isinstance(text, str)), "")
            try:
                found = None if bad else check(row | {f: of(row) for f, of in derived.items()})
            except ValidationError as error:
                bad = str(error.errors(include_url=False)[0]["loc"][0])
            if found is None or bad:
                raise ValueError(f"{name}, line {line}: {bad}: given {row[bad]!r}")
            key = row[columns[0]]
            if key in seen:
                raise ValueError(f"{name}, line {line}: {columns[0]}: given {key!r} a second time")
            seen.add(key)
            yield found


COLUMN_NAMES = {"values": "value"}  # columns that are not called as their fields
Relation = Literal["about", "range", "max", "less_than", "min"]
Quantity = Literal["mean_error", "max_point_error", "plane_error_xz", "plane_error_yz"]

Values = Annotated[
    tuple[Number, ...],
    BeforeValidator(lambda text: () if text == "all" else text.split(";")),
    Field(alias=COLUMN_NAMES["values"]),
]


@dataclass(frozen=True)
class Claim:
    """One figure that the thesis states."""

    #: Where it stands
    id: Text
    figure_set: Text
    section: Text
    figure: str
    panel: str
    case: str
    mode: Integer  #: Mode it speaks of
    quantity: Quantity  #: Which error
    #: Values of the varied parameter; empty if it speaks of all settings of the case
    values: Values
    relation: Relation  #: How the interval is meant
    #: The stated interval in %; equal for a single value
    low: Number
    high: Number
    excepted: Integer  #: How many markers the text leaves out
    #: Order of adding pairs that it speaks of; empty for the one that the study runs
    pair_order: str = ""
    #: Half a unit of the last printed digit of `low` and of `high`
    rounding: tuple[float, float] = (0.0, 0.0)
    conflicts: Names = ()  #: Ids of claims that cannot be true together with this one
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
    ends = "low", "high"
    rounding = {"rounding": lambda row: [half_digit(row[end]) for end in ends]}
    return [*read_rows("claims.csv", Claim, rounding)]


def half_digit(text: str) -> float:
    """Return half a unit of the last digit of a number as it is printed.

    Examples
    --------
    >>> half_digit("10"), half_digit("1.2")
    (0.5, 0.05)
    """
    return 0.5 * 10.0 ** -len(text.partition(".")[2])


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


Modes = Annotated[tuple[Integer, ...], BeforeValidator(lambda text: text.split(";"))]


def _check_relation(text: str) -> str:
    name, _, argument = text.partition(" ")
    if name not in RELATION_WORDS or not re.fullmatch(RELATION_WORDS[name], argument):
        raise ValueError(text)
    return text


@dataclass(frozen=True)
class Trend:
    """One trend that the thesis states."""

    id: Text  #: Its name
    chapter: Integer  #: Chapter of the thesis
    section: Text  #: Section of the thesis
    cases: Names  #: Cases it speaks of; none means all of the source
    modes: Modes  #: Modes it speaks of
    quantities: SomeNames  #: Errors it speaks of
    kind: str  #: How it goes, such as ``increasing_with``
    parameter: str  #: What varies
    words: Text  #: What it says
    source: SomeNames  #: Figure sets, or runs of the ledger's own, that it is judged by
    test: Annotated[str, AfterValidator(_check_relation)]  #: Relation and its argument


def read_trends() -> list[Trend]:
    """Read the stated trends, from ``data/thesis/trends.csv``, refused line by line."""
    return [*read_rows("trends.csv", Trend)]


_PAGE_PATTERN = r"[\w/-]+(#[\w-]+)?"  # a document of the book, perhaps with an anchor


@dataclass(frozen=True)
class Reason:
    """Why the book gets something else than a claim of the thesis."""

    id: Text  #: Name of the claim
    reason: Annotated[str, matching(r"\S.*\.")]  #: One sentence
    #: Document of the book that tells more, such as ``errata#errata-a6``
    page: Annotated[str, matching(_PAGE_PATTERN)]


def read_reasons() -> dict[str, Reason]:
    """Read the reasons by the names of their claims, from ``data/thesis/reasons.csv``.

    Raises
    ------
    ValueError
        Naming the line and the field of a malformed row.
    """
    return {one.id: one for one in read_rows("reasons.csv", Reason)}


@dataclass(frozen=True)
class IndexEntry:
    """One figure, table or equation of the thesis: its place here, or why it has none."""

    #: Name in the thesis, such as ``figure 3.4``
    item: Annotated[str, matching(r"(figure|table|equation) \w\.\d+[ab]?")]
    what: Annotated[str, matching(r"\S.*")]  #: Subject, in our words
    #: Document of the book, such as ``beam#eq-modal``
    page: Annotated[str, matching(rf"({_PAGE_PATTERN})?")]
    function: Annotated[tuple[str, ...], list_of(r"thesis_lib(\.\w+)+")]  #: Names in the library
    #: Variables of figure sets, such as ``beam-distance: mean_error``
    cube: Annotated[tuple[str, ...], list_of(r"[\w-]+: \w+(, \w+)*")]
    #: Names of tests
    test: Annotated[tuple[str, ...], list_of(r"tests/(\w+/)*test_\w+\.py::test_\w+")]
    reason: Annotated[str, matching(r"(\S.*)?")]  #: Why nothing here is about it
    errata: Annotated[tuple[str, ...], list_of(r"errata#errata-[a-e]\d+")]  #: Errata on it


def read_index() -> list[IndexEntry]:
    """Read the index, from ``data/thesis/index.csv``, refused line by line."""
    entries = [*read_rows("index.csv", IndexEntry)]
    for one in entries:
        if bool(one.reason) == any((one.page, one.function, one.cube, one.test)):
            allowed = "one if there is no page, function, cube or test, else none"
            raise ValueError(
                f"index.csv, {one.item}: reason: given {one.reason!r}, allowed: {allowed}"
            )
    return entries
