"""The figures of ``lab-elevation`` and ``lab-layout``, drawn from their cubes.

A case in which one number is varied has four panels: (a) the cameras, (b) the error, with what the
law says if all centres were equally exact, and what scatter and bias of the centres say by
themselves, (c) scatter and bias of the centres, (d) markers that are lost, or where along the beam
the error is.
"""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure, SubFigure
from matplotlib.patches import Rectangle
from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, NullLocator

from thesis_lib.arrays import Array
from thesis_lib.facts import setups
from thesis_lib.figure_sets.lab_layout.optima import TEXTS, complete, expected, optimum, ratios
from thesis_lib.plotting.panels import setup_panel
from thesis_lib.plotting.selection import select
from thesis_lib.plotting.style import COLORS, HIGHLIGHT, REFERENCE, color, subplots
from thesis_lib.studies.cubes import trials_are
from thesis_lib.studies.vocabulary import unit
from thesis_lib.vision.pinhole import hemisphere_directions

__all__ = ["TEXTS", "figure"]
VARIED = {"elevation_deg": "elevation φ", "distance_mm": "distance d", "aperture_deg": "aperture α"}


def figure(cube: xr.Dataset, case: str, mode: int) -> Figure:
    """The figure of a case; the style is that of :func:`thesis_lib.figure_sets.display.figure`."""
    part = select(cube, case, mode)
    return sets(part) if case == "subsets" else _sweep(cube, part)


def _sweep(cube: xr.Dataset, part: xr.Dataset) -> Figure:
    part = part.isel(setting=np.argsort(part["value"].values, kind="stable"))
    drawing, axes = subplots(2, 2, figsize=(7.6, 6.0), layout="constrained")
    setup_panel(axes[0, 0], cube, part)
    axes[0, 0].set_title(f"(a) setups: {VARIED[str(part['parameter'].values[0])]} varied")
    _errors(axes[0, 1], part)
    _centres(axes[1, 0], part)
    if part["parameter"].values[0] == "elevation_deg":
        _lost(axes[1, 1], part)
        sides = axes.flat[1:]
    else:
        _along(axes[1, 1], part)
        sides = axes.flat[1:3]
    for panel in sides:
        _value_axis(panel, part)
    return drawing


def _value_axis(axes: Axes, part: xr.Dataset) -> None:
    """A logarithmic axis with the settings' values as its ticks."""
    values = part["value"].values
    axes.set_xscale("log")
    axes.xaxis.set_major_locator(FixedLocator(values.tolist()))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.set_xticklabels([f"{value:g}" for value in values])
    varied = str(part["parameter"].values[0])
    axes.set_xlabel(f"{VARIED[varied]} in {unit(varied)}")
    axes.set_xlim(values.min() / 1.15, values.max() * 1.15)


def _errors(axes: Axes, part: xr.Dataset) -> None:
    values = part["value"].values
    error = part["mean_error"].transpose("setting", "trial").values
    axes.plot(
        values,
        part["predicted_error"],
        "_",
        color=DARK,
        markersize=10,
        label="law, centres equally exact",
    )
    axes.plot(values, part["noise_error"], "-", color=COLORS[5], linewidth=1, label="scatter alone")
    axes.plot(values, part["bias_error"], "-", color=COLORS[1], linewidth=1, label="bias alone")
    if error.shape[1] > 1:
        low, high = np.quantile(error[:, 1:], [0.05, 0.95], axis=1)
        label = f"5–95 % of {trials_are(part)}"
        axes.vlines(values, low, high, color=COLORS[0], linewidth=1.4, label=label)
        axes.plot(
            values, expected(part), "o", color=COLORS[0], markersize=4, label="rms over these"
        )
    axes.plot(
        values,
        error[:, 0],
        "D",
        markerfacecolor="none",
        color=HIGHLIGHT,
        markersize=4,
        label="rendered run",
    )
    whole = complete(part)
    best = None
    if part["parameter"].values[0] == "elevation_deg":
        best = optimum(whole["value"].values, expected(whole))
    if best is not None:
        axes.axvspan(best.low, best.high, color=COLORS[0], alpha=0.08, linewidth=0)
        axes.axvline(best.at, color=COLORS[0], linewidth=0.8, linestyle=":")
        axes.text(
            best.at,
            0.55,
            f" least at {best.at:.0f}°",
            color=COLORS[0],
            fontsize=8,
            transform=axes.get_xaxis_transform(),
        )
    axes.set_yscale("log")
    axes.set(title="(b) mean (rms) error", ylabel="% of the largest deflection")
    low, high = axes.get_ylim()
    axes.set_ylim(low, high * (high / low) ** 0.45)  # room for the key
    plain_ticks(axes.yaxis)
    axes.legend(ncols=2, loc="upper center", columnspacing=1, handlelength=1.4, fontsize=7)


def _centres(axes: Axes, part: xr.Dataset) -> None:
    values = part["value"].values
    for name, style in (("scatter", "o-"), ("bias", "s:")):
        for axis, tone in (("u", COLORS[4]), ("v", COLORS[2])):
            axes.plot(
                values,
                part[f"centre_{name}"].sel(axis=axis),
                style,
                color=tone,
                markersize=4,
                linewidth=1,
                label=f"{name}, {axis}",
            )
    for axis, tone in (("u", COLORS[4]), ("v", COLORS[2])):
        axes.plot(
            values,
            part["edge_scatter"].sel(axis=axis),
            "_",
            color=tone,
            markersize=9,
            label=f"law of edges, {axis}",
        )
    axes.set_yscale("log")
    axes.set(title="(c) scatter and bias of the centres", ylabel="px")
    low, high = axes.get_ylim()
    axes.set_ylim(low, high * (high / low) ** 0.35)
    plain_ticks(axes.yaxis)
    axes.legend(ncols=3, loc="upper center", columnspacing=1, handlelength=1.8, fontsize=7)


def _lost(axes: Axes, part: xr.Dataset) -> None:
    values = part["value"].values
    axes.plot(values, 100 * part["lost"], "o-", color=DARK, markersize=4, label="lost, of all")
    axes.plot(
        values,
        100 * part["wrong"],
        "D-",
        markerfacecolor="none",
        color=HIGHLIGHT,
        markersize=4,
        linewidth=1,
        label="wrong, of those found",
    )
    for value, height in zip(values, part["image_height"].values, strict=True):
        axes.text(value, 112, f"{height:.1f}", ha="center", fontsize=7, color="#555555")
    axes.text(
        0.5,
        0.93,
        "height of a marker's image in px",
        ha="center",
        fontsize=7,
        color="#555555",
        transform=axes.transAxes,
    )
    axes.set(title="(d) markers that are lost", ylabel="%", ylim=(-4, 134))
    axes.set_yticks([0, 25, 50, 75, 100])
    axes.legend(loc="center right")


def _along(axes: Axes, part: xr.Dataset) -> None:
    error = expected(part)
    if np.isfinite(error).any():
        for index in dict.fromkeys([int(np.nanargmin(error)), int(np.nanargmax(error))]):
            one = part.isel(setting=index)
            name = "best" if index == np.nanargmin(error) else "worst"
            axes.plot(
                one["x"] * 1000,
                one["point_error"],
                ".-",
                color=color(index),
                linewidth=1,
                label=f"{one['label'].item()} ({name})",
            )
        axes.legend()
    axes.set(
        title="(d) error of each marker",
        xlabel="x in mm",
        ylabel="% of the largest deflection",
        ylim=(0, None),
    )


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
