"""Drawings of the laboratory: the rig, the board on each sensor, the sound, and a marker over time.

The notebooks use the figure of all beams (:func:`thesis_lib.plotting.panels.beam_figure`).
"""

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Arc, Circle, Polygon, Rectangle

from thesis_lib.arrays import Array
from thesis_lib.facts import setups
from thesis_lib.figure_sets.experiment.figure_set import Way
from thesis_lib.figure_sets.experiment.methods import MAX_HARMONIC_ORDER, select_tracks
from thesis_lib.laboratory.parameters import CAMERA_NAMES
from thesis_lib.measure.fitting.harmonics import fit_harmonics
from thesis_lib.measure.recordings.board import rows_on
from thesis_lib.plotting import selection, style
from thesis_lib.plotting.panels import beam_figure as beam_figure
from thesis_lib.studies.cubes import iterate_slices

MARKERS = rows_on(setups.thesis_beam())
TIP_MARKER = MARKERS.middle_row.stop - 1  # the last on the beam's axis, which moves most
WIDTH_IN = 5.5  # in: on a phone the letters are then hardly smaller than the text
SKETCH_INK, BEAM_GREY, SENSOR_GREY = "#333333", "#dcdcdc", "#f4f4f4"
WHITE_GROUND: Any = {"facecolor": "white", "edgecolor": "none", "pad": 0.5}
RESIDUAL_FACTOR = 8000.0  # magnification of drawn residuals


def write_label(axes: Axes, place: Any, text: str, **look: Any) -> None:
    """Write a text in ink, centred at a place by default."""
    how: Any = {"ha": "center", "va": "center", "color": SKETCH_INK, **look}
    axes.text(place[0], place[1], text, **how)


def draw_box(axes: Axes, corner: Any, size: Any, ground: str, **look: Any) -> None:
    """Draw a rectangle with an edge in ink."""
    how: Any = {"facecolor": ground, "edgecolor": SKETCH_INK, "linewidth": 0.8, **look}
    axes.add_patch(Rectangle(corner, *size, **how))


def _draw_arrow(axes: Axes, start: Any, end: Any, heads: str, zorder: int = 3, **line: Any) -> None:
    arrow = {"arrowstyle": heads, "color": SKETCH_INK, **line}
    axes.annotate("", end, start, zorder=zorder, arrowprops=arrow)


def way_of(data: xr.Dataset, method: str) -> Way:
    """Return the way of measuring by a method with all cameras at the largest width."""
    return method, CAMERA_NAMES, int(data["width"].max())


def draw_rig(data: xr.Dataset) -> Figure:
    """Draw the calibrated cameras and the beam with its printed markers (figures 5.1, F.1)."""
    found = select_tracks(data, way_of(data, "harmonic"))
    centres = 1e3 * found.frame.to_beam(np.array([c.centre for c in found.cameras]).T)
    axes_of = np.array([c.R_camera_world[2] for c in found.cameras]).T  # viewing directions
    looks = np.tensordot(found.frame.R, axes_of, axes=1)
    figure, axes = style.subplots(3, 1, figsize=(WIDTH_IN, 6.1), height_ratios=[3.9, 1.75, 0.75])
    _draw_plan(axes[0], centres, looks)
    _draw_side(axes[1], centres, looks)
    _draw_layout(axes[2])
    return figure


def _draw_cameras(axes: Axes, places: Array, looks: Array) -> None:
    """Draw cameras (2, n) as triangles along their viewing directions, with their axes.

    Cameras that hide each other share a label.
    """
    hidden = [np.linalg.norm(places - place[:, None], axis=0) < 20 for place in places.T]
    for i, (place, look) in enumerate(zip(places.T, looks.T, strict=True)):
        ink, ahead = style.cycle_color(i), 38 * look / np.linalg.norm(look)
        axes.plot(*np.stack([place, [0, 0]]).T, color=ink, linewidth=0.9, zorder=1)
        side = 0.5 * np.array([-ahead[1], ahead[0]])
        body = np.array([place, place - ahead + side, place - ahead - side])
        axes.add_patch(Polygon(body, color=ink, zorder=4))
        if np.argmax(hidden[i]) == i:
            letters = ", ".join(chr(ord("A") + n) for n in np.flatnonzero(hidden[i]))
            aside = 1.85 * (1.9 if len(letters) > 1 else 1)
            write_label(axes, place - [aside, 1.3] * ahead, letters, weight="bold", fontsize=11)


