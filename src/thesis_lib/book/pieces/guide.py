"""Drawings of the ten steps from an empty folder to a measured plate."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Arc, Circle, Polygon, Rectangle

from thesis_lib.arrays import Array
from thesis_lib.measure.recordings.board import Board
from thesis_lib.plotting.style import (
    COLORS,
    HIGHLIGHT,
    INK,
    REFERENCE,
    color,
    subplots,
)
from thesis_lib.vision.pinhole import (
    CameraArray,
    hemisphere_directions,
    hemisphere_rotations,
    intrinsics,
    project,
)

LENGTH, WIDTH = 240.0, 160.0  # mm, of the plate
COLUMNS, ROWS, SPACING, DIAMETER = 6, 4, 36.0, 12.0  # of its markers, mm
BOARD = Board(7, 5, 0.028, 0.021)
PHONES = {"north": 20.0, "east": 105.0, "south": 190.0, "west": 280.0}  # azimuth, °
ELEVATION, DISTANCE = 30.0, 470.0  # °, mm
SIZE, FOCAL = (640, 360), 560.0  # px
TILTS = ((0, 0), (20, 0), (20, 90), (20, 180), (20, 270), (12, 45))  # of the board: how far, where


def sheets() -> Figure:
    """The two sheets to print, each with its line to measure and a ruler beside it."""
    drawing, axes = subplots(1, 2, figsize=(7.2, 2.7))
    drawing.subplots_adjust(0.01, 0.01, 0.99, 0.9, wspace=0.06)
    for axis, title in zip(axes, ("(a) the board", "(b) the markers"), strict=True):
        _bare(axis, title)
        axis.add_patch(Rectangle((-148.5, -105), 297, 210, fill=False, ec=INK, lw=1))
        axis.plot([-50, 50], [-92, -92], color=HIGHLIGHT, lw=2)
        axis.text(56, -92, "100 mm", color=HIGHLIGHT, fontsize=8, va="center")
        for x in range(-50, 51, 10):
            axis.plot([x, x], [-92, -86], color=HIGHLIGHT, lw=0.8)
        axis.set(xlim=(-150, 150), ylim=(-107, 107))
    for tile in 1000 * BOARD.dark_tiles:
        axes[0].add_patch(Polygon(tile + [0, 8], color=INK, lw=0))
    for x, y in _markers().T:
        axes[1].add_patch(Circle((x, y + 8), DIAMETER / 2, color=INK, lw=0))
    return drawing


def plate() -> Figure:
    """The plate with its markers, the pen's cross, the axes and the order of the corners."""
    drawing, axis = subplots(figsize=(5.6, 3.4))
    drawing.subplots_adjust(0.01, 0.01, 0.99, 0.99)
    _bare(axis, "")
    axis.add_patch(Polygon(_corners().T, fill=False, ec=REFERENCE, lw=2))
    for x, y in _markers().T:
        axis.add_patch(Circle((x, y), DIAMETER / 2, color=INK, lw=0))
    left, low = -LENGTH / 2, -WIDTH / 2
    _cross(axis, np.array([left + 10, low + 10]))
    for end, name in (((left + 75, low - 16), "x"), ((left - 16, low + 75), "y")):
        start = (left, end[1]) if name == "x" else (end[0], low)
        axis.annotate("", end, start, arrowprops={"arrowstyle": "->", "color": COLORS[0]})
        away = (7, 0) if name == "x" else (0, 8)
        axis.text(*np.add(end, away), name, color=COLORS[0], va="center", ha="center")
    for number, (x, y) in enumerate(_corners().T, 1):
        axis.text(1.06 * x, 1.08 * y, str(number), color=HIGHLIGHT, ha="center", va="center")
    row = _markers()[:, :2]
    for x, y in row.T:
        axis.plot([x, x], [y, low + 4], color=INK, lw=0.6)
    axis.annotate(
        "",
        (row[0, 1], low + 5),
        (row[0, 0], low + 5),
        arrowprops={"arrowstyle": "<->", "color": INK},
    )
    axis.text(row[0, 1] + 4, low + 5, f"{SPACING:g} mm", color=INK, va="center")
    axis.set(xlim=(-150, 145), ylim=(-105, 100))
    return drawing


