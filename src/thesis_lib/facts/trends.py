"""What the thesis says of trends, tested in expectation.

A trend is a statement on expected errors: the mean of a setting's error over the random shifts of
the pixel grids. It is tested on resamples of the trials, the same in every setting; the share of
resamples in which it holds is its *confidence*. The share of single trials in which it holds tells
how often somebody with one run, such as the thesis, would see it.

A trend that says that an error falls or rises has *effects*, too: by what factor the expected
error changes from the first to the last setting, of all the errors that it names the one that
changes least in the stated direction, and the one that changes most. If no expected error changes
by more than the smallest effect that counts, ``MATERIAL``, it is no material change, however sure
its sign. If an expected error goes the other way by more than that between two neighbouring
settings, the trend is not monotonic, which is said beside the verdict.

What the words mean is set in ``trend_tests.py``, once for all trends.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from thesis_lib.facts.rows import Kind, read_rows, several, some

_NUMBER = r"\d+(\.\d+)?"
_INTERVALS = rf"{_NUMBER} {_NUMBER}(?: {_NUMBER} {_NUMBER})*"
_ONE_SIDED = rf"{_NUMBER}( first| last)?"
WORDS = {  # what is stated, and what has to be said with it
    "falls": "", "rises": "", "falls_steadily": "", "falls_irregularly": "",
    "flat": rf"({_INTERVALS})?", "within": _INTERVALS,
    "no_trend": "", "mostly_no_trend": "", "same_pattern": "", "same_trends": "",
    "below": _ONE_SIDED, "at_most": _ONE_SIDED, "above": rf"{_NUMBER} first",
    "peaks": _NUMBER, "highest_last": "", "modes_alike": "",
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
    """The stated trends, from ``data/thesis/trends.csv``, refused line by line."""
    kinds: dict[str, Kind] = {
        "id": some,
        "chapter": int,
        "section": some,
        "cases": several,
        "modes": _numbers,
        "quantities": _some_of,
        "kind": str,
        "parameter": str,
        "words": some,
        "source": _some_of,
        "test": _known,
    }
    return [Trend(**row) for row in read_rows("trends.csv", kinds)]


def _some_of(text: str) -> tuple[str, ...]:
    return several(some(text))


def _numbers(text: str) -> tuple[int, ...]:
    return tuple(map(int, _some_of(text)))


def _known(text: str) -> str:
    name, _, argument = text.partition(" ")
    if name not in WORDS or not re.fullmatch(WORDS[name], argument):
        raise ValueError(text)
    return text
