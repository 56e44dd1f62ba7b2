"""Why claims of the thesis are not met, where a reason is known or was sought and not found."""

from __future__ import annotations

import re
from dataclasses import dataclass

from thesis_lib.facts.rows import Kind, read_rows, some

_PAGE = re.compile(r"[\w/-]+(#[\w-]+)?")


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
    kinds: dict[str, Kind] = {"id": some, "reason": _sentence, "page": _page}
    return {row["id"]: Reason(**row) for row in read_rows("reasons.csv", kinds)}


def _sentence(text: str) -> str:
    if not re.fullmatch(r"\S.*\.", text):
        raise ValueError
    return text


def _page(text: str) -> str:
    if not _PAGE.fullmatch(text):
        raise ValueError
    return text
