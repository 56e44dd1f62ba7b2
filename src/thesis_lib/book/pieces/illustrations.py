"""Figures of chapters, one for each step of the argument, drawn from cubes or from facts.

Figures that need neither are in ``book/figures``.
"""

import json
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle

from thesis_lib import files
from thesis_lib.book.pieces.opened import read_once, write_placeholder
from thesis_lib.facts import setups
from thesis_lib.figure_sets import display
from thesis_lib.figure_sets.optics.figures import pixel_flows
from thesis_lib.figure_sets.parametric import compute, figure_set
from thesis_lib.plotting import selection, style
from thesis_lib.vibration import deflection_shape, structure as structures

DRAWN_MODE = 3  # of the curves over the varied parameter
LAW_SETTINGS = 101
# By study: axis label; ticks, if not the computed values; and the parameters over whose range the
# law is drawn, at LAW_SETTINGS settings: with fewer its line would hide the variation between the
# settings of the thesis. There are none between numbers of cameras.
VARIED: dict[str, tuple[str, tuple[float, ...], tuple[str, ...]]] = {
    "distance": ("distance in mm", (), ("distances_mm",)),
    "aperture": ("aperture in °", (16, 60, 110, 160), ("half_apertures_deg", "elevations_deg")),
    "resolution": ("pixels across the image", (), ("widths_px",)),
    "arrays": ("number of cameras", (2, 4, 6, 8, 12), ()),
}


def draw_varied(of: str, cube: xr.Dataset) -> Figure:
    """Draw the mean error over the varied parameter: rms and band of the trials, and the law."""
    drawing, axes = style.subplots(figsize=(5.2, 3.2))  # to be read on a phone
    parts, (label, ticks, parameters) = selection.split_cases(cube, DRAWN_MODE), VARIED[of]
    fine = None
    if parameters:  # the same study with many settings from its first to its last
        asked = json.loads(cube.attrs["parameters"]) | {"trials": 0, "cube": ""}
        for name in parameters:
            ends = np.linspace(min(asked[name]), max(asked[name]), LAW_SETTINGS)
            asked[name] = (np.rint(ends).astype(int) if name == "widths_px" else ends).tolist()
        fine = compute.run(figure_set.camera_study(cube.attrs["figure_set"], asked))
    for i, (case, part) in enumerate(parts.items()):
        bars, order = selection.error_bars(cube, case, DRAWN_MODE), np.argsort(part["value"].values)
        (low, _, high), rms = bars.band[:, order], selection.trial_rms(part["mean_error"])[order]
        shift = 1.02 ** (i - (len(parts) - 1) / 2)  # side by side
        at = part["value"].values[order] * shift
        color, name = style.cycle_color(i), f"case {case.replace(chr(39), '′')}"
        axes.vlines(at, low, high, color=color, linewidth=1)
        axes.plot(at, rms, "osD^v*"[i], label=name, color=color, markersize=4)
        if fine is None:
            axes.plot(at, bars.predicted[order], "_", color=color, markersize=10)
        else:
            law = selection.select_settings(fine, case, DRAWN_MODE).sortby("value")
            axes.plot(law["value"] * shift, law["predicted_error"], color=color, linewidth=1)
    style.log_axes(axes, ticks or np.unique(cube["value"]), [1, 2, 3, 5, 10, 20, 30, 50])
    axes.set(xlabel=label, ylabel=f"mean error in mode {DRAWN_MODE}, %")
    if len(parts) > 1:
        drawing.legend(loc="outside upper left", ncols=3, columnspacing=1)
    return drawing


def draw_elevations(cube: xr.Dataset) -> Figure:
    """Draw the error over elevation: median and band of the trials, by case."""
    drawing, axes = style.subplots(figsize=(6.4, 3.0))
    for i, (case, part) in enumerate(selection.split_cases(cube, 1).items()):
        low, median, high = selection.error_bars(cube, case, 1).band
        bounds, words = [median - low, high - median], case.replace("-", " ")
        look = {"fmt": "osD^v"[i] + "-", "color": style.cycle_color(i), "ms": 4, "linewidth": 1}
        axes.errorbar(part["value"], median, bounds, label=words, **look)
    style.make_logarithmic(axes.yaxis, [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5])
    axes.set(xlabel="elevation in °", ylabel="mean error, %", xlim=(0, None))
    axes.legend()
    return drawing


