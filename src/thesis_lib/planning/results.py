"""A plan as a labelled cube, as a table of cameras, as figures and as a view that can be turned."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from thesis_lib.arrays import Array
from thesis_lib.planning.errors import predicted
from thesis_lib.planning.planner import Option, Plan
from thesis_lib.planning.positions import centres
from thesis_lib.plotting.style import (
    COLORS,
    HIGHLIGHT,
    INK,
    REFERENCE,
    color,
    in_style,
    logarithmic,
    subplots,
)
from thesis_lib.studies.cubes import percent_text
from thesis_lib.studies.schema import declared, labelled
from thesis_lib.vision.pinhole import hemisphere_rotations
from thesis_lib.web.fragment import VIEWER_CSS, joined, static_html

COLUMNS = (
    "camera",
    "x_mm",
    "y_mm",
    "z_mm",
    "azimuth_deg",
    "elevation_deg",
    "distance_mm",
    "focal_length_mm",
    "width_px",
    "height_px",
    "frame_rate_hz",
)


def camera_table(cube: xr.Dataset, option: int) -> str:
    """Return the cameras of an option as CSV."""
    one = cube.isel(option=option)
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    for i in range(int(one["n_cameras"])):
        camera = one.isel(camera=i)
        lengths = (1000 * camera["camera_position"].values).tolist()
        angles = [float(camera["camera_azimuth"]), float(camera["camera_elevation"])]
        lens = [1000 * float(camera["camera_distance"]), 1000 * float(camera["focal_length"])]
        place = [f"{round(value, 3) + 0.0:.3f}" for value in (*lengths, *angles)]
        size = int(one["width_px"]), int(one["height_px"])
        rate = f"{float(one['frame_rate']):g}"
        writer.writerow([i + 1, *place, f"{lens[0]:.3f}", f"{lens[1]:g}", *size, rate])
    return text.getvalue()


OF_SOUND = declared("""
    shape_plan_error(option, mode) [percent] error of the sound by the law of the layout for the
        shape
""")
XYZ = ("x", "y", "z")

VARIABLES = declared("""
    n_cameras(option) [1] number of cameras
    width_px(option) [1] width of the pictures in pixels
    height_px(option) [1] height of the pictures in pixels
    frame_rate(option) [Hz] frame rate
    pixel_rate(option) [s-1] pixels per second of all cameras
    cost(option) [1] price of all cameras, or pixels per second of all cameras
    expected_error(option) [percent] error of the worst mode if every coordinate had an independent
        error of 1/6 px2
    bound(option) [percent] what the averaged error of no layout on the grid of the search can be
        below
    predicted_error(option, mode) [percent] error by the law of rounding
    simulated_error(option, mode) [percent] rms error over the trials
    simulated_low(option, mode) [percent] 5 % quantile of the error of the trials
    simulated_high(option, mode) [percent] 95 % quantile of the error of the trials
    on_front(option) [1] 1 if no other is cheaper or more accurate, else 0
    chosen() [1] the option that is proposed
    camera_azimuth(option, camera) [degree] azimuth of a camera
    camera_elevation(option, camera) [degree] elevation of a camera
    camera_distance(option, camera) [m] distance of a camera from the centre
    camera_position(option, camera, axis) [m] position of a camera
    focal_length(option, camera) [m] focal length of a camera
    point_error(mode, point) [percent] error of each marker by the law, of the proposed option
    marker(point, axis) [m] marker at rest
    normal(point, axis) [1] unit vector along which a marker moves
    reference_deflection(mode, point) [m] deflection of the markers
    outline(corner, axis) [m] corner of the structure, or of the box around a structure
    frequency(mode) [Hz] natural frequency
