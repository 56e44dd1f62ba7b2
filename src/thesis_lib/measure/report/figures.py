"""Pictures of a measurement: the shape, the cameras, what they saw, how well the fit is."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from thesis_lib.arrays import Array, Image
from thesis_lib.measure.recordings.check import markers_of
from thesis_lib.measure.recordings.manifest_model import Manifest
from thesis_lib.plotting.style import (
    COLORS,
    HIGHLIGHT,
    REFERENCE,
    color,
    drawable,
    in_style,
    subplots,
)

WIDE = 7.6  # inches
SHOWN = 1000  # px of the width at which photographs are kept
SIGMAS = 2  # standard errors that bars show


def shape(data: xr.Dataset, manifest: Manifest) -> Figure:
    """The deflection of every marker with its standard error, and the most similar mode."""
    rows = markers_of(manifest).rows
    with in_style():
        if len(rows) <= 6 and max(row.stop - row.start for row in rows) >= 4:
            return _rows(data, rows)
        return _map(data, manifest)


def _rows(data: xr.Dataset, rows: Sequence[slice]) -> Figure:
    figure, axes = subplots(figsize=(WIDE, 3.6), layout="constrained")
    x, y = 1e3 * data["x"].values, 1e3 * data["y"].values
    w, error = 1e3 * data["deflection"].values, 1e3 * data["standard_error"].values
    reference = 1e3 * data["reference_deflection"].values
    for k, row in enumerate(rows):
        if np.isfinite(reference[row]).any():
            name = data.attrs["most_similar"] if k == 0 else None
            axes.plot(x[row], reference[row], color=REFERENCE, linewidth=2.5, label=name)
        axes.errorbar(
            x[row],
            w[row],
            SIGMAS * error[row],
            fmt=".-",
            color=color(k),
            linewidth=0.9,
            capsize=2,
            label=f"row at y = {y[row][0]:.4g} mm",
        )
    axes.set(
        xlabel="x in mm",
        ylabel="deflection in mm",
        title=f"deflection at its maximum; bars are {SIGMAS} standard errors",
    )
    axes.legend()
    return figure


def _map(data: xr.Dataset, manifest: Manifest) -> Figure:
    length, width = manifest.structure.length_mm, manifest.structure.width_mm
    panels = {
        "deflection in mm": 1e3 * data["deflection"].values,
        "standard error in mm": 1e3 * data["standard_error"].values,
    }
    if np.isfinite(data["reference_deflection"].values).any():
        panels[f"{data.attrs['most_similar']} in mm"] = 1e3 * data["reference_deflection"].values
    count = len(panels)
    side = WIDE / count
    figure, axes = subplots(
        1,
        count,
        figsize=(WIDE, min(side * width / length + 0.9, 6)),
        layout="constrained",
        squeeze=False,
    )
    most = float(np.nanmax(np.abs(panels["deflection in mm"])))
    for panel, (title, values) in zip(axes[0], panels.items(), strict=True):
        signed = "error" not in title
        style: Any = (
            {"cmap": "PuOr", "vmin": -most, "vmax": most} if signed else {"cmap": "viridis"}
        )
        drawn = panel.scatter(1e3 * data["x"], 1e3 * data["y"], c=values, s=24, **style)
        panel.set(title=title, xlim=(0, length), ylim=(0, width), aspect="equal", xlabel="x in mm")
        figure.colorbar(drawn, ax=panel, orientation="horizontal", fraction=0.08)
    axes[0, 0].set_ylabel("y in mm")
    return figure


def cameras(data: xr.Dataset, manifest: Manifest) -> Figure:
    """Where the cameras stood, from above and from the side."""
    with in_style():
        figure, axes = subplots(1, 2, figsize=(WIDE, 3.4), layout="constrained")
        length, width = manifest.structure.length_mm, manifest.structure.width_mm
        centre = 1e3 * data["camera_centre"].values
        rest = 1e3 * data["rest_position"].values
        for panel, (i, j), half in ((axes[0], (0, 1), width / 2), (axes[1], (0, 2), 0.0)):
            panel.plot(
                length / 2 * np.array([-1, 1, 1, -1, -1]),
                half * np.array([-1, -1, 1, 1, -1]),
                color=REFERENCE,
            )
            panel.plot(rest[i], rest[j], ".", color=REFERENCE, markersize=2)
            for k, name in enumerate(drawable(data["camera"].values, "camera")):
                panel.plot([centre[k, i], 0], [centre[k, j], 0], color=color(k), linewidth=0.6)
                panel.plot(centre[k, i], centre[k, j], "s", color=color(k))
                panel.annotate(
                    name,
                    (centre[k, i], centre[k, j]),
                    xytext=(5, 5),
                    textcoords="offset points",
                )
            panel.set(aspect="equal", xlabel="x in mm", ylabel=f"{'xyz'[j]} in mm")
            panel.margins(0.12, 0.12 if j == 1 else 0.35)  # names of all on one height fit below
        axes[0].set_title("(a) from above")
        axes[1].set_title("(b) from the side")
    return figure


def corners(data: xr.Dataset) -> Figure:
    """What is left of the board's corners after the adjustment, camera by camera."""
    residuals = data["residuals"].values
    with in_style():
        figure, axes = subplots(figsize=(4.2, 3.8), layout="constrained")
        for k, name in enumerate(drawable(data["camera"].values, "camera")):
            u, v = residuals[k].swapaxes(0, 1).reshape(2, -1)
            axes.plot(u, v, ".", color=color(k), markersize=2, alpha=0.5, label=name)
        most = 1.05 * float(np.nanmax(np.abs(residuals)))
        axes.set(
            aspect="equal",
            xlim=(-most, most),
            ylim=(-most, most),
            xlabel="u in px",
            ylabel="v in px",
            title="corners seen minus computed",
        )
        axes.legend(markerscale=4, ncols=2)
    return figure


