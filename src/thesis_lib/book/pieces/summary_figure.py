"""The whole thesis in one figure: error against each of the five knobs."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, NullLocator, StrMethodFormatter

from thesis_lib import files
from thesis_lib.book.pieces.factors import FACTORS, Curve, Factor, read_curves
from thesis_lib.book.pieces.opened import Cubes
from thesis_lib.figure_sets import cube_file
from thesis_lib.plotting.style import CYCLE_COLORS, figure_svg, in_style, subplots

FIGURE_FILE = "conclusions.svg"
PANEL_GROUPS = dict(
    zip(
        ("beam", "plate", "sound", "experiment"),
        CYCLE_COLORS[:2] + CYCLE_COLORS[2:3] + CYCLE_COLORS[4:5],
        strict=True,
    )
)
PANEL_TITLES = {
    "closer": "(a) distance, mm",
    "wider": "(b) aperture, °",
    "lower": "(c) elevation, °",
    "finer": "(d) width, px",
    "more": "(e) cameras",
}
PANEL_TICKS = {
    "closer": (500, 750, 1000, 1500),
    "wider": (20, 50, 150),
    "lower": (5, 10, 20, 60),
    "finer": (320, 640, 1920),
    "more": (2, 4, 6, 12),
}


def draw_summary(opened: Cubes) -> Figure:
    """Return five panels, one for each factor, all with the same axis of errors.

    A line is one case, the geometric mean over modes and planes of the rms over the trials; a
    diamond is one figure that the thesis states.
    """
    with in_style():
        drawing, panels = subplots(1, 5, figsize=(9.6, 3.6), sharey=True, layout="constrained")
        for axes, (name, factor) in zip(panels, FACTORS.items(), strict=True):
            _draw_factor(axes, list(read_curves(opened, factor)))
            _format_error_axis(axes, name, factor)
        panels[0].set(yscale="log", ylabel="rms error, %")
        panels[0].yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
        drawing.legend(
            handles=_draw_legend(),
            loc="outside lower center",
            ncols=3,
            columnspacing=1.2,
            handlelength=1.8,
        )
    return drawing


def _draw_factor(axes: Axes, found: Sequence[Curve]) -> None:
    by: dict[tuple[str, str], list[Curve]] = {}
    for curve in found:
        by.setdefault((curve.group, curve.case), []).append(curve)
        axes.plot(
            curve.values,
            curve.claimed,
            "D",
            color=_choose_color(curve.group),
            markersize=4,
            markerfacecolor="none",
            markeredgewidth=0.7,
            alpha=0.8,
            zorder=3,
        )
    for (group, _), alike in by.items():
        mean = np.exp(np.mean([np.log(curve.rms) for curve in alike], axis=0))
        axes.plot(
            alike[0].values,
            mean,
            "--" if "rendered" in group else "-",
            color=_choose_color(group),
            linewidth=1.2,
            marker=".",
            markersize=4,
        )


def _format_error_axis(axes: Axes, name: str, factor: Factor) -> None:
    axes.set(xscale="log", title=PANEL_TITLES[name])
    axes.xaxis.set_major_locator(FixedLocator(PANEL_TICKS[name]))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    if factor.better < 0:  # to the right is what should measure better
        axes.invert_xaxis()


def _choose_color(group: str) -> str:
    return PANEL_GROUPS[group.partition(",")[0]]


def _draw_legend() -> list[Line2D]:
    lines = [Line2D([], [], color=color, label=name) for name, color in PANEL_GROUPS.items()]
    grey = "#555555"
    rendered = Line2D([], [], color=grey, linestyle="--", label="rendered recordings")
    stated = Line2D(
        [],
        [],
        color=grey,
        linestyle="",
        marker="D",
        markersize=4,
        markerfacecolor="none",
        label="thesis",
    )
    return [*lines, rendered, stated]


def list_used_cubes(made: Iterable[Path]) -> list[Path]:
    """Return the result files that the figure shows."""
    names = {name for factor in FACTORS.values() for _, name, _, _ in factor.sources}
    return [path for path in made if path.stem in names]


def write_summary_figure(made: Iterable[Path], folder: Path) -> None:
    """Draw the figure of the cubes `made` into a folder; those that it lacks are left out."""
    opened = {path.stem: cube_file.read_cube(path) for path in list_used_cubes(made)}
    text = figure_svg(draw_summary(opened))
    files.whole_text(folder / FIGURE_FILE, text)
