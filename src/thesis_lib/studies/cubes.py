"""Result cubes: what made them, what they say in a table, and how two of them differ."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, TypeVar

import numpy as np
import pandas as pd
import xarray as xr

from thesis_lib.arrays import Array

ERROR_VARIABLES = {  # name in the tables: variable, and plane if it has one
    "mean_error": ("mean_error", None),
    "max_point_error": ("max_point_error", None),
    "plane_error_xz": ("plane_error", "XZ"),
    "plane_error_yz": ("plane_error", "YZ"),
    "power_error": ("power_error", None),
}
SHORT_LABELS = {
    "mean_error": "mean",
    "max_point_error": "peak",
    "plane_error_xz": "XZ",
    "plane_error_yz": "YZ",
    "power_error": "power",
}
LABEL_MEANINGS = {
    "mean": "rms over the markers",
    "peak": "error of the marker that is farthest off",
    "XZ": "error of the pressure on that plane",
    "YZ": "error of the pressure on that plane",
    "power": "error of the sound power",
}
LISTED_VARIABLES = {  # by its dimension, what is compared of a cube whose results are a list
    "claim": ("claim", "verdict"),
    "quantity": ("quantity", "value", "unit"),
}
ROW_KEYS = ["case", "value", "label", "pair_order", "mode"]
STATISTIC_NAMES = ["trial_0", "median", "low", "high"]
BAND_QUANTILES = (0.05, 0.5, 0.95)  # quantiles of the trials

_Cube = TypeVar("_Cube", xr.Dataset, xr.DataArray)


def iterate_slices(cube: _Cube, dim: str) -> Iterator[_Cube]:
    """Iterate over a cube along a dimension."""
    return (cube.isel({dim: index}) for index in range(cube.sizes[dim]))


def list_dimension(cube: xr.Dataset) -> str:
    """Return the dimension along which a cube lists results; empty if it holds errors."""
    return next((name for name in LISTED_VARIABLES if name in cube.dims), "")


def cube_errors(cube: xr.Dataset) -> dict[str, xr.DataArray]:
    """Return the errors that a cube holds in %, by their names in the tables."""
    return {
        name: cube_error(cube, name)
        for name, (variable, _) in ERROR_VARIABLES.items()
        if variable in cube
    }


def cube_error(cube: xr.Dataset, name: str) -> xr.DataArray:
    """Return one of them."""
    variable, plane = ERROR_VARIABLES[name]
    return cube[variable] if plane is None else cube[variable].sel(plane=plane)


def predicted_value(cube: xr.Dataset, error: str) -> xr.DataArray:
    """Return what is predicted of an error by its name in the tables, in %."""
    variable, plane = ERROR_VARIABLES[error]
    own = f"predicted_{variable}"  # of a cube with errors of several kinds
    values = cube[own if own in cube else "predicted_error"]
    return values if plane is None else values.sel(plane=plane)


def summarise_errors(cube: xr.Dataset) -> pd.DataFrame:
    """Return each error by setting and mode: trial 0, and median, 5 % and 95 % of the other trials.

    Without other trials the latter three are NaN. Of the ledger: the verdict on every claim; of
    a cube that lists quantities: each with its value and unit.
    """
    if name := list_dimension(cube):
        return pd.DataFrame({column: cube[column].values for column in LISTED_VARIABLES[name]})
    rows: list[dict[str, Any]] = []
    for quantity, values in cube_errors(cube).items():
        literal = values.isel(trial=0).transpose("setting", "mode").values
        low, median, high = trial_band(values)
        for s in range(cube.sizes["setting"]):
            for m, mode in enumerate(cube["mode"].values):
                rows.append(
                    {
                        "case": str(cube["case"].values[s]),
                        "value": float(cube["value"].values[s]),
                        "pair_order": str(cube["pair_order"].values[s]),
                        "label": str(cube["label"].values[s]),
                        "mode": int(mode),
                        "error": quantity,
                        "trial_0": float(literal[s, m]),
                        "median": float(median[s, m]),
                        "low": float(low[s, m]),
                        "high": float(high[s, m]),
                    }
                )
    return pd.DataFrame(rows)


def trial_band(values: xr.DataArray) -> Any:
    """Return the quantiles 5, 50 and 95 % of errors over their trials but the nominal run.

    They are (3, setting, ...), NaN without such trials. One setting is read at a time.
    """
    here = values.transpose("setting", ..., "trial")
    bands = np.full((len(BAND_QUANTILES), *here.shape[:-1]), np.nan)
    for setting in range(here.sizes["setting"] if here.sizes["trial"] > 1 else 0):
        drawn = here.isel(setting=setting).values[..., 1:]
        bands[:, setting] = np.quantile(drawn, BAND_QUANTILES, axis=-1)
    return bands


def typical_error(values: xr.DataArray) -> Array:
    """Return the median over the random trials, or the nominal run if there are none.

    Shape (setting, ...): what settings are ranked by, as one run alone ranks them by its luck.
    """
    literal: Array = values.isel(trial=0).transpose("setting", ...).values
    median = trial_band(values)[1]
    return np.where(np.isfinite(median), median, literal)


def trials_are(cube: xr.Dataset) -> str:
    """Return what the trials of a cube are, as tables and legends say it."""
    draws = str(cube.attrs.get("draws", ""))
    return draws if draws.endswith("recordings") else "trials"


def percent_text(value: float) -> str:
    """Return a percentage with one decimal, below 1 with two, below 0.1 with three."""
    size = abs(value)
    return f"{value:.1f}" if size >= 0.995 else f"{value:.2f}" if size >= 0.095 else f"{value:.3f}"


def band_text(median: float, low: float, high: float) -> str:
    """Return the median and band as they stand in tables; a dash where there were no trials."""
    text = percent_text
    return "—" if np.isnan(median) else f"{text(median)} ({text(low)}–{text(high)})"
