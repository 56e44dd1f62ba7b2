"""Figures of ``design-law``, drawn from its cube."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from thesis_lib.arrays import Array
from thesis_lib.figure_sets.design_law import dither as design_dither
from thesis_lib.figure_sets.design_law.shares import FOLLOWED_PX
from thesis_lib.figure_sets.design_law.tables import SHOWN_NOISES_PX
from thesis_lib.plotting.style import (
    CYCLE_COLORS,
    HIGHLIGHT_COLOR,
    INK_COLOR,
    REFERENCE_COLOR,
    cycle_color,
    log_axes,
    make_logarithmic,
    subplots,
)
from thesis_lib.vision import dither
from thesis_lib.vision.cone_law import ISOTROPIC_ANGLE_RAD, MOTION_PX
from thesis_lib.vision.rounding import difference_variance

FIGURE_SIZE_IN = (7.2, 3.3)  # inches
_PER_PIXEL = 181  # motions at which the law is drawn, in each pixel
DRAWN_ANGLE_STEP = 5  # of the drawn angles, so that dots stand apart
PERCENT_TICKS = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100, 200]


def motion(cube: xr.Dataset) -> Figure:
    """Plot the rounding error of one coordinate against its motion, and relative to it."""
    drawing, (left, right) = subplots(1, 2, figsize=FIGURE_SIZE_IN, layout="constrained")
    delta, drawn = cube["motion"].values, cube["drawn_motion_error"].values
    every = _arched(delta[0], delta[-1])
    law = np.sqrt(difference_variance(every))
    for axes, power in ((left, 0), (right, 1)):
        scale = (100 / every) ** power
        axes.plot(every, scale * law, color=CYCLE_COLORS[0], lw=1.6, label="the law")
        axes.plot(
            delta, (100 / delta) ** power * drawn, "o", color=INK_COLOR, ms=2.2, label="drawn"
        )
        axes.plot(
            every,
            scale * MOTION_PX,
            "--",
            color=CYCLE_COLORS[4],
            lw=1.2,
            label="two independent roundings",
        )
    left.set(
        title="(a) error of a motion",
        xlabel="motion of the image in px",
        ylabel="rms error in px",
        xlim=(0, 3),
        ylim=(0, 0.75),
    )
    left.legend(loc="upper right")
    small = delta < 0.2
    right.plot(delta[small], 100 / np.sqrt(delta[small]), ":", color=INK_COLOR, lw=1.2)
    right.annotate("1/√δ", (0.013, 480), color=INK_COLOR)
    right.annotate("1/δ", (0.04, 1300), color=CYCLE_COLORS[4])
    log_axes(right, [0.01, 0.1, 1, 5], [5, 10, 20, 50, 100, 200, 500, 1000, 2000])
    right.set(title="(b) in % of the motion", xlabel="motion of the image in px", ylim=(4, 3000))
    return drawing


def _arched(first: float, last: float) -> Array:
    """Return motions in px from first to last, closer to each other towards whole pixels.

    There the law has cusps: √(f (1 − f)) is half the sine of an angle that grows evenly here.
    """
    pixels = np.arange(np.ceil(last))
    place = (1 - np.cos(np.linspace(0, np.pi, _PER_PIXEL))) / 2
    every = np.concatenate([(pixels[:, None] + place).ravel(), np.geomspace(first, 1, _PER_PIXEL)])
    return np.unique(every[(every >= first) & (every <= last)])


def settings(cube: xr.Dataset) -> Figure:
    """Plot predicted against simulated errors of all settings of the thesis."""
    drawing, (left, right) = subplots(1, 2, figsize=FIGURE_SIZE_IN, layout="constrained")
    simulated = cube["simulated_error"].values
    ends = np.array([simulated.min() / 1.3, simulated.max() * 1.3])
    left.plot(ends, ends, color=REFERENCE_COLOR, lw=1)
    right.axhline(1, color=REFERENCE_COLOR, lw=1)
    for number, one in enumerate(cube["structure"].values):
        rows = cube["of_structure"].values == one
        x, marker = simulated[rows].ravel(), "os"[number % 2]
        law, naive = (cube[f"{k}_error"].values[rows].ravel() for k in ("law", "naive"))
        style = {"ls": "none", "marker": marker, "ms": 3}
        left.plot(x, law, color=cycle_color(2 * number), label=f"{one}, the law", **style)
        right.plot(
            x,
            naive / x,
            color=CYCLE_COLORS[4],
            mfc="none",
            mew=0.6,
            label=f"{one}, independent roundings",
            **style,
        )
        right.plot(x, law / x, color=cycle_color(2 * number), label=f"{one}, the law", **style)
    log_axes(left, PERCENT_TICKS, PERCENT_TICKS)
    make_logarithmic(right.xaxis, PERCENT_TICKS)
    words = "rms error over the trials in %"
    left.set(
        title="(a) predicted against simulated",
        xlabel=words,
        ylabel="predicted error in %",
        xlim=ends,
        ylim=ends,
    )
    right.set(title="(b) predicted over simulated", xlabel=words, ylim=(0.8, 2.7))
    left.legend(loc="upper left")
    right.legend(loc="upper left", fontsize=7)
    return drawing


def cone(cube: xr.Dataset) -> Figure:
    """Plot errors along and across the normal against the angle of the cone."""
    drawing, axes = subplots(figsize=(6.0, 3.4), layout="constrained")
    angle = cube["angle"].values
    for number, (axis, words) in enumerate(
        (("Z", "along the normal, z"), ("X", "across it, x = y"))
    ):
        closed, drawn = (1000 * cube[f"cone{k}_error"].sel(axis=axis) for k in ("", "_drawn"))
        axes.plot(angle, closed, color=cycle_color(number), lw=1.6, label=words)
        axes.plot(
            angle[::DRAWN_ANGLE_STEP],
            drawn[::DRAWN_ANGLE_STEP],
            "o",
            color=cycle_color(number),
            ms=3.5,
        )
    other = 1000 * cube["cone_drawn_error"].sel(axis="Y")[::DRAWN_ANGLE_STEP]
    axes.plot(angle[::DRAWN_ANGLE_STEP], other, "o", color=CYCLE_COLORS[1], ms=3.5, mfc="none")
    axes.axvline(np.degrees(ISOTROPIC_ANGLE_RAD), color=HIGHLIGHT_COLOR, lw=1)
    axes.annotate(
        f" {np.degrees(ISOTROPIC_ANGLE_RAD):.1f}°: the same\n in all directions",
        (np.degrees(ISOTROPIC_ANGLE_RAD), 0.72),
        xycoords=("data", "axes fraction"),
        color=HIGHLIGHT_COLOR,
    )
    axes.plot([], [], "o", color=INK_COLOR, ms=3.5, label="drawn with whole pixels")
    axes.set(
        xlabel="angle θ of the cone from the normal in °", ylabel="rms error in mm", xlim=(0, 90)
    )
    make_logarithmic(axes.yaxis, [0.2, 0.5, 1, 2, 5, 10, 20])
    axes.legend(loc="upper right")
    return drawing


def findings(cube: xr.Dataset) -> Figure:
    """Plot distance, resolution, number, elevation, aperture; and the thesis's growing arrays."""
    drawing, grid = subplots(2, 3, figsize=(7.6, 5.0), layout="constrained")
    axes = dict(zip(cube["finding"].values, grid.flat, strict=False))
    labels = {
        "distance": "distance d in mm",
        "resolution": "pixels across",
        "number": "number of cameras N",
        "elevation": "elevation φ in °",
        "aperture": "aperture α in °",
    }
    for number, (name, words) in enumerate(labels.items()):
        axis = axes[name]
        for s, one in enumerate(cube["structure"].values):
            part = cube.sel(finding=name, structure=one)
            x = part["swept"].values
            axis.plot(x, part["exact_error"], color=cycle_color(2 * s), lw=0.6, alpha=0.7)
            axis.plot(x, part["expected_error"], color=cycle_color(2 * s), lw=1.8, label=one)
            axis.plot(x, part["centre_error"], ":", color=cycle_color(2 * s), lw=1.3)
            if name == "aperture":
                axis.plot(x, part["noisy_error"], "--", color=cycle_color(2 * s), lw=1)
                axis.axvline(
                    float(part["best_aperture"].isel(amplitudes=1)),
                    color=cycle_color(2 * s),
                    lw=0.8,
                )
        axis.set(title=f"({'abcde'[number]})", xlabel=words)
        make_logarithmic(axis.yaxis, PERCENT_TICKS)
    make_logarithmic(axes["distance"].xaxis, [500, 750, 1000, 1500])
    make_logarithmic(axes["resolution"].xaxis, [320, 640, 1280, 1920])
    make_logarithmic(axes["number"].xaxis, [3, 6, 12, 24, 48])
    for row in grid:
        row[0].set_ylabel("error in % of the peak")
    axes["distance"].legend(loc="upper left")
    _arrays(grid[1, 2], cube)
    for style, words in (
        (("-", 1.8), "averaged"),
        (("-", 0.6), "modes 1–3"),
        ((":", 1.3), "centre"),
    ):
        axes["resolution"].plot([], [], style[0], lw=style[1], color=INK_COLOR, label=words)
    axes["resolution"].legend(loc="lower left")
    (noise,) = axes["aperture"].plot([], [], "--", lw=1, color=INK_COLOR)
    axes["aperture"].legend([noise], ["independent noise"], loc="upper center")
    return drawing