def phones() -> Figure:
    """Where the phones stand, from above and from the side."""
    drawing, (above, side) = subplots(
        1, 2, figsize=(7.2, 3.0), gridspec_kw={"width_ratios": (1.2, 1)}
    )
    drawing.subplots_adjust(0.01, 0.01, 0.99, 0.9, wspace=0.04)
    _bare(above, "(a) from above")
    _bare(side, "(b) from the side")
    above.add_patch(Polygon(_corners().T, fill=False, ec=REFERENCE, lw=2))
    _cross(above, _corners()[:, 0] + 14)
    for k, (name, place) in enumerate(zip(PHONES, _directions(), strict=True)):
        x, y = DISTANCE * place[:2]
        above.plot([0, x], [0, y], color=color(k), lw=0.7)
        _phone(above, (x, y), np.degrees(np.arctan2(y, x)), color(k))
        above.text(1.22 * x, 1.16 * y, name, color=color(k), ha="center", va="center")
    above.set(xlim=(-560, 560), ylim=(-520, 520))
    phi = np.radians(ELEVATION)
    side.plot([-LENGTH / 2, LENGTH / 2], [0, 0], color=REFERENCE, lw=3)
    side.plot([0, 480], [0, 0], color=INK, lw=0.7, ls=":")
    for sign in (-1, 1):
        x, z = sign * DISTANCE * np.cos(phi), DISTANCE * np.sin(phi)
        side.plot([0, x], [0, z], color=COLORS[0], lw=0.7)
        _phone(side, (x, z), np.degrees(np.arctan2(z, x)), COLORS[0])
    side.add_patch(Arc((0, 0), 400, 400, theta1=0, theta2=ELEVATION, color=HIGHLIGHT, lw=1.4))
    side.text(215, 55, f"{ELEVATION:g}°", color=HIGHLIGHT, va="center")
    side.text(-150, 165, "half a metre", color=INK, rotation=-ELEVATION, ha="center")
    side.set(xlim=(-480, 500), ylim=(-60, 330))
    return drawing


def poses() -> Figure:
    """The board in some poses, as one phone sees it."""
    drawing, axes = subplots(2, 3, figsize=(7.2, 2.8))
    drawing.subplots_adjust(0.01, 0.01, 0.99, 0.99, wspace=0.04, hspace=0.06)
    P = _cameras()[:1]
    for axis, (tilt, way) in zip(axes.flat, TILTS, strict=True):
        _framed(axis)
        turn = _tilted(np.radians(tilt), np.radians(way))
        for tile in BOARD.dark_tiles:
            flat = np.vstack([tile.T, np.zeros(len(tile))])
            axis.add_patch(Polygon(project(P, turn @ flat)[0].T, color=INK, lw=0))
        rim = np.vstack([BOARD.outline.T, np.zeros(4)])
        axis.add_patch(Polygon(project(P, turn @ rim)[0].T, fill=False, ec=REFERENCE, lw=1))
    return drawing


def times() -> Figure:
    """Starts of the phones, claps, rest and steady motion, and the fields that tell of them."""
    drawing, axis = subplots(figsize=(5.0, 2.8))
    drawing.subplots_adjust(0.01, 0.01, 0.99, 0.99)
    axis.set_axis_off()
    starts, end = (0.4, 0.0, 1.0, 0.7), 10.0
    for k, (name, start) in enumerate(zip(PHONES, starts, strict=True)):
        axis.plot([start, end], [3 - k, 3 - k], color=color(k), lw=5, solid_capstyle="butt")
        axis.text(-0.15, 3 - k, name, color=color(k), ha="right", va="center", fontsize=8)
    for clap in (1.9, 2.3, 3.0):
        axis.plot([clap, clap], [-0.5, 3.5], color=HIGHLIGHT, lw=1.2)
    axis.text(2.4, 3.65, "claps", color=HIGHLIGHT, ha="center", fontsize=8)
    t = np.linspace(1.0, end, 1500)
    grown = 1 - np.exp(-np.clip(t - 4.2, 0, None) / 0.5)
    axis.plot(t, -1.4 + 0.6 * grown * np.sin(2 * np.pi * 2.2 * t), color=INK, lw=1)
    axis.text(-0.15, -1.4, "plate", color=INK, ha="right", va="center", fontsize=8)
    for begin, stop, name in ((1.0, 4.0, "rest_s, of every film"), (6.4, 9.8, "steady_s")):
        span = {"arrowstyle": "<->", "color": COLORS[0]}
        axis.annotate("", (stop, -2.3), (begin, -2.3), arrowprops=span)
        axis.text((begin + stop) / 2, -2.75, name, color=COLORS[0], ha="center", fontsize=8)
    axis.set(xlim=(-1.5, 10.1), ylim=(-3.1, 4.2))
    return drawing


