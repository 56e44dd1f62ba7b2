"""Select the part of a cube that a figure shows, as arrays and as tidy tables of numbers."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from thesis_lib.arrays import Array
from thesis_lib.facts.claims import Claim, claims_of
from thesis_lib.studies import cubes


def select_settings(cube: xr.Dataset, case: str, mode: int) -> xr.Dataset:
    """Return the settings of one case and one mode."""
    rows = np.flatnonzero(cube["case"].values == case)
    return cube.isel(setting=rows).sel(mode=mode)


def best_and_worst(part: xr.Dataset) -> list[int]:
    """Return the indices of the settings with the least and the largest typical mean error."""
    name = "mean_error" if "mean_error" in part else "deflection_error"
    order = np.argsort(cubes.typical_error(part[name]), kind="stable")
    return [int(order[0])] if len(order) == 1 else [int(order[0]), int(order[-1])]


def rank_settings(part: xr.Dataset) -> tuple[str, str]:
    """Name the first and the last of :func:`best_and_worst` by what they are ranked by."""
    by = " by median" if part.sizes["trial"] > 1 else ""
    return f"best{by}", f"worst{by}"


def claimed_errors(
    cube: xr.Dataset, case: str, mode: int, quantity: str = "mean_error"
) -> list[Claim | None]:
    """Return the claims of the thesis on an error of each setting of a case, or None.

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
    """One error of every setting: nominal run, band of the trials, prediction, stated values."""

    #: In %, shape (settings,)
    literal: Array
    predicted: Array
    band: Array  #: Quantiles 5, 50 and 95 % in %, shape (3, settings)
    claims: list[Claim | None]  #: What the thesis states of each setting, or None
    name: str = ""  #: What the bars are, if there is more than one to a setting


def error_bars(cube: xr.Dataset, case: str, mode: int, quantity: str = "mean_error") -> Bars:
    """Return the bars of one error of a case and mode, by the error's name in the tables."""
    part = select_settings(cube, case, mode)
    values = cubes.cube_error(part, quantity)
    predicted, plane = cubes.predicted_value(part, quantity), cubes.ERROR_VARIABLES[quantity][1]
    literal, claims = values.isel(trial=0).values, claimed_errors(cube, case, mode, quantity)
    return Bars(literal, predicted.values, cubes.trial_band(values), claims, plane or "")


_CLAIMED_FIELDS = ("stated_low", "stated_high", "stated")


def errors_table(cube: xr.Dataset) -> pd.DataFrame:
    """Return every error of a cube in %: one row per setting, mode and kind of error.

    The nominal run (``trial_0``), median, 5 % and 95 % quantile of the trials, what is predicted,
    and the ends and words of what the thesis states; an open end is empty. Of the ledger: one row
    per claim, with all that the cube says of it; of a cube of single quantities: each with its
    value and unit.
    """
    if cubes.list_dimension(cube) == "claim":
        return pd.DataFrame(
            {str(n): v.values for n, v in cube.variables.items() if v.dims == ("claim",)}
        )
    table = cubes.summarise_errors(cube)
    if "case" not in cube:
        return table
    table = table.rename(columns={"label": "setting", "low": "low_5", "high": "high_95"})
    extra = [row for error in cubes.cube_errors(cube) for row in _by_setting(cube, error)]
    return pd.concat([table, pd.DataFrame(extra)], axis=1)


def _by_setting(cube: xr.Dataset, error: str) -> Iterator[dict[str, Any]]:
    """Yield prediction and claimed values of an error by setting and mode."""
    cases, modes = cube["case"].values, cube["mode"].values.tolist()
    predicted = np.full((len(cases), len(modes)), np.nan)
    said: Any = np.full(predicted.shape, None)
    if error != "max_point_error" or f"predicted_{error}" in cube:
        predicted = cubes.predicted_value(cube, error).transpose("setting", "mode").values
    for case in dict.fromkeys(cases.tolist()):
        for m, mode in enumerate(modes):
            said[cases == case, m] = claimed_errors(cube, case, mode, error)
    for s, m in np.ndindex(said.shape):
        parameter = str(cube["parameter"].values[s])
        here = {"parameter": parameter, "predicted": float(predicted[s, m])}
        yield here | _claimed_value(said[s, m])