def _arrays(axes: Axes, cube: xr.Dataset) -> None:
    """Draw exponents in N of the thesis's growing arrays."""
    names = cube["array"].values
    for s, one in enumerate(cube["structure"].values):
        place = np.arange(len(names)) + 0.36 * (s - 0.5)
        axes.bar(place, cube["array_exponent"].sel(structure=one), 0.34, color=cycle_color(2 * s))
    axes.axhline(-0.5, color=HIGHLIGHT_COLOR, lw=1)
    axes.set_xticks(np.arange(len(names)), [str(name) for name in names])
    axes.set(title="(f) exponent in N", xlabel="growing arrays of the thesis")
    axes.grid(visible=False, axis="x")


def shares(cube: xr.Dataset) -> Figure:
    """Plot equal pixels per second in two to many cameras: one frame, a fit to all, the sensors."""
    drawing, grid = subplots(1, 3, figsize=(7.6, 3.5), layout="constrained")
    n = cube["count"].values
    order = np.argsort(n)
    for k, rate in enumerate(cube["rate"].values):
        part, style = cube.isel(rate=k, count=order), {"color": cycle_color(k)}
        frame, film, sensor = grid
        law = {"marker": "_", "ms": 9, "mew": 1.5, "ls": "none"}
        frame.plot(n[order], part["frame_error"], **law, **style)
        frame.plot([], [], lw=1.5, label=f"{rate:g} Hz", **style)
        frame.plot(n[order], part["average_error"], "--", lw=0.9, **style)
        film.plot(n[order], part["fit_error"], **law, **style)
        for e, name in enumerate(cube["estimator"].values):
            dots: Any = {
                "marker": "osD^"[e % 4],
                "ls": "none" if e == 0 else ":",
                "ms": 3.5,
                **({"mfc": "none"} if e else {}),
                **style,
            }
            frame.plot(n[order], part["drawn_frame_error"].sel(estimator=name), **dots)
            film.plot(n[order], part["drawn_fit_error"].sel(estimator=name), **dots)
        width = part["width_px"].values
        sensor.plot(n[order], width, lw=1.2, **style)
        small = part["marker_height"].values < FOLLOWED_PX
        sensor.plot(n[order][~small], width[~small], "o", ms=3.5, **style)
        sensor.plot(n[order][small], width[small], "x", ms=4.5, **style)
    grid[1].plot(
        n[order],
        cube["independent_fit_error"].isel(rate=0, count=order),
        "--",
        color=INK_COLOR,
        lw=0.9,
    )
    for axes, title in zip(
        grid,
        ("(a) one frame, %", "(b) amplitude from all frames, %", "(c) pixels across each sensor"),
        strict=True,
    ):
        make_logarithmic(axes.xaxis, [2, 4, 8, 16, 32, 64])
        axes.set(title=title, xlabel="number of cameras N")
    least = min(float(cube[f"{k}fit_error"].min()) for k in ("", "drawn_", "independent_"))
    for axes in grid[:2]:
        make_logarithmic(axes.yaxis, PERCENT_TICKS)
        axes.set_ylim(0.75 * least, 150)
    make_logarithmic(grid[2].yaxis, [100, 200, 500, 1000, 2000])
    for e, name in enumerate(cube["estimator"].values):
        grid[1].plot(
            [],
            [],
            ls="none",
            marker="osD^"[e % 4],
            color=INK_COLOR,
            ms=3.5,
            mfc="none" if e else None,
            label=name,
        )
    grid[1].plot([], [], color=INK_COLOR, label="the law", **law)
    grid[1].plot([], [], "--", color=INK_COLOR, lw=1, label="independent, averaged")
    grid[2].plot([], [], "x", color=INK_COLOR, ms=4.5, label=f"markers < {FOLLOWED_PX:g} px high")
    grid[0].legend(loc="upper center", ncols=3, columnspacing=0.8, handlelength=1.2, fontsize=7)
    grid[1].legend(loc="upper left", fontsize=7)
    grid[2].legend(loc="lower left", fontsize=7)
    return drawing


