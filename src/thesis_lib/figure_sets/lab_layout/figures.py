"""The figures of ``lab-elevation`` and ``lab-layout``, drawn from their cubes.

A case in which one number is varied has four panels: (a) the cameras, (b) the error, with what the
law says if all centres were equally exact, and what scatter and bias of the centres say by
themselves, (c) scatter and bias of the centres, (d) markers that are lost, or where along the beam
the error is.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure, SubFigure
from matplotlib.patches import Rectangle
from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, NullLocator

from thesis_lib.arrays import Array
from thesis_lib.facts import setups
from thesis_lib.figure_sets.lab_layout.optima import (
    TEXTS,
    find_optimum,
    law_ratios,
    predict_errors,
    select_complete,
)
from thesis_lib.plotting.panels import setup_panel
from thesis_lib.plotting.selection import select_settings
from thesis_lib.plotting.style import (
    BEST_COLOR,
    CYCLE_COLORS,
    HIGHLIGHT_COLOR,
    REFERENCE_COLOR,
    WORST_COLOR,
    draw_curves,
    ordered_colors,
    subplots,
)
from thesis_lib.studies.cubes import trials_are
from thesis_lib.studies.fields import unit_of_field
from thesis_lib.vision.pinhole import hemisphere_directions

__all__ = ["TEXTS", "figure"]
DARK_GREY, PALE_GREY = "#222222", "#c8c8c8"
LAW_CURVE = {"predicted_error": ("law, centres equally exact", "_", DARK_GREY)}
PART_CURVES = {
    "noise_error": ("scatter alone", "-", CYCLE_COLORS[5]),
    "bias_error": ("bias alone", "-", CYCLE_COLORS[1]),
}
_LINE_STYLE: Any = {"markersize": 4, "linewidth": 1}
CENTRE_CURVES: list[tuple[str, str, str, Any]] = [  # variable, label, line, style
    ("centre_scatter", "scatter", "o-", _LINE_STYLE),
    ("centre_bias", "bias", "s:", _LINE_STYLE),
    ("edge_scatter", "law of edges", "_", {"markersize": 9}),
]
VARIED_NAMES = {
    "elevation_deg": "elevation φ",
    "distance_mm": "distance d",
    "aperture_deg": "aperture α",
}


def figure(cube: xr.Dataset, case: str, mode: int) -> Figure:
    """Draw the figure of a case."""
    part = select_settings(cube, case, mode)
    return draw_sets(part) if case == "subsets" else _draw_sweep(cube, part)


def _draw_sweep(cube: xr.Dataset, part: xr.Dataset) -> Figure:
    part = part.isel(setting=np.argsort(part["value"].values, kind="stable"))
    drawing, axes = subplots(2, 2, figsize=(7.6, 6.0), layout="constrained")
    setup_panel(axes[0, 0], cube, part)
    axes[0, 0].set_title(f"(a) setups: {VARIED_NAMES[str(part['parameter'].values[0])]} varied")
    _draw_errors(axes[0, 1], part)
    _draw_centres(axes[1, 0], part)
    if part["parameter"].values[0] == "elevation_deg":
        _draw_lost(axes[1, 1], part)
        sides = axes.flat[1:]
    else:
        _draw_along(axes[1, 1], part)
        sides = axes.flat[1:3]
    for panel in sides:
        _value_axis(panel, part)
    return drawing


def _value_axis(axes: Axes, part: xr.Dataset) -> None:
    """Make a logarithmic axis with the settings' values as its ticks."""
    values = part["value"].values
    axes.set_xscale("log")
    axes.xaxis.set_major_locator(FixedLocator(values.tolist()))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.set_xticklabels([f"{value:g}" for value in values])
    varied = str(part["parameter"].values[0])
    axes.set_xlabel(f"{VARIED_NAMES[varied]} in {unit_of_field(varied)}")
    axes.set_xlim(values.min() / 1.15, values.max() * 1.15)


