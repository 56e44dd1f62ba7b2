"""Figures of ``cameras``, drawn from its cube, and further values for its tables."""

import json
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from thesis_lib.arrays import Array
from thesis_lib.facts import claims, setups
from thesis_lib.plotting import style
from thesis_lib.studies.cubes import iterate_slices
from thesis_lib.vision.optics import picture_height

FIGURE_SIZE_IN = (7.2, 3.3)
DRAWN_DEPTH_STEP = 6  # of the drawn depths, so that dots stand apart
NORMAL_MM = 50  # the lens of eq. 2.20
CLAIMED_SIDES = {  # side: its name in words, and the claimed number of eq. 2.20
    "width": ("across", "view-across"),
    "height": ("up", "view-up"),
    "diagonal": ("diagonally", "view-diagonal"),
}
ERROR_CURVES = {
    "projection_error": ("largest error, px", "-", style.RED),
    "relative_projection_error": ("the same, % of the row of markers", "--", style.ORANGE),
    "depth_range": ("spread of the depths, ± %", ":", style.REFERENCE_COLOR),
}


def view(cube: xr.Dataset) -> Figure:
    """Plot the angle of view against focal length, and against that times the crop factor."""
    drawing, (left, right) = style.subplots(1, 2, figsize=FIGURE_SIZE_IN, sharey=True)
    ordered = cube.sortby("focal_length")
    f = ordered["focal_length"].values * 1000
    for i, one in enumerate(iterate_slices(ordered, "sensor")):
        width, height = one["sensor_size"].values[:2] * 1000
        look = {"color": style.cycle_color(i), "lw": 1.2, "marker": "osD^v"[i % 5], "ms": 3.5}
        name = f"{one['sensor'].item()}, {width:g}×{height:g} mm"
        left.plot(f, one["angle_of_view"].sel(side="width"), label=name, **look)
        diagonal = one["angle_of_view"].sel(side="diagonal")
        right.plot(f * float(one["crop_factor"]), diagonal, **look)
    style.make_logarithmic(left.xaxis, [10, 20, 50, 100])
    style.make_logarithmic(right.xaxis, [10, 20, 50, 100, 200, 500])
    left.set(title="(a) across", xlabel="focal length f in mm", ylabel="angle of view in °")
    left.set_ylim(0, None)
    right.set(title="(b) diagonally: one curve for all", xlabel="f times crop factor in mm")
    left.legend(handlelength=1.6, fontsize=7)
    return drawing


def projection(cube: xr.Dataset) -> Figure:
    """Plot the markers by a pinhole and with one depth, and their distance."""
    drawing, (left, right) = style.subplots(1, 2, figsize=FIGURE_SIZE_IN, width_ratios=[1.25, 1])
    near = cube.isel(shown_distance=int(np.argmin(cube["shown_distance"].values)))
    (u, v), (flat_u, flat_v) = near["image"].values
    left.plot([u, flat_u], [v, flat_v], color=style.REFERENCE_COLOR, lw=0.6)
    look = {"ls": "none", "marker": "o", "ms": 3.5}
    left.plot(u, v, color=style.BLUE, label="pinhole", **look)
    left.plot(flat_u, flat_v, color=style.RED, mfc="none", label="one depth for all", **look)
    title = f"(a) the markers from {1000 * float(near['shown_distance']):g} mm"
    left.set(title=title, xlabel="u in px", ylabel="v in px", aspect="equal")
    left.invert_yaxis()
    left.margins(y=0.7)
    left.legend(loc="lower center", ncols=2, columnspacing=1)
    d = cube["distance"].values * 1000
    asked = np.isin(cube["distance"].values, cube["shown_distance"].values)
    for name, (words, line, ink) in ERROR_CURVES.items():
        values = cube[name].values
        right.plot(d, values, line, label=words, lw=1.5, color=ink)
        right.plot(d[asked], values[asked], color=ink, **look)
    _label_distances(right, d)
    style.make_logarithmic(right.yaxis, [0.2, 0.5, 1, 2, 5, 10, 20, 50])
    right.set(title="(b) the error of one depth")
    right.legend(loc="lower left")
    return drawing


def pixels(cube: xr.Dataset) -> Figure:
    """Show an image with coarser and coarser pixels."""
    number, rows, columns = cube["pixelated"].shape
    size = (6.8, number * (6.6 * rows / columns + 0.3))
    drawing, axes = style.subplots(number, 1, figsize=size, squeeze=False)
    for part, axis in zip(iterate_slices(cube, "width"), axes[:, 0], strict=True):
        axis.imshow(part["pixelated"].values, cmap="gray", vmin=0, vmax=255, interpolation="none")
        axis.set_title(
            f"{int(part['width'])} pixels across: {1000 * float(part['pixel_size']):.2g} mm each; "
            f"contrast of the markers {float(part['marker_contrast']):.0f} %"
        )
        axis.axis("off")
    return drawing


def mosaic(cube: xr.Dataset) -> Figure:
    """Show a marker in colours, through the filters, interpolated, and the error."""
    drawing, axes = style.subplots(2, 2, figsize=(6.4, 4.6))
    titles = ("(a) true colours", "(b) recorded mosaic", "(c) interpolated")
    for axis, picture, title in zip(axes.flat, cube["colour_picture"].values, titles, strict=False):
        axis.imshow(np.clip(picture, 0, 1), interpolation="none")
        axis.set_title(title)
    true, _, found = cube["colour_picture"].values
    error, last = 100 * np.abs(found - true).max(axis=-1), axes[1, 1]
    image = last.imshow(error, cmap="magma", vmin=0, interpolation="none")
    last.set_title("(d) error of the worst colour")
    drawing.colorbar(image, ax=last, label="% of full scale", shrink=0.8)
    for axis in axes.flat:
        axis.axis("off")
    return drawing


