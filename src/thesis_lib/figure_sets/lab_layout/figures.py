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
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullLocator

from thesis_lib.figure_sets.lab_layout.optima import complete, expected, optimum
from thesis_lib.figure_sets.lab_layout.set_figures import DARK, plain_ticks, sets
from thesis_lib.plotting.panels import setup_panel
from thesis_lib.plotting.selection import select
from thesis_lib.plotting.style import COLORS, HIGHLIGHT, color, subplots
from thesis_lib.studies.cubes import trials_are
from thesis_lib.studies.vocabulary import unit

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
