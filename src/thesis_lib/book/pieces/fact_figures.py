"""Figures of chapters that need no cube: the facts of the thesis by themselves."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from thesis_lib.facts import setups
from thesis_lib.facts.setups import Setting
from thesis_lib.figure_sets.optics.figures import pixel_flows
from thesis_lib.figure_sets.parametric.parameters import CAMERA_STUDIES, camera_study
from thesis_lib.plotting.style import (
    CYCLE_COLORS,
    HIGHLIGHT_COLOR,
    INK_COLOR,
    REFERENCE_COLOR,
    cycle_color,
    draw_map,
    make_logarithmic,
    subplots,
)
from thesis_lib.vibration import deflection_shape
from thesis_lib.vibration.structure import (
    Structure,
    modal_coordinates,
    peak_deflection,
    resonance_frequency,
)

WIDTHS_PX = (320, 640, 1280, 1920)


def draw_response() -> Figure:
    """Draw the response of two points of the beam, and the shapes behind its peaks."""
    beam = setups.thesis_beam()
    drawing, (left, right) = subplots(1, 2, figsize=(7.2, 2.6), layout="constrained")
    hertz = np.geomspace(3, 200, 900)
    points = np.array([[0.45, 1.0], [0.5, 0.5]]) * [[beam.length], [beam.width]]
    moved = modal_coordinates(beam, 2 * np.pi * hertz, 20)
    response = np.abs(moved.T @ beam.mode_shapes(range(1, 21), points))
    for i, word in enumerate(("45 % of the length", "the tip")):
        left.plot(hertz, 1000 * response[:, i], color=cycle_color(i), label=word)
    make_logarithmic(left.xaxis, [5, 10, 20, 50, 100, 200])
    make_logarithmic(left.yaxis, [1e-4, 1e-3, 0.01, 0.1, 1, 10])
    left.set(
        title="(a) two points, a force of 1 N", xlabel="frequency in Hz", ylabel="motion in mm"
    )
    left.legend()
    for i, mode in enumerate((1, 2, 3)):
        w = deflection_shape(beam, mode, beam.markers, peak=1.0)
        right.plot(1000 * beam.markers[0], w, color=CYCLE_COLORS[i + 2], label=f"peak {mode}")
    right.set(title="(b) the shape behind each peak", xlabel="x in mm", ylabel="of its largest")
    right.legend()
    return drawing


def draw_deflections() -> Figure:
    """Draw how far 1 N moves beam and plate at their resonances, and what a pixel spans."""
    drawing, axes = subplots(figsize=(6.4, 3.0), layout="constrained")
    bodies: dict[str, Structure] = {"beam": setups.thesis_beam(), "plate": setups.thesis_plate()}
    for i, (word, body) in enumerate(bodies.items()):
        modes = range(1, 6)
        hertz = [resonance_frequency(body, mode) / (2 * np.pi) for mode in modes]
        peak = [1000 * peak_deflection(body, mode) for mode in modes]
        axes.plot(hertz, peak, "o-", color=cycle_color(i), label=f"{word}, force of 1 N")
    for n, width in enumerate((320, 1920)):
        span = 500 * 36 / 24 / width  # mm, of the lens and sensor that the book takes
        axes.axhline(span, color=INK_COLOR, linewidth=1, linestyle=("--", ":")[n])
        words = f"a pixel of {width} across, 500 mm away"
        axes.text(1900, span * 1.15, words, color=INK_COLOR, fontsize=8, ha="right")
    make_logarithmic(axes.xaxis, [5, 10, 20, 50, 100, 200, 500, 1000, 2000])
    make_logarithmic(axes.yaxis, [1e-6, 1e-5, 1e-4, 1e-3, 0.01, 0.1, 1, 10])
    axes.set(xlabel="natural frequency in Hz", ylabel="largest deflection in mm")
    axes.legend(loc="lower left")
    return drawing


def draw_rates() -> Figure:
    """Draw frames per second against pixels of a frame, at the same pixels per second."""
    drawing, axes = subplots(figsize=(6.4, 2.6), layout="constrained")
    widths, fps = np.array([(width, rate) for width, _, rate in pixel_flows()]).T
    axes.plot(widths, fps, "o-", color=CYCLE_COLORS[0], label="frames per second")
    axes.plot(widths, fps / 2, "s--", color=CYCLE_COLORS[4], label="highest frequency, Hz")
    make_logarithmic(axes.xaxis, WIDTHS_PX)
    make_logarithmic(axes.yaxis, [20, 50, 100, 200, 500, 1000, 2000])
    axes.set(xlabel="pixels across a frame", ylabel="per second")
    axes.legend()
    return drawing


def draw_beam_modes() -> Figure:
    """Draw the three shapes of the beam that are measured, each marker a dot."""
    beam = setups.thesis_beam()
    drawing, axes = subplots(figsize=(6.4, 2.4), layout="constrained")
    for i, mode in enumerate((1, 2, 3)):
        w = deflection_shape(beam, mode, beam.markers, peak=1.0)
        hertz = beam.angular_frequencies(mode)[-1] / (2 * np.pi)
        axes.plot(
            1000 * beam.markers[0], w, ".-", color=cycle_color(i), label=_mode_label(mode, hertz)
        )
    axes.axhline(0, color=REFERENCE_COLOR, linewidth=1)
    axes.set(xlabel="x in mm, from the clamp", ylabel="deflection, of its peak")
    axes.legend()
    return drawing


def draw_plate_modes() -> Figure:
    """Draw the three shapes of the plate that are measured, a cell for each marker."""
    plate = setups.thesis_plate()
    x, y = (np.unique(np.round(each, 9)) * 1000 for each in plate.markers)
    drawing, axes = subplots(1, 3, figsize=(7.2, 2.0), layout="constrained", sharey=True)
    for axis, mode in zip(axes, (1, 2, 3), strict=True):
        w = deflection_shape(plate, mode, plate.markers, peak=1.0)
        picture = draw_map(axis, w.reshape(y.size, x.size), x, y, 1.0)
        hertz = plate.angular_frequencies(mode)[-1] / (2 * np.pi)
        axis.set(title=_mode_label(mode, hertz), xlabel="x in mm")
    axes[0].set_ylabel("y in mm")
    drawing.colorbar(picture, ax=axes, label="of the peak", shrink=0.9)
    return drawing


def draw_alias() -> Figure:
    """Draw a vibration, and what a camera with fewer frames than it needs makes of it."""
    drawing, axes = subplots(figsize=(6.4, 2.2), layout="constrained")
    hertz, rate = resonance_frequency(setups.thesis_beam(), 2) / (2 * np.pi), 60.0
    t, seen = np.linspace(0, 0.2, 800), np.arange(0, 0.2, 1 / rate)
    slow = hertz - rate * np.round(hertz / rate)
    for one, style in ((hertz, "-"), (slow, "--")):
        word = "true" if one == hertz else "seen"
        tone = CYCLE_COLORS[0] if word == "true" else HIGHLIGHT_COLOR
        label = f"{word}: {abs(one):.3g} Hz"
        axes.plot(t, np.cos(2 * np.pi * one * t), style, color=tone, linewidth=1, label=label)
    axes.plot(
        seen, np.cos(2 * np.pi * hertz * seen), "o", color=INK_COLOR, label=f"{rate:g} frames/s"
    )
    axes.set(xlabel="time in s", ylabel="motion", ylim=(-1.2, 2.1), yticks=[-1, 0, 1])
    axes.legend(ncols=3, loc="upper center")
    return drawing


def draw_cases() -> Figure:
    """Draw every case of Tables 3.3 and 3.4 from above, each setting in a colour of its own."""
    found: dict[str, list[Setting]] = {}
    for one in map(camera_study, CAMERA_STUDIES):
        if one.subject == "beam":
            for setting in one.settings():
                found.setdefault(setting.case, []).append(setting)
    figure, grid = subplots(3, 4, figsize=(7, 5.2))
    figure.subplots_adjust(0.02, 0.01, 0.98, 0.95, hspace=0.15)
    for axes, (case, settings) in zip(grid.flat, sorted(found.items()), strict=True):
        axes.set_title(f"{case}: {_range_words(settings)}", fontsize=8)
        axes.set_aspect("equal")
        axes.set_axis_off()
        _draw_from_above(axes, settings)
    return figure


def _draw_from_above(axes: Axes, settings: list[Setting]) -> None:
    """Draw the cameras of a case around the beam; in a growing set each where it comes in."""
    far = max(setting.distance_mm for setting in settings)
    for elevation in (0, 30, 60):
        rim = Circle((0, 0), np.cos(np.radians(elevation)), fill=False, ec="#d4d4d4", lw=0.6)
        axes.add_patch(rim)
    length = setups.thesis_beam().length * 500 / far
    axes.plot([-length, length], [0, 0], color=REFERENCE_COLOR, lw=3, solid_capstyle="butt")
    seen: set[object] = set()
    for i, setting in enumerate(settings):
        for direction in setting.directions_deg:
            place = (*direction, setting.distance_mm)
            if place in seen:
                continue
            seen.add(place)
            azimuth, elevation = np.radians(direction)
            radius = np.cos(elevation) * setting.distance_mm / far
            axes.plot(
                radius * np.sin(azimuth), radius * np.cos(azimuth), "o", ms=4, color=cycle_color(i)
            )
    axes.set(xlim=(-1.1, 1.1), ylim=(-1.1, 1.1))


def _range_words(settings: list[Setting]) -> str:
    """Return the first and the last setting, the unit once."""
    widths = [setting.resolution_px[0] for setting in (settings[0], settings[-1])]
    if widths[0] != widths[1]:
        return f"{widths[0]} … {widths[1]} px across"
    first, last = (setting.label.split(" ") for setting in (settings[0], settings[-1]))
    return f"{' '.join(first if first[1:] != last[1:] else first[:1])} … {' '.join(last)}"


def _mode_label(mode: int, hertz: float) -> str:
    return f"mode {mode}: {hertz:.4g} Hz"


FACT_FIGURES: dict[str, Callable[[], Figure]] = {
    "beam-modes.svg": draw_beam_modes,
    "plate-modes.svg": draw_plate_modes,
    "introduction-point.svg": draw_response,
    "introduction-rarer.svg": draw_deflections,
    "introduction-rates.svg": draw_rates,
    "motions-frames.svg": draw_alias,
    "setup-cases.svg": draw_cases,
}
