"""Figures of ``planner``, drawn from its cube."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from thesis_lib.figure_sets.planner.compute import cheapest_option
from thesis_lib.figure_sets.planner.parameters import (
    BLOCKED_QUESTIONS,
    MACHINE_BOX_MM,
    THESIS_QUESTIONS,
)
from thesis_lib.figure_sets.planner.tables import (
    FRONT_QUESTION,
    SHOWN_CAMERAS,
    TEXTS,
    coarse_options,
    nearest_option,
    table_parameter,
)
from thesis_lib.planning.report import LAYOUT_VIEWS, flatten_points, front_panel, layout_panel
from thesis_lib.plotting.style import (
    BELOW_PANEL,
    BLACK_COLOR,
    HIGHLIGHT_COLOR,
    REFERENCE_COLOR,
    cycle_color,
    log_axes,
    subplots,
)
from thesis_lib.studies.cubes import iterate_slices

__all__ = ["TEXTS", "front", "gain", "layouts"]


def gain(cube: xr.Dataset) -> Figure:
    """Plot errors of the thesis's layouts and of planned ones against the number of cameras."""
    drawing, axes = subplots(1, 2, figsize=(7.4, 3.8), layout="constrained")
    n, tilt = cube["count"].values, table_parameter(cube, "tilt_deg")
    for panel, (body, question) in zip(axes, THESIS_QUESTIONS.items(), strict=True):
        of_cases = iterate_slices(cube["thesis_expected"].sel(structure=body), "thesis_case")
        for i, own in enumerate(of_cases):
            words, style = f"case {own['thesis_case'].item()}", {"ms": 3.5, "lw": 0.8}
            panel.plot(n, own, "o--", color=cycle_color(i), label=words, **style)
        one = coarse_options(cube, question)
        read = coarse_options(cube, f"{body}: markers that can be read")
        lines: tuple[tuple[Any, str, dict[str, Any]], ...] = (
            (one["expected_error"], "o-", {"label": "planned, read from any side", "lw": 2}),
            (one["bound"], "_", {"label": "bound", "ms": 12}),
            (
                read["expected_error"],
                "s-",
                {"label": f"planned, read up to {tilt:g}°", "color": REFERENCE_COLOR, "ms": 4},
            ),
        )
        for values, line, style in lines:
            panel.plot(n, values, line, **{"color": BLACK_COLOR, **style})
        log_axes(panel, n.tolist(), [2, 5, 10, 20, 50])
        panel.set(title=body, xlabel="number of cameras", ylabel="error of the worst mode, %")
    once = axes[1].get_legend_handles_labels()
    drawing.legend(*once, loc="outside lower center", ncols=5, fontsize=7)
    return drawing


def layouts(cube: xr.Dataset) -> Figure:
    """Draw planned layouts of some questions from a corner and from above."""
    shown = [str(q) for q in cube["question"].values if "read" not in str(q)]
    across = 3
    rows = -(-len(shown) // across)
    size = (7.6, 3.6 * rows)
    drawing, grid = subplots(2 * rows, across, figsize=size, layout="constrained", squeeze=False)
    columns = [grid[2 * row : 2 * row + 2, at] for row in range(rows) for at in range(across)]
    for column, question in zip(columns, shown, strict=False):
        at = nearest_option(cube, question, SHOWN_CAMERAS)
        part = cube.sel(question=question).isel(option=at)
        for panel, (_, azimuth, elevation) in zip(column, LAYOUT_VIEWS, strict=False):
            layout_panel(panel, part, azimuth, elevation)
            if question in BLOCKED_QUESTIONS:
                _draw_wall(panel, part, BLOCKED_QUESTIONS[question], azimuth, elevation)
        column[0].set_title(question)
        column[1].set_gid(f"{BELOW_PANEL}-{question}")
    for column in columns[len(shown) :]:
        for panel in column:
            panel.axis("off")
    return drawing


def _draw_wall(
    panel: Axes, part: xr.Dataset, obstacle: str, azimuth: float, elevation: float
) -> None:
    """Draw the face of a wall at Y = 0 or of a machine, behind which no camera may stand."""
    low, high = (getattr(part["camera_position"], end)().item() for end in ("min", "max"))
    reach = max(abs(low), high)
    along, up = np.array([-1, 1, 1, -1]) * reach, np.array([0, 0, 1, 1]) * 0.6 * reach
    across = np.full(4, MACHINE_BOX_MM[0] / 1000 if obstacle == "machine" else 0.0)
    corners = (across, along, up) if obstacle == "machine" else (along, across, up)
    face = flatten_points(np.stack(corners, axis=1), azimuth, elevation)
    panel.fill(*face.T, color=HIGHLIGHT_COLOR, alpha=0.25, lw=1, zorder=2)
    panel.annotate(obstacle, face[1], color=HIGHLIGHT_COLOR, fontsize=8, ha="center", va="top")


def front(cube: xr.Dataset) -> Figure:
    """Plot the error against cost for one question."""
    drawing, panel = subplots(figsize=(7.2, 3.8), layout="constrained")
    one = cube.sel(question=FRONT_QUESTION)
    found, target = np.isfinite(one["cost"].values), table_parameter(cube, "target_percent")
    best = cheapest_option(one, target)
    chosen = 0 if best is None else int(np.sum(found[:best]))
    one = one.isel(option=found).assign(chosen=chosen)
    front_panel(panel, one, None if best is None else target)
    return drawing
