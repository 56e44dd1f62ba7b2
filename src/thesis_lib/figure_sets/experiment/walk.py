"""Figures and paragraphs of the page that walks through chapter 5, from its recordings.

Each step of the measuring chain has a figure: camera images with the features found in them.
"""

import io
import json
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import PIL.Image
import xarray as xr
from matplotlib import patheffects
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon, Rectangle

from thesis_lib import files, templates
from thesis_lib.arrays import Array, Image
from thesis_lib.facts import setups
from thesis_lib.figure_sets.experiment import compute, figure_set, figures, methods
from thesis_lib.figure_sets.experiment.figures import MARKERS, WIDTH_IN
from thesis_lib.laboratory.experiment import compare_deflections
from thesis_lib.measure.calibration.rig import central_corners
from thesis_lib.measure.fitting.reconstruction import deflection_at
from thesis_lib.measure.recordings.board import Board
from thesis_lib.measure.tracking import follow, tracker
from thesis_lib.plotting import style
from thesis_lib.studies.cubes import iterate_slices
from thesis_lib.vibration.motion import Component

Box = tuple[float, float, float, float]  # left, right, top, bottom in px

DARK_RIM: Any = [patheffects.withStroke(linewidth=2.5, foreground=style.BLACK_COLOR)]


def _draw_photo(
    axes: Axes,
    image: Image,
    box: Box | None = None,
    smooth: bool = False,
    scale: float = 1.0,
    border: str = "",
) -> None:
    """Draw an image or a part of it, pixel by pixel; one pixel spans `scale` px of the axes.

    `border` is the colour in which another panel outlines the part.
    """
    height, width = image.shape
    left, right, top, bottom = box or (0, width * scale, 0, height * scale)
    # Only whole pixels around the box are drawn.
    u0, u1 = max(int(left / scale), 0), min(int(np.ceil(right / scale)), width)
    v0, v1 = max(int(top / scale), 0), min(int(np.ceil(bottom / scale)), height)
    extent = (u0 * scale, u1 * scale, v1 * scale, v0 * scale)
    look: Any = {"interpolation": "antialiased" if smooth else "nearest", "extent": extent}
    axes.imshow(image[v0:v1, u0:u1], cmap="gray", vmin=0, vmax=255, **look)
    axes.set(xlim=(left, right), ylim=(bottom, top), xticks=[], yticks=[])
    axes.grid(visible=False)
    for spine in axes.spines.values():
        spine.set(visible=bool(border), color=border or "none", linewidth=2)


def _write_note(axes: Axes, place: Any, text: str, tint: str = "white", **look: Any) -> None:
    """Write text with a dark rim, legible on any background."""
    (u, v), look = place, {"ha": "center", "va": "center", "fontsize": 9, **look}
    axes.text(u, v, text, color=tint, path_effects=DARK_RIM, **look)


def _draw_frame(axes: Axes, box: Box, tint: str) -> None:
    """Outline the part that another panel shows."""
    left, right, top, bottom = box
    frame = Rectangle((left, top), right - left, bottom - top, edgecolor=tint, linewidth=1.3)
    axes.add_patch(frame).set_fill(False)


def _draw_crosses(axes: Axes, places: Array, tint: str, size: float, rim: bool = True) -> None:
    """Draw crosses at places (2, n), with a dark rim if the background may be bright."""
    if rim:
        axes.plot(*places, "+", color=style.BLACK_COLOR, markersize=size + 1, markeredgewidth=2.4)
    axes.plot(*places, "+", color=tint, markersize=size, markeredgewidth=1.2)


def _enclose_places(places: Array, aspect: float, margin: float, limits: tuple[int, int]) -> Box:
    """Return a box of an aspect ratio, width over height, around places (2, n) in an image."""
    (left, top), (right, bottom) = np.nanmin(places, 1) - margin, np.nanmax(places, 1) + margin
    width = max(right - left, aspect * (bottom - top))
    u, v = (left + right) / 2, (top + bottom) / 2
    half, tall = width / 2, width / aspect / 2
    u = float(np.clip(u, half, max(limits[0] - half, half)))
    v = float(np.clip(v, tall, max(limits[1] - tall, tall)))
    return u - half, u + half, v - tall, v + tall


def _rest_centres(data: xr.Dataset, camera: int = 0, frame: int = 0) -> Array:
    """Return marker centres of a camera in one frame at full width, (2, markers), px."""
    part = data["tracks"].sel(width=data["width"].max()).isel(camera=camera, frame=frame)
    return np.asarray(part.transpose("axis", "marker").values, float)