def motion(data: xr.Dataset, seen: xr.Dataset) -> Figure:
    """The marker that moves most, folded into one period, as each camera saw it."""
    period, count = 1 / float(data["frequency"]), seen.sizes["camera"]
    rows = -(-count // 2)
    names = drawable([f"camera {name}" for name in seen["camera"].values], "camera")
    with in_style():
        figure, axes = subplots(
            rows,
            2,
            figsize=(WIDE, 0.5 + 1.5 * rows),
            sharex=True,
            layout="constrained",
            squeeze=False,
        )
        for k, panel in enumerate(axes.flat[:count]):
            one = seen.isel(camera=k)
            turns = (one["track_time"].values % period) / period
            panel.plot(turns, one["track"], ".", color=color(k), markersize=3)
            panel.set(title=f"{names[k]}, {'uv'[int(one['track_side'])]} in px")
        for panel in axes.flat[count:]:
            panel.set_visible(False)
        for panel in axes[-1]:
            panel.set_xlabel("time in periods")
    return figure


def residuals(seen: xr.Dataset) -> Figure:
    """How far each camera's centres are, frame by frame, from what all cameras agree on."""
    with in_style():
        figure, axes = subplots(figsize=(WIDE, 2.8), layout="constrained")
        for k, name in enumerate(drawable(seen["camera"].values, "camera")):
            axes.plot(seen["time"], seen["residual"][k], color=color(k), label=name)
        axes.set(xlabel="time in s", ylabel="rms residual in px", ylim=(0, None))
        axes.legend(ncols=4)
    return figure


def photograph(image: Image, found: Array, outline: Array) -> Figure:
    """The first frame of a camera, with the markers found in it and the structure's outline."""
    height, width = image.shape
    around = np.column_stack([found[:, np.isfinite(found[0])], outline])
    margin = 0.04 * width
    left, top = np.clip(np.min(around, axis=1) - margin, 0, None)
    right, bottom = np.minimum(np.max(around, axis=1) + margin, (width, height))
    step = max(int(right - left) // SHOWN, 1)
    with in_style():
        figure = Figure(figsize=(WIDE, WIDE * (bottom - top) / (right - left)))
        axes: Axes = figure.add_axes((0, 0, 1, 1))
        axes.imshow(
            image[::step, ::step], cmap="gray", vmin=0, vmax=255, extent=(0, width, height, 0)
        )
        axes.plot(*found, "+", color=HIGHLIGHT, markersize=5, markeredgewidth=0.8)
        axes.plot(*np.column_stack([outline, outline[:, :1]]), color=COLORS[5], linewidth=0.8)
        axes.set_xlim(left, right)
        axes.set_ylim(bottom, top)
        axes.set_axis_off()
    return figure
