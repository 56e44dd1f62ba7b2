"""What the thesis states, beside what we get.

One rule for every claim, set before looking:

agrees
    The literal run is inside the stated value or interval, give or take half a unit of the last
    digit that is printed.
within scatter
    Else, the 5–95 % band of the trials, widened by 1 point (0.5 if the stated value is below 10 %),
    meets the stated value or interval.
differs
    Neither.
undefined
    There is nothing to compare with; the reason is told.

Upper and lower bounds are one-sided; a strict one, "less than", allows no rounding. A claim about
all settings holds if it holds for each. Where the text excepts one marker, the second-largest error
is meant.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

from thesis_lib.facts.rows import Kind, finite, one_of, read_rows, several, some

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
        """Chapter of the thesis."""
        return int(self.section[0])

    @property
    def ends(self) -> tuple[float | None, float | None]:
        """The stated interval in %, with None at the open end of a bound."""
        upper, lower = self.relation in ("max", "less_than"), self.relation == "min"
        return None if upper else self.low, None if lower else self.high

    def speaks_of(self, case: str, value: float, pair_order: str) -> bool:
        """Whether a setting with this case, varied value and order of pairs is meant."""
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
    """The stated values, from ``data/thesis/claims.csv``.

    Raises
    ------
    ValueError
        Naming the line and the field of a malformed row.
    """
    claims = []
    for row in read_rows("claims.csv", _KINDS):
        row["values"] = row.pop("value")
        (row["low"], low), (row["high"], high) = row["low"], row["high"]
        claims.append(Claim(**row, rounding=(low, high)))
    return claims


def half_digit(text: str) -> float:
    """Half a unit of the last digit of a number as it is printed.

    Examples
    --------
    >>> half_digit("10"), half_digit("1.2")
    (0.5, 0.05)
    """
    return 0.5 * 10.0 ** -len(text.partition(".")[2])


def _values(text: str) -> tuple[float, ...]:
    return () if text == "all" else tuple(map(finite, text.split(";")))


def _printed(text: str) -> tuple[float, float]:
    """A number, and half a unit of its last digit."""
    return finite(text), half_digit(text)


_KINDS: dict[str, Kind] = {
    "id": some,
    "figure_set": some,
    "section": some,
    "figure": str,
    "panel": str,
    "case": str,
    "mode": int,
    "quantity": one_of(QUANTITIES),
    "value": _values,
    "relation": one_of(RELATIONS),
    "low": _printed,
    "high": _printed,
    "excepted": int,
    "pair_order": str,
    "conflicts": several,
    "conflict_why": str,
}


@cache
def claims_of(name: str) -> tuple[Claim, ...]:
    """Claims about a figure set."""
    return tuple(claim for claim in read_claims() if claim.figure_set == name)
