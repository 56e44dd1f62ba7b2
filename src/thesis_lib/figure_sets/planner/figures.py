"""Figures of ``planner``, drawn from its cube, and further values for its tables."""

import json
from collections.abc import Iterator
from typing import Any

import numpy as np
import xarray as xr
from IPython.display import HTML
from matplotlib.figure import Figure

from thesis_lib.figure_sets.planner import compute, figure_set
from thesis_lib.planning import errors, positions, report as plan_report
from thesis_lib.plotting import panels, style
from thesis_lib.studies.cubes import iterate_slices
from thesis_lib.templates import render

FRONT_QUESTION = figure_set.FREE_QUESTIONS["beam"]  # whose front of error and cost is drawn
SHOWN_CAMERAS = 4  # of the layouts that are drawn, or the nearest number


def table_parameter(cube: xr.Dataset, name: str) -> Any:
    """Return a parameter of the run."""
    return json.loads(cube.attrs["parameters"])[name]


def coarse_options(cube: xr.Dataset, question: str) -> xr.Dataset:
    """Return the options of a question with the first of the resolutions."""
    one = cube.sel(question=question)
    return one.isel(option=one["width_px"].values == table_parameter(cube, "resolutions_px")[0][0])


def _best_of_thesis(cube: xr.Dataset, body: str) -> Iterator[xr.Dataset]:
    """Yield the thesis's layout with the least averaged error for each count, NaN without any."""
    for one in iterate_slices(cube.sel(structure=body), "count"):
        expected = one["thesis_expected"].fillna(np.inf)
        yield one.isel(thesis_case=int(expected.values.argmin()))


def compare_with_thesis(cube: xr.Dataset) -> dict[str, Any]:
    """Compare planned layouts with the best of the thesis with as many cameras."""
    rows = []
    for body, question in figure_set.THESIS_QUESTIONS.items():
        plans = iterate_slices(coarse_options(cube, question), "option")
        for planned, own in zip(plans, _best_of_thesis(cube, body), strict=True):
            rows.append({"body": body, "planned": planned, "own": own})
    return {"rows": rows, "readable": with_readable(cube)}


def with_readable(cube: xr.Dataset) -> str:
    """Compare the plan whose markers can be read with the thesis's best layouts, in words."""
    worse, shares = [], []
    for body in figure_set.THESIS_QUESTIONS:
        plan = coarse_options(cube, figure_set.READABLE_QUESTIONS[body])["expected_error"].values
        for planned, own in zip(plan, _best_of_thesis(cube, body), strict=True):
            if np.isfinite(own["thesis_expected"]) and np.isfinite(planned):
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
            for one in (figure_set.THESIS_QUESTIONS[question.partition(":")[0]], question)
        )
        more = own / free - 1
        changes = np.where(np.abs(more) >= positions.MAX_TIE_RATIO, more, np.nan)
        rows.append({"question": question, "cells": list(zip(own, changes, strict=True))})
    return {"rows": rows}


def list_front(cube: xr.Dataset) -> dict[str, Any]:
    """Return the options on the front of error and cost of one question."""
    one = cube.sel(question=FRONT_QUESTION).sortby("cost")
    return {"options": [part for part in iterate_slices(one, "option") if part["on_front"] == 1]}


def list_targets(cube: xr.Dataset) -> dict[str, Any]:
    """Return the cheapest layout that reaches the target, question by question."""
    best = {}
    for one in iterate_slices(cube, "question"):
        at = compute.cheapest_option(one, table_parameter(cube, "target_percent"))
        best[one["question"].item()] = None if at is None else one.isel(option=at)
    return {"best": best}


def compare_simulated(cube: xr.Dataset) -> dict[str, Any]:
    """Compare simulated with predicted errors, over all options and modes of a structure."""
    ratio, of_body = cube["simulated_error"] / cube["predicted_error"], cube["question"].str
    return {
        "ratios": {
            body: _sort_finite(ratio[of_body.startswith(body)])
            for body in figure_set.THESIS_QUESTIONS
        },
        "median": np.median,
        "amplitudes": errors.AMPLITUDE_RANGE,
        "planned": _sort_finite(cube["averaged_law_ratio"]),
        "own": _sort_finite(cube["thesis_averaged_law_ratio"]),
    }


def _sort_finite(values: xr.DataArray) -> Any:
    return np.sort(values.values[np.isfinite(values.values)])