def sharpness(cube: xr.Dataset) -> Figure:
    """Plot the nearest and farthest sharp depth against the focused distance."""
    drawing, axes = style.subplots(figsize=(6.0, 3.6))
    d = cube["distance"].values * 1000
    top = 2 * d.max()
    parts = list(iterate_slices(cube.sortby("f_number", ascending=False), "f_number"))
    for part, ink in zip(parts, style.ordered_colors(len(parts))[::-1], strict=True):
        near, far = (part[name].values * 1000 for name in ("near_limit", "far_limit"))
        far = np.where(np.isfinite(far), far, 10 * top)
        axes.fill_between(d, near, far, color=ink, alpha=0.18, lw=0)
        axes.plot(d, near, color=ink, lw=1.3, label=f"f/{float(part.f_number):g}")
        axes.plot(d, far, color=ink, lw=1.3)
    axes.plot(d, d, color=style.REFERENCE_COLOR, lw=0.8, label="focused distance")
    for name, word in (("nearest_depth", "nearest and farthest marker"), ("farthest_depth", "_")):
        axes.plot(d, cube[name].values * 1000, color=style.INK_COLOR, lw=1, ls="--", label=word)
    _label_distances(axes, d, "focused distance d in mm")
    style.make_logarithmic(axes.yaxis, [200, 500, 1000, 2000, 5000, 10000])
    axes.set(ylabel="sharp depths in mm", ylim=(800 * float(cube["near_limit"].min()), top))
    drawing.legend(loc="outside right center")
    return drawing


def stereo(cube: xr.Dataset) -> Figure:
    """Plot the depth error of two parallel cameras against distance."""
    drawing, axes = style.subplots(figsize=(6.0, 3.8))
    d, some = cube["distance"].values * 1000, slice(None, None, DRAWN_DEPTH_STEP)
    inks = style.ordered_colors(cube.sizes["baseline"])
    for part, ink in zip(iterate_slices(cube, "baseline"), inks, strict=True):
        words, fine = f"b = {1000 * float(part['baseline']):g} mm", part["depth_error"] * 1000
        axes.plot(d, fine, color=ink, lw=1.4, label=words)
        axes.plot(d, part["rounding_depth_error"] * 1000, color=ink, lw=1, ls="--")
        axes.plot(d[some], part["rounded_depth_error"][some] * 1000, "o", color=ink, ms=3)
    drawn = {"ls": "none", "marker": "o", "ms": 3}
    kinds = {"fine centres": {}, "whole pixels, first order": {"ls": "--"}}
    style.name_styles(axes, {**kinds, "whole pixels, drawn": drawn})
    _label_distances(axes, d)
    style.make_logarithmic(axes.yaxis, [0.1, 1, 10, 100, 1000, 10000])
    axes.set(ylabel="error of the depth in mm")
    axes.legend(ncols=2, columnspacing=1)
    return drawing


def _label_distances(axes: Axes, d: Array, label: str = "distance d in mm") -> None:
    style.make_logarithmic(axes.xaxis, [500, 1000, 2000, 5000, 10000])
    axes.set(xlim=(d.min(), d.max()), xlabel=label)


def choose_lens(cube: xr.Dataset) -> dict[str, Any]:
    """Return the cube at the focal length that is nearest to the book's."""
    book = json.loads(cube.attrs["parameters"])["focal_length_mm"] / 1000
    nearest = int(abs(cube["focal_length"] - book).argmin("focal_length"))
    return {"lens": cube.isel(focal_length=nearest)}


def normal_lens(cube: xr.Dataset) -> dict[str, Any]:
    """Return the angles of equation 2.20, the length that such a lens sees, and the beam's."""
    one = cube.isel(sensor=0).sel(focal_length=NORMAL_MM / 1000)
    numbers = {number.id: number for number in claims.read_numbers()}
    nearest = 1000 * float(cube["shown_distance"].min())
    half = np.radians(float(one["angle_of_view"].sel(side="width"))) / 2
    return {
        "rows": [(w, one.sel(side=side), numbers[n]) for side, (w, n) in CLAIMED_SIDES.items()],
        "nearest": nearest,
        "seen": 2 * nearest * np.tan(half),
        "beam": 1000 * setups.thesis_beam().length,
    }


def at_distances(cube: xr.Dataset, ends_only: int = 0) -> dict[str, Any]:
    """Return the cube at each of the distances asked for, or at the first and the last."""
    places = cube["shown_distance"].values
    parts = [cube.sel(distance=place, shown_distance=place) for place in places]
    shown = parts[:: max(len(parts) - 1, 1)] if ends_only else parts
    return {"parts": shown, "nearest": parts[int(np.argmin(places))], "digits": _three_digits}


def _three_digits(metres: xr.DataArray) -> str:
    """Format a length in millimetres with three significant digits."""
    value = 1000 * float(metres)
    return "–" if np.isnan(value) else f"{value:.{max(0, 2 - int(np.floor(np.log10(value))))}f}"


def pixel_flows() -> list[tuple[int, int, float]]:
    """Return width and pixels of a frame, and frames per second, at chapter 5's pixel rate."""
    widths = setups.setup_table("beam", "resolution")["widths_px"]
    rate = setups.setup_table("experiment", "rig")["frame_rate_hz"]
    counts = {width: width * picture_height(width, 16, 9) for width in widths}
    return [(w, number, rate * max(counts.values()) / number) for w, number in counts.items()]


TEXTS = {
    "flow": lambda _: {"flows": pixel_flows()},
    "sensors": choose_lens,
    "lens": normal_lens,
    **dict.fromkeys(("horizons", "projections", "focus", "stereo"), at_distances),
}