def _draw_errors(axes: Axes, part: xr.Dataset) -> None:
    values, error = part["value"].values, part["mean_error"].transpose("setting", "trial").values
    draw_curves(axes, values, part, LAW_CURVE, markersize=10)
    draw_curves(axes, values, part, PART_CURVES, linewidth=1)
    if error.shape[1] > 1:
        low, high = np.quantile(error[:, 1:], [0.05, 0.95], axis=1)
        label = f"5–95 % of {trials_are(part)}"
        axes.vlines(values, low, high, color=CYCLE_COLORS[0], linewidth=1.4, label=label)
        style: Any = {"color": CYCLE_COLORS[0], "markersize": 4}
        axes.plot(values, predict_errors(part), "o", label="rms over these", **style)
    style = {"markerfacecolor": "none", "color": HIGHLIGHT_COLOR, "markersize": 4}
    axes.plot(values, error[:, 0], "D", label="rendered run", **style)
    whole = select_complete(part)
    best = None
    if part["parameter"].values[0] == "elevation_deg":
        best = find_optimum(whole["value"].values, predict_errors(whole))
    if best is not None:
        axes.axvspan(best.low, best.high, color=CYCLE_COLORS[0], alpha=0.08, linewidth=0)
        axes.axvline(best.at, color=CYCLE_COLORS[0], linewidth=0.8, linestyle=":")
        where: Any = {"fontsize": 8, "transform": axes.get_xaxis_transform()}
        axes.text(best.at, 0.55, f" least at {best.at:.0f}°", color=CYCLE_COLORS[0], **where)
    axes.set_yscale("log")
    axes.set(title="(b) mean (rms) error", ylabel="% of the largest deflection")
    _add_key(axes, room=0.45, ncols=2, handlelength=1.4)


def _add_key(axes: Axes, room: float, **how: Any) -> None:
    """Add plain ticks and a legend, in some room above what is drawn."""
    low, high = axes.get_ylim()
    axes.set_ylim(low, high * (high / low) ** room)
    plain_ticks(axes.yaxis)
    axes.legend(loc="upper center", columnspacing=1, fontsize=7, **how)


def _draw_centres(axes: Axes, part: xr.Dataset) -> None:
    values = part["value"].values
    for name, label, style, how in CENTRE_CURVES:
        for axis, tone in (("u", CYCLE_COLORS[4]), ("v", CYCLE_COLORS[2])):
            one = part[name].sel(axis=axis)
            axes.plot(values, one, style, color=tone, label=f"{label}, {axis}", **how)
    axes.set_yscale("log")
    axes.set(title="(c) scatter and bias of the centres", ylabel="px")
    _add_key(axes, room=0.35, ncols=3, handlelength=1.8)


def _draw_lost(axes: Axes, part: xr.Dataset) -> None:
    values, grey = part["value"].values, "#555555"
    axes.plot(values, 100 * part["lost"], "o-", color=DARK_GREY, markersize=4, label="lost, of all")
    style: Any = {
        "markerfacecolor": "none",
        "color": HIGHLIGHT_COLOR,
        "markersize": 4,
        "linewidth": 1,
    }
    axes.plot(values, 100 * part["wrong"], "D-", label="wrong, of those found", **style)
    for value, height in zip(values, part["image_height"].values, strict=True):
        axes.text(value, 112, f"{height:.1f}", ha="center", fontsize=7, color=grey)
    where: Any = {"ha": "center", "fontsize": 7, "color": grey, "transform": axes.transAxes}
    axes.text(0.5, 0.93, "height of a marker's image in px", **where)
    axes.set(title="(d) markers that are lost", ylabel="%", ylim=(-4, 134))
    axes.set_yticks([0, 25, 50, 75, 100])
    axes.legend(loc="center right")


def _draw_along(axes: Axes, part: xr.Dataset) -> None:
    error = predict_errors(part)
    if np.isfinite(error).any():
        for index in dict.fromkeys([int(np.nanargmin(error)), int(np.nanargmax(error))]):
            one, name = (
                part.isel(setting=index),
                "best" if index == np.nanargmin(error) else "worst",
            )
            style: Any = {"color": BEST_COLOR if name == "best" else WORST_COLOR, "linewidth": 1}
            label = f"{one['label'].item()} ({name})"
            axes.plot(one["x"] * 1000, one["point_error"], ".-", label=label, **style)
        axes.legend()
    axes.set(title="(d) error of each marker", xlabel="x in mm", ylim=(0, None))
    axes.set_ylabel("% of the largest deflection")


def plain_ticks(axis: Axis) -> None:
    """Put ticks of a logarithmic axis at 1, 2 and 5 times powers of ten, or at these alone."""
    low, high = axis.get_view_interval()
    subs = (1.0, 2.0, 5.0) if high / low < 100 else (1.0,)
    axis.set_major_locator(LogLocator(subs=subs))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_locator(NullLocator())


def draw_sets(part: xr.Dataset) -> Figure:
    """Draw all sets, from their part of the cube."""
    drawing = Figure(figsize=(7.6, 6.6), layout="constrained")
    parts = drawing.subfigures(2, 2, squeeze=False, height_ratios=[1.0, 1.05])
    _draw_plans(parts[0, 0], part)
    count = part["n_cameras"].values
    numbers = np.unique(count).tolist()
    tones = dict(zip(numbers, ordered_colors(len(numbers)), strict=True))
    _against_the_law(parts[0, 1].subplots(), part, tones)
    _draw_ratio(parts[1, 0].subplots(), part)
    _by_number(parts[1, 1].subplots(), part)
    return drawing


