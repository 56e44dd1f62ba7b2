"""Judge claimed values by one rule: which interval is met.

The rule holds for every claim and was set before looking:

agrees
    The nominal run is inside the stated value or interval, give or take half a unit of the last
    digit that is printed.
within scatter
    Else, the 5–95 % band of the trials, widened by 1 point (0.5 if the stated value is below 10 %),
    meets the stated value or interval.
differs
    Neither.
undefined
    There is nothing to compare with; a reason is given.

Upper and lower bounds are one-sided; a strict one, "less than", allows no rounding. A claim about
all settings holds if it holds for each. Where the text excepts one marker, the second-largest error
is meant.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
import xarray as xr

from thesis_lib.arrays import Array, IntArray
from thesis_lib.facts.claims import Claim
from thesis_lib.studies import cubes

WIDENING_POINTS, WIDENING_POINTS_BELOW_10 = 1.0, 0.5  # points by which the band is widened
UNCHANGED = "no material change"  # of trends alone
VERDICTS = ("agrees", "within scatter", "differs", UNCHANGED, "undefined")


@dataclass(frozen=True)
class Check:
    """A claim and what a cube says of it, in %, at that of its settings that is farthest off."""

    claim: Claim  #: What is stated
    #: The nominal run, and median and 5–95 % band of the trials
    literal: float
    median: float
    low: float
    high: float
    inside: bool  #: Whether the band meets the claim in all of its settings
    exact: bool  #: Whether the nominal run does, to the printed digits

    @property
    def verdict(self) -> str:
        """Return one of ``VERDICTS``."""
        return "agrees" if self.exact else "within scatter" if self.inside else "differs"

    @property
    def ratio(self) -> float:
        """The median over the nearest value that the claim allows: 1 inside the stated interval."""
        least, most = self.claim.ends
        nearest = self.median if least is None else max(self.median, least)
        return self.median / (nearest if most is None else min(nearest, most))


def _settings(cube: xr.Dataset, claim: Claim) -> IntArray:
    """Return the indices of the settings that a claim speaks of."""
    columns = (cube.variables[n].values.tolist() for n in ("case", "value", "pair_order"))
    return np.flatnonzero([claim.speaks_of(*one) for one in zip(*columns, strict=True)])


def claim_errors(cube: xr.Dataset, claim: Claim) -> xr.DataArray:
    """Return the quantity that a claim speaks of, over its settings and all trials, in %."""
    here = {
        "setting": _settings(cube, claim),
        "mode": cube.variables["mode"].values.tolist().index(claim.mode),
    }
    if not claim.excepted:
        return cubes.cube_error(cube, claim.quantity).isel(here)
    return point_errors(cube.isel(here)).isel(point=-1 - claim.excepted)


def point_errors(cube: xr.Dataset) -> xr.DataArray:
    """Return the errors of the markers in %, sorted, over settings, modes and trials."""
    reference = cube["reference_deflection"]
    error = abs(cube["measured_deflection"].astype(float) - reference)
    error = error / abs(reference).max("point") * 100
    ordered = np.sort(error.values, axis=error.get_axis_num("point"))
    return error.copy(data=ordered).drop_vars(["x", "y"], errors="ignore")


def claim_from_errors(claim: Claim, values: Array) -> Claim:
    """Return the claim as a thesis with these errors (in %) in the settings would have printed it.

    An interval from the least to the largest, an upper bound rounded up, a lower one down; one
    value is the middle. All with the digits of the real claim.
    """
    low, high = np.min(values), np.max(values)
    digit = 2 * np.array(claim.rounding)
    if claim.relation == "about":
        low = high = (low + high) / 2
    if claim.relation == "less_than":
        high = high + digit[1] / 2  # so that rounding leaves it above
    up = np.ceil if claim.relation in ("max", "less_than") else np.rint
    down = np.floor if claim.relation == "min" else np.rint
    ends = digit[0] * down(low / digit[0]), digit[1] * up(high / digit[1])
    return replace(claim, low=float(ends[0]), high=float(ends[1]))


def meets_claim(claim: Claim, low: float, high: float) -> bool:
    """Return whether a band in % meets the claim by the rule of this module."""
    margin = WIDENING_POINTS_BELOW_10 if claim.high < 10 else WIDENING_POINTS
    return bool(_gap(claim, low, high) <= margin)


def _exact(claim: Claim, literal: float) -> bool:
    """Return whether a nominal run equals the claim to the printed digits."""
    least, most = claim.ends
    if claim.relation == "less_than":
        return literal < claim.high
    above = least is None or literal >= least - claim.rounding[0]
    return above and (most is None or literal <= most + claim.rounding[1])


def _gap(claim: Claim, low: float, high: float) -> float:
    """Return the distance of a band in % from the claimed interval, negative inside it."""
    least, most = claim.ends
    return max(-np.inf if most is None else low - most, -np.inf if least is None else least - high)


def check_claims(cube: xr.Dataset, claims: Iterable[Claim]) -> list[Check]:
    """Hold claims against a cube; those whose settings or modes it lacks are left out."""
    plain = cube.reset_coords()  # each coordinate of errors costs as much as judging them
    return [found for claim in claims if isinstance(found := judge_claim(plain, claim), Check)]


def judge_claim(cube: xr.Dataset, claim: Claim) -> Check | str:
    """Hold one claim against a cube, or say in a few words why that cannot be done."""
    if claim.mode not in cube.variables["mode"].values:
        return f"mode {claim.mode} was not run"
    found = set(cube.variables["value"].values[_settings(cube, claim)].tolist())
    missing = [f"{value:g}" for value in claim.values if value not in found]
    if missing or not found:
        return f"case {claim.case} was not run" + (f" at {', '.join(missing)}" if missing else "")
    if cube.sizes["trial"] < 2:
        return "the cube has no random trials"
    values = claim_errors(cube, claim).transpose("setting", "trial").values
    first, drawn = values[:, 0], values[:, 1:]
    band = np.quantile(drawn, cubes.BAND_QUANTILES[::2], axis=1)
    if not (np.isfinite(first).all() and np.isfinite(band).all()):
        return "the reference is zero: a nodal plane"
    worst = int(np.argmax([_gap(claim, low, high) for low, high in band.T]))
    low, high = (float(end) for end in band[:, worst])
    exact = all(_exact(claim, float(value)) for value in first)
    median = float(np.median(drawn[worst]))
    inside = meets_claim(claim, low, high)
    return Check(claim, float(first[worst]), median, low, high, inside, exact)