def draw_views(data: xr.Dataset) -> Figure:
    """Draw the first frame of every camera (figure 5.2)."""
    pictures = data["picture_all"].transpose("camera", "row4", "column4").values
    apart, height = {"wspace": 0.01, "hspace": 0.01}, (WIDTH_IN * 9 / 16 + 0.03) / 2
    figure, grid = style.panel_grid(len(pictures), WIDTH_IN, height, gridspec_kw=apart)
    figure.get_layout_engine().set(w_pad=0, h_pad=0)  # type: ignore[union-attr,call-arg]
    for i, (axes, name) in enumerate(zip(grid, data["camera"].values, strict=False)):
        _draw_photo(axes, pictures[i], smooth=True)
        scale = pictures[i].shape[1] / float(data["size"].values[i, 0])
        row = scale * _rest_centres(data, i)[:, MARKERS.middle_row]
        where: Any = {"va": "top", "ha": "left", "transform": axes.transAxes}
        _write_note(axes, (0.04, 0.93), name, fontsize=13, weight="bold", **where)
        for place, text in ((row[:, 0], "clamp"), (row[:, -1], "tip")):
            _write_note(axes, place + [0, 34], text, fontsize=8.5)
    return figure


def draw_board(data: xr.Dataset) -> Figure:
    """Draw a calibration image, its corners, the central squares, and one corner (D.1 to D.4)."""
    picture = data["picture_shot"].values
    corners = data["picture_corners"].transpose("axis", "corner").values
    shape = Board()
    nx, part = shape.shape[0], central_corners(shape)
    used = corners[:, part].reshape(2, -1, 6)
    rim = np.concatenate([used[:, 0], used[:, :, -1], used[:, -1, ::-1], used[:, ::-1, 0]], axis=1)
    limits, size = picture.shape[::-1], (WIDTH_IN, 0.436 * WIDTH_IN)
    figure, (left, right) = style.subplots(1, 2, figsize=size, width_ratios=[1.32, 1])
    _draw_photo(left, picture, _enclose_places(corners, 1.32, 95, limits), smooth=True)
    left.add_patch(Polygon(rim.T, fill=False, edgecolor=style.ORANGE, linewidth=2))
    left.plot(*corners, "o", color=style.SKY, markersize=4.5, fillstyle="none", markeredgewidth=1.3)
    first = corners[:, part[0]]
    arrow = {"arrowstyle": "->", "color": style.RED, "linewidth": 2}
    for there, name in ((corners[:, part[0] + 1], "x"), (corners[:, part[0] + nx], "y")):
        left.annotate("", first + 1.5 * (there - first), first, arrowprops=arrow)
        _write_note(left, first + 1.75 * (there - first), name)
    zoomed = corners[:, part[20]]
    _draw_frame(left, _enclose_places(zoomed[:, None], 1.0, 26, limits), style.GREEN)
    near = _enclose_places(zoomed[:, None], 1.0, 10, limits)
    _draw_photo(right, picture, near, border=style.GREEN)
    _draw_crosses(right, zoomed, style.SKY, 22)
    left.set_title("(a) board image of camera A")
    right.set_title("(b) one corner, pixel by pixel")
    return figure


def draw_outline(data: xr.Dataset) -> Figure:
    """Draw the first frame with the beam's outline, and its two ends (figures F.2 and F.3)."""
    picture = data["picture_first"].values
    corners = data["picture_outline"].transpose("axis", "outline").values
    centres = data["picture_centres"].transpose("axis", "marker").values
    row, limits = MARKERS.columns, picture.shape[::-1]
    ends = {  # markers, corners, colour and letter of each
        "tip": ([row - 3, row - 1, 3 * row - 3, 3 * row - 1], [1, 2], style.GREEN, "b"),
        "clamped end": ([0, 2, 2 * row, 2 * row + 2], [0, 3], style.PINK, "c"),
    }
    size, names = (WIDTH_IN, 0.79 * WIDTH_IN), [["all", "all"], [*ends]]
    figure, panels = style.make_mosaic(names, size, height_ratios=[1.45, 1])
    whole = panels["all"]
    _draw_photo(whole, picture, _enclose_places(corners, 2.15, 160, limits), smooth=True)
    whole.add_patch(Polygon(corners.T, fill=False, edgecolor=style.ORANGE, linewidth=1.2))
    middle = corners[0].mean(), corners[1, [[0, 3], [1, 2], [1, 2], [0, 3]]].mean(axis=1)
    beside = corners + [[45], [32]] * np.sign(corners - np.stack(np.broadcast_arrays(*middle)))
    for place, digit in zip(beside.T, "①②③④", strict=True):
        _write_note(whole, place, digit, style.ORANGE, fontsize=12)
    whole.set_title("(a) the first frame of camera A, with the beam's outline")
    for name, (some, near, tint, letter) in ends.items():
        places = np.column_stack([centres[:, some], corners[:, near]])
        box, axes = _enclose_places(places, 1.65, 14, limits), panels[name]
        _draw_frame(whole, box, tint)
        _draw_photo(axes, picture, box, border=tint)
        axes.add_patch(Polygon(corners.T, fill=False, edgecolor=style.ORANGE, linewidth=1.5))
        inside = (centres[0] > box[0]) & (centres[0] < box[1])
        _draw_crosses(axes, centres[:, inside], style.SKY, 6, rim=False)
        axes.set_title(f"({letter}) the {name}")
    return figure