def _draw_plan(axes: Axes, centres: Array, looks: Array) -> None:
    length, width = 1e3 * np.array(MARKERS.extent)
    axes.set_title("(a) from above")
    draw_box(axes, (-width / 2, -length / 2), (width, length), BEAM_GREY, zorder=2)
    places = 1e3 * MARKERS.world[[1, 0], : MARKERS.count]
    axes.plot(*places, "o", color=SKETCH_INK, markersize=1.2, zorder=3)
    draw_box(axes, (-45, length / 2 * -1 - 42), (90, 42), "white", hatch="////", zorder=2)
    write_label(axes, (62, -length / 2 - 21), "clamp", ha="left")
    write_label(axes, (0, length / 2 + 20), "tip", va="bottom")
    _draw_cameras(axes, centres[[1, 0]], looks[[1, 0]])
    _draw_axes(axes, "YX")
    first, second = (np.degrees(np.arctan2(*centres[:2, i])) for i in (0, 1))
    low, high = sorted([first, second])
    _draw_angle(axes, low, high, (295, 0), f"α = {high - low:.0f}°")
    along = centres[[1, 0], 3] / np.linalg.norm(centres[[1, 0], 3])
    distance = np.mean(np.linalg.norm(centres, axis=0))
    slope = np.degrees(np.arctan(along[1] / along[0]))
    write_label(axes, 300 * along + [0, 22], f"d = {distance:.0f} mm", rotation=slope)
    _hide_axes(axes, (-650, 650), (-length / 2 - 55, length / 2 + 60))


def _draw_side(axes: Axes, centres: Array, looks: Array) -> None:
    _, width = 1e3 * np.array(MARKERS.extent)
    axes.set_title("(b) along the beam")
    axes.add_patch(Rectangle((-width / 2, -3), width, 6, facecolor=SKETCH_INK, zorder=5))
    _draw_cameras(axes, centres[[1, 2]], looks[[1, 2]])
    _draw_axes(axes, "YZ")
    flat = np.hypot(*centres[:2, 0])
    elevation = np.degrees(np.arctan2(centres[2, 0], flat))
    axes.plot([0, flat], [0, 0], "--", color=style.REFERENCE_COLOR, linewidth=0.8, zorder=0)
    _draw_angle(axes, 0, elevation, (300, 50), f"φ = {elevation:.0f}°")
    _draw_arrow(axes, (-60, 48), (-60, -48), "<->")
    write_label(axes, (-78, -36), "vibrates", ha="right")
    _hide_axes(axes, (-650, 650), (-90, 290))


def _draw_axes(axes: Axes, names: str) -> None:
    for end, place, name in zip(((150, 0), (0, 150)), ((165, 0), (30, 142.5)), names, strict=True):
        _draw_arrow(axes, (0, 0), end, "->", zorder=6, linewidth=1.2)
        write_label(axes, place, name, zorder=6, bbox=WHITE_GROUND)


def _draw_angle(axes: Axes, low: float, high: float, place: Any, text: str) -> None:
    """Draw an arc between two directions in °, and write their angle next to it."""
    look: Any = {"color": style.HIGHLIGHT_COLOR}
    axes.add_patch(Arc((0, 0), 560, 560, theta1=low, theta2=high, linewidth=1.4, **look))
    write_label(axes, place, text, ha="left", **look)


def _hide_axes(axes: Axes, x: tuple[float, float], y: tuple[float, float]) -> None:
    axes.set(xlim=x, ylim=y, aspect="equal")
    axes.axis("off")


def _draw_layout(axes: Axes) -> None:
    """Draw markers, hole and shaker on the beam, with the printed dimensions in mm in the title."""
    length, width = 1e3 * np.array(MARKERS.extent)
    places, radius, row = 1e3 * MARKERS.positions, 500 * MARKERS.diameter, MARKERS.columns
    apart = (
        f"every {places[0, 1] - places[0, 0]:g} mm in rows {1e3 * MARKERS.row_spacing:g} mm apart"
    )
    axes.set_title(f"(c) printed on it: a hole, and markers of {2 * radius:g} mm {apart}")
    draw_box(axes, (0, 0), (length, width), BEAM_GREY)
    for n, place in enumerate(places.T):
        ink = style.HIGHLIGHT_COLOR if n >= MARKERS.count else SKETCH_INK  # the hole comes last
        axes.add_patch(Circle(place, radius, color=ink, zorder=3))
    for y, first in zip(places[1, ::row], range(1, MARKERS.count, row), strict=False):
        outward = y + 0.7 * (y - width / 2)  # else they touch
        write_label(axes, (-6, outward), str(first), ha="right", fontsize=7.5)
        write_label(axes, (length + 6, outward), str(first + row - 1), ha="left", fontsize=7.5)
    force = 1e3 * setups.thesis_beam().force_point[:, 0]
    axes.plot(*force, "X", markersize=7, markeredgecolor="white", zorder=5, color=style.RED)
    write_label(axes, (force[0], -16), "shaker beneath", color=style.RED)
    _hide_axes(axes, (-32, length + 32), (-22, width + 4))


