"""Figures of chapters that need no cube: what the facts of the thesis say by themselves."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Ellipse

from thesis_lib.facts import setups
from thesis_lib.figure_sets.optics.tables import flows
from thesis_lib.plotting.style import (
    COLORS,
    HIGHLIGHT,
    INK,
    REFERENCE,
    color,
    draw_map,
    logarithmic,
    subplots,
)
from thesis_lib.vibration import deflection_shape
from thesis_lib.vibration.structure import (
    Structure,
    modal_coordinates,
    peak_deflection,
    resonance,
)

WIDTHS = (320, 640, 1280, 1920)


def one_point() -> Figure:
    """The response of two points of the beam over frequency, and the shapes behind its peaks."""
    beam = setups.beam()
    drawing, (left, right) = subplots(1, 2, figsize=(7.2, 2.6), layout="constrained")
    hertz = np.geomspace(3, 200, 900)
    points = np.array([[0.45, 1.0], [0.5, 0.5]]) * [[beam.length], [beam.width]]
    moved = modal_coordinates(beam, 2 * np.pi * hertz, 20)
    response = np.abs(moved.T @ beam.mode_shapes(range(1, 21), points))
    for i, word in enumerate(("45 % of the length", "the tip")):
        left.plot(hertz, 1000 * response[:, i], color=color(i), label=word)
    logarithmic(left.xaxis, [5, 10, 20, 50, 100, 200])
    logarithmic(left.yaxis, [1e-4, 1e-3, 0.01, 0.1, 1, 10])
    left.set(
        title="(a) two points, a force of 1 N", xlabel="frequency in Hz", ylabel="motion in mm"
    )
    left.legend()
    for i, mode in enumerate((1, 2, 3)):
        w = deflection_shape(beam, mode, beam.markers, peak=1.0)
        right.plot(1000 * beam.markers[0], w, color=COLORS[i + 2], label=f"peak {mode}")
    right.set(title="(b) the shape behind each peak", xlabel="x in mm", ylabel="of its largest")
    right.legend()
    return drawing


def two_views() -> Figure:
    """What one camera leaves open, and what a second one adds, seen from the side."""
    drawing, axes = subplots(1, 2, figsize=(6.4, 2.4))
    drawing.subplots_adjust(0.01, 0.01, 0.99, 0.9, wspace=0.05)
    point, eyes = np.array([0.0, 0.35]), [np.array([-1.0, 1.0]), np.array([1.0, 1.0])]
    titles = "(a) one camera: anywhere on a line", "(b) two cameras: one point"
    for axis, title, seen in zip(axes, titles, (eyes[:1], eyes), strict=True):
        axis.plot([-1.2, 1.2], [0, 0], color=REFERENCE, linewidth=3)
        for i, eye in enumerate(seen):
            end = eye + 1.45 * (point - eye)
            axis.plot(*np.stack([eye, end], axis=1), color=color(i), linewidth=1.2)
            axis.plot(*eye, "s", color=color(i), markersize=9)
        if len(seen) == 1:
            for step in (0.7, 1.0, 1.3):
                place = eyes[0] + step * (point - eyes[0])
                axis.plot(*place, "o", color=HIGHLIGHT, markerfacecolor="white", markersize=7)
        else:
            axis.plot(*point, "o", color=HIGHLIGHT, markersize=7)
        axis.set(title=title, xlim=(-1.3, 1.3), ylim=(-0.15, 1.15), aspect="equal")
        axis.set_axis_off()
    return drawing


def rarer() -> Figure:
    """How far 1 N moves beam and plate at their resonances, beside what a pixel spans."""
    drawing, axes = subplots(figsize=(6.4, 3.0), layout="constrained")
    bodies: dict[str, Structure] = {"beam": setups.beam(), "plate": setups.plate()}
    for i, (word, body) in enumerate(bodies.items()):
        modes = range(1, 6)
        hertz = [resonance(body, mode) / (2 * np.pi) for mode in modes]
        peak = [1000 * peak_deflection(body, mode) for mode in modes]
        axes.plot(hertz, peak, "o-", color=color(i), label=f"{word}, force of 1 N")
    for n, width in enumerate((320, 1920)):
        span = 500 * 36 / 24 / width  # mm, of the lens and sensor that the book takes
        axes.axhline(span, color=INK, linewidth=1, linestyle=("--", ":")[n])
        words = f"a pixel of {width} across, 500 mm away"
        axes.text(1900, span * 1.15, words, color=INK, fontsize=8, ha="right")
    logarithmic(axes.xaxis, [5, 10, 20, 50, 100, 200, 500, 1000, 2000])
    logarithmic(axes.yaxis, [1e-6, 1e-5, 1e-4, 1e-3, 0.01, 0.1, 1, 10])
    axes.set(xlabel="natural frequency in Hz", ylabel="largest deflection in mm")
    axes.legend(loc="lower left")
    return drawing


def rates() -> Figure:
    """Frames per second against pixels of a frame, at the same pixels per second."""
    drawing, axes = subplots(figsize=(6.4, 2.6), layout="constrained")
    widths, fps = np.array([(width, rate) for width, _, rate in flows()]).T
    axes.plot(widths, fps, "o-", color=COLORS[0], label="frames per second")
    axes.plot(widths, fps / 2, "s--", color=COLORS[4], label="highest frequency, Hz")
    logarithmic(axes.xaxis, WIDTHS)
    logarithmic(axes.yaxis, [20, 50, 100, 200, 500, 1000, 2000])
    axes.set(xlabel="pixels across a frame", ylabel="per second")
    axes.legend()
    return drawing


def pinhole() -> Figure:
    """A point and its image behind the hole, and before it."""
    drawing, axes = subplots(figsize=(6.4, 2.3))
    drawing.subplots_adjust(0.01, 0.01, 0.99, 0.99)
    f, depth, height = 1.0, 3.0, 1.2
    image = f * height / depth
    axes.plot([depth, -f], [height, -image], color=COLORS[0], linewidth=1.2)
    axes.plot([depth, -f], [0, 0], color=INK, linewidth=0.8, linestyle=":")
    for z, words in ((-f, "image behind,\nupside down"), (f, "image plane\nof the model")):
        axes.plot([z, z], [-0.75, 0.75], color=REFERENCE, linewidth=2)
        axes.text(z, -0.85, words, ha="center", va="top", fontsize=8, color=INK)
    for z, x, tone in ((depth, height, HIGHLIGHT), (-f, -image, COLORS[4]), (f, image, COLORS[4])):
        axes.annotate("", (z, x), (z, 0), arrowprops={"arrowstyle": "->", "color": tone, "lw": 2})
    axes.plot([0, 0], [0.06, 0.75], color=INK, linewidth=2)
    axes.plot([0, 0], [-0.06, -0.75], color=INK, linewidth=2)
    axes.text(0, -0.85, "hole", ha="center", va="top", fontsize=8, color=INK)
    axes.text(depth + 0.08, height / 2, "X", color=HIGHLIGHT, va="center")
    axes.text(f + 0.06, image / 2, "u = f X / Z", color=COLORS[4], va="center")
    axes.text(-f - 0.06, -image / 2, "−f X / Z", color=COLORS[4], va="center", ha="right")
    for start, end, name in ((0, f, "f"), (-f, 0, "f"), (0, depth, "Z")):
        up = 0.95 if name == "f" else 1.35
        axes.annotate("", (end, up), (start, up), arrowprops={"arrowstyle": "<->", "color": INK})
        axes.text((start + end) / 2, up + 0.05, name, ha="center", color=INK)
    axes.set(xlim=(-2.0, 3.6), ylim=(-1.3, 1.6))
    axes.set_axis_off()
    return drawing


def beam_modes() -> Figure:
    """The three shapes of the beam that are measured, each marker a dot."""
    beam = setups.beam()
    drawing, axes = subplots(figsize=(6.4, 2.4), layout="constrained")
    for i, mode in enumerate((1, 2, 3)):
        w = deflection_shape(beam, mode, beam.markers, peak=1.0)
        hertz = beam.angular_frequencies(mode)[-1] / (2 * np.pi)
        axes.plot(1000 * beam.markers[0], w, ".-", color=color(i), label=_mode(mode, hertz))
    axes.axhline(0, color=REFERENCE, linewidth=1)
    axes.set(xlabel="x in mm, from the clamp", ylabel="deflection, of its peak")
    axes.legend()
    return drawing


def plate_modes() -> Figure:
    """The three shapes of the plate that are measured, a cell for each marker."""
    plate = setups.plate()
    x, y = (np.unique(np.round(each, 9)) * 1000 for each in plate.markers)
    drawing, axes = subplots(1, 3, figsize=(7.2, 2.0), layout="constrained", sharey=True)
    for axis, mode in zip(axes, (1, 2, 3), strict=True):
        w = deflection_shape(plate, mode, plate.markers, peak=1.0)
        picture = draw_map(axis, w.reshape(y.size, x.size), x, y, 1.0)
        hertz = plate.angular_frequencies(mode)[-1] / (2 * np.pi)
        axis.set(title=_mode(mode, hertz), xlabel="x in mm")
    axes[0].set_ylabel("y in mm")
    drawing.colorbar(picture, ax=axes, label="of the peak", shrink=0.9)
    return drawing


def discs() -> Figure:
    """A row of round markers, seen lower and lower."""
    drawing, axes = subplots(1, 3, figsize=(6.4, 1.3))
    drawing.subplots_adjust(0.01, 0.02, 0.99, 0.85)
    for axis, elevation in zip(axes, (60, 22, 7), strict=True):
        for x in range(4):
            height = np.sin(np.radians(elevation))
            axis.add_patch(Ellipse((2 * x, 0), 1.2, 1.2 * height, color=INK))
        axis.set(title=f"from {elevation}°", xlim=(-1, 7), ylim=(-0.8, 0.8), aspect="equal")
        axis.set_axis_off()
    return drawing


def frames() -> Figure:
    """A vibration, seen by a camera with fewer frames than it needs, and what it looks like."""
    drawing, axes = subplots(figsize=(6.4, 2.2), layout="constrained")
    hertz, rate = resonance(setups.beam(), 2) / (2 * np.pi), 60.0
    t, seen = np.linspace(0, 0.2, 800), np.arange(0, 0.2, 1 / rate)
    slow = hertz - rate * np.round(hertz / rate)
    for one, style in ((hertz, "-"), (slow, "--")):
        word = "true" if one == hertz else "seen"
        tone = COLORS[0] if word == "true" else HIGHLIGHT
        label = f"{word}: {abs(one):.3g} Hz"
        axes.plot(t, np.cos(2 * np.pi * one * t), style, color=tone, linewidth=1, label=label)
    axes.plot(seen, np.cos(2 * np.pi * hertz * seen), "o", color=INK, label=f"{rate:g} frames/s")
    axes.set(xlabel="time in s", ylabel="motion", ylim=(-1.2, 2.1), yticks=[-1, 0, 1])
    axes.legend(ncols=3, loc="upper center")
    return drawing


def _mode(mode: int, hertz: float) -> str:
    return f"mode {mode}: {hertz:.4g} Hz"


OF_FACTS: dict[str, Callable[[], Figure]] = {
    "beam-modes.svg": beam_modes,
    "plate-modes.svg": plate_modes,
    "introduction-point.svg": one_point,
    "introduction-rarer.svg": rarer,
    "introduction-views.svg": two_views,
    "introduction-rates.svg": rates,
    "cameras-pinhole.svg": pinhole,
    "layouts-discs.svg": discs,
    "motions-frames.svg": frames,
}