def _draw_plans(place: SubFigure, part: xr.Dataset) -> None:
    """Draw plans of the best and the worst sets of two, three and four cameras."""
    error, count = predict_errors(part), part["n_cameras"].values
    shown = [int(n) for n in np.unique(count) if np.isfinite(error[count == n]).any()][:3]
    panels = place.subplots(2, max(len(shown), 1), squeeze=False)
    every = _camera_places(part.isel(setting=int(np.argmax(count))))
    reach = 1.25 * np.abs(every).max()
    length, width = (1000 * side for side in setups.thesis_beam().extent)
    for column, n in enumerate(shown):
        own = np.flatnonzero((count == n) & np.isfinite(error))
        order = own[np.argsort(error[own], kind="stable")]
        for axes, index, word in zip(
            panels[:, column], order[[0, -1]], ("best", "worst"), strict=True
        ):
            one = part.isel(setting=int(index))
            axes.add_patch(
                Rectangle(
                    (-length / 2, -width / 2), length, width, color=REFERENCE_COLOR, linewidth=0
                )
            )
            axes.plot(*every.T, ".", color="#cccccc", markersize=3)
            for name, (x, y) in zip(
                str(one["label"].item()).split("–"), _camera_places(one), strict=True
            ):
                axes.plot([0, x], [0, y], color=CYCLE_COLORS[0], linewidth=0.6, alpha=0.6)
                axes.plot(x, y, "o", color=CYCLE_COLORS[0], markersize=4)
                axes.annotate(name, (1.17 * x, 1.17 * y), ha="center", va="center", fontsize=7)
            axes.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal")
            axes.set_title(f"{word} {n}: {error[index]:.3g} %", fontsize=8, loc="center")
            axes.axis("off")
    place.suptitle("(a) best and worst sets in plan", fontsize=9, x=0.02, ha="left")


def _camera_places(setting: xr.Dataset) -> Array:
    """Return the cameras of one setting in plan, X and Y in mm, shape (cameras, 2)."""
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
    law, error = part["predicted_error"].values, predict_errors(part)
    literal, count = part["mean_error"].values[:, 0], part["n_cameras"].values
    axes.plot(law, literal, ".", color=PALE_GREY, markersize=3, label="rendered run")
    for n, tone in tones.items():
        axes.plot(law[count == n], error[count == n], ".", color=tone, markersize=4, label=f"{n}")
    both = np.concatenate([law, error])
    both = both[np.isfinite(both)]
    if both.size:
        ends = [both.min(), both.max()]
        axes.plot(ends, ends, color=DARK_GREY, linewidth=0.8)
    axes.set(xscale="log", yscale="log", ylabel="error, %")
    axes.set(xlabel="law, % of the largest deflection")
    axes.set(title=f"(b) rms over {trials_are(part)} against the law")
    for axis in (axes.xaxis, axes.yaxis):
        plain_ticks(axis)
    axes.legend(ncols=2, fontsize=7, columnspacing=1, handletextpad=0.2)


def _draw_ratio(axes: Axes, part: xr.Dataset) -> None:
    trials = law_ratios(part)
    literal = part["mean_error"].values[:, 0] / part["predicted_error"].values
    both = np.concatenate([trials, literal])
    both = both[np.isfinite(both)]
    if both.size:
        bins = np.linspace(min(both.min(), 0.98), max(both.max(), 1.02), 31).tolist()
        axes.hist(literal, bins, color=PALE_GREY, label="rendered run")
        label = f"rms over {trials_are(part)}"
        axes.hist(trials, bins, histtype="step", color=CYCLE_COLORS[0], label=label)
        axes.legend()
    axes.axvline(1, color=DARK_GREY, linewidth=0.8)
    axes.set(title="(c) error over the law", xlabel="ratio", ylabel="sets")


def _by_number(axes: Axes, part: xr.Dataset) -> None:
    error, count = predict_errors(part), part["n_cameras"].values
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
    axes.plot(count, error, ".", color=PALE_GREY, markersize=4)
    for values, style, name in zip(
        rows, ("v-", "o-", "^-"), ("best", "mean", "worst"), strict=True
    ):
        how: Any = {
            **_LINE_STYLE,
            "color": CYCLE_COLORS[0],
            "alpha": 1.0 if name == "mean" else 0.6,
        }
        axes.plot(n, values, style, label=name, **how)
    root = rows[0, 0] * np.sqrt(n[0] / n)
    axes.plot(n, root, "--", color=DARK_GREY, linewidth=1, label="best pair, as 1/√n")
    axes.set(yscale="log", xlabel="cameras", title="(d) error by the number of cameras")
    axes.set_ylabel("% of the largest deflection")
    plain_ticks(axes.yaxis)
    axes.set_xticks(n)
    axes.legend()