def draw_coverage(data: xr.Dataset) -> Figure:
    """Draw all corners on each sensor, with their residuals exaggerated (figure D.5)."""
    figure, grid = style.panel_grid(data.sizes["camera"], WIDTH_IN, 1.8)
    for i, (axes, camera) in enumerate(zip(grid, iterate_slices(data, "camera"), strict=False)):
        corners, residual = (
            camera[name].transpose("axis", "shot", "corner").values.reshape(2, -1)
            for name in ("adjusted_corners", "corner_residuals")
        )
        width, height = (float(size) for size in camera["size"].values)
        scale, left = RESIDUAL_FACTOR * width / 1920, 0.03 * width
        draw_box(axes, (0, 0), (width, height), SENSOR_GREY)
        _draw_segments(axes, corners, corners + scale * residual, style.cycle_color(i), 0.7)
        _draw_segments(axes, corners - [[3], [0]], corners + [[3], [0]], SKETCH_INK, 1.6)
        still = camera["tracks"].sel(width=camera["width"].max()).isel(frame=0)
        row = still.transpose("axis", "marker").values[:, MARKERS.middle_row]
        axes.plot(*row, color=SKETCH_INK, linewidth=2.5, alpha=0.45, zorder=3)
        ink: Any = {"color": style.HIGHLIGHT_COLOR}
        axes.plot([left, left + 0.01 * scale], [0.95 * height] * 2, linewidth=2, **ink)
        look = ink | {"fontsize": 7.5, "ha": "left", "va": "bottom"}
        ground = WHITE_GROUND | {"facecolor": SENSOR_GREY}
        write_label(axes, (left, 0.92 * height), "0.01 px", bbox=ground, **look)
        rms = np.sqrt(np.nanmean(residual**2))
        axes.set_title(f"{camera['camera'].item()}: rms {rms:.4f} px")
        _hide_axes(axes, (-0.01 * width, 1.01 * width), (1.01 * height, -0.01 * height))
    return figure


def _draw_segments(axes: Axes, start: Array, end: Array, tint: str, width: float) -> None:
    """Draw segments between points (2, n) as one line with gaps."""
    points = np.stack([start, end, np.full_like(start, np.nan)], axis=2).reshape(2, -1)
    axes.plot(*points, color=tint, linewidth=width, solid_capstyle="butt")


def draw_sound(data: xr.Dataset) -> Figure:
    """Draw the start of the force on the four audio tracks, before and after alignment."""
    signal = data["picture_sound"].transpose("camera", "sample").values
    seconds = np.arange(signal.shape[1]) / float(data["picture_sound"].attrs["rate_hz"])
    delay, begin = data["delay"].values, float(data["steady"][0])
    whole = data["delay_frames"].values / data["frame_rate"].values
    figure, panels = style.make_mosaic([["own", "own"], ["whole", "part"]], figsize=(WIDTH_IN, 5.2))
    top, below = panels["own"], [panels["whole"], panels["part"]]
    for i, (own, name) in enumerate(zip(signal, data["camera"].values, strict=True)):
        top.plot(seconds, own - i, color=style.cycle_color(i), linewidth=0.9)
        text = f"{name}  {1000 * delay[i]:+.1f} ms".replace("-", "−") if i else name
        top.text(begin - 0.74, 0.13 - i, text, color=SKETCH_INK)
    top.set_title("(a) the force on each camera's clock; start after A's")
    top.set(xlabel="s after its first frame", xlim=(begin - 0.75, begin + 0.55), yticks=[])
    top.grid(visible=False, axis="y")
    top.spines["left"].set_visible(False)
    middle = _find_crossing(seconds, signal[0], begin)
    titles = ("(b) aligned to whole frames", "(c) to fractions of a frame")
    for axes, shift, title in zip(below, (whole, delay), titles, strict=True):
        for i, own in enumerate(signal):
            time = 1000 * (seconds + shift[i] - middle)
            near = np.abs(time) < 30
            axes.plot(time[near], own[near], color=style.cycle_color(i), linewidth=1.3)
        axes.set(title=title, xlim=(-28, 28), xlabel="ms from a zero crossing")
        axes.axhline(0, color=SKETCH_INK, linewidth=0.6, zorder=0)
        axes.set_ylim(-0.45, 0.5)
    below[0].set_ylabel("force over full scale")
    below[1].tick_params(labelleft=False)
    half = 500 / float(data["frame_rate"][0])
    below[0].axvspan(-half, half, color="#eeeeee", zorder=-1)
    write_label(below[0], (0, -0.43), "one frame", va="bottom", fontsize=7.5)
    return figure