def corners() -> Figure:
    """The plate as each phone sees it, its corners in the order in which they are asked for."""
    drawing, axes = subplots(2, 2, figsize=(7.2, 4.2))
    drawing.subplots_adjust(0.01, 0.01, 0.99, 0.95, wspace=0.04, hspace=0.14)
    inner = np.array([[-LENGTH / 2 + 10], [-WIDTH / 2 + 10], [0.0]]) / 1000
    for k, (axis, name) in enumerate(zip(axes.flat, PHONES, strict=True)):
        P = _cameras()[k : k + 1]
        _framed(axis)
        axis.set_title(name, fontsize=8, color=color(k))
        uv = project(P, _lifted(_corners()))[0]
        axis.add_patch(Polygon(uv.T, fill=False, ec=REFERENCE, lw=1.6))
        axis.plot(*project(P, _lifted(_markers()))[0], ".", color=INK, markersize=4)
        axis.plot(*project(P, inner)[0], "x", color=HIGHLIGHT, markersize=6)
        middle = uv.mean(axis=1)
        for number, place in enumerate(uv.T, 1):
            u, v = middle + 1.13 * (place - middle)
            axis.text(u, v, str(number), color=HIGHLIGHT, ha="center", va="center")
    return drawing


def _corners() -> Array:
    """The plate's corners in their order, (2, 4), mm from its centre."""
    return np.array([[-1, 1, 1, -1], [-1, -1, 1, 1]]) / 2 * [[LENGTH], [WIDTH]]


def _markers() -> Array:
    """The markers, (2, n), row by row, mm from the plate's centre."""
    x = (np.arange(COLUMNS) - (COLUMNS - 1) / 2) * SPACING
    y = (np.arange(ROWS) - (ROWS - 1) / 2) * SPACING
    return np.stack([np.tile(x, ROWS), np.repeat(y, COLUMNS)])


def _lifted(places: Array) -> Array:
    """Places (2, n) in mm as points of the plate, (3, n), m."""
    return np.vstack([places / 1000, np.zeros(places.shape[1])])


def _directions() -> Array:
    return hemisphere_directions(np.radians(list(PHONES.values())), np.radians([ELEVATION] * 4))


def _cameras() -> Array:
    """Projection matrices of the phones, (4, 3, 4)."""
    turns = hemisphere_rotations(np.radians(list(PHONES.values())), np.radians([ELEVATION] * 4))
    K = np.array([intrinsics(FOCAL, SIZE)] * 4)
    return CameraArray(K, turns, DISTANCE / 1000 * _directions(), SIZE).P


def _tilted(angle: float, way: float) -> Array:
    """Rotation about the axis in the plane that lies at an angle to x (Rodrigues' formula)."""
    x, y = np.cos(way), np.sin(way)
    cross = np.array([[0, 0, y], [0, 0, -x], [-y, x, 0]])
    turn: Array = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    return turn


def _bare(axis: Axes, title: str) -> None:
    axis.set_title(title, fontsize=8)
    axis.set_aspect("equal")
    axis.set_axis_off()


def _framed(axis: Axes) -> None:
    """A panel as a phone's picture: pixels from its upper left corner, and its frame."""
    axis.set(xlim=(0, SIZE[0]), ylim=(SIZE[1], 0), aspect="equal")
    axis.set_axis_off()
    axis.add_patch(Rectangle((0, 0), *SIZE, fill=False, ec=INK, lw=1, clip_on=False))


def _cross(axis: Axes, place: Array) -> None:
    axis.plot(*place, "x", color=HIGHLIGHT, markersize=6, markeredgewidth=1.6)


def _phone(axis: Axes, place: tuple[float, float], degrees: float, ink: str) -> None:
    """A phone as a bar across its line of sight."""
    body: Any = Rectangle(
        (place[0] - 9, place[1] - 45), 18, 90, angle=degrees, rotation_point="center", color=ink
    )
    axis.add_patch(body)


DRAWINGS: dict[str, Callable[[], Figure]] = {
    "guide-print.svg": sheets,
    "guide-plate.svg": plate,
    "guide-phones.svg": phones,
    "guide-board.svg": poses,
    "guide-time.svg": times,
    "guide-corners.svg": corners,
}
"""By file."""