def estimators(cube: xr.Dataset) -> Figure:
    """Plot errors of the estimators against the number of cameras and the noise of pixels."""
    drawing, (left, right) = subplots(1, 2, figsize=FIGURE_SIZE_IN, layout="constrained")
    n = cube["equidistant_rig"].values
    for k, name in enumerate(cube["rule"].values):
        part, style = cube.sel(rule=name), {"color": cycle_color(k), "marker": "osD^"[k % 4]}
        left.plot(n, 1e6 * part["equidistant_rig_error"], ms=4, lw=1.3, label=name, **style)
        right.plot(cube["noise"], 1e6 * part["noise_error"], ms=4, lw=1.3, **style)
    first = 1e6 * float(cube["equidistant_rig_error"].isel(equidistant_rig=0).min())
    for power, words in ((-0.5, "1/√N"), (-1.0, "1/N")):
        line = first * (n / n[0]) ** power
        left.plot(n, line, ":", color=INK_COLOR, lw=1)
        left.annotate(words, (n[-1], line[-1]), color=INK_COLOR, ha="right", va="top")
    log_axes(left, [4, 8, 16, 32, 64], [50, 100, 200, 500, 1000])
    left.set(title="(a) error of a deflection, µm", xlabel="number of cameras N")
    left.legend(loc="lower left", fontsize=7)
    right.set(
        title=f"(b) {design_dither.NOISY_CAMERAS} cameras, µm",
        ylim=(0, None),
        xlabel="noise of the images before rounding, px",
    )
    return drawing