def draw_plane(data: xr.Dataset) -> Figure:
    """Draw the frame on the beam's plane, with grid, matches and spare matches (F.4 to F.6)."""
    picture = data["picture_beam"].transpose("row_beam", "column_beam").values
    found = data["picture_matches"].transpose("axis", "match").values
    scale = tracker.THESIS_SCALE_PX_PER_M
    grid, matches = (scale * (p + tracker.THESIS_REACH_M) for p in (MARKERS.positions, found))
    places = tracker.assign_places(MARKERS.positions, found, tracker.assignment_gate(MARKERS))
    taken = (np.abs(found[:, :, None] - places[:, None]).max(axis=0) < 1e-12).any(axis=1)
    size = picture.shape[::-1]
    box = (0.0, 380.0, 0.0, float(size[1]))
    heights = [size[1] / width for width in (size[0], box[1], box[1])]
    figure, axes = style.subplots(3, 1, figsize=(WIDTH_IN, 1.03 * WIDTH_IN), height_ratios=heights)
    for panel, part in zip(axes, (None, box, box), strict=True):
        _draw_photo(panel, picture, part, smooth=part is None, border=style.SKY if part else "")
        panel.invert_yaxis()  # y upwards: the beam as it is seen from above
    _draw_frame(axes[0], (box[0] + 3, box[1], 3, box[3] - 3), style.SKY)
    _draw_crosses(axes[1], grid, style.PINK, 11, rim=False)
    large: Any = {"fillstyle": "none", "markersize": 15, "markeredgewidth": 2}
    small: Any = {"fillstyle": "none", "markersize": 6, "markeredgewidth": 1.2}
    axes[2].plot(*matches[:, taken], "o", color=style.GREEN, **large)
    axes[0].plot(*matches[:, ~taken], "s", color=style.RED, **small)
    axes[2].plot(*matches[:, ~taken], "s", color=style.RED, **large)
    axes[0].set_title(f"(a) the frame on the beam's plane; spare matches: {np.sum(~taken)}")
    axes[1].set_title(f"(b) clamped end, with the ideal grid of {grid.shape[1]} points")
    axes[2].set_title("(c) matches: circles belong to the grid, squares are spare")
    return figure


def draw_centres(data: xr.Dataset) -> Figure:
    """Draw marker centres in the image at rest and at the maximum, at the tip (figure F.7)."""
    frame, row = int(data["picture_moved"].attrs["frame"]), MARKERS.columns
    shown = np.concatenate([np.arange(n * row - 3, n * row) for n in (1, 2, 3)])
    still, moved = _rest_centres(data)[:, shown], _rest_centres(data, frame=frame)[:, shown]
    pictures = data["picture_first"].values, data["picture_moved"].values
    both = np.column_stack([still, moved])
    box = _enclose_places(both, 2.5, 12, pictures[0].shape[::-1])
    figure, axes = style.subplots(2, 1, figsize=(WIDTH_IN, 0.89 * WIDTH_IN))
    for panel, picture in zip(axes, pictures, strict=True):
        _draw_photo(panel, picture, box)
        _draw_crosses(panel, still, style.SKY, 10)
    _draw_crosses(axes[1], moved, style.ORANGE, 10)
    line = {"arrowstyle": "-", "color": style.ORANGE, "linewidth": 1.2, "shrinkA": 0, "shrinkB": 0}
    for start, end in zip(still.T, moved.T, strict=True):
        axes[1].annotate("", end, start, arrowprops=line)
    tip = np.abs(moved - still)[1, shown == figures.TIP_MARKER].item()
    axes[0].set_title("(a) at rest")
    axes[1].set_title(f"(b) at the maximum: the tip's marker has moved {tip:.1f} px")
    return figure


