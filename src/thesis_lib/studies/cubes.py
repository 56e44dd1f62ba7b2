"""Result cubes: what made them, what they say in a table, and how two of them differ."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from thesis_lib.figure_sets.cube_check import check
from thesis_lib.figure_sets.registry import STUDIES
from thesis_lib.studies.storage import opened
from thesis_lib.vision.simulation import LEAST_SQUARES

ERRORS = {  # name in the tables: variable, and plane if it has one
    "mean_error": ("mean_error", None),
    "max_point_error": ("max_point_error", None),
    "plane_error_xz": ("plane_error", "XZ"),
    "plane_error_yz": ("plane_error", "YZ"),
    "power_error": ("power_error", None),
}
SHORT = {"mean_error": "mean", "max_point_error": "peak",
         "plane_error_xz": "XZ", "plane_error_yz": "YZ", "power_error": "power"}  # fmt: skip
_QUANTITIES = ("quantity", "value", "unit")
OWN = {  # what is compared of figure sets without settings of the thesis
    "claims": ("claim", "verdict"), "cameras": _QUANTITIES, "design-law": _QUANTITIES,
    "planner": _QUANTITIES,
}  # fmt: skip
KEYS = ["case", "value", "label", "pair_order", "mode"]
STATISTICS = ["trial_0", "median", "low", "high"]
BAND = (0.05, 0.5, 0.95)  # quantiles of the trials


def predicts(cube: xr.Dataset) -> str:
    """What `predicted_error` stands for, as legends say it."""
    words = STUDIES[cube.attrs["figure_set"]].predicts
    estimator = json.loads(cube.attrs["parameters"]).get("estimator", LEAST_SQUARES)
    return words if estimator == LEAST_SQUARES else f"{words} of least squares"


def read(path: Path) -> xr.Dataset:
    """Open one of our cubes.

    Raises
    ------
    CubeError
        In one line: the file, and what is wrong with it.
    """
    cube = opened(path)
    name = str(cube.attrs.get("figure_set"))
    if name in OWN:
        check(cube, path, set(OWN[name]), set())
    else:
        check(cube, path, set(KEYS), {variable for variable, _ in ERRORS.values()})
    return cube


def errors(cube: xr.Dataset) -> dict[str, xr.DataArray]:
    """The errors that a cube holds in %, by their names in the tables."""
    return {
        name: cube[variable] if plane is None else cube[variable].sel(plane=plane)
        for name, (variable, plane) in ERRORS.items()
        if variable in cube
    }


def predicted(cube: xr.Dataset, error: str) -> xr.DataArray:
    """What is predicted of an error by its name in the tables, in %."""
    variable, plane = ERRORS[error]
    own = f"predicted_{variable}"  # of a cube with errors of several kinds
    values = cube[own if own in cube else "predicted_error"]
    return values if plane is None else values.sel(plane=plane)


def summary(cube: xr.Dataset) -> pd.DataFrame:
    """Each error by setting and mode: trial 0, and median, 5 % and 95 % of the other trials.

    Without other trials the latter three are NaN. Of the ledger: the verdict on every claim; of
    ``cameras``, ``design-law`` and ``planner``: every quantity with its value and unit.
    """
    if (name := cube.attrs["figure_set"]) in OWN:
        return pd.DataFrame({column: cube[column].values for column in OWN[name]})
    rows: list[dict[str, Any]] = []
    for quantity, values in errors(cube).items():
        literal = values.isel(trial=0).transpose("setting", "mode").values
        low, median, high = band(values)
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


def band(values: xr.DataArray) -> Any:
    """Quantiles 5, 50 and 95 % of errors over their trials but the literal run.

    They are (3, setting, ...), NaN without such trials. One setting is read at a time.
    """
    here = values.transpose("setting", ..., "trial")
    bands = np.full((len(BAND), *here.shape[:-1]), np.nan)
    for setting in range(here.sizes["setting"] if here.sizes["trial"] > 1 else 0):
        drawn = here.isel(setting=setting).values[..., 1:]
        bands[:, setting] = np.quantile(drawn, BAND, axis=-1)
    return bands


def percent_text(value: float) -> str:
    """A percentage with one decimal, below 1 with two, below 0.1 with three."""
    size = abs(value)
    return f"{value:.1f}" if size >= 0.995 else f"{value:.2f}" if size >= 0.095 else f"{value:.3f}"


def band_text(median: float, low: float, high: float) -> str:
    """Median and band as they stand in tables; a dash where there were no trials."""
    text = percent_text
    return "—" if np.isnan(median) else f"{text(median)} ({text(low)}–{text(high)})"