def _claimed_value(claim: Claim | None) -> dict[str, Any]:
    if claim is None:
        return dict.fromkeys(_CLAIMED_FIELDS)
    return dict(zip(_CLAIMED_FIELDS, (*claim.ends, claim.stated), strict=True))


def figure_table(cube: xr.Dataset, errors: pd.DataFrame, case: str, mode: int) -> pd.DataFrame:
    """Return the numbers that a figure of a case and mode draws, a row each.

    `errors` is the table of the cube (:func:`errors_table`).

    Marker values are those of the settings with the least and the largest typical error, all
    else is of every setting. Maps of pressure are left to the cube. Columns ``quantity``,
    ``statistic``, ``setting``, ``point``, ``x_mm``, ``y_mm``, ``value`` and ``unit``; those that do
    not apply are empty.
    """
    part = select_settings(cube, case, mode)
    whole = errors[(errors["case"] == case) & (errors["mode"] == mode)]
    statistics = ("trial_0", "low_5", "median", "high_95", "predicted", *_CLAIMED_FIELDS[:2])
    rows = []
    for row in whole.to_dict("records"):
        about = {"quantity": row["error"], "setting": row["setting"], "unit": "percent"}
        kept = [name for name in statistics if not pd.isna(row[name])]
        rows += [{**about, "statistic": name, "value": row[name]} for name in kept]
    rows += [row for name in part.data_vars for row in _drawn_values(part, str(name))]
    columns = ["quantity", "statistic", "setting", "point", "x_mm", "y_mm", "value", "unit"]
    table = pd.DataFrame(rows, columns=columns)
    return table.astype({"point": "Int64"})


def _drawn_values(part: xr.Dataset, name: str) -> Iterator[dict[str, Any]]:
    """Yield the values of one variable of a case and mode, if a figure shows them."""
    values = part[name]
    if "trial" in values.dims:
        values = values.isel(trial=0)
    of_tables = name in {v for v, _ in cubes.ERROR_VARIABLES.values()} or name.startswith(
        "predicted_"
    )
    if values.dtype.kind != "f" or of_tables:
        return
    unit, labels = str(values.attrs.get("units", "1")), part["label"].values.astype(str)
    if values.dims == ("setting",):
        for label, value in zip(labels, values.values, strict=True):
            if np.isfinite(value):
                yield {"quantity": name, "setting": label, "value": value, "unit": unit}
    if values.dims == ("point",):
        yield from _points(part, name, values.values, unit, "")
    if values.dims == ("setting", "point"):
        for index in dict.fromkeys(best_and_worst(part)):
            yield from _points(part, name, values.values[index], unit, labels[index])


def _points(
    part: xr.Dataset, name: str, values: Any, unit: str, setting: str
) -> Iterator[dict[str, Any]]:
    places = {f"{a}_mm": part[a].values * 1000 for a in ("x", "y") if a in part}
    for point in np.flatnonzero(np.isfinite(values)):
        here = {axis: place[point] for axis, place in places.items()}
        here |= {"quantity": name, "setting": setting, "unit": unit}
        yield here | {"point": point + 1, "value": values[point]}


def as_csv(table: pd.DataFrame) -> str:
    """Format a table as CSV with six digits; equal tables give equal text."""
    return table.to_csv(index=False, float_format="%.6g", lineterminator="\n")


def figure_names(cube: xr.Dataset) -> dict[tuple[str, int], str]:
    """Return a file name without suffix for the numbers of each figure, by case and mode.

    Cases may have any name; a file's has plain letters, digits and hyphens alone. A cube without
    cases has no such files: all that its figures draw is in its one table.
    """
    names: dict[tuple[str, int], str] = {}
    if "case" not in cube or cubes.list_dimension(cube) == "claim":
        return names
    for case in dict.fromkeys(cube["case"].values.tolist()):
        plain = re.sub(r"[^A-Za-z0-9]+", "-", case.replace("'", "-prime")).strip("-") or "case"
        for mode in cube["mode"].values.tolist():
            name, number = f"{plain}-mode-{mode}".lower(), 1
            while name in names.values():
                number += 1
                name = f"{plain}-{number}-mode-{mode}".lower()
            names[case, int(mode)] = name
    return names