def noisy(cube: xr.Dataset) -> Figure:
    """Plot errors at equal pixels per second against the number of cameras and the noise."""
    drawing, (left, right) = subplots(1, 2, figsize=FIGURE_SIZE_IN, layout="constrained")
    drawn, least = 1e6 * cube["noisy_share_error"], 1e6 * cube["least_share_error"]
    counts, noises = np.sort(cube["count"].values), cube["image_noise"].values
    styles = (("o", "none"), ("s", "none"), ("", "-"))  # in the order of the approaches

    def lines(axes: Axes, part: xr.DataArray, x: Array, label: str, number: int) -> None:
        for name, (marker, line) in zip(part["approach"].values, styles, strict=True):
            axes.plot(x, part.sel(approach=name), ls=line, marker=marker, ms=3.5,
                      mfc="none", color=cycle_color(number),
                      label=label if marker == "" else None)  # fmt: skip

    for k, noise in enumerate(SHOWN_NOISES_PX):
        at = {"image_noise": noise, "count": counts}
        lines(left, drawn.sel(at), counts, f"{noise:g} px" if noise else "no noise", k)
        if noise:
            left.plot(counts, least.sel(at), ":", color=cycle_color(k), lw=1.2)
    places = np.where(noises > 0, noises, 0.5 * np.min(noises[noises > 0], initial=1))
    for k, count in enumerate((counts[0], counts[len(counts) // 2], counts[-1])):
        lines(right, drawn.sel(count=count), places, f"{count} cameras", k)
    few = least.sel(count=counts[0]).values
    right.plot(noises[noises > 0], few[noises > 0], ":", color=INK_COLOR, lw=1.2, label="bound")
    for axes, title in ((left, "(a) error of a deflection, µm"), (right, "(b) the same, µm")):
        make_logarithmic(axes.yaxis, [50, 100, 200, 300, 500])
        axes.set(title=title)
        axes.set_ylim(0.9 * min(float(drawn.min()), few[noises > 0].min()), None)
    make_logarithmic(left.xaxis, [2, 4, 8, 16, 32, 64])
    left.set_xlabel("number of cameras N")
    right.set_xscale("log")
    right.set_xticks(places, [f"{noise:g}" for noise in noises])
    right.minorticks_off()
    right.set_xlabel("noise of the images before rounding, px")
    for name, (marker, line) in zip(drawn["approach"].values, styles, strict=True):
        left.plot([], [], ls=line, marker=marker, ms=3.5, mfc="none",
                  color=INK_COLOR, label=str(name))  # fmt: skip
    left.legend(loc="lower left", fontsize=6, ncols=2)
    right.legend(loc="upper left", fontsize=7)
    return drawing


def dithering(cube: xr.Dataset) -> Figure:
    """Plot the residual rounding error by motion, shake, and size of the markers."""
    drawing, grid = subplots(1, 3, figsize=(7.6, 3.1), layout="constrained")
    panels = (
        ("fitted_amplitude", "(a) fitted amplitude, px", "amplitude of the image, px"),
        ("shake", "(b) mean of frames, px", "camera shake, px"),
        ("disc", "(c) centroid of a disc, px", "diameter of the marker, px"),
    )
    ends = {name: (cube[name].values.min(), cube[name].values.max()) for name, *_ in panels}
    swing = np.geomspace(*ends["fitted_amplitude"], 201)  # its axis is logarithmic
    shake, disc = (np.linspace(*ends[name], 201) for name in ("shake", "disc"))
    closed_forms = {
        "fitted_amplitude": (swing, np.sqrt(dither.amplitude_variance(swing))),
        "shake": (shake, np.sqrt(dither.shaken_variance(design_dither.SHAKE_FRAMES, shake))),
        "disc": (disc, [dither.disc_variance(one) ** 0.5 for one in disc]),
    }
    for axes, (name, title, words) in zip(grid, panels, strict=True):
        x = cube[name].values
        axes.axhline(
            dither.ONE_FRAME**0.5,
            color=CYCLE_COLORS[4],
            ls="--",
            lw=1.2,
            label="one coordinate, one frame",
        )
        many, closed = closed_forms[name]
        axes.plot(many, closed, color=CYCLE_COLORS[0], lw=1.6, label="closed form")
        axes.plot(x, cube[f"drawn_{name}_error"], "o", color=INK_COLOR, ms=2.4, label="drawn")
        axes.set(title=title, xlabel=words)
        make_logarithmic(axes.yaxis, [0.001, 0.003, 0.01, 0.03, 0.1, 0.3])
    grid[1].plot(
        shake,
        np.sqrt(dither.mean_variance(0.0, shake)),
        ":",
        color=CYCLE_COLORS[0],
        lw=1.4,
        label="endless frames",
    )
    grid[1].set_ylim(0.01, 0.5)
    make_logarithmic(grid[0].xaxis, [0.1, 0.3, 1, 3, 10])
    for axes in grid[:2]:
        axes.legend(loc="lower left", fontsize=7)
    return drawing
