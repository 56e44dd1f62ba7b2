"""Figures of the ledger: claimed against computed values, chapter by chapter."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, NullFormatter

from thesis_lib.figure_sets.claims.tables import TEXTS
from thesis_lib.ledger.entries import Entry, from_cube
from thesis_lib.plotting.style import BLACK_COLOR, CYCLE_COLORS, REFERENCE_COLOR, subplots

__all__ = ["TEXTS", "chapter", "readings"]
VERDICT_MARKS = {  # verdict: colour and shape, so that neither says it alone
    "agrees": (CYCLE_COLORS[0], "o"),
    "within scatter": (CYCLE_COLORS[5], "D"),
    "differs": (CYCLE_COLORS[4], "^"),
}


def chapter(cube: xr.Dataset, number: int) -> Figure:
    """Plot claimed against reproduced errors of a chapter, and their ratios."""
    every = [e for e in from_cube(cube) if e.kind == "figure" and e.chapter == number]
    part = [e for e in every if np.isfinite([e.least, e.most, e.median]).all()]
    drawing, (left, right) = subplots(1, 2, figsize=(7.6, 3.6), layout="constrained")
    bounds = sum(not np.isfinite([e.least, e.most]).all() for e in every)
    _against(left, part, bounds)
    _ratios(right, part)
    return drawing


def _against(axes: Axes, part: Sequence[Entry], bounds: int) -> None:
    ends = [e.least for e in part] + [e.most for e in part] + [e.high for e in part]
    span = np.array([0.7 * min(*ends, *(e.low for e in part)), 1.4 * max(ends)])
    axes.plot(span, span, color=REFERENCE_COLOR, lw=1, zorder=1)
    for verdict, (color, shape) in VERDICT_MARKS.items():
        chosen = [(e.least, e.most, e.low, e.median, e.high) for e in part if e.verdict == verdict]
        if not chosen:
            continue
        least, most, low, median, high = np.array(chosen).T
        stated = np.sqrt(least * most)
        reach, band = (stated - least, most - stated), (median - low, high - median)
        style: Any = {"ls": "none", "marker": shape, "ms": 4, "color": color, "elinewidth": 0.6}
        words = f"{verdict} ({len(chosen)})"
        axes.errorbar(stated, median, band, reach, label=words, **style)
    axes.set(xscale="log", yscale="log", xlim=span, ylim=span, aspect="equal")
    axes.set_title("(a) stated against median and 5–95 % band")
    axes.set(xlabel="stated, %", ylabel="this book, %")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter("{x:g}")
        axis.set_minor_formatter(NullFormatter())
    title = f"without {bounds} bounds" if bounds else None
    axes.legend(loc="upper left", title=title, title_fontsize="small")


def _ratios(axes: Axes, part: Sequence[Entry]) -> None:
    ratios = np.log2([e.median / np.sqrt(e.least * e.most) for e in part])
    verdicts, median = np.array([e.verdict for e in part]), float(np.median(ratios))
    edge = max(1.0, np.ceil(4 * np.abs(ratios).max()) / 4)
    bins = np.arange(-edge, edge + 0.01, 0.25).tolist()
    stacks, names = [ratios[verdicts == v] for v in VERDICT_MARKS], list(VERDICT_MARKS)
    colors = [color for color, _ in VERDICT_MARKS.values()]
    axes.hist(stacks, bins=bins, stacked=True, label=names, color=colors)
    ticks = np.arange(-np.floor(edge), np.floor(edge) + 1)
    axes.set_xticks(ticks, [f"{2.0**tick:g}" for tick in ticks])
    axes.axvline(0, color=REFERENCE_COLOR, lw=1)
    axes.axvline(median, color=BLACK_COLOR, lw=1, ls="--")
    where: Any = {"ha": "right", "va": "top", "transform": axes.transAxes, "fontsize": 8}
    axes.text(0.98, 0.96, f"median ratio {2**median:.2f}", **where)
    axes.yaxis.set_major_locator(MaxNLocator(integer=True))
    axes.set(title="(b) median over stated", xlabel="ratio", ylabel="stated values")


def readings(cube: xr.Dataset) -> Figure:
    """Draw the number of claimed values that each interpretation meets, by chapter."""
    names, inside = cube["reading"].values.tolist(), cube["reading_inside"].values
    total = int(cube["reading_claims"].isel(reading=0).sum())
    drawing, axes = subplots(figsize=(7.6, 0.5 + 0.22 * len(names)), layout="constrained")
    place = np.arange(len(names))[::-1]
    left = np.zeros(len(names))
    for number, color, part in zip((3, 4, 6), CYCLE_COLORS, inside.T, strict=False):
        axes.barh(place, part, 0.75, left, color=color, label=f"chapter {number}")
        left += part
    axes.axvline(left[0], color=BLACK_COLOR, lw=0.8, ls="--")
    axes.set_yticks(place, names, fontsize=8)
    axes.set(xlim=(0, total), xlabel=f"stated values met, of {total}")
    axes.grid(visible=False, axis="y")
    axes.legend(
        loc="upper center", bbox_to_anchor=(0.4, 1.0), ncols=3, bbox_transform=drawing.transFigure
    )
    return drawing
