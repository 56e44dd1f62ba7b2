"""Tables of errors, and of claimed values next to the results."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import xarray as xr
from IPython.display import Markdown

from thesis_lib.facts import claims
from thesis_lib.ledger import verdicts
from thesis_lib.studies import cubes
from thesis_lib.templates import render


def error_table(cube: xr.Dataset) -> Markdown:
    """List errors by setting and mode: trial 0, median, 5–95 % band, law of rounding."""
    columns = dict(_columns(cube))
    rows = [
        {
            "case": str(cube["case"].values[i]),
            "label": str(cube["label"].values[i]),
            "cells": [cells[i] for cells in columns.values()],
            "in_view": float(cube["in_view"].values[i]),
            "missing": float(cube["missing"].values[i, 0, 0]) if "missing" in cube else 0.0,
        }
        for i in range(cube.sizes["setting"])
    ]
    text = render(
        __file__,
        "errors",
        said=cube.attrs,
        trials=cubes.trials_are(cube),
        columns=list(columns),
        rows=rows,
        sound="plane_error" in cube,
        piston_size=float(cube["piston_size"].max()) if "piston_size" in cube else 0.0,
    )
    return Markdown(text)


def _columns(cube: xr.Dataset) -> Iterator[tuple[str, list[dict[str, Any]]]]:
    """Yield the errors of each mode, and of each plane of the sound, setting by setting."""
    table = cubes.summarise_errors(cube).set_index(["error", "mode"])
    for mode in cube["mode"].values.tolist():
        for error, (_, plane) in cubes.ERROR_VARIABLES.items():
            if (error, mode) not in table.index or error == "max_point_error":
                continue
            predicted = cubes.predicted_value(cube, error).sel(mode=mode).values
            cells = table.loc[[(error, mode)]].to_dict("records")
            for i, cell in enumerate(cells):
                cell["predicted"] = predicted[i]
                if np.isnan(cell["trial_0"]):  # a nodal plane
                    cell["of_larger"] = _of_larger(cube, i, mode, plane)
            yield f"mode {mode}" + (f", {plane}" if plane else ""), cells


def _of_larger(cube: xr.Dataset, setting: int, mode: int, plane: str | None) -> float:
    """Return the error on a nodal plane relative to the other plane's pressure, or NaN."""
    values = cube["plane_error_of_larger"].isel(setting=setting).sel(mode=mode, plane=plane)
    return float(np.median(values.values[1:] if values.size > 1 else values.values))


def claims_table(cube: xr.Dataset, only_misses: bool = True) -> Markdown:
    """Compare the thesis's claimed values with the band of the trials."""
    checks = []
    if cube.sizes["trial"] > 1:
        checks = verdicts.check_claims(cube, claims.claims_of(cube.attrs["figure_set"]))
    counts = {}
    for quantity, word in cubes.SHORT_LABELS.items():
        inside = [check.inside for check in checks if check.claim.quantity == quantity]
        if inside:
            counts[word] = inside
    text = render(
        __file__,
        "claims",
        trials=cubes.trials_are(cube) if cube.sizes["trial"] > 1 else "",
        counts=counts,
        checks=[check for check in checks if not (only_misses and check.inside)],
        only_misses=only_misses,
        short=cubes.SHORT_LABELS,
    )
    return Markdown(text)
