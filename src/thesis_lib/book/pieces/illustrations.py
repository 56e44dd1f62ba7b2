"""Figures that stand in chapters, one to a step of the argument: of cubes or of facts."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from thesis_lib import files
from thesis_lib.book import missing
from thesis_lib.book.pieces import guide, schematics
from thesis_lib.figure_sets import cube_file, display
from thesis_lib.plotting.selection import error_bars, select
from thesis_lib.plotting.style import (
    COLORS,
    INK,
    color,
    in_style,
    logarithmic,
    subplots,
    svg,
)

MODE = 3  # of the curves over what is varied
TICKS = {"aperture": (20, 50, 100, 160), "arrays": (2, 4, 6, 8, 12)}  # else what was computed
LABELS = {
    "distance": "distance in mm",
    "aperture": "aperture in °",
    "resolution": "pixels across the picture",
    "arrays": "number of cameras",
}


def varied(of: str, cube: xr.Dataset) -> Figure:
    """Mean error over what is varied: median and band of the trials, and the law of rounding."""
    drawing, axes = subplots(figsize=(5.2, 3.2), layout="constrained")  # to be read on a phone
    cases = list(dict.fromkeys(cube["case"].values.tolist()))
    for i, case in enumerate(cases):
        values = select(cube, case, MODE)["value"].values
        bars, order = error_bars(cube, case, MODE), np.argsort(values)
        low, median, high = bars.band[:, order]
        at = values[order] * 1.02 ** (i - (len(cases) - 1) / 2)  # side by side
        style = {"color": color(i), "markersize": 4}
        axes.errorbar(
            at,
            median,
            [median - low, high - median],
            fmt="osD^v*"[i],
            linewidth=1,
            label=f"case {case.replace(chr(39), '′')}",
            **style,
        )
        axes.plot(at, bars.predicted[order], color=color(i), linewidth=1)
    logarithmic(axes.xaxis, TICKS.get(of, np.unique(cube["value"]).tolist()))
    logarithmic(axes.yaxis, [1, 2, 3, 5, 10, 20, 30, 50])
    axes.set(xlabel=LABELS[of], ylabel=f"mean error in mode {MODE}, %")
    if len(cases) > 1:
        drawing.legend(loc="outside upper left", ncols=3, columnspacing=1)
    return drawing


def leaps(cube: xr.Dataset) -> Figure:
    """Error over elevation: median of the trials, and the law of the distance and the height."""
    drawing, axes = subplots(figsize=(6.4, 3.0), layout="constrained")
    for i, case in enumerate(dict.fromkeys(cube["case"].values.tolist())):
        part, bars = select(cube, case, 1), error_bars(cube, case, 1)
        low, median, high = bars.band
        axes.errorbar(
            part["value"].values,
            median,
            [median - low, high - median],
            fmt="osD^v"[i] + "-",
            color=color(i),
            markersize=4,
            linewidth=1,
            label=case.replace("-", " "),
        )
    logarithmic(axes.yaxis, [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5])
    axes.set(xlabel="elevation in °", ylabel="mean error, %", xlim=(0, None))
    axes.legend()
    return drawing


def far_and_wide(cube: xr.Dataset) -> Figure:
    """Error over distance and over aperture: median and band of the trials, and the law."""
    drawing, panels = subplots(1, 2, figsize=(7.2, 2.8), layout="constrained", sharey=True)
    for axes, case, unit in zip(panels, ("distance", "aperture"), ("mm", "°"), strict=True):
        part, bars = select(cube, case, 1), error_bars(cube, case, 1)
        low, median, high = bars.band
        values, bounds = part["value"].values, [median - low, high - median]
        axes.errorbar(values, median, bounds, fmt="o", color=COLORS[0], label="rendered frames")
        axes.plot(values, bars.predicted, "--", color=INK, label="law, one noise for all")
        logarithmic(axes.xaxis, values.tolist()[:: 1 + len(values) // 6])
        logarithmic(axes.yaxis, [0.01, 0.02, 0.05, 0.1, 0.2])
        axes.set(xlabel=f"{case} in {unit}")
    panels[0].set_ylabel("mean error, %")
    panels[0].legend()
    return drawing


def ways(cube: xr.Dataset) -> Figure:
    """Error over the frame rate of the ways to read too few frames, by mode."""
    modes = cube["mode"].values.tolist()
    drawing, panels = subplots(
        1, len(modes), figsize=(7.2, 2.8), layout="constrained", sharey=True, squeeze=False
    )
    for axes, mode in zip(panels[0], modes, strict=True):
        for i, case in enumerate(dict.fromkeys(cube["case"].values.tolist())):
            part, bars = select(cube, case, mode), error_bars(cube, case, mode)
            style = "--" if case == "known" else "-"
            axes.plot(
                part["value"], bars.band[1], "osD^"[i] + style, color=color(i), ms=4, label=case
            )
        logarithmic(axes.xaxis, cube["frame_rate"].values.tolist())
        logarithmic(axes.yaxis, [0.1, 0.3, 1, 3, 10, 30])
        axes.set(title=f"mode {mode}", xlabel="frames per second")
    panels[0][0].set_ylabel("mean error, %")
    panels[0][-1].legend()
    return drawing


def own_errors(cube: xr.Dataset) -> Figure:
    """Fitted centres beside whole pixels: error of the deflection, mode 1, by what is varied."""
    cases = list(dict.fromkeys(cube["case"].values.tolist()))
    drawing, axes = subplots(figsize=(6.4, 3.0), layout="constrained")
    for i, case in enumerate(cases):
        part, bars = select(cube, case, 1), error_bars(cube, case, 1)
        place = i + np.linspace(-0.3, 0.3, part.sizes["setting"])
        axes.plot(place, bars.band[1], "o-", color=COLORS[0])
        axes.plot(place, part["rounded_error"], "s--", color=COLORS[4])
    handles = [
        Line2D([], [], color=COLORS[0], marker="o", label="fitted centres"),
        Line2D([], [], color=COLORS[4], marker="s", ls="--", label="whole pixels, by the law"),
    ]
    axes.legend(handles=handles, loc="upper center", ncols=2)
    axes.set_xticks(range(len(cases)), cases)
    logarithmic(axes.yaxis, [0.1, 0.3, 1, 3, 10, 30, 100])
    axes.set(ylabel="error of the deflection, %", ylim=(None, 400))
    axes.set_xlabel("what is varied, from its first setting to its last")
    return drawing


def _picture(*of: Any) -> Figure:
    """A figure set's own picture by its name, and what else it is given, of its cube."""
    *which, cube = of
    drawing = display.picture(cube, *which)
    assert drawing is not None
    return drawing