""")


def as_cube(plan: Plan) -> xr.Dataset:
    """Return the cube of a plan: every option, the proposed one marker by marker."""
    options, body = plan.options, plan.body
    best = options[plan.chosen]
    most = max(len(one.layout) for one in options)
    places = np.full((len(options), most, 7), np.nan)
    for row, one in zip(places, options, strict=True):
        row[: len(one.layout)] = _camera_rows(one, plan)
    verified = plan.verified
    values: dict[str, Any] = {
        "n_cameras": [len(one.layout) for one in options],
        "width_px": [one.resolution[0] for one in options],
        "height_px": [one.resolution[1] for one in options],
        "frame_rate": [one.frame_rate for one in options],
        "pixel_rate": [one.pixel_rate for one in options],
        "cost": [one.cost for one in options],
        "expected_error": [one.expected for one in options],
        "bound": [one.bound for one in options],
        "predicted_error": [one.predicted for one in options],
        "simulated_error": [one.simulated for one in verified],
        "simulated_low": [one.band[0] for one in verified],
        "simulated_high": [one.band[1] for one in verified],
        "on_front": [int(i in plan.front) for i in range(len(options))],
        "chosen": plan.chosen,
        "camera_azimuth": places[:, :, 0],
        "camera_elevation": places[:, :, 1],
        "camera_distance": places[:, :, 2],
        "focal_length": places[:, :, 3],
        "camera_position": places[:, :, 4:],
        "point_error": predicted(best.scene, best.layout, best.resolution[0]),
        "marker": body.points.T,
        "normal": body.normals.T,
        "reference_deflection": body.shapes * np.array(plan.request.peaks_m)[:, None],
        "outline": _outline(plan).T,
        "frequency": body.frequencies,
    }
    cube = xr.Dataset(
        coords={
            "mode": ("mode", list(body.modes), {"units": "1", "long_name": "mode number"}),
            "axis": ("axis", list(XYZ), {"units": "1", "long_name": "axis"}),
        },
        attrs={
            "structure": body.name,
            "candidates": np.int64(plan.candidates),
            "cost_is": "price" if plan.request.prices else "pixels per second",
            "objective": plan.request.objective,
            "target_percent": json.dumps(plan.request.target_percent),
        },
    )
    cube = cube.assign(labelled({name: values[name] for name in VARIABLES}, VARIABLES))
    instead = [one.instead.field for one in options if one.instead]
    if not instead:
        return cube
    cube.attrs["goal"] = plan.request.goal
    return cube.assign(labelled({"shape_plan_error": instead}, OF_SOUND))


def _camera_rows(option: Option, plan: Plan) -> np.ndarray[Any, Any]:
    """Azimuth and elevation in degrees, distance and focal length in m, position in m."""
    layout = option.layout
    azimuth = np.mod(np.degrees(layout[:, 0]) + 180, 360) - 180
    focal = layout[:, 3] * plan.request.sensor_width_mm / 1000
    return np.column_stack(
        [azimuth, np.degrees(layout[:, 1]), layout[:, 2], focal, centres(option.scene, layout)]
    )


def _outline(plan: Plan) -> np.ndarray[Any, Any]:
    """Return the structure's corners, or those of the box around its markers as one closed walk."""
    if plan.body.outline.size:
        return plan.body.outline
    low, high = plan.body.points.min(axis=1), plan.body.points.max(axis=1)
    walk = [
        (0, 0, 0),
        (1, 0, 0),
        (1, 1, 0),
        (0, 1, 0),
        (0, 0, 0),
        (0, 0, 1),
        (1, 0, 1),
        (1, 0, 0),
        (1, 0, 1),
        (1, 1, 1),
        (1, 1, 0),
        (1, 1, 1),
        (0, 1, 1),
        (0, 1, 0),
        (0, 1, 1),
        (0, 0, 1),
    ]
    return low[:, None] + np.array(walk).T * (high - low)[:, None]


VIEWS = (("from a corner", 155.0, 28.0), ("from above", 180.0, 90.0), ("along Y", 180.0, 0.0))
_SYMBOLS = "osD^vP*X"
_TICKS = [a * 10.0**b for b in range(-4, 5) for a in (1, 2, 5)]


def layout_figure(cube: xr.Dataset, option: int) -> Figure:
    """Return the cameras of an option from three sides, with lines of sight."""
    with in_style():
        size, ratios = (7.6, 3.1), [1.3, 1, 1]
        drawing, axes = subplots(1, 3, figsize=size, layout="constrained", width_ratios=ratios)
        for axis, (words, azimuth, elevation) in zip(axes, VIEWS, strict=True):
            layout_panel(axis, cube.isel(option=option), azimuth, elevation)
            axis.set_title(words)
    return drawing


def layout_panel(axes: Axes, part: xr.Dataset, azimuth: float, elevation: float) -> None:
    """Draw the cameras of one option in a parallel projection from a direction in degrees."""
    right, down, _ = hemisphere_rotations(*np.radians([azimuth, elevation]))

    def flat(points: Array) -> Array:
        return np.asarray(points @ np.stack([right, -down]).T) * 1000

    outline = part["outline"].values
    outline = outline[np.isfinite(outline).all(axis=1)]
    where = part["camera_position"].values
    where = where[np.isfinite(where).all(axis=1)]
    centre = (outline.max(axis=0) + outline.min(axis=0)) / 2
    if len(outline) == 4:
        axes.fill(*flat(outline).T, color="#9a9a9a", zorder=1)
    else:
        axes.plot(*flat(outline).T, color="#9a9a9a", linewidth=0.8, zorder=1)
    if "marker" in part:
        axes.plot(*flat(part["marker"].values).T, ".", color=INK, markersize=1.5, zorder=2)
    for i, place in enumerate(where):
        sight = flat(np.stack([place, centre]))
        foot = flat(np.stack([place, [place[0], place[1], centre[2]]]))
        axes.plot(*sight.T, color=color(i), linewidth=0.6, alpha=0.6)
        axes.plot(*foot.T, ":", color=REFERENCE, linewidth=0.6)
        axes.plot(*sight[0], "o", color=color(i), markersize=9, zorder=4, clip_on=False)
        n = str(i + 1)
        axes.annotate(n, sight[0], color="white", size=6.5, ha="center", va="center", zorder=5)
    size = max(np.ptp(where, axis=0).max(), np.ptp(outline, axis=0).max()) / 3
    for axis, name in zip(np.eye(3), "XYZ", strict=True):
        line = flat(np.stack([centre, centre + size * axis]))
        if np.linalg.norm(line[1] - line[0]) > 1:
            axes.plot(*line.T, color="#777777", linewidth=0.8, zorder=3)
            axes.annotate(name, line[1], color="#777777", fontsize=8, ha="center", va="bottom")
    axes.set_aspect("equal")
    axes.margins(0.1)
    axes.axis("off")


