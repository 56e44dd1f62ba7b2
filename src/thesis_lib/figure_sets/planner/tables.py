"""What the tables of ``planner`` need besides its cube."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import numpy as np
import xarray as xr
from IPython.display import HTML

from thesis_lib.figure_sets.planner.compute import cheapest_option
from thesis_lib.figure_sets.planner.parameters import THESIS_QUESTIONS
from thesis_lib.planning.errors import AMPLITUDE_RANGE
from thesis_lib.planning.positions import MAX_TIE_RATIO
from thesis_lib.planning.report import layout_view
from thesis_lib.studies.cubes import iterate_slices
from thesis_lib.templates import render

FRONT_QUESTION = "beam: nearer or farther, too"  # of which the front is drawn
SHOWN_CAMERAS = 4  # of the layouts that are drawn, or the nearest number


def table_parameter(cube: xr.Dataset, name: str) -> Any:
    """Return a parameter of the run."""
    return json.loads(cube.attrs["parameters"])[name]


def coarse_options(cube: xr.Dataset, question: str) -> xr.Dataset:
    """Return the options of a question with the first of the resolutions."""
    one = cube.sel(question=question)
    return one.isel(option=one["width_px"].values == table_parameter(cube, "resolutions_px")[0][0])


def _best_of_thesis(cube: xr.Dataset, body: str) -> Iterator[xr.Dataset | None]:
    """Yield the thesis's layout with the least averaged error for each count, if it has any."""
    for one in iterate_slices(cube.sel(structure=body), "count"):
        expected = one["thesis_expected"].values
        known = np.isfinite(expected).any()
        yield one.isel(thesis_case=int(np.nanargmin(expected))) if known else None


def compare_with_thesis(cube: xr.Dataset) -> dict[str, Any]:
    """Compare planned layouts with the best of the thesis with as many cameras."""
    rows: list[dict[str, Any]] = []
    for body, question in THESIS_QUESTIONS.items():
        plans = iterate_slices(coarse_options(cube, question), "option")
        for planned, own in zip(plans, _best_of_thesis(cube, body), strict=True):
            error = np.nan if own is None else float(own["thesis_expected"])
            rows.append(
                {
                    "body": body,
                    "count": planned["n_cameras"],
                    "case": "—" if own is None else own["thesis_case"].item(),
                    "own": error,
                    "planned": planned["expected_error"],
                    "less": 100 * (1 - planned["expected_error"] / error),
                    "bound": planned["bound"],
                    "own_simulated": np.nan if own is None else own["thesis_simulated"],
                    "simulated": planned["simulated_error"].max(),
                }
            )
    return {"rows": rows, "readable": with_readable(cube)}


def with_readable(cube: xr.Dataset) -> str:
    """Compare the plan whose markers can be read with the thesis's best layouts, in words."""
    worse, shares = [], []
    for body in THESIS_QUESTIONS:
        plan = coarse_options(cube, f"{body}: markers that can be read")["expected_error"].values
        for planned, own in zip(plan, _best_of_thesis(cube, body), strict=True):
            if own is not None and np.isfinite(planned):
                worse.append(bool(planned > own["thesis_expected"]))
                shares.append(100 * float(own["thesis_read_fraction"]))
    tilt, counted = table_parameter(cube, "tilt_deg"), {"worse": sum(worse), "pairs": len(worse)}
    return render(__file__, "readable", **counted, shares=shares, tilt=tilt)


def compare_limits(cube: xr.Dataset) -> dict[str, Any]:
    """Return the errors under limits on places, and how much they exceed those without."""
    rows = []
    for question in cube["question"].values.tolist():
        free, own = (
            coarse_options(cube, one)["expected_error"].values
            for one in (THESIS_QUESTIONS[question.partition(":")[0]], question)
        )
        more = own / free - 1
        changes = np.where(np.abs(more) >= MAX_TIE_RATIO, more, np.nan)
        rows.append({"question": question, "cells": list(zip(own, changes, strict=True))})
    return {"rows": rows}


def list_front(cube: xr.Dataset) -> dict[str, Any]:
    """Return the options on the front of one question."""
    one = cube.sel(question=FRONT_QUESTION).sortby("cost")
    return {"options": [part for part in iterate_slices(one, "option") if part["on_front"] == 1]}


def list_targets(cube: xr.Dataset) -> dict[str, Any]:
    """Return the cheapest layout that reaches the target, question by question."""
    best = {}
    for one in iterate_slices(cube, "question"):
        at = cheapest_option(one, table_parameter(cube, "target_percent"))
        best[one["question"].item()] = None if at is None else one.isel(option=at)
    return {"best": best}


def compare_simulated(cube: xr.Dataset) -> dict[str, Any]:
    """Compare simulated with predicted errors, over all options and modes of a structure."""
    ratio, of_body = cube["simulated_error"] / cube["predicted_error"], cube["question"].str
    return {
        "ratios": {
            body: _sort_finite(ratio[of_body.startswith(body)]) for body in THESIS_QUESTIONS
        },
        "median": np.median,
        "amplitudes": AMPLITUDE_RANGE,
        "planned": _sort_finite(cube["averaged_law_ratio"]),
        "own": _sort_finite(cube["thesis_averaged_law_ratio"]),
    }


def _sort_finite(values: xr.DataArray) -> Any:
    return np.sort(values.values[np.isfinite(values.values)])


def compare_sound(cube: xr.Dataset) -> dict[str, Any]:
    """Compare layouts planned for the shape and for the sound by their errors of both."""
    rows = []
    for one in iterate_slices(cube, "count"):
        field, simulated = (
            one[name].max("mode").values for name in ("sound_error", "sound_simulated")
        )
        fields, change = list(zip(field, simulated, strict=True)), field[1] / field[0] - 1
        row = {"count": one["count"], "fields": fields, "change": change}
        rows.append(row | {"shapes": one["sound_shape_error"].values})
    return {"rows": rows}


def nearest_option(cube: xr.Dataset, question: str, count: int) -> int:
    """Return the option of a question with the number of cameras nearest to a count."""
    counts = cube.sel(question=question)["n_cameras"].values
    return int(np.argmin(np.abs(counts - count)))


TEXTS = {
    "thesis": compare_with_thesis,
    "limits": compare_limits,
    "front": list_front,
    "targets": list_targets,
    "verification": compare_simulated,
    "sound": compare_sound,
}


def show_layouts(cube: xr.Dataset) -> HTML:
    """Show every planned layout in a notebook, to be turned."""
    plans = []
    for one in iterate_slices(cube, "question"):
        question, found = one["question"].item(), np.flatnonzero(np.isfinite(one["cost"].values))
        first = int(np.searchsorted(found, nearest_option(cube, question, SHOWN_CAMERAS)))
        plans.append((str(question), one.isel(option=found), first))
    return HTML(layout_view(plans))