def draw_distances(cube: xr.Dataset) -> Figure:
    """Draw the error over distance and over aperture: rms and band of the trials, and the law."""
    drawing, panels = style.subplots(1, 2, figsize=(7.2, 2.8), sharey=True)
    for axes, case, unit in zip(panels, ("distance", "aperture"), ("mm", "°"), strict=True):
        part, bars = selection.select_settings(cube, case, 1), selection.error_bars(cube, case, 1)
        values, law = part["value"].values, "law, one noise for all"
        rms = selection.trial_rms(part["mean_error"])
        axes.vlines(values, bars.band[0], bars.band[2], color=style.BLUE)
        axes.plot(values, rms, "o", color=style.BLUE, label="rendered frames")
        axes.plot(values, bars.predicted, "_", color=style.INK_COLOR, markersize=14, label=law)
        ticks = values[:: 1 + len(values) // 6]
        style.log_axes(axes, ticks, [0.01, 0.02, 0.05, 0.1, 0.2])
        axes.set(xlabel=f"{case} in {unit}")
    panels[0].set_ylabel("mean error, %")
    panels[0].legend()
    return drawing


def draw_few_frames(cube: xr.Dataset) -> Figure:
    """Draw the error over the frame rate for each way to use too few frames, by mode."""
    modes = cube["mode"].values.tolist()
    drawing, panels = style.subplots(1, len(modes), figsize=(7.2, 2.8), sharey=True, squeeze=False)
    for axes, mode in zip(panels[0], modes, strict=True):
        for i, (case, part) in enumerate(selection.split_cases(cube, mode).items()):
            median = selection.error_bars(cube, case, mode).band[1]
            mark, ink = "osD^"[i] + ("--" if case == "known" else "-"), style.cycle_color(i)
            axes.plot(part["value"], median, mark, color=ink, ms=4, label=case)
        style.log_axes(axes, cube["frame_rate"].values, [0.1, 0.3, 1, 3, 10, 30])
        axes.set(title=f"mode {mode}", xlabel="frames per second")
    panels[0][0].set_ylabel("mean error, %")
    panels[0][-1].legend()
    return drawing


def draw_plate_errors(cube: xr.Dataset) -> Figure:
    """Draw the deflection's error in mode 1 of fitted centres and of whole pixels."""
    cases = selection.split_cases(cube, 1)
    drawing, axes = style.subplots(figsize=(6.4, 3.0))
    for i, part in enumerate(cases.values()):
        place = i + np.linspace(-0.3, 0.3, part.sizes["setting"])
        axes.plot(place, selection.trial_rms(part["mean_error"]), "o-", color=style.BLUE)
        axes.plot(place, part["rounded_error"], "_", color=style.RED, markersize=8)
    handles = [
        Line2D([], [], color=style.BLUE, marker="o", label="fitted centres"),
        Line2D([], [], color=style.RED, marker="_", ls="", label="whole pixels, by the law"),
    ]
    axes.legend(handles=handles, loc="upper center", ncols=2)
    axes.set_xticks(range(len(cases)), [*cases])
    style.make_logarithmic(axes.yaxis, [0.1, 0.3, 1, 3, 10, 30, 100])
    axes.set(ylabel="error of the deflection, %", ylim=(None, 400))
    axes.set_xlabel("varied parameter, from its first setting to its last")
    return drawing


def draw_response() -> Figure:
    """Draw the response of two points of the beam, and the shapes behind its peaks."""
    beam = setups.thesis_beam()
    drawing, (left, right) = style.subplots(1, 2, figsize=(7.2, 2.6))
    hertz = np.geomspace(3, 200, 900)
    points = np.array([[0.45, 1.0], [0.5, 0.5]]) * [[beam.length], [beam.width]]
    moved = structures.modal_coordinates(beam, 2 * np.pi * hertz, 20)
    response = np.abs(moved.T @ beam.mode_shapes(range(1, 21), points))
    for i, word in enumerate(("45 % of the length", "the tip")):
        left.plot(hertz, 1000 * response[:, i], color=style.cycle_color(i), label=word)
    style.log_axes(left, [5, 10, 20, 50, 100, 200], [1e-4, 1e-3, 0.01, 0.1, 1, 10])
    left.set(xlabel="frequency in Hz", ylabel="motion in mm")
    left.set_title("(a) two points, a force of 1 N")
    left.legend()
    for mode, ink in zip((1, 2, 3), style.CYCLE_COLORS[2:], strict=False):
        w = deflection_shape(beam, mode, beam.markers, peak=1.0)
        right.plot(1000 * beam.markers[0], w, color=ink, label=f"peak {mode}")
    right.set(title="(b) the shape behind each peak", xlabel="x in mm", ylabel="of its largest")
    right.legend()
    return drawing


def draw_deflections() -> Figure:
    """Draw the deflection of beam and plate by 1 N at resonance, and the width of a pixel."""
    drawing, axes = style.subplots(figsize=(6.4, 3.0))
    bodies: list[structures.Structure] = [setups.thesis_beam(), setups.thesis_plate()]
    for i, (word, body) in enumerate(zip(("beam", "plate"), bodies, strict=True)):
        modes = range(1, 6)
        hertz = [structures.resonance_frequency(body, mode) / (2 * np.pi) for mode in modes]
        peak = [1000 * structures.peak_deflection(body, mode) for mode in modes]
        axes.plot(hertz, peak, "o-", color=style.cycle_color(i), label=f"{word}, force of 1 N")
    for n, width in enumerate((320, 1920)):
        span = 500 * 36 / 24 / width  # mm, of the lens and sensor that the book uses
        axes.axhline(span, color=style.INK_COLOR, linewidth=1, linestyle=("--", ":")[n])
        words = f"a pixel of {width} across, 500 mm away"
        axes.text(1900, span * 1.15, words, color=style.INK_COLOR, fontsize=8, ha="right")
    powers = [1e-6, 1e-5, 1e-4, 1e-3, 0.01, 0.1, 1, 10]
    style.log_axes(axes, [5, 10, 20, 50, 100, 200, 500, 1000, 2000], powers)
    axes.set(xlabel="natural frequency in Hz", ylabel="largest deflection in mm")
    axes.legend(loc="lower left")
    return drawing


def draw_rates() -> Figure:
    """Draw frames per second against pixels of a frame, at the same pixels per second."""
    drawing, axes = style.subplots(figsize=(6.4, 2.6))
    widths, fps = np.array([(width, rate) for width, _, rate in pixel_flows()]).T
    axes.plot(widths, fps, "o-", color=style.BLUE, label="frames per second")
    axes.plot(widths, fps / 2, "s--", color=style.RED, label="highest frequency, Hz")
    style.log_axes(axes, (320, 640, 1280, 1920), [20, 50, 100, 200, 500, 1000, 2000])
    axes.set(xlabel="pixels across a frame", ylabel="per second")
    axes.legend()
    return drawing


def draw_beam_modes() -> Figure:
    """Draw the three measured mode shapes of the beam, each marker a dot."""
    beam = setups.thesis_beam()
    drawing, axes = style.subplots(figsize=(6.4, 2.4))
    for i, omega in enumerate(beam.angular_frequencies(3)):
        w = deflection_shape(beam, i + 1, beam.markers, peak=1.0)
        label = f"mode {i + 1}: {omega / (2 * np.pi):.4g} Hz"
        axes.plot(1000 * beam.markers[0], w, ".-", color=style.cycle_color(i), label=label)
    axes.axhline(0, color=style.REFERENCE_COLOR, linewidth=1)
    axes.set(xlabel="x in mm, from the clamp", ylabel="deflection, of its peak")
    axes.legend()
    return drawing


def draw_plate_modes() -> Figure:
    """Draw the three measured mode shapes of the plate, a cell for each marker."""
    plate = setups.thesis_plate()
    x, y = (np.unique(np.round(each, 9)) * 1000 for each in plate.markers)
    drawing, axes = style.subplots(1, 3, figsize=(7.2, 2.0), sharey=True)
    maps = []
    for mode, omega in enumerate(plate.angular_frequencies(3), 1):
        w = deflection_shape(plate, mode, plate.markers, peak=1.0).reshape(y.size, x.size)
        maps.append((f"mode {mode}: {omega / (2 * np.pi):.4g} Hz", w, 1.0))
    pictures = style.draw_maps(axes, maps, x, y, "xy")
    drawing.colorbar(pictures[-1], ax=axes, label="of the peak", shrink=0.9)
    return drawing


def draw_alias() -> Figure:
    """Draw a vibration, and its alias in a camera whose frame rate is too low."""
    drawing, axes = style.subplots(figsize=(6.4, 2.2))
    hertz, rate = structures.resonance_frequency(setups.thesis_beam(), 2) / (2 * np.pi), 60.0
    t, seen = np.linspace(0, 0.2, 800), np.arange(0, 0.2, 1 / rate)
    slow = hertz - rate * np.round(hertz / rate)
    curves = ("true", hertz, "-", style.BLUE), ("seen", slow, "--", style.HIGHLIGHT_COLOR)
    for word, one, line, color in curves:
        label = f"{word}: {abs(one):.3g} Hz"
        axes.plot(t, np.cos(2 * np.pi * one * t), line, color=color, linewidth=1, label=label)
    frames = np.cos(2 * np.pi * hertz * seen)
    axes.plot(seen, frames, "o", color=style.INK_COLOR, label=f"{rate:g} frames/s")
    axes.set(xlabel="time in s", ylabel="motion", ylim=(-1.2, 2.1), yticks=[-1, 0, 1])
    axes.legend(ncols=3, loc="upper center")
    return drawing


def draw_cases() -> Figure:
    """Draw every case of Tables 3.3 and 3.4 from above, each setting in its own colour.

    In a growing set each camera has the colour of the first setting that has it.
    """
    found: dict[str, list[setups.Setting]] = {}
    for one in map(figure_set.camera_study, figure_set.CAMERA_STUDIES):
        if one.subject == "beam":
            for setting in one.settings():
                found.setdefault(setting.case, []).append(setting)
    figure, grid = style.subplots(3, 4, figsize=(7, 5.2), layout=None)
    figure.subplots_adjust(0.02, 0.01, 0.98, 0.95, hspace=0.15)
    for axes, (case, settings) in zip(grid.flat, sorted(found.items()), strict=True):
        axes.set_title(f"{case}: {_range_words(settings)}", fontsize=8)
        far = max(setting.distance_mm for setting in settings)
        for elevation in (0, 30, 60):
            rim = Circle((0, 0), np.cos(np.radians(elevation)), fill=False, ec="#d4d4d4", lw=0.6)
            axes.add_patch(rim)
        ends = np.array([-500, 500]) * setups.thesis_beam().length / far
        axes.plot(ends, [0, 0], color=style.REFERENCE_COLOR, lw=3, solid_capstyle="butt")
        first: dict[tuple[float, ...], int] = {}  # by camera: the first setting that has it
        for i, setting in enumerate(settings):
            for direction in setting.directions_deg:
                first.setdefault((*direction, setting.distance_mm), i)
        for place, i in first.items():
            azimuth, elevation = np.radians(place[:2])
            radius = np.cos(elevation) * place[2] / far
            x, y = radius * np.sin(azimuth), radius * np.cos(azimuth)
            axes.plot(x, y, "o", ms=4, color=style.cycle_color(i))
        axes.set(xlim=(-1.1, 1.1), ylim=(-1.1, 1.1), aspect="equal")
        axes.set_axis_off()
    return figure


def _range_words(settings: list[setups.Setting]) -> str:
    """Describe the first and the last setting, with the unit once."""
    widths = [setting.resolution_px[0] for setting in (settings[0], settings[-1])]
    if widths[0] != widths[1]:
        return f"{widths[0]} … {widths[1]} px across"
    first, last = (setting.label.split(" ") for setting in (settings[0], settings[-1]))
    return f"{' '.join(first if first[1:] != last[1:] else first[:1])} … {' '.join(last)}"


FACTS = "facts"
FIGURES: dict[str, tuple[str, Callable[..., Any]]] = {
    **{
        f"{body}-{what}.svg": (f"{body}-{what}", partial(draw_varied, what))
        for body in ("beam", "plate")
        for what in VARIED
    },
    **{
        f"cameras-{name}.svg": ("cameras", partial(display.draw_named_figure, name=name))
        for name in ("view", "projection", "pixels", "mosaic")
    },
    "layouts-elevation.svg": ("lab-elevation", draw_elevations),
    "layouts-far.svg": ("lab-layout", draw_distances),
    "layouts-sets.svg": ("lab-layout", partial(display.draw_figure, case="subsets", mode=1)),
    "equal-pixels.svg": ("lab-equal-pixels", partial(display.draw_named_figure, name="claim")),
    "motions-ways.svg": ("lab-modes", draw_few_frames),
    "motions-aliases.svg": (
        "lab-modes",
        lambda cube: display.draw_named_figure(cube, "aliases", 2),
    ),
    "motions-plate.svg": ("lab-plate", draw_plate_errors),
    "beam-modes.svg": (FACTS, draw_beam_modes),
    "plate-modes.svg": (FACTS, draw_plate_modes),
    "introduction-point.svg": (FACTS, draw_response),
    "introduction-rarer.svg": (FACTS, draw_deflections),
    "introduction-rates.svg": (FACTS, draw_rates),
    "motions-frames.svg": (FACTS, draw_alias),
    "setup-cases.svg": (FACTS, draw_cases),
}
"""By file: the figure set whose cube is drawn, or ``FACTS``, and the drawing function."""


def write_illustrations(
    made: Sequence[Path], folder: Path, names: Iterable[str] = tuple(FIGURES)
) -> None:
    """Write the figures `names` of the cubes `made`, or placeholders, into `folder`."""
    cubes = {path.stem: path for path in made}
    for name in names:
        of, draw = FIGURES[name]
        if of not in (FACTS, *cubes):
            write_placeholder(folder / name, of)
            continue
        drawn, look = [], None
        if of in cubes:
            drawn, look = [read_once(cubes[of])], display.figure_style(of)
        with style.in_style(look):
            text = style.figure_svg(draw(*drawn), look)
        files.whole_text(folder / name, text)
