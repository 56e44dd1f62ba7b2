"""What of a cube a figure shows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr

from thesis_lib.arrays import Array
from thesis_lib.facts.claims import Claim, claims_of
from thesis_lib.studies import cubes


def select(cube: xr.Dataset, case: str, mode: int) -> xr.Dataset:
    """The settings of one case and one mode."""
    rows = np.flatnonzero(cube["case"].values == case)
    return cube.isel(setting=rows).sel(mode=mode)


def best_and_worst(part: xr.Dataset) -> list[int]:
    """Indices of the settings with the least and the largest typical mean error."""
    name = "mean_error" if "mean_error" in part else "deflection_error"
    order = np.argsort(cubes.typical(part[name]), kind="stable")
    return [int(order[0])] if len(order) == 1 else [int(order[0]), int(order[-1])]


def ranking(part: xr.Dataset) -> tuple[str, str]:
    """What the first and the last of :func:`best_and_worst` are called, by what they are ranked."""
    by = " by median" if part.sizes["trial"] > 1 else ""
    return f"best{by}", f"worst{by}"


def stated(
    cube: xr.Dataset, case: str, mode: int, quantity: str = "mean_error"
) -> list[Claim | None]:
    """What the thesis states of an error of each setting of a case, if it does.

    A claim about all settings counts for each of them.
    """
    claims = [
        claim
        for claim in claims_of(cube.attrs["figure_set"])
        if (claim.case, claim.mode, claim.quantity) == (case, mode, quantity)
    ]
    return [
        next((c for c in claims if value in c.values), None)
        or next((c for c in claims if not c.values), None)
        for value in cube["value"].values[cube["case"].values == case]
    ]


@dataclass(frozen=True)
class Bars:
    """One error of every setting: literal run, band of the trials, prediction, stated values."""

    #: In %, shape (settings,)
    literal: Array
    predicted: Array
    band: Array  #: Quantiles 5, 50 and 95 % in %, shape (3, settings)
    claims: list[Claim | None]  #: What the thesis states of each setting, or None
    name: str = ""  #: What the bars are, if there is more than one to a setting


def error_bars(cube: xr.Dataset, case: str, mode: int, quantity: str = "mean_error") -> Bars:
    """The bars of one error of a case and mode, by the error's name in the tables."""
    part = select(cube, case, mode)
    values = cubes.error(part, quantity)
    predicted, plane = cubes.predicted(part, quantity), cubes.ERRORS[quantity][1]
    literal, claims = values.isel(trial=0).values, stated(cube, case, mode, quantity)
    return Bars(literal, predicted.values, cubes.band(values), claims, plane or "")
