"""Tables of ``planner``, from its cube."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import xarray as xr
from IPython.display import HTML, Markdown

from thesis_lib.figure_sets.planner.compute import cheapest_option
from thesis_lib.figure_sets.planner.parameters import THESIS_QUESTIONS
from thesis_lib.planning.errors import AMPLITUDE_RANGE
from thesis_lib.planning.figures import layout_view
from thesis_lib.planning.positions import MAX_TIE_RATIO
from thesis_lib.templates import render

FRONT_QUESTION = "beam: nearer or farther, too"  # of which the front is drawn
SHOWN_CAMERAS = 4  # of the layouts that are drawn, or the nearest number


def table_parameter(cube: xr.Dataset, name: str) -> Any:
    """Return a parameter of the run."""
    return json.loads(cube.attrs["parameters"])[name]


def coarse_options(cube: xr.Dataset, question: str) -> xr.Dataset:
    """Return the options of a question with the first of the resolutions."""
    one = cube.sel(question=question)
    return one.isel(
        option=np.flatnonzero(one["width_px"] == table_parameter(cube, "resolutions_px")[0][0])
    )


def _best_of_thesis(cube: xr.Dataset, body: str) -> Iterator[xr.Dataset | None]:
    """Yield the thesis's layout with the least averaged error for each count, if it has any."""
    part = cube.sel(structure=body)
    for i in range(cube.sizes["count"]):
        one = part.isel(count=i)
        expected = one["thesis_expected"].values
        known = np.isfinite(expected).any()
        yield one.isel(thesis_case=int(np.nanargmin(expected))) if known else None


def compare_with_thesis(cube: xr.Dataset) -> str:
    """Compare planned layouts with the best of the thesis with as many cameras."""
    rows: list[dict[str, Any]] = []
    for body, question in THESIS_QUESTIONS.items():
        plan = coarse_options(cube, question)
        for i, own in enumerate(_best_of_thesis(cube, body)):
            error = np.nan if own is None else float(own["thesis_expected"])
            planned = plan.isel(option=i)
            rows.append(
                {
                    "body": body,
                    "count": cube["count"][i],
                    "case": "—" if own is None else own["thesis_case"].item(),
                    "own": error,
                    "planned": planned["expected_error"],
                    "less": 100 * (1 - planned["expected_error"] / error),
                    "bound": planned["bound"],
                    "own_simulated": np.nan if own is None else own["thesis_simulated"],
                    "simulated": planned["simulated_error"].max(),
                }
            )
    size = table_parameter(cube, "resolutions_px")[0]
    return render(__file__, "thesis", rows=rows, size=size, readable=with_readable(cube))


def with_readable(cube: xr.Dataset) -> str:
    """Compare the plan whose markers can be read with the thesis's best layouts."""
    worse, shares = [], []
    for body in THESIS_QUESTIONS:
        plan = coarse_options(cube, f"{body}: markers that can be read")["expected_error"].values
        for planned, own in zip(plan, _best_of_thesis(cube, body), strict=True):
            if own is not None and np.isfinite(planned):
                worse.append(bool(planned > own["thesis_expected"]))
                shares.append(100 * float(own["thesis_read_fraction"]))
    tilt = table_parameter(cube, "tilt_deg")
    return render(
        __file__, "readable", worse=sum(worse), pairs=len(worse), shares=shares, tilt=tilt
    )


def list_limits(cube: xr.Dataset) -> str:
    """Show the cost of limits on places."""
    rows = []
    for question in cube["question"].values.tolist():
        free = coarse_options(cube, THESIS_QUESTIONS[question.partition(":")[0]])[
            "expected_error"
        ].values
        own = coarse_options(cube, question)["expected_error"].values
        more = own / free - 1
        changes = [one if abs(one) >= MAX_TIE_RATIO else np.nan for one in more]
        rows.append({"question": question, "cells": list(zip(own, changes, strict=True))})
    counts, tilt = cube["count"].values, table_parameter(cube, "tilt_deg")
    return render(__file__, "limits", rows=rows, counts=counts, tilt=tilt)


def list_front(cube: xr.Dataset) -> str:
    """List the options on the front of one question."""
    one = cube.sel(question=FRONT_QUESTION)
    order = np.argsort(one["cost"].values, kind="stable")
    options = [one.isel(option=i) for i in order if one["on_front"].values[i] == 1]
    return render(__file__, "front", options=options) if options else ""


def list_targets(cube: xr.Dataset) -> str:
    """List the cheapest layout that reaches the target, question by question."""
    target = table_parameter(cube, "target_percent")
    best = {}
    for question in cube["question"].values.tolist():
        one = cube.sel(question=question)
        at = cheapest_option(one, target)
        best[question] = None if at is None else one.isel(option=at)
    return render(__file__, "targets", best=best, target=target)


def compare_simulated(cube: xr.Dataset) -> str:
    """Compare simulated with predicted errors, over all options and modes of a structure."""
    ratios = {}
    for body in THESIS_QUESTIONS:
        part = cube.sel(question=[q for q in cube["question"].values if q.startswith(body)])
        ratio = (part["simulated_error"] / part["predicted_error"]).values.ravel()
        ratios[body] = np.sort(ratio[np.isfinite(ratio)])
    planned, own = (
        np.sort(cube[name].values[np.isfinite(cube[name].values)])
        for name in ("averaged_law_ratio", "thesis_averaged_law_ratio")
    )
    return render(
        __file__,
        "verification",
        ratios=ratios,
        median=np.median,
        amplitudes=AMPLITUDE_RANGE,
        planned=planned,
        own=own,
    )


def for_sound(cube: xr.Dataset) -> str:
    """Compare layouts planned for the shape and for the sound by their errors of both."""
    rows = []
    for i in range(cube.sizes["count"]):
        one = cube.isel(count=i)
        field = one["sound_error"].max("mode").values
        simulated = one["sound_simulated"].max("mode").values
        rows.append(
            {
                "count": one["count"],
                "fields": list(zip(field, simulated, strict=True)),
                "change": field[1] / field[0] - 1,
                "shapes": one["sound_shape_error"].values,
            }
        )
    return render(__file__, "sound", rows=rows, size=table_parameter(cube, "resolutions_px")[0])


def nearest_option(cube: xr.Dataset, question: str, count: int) -> int:
    """Return the option of a question with the number of cameras nearest to a count."""
    counts = cube.sel(question=question)["n_cameras"].values
    return int(np.argmin(np.abs(counts - count)))


TABLES: dict[str, Callable[[xr.Dataset], str]] = {
    "thesis": compare_with_thesis,
    "limits": list_limits,
    "front": list_front,
    "targets": list_targets,
    "verification": compare_simulated,
    "sound": for_sound,
}
PIECES = TABLES


def show_table(cube: xr.Dataset, name: str) -> Markdown:
    """Show one of :data:`TABLES` in a notebook."""
    return Markdown(TABLES[name](cube))


def show_layouts(cube: xr.Dataset) -> HTML:
    """Show every planned layout in a notebook, to be turned."""
    plans = []
    for question in cube["question"].values.tolist():
        one = cube.sel(question=question)
        found = np.flatnonzero(np.isfinite(one["cost"].values))
        first = int(np.searchsorted(found, nearest_option(cube, question, SHOWN_CAMERAS)))
        plans.append((str(question), one.isel(option=found), first))
    return HTML(layout_view(plans))