def compare_sound(cube: xr.Dataset) -> dict[str, Any]:
    """Compare layouts planned for the shape and for the sound by their errors of both."""
    rows = []
    for one in iterate_slices(cube, "count"):
        field, simulated = (one[f"sound_{k}"].max("mode").values for k in ("error", "simulated"))
        fields, change = list(zip(field, simulated, strict=True)), field[1] / field[0] - 1
        rows.append({"one": one, "fields": fields, "change": change})
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
    """Return a view of all planned layouts for a notebook, which can be rotated."""
    plans = []
    for one in iterate_slices(cube, "question"):
        question, found = one["question"].item(), np.flatnonzero(np.isfinite(one["cost"].values))
        first = int(np.searchsorted(found, nearest_option(cube, question, SHOWN_CAMERAS)))
        plans.append((str(question), one.isel(option=found), first))
    return HTML(plan_report.layout_view(plans))


def gain(cube: xr.Dataset) -> Figure:
    """Plot errors of the thesis's layouts and of planned ones against the number of cameras."""
    drawing, axes = style.subplots(1, 2, figsize=(7.4, 3.8))
    n, tilt = cube["count"].values, table_parameter(cube, "tilt_deg")
    for panel, (body, question) in zip(axes, figure_set.THESIS_QUESTIONS.items(), strict=True):
        of_cases = iterate_slices(cube["thesis_expected"].sel(structure=body), "thesis_case")
        for i, own in enumerate(of_cases):
            words, look = f"case {own['thesis_case'].item()}", {"ms": 3.5, "lw": 0.8}
            panel.plot(n, own, "o--", color=style.cycle_color(i), label=words, **look)
        one = coarse_options(cube, question)
        read = coarse_options(cube, figure_set.READABLE_QUESTIONS[body])["expected_error"]
        anywhere, tilted = "planned, read from any side", f"planned, read up to {tilt:g}°"
        panel.plot(n, one["expected_error"], "o-", color=style.BLACK_COLOR, label=anywhere, lw=2)
        panel.plot(n, one["bound"], "_", color=style.BLACK_COLOR, label="bound", ms=12)
        panel.plot(n, read, "s-", color=style.REFERENCE_COLOR, label=tilted, ms=4)
        style.log_axes(panel, n.tolist(), [2, 5, 10, 20, 50])
        panel.set(title=body, xlabel="number of cameras", ylabel="error of the worst mode, %")
    style.legend_below(drawing, axes[1], 5)
    return drawing


def layouts(cube: xr.Dataset) -> Figure:
    """Draw planned layouts of some questions from a corner and from above."""
    shown = [str(q) for q in cube["question"].values if "read" not in str(q)]
    rows = -(-len(shown) // 3)
    drawing, grid = style.subplots(2 * rows, 3, figsize=(7.6, 3.6 * rows), squeeze=False)
    columns = grid.reshape(rows, 2, 3).swapaxes(1, 2).reshape(-1, 2)  # two panels for a question
    for column, question in zip(columns, shown, strict=False):
        at = nearest_option(cube, question, SHOWN_CAMERAS)
        part = cube.sel(question=question).isel(option=at)
        obstacle = figure_set.BLOCKED_QUESTIONS.get(question)
        low, high = (getattr(part["camera_position"], end)().item() for end in ("min", "max"))
        reach = max(abs(low), high)
        along, up = np.array([-1, 1, 1, -1]) * reach, np.array([0, 0, 1, 1]) * 0.6 * reach
        # The face of a wall at Y = 0 or of a machine, behind which no camera may stand
        corners = along, np.zeros(4), up
        if obstacle == "machine":
            corners = np.full(4, figure_set.MACHINE_BOX_MM[0] / 1000), along, up
        views = zip(column, plan_report.LAYOUT_VIEWS, strict=False)
        for panel, (words, azimuth, elevation) in views:
            panel.set_title(f"{question}\n{words}", fontsize=8)
            plan_report.layout_panel(panel, part, azimuth, elevation)
            if obstacle:
                face = 1000 * panels.project_parallel(np.stack(corners, axis=1), azimuth, elevation)
                panel.fill(*face.T, color=style.HIGHLIGHT_COLOR, alpha=0.25, lw=1, zorder=2)
                where: Any = {"fontsize": 8, "ha": "center", "va": "top"}
                panel.annotate(obstacle, face[1], color=style.HIGHLIGHT_COLOR, **where)
    for spare in columns[len(shown) :].flat:
        spare.axis("off")
    return drawing


def front(cube: xr.Dataset) -> Figure:
    """Plot the error against cost for one question."""
    drawing, panel = style.subplots(figsize=(7.2, 3.8))
    one, target = cube.sel(question=FRONT_QUESTION), table_parameter(cube, "target_percent")
    found, best = np.isfinite(one["cost"].values), compute.cheapest_option(one, target)
    chosen = 0 if best is None else int(np.sum(found[:best]))
    one = one.isel(option=found).assign(chosen=chosen)
    plan_report.front_panel(panel, one, None if best is None else target)
    return drawing
