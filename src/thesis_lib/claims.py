"""What the thesis states, beside what we get.

One rule for every claim, set before looking: the 5–95 % band of the trials, widened by 1 point
(0.5 if the stated value is below 10 %), must meet the stated value or interval. Upper and lower
bounds are one-sided. A claim about all settings holds if it holds for each. Where the text excepts
one marker, the second-largest error is meant.
"""

from __future__ import annotations

import csv
import dataclasses
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
import xarray as xr

from thesis_lib import cubes
from thesis_lib.setups import data_folder

BAND = (0.05, 0.95)


@dataclass(frozen=True)
class Claim:
    """One figure that the thesis states.

    Parameters
    ----------
    id, figure_set, section, figure, panel, case : str
        Where it stands.
    mode : int
        Mode it speaks of.
    quantity : str
        ``mean_error``, ``max_point_error``, ``plane_error_xz`` or ``plane_error_yz``.
    values : tuple of float
        Values of the varied parameter; empty if it speaks of all settings of the case.
    relation : str
        ``about``, ``range``, ``max``, ``less_than`` or ``min``.
    low, high : float
        The stated interval in %; equal for a single value.
    excepted : int
        How many markers the text leaves out.
    pair_order : str
        Order of adding pairs that it speaks of; empty for the one that the study runs.
    """

    id: str
    figure_set: str
    section: str
    figure: str
    panel: str
    case: str
    mode: int
    quantity: str
    values: tuple[float, ...]
    relation: str
    low: float
    high: float
    excepted: int
    pair_order: str = ""

    @property
    def ends(self) -> tuple[float | None, float | None]:
        """The stated interval in %, with None at the open end of a bound."""
        upper, lower = self.relation in ("max", "less_than"), self.relation == "min"
        return None if upper else self.low, None if lower else self.high

    @property
    def stated(self) -> str:
        """The claim in a few characters, such as ``10–15 %`` or ``≤ 40 %``."""
        sign = {"max": "≤ ", "less_than": "< ", "min": "≥ "}.get(self.relation, "")
        interval = f"{self.low:g}" if self.low == self.high else f"{self.low:g}–{self.high:g}"
        return f"{sign}{interval} %"


@dataclass(frozen=True)
class Check:
    """A claim and what a cube says of it, in %, at that of its settings that is farthest off."""

    claim: Claim
    literal: float
    median: float
    low: float
    high: float
    inside: bool


def read_claims() -> list[Claim]:
    """The stated figures, from ``data/thesis/claims.csv``.

    Raises
    ------
    ValueError
        Naming the line and the field of a malformed row.
    """
    path = data_folder() / "claims.csv"
    kinds: dict[str, Callable[[str], object]] = {
        "mode": int, "low": float, "high": float, "excepted": int, "value": _values,
    }  # fmt: skip
    claims: list[Claim] = []
    with path.open(encoding="utf-8", newline="") as file:
        rows = csv.DictReader(file)
        expected = {f.name for f in dataclasses.fields(Claim)} - {"values"} | {"value"}
        if set(rows.fieldnames or ()) != expected:
            given = ", ".join(rows.fieldnames or ())
            raise ValueError(f"claims.csv, line 1: given {given}, allowed: {', '.join(expected)}")
        for row in rows:
            fields: dict[str, object] = dict(row)
            for field, kind in kinds.items():
                try:
                    fields[field] = kind(row[field])
                except (KeyError, TypeError, ValueError):
                    raise ValueError(
                        f"claims.csv, line {len(claims) + 2}: {field}: given {row.get(field)!r}"
                    ) from None
            fields["values"] = fields.pop("value")
            claims.append(Claim(**fields))  # type: ignore[arg-type]
    return claims


def _values(text: str) -> tuple[float, ...]:
    return () if text == "all" else tuple(float(value) for value in text.split(";"))


def errors(cube: xr.Dataset, claim: Claim) -> xr.DataArray:
    """The quantity that a claim speaks of, over its settings and all trials, in %."""
    where = cube["case"] == claim.case
    if claim.values:
        where &= cube["value"].isin(claim.values)
    if claim.pair_order:
        where &= cube["pair_order"] == claim.pair_order
    part = cube.isel(setting=np.flatnonzero(where.values)).sel(mode=claim.mode)
    if not claim.excepted:
        return cubes.errors(part)[claim.quantity]
    reference = part["reference_deflection"]
    error = abs(part["measured_deflection"].astype(float) - reference)
    ordered = np.sort(error / abs(reference).max() * 100, axis=error.get_axis_num("point"))
    kept = error.copy(data=ordered).isel(point=-1 - claim.excepted)
    return kept.drop_vars(["x", "y"], errors="ignore")


def meets(claim: Claim, low: float, high: float) -> bool:
    """Whether a band in % meets the claim by the rule at the top of this module."""
    margin = 0.5 if claim.high < 10 else 1.0
    below = low - margin <= claim.high
    above = high + margin >= claim.low
    if claim.relation in ("max", "less_than"):
        return below
    if claim.relation == "min":
        return above
    return below and above


def _gap(claim: Claim, low: float, high: float) -> float:
    """How far a band in % is from the stated interval, negative inside it."""
    least, most = claim.ends
    return max(-np.inf if most is None else low - most, -np.inf if least is None else least - high)


def check(cube: xr.Dataset, claims: Iterable[Claim]) -> list[Check]:
    """Hold claims against a cube; those whose settings or modes it lacks are left out."""
    checks = []
    for claim in claims:
        known = claim.mode in cube["mode"]
        values = errors(cube, claim) if known else None
        if values is None or values.sizes["setting"] == 0 or cube.sizes["trial"] < 2:
            continue
        drawn = values.isel(trial=slice(1, None))
        band = drawn.quantile(BAND, dim="trial").transpose("quantile", "setting").values
        gaps = [_gap(claim, low, high) for low, high in band.T]
        worst = int(np.argmax(gaps))
        low, high = (float(end) for end in band[:, worst])
        literal = float(values.isel(trial=0)[worst])
        median = float(np.median(drawn.isel(setting=worst)))
        checks.append(Check(claim, literal, median, low, high, meets(claim, low, high)))
    return checks


def claims_of(name: str) -> list[Claim]:
    """Claims about a figure set."""
    return [claim for claim in read_claims() if claim.figure_set == name]