def _find_crossing(time: Array, signal: Array, before: float) -> float:
    """Find the steepest zero crossing before a time, which shows a delay best."""
    steps = round(0.02 / (time[1] - time[0]))
    smooth = np.convolve(signal, np.ones(steps) / steps, "same")
    signs = np.flatnonzero((smooth[:-1] * smooth[1:] < 0) & (time[1:] < before))
    return float(time[signs[np.argmax(np.abs(np.gradient(smooth))[signs])]])


def draw_tracks(data: xr.Dataset) -> Figure:
    """Draw one marker in four cameras: on their clocks, on one clock, and the residual."""
    every = data["tracks"].sel(width=data["width"].max(), axis="v")
    v = every.isel(marker=TIP_MARKER).transpose("camera", "frame").values
    own = np.arange(v.shape[1]) / data["frame_rate"].values[:, None]
    common = own + data["delay"].values[:, None]
    omega, (begin, end) = 2 * np.pi * float(data["frequency"]), data["steady"].values
    figure, axes = style.subplots(3, 1, figsize=(WIDTH_IN, 6.4), height_ratios=[1.1, 1.1, 0.8])
    for i, name in enumerate(data["camera"].values):
        ink: Any = {"color": style.cycle_color(i)}
        dots: Any = {**ink, "markersize": 3.5}
        rest = np.nanmean(v[i, own[i] < float(data["rest"]) - 1 / data["frame_rate"].values[i]])
        moved = v[i] - rest
        axes[0].plot(own[i], moved, ".-", linewidth=0.6, label=name, **dots)
        axes[1].plot(common[i], moved, ".", **dots)
        steady = (common[i] >= begin) & (common[i] <= end)
        fit = fit_harmonics(omega, common[i, steady], moved[steady], MAX_HARMONIC_ORDER)
        fine = np.linspace(begin, end, 400)
        axes[1].plot(fine, fit.at(omega, fine), linewidth=0.8, zorder=1, **ink)
        residual = moved[steady] - fit.at(omega, common[i, steady])
        axes[2].plot(common[i, steady], 1e3 * residual, ".", **dots)
    axes[0].set(xlabel="s after its first frame", xlim=(begin - 0.75, begin + 0.5))
    axes[0].set_title("(a) the tip's marker on each camera's own clock")
    axes[0].legend(ncols=4, loc="upper left", markerscale=2, columnspacing=1, handlelength=1)
    axes[1].set_title("(b) on A's clock, with each camera's harmonic fit")
    axes[2].set(xlabel="s after A's first frame", ylabel="thousandths of a px")
    axes[2].set_title("(c) residual of the fit")
    for panel in axes[:2]:
        panel.set_ylabel("v minus v at rest, px")
        panel.margins(y=0.15)
    for panel in axes[1:]:
        panel.set_xlim(begin - 0.75, end + 0.05)
        panel.axvspan(begin, end, color="#eeeeee", zorder=-1)
    where: Any = {"ha": "left", "va": "top", "transform": axes[1].get_xaxis_transform()}
    axes[1].text(begin + 0.02, 0.98, "steady state", color=SKETCH_INK, **where)
    return figure


def _harmonic(cube: xr.Dataset) -> dict[str, Any]:
    """Return the last setting of the harmonic fit, and the drive-point mobilities."""
    if (part := selection.split_cases(cube).get("harmonic")) is None:
        return {"last": None}
    last = part.isel(setting=-1)
    return {
        "last": last,
        "every_fourth": slice(None, None, 4),
        "found": complex(last["mobility_real"].item(), last["mobility_imag"].item()),
        "model": complex(*cube["mobility_reference"].values),
    }


TEXTS = {"harmonic": _harmonic}  # of the notebooks, from a cube