def draw_widths(data: xr.Dataset) -> Figure:
    """Draw three columns of markers at every width, with shares of missing and wrong centres."""
    full = data["picture_first"].values
    row, middle = MARKERS.columns, MARKERS.columns // 2
    shown = np.concatenate([n * row + np.arange(middle - 1, middle + 2) for n in range(3)])
    box = _enclose_places(_rest_centres(data)[:, shown], 2.3, 16, full.shape[::-1])
    every = sorted(data["width"].values.tolist(), reverse=True)
    figure, grid = style.panel_grid(len(every), WIDTH_IN, 0.245 * WIDTH_IN)
    for axes, width in zip(grid, every, strict=False):
        small = follow.reduce_frame(full, width)
        if width == data.sizes["column_low"]:
            small = data["picture_low"].values
        _draw_photo(axes, small, box, scale=full.shape[1] / small.shape[1])
        at = data.sel(width=width)
        text = f"{100 * float(at['missing_share']):.0f} % missing"
        if np.isfinite(at["wrong_share"]):
            text += f", {100 * float(at['wrong_share']):.0f} % wrong"
        axes.set_title(f"{width}×{small.shape[0]}: {text}", color=figures.SKETCH_INK)
    return figure


PICTURE_WIDTH_PX = 1500  # width of figures that hold photographs
WEBP_QUALITY = 85  # of 100, at which they are stored
WALK_FIGURES: dict[str, Callable[[xr.Dataset], Figure]] = {
    "rig": figures.draw_rig,
    "views": draw_views,
    "board": draw_board,
    "coverage": figures.draw_coverage,
    "sound": figures.draw_sound,
    "outline": draw_outline,
    "plane": draw_plane,
    "centres": draw_centres,
    "widths": draw_widths,
    "tracks": figures.draw_tracks,
}


def file_name(name: str) -> str:
    """Name a figure's file: WebP if it holds photographs, SVG otherwise."""
    # Figures that this module draws hold photographs.
    return f"lab-{name}.{'webp' if WALK_FIGURES[name].__module__ == __name__ else 'svg'}"


def _encode_webp(figure: Figure) -> bytes:
    """Encode as WebP: lossless where that takes fewer bytes, else at `WEBP_QUALITY`."""
    drawn = style.save_figure(figure, "png", dpi=PICTURE_WIDTH_PX / figure.get_figwidth())
    picture, found = PIL.Image.open(io.BytesIO(drawn)).convert("RGB"), []
    for lossless in (True, False):
        file = io.BytesIO()
        picture.save(file, format="webp", lossless=lossless, quality=WEBP_QUALITY, method=6)
        found.append(file.getvalue())
    return min(found, key=len)


# Further values for paragraphs and tables.


def _phase_loss(data: xr.Dataset, frames: float) -> float:
    """Return the loss of deflection in % at a number of frames from a maximum."""
    phase = 2 * np.pi * float(data["frequency"]) * frames / float(data["frame_rate"][0])
    return float(100 * (1 - np.cos(phase)))


def _synchronisation(data: xr.Dataset) -> dict[str, Any]:
    """Compare delays in whole frames with the true ones."""
    cameras = []
    for one in list(iterate_slices(data, "camera"))[1:]:
        true = float(one["true_delay"] * one["frame_rate"])
        cameras.append((one, true, _phase_loss(data, float(one["delay_frames"]) - true)))
    return {"cameras": cameras}


def _clocks(data: xr.Dataset) -> dict[str, Any]:
    """Return the frame rate, and the losses in % by half a frame and a whole frame."""
    half, whole = (_phase_loss(data, frames) for frames in (0.5, 1.0))
    return {"rate": data["frame_rate"][0], "half": half, "whole": whole}


def _exposure(data: xr.Dataset) -> dict[str, Any]:
    """Return the loss of amplitude in % by the exposure, and by one that lasts a whole frame."""
    time, rate = float(data["exposure"][0]), float(data["frame_rate"][0])
    loss, whole = (100 * (1 - np.sinc(float(data["frequency"]) * t)) for t in (time, 1 / rate))
    return {"loss": loss, "whole_frame": whole}


