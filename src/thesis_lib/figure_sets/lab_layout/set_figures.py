"""The figure of all sets of some cameras.

It has four panels: (a) the best and the worst as plans, (b) the error against the law, (c) their
ratio, (d) the error by the number of cameras.
"""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure, SubFigure
from matplotlib.patches import Rectangle
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from thesis_lib.arrays import Array
from thesis_lib.facts import setups
from thesis_lib.figure_sets.lab_layout.optima import expected, ratios
from thesis_lib.plotting.style import COLORS, REFERENCE, color
from thesis_lib.studies.cubes import trials_are
from thesis_lib.vision.pinhole import hemisphere_directions

DARK = "#222222"


def plain_ticks(axis: Axis) -> None:
    """Ticks of a logarithmic axis at 1, 2 and 5 times powers of ten, or at powers of ten alone."""
    low, high = axis.get_view_interval()
    subs = (1.0, 2.0, 5.0) if high / low < 100 else (1.0,)
    axis.set_major_locator(LogLocator(subs=subs))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_locator(NullLocator())


def sets(part: xr.Dataset) -> Figure:
    """All sets, from their part of the cube."""
    drawing = Figure(figsize=(7.6, 6.6), layout="constrained")
    parts = drawing.subfigures(2, 2, squeeze=False, height_ratios=[1.0, 1.05])
    _plans(parts[0, 0], part)
    count = part["n_cameras"].values
    tones = {int(n): color(i) for i, n in enumerate(np.unique(count))}
    _against_the_law(parts[0, 1].subplots(), part, tones)
    _ratio(parts[1, 0].subplots(), part)
    _by_number(parts[1, 1].subplots(), part)
    return drawing


def _plans(place: SubFigure, part: xr.Dataset) -> None:
    """Plans of the best and the worst sets of two, three and four cameras."""
    error, count = expected(part), part["n_cameras"].values
    shown = [int(n) for n in np.unique(count) if np.isfinite(error[count == n]).any()][:3]
    panels = place.subplots(2, max(len(shown), 1), squeeze=False)
    every = _places(part.isel(setting=int(np.argmax(count))))
    reach = 1.25 * np.abs(every).max()
    length, width = (1000 * side for side in setups.beam().extent)
    for column, n in enumerate(shown):
        own = np.flatnonzero((count == n) & np.isfinite(error))
        order = own[np.argsort(error[own], kind="stable")]
        for axes, index, word in zip(
            panels[:, column], order[[0, -1]], ("best", "worst"), strict=True
        ):
            one = part.isel(setting=int(index))
            axes.add_patch(
                Rectangle((-length / 2, -width / 2), length, width, color=REFERENCE, linewidth=0)
            )
            axes.plot(*every.T, ".", color="#cccccc", markersize=3)
            for name, (x, y) in zip(str(one["label"].item()).split("–"), _places(one), strict=True):
                axes.plot([0, x], [0, y], color=COLORS[0], linewidth=0.6, alpha=0.6)
                axes.plot(x, y, "o", color=COLORS[0], markersize=4)
                axes.annotate(name, (1.17 * x, 1.17 * y), ha="center", va="center", fontsize=7)
            axes.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal")
            axes.set_title(f"{word} {n}: {error[index]:.3g} %", fontsize=8, loc="center")
            axes.axis("off")
    place.suptitle("(a) best and worst sets in plan", fontsize=9, x=0.02, ha="left")


def _places(setting: xr.Dataset) -> Array:
    """Cameras of one setting in plan, X and Y in mm, shape (cameras, 2)."""
    azimuth, elevation = (
        np.radians(setting[f"camera_{a}"].values) for a in ("azimuth", "elevation")
    )
    centres = (
        1000
        * setting["camera_distance"].values[:, None]
        * hemisphere_directions(azimuth, elevation)
    )
    return np.asarray(centres[np.isfinite(centres[:, 0]), :2])


def _against_the_law(axes: Axes, part: xr.Dataset, tones: dict[int, str]) -> None:
    law, error = part["predicted_error"].values, expected(part)
    literal, count = part["mean_error"].values[:, 0], part["n_cameras"].values
    axes.plot(law, literal, ".", color="#c8c8c8", markersize=3, label="rendered run")
    for n, tone in tones.items():
        axes.plot(law[count == n], error[count == n], ".", color=tone, markersize=4, label=f"{n}")
    both = np.concatenate([law, error])
    both = both[np.isfinite(both)]
    if both.size:
        ends = [both.min(), both.max()]
        axes.plot(ends, ends, color=DARK, linewidth=0.8)
    axes.set(
        xscale="log",
        yscale="log",
        xlabel="law, % of the largest deflection",
        ylabel="error, %",
        title=f"(b) rms over {trials_are(part)} against the law",
    )
    for axis in (axes.xaxis, axes.yaxis):
        plain_ticks(axis)
    axes.legend(ncols=2, fontsize=7, columnspacing=1, handletextpad=0.2)


def _ratio(axes: Axes, part: xr.Dataset) -> None:
    trials = ratios(part)
    literal = part["mean_error"].values[:, 0] / part["predicted_error"].values
    both = np.concatenate([trials, literal])
    both = both[np.isfinite(both)]
    if both.size:
        bins = np.linspace(min(both.min(), 0.98), max(both.max(), 1.02), 31).tolist()
        axes.hist(literal, bins, color="#c8c8c8", label="rendered run")
        axes.hist(
            trials, bins, histtype="step", color=COLORS[0], label=f"rms over {trials_are(part)}"
        )
        axes.legend()
    axes.axvline(1, color=DARK, linewidth=0.8)
    axes.set(title="(c) error over the law", xlabel="ratio", ylabel="sets")


def _by_number(axes: Axes, part: xr.Dataset) -> None:
    error, count = expected(part), part["n_cameras"].values
    known = np.isfinite(error)
    n = np.unique(count[known])
    if not len(n):
        axes.set(title="(d) error by the number of cameras")
        return
    rows = np.array(
        [
            [function(error[known & (count == k)]) for k in n]
            for function in (np.min, np.mean, np.max)
        ]
    )
    axes.plot(count, error, ".", color="#c8c8c8", markersize=4)
    for values, style, name in zip(
        rows, ("v-", "o-", "^-"), ("best", "mean", "worst"), strict=True
    ):
        axes.plot(
            n,
            values,
            style,
            color=COLORS[0],
            markersize=4,
            linewidth=1,
            label=name,
            alpha=1.0 if name == "mean" else 0.6,
        )
    axes.plot(
        n, rows[0, 0] * np.sqrt(n[0] / n), "--", color=DARK, linewidth=1, label="best pair, as 1/√n"
    )
    axes.set(
        yscale="log",
        xlabel="cameras",
        ylabel="% of the largest deflection",
        title="(d) error by the number of cameras",
    )
    plain_ticks(axes.yaxis)
    axes.set_xticks(n)
    axes.legend()
