"""Errors of cubes as series, as the trends are judged on."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
import xarray as xr

from thesis_lib.facts.trends import read_trends
from thesis_lib.ledger.trends import Series
from thesis_lib.ledger.verdicts import point_errors
from thesis_lib.studies import cubes

SECOND = "second_point_error"  # the largest of the markers' but one


@cache
def _sets_with(quantity: str) -> frozenset[str]:
    """The figure sets of which some trend states a quantity."""
    stated = (trend for trend in read_trends() if quantity in trend.quantities)
    return frozenset(name for trend in stated for name in trend.source)


def series_of(cube: xr.Dataset, name: Callable[[str], str] = str) -> list[Series]:
    """The errors of a cube's random trials, case by case; `name` renames cases."""
    kinds = dict(cubes.errors(cube))
    if "deflection_error" in cube:
        kinds["deflection_error"] = cube["deflection_error"]
    if cube.attrs["figure_set"] in _sets_with(SECOND):
        kinds[SECOND] = point_errors(cube).isel(point=-2, drop=True)
    if {"lost", "wrong"} <= set(cube):  # of the laboratory, once for all trials
        failures = 100 * (cube["lost"] + cube["wrong"].fillna(0))
        kinds["tracking_failures"] = failures.expand_dims(mode=cube["mode"], trial=[0, 1])
    found = []
    for case in dict.fromkeys(cube["case"].values.tolist()):
        rows = np.flatnonzero(cube["case"].values == case)
        rows = rows[np.argsort(cube["value"].values[rows], kind="stable")]
        values = cube["value"].values[rows].astype(float)
        for quantity, errors in kinds.items():
            chosen = errors.isel(setting=rows, trial=slice(1, None))
            table = chosen.transpose("mode", "setting", "trial").values.astype(float)
            found += [
                Series(quantity, name(case), int(mode), values, part)
                for mode, part in zip(cube["mode"].values, table, strict=True)
            ]
    if "tracking_missing" in cube:
        failures = 100 * (cube["tracking_missing"] + cube["tracking_wrong"].fillna(0))
        widths = cube["tracked_width"].values.astype(float)
        found.append(
            Series(
                "tracking_failures", "tracking", 1, widths, failures.values[:, None].astype(float)
            )
        )
    return found
