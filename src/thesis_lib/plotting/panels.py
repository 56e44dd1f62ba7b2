"""The standard figure framework of the parametric studies, drawn from a cube.

Four panels as in the thesis: (a) the setups, (b) reference and measured shape, (c) error of each
marker, (d) mean error of each setting. Added here: the 5–95 % band of the trials, the prediction
by the law of rounding, and the claimed values of the thesis. Settings are ordered, and so are their
colours; blue and vermilion are the best and the worst.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from matplotlib.path import Path

from thesis_lib.arrays import Array, ArrayLike
from thesis_lib.facts.claims import Claim
from thesis_lib.plotting import selection, style
from thesis_lib.studies import cubes, schema
from thesis_lib.vision.pinhole import hemisphere_directions, hemisphere_rotations

_BEAM_GRID = {
    "left": 0.079, "right": 0.98, "bottom": 0.093, "top": 0.944, "wspace": 0.21, "hspace": 0.39
}  # fmt: skip
MAX_LINEAR_RATIO = 20.0
"""Ratio of the largest to the least error above which the axis of errors is logarithmic."""


def bar_panel(axes: Axes, part: xr.Dataset, groups: Sequence[selection.Bars]) -> None:
    """Draw the errors of each setting, one or more side by side.

    They are bars on an axis from 0. On a logarithmic axis, for errors that are far apart, they are
    marks, since the length of a bar means nothing there.
    """
    n_settings, width = part.sizes["setting"], 0.7 / len(groups)
    (floor, top), black = _find_limits(groups), style.BLACK_COLOR
    silent = [bars.name for bars in groups if np.isnan(bars.literal).all()]
    for g, bars in enumerate(groups):
        if bars.name in silent:
            continue
        position = np.arange(n_settings) + (g - (len(groups) - 1) / 2) * width
        low, median, high = bars.band
        faint = {"alpha": 0.4 if g else 0.75}
        look: dict[str, Any] = {"color": style.ordered_colors(n_settings), **faint}
        if floor:
            axes.scatter(position, bars.literal, 36, marker="s", **look)
        else:
            axes.bar(position, bars.literal, 0.9 * width, **look)
        alone = {"ls": "none", "marker": "s", "ms": 8, **faint}
        style.name_styles(axes, {bars.name or part.attrs["trial_0"]: alone})
        if np.isfinite(median).all():  # there were trials
            axes.vlines(position, low, high, color=black, lw=1.2)
            words = f"5–95 % of {cubes.trials_are(part)}"
            axes.plot([], [], "|", color=black, ms=10, mew=1.2, label=words)
            axes.plot(position, median, "o", color=black, ms=4, label="median")
        words, size = f"{part.attrs['predicts']}, rms", 18 / len(groups)
        axes.plot(position, bars.predicted, "_", color=black, ms=size, label=words)
        for at, claim in zip(position + 0.54 * width, bars.claims, strict=True):
            if claim:
                _mark_claim(axes, at, claim, 0.3 * width)
    partial, labels = part["in_view"].values < 1, part["label"].values.astype(str)
    names = np.strings.replace(labels, " cameras", "") + np.where(partial, "*", "")
    turn = 30 if n_settings > 4 and max(map(len, names)) > 4 else 0
    axes.set_xticks(np.arange(n_settings), names, fontsize=8, rotation=turn)
    unit = "number of cameras" if labels[0].endswith("cameras") else ""
    cut = "* markers leave the sensor" if partial.any() else ""
    nodal = f"{' and '.join(silent)}: nodal plane" if silent else ""
    axes.set_xlabel("; ".join(filter(None, [unit, cut, nodal])))
    once = {name: line for line, name in zip(*axes.get_legend_handles_labels(), strict=True)}
    crowded = any(c.high > 0.8 * top for bars in groups for c in bars.claims if c)
    room = 1.55 if crowded or len(once) > 4 else 1.35  # of two columns
    if floor:
        ticks = [step * 10.0**power for power in range(-5, 5) for step in (1, 3)]
        style.make_logarithmic(axes.yaxis, ticks)
        axes.set_ylim(floor / 1.5, top * (top / floor) ** (room - 1))
        axes.set_xlim(-0.5, n_settings - 0.5)  # as bars have it
    else:
        axes.set_ylim(0, room * top)
    axes.grid(visible=False, axis="x")
    look = {"fontsize": 7, "columnspacing": 1, "handlelength": 1.4}  # not wider than the panel
    axes.legend(once.values(), once, ncols=2, loc="upper center", **look)


def _mark_claim(axes: Axes, at: float, claim: Claim, reach: float) -> None:
    """Mark the claim of the thesis: a value or interval, or a bound and its allowed side."""
    (least, most), ink = claim.ends, style.HIGHLIGHT_COLOR
    if least is None or most is None:
        marker = "v" if least is None else "^"
        axes.plot([at - reach, at + reach], [claim.high] * 2, lw=1.2, color=ink)
        axes.plot(at, claim.high, marker, ms=5, label="thesis, bound", color=ink)
    else:
        axes.plot([at, at], [least, most], lw=1.2, color=ink)
        axes.plot(at, (least + most) / 2, "D", mfc="white", ms=4, label="thesis", color=ink)


def _find_limits(groups: Sequence[selection.Bars]) -> tuple[float, float]:
    """Return the least error if an axis from 0 hides it, else 0, and the largest, at least 0.1."""
    drawn = np.ravel([[bars.literal, bars.band[2]] for bars in groups])
    stated = [claim.high for bars in groups for claim in bars.claims if claim]
    top = float(np.fmax.reduce([*drawn, 0.1, *stated]))
    every = np.ravel([[bars.literal, bars.predicted, *bars.band] for bars in groups])
    least = float(np.fmin.reduce(every))
    return (least if least > 0 and top > MAX_LINEAR_RATIO * least else 0.0), top


def setup_panel(axes: Axes, cube: xr.Dataset, part: xr.Dataset) -> None:
    """Draw cameras on their hemispheres, seen from a corner, and mark the varied parameter."""
    axes.set_title(f"(a) setups: {cube.attrs['varied_label']} varied")
    cameras = [camera_centres(part.isel(setting=index)) for index in range(part.sizes["setting"])]
    radius = max(np.linalg.norm(c, axis=1).max() for c in cameras)
    turn, arcs = np.linspace(0, 2 * np.pi, 181), np.linspace(0, np.pi, 91)
    circle = np.stack([np.sin(turn), np.cos(turn), 0 * turn], axis=1)
    overhead = np.stack([np.cos(arcs), 0 * arcs, np.sin(arcs)], axis=1)
    for curve in (circle, overhead, overhead[:, [1, 0, 2]]):
        _draw(axes, radius * curve, color="#d0d0d0", lw=0.7)
    half = schema.structure_extent(cube)[0] / 2
    contours = schema.structure_contours(cube)
    seen_curves = [project_parallel(np.insert(c, 2, 0, axis=1)) for c in contours]
    closed = Path.make_compound_path(*(Path([*c, c[0]], closed=True) for c in seen_curves))
    axes.add_patch(PathPatch(closed, color="#9a9a9a", lw=1, zorder=3))
    seen: set[tuple[float, ...]] = set()
    for places, ink in zip(cameras, style.ordered_colors(len(cameras)), strict=True):
        for place in places:
            if (key := tuple(np.round(place, 6))) not in seen:
                seen.add(key)
                _draw(axes, np.array([place, 0 * place]), color=ink, lw=0.6, alpha=0.6)
                axes.plot(*project_parallel(place), "o", color=ink, ms=5, zorder=4)
    varied, red = part["parameter"].values[0], style.HIGHLIGHT_COLOR
    look = {"color": red, "lw": 1.6, "zorder": 5}
    if varied == "distance_mm":
        far = max((c[0] for c in cameras), key=lambda c: float(np.linalg.norm(c)))
        _draw(axes, np.array([0 * far, far]), **look)
        _write(axes, 0.55 * far + [0, 0, 0.06 * np.linalg.norm(far)], "d", color=red)
    elif varied == "aperture_deg":  # that of the widest setting
        spans = [np.linalg.norm(c[0] - c[1]) for c in cameras]
        arc = 0.45 * radius * _aperture_arc(part.isel(setting=int(np.argmax(spans))))
        _draw(axes, arc, **look)
        _write(axes, 1.12 * arc[10], "α", color=red)  # off the names of the axes
    else:
        text = " … ".join(dict.fromkeys(part["label"].values[[0, -1]].astype(str)))
        axes.text(0.0, 0.0, text, color=red, transform=axes.transAxes, fontsize=8)
    for name, end in zip("XYZ", np.diag([1.12 * half, 0.45 * radius, 0.45 * radius]), strict=True):
        _draw(axes, np.array([0 * end, end]), color="#777777", lw=0.7, zorder=4)
        _write(axes, 1.08 * end, name, color="#777777", fontsize=8)
    axes.set_aspect("equal")
    axes.margins(0.06)
    axes.axis("off")


def _aperture_arc(pair: xr.Dataset) -> Array:
    """Return directions (41, 3) from one camera to the other, over the top if they are opposite."""
    (start, stop), (low, high) = (
        np.radians(pair[f"camera_{angle}"].values[:2]) for angle in ("azimuth", "elevation")
    )
    if np.cos(start - stop) < -1 + 1e-9:
        stop, high = start, np.pi - high
    return hemisphere_directions(np.linspace(start, stop, 41), np.linspace(low, high, 41))


def camera_centres(setting: xr.Dataset) -> Array:
    """Return the camera centres of one setting in m, shape (cameras, 3)."""
    azimuth, elevation = (np.radians(setting[f"camera_{a}"]) for a in ("azimuth", "elevation"))
    places = hemisphere_directions(azimuth, elevation) * setting["camera_distance"].values[:, None]
    return np.asarray(places[np.isfinite(places[:, 0])])


def project_parallel(points: ArrayLike, azimuth: float = 155.0, elevation: float = 28.0) -> Array:
    """Project points (..., 3) orthographically, seen from a direction in degrees, (..., 2)."""
    right, down, _ = hemisphere_rotations(*np.radians([azimuth, elevation]))
    return np.asarray(points, float) @ np.stack([right, -down]).T


def _draw(axes: Axes, points: Array, **look: Any) -> None:
    axes.plot(*project_parallel(points).T, **look)


def _write(axes: Axes, place: Array, text: str, **look: Any) -> None:
    u, v = project_parallel(place)
    axes.text(u, v, text, ha="center", va="center", **look)


def beam_figure(cube: xr.Dataset, case: str, mode: int) -> Figure:
    """Draw the setups, deflection shapes, marker errors and bars of a beam."""
    part = selection.select_settings(cube, case, mode)
    drawing, axes = style.make_mosaic("ab;cd", (7.6, 5.4), None, gridspec_kw=_BEAM_GRID)
    setup_panel(axes["a"], cube, part)
    x, reference = part["x"].values * 1000, part["reference_deflection"] * 1000
    axes["b"].plot(x, reference, color=style.REFERENCE_COLOR, lw=3, label="reference")
    for one, word, ink in selection.rank_settings(part)[: part.sizes["setting"]]:
        measured, label = one["measured_deflection"].isel(trial=0) * 1000, one["label"].item()
        axes["b"].plot(x, measured, ".-", color=ink, lw=1, label=f"{label}, {word}")
        axes["c"].plot(x, one["point_error"], ".-", color=ink, lw=1, label=label)
    axes["b"].set(title="(b) deflection shape", xlabel="x in mm", ylabel="w in mm")
    axes["c"].set(title="(c) error of each marker", xlabel="x in mm", ylim=(0, None))
    axes["c"].set_ylabel("% of the largest deflection")
    style.add_legend(axes["b"], room=0.45)
    axes["c"].legend()
    bar_panel(axes["d"], part, [selection.error_bars(cube, case, mode)])
    axes["d"].set(title="(d) mean (rms) error", ylabel="% of the largest deflection")
    return drawing


@dataclass(frozen=True)
class Caption:
    """Plain texts of a figure."""

    name: str = ""  #: Anchor on its page
    text: str = ""  #: Text below it
    alt: str = ""  #: Alternative text; if empty, :func:`describe_panels` supplies it


def case_captions(cube: xr.Dataset) -> dict[tuple[str, int], Caption]:
    """Return the caption of the figure of each case and mode of a cube."""
    made = {}
    for (case, mode), file in selection.figure_names(cube).items():
        one = selection.select_settings(cube, case, mode).isel(setting=0)
        title, number = str(one["case_title"].item()), str(one["thesis_figure"].item())
        name = number.replace(".", "-") or f"{cube.attrs['figure_set']}-{file}"
        text = f"Figure {number} of the thesis. " if number else ""
        text += f"Case {case.replace(chr(39), '′') if title else case}, mode {mode}"
        made[case, mode] = Caption(f"fig-{name}", text + (f": {title}." if title else "."))
    return made


def describe_panels(drawing: Figure) -> str:
    """Describe the panels and colour bars of a figure in words: title, axes and legend of each."""
    panels = []
    for axes in drawing.axes:
        title = "".join(axes.get_title(place) for place in ("left", "center", "right"))
        title = title.replace("\n", " ")
        scale = "colours" if axes.get_label() == "<colorbar>" else ""
        drawn = " over ".join(filter(None, (axes.get_ylabel(), axes.get_xlabel())))
        words = ", ".join(filter(None, (title or scale, drawn)))
        legend = axes.get_legend()
        names = ", ".join(text.get_text() for text in legend.get_texts()) if legend else ""
        panels.append(": ".join(filter(None, (words, names))))
    return f"Panels: {'; '.join(filter(None, panels))}."