def front_figure(cube: xr.Dataset, target: float | None = None) -> Figure:
    """Error against cost of every option, and the front of those that nothing beats."""
    with in_style():
        drawing, axes = subplots(figsize=(7.2, 3.8), layout="constrained")
        front_panel(axes, cube, target)
    return drawing


def front_panel(axes: Axes, cube: xr.Dataset, target: float | None = None) -> None:
    """Draw the same in axes: colours are numbers of cameras, symbols resolutions."""
    priced = cube.attrs.get("cost_is") == "price"
    cost = cube["cost"].values / (1.0 if priced else 1e6)
    predicted = cube["predicted_error"].max("mode").values
    simulated = cube["simulated_error"].max("mode").values
    counts, widths = cube["n_cameras"].values, cube["width_px"].values
    front = np.flatnonzero(cube["on_front"].values)
    front = front[np.argsort(cost[front], kind="stable")]
    words = "nothing cheaper is as accurate"
    axes.step(
        cost[front], predicted[front], where="post", color=REFERENCE, linewidth=1.2, label=words
    )
    for i, n in enumerate(np.unique(counts)):
        axes.plot([], [], "s", color=color(i), markersize=5, label=f"{n} cameras")
        for j, width in enumerate(np.unique(widths)):
            at = (counts == n) & (widths == width)
            axes.plot(cost[at], predicted[at], _SYMBOLS[j % 8], color=color(i), markersize=6)
    for j, width in enumerate(np.unique(widths)):
        height = int(cube["height_px"].values[widths == width][0])
        axes.plot([], [], _SYMBOLS[j % 8], color=INK, markersize=5, label=f"{width}×{height} px")
    axes.plot(cost, simulated, "_", color="#222222", markersize=9, label="simulated")
    if target is not None:
        axes.axhline(target, color=HIGHLIGHT, linestyle="--", linewidth=1, label="target")
        at = cost[int(cube["chosen"])], predicted[int(cube["chosen"])]
        words = "cheapest that reaches it"
        axes.plot(*at, "o", markersize=14, markerfacecolor="none", color=HIGHLIGHT, label=words)
    logarithmic(axes.xaxis, [t for t in _TICKS if cost.min() / 2 < t < 2 * cost.max()])
    logarithmic(axes.yaxis, [t for t in _TICKS if predicted.min() / 2 < t < 2 * predicted.max()])
    axes.set_xlabel("price of all cameras" if priced else "million pixels per second, all cameras")
    axes.set_ylabel("error of the worst mode, %")
    axes.legend(loc="center left", bbox_to_anchor=(1, 0.5), fontsize=7)


WITHOUT = "This picture needs JavaScript to be turned; the ones beside it show the same cameras."


def layout_view(plans: Sequence[tuple[str, xr.Dataset, int]]) -> str:
    """Plans as a self-contained HTML fragment.

    Parameters
    ----------
    plans : sequence of (str, xarray.Dataset, int)
        Name, options with their cameras, as in a plan's cube, and which option is shown first.
    """
    data = {"plans": [_plan(*one) for one in plans], "tints": list(COLORS)}
    return static_html(joined("layout"), VIEWER_CSS, {"data": data}, WITHOUT)


def _plan(name: str, cube: xr.Dataset, chosen: int) -> dict[str, Any]:
    outline = _finite(cube["outline"].values)
    return {
        "name": name,
        "chosen": chosen,
        "centre": ((outline.max(axis=0) + outline.min(axis=0)) / 2).tolist(),
        "outline": outline.tolist(),
        "markers": cube["marker"].values.tolist() if "marker" in cube else [],
        "options": [_option(cube, i) for i in range(cube.sizes["option"])],
    }


def _option(cube: xr.Dataset, index: int) -> dict[str, Any]:
    one = cube.isel(option=index)
    label = f"{int(one['n_cameras'])} of {int(one['width_px'])}×{int(one['height_px'])} px"
    error, simulated = (
        percent_text(float(one[f"{name}_error"].max())) for name in ("predicted", "simulated")
    )
    errors = f"{error} % predicted, {simulated} % simulated, in the worst mode."
    return {
        "label": label,
        "words": f"{label} at {float(one['frame_rate']):g} Hz: {errors}",
        "table": camera_table(cube, index),
    }


def _finite(points: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """Points (points, 3) without the rows that only fill up."""
    return points[np.isfinite(points).all(axis=1)]