def _matches(data: xr.Dataset) -> dict[str, Any]:
    """Return the apparent sideways motion of the tip on the plane at rest."""
    given = json.loads(data.attrs["rendering"])
    sideways = given["amplitude_mm"] / np.tan(np.radians(given["elevation_deg"]))
    return {"amplitude_mm": given["amplitude_mm"], "sideways_mm": sideways, "markers": MARKERS}


def _tracking(data: xr.Dataset) -> dict[str, Any]:
    """Return the size of a marker's image at the least width."""
    given, narrow = json.loads(data.attrs["rendering"]), int(data["width"].min())
    camera = data.sel(calibration="full").isel(camera=0)
    focal = float(camera["K"].values[0, 0]) * narrow / float(camera["size"].values[0])
    length = 1000 * MARKERS.diameter * focal / given["distance_mm"]
    height = length * np.sin(np.radians(given["elevation_deg"]))
    return {"narrow": narrow, "length_px": length, "height_px": height}


def _steps(data: xr.Dataset) -> dict[str, Any]:
    """Measure the deflection by the four methods; return also the beam's coordinate frame."""
    given, beam = json.loads(data.attrs["rendering"]), setups.thesis_beam()
    part = Component("bending", 1, given["frequency_hz"], given["amplitude_mm"] / 1000)
    reference, found = part.amplitude * part.shape(beam, beam.markers), []
    for method in figure_set.METHODS:
        tracks, every, _ = compute.measure_setting(data, figures.way_of(data, method))
        measured = every[MARKERS.middle_row]
        found.append((method, measured, compare_deflections(measured[None], reference)))
    return {
        "methods": found,
        "widest": int(data["width"].max()),
        "reference": reference,
        "frame": tracks.frame,  # of the last one, the harmonic fit
    }


def _parts(data: xr.Dataset) -> dict[str, Any]:
    """Return the errors of the literal method by a missed maximum and by whole-frame delays."""
    row = MARKERS.middle_row
    instant = methods.find_maxima(data, setups.thesis_beam().damping)
    tracks = methods.select_tracks(data, figures.way_of(data, "literal"))
    maximum, frame = instant.nearest(tracks.rate, tracks.times[0, 0] * tracks.rate)
    exact = (data["delay"] - data["delay"][0]).values
    residual, n = exact - tracks.frames / tracks.rate, len(exact)

    def shape_at(times: Array) -> Array:
        images = [
            own.at(instant.omega, [t])[0] for own, t in zip(tracks.harmonics, times, strict=True)
        ]
        return deflection_at(tracks.P, tracks.frame, tracks.rest, np.array(images))[row]

    def loss(times: Array) -> float:
        seen, most = shape_at(times), shape_at(np.full(n, maximum))
        return float(100 * np.sqrt(np.nanmean((seen - most) ** 2)) / np.nanmax(np.abs(most)))

    return {
        "frames_off": abs(frame - maximum) * tracks.rate,
        "peak": loss(np.full(n, frame)),
        "rounding": loss(maximum + residual),
        "both": loss(frame + residual),
    }


TEXT_VALUES: dict[str, Callable[[xr.Dataset], dict[str, Any]]] = {
    "lab-calibration": lambda _: {},
    "lab-synchronisation": _synchronisation,
    "lab-clocks": _clocks,
    "lab-exposure": _exposure,
    "lab-matches": _matches,
    "lab-tracking": _tracking,
    "lab-steps": _steps,
    "lab-parts": _parts,
}


def fill_text(data: xr.Dataset, name: str) -> str:
    """Fill in a table or paragraph of the page."""
    return templates.render(
        __file__, name, data=data, slices=iterate_slices, **TEXT_VALUES[name](data)
    )


def write_all(folder: Path) -> None:
    """Write figures and texts of chapter 5's recordings; equal recordings give equal bytes."""
    data = compute.EXPERIMENT.load(figure_set.ExperimentResolution().recordings)
    for name, draw in WALK_FIGURES.items():
        with style.in_style():
            figure = draw(data)
        path = folder / file_name(name)
        is_image = path.suffix == ".webp"
        encoded = _encode_webp(figure) if is_image else style.figure_svg(figure).encode()
        files.whole_file(path, partial(Path.write_bytes, data=encoded))
    for name in TEXT_VALUES:
        files.whole_text(folder / f"{name}.md", fill_text(data, name))
