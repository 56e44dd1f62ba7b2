"""Drawings of what the camera setups are: the angles, and every case from above."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Arc, Circle, Rectangle

from thesis_lib import files
from thesis_lib.facts import setups
from thesis_lib.facts.setups import Setting
from thesis_lib.figure_sets.parametric.parameters import CAMERA_STUDIES
from thesis_lib.plotting.style import (
    COLORS,
    HIGHLIGHT,
    INK,
    REFERENCE,
    color,
    in_style,
    subplots,
    svg,
)

NAMES = ("setup-angles.svg", "setup-cases.svg")
SUBJECT = "beam"


def write(folder: Path) -> None:
    """Write :data:`NAMES` into `folder`."""
    for name, draw in zip(NAMES, (angles, cases), strict=True):
        with in_style():
            picture = svg(draw())
        files.whole_text(folder / name, picture)


def angles() -> Figure:
    """Azimuth, aperture, elevation and distance, from above and from the side."""
    figure, (above, side) = subplots(1, 2, figsize=(7, 2.5))
    for axes, title in ((above, "(a) from above"), (side, "(b) from the side")):
        _bare(axes, title)
    half, theta, phi = 0.45, np.radians(50), np.radians(30)
    above.add_patch(Rectangle((-half, -0.02), 2 * half, 0.04, color=REFERENCE))
    _arrow(above, (0, 0), (0.7, 0), "X")
    _arrow(above, (0, 0), (0, 1.12), "Y")
    for sign, name in ((1, "camera A"), (-1, "camera B")):
        _camera(above, sign * np.sin(theta), np.cos(theta), name)
    above.add_patch(Arc((0, 0), 0.76, 0.76, theta1=40, theta2=90, color=COLORS[0], lw=1.6))
    above.text(0.03, 0.42, "azimuth θ", color=COLORS[0], fontsize=8)
    above.add_patch(Arc((0, 0), 1.3, 1.3, theta1=40, theta2=140, color=HIGHLIGHT, lw=1.6))
    above.text(-0.04, 0.69, "aperture α", color=HIGHLIGHT, ha="right", fontsize=8)
    side.plot([-half, half], [0, 0], color=REFERENCE, lw=3)
    wave = np.linspace(-half, half, 60)
    side.plot(wave, 0.12 * (wave + half) ** 2, color=REFERENCE, lw=1, ls="--")
    _arrow(side, (0, 0), (0, 0.95), "Z")
    side.plot([0, 1.1], [0, 0], color=INK, lw=0.8, ls=":")
    _camera(side, np.cos(phi), np.sin(phi), "camera")
    side.add_patch(Arc((0, 0), 1.0, 1.0, theta1=0, theta2=30, color=COLORS[0], lw=1.6))
    side.text(0.52, 0.1, "elevation φ", color=COLORS[0])
    side.text(0.36, 0.38, "distance d", color=INK, rotation=30, ha="center")
    figure.subplots_adjust(0.02, 0.02, 0.98, 0.9)
    above.set(xlim=(-1.05, 1.05), ylim=(-0.15, 1.25))
    side.set(xlim=(-0.7, 1.4), ylim=(-0.15, 1.25))
    return figure


def cases() -> Figure:
    """Every case of Tables 3.3 and 3.4 from above, its settings in the colours of their figures."""
    found: dict[str, list[Setting]] = {}
    for study in CAMERA_STUDIES.values():
        one = study()
        if one.subject == SUBJECT:
            for setting in one.settings():
                found.setdefault(setting.case, []).append(setting)
    figure, grid = subplots(3, 4, figsize=(7, 5.2))
    figure.subplots_adjust(0.02, 0.01, 0.98, 0.95, hspace=0.15)
    for axes, (case, settings) in zip(grid.flat, sorted(found.items()), strict=True):
        _bare(axes, f"{case}: {_words(settings)}")
        _from_above(axes, settings)
    return figure


def _from_above(axes: Axes, settings: list[Setting]) -> None:
    """The cameras of a case around the beam; of a growing set each camera where it comes in."""
    far = max(setting.distance_mm for setting in settings)
    for elevation in (0, 30, 60):
        rim = Circle((0, 0), np.cos(np.radians(elevation)), fill=False, ec="#d4d4d4", lw=0.6)
        axes.add_patch(rim)
    length = setups.beam().length * 500 / far
    axes.plot([-length, length], [0, 0], color=REFERENCE, lw=3, solid_capstyle="butt")
    seen: set[object] = set()
    for i, setting in enumerate(settings):
        for direction in setting.directions_deg:
            place = (*direction, setting.distance_mm)
            if place in seen:
                continue
            seen.add(place)
            azimuth, elevation = np.radians(direction)
            radius = np.cos(elevation) * setting.distance_mm / far
            axes.plot(radius * np.sin(azimuth), radius * np.cos(azimuth), "o", ms=4, color=color(i))
    axes.set(xlim=(-1.1, 1.1), ylim=(-1.1, 1.1))


def _words(settings: list[Setting]) -> str:
    """First and last setting, the unit once."""
    widths = [setting.resolution_px[0] for setting in (settings[0], settings[-1])]
    if widths[0] != widths[1]:
        return f"{widths[0]} … {widths[1]} px across"
    first, last = (setting.label.split(" ") for setting in (settings[0], settings[-1]))
    return f"{' '.join(first if first[1:] != last[1:] else first[:1])} … {' '.join(last)}"


def _bare(axes: Axes, title: str) -> None:
    axes.set_title(title, fontsize=8)
    axes.set_aspect("equal")
    axes.set_axis_off()


def _arrow(axes: Axes, start: tuple[float, float], end: tuple[float, float], name: str) -> None:
    axes.annotate("", end, start, arrowprops={"arrowstyle": "->", "color": INK, "lw": 0.8})
    axes.text(end[0] + 0.03, end[1], name, color=INK)


def _camera(axes: Axes, x: float, y: float, name: str) -> None:
    axes.plot([0, x], [0, y], color=INK, lw=0.8)
    axes.plot(x, y, "o", ms=7, color=INK)
    axes.text(x, y + 0.09, name, color=INK, ha="center")