Draw = Callable[[xr.Dataset], Figure]
OF_CUBES: dict[str, tuple[str, Draw]] = {
    **{
        f"{body}-{what}.svg": (f"{body}-{what}", partial(varied, what))
        for body in ("beam", "plate")
        for what in LABELS
    },
    **{
        f"cameras-{name}.svg": ("cameras", partial(_picture, name))
        for name in ("view", "projection", "pixels", "mosaic")
    },
    "layouts-elevation.svg": ("lab-elevation", leaps),
    "layouts-far.svg": ("lab-layout", far_and_wide),
    "layouts-sets.svg": ("lab-layout", partial(display.figure, case="subsets", mode=1)),
    "equal-pixels.svg": ("lab-equal-pixels", partial(_picture, "claim")),
    "motions-ways.svg": ("lab-modes", ways),
    "motions-aliases.svg": ("lab-modes", partial(_picture, "aliases", 2)),
    "motions-plate.svg": ("lab-plate", own_errors),
}
"""By file: the figure set whose cube is drawn, and what draws it."""
OF_FACTS = schematics.OF_FACTS | guide.DRAWINGS
"""By file: what draws it of the thesis's facts, or of nothing."""
NAMES = (*OF_CUBES, *OF_FACTS)


def cube_of(name: str) -> str:
    """The figure set that a figure is drawn of, or that it is of facts."""
    return OF_CUBES[name][0] if name in OF_CUBES else "facts"


def write(made: Sequence[Path], folder: Path, names: Iterable[str] = NAMES) -> None:
    """Write the figures `names` of the cubes `made` into `folder`; one without its cube says so."""
    cubes = {path.stem: path for path in made}
    for name in names:
        file = folder / name
        if name in OF_FACTS:
            with in_style():
                text = svg(OF_FACTS[name]())
        elif OF_CUBES[name][0] in cubes:
            of, draw = OF_CUBES[name]
            style = display.picture_style(of)
            with in_style(style):
                text = svg(draw(cube_file.read(cubes[of])), style)
        else:
            missing.write_placeholder(file, OF_CUBES[name][0])
            continue
        files.whole_text(file, text)
