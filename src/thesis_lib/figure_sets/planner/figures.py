"""Figures of ``planner``, drawn from its cube."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from thesis_lib.figure_sets.planner.compute import cheapest_option
from thesis_lib.figure_sets.planner.parameters import THESIS_QUESTIONS
from thesis_lib.figure_sets.planner.tables import (
    FRONT_QUESTION,
    SHOWN_CAMERAS,
    coarse_options,
    nearest_option,
    table_parameter,
)
from thesis_lib.planning.figures import LAYOUT_VIEWS, front_panel, layout_panel
from thesis_lib.plotting.panel_boxes import BELOW_PANEL
from thesis_lib.plotting.style import REFERENCE_COLOR, cycle_color, log_axes, subplots


def gain(cube: xr.Dataset) -> Figure:
    """Plot errors of the thesis's layouts and of planned ones against the number of cameras."""
    drawing, axes = subplots(1, 2, figsize=(7.4, 3.8), layout="constrained")
    n = cube["count"].values
    for panel, (body, question) in zip(axes, THESIS_QUESTIONS.items(), strict=True):
        own = cube.sel(structure=body)["thesis_expected"]
        for i, case in enumerate(cube["thesis_case"].values):
            panel.plot(
                n,
                own.sel(thesis_case=case),
                "o--",
                color=cycle_color(i),
                ms=3.5,
                lw=0.8,
                label=f"case {case}",
            )
        one = coarse_options(cube, question)
        panel.plot(
            n,
            one["expected_error"],
            "o-",
            color="#222222",
            lw=2,
            label="planned, read from any side",
        )
        panel.plot(n, one["bound"], "_", color="#222222", ms=12, label="bound")
        read = coarse_options(cube, f"{body}: markers that can be read")
        panel.plot(
            n,
            read["expected_error"],
            "s-",
            color=REFERENCE_COLOR,
            lw=1.4,
            ms=4,
            label=f"planned, read up to {table_parameter(cube, 'tilt_deg'):g}°",
        )
        log_axes(panel, n.tolist(), [2, 5, 10, 20, 50])
        panel.set(title=body, xlabel="number of cameras", ylabel="error of the worst mode, %")
    once = axes[1].get_legend_handles_labels()
    drawing.legend(*once, loc="outside lower center", ncols=5, fontsize=7)
    return drawing


def layouts(cube: xr.Dataset) -> Figure:
    """Draw planned layouts of some questions from a corner and from above."""
    shown = [q for q in cube["question"].values.tolist() if "read" not in str(q)]
    across = 3
    rows = -(-len(shown) // across)
    drawing, grid = subplots(
        2 * rows, across, figsize=(7.6, 3.6 * rows), layout="constrained", squeeze=False
    )
    columns = [grid[2 * row : 2 * row + 2, at] for row in range(rows) for at in range(across)]
    for column, question in zip(columns, shown, strict=False):
        part = cube.sel(question=question).isel(
            option=nearest_option(cube, question, SHOWN_CAMERAS)
        )
        for panel, (_, azimuth, elevation) in zip(column, LAYOUT_VIEWS, strict=False):
            layout_panel(panel, part, azimuth, elevation)
        column[0].set_title(str(question))
        column[1].set_gid(f"{BELOW_PANEL}-{question}")
    for column in columns[len(shown) :]:
        for panel in column:
            panel.axis("off")
    return drawing


def front(cube: xr.Dataset) -> Figure:
    """Plot the error against cost for one question."""
    drawing, panel = subplots(figsize=(7.2, 3.8), layout="constrained")
    one = cube.sel(question=FRONT_QUESTION)
    best = cheapest_option(one, table_parameter(cube, "target_percent"))
    one = one.isel(option=np.flatnonzero(np.isfinite(one["cost"].values)))
    target = None if best is None else table_parameter(cube, "target_percent")
    kept = np.isfinite(cube.sel(question=FRONT_QUESTION)["cost"].values)
    chosen = 0 if best is None else int(np.sum(kept[:best]))
    front_panel(panel, one.assign(chosen=chosen), target)
    return drawing
