"""Figures of ``cameras``, drawn from its cube."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from thesis_lib.arrays import Array
from thesis_lib.plotting.style import (
    CYCLE_COLORS,
    INK_COLOR,
    REFERENCE_COLOR,
    cycle_color,
    make_logarithmic,
    subplots,
)

FIGURE_SIZE_IN = (7.2, 3.3)  # inches
DRAWN_DEPTH_STEP = 6  # of the drawn depths, so that dots stand apart


def view(cube: xr.Dataset) -> Figure:
    """Plot the angle of view against focal length, and against that times the crop factor."""
    drawing, (left, right) = subplots(
        1, 2, figsize=FIGURE_SIZE_IN, layout="constrained", sharey=True
    )
    f = cube["focal_length"].values * 1000
    order = np.argsort(f)
    for i, sensor in enumerate(cube["sensor"].values):
        one = cube.sel(sensor=sensor)
        width, height = one["sensor_size"].values[:2] * 1000
        style = {"color": cycle_color(i), "lw": 1.2, "marker": "osD^v"[i % 5], "ms": 3.5}
        name = f"{sensor}, {width:g}×{height:g} mm"
        across, diagonal = (one["angle_of_view"].sel(side=s).values for s in ("width", "diagonal"))
        left.plot(f[order], across[order], label=name, **style)
        right.plot(f[order] * float(one["crop_factor"]), diagonal[order], **style)
    make_logarithmic(left.xaxis, [10, 20, 50, 100])
    make_logarithmic(right.xaxis, [10, 20, 50, 100, 200, 500])
    left.set(
        title="(a) across",
        xlabel="focal length f in mm",
        ylabel="angle of view in °",
        ylim=(0, None),
    )
    right.set(title="(b) diagonally: one curve for all", xlabel="f times crop factor in mm")
    left.legend(handlelength=1.6, fontsize=7)
    return drawing


def projection(cube: xr.Dataset) -> Figure:
    """Plot the markers by a pinhole and with one depth, and their distance."""
    drawing, (left, right) = subplots(
        1, 2, figsize=FIGURE_SIZE_IN, layout="constrained", width_ratios=[1.25, 1]
    )
    near = int(np.argmin(cube["shown_distance"].values))
    (u, v), (flat_u, flat_v) = cube["image"].values[near]
    for start, end in zip(zip(u, v, strict=True), zip(flat_u, flat_v, strict=True), strict=True):
        left.plot(*zip(start, end, strict=True), color=REFERENCE_COLOR, lw=0.6)
    left.plot(u, v, "o", color=CYCLE_COLORS[0], ms=3.5, label="pinhole")
    left.plot(
        flat_u, flat_v, "o", color=CYCLE_COLORS[4], ms=3.5, mfc="none", label="one depth for all"
    )
    distance = cube["shown_distance"].values[near] * 1000
    left.set(
        title=f"(a) the markers from {distance:g} mm",
        xlabel="u in px",
        ylabel="v in px",
        aspect="equal",
    )
    left.invert_yaxis()
    left.margins(y=0.7)
    left.legend(loc="lower center", ncols=2, columnspacing=1)
    d = cube["distance"].values * 1000
    asked = np.isin(cube["distance"].values, cube["shown_distance"].values)
    for name, style, words in (
        ("projection_error", {"color": CYCLE_COLORS[4]}, "largest error, px"),
        (
            "relative_projection_error",
            {"color": CYCLE_COLORS[1], "ls": "--"},
            "the same, % of the row of markers",
        ),
        ("depth_range", {"color": REFERENCE_COLOR, "ls": ":"}, "spread of the depths, ± %"),
    ):
        values = cube[name].values
        right.plot(d, values, label=words, lw=1.5, **style)
        right.plot(d[asked], values[asked], "o", color=style["color"], ms=3.5)
    _distances(right, d)
    make_logarithmic(right.yaxis, [0.2, 0.5, 1, 2, 5, 10, 20, 50])
    right.set(title="(b) the error of one depth")
    right.legend(loc="lower left")
    return drawing


def pixels(cube: xr.Dataset) -> Figure:
    """Show an image with coarser and coarser pixels."""
    number = cube.sizes["width"]
    rows, columns = cube["pixelated"].shape[1:]
    height = 6.6 * rows / columns + 0.3
    drawing, axes = subplots(
        number, 1, figsize=(6.8, number * height), squeeze=False, layout="constrained"
    )
    for one, axis in zip(range(number), axes[:, 0], strict=True):
        part = cube.isel(width=one)
        axis.imshow(part["pixelated"].values, cmap="gray", vmin=0, vmax=255, interpolation="none")
        axis.set_title(
            f"{int(part['width'])} pixels across: {1000 * float(part['pixel_size']):.2g} mm each; "
            f"contrast of the markers {float(part['marker_contrast']):.0f} %"
        )
        axis.axis("off")
    return drawing


def mosaic(cube: xr.Dataset) -> Figure:
    """Show a marker in colours, through the filters, interpolated, and the error."""
    true, raw, found = cube["colour_picture"].values
    drawing, axes = subplots(2, 2, figsize=(6.4, 4.6), layout="constrained")
    shown = (
        (true, "(a) what is there"),
        (raw, "(b) what the sensor records"),
        (found, "(c) interpolated"),
    )
    for axis, (picture, title) in zip(axes.flat, shown, strict=False):
        axis.imshow(np.clip(picture, 0, 1), interpolation="none")
        axis.set_title(title)
    last = axes[1, 1]
    error = 100 * np.abs(found - true).max(axis=-1)
    image = last.imshow(error, cmap="magma", vmin=0, interpolation="none")
    last.set_title("(d) error of the worst colour")
    drawing.colorbar(image, ax=last, label="% of full scale", shrink=0.8)
    for axis in axes.flat:
        axis.axis("off")
    return drawing


def sharpness(cube: xr.Dataset) -> Figure:
    """Plot the nearest and farthest sharp depth against the focused distance."""
    drawing, axes = subplots(figsize=(6.0, 3.6), layout="constrained")
    d = cube["distance"].values * 1000
    top = 2 * d.max()
    least = float(cube["near_limit"].min()) * 1000
    for i in np.argsort(-cube["f_number"].values):
        part = cube.isel(f_number=i)
        near, far = (part[name].values * 1000 for name in ("near_limit", "far_limit"))
        far = np.where(np.isfinite(far), far, 10 * top)
        axes.fill_between(d, near, far, color=cycle_color(int(i)), alpha=0.18, lw=0)
        axes.plot(d, near, color=cycle_color(int(i)), lw=1.3, label=f"f/{float(part.f_number):g}")
        axes.plot(d, far, color=cycle_color(int(i)), lw=1.3)
    axes.plot(d, d, color=REFERENCE_COLOR, lw=0.8)
    for name, word in (("nearest_depth", "nearest and farthest marker"), ("farthest_depth", "")):
        axes.plot(d, cube[name].values * 1000, color=INK_COLOR, lw=1, ls="--", label=word or "_")
    _distances(axes, d, "focused distance d in mm")
    make_logarithmic(axes.yaxis, [200, 500, 1000, 2000, 5000, 10000])
    axes.set(ylabel="sharp depths in mm", ylim=(0.8 * least, top))
    axes.legend(loc="upper left")
    return drawing


def stereo(cube: xr.Dataset) -> Figure:
    """Plot the depth error of two parallel cameras against distance."""
    drawing, axes = subplots(figsize=(6.0, 3.8), layout="constrained")
    d = cube["distance"].values * 1000
    for i, baseline in enumerate(cube["baseline"].values):
        part = cube.isel(baseline=i)
        fine, law, drawn = (
            part[name].values * 1000
            for name in ("depth_error", "rounding_depth_error", "rounded_depth_error")
        )
        axes.plot(d, fine, color=cycle_color(i), lw=1.4, label=f"b = {1000 * baseline:g} mm")
        axes.plot(d, law, color=cycle_color(i), lw=1, ls="--")
        axes.plot(d[::DRAWN_DEPTH_STEP], drawn[::DRAWN_DEPTH_STEP], "o", color=cycle_color(i), ms=3)
    for style, word in (
        ({"ls": "-"}, "fine centres"),
        ({"ls": "--"}, "whole pixels, first order"),
        ({"ls": "none", "marker": "o", "ms": 3}, "whole pixels, drawn"),
    ):
        axes.plot([], [], color=INK_COLOR, lw=1, label=word, **style)
    _distances(axes, d)
    make_logarithmic(axes.yaxis, [0.1, 1, 10, 100, 1000, 10000])
    axes.set(ylabel="error of the depth in mm")
    axes.legend(ncols=2, columnspacing=1)
    return drawing


def _distances(axes: Axes, d: Array, label: str = "distance d in mm") -> None:
    make_logarithmic(axes.xaxis, [500, 1000, 2000, 5000, 10000])
    axes.set(xlim=(d.min(), d.max()), xlabel=label)
