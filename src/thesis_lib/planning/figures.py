"""A plan as figures and as a view that can be turned."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from thesis_lib.arrays import Array
from thesis_lib.planning.results import camera_table
from thesis_lib.plotting.style import (
    BLACK_COLOR,
    CYCLE_COLORS,
    HIGHLIGHT_COLOR,
    INK_COLOR,
    REFERENCE_COLOR,
    TICK_STEPS,
    cycle_color,
    in_style,
    make_logarithmic,
    name_styles,
    ordered_colors,
    subplots,
)
from thesis_lib.studies.cubes import percent_text
from thesis_lib.vision.pinhole import hemisphere_rotations
from thesis_lib.web.fragment import VIEWER_CSS, join_modules, static_html

LAYOUT_VIEWS = (
    ("from a corner", 155.0, 28.0),
    ("from above", 180.0, 90.0),
    ("along Y", 180.0, 0.0),
)
_LINE_SYMBOLS = "osD^vP*X"
NO_SCRIPT_TEXT = (
    "This picture needs JavaScript to be turned; the ones beside it show the same cameras."
)


def layout_figure(cube: xr.Dataset, option: int) -> Figure:
    """Return the cameras of an option from three sides, with lines of sight."""
    with in_style():
        size, ratios = (7.6, 3.1), [1.3, 1, 1]
        drawing, axes = subplots(1, 3, figsize=size, layout="constrained", width_ratios=ratios)
        for axis, (words, azimuth, elevation) in zip(axes, LAYOUT_VIEWS, strict=True):
            layout_panel(axis, cube.isel(option=option), azimuth, elevation)
            axis.set_title(words)
    return drawing


def flatten_points(points: Array, azimuth: float, elevation: float) -> Array:
    """Project points (n, 3) in m along a direction in degrees, (n, 2) in mm."""
    right, down, _ = hemisphere_rotations(*np.radians([azimuth, elevation]))
    return np.asarray(points @ np.stack([right, -down]).T) * 1000


def layout_panel(axes: Axes, part: xr.Dataset, azimuth: float, elevation: float) -> None:
    """Draw the cameras of one option in a parallel projection from a direction in degrees."""

    def flat(points: Any) -> Array:
        return flatten_points(np.asarray(points), azimuth, elevation)

    outline, where = (_finite(part[name].values) for name in ("outline", "camera_position"))
    centre = (outline.max(axis=0) + outline.min(axis=0)) / 2
    if len(outline) == 4:
        axes.fill(*flat(outline).T, color="#9a9a9a", zorder=1)
    else:
        axes.plot(*flat(outline).T, color="#9a9a9a", linewidth=0.8, zorder=1)
    if "marker" in part:
        axes.plot(*flat(part["marker"].values).T, ".", color=INK_COLOR, markersize=1.5, zorder=2)
    for i, place in enumerate(where):
        sight, foot = flat([place, centre]), flat([place, [place[0], place[1], centre[2]]])
        axes.plot(*sight.T, color=cycle_color(i), linewidth=0.6, alpha=0.6)
        axes.plot(*foot.T, ":", color=REFERENCE_COLOR, linewidth=0.6)
        axes.plot(*sight[0], "o", color=cycle_color(i), markersize=9, zorder=4, clip_on=False)
        n = str(i + 1)
        axes.annotate(n, sight[0], color="white", size=6.5, ha="center", va="center", zorder=5)
    size = max(np.ptp(where, axis=0).max(), np.ptp(outline, axis=0).max()) / 3
    for axis, name in zip(np.eye(3), "XYZ", strict=True):
        line = flat([centre, centre + size * axis])
        if np.linalg.norm(line[1] - line[0]) > 1:
            axes.plot(*line.T, color="#777777", linewidth=0.8, zorder=3)
            axes.annotate(name, line[1], color="#777777", fontsize=8, ha="center", va="bottom")
    axes.set_aspect("equal")
    axes.margins(0.1)
    axes.axis("off")


def front_figure(cube: xr.Dataset, target: float | None = None) -> Figure:
    """Return the error against cost of every option, and the front of those that nothing beats."""
    with in_style():
        drawing, axes = subplots(figsize=(7.2, 3.8), layout="constrained")
        front_panel(axes, cube, target)
    return drawing


def front_panel(axes: Axes, cube: xr.Dataset, target: float | None = None) -> None:
    """Draw the same in axes: colours are numbers of cameras, symbols resolutions."""
    priced = cube.attrs.get("cost_is") == "price"
    cost = cube["cost"].values / (1.0 if priced else 1e6)
    predicted, simulated = (
        cube[f"{name}_error"].max("mode").values for name in ("predicted", "simulated")
    )
    counts, widths = cube["n_cameras"].values, cube["width_px"].values
    front = np.flatnonzero(cube["on_front"].values)
    front = front[np.argsort(cost[front], kind="stable")]
    line: Any = {"color": REFERENCE_COLOR, "linewidth": 1.2, "where": "post"}
    axes.step(cost[front], predicted[front], label="nothing cheaper is as accurate", **line)
    numbers = np.unique(counts)
    symbols = {w: _LINE_SYMBOLS[j % 8] for j, w in enumerate(np.unique(widths))}
    inks = ordered_colors(len(numbers))
    for n, ink in zip(numbers, inks, strict=True):
        for width, symbol in symbols.items():
            at = (counts == n) & (widths == width)
            axes.plot(cost[at], predicted[at], symbol, color=ink, markersize=6)
    heights = {width: int(cube["height_px"].values[widths == width][0]) for width in symbols}
    dots: dict[str, dict[str, Any]] = {
        f"{n} cameras": {"color": ink, "marker": "s"} for n, ink in zip(numbers, inks, strict=True)
    }
    dots |= {f"{w}×{heights[w]} px": {"marker": symbol} for w, symbol in symbols.items()}
    name_styles(axes, {label: {"ls": "none", "ms": 5, **style} for label, style in dots.items()})
    axes.plot(cost, simulated, "_", color=BLACK_COLOR, markersize=9, label="simulated")
    if target is not None:
        axes.axhline(target, color=HIGHLIGHT_COLOR, linestyle="--", linewidth=1, label="target")
        at = cost[int(cube["chosen"])], predicted[int(cube["chosen"])]
        ring: Any = {"markersize": 14, "markerfacecolor": "none", "color": HIGHLIGHT_COLOR}
        axes.plot(*at, "o", label="cheapest that reaches it", **ring)
    for axis, values in ((axes.xaxis, cost), (axes.yaxis, predicted)):
        low, high = values.min() / 2, 2 * values.max()
        make_logarithmic(axis, [tick for tick in TICK_STEPS if low < tick < high])
    axes.set_xlabel("price of all cameras" if priced else "million pixels per second, all cameras")
    axes.set_ylabel("error of the worst mode, %")
    axes.legend(loc="center left", bbox_to_anchor=(1, 0.5), fontsize=7)


def layout_view(plans: Sequence[tuple[str, xr.Dataset, int]]) -> str:
    """Return plans as a self-contained HTML fragment.

    Parameters
    ----------
    plans : sequence of (str, xarray.Dataset, int)
        Name, options with their cameras, as in a plan's cube, and which option is shown first.
    """
    data = {"plans": [_describe_plan(*one) for one in plans], "tints": list(CYCLE_COLORS)}
    return static_html(join_modules("layout"), VIEWER_CSS, {"data": data}, NO_SCRIPT_TEXT)


def _describe_plan(name: str, cube: xr.Dataset, chosen: int) -> dict[str, Any]:
    outline = _finite(cube["outline"].values)
    return {
        "name": name,
        "chosen": chosen,
        "centre": ((outline.max(axis=0) + outline.min(axis=0)) / 2).tolist(),
        "outline": outline.tolist(),
        "markers": cube["marker"].values.tolist() if "marker" in cube else [],
        "options": [_describe_option(cube, i) for i in range(cube.sizes["option"])],
    }


def _describe_option(cube: xr.Dataset, index: int) -> dict[str, Any]:
    one = cube.isel(option=index)
    label = f"{int(one['n_cameras'])} of {int(one['width_px'])}×{int(one['height_px'])} px"
    error, simulated = (
        percent_text(float(one[f"{name}_error"].max())) for name in ("predicted", "simulated")
    )
    errors = f"{error} % predicted, {simulated} % simulated, in the worst mode."
    words = f"{label} at {float(one['frame_rate']):g} Hz: {errors}"
    return {"label": label, "words": words, "table": camera_table(cube, index)}


def _finite(points: Array) -> Array:
    """Return the points (points, 3) without the rows that only fill up."""
    return points[np.isfinite(points).all(axis=1)]
