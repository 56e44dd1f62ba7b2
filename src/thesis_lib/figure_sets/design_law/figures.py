"""Figures of ``design-law``, drawn from its cube."""

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from thesis_lib.arrays import Array
from thesis_lib.figure_sets.design_law import compute, shares as design_shares
from thesis_lib.plotting import style
from thesis_lib.studies.cubes import iterate_slices
from thesis_lib.vision import cone_law, dither, rounding

TEXTS = compute.TEXTS  # values for the templates of texts
FIGURE_SIZE_IN = (7.2, 3.3)
_CURVE_POINTS = 1001  # motions at which the law is drawn
DRAWN_ANGLE_STEP = 5  # of the drawn angles, so that dots stand apart
PERCENT_TICKS = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100, 200]


def motion(cube: xr.Dataset) -> Figure:
    """Plot the rounding error of one coordinate against its motion, and relative to it."""
    drawing, (left, right) = style.subplots(1, 2, figsize=FIGURE_SIZE_IN)
    delta, drawn = cube["motion"].values, cube["drawn_motion_error"].values
    fine = np.linspace(0, delta[-1], _CURVE_POINTS)  # with whole pixels, where the law has cusps
    every = np.unique(np.concatenate([np.geomspace(delta[0], 1, 201), fine[fine > delta[0]]]))
    law = np.sqrt(rounding.difference_variance(every))
    independent = np.full_like(every, cone_law.MOTION_PX)
    for axes, power in ((left, 0), (right, 1)):
        scale, drawn_scale = (100 / every) ** power, (100 / delta) ** power
        axes.plot(every, scale * law, color=style.BLUE, lw=1.6, label="the law")
        axes.plot(delta, drawn_scale * drawn, "o", color=style.INK_COLOR, ms=2.2, label="drawn")
        look: Any = {"color": style.RED, "lw": 1.2}
        axes.plot(every, scale * independent, "--", label="two independent roundings", **look)
    left.set(title="(a) error of a motion", ylabel="rms error in px", xlim=(0, 3), ylim=(0, 0.75))
    left.legend(loc="upper right")
    small = delta < 0.2
    right.plot(delta[small], 100 / np.sqrt(delta[small]), ":", color=style.INK_COLOR, lw=1.2)
    right.annotate("1/√δ", (0.013, 480), color=style.INK_COLOR)
    right.annotate("1/δ", (0.04, 1300), color=style.RED)
    style.log_axes(right, [0.01, 0.1, 1, 5], [5, 10, 20, 50, 100, 200, 500, 1000, 2000])
    right.set(title="(b) in % of the motion", ylim=(4, 3000), xlabel="motion of the image in px")
    left.set_xlabel("motion of the image in px")
    return drawing


def settings(cube: xr.Dataset) -> Figure:
    """Plot predicted against simulated errors of all settings of the thesis."""
    drawing, (left, right) = style.subplots(1, 2, figsize=FIGURE_SIZE_IN)
    simulated = cube["simulated_error"].values
    ends = np.array([simulated.min() / 1.3, simulated.max() * 1.3])
    left.plot(ends, ends, color=style.REFERENCE_COLOR, lw=1)
    right.axhline(1, color=style.REFERENCE_COLOR, lw=1)
    for number, one in enumerate(cube["structure"].values):
        rows, kinds = cube["of_structure"].values == one, ("law", "naive", "simulated")
        law, naive, x = (cube[f"{kind}_error"].values[rows].ravel() for kind in kinds)
        look: Any = {"ls": "none", "marker": "os"[number % 2], "ms": 3}
        apart = {"mfc": "none", "mew": 0.6, "label": f"{one}, independent roundings"}
        right.plot(x, naive / x, color=style.RED, **apart, **look)
        look |= {"color": style.cycle_color(2 * number), "label": f"{one}, the law"}
        left.plot(x, law, **look)
        right.plot(x, law / x, **look)
    style.log_axes(left, PERCENT_TICKS, PERCENT_TICKS)
    style.make_logarithmic(right.xaxis, PERCENT_TICKS)
    words = "rms error over the trials in %"
    left.set(title="(a) predicted against simulated", ylabel="predicted error in %")
    left.set(xlim=ends, ylim=ends, xlabel=words)
    right.set(title="(b) predicted over simulated", ylim=(0.8, 2.7), xlabel=words)
    left.legend(loc="upper left")
    right.legend(loc="upper left", fontsize=7)
    return drawing


def cone(cube: xr.Dataset) -> Figure:
    """Plot errors along and across the normal against the angle of the cone."""
    drawing, axes = style.subplots(figsize=(6.0, 3.4))
    angle, some = cube["angle"].values, slice(None, None, DRAWN_ANGLE_STEP)
    drawn = 1000 * cube["cone_drawn_error"]
    for axis, ink, filled, words in (
        ("Z", style.BLUE, True, "along the normal, z"),
        ("X", style.ORANGE, True, "across it, x = y"),
        ("Y", style.ORANGE, False, "_"),
    ):
        axes.plot(angle, 1000 * cube["cone_error"].sel(axis=axis), color=ink, lw=1.6, label=words)
        look: Any = {"color": ink, "ms": 3.5, "mfc": ink if filled else "none"}
        axes.plot(angle[some], drawn.sel(axis=axis)[some], "o", **look)
    alike = float(np.degrees(cone_law.ISOTROPIC_ANGLE_RAD))
    axes.axvline(alike, color=style.HIGHLIGHT_COLOR, lw=1)
    words, half_way = f" {alike:.1f}°: the same\n in all directions", axes.get_xaxis_transform()
    axes.annotate(words, (alike, 0.5), xycoords=half_way, color=style.HIGHLIGHT_COLOR)
    style.name_styles(axes, {"drawn with whole pixels": {"ls": "none", "marker": "o", "ms": 3.5}})
    axes.set(xlabel="angle θ of the cone from the normal in °", ylabel="rms error in mm")
    axes.set_xlim(0, 90)
    style.make_logarithmic(axes.yaxis, [0.2, 0.5, 1, 2, 5, 10, 20])
    axes.legend(loc="upper right")
    return drawing


def findings(cube: xr.Dataset) -> Figure:
    """Plot errors by distance, resolution, number, elevation, aperture; and exponents of arrays."""
    drawing, grid = style.subplots(2, 3, figsize=(7.6, 5.4))
    labels = {
        "distance": "distance d in mm",
        "resolution": "pixels across",
        "number": "number of cameras N",
        "elevation": "elevation φ in °",
        "aperture": "aperture α in °",
    }
    ticks = ([500, 750, 1000, 1500], [320, 640, 1280, 1920], [3, 6, 12, 24, 48])
    for number, (name, words) in enumerate(labels.items()):
        axis = grid.flat[number]
        for s, part in enumerate(iterate_slices(cube.sel(finding=name), "structure")):
            x, ink = part["swept"].values, style.cycle_color(2 * s)
            axis.plot(x, part["exact_error"], color=ink, lw=0.6, alpha=0.7)
            axis.plot(x, part["expected_error"], color=ink, lw=1.8)
            axis.plot(x, part["centre_error"], ":", color=ink, lw=1.3)
            if name == "aperture":
                axis.plot(x, part["noisy_error"], "--", color=ink, lw=1)
                best = float(part["best_aperture"].isel(amplitudes=1))
                least = float(np.interp(best, x, part["expected_error"]))
                axis.plot(best, least, "v", color=ink, ms=5)
        axis.set(title=f"({'abcde'[number]})", xlabel=words)
        style.make_logarithmic(axis.yaxis, PERCENT_TICKS)
        if number < len(ticks):
            style.make_logarithmic(axis.xaxis, ticks[number])
    for row in grid:
        row[0].set_ylabel("error in % of the peak")
    last, names = grid[1, 2], cube["array"].values
    for s, exponents in enumerate(iterate_slices(cube["array_exponent"], "structure")):
        place = np.arange(len(names)) + 0.36 * (s - 0.5)
        last.bar(place, exponents, 0.34, color=style.cycle_color(2 * s))
    last.axhline(-0.5, color=style.HIGHLIGHT_COLOR, lw=1)
    last.set_xticks(np.arange(len(names)), [str(name) for name in names])
    last.set(title="(f) exponent in N", xlabel="growing arrays of the thesis")
    last.grid(visible=False, axis="x")
    styles: dict[str, dict[str, Any]] = {
        **{
            str(one): {"color": style.cycle_color(2 * s), "lw": 4}
            for s, one in enumerate(cube["structure"].values)
        },
        "markers, amplitudes averaged": {"lw": 1.8},
        "markers, modes 1–3": {"lw": 0.6},
        "centre": {"ls": ":", "lw": 1.3},
        "markers, independent noise": {"ls": "--"},
        "least error": {"ls": "none", "marker": "v", "ms": 5},
        "1/√N": {"color": style.HIGHLIGHT_COLOR},
    }
    style.name_styles(grid[1, 1], styles)
    style.legend_below(drawing, grid[1, 1], 4)
    return drawing


def shares(cube: xr.Dataset) -> Figure:
    """Plot errors at equal pixels per second, of one frame and a fit to all, and sensor widths."""
    drawing, (frame, film, sensor) = style.subplots(1, 3, figsize=(7.6, 3.9))
    cube = cube.sortby("count")
    n, law = cube["count"].values, {"marker": "_", "ms": 9, "mew": 1.5, "ls": "none"}
    names = [str(name) for name in cube["estimator"].values]
    dots: dict[str, dict[str, Any]] = {
        name: {"marker": "osD^"[e % 4], "ms": 3.5} | ({"mfc": "none"} if e else {})
        for e, name in enumerate(names)
    }
    inks = style.ordered_colors(cube.sizes["rate"])
    for part, ink in zip(iterate_slices(cube, "rate"), inks, strict=True):
        frame.plot(n, part["frame_error"], color=ink, **law)
        frame.plot(n, part["average_error"], "--", lw=0.9, color=ink)
        film.plot(n, part["fit_error"], color=ink, **law)
        for name, look in dots.items():
            look = {"ls": "none" if name == names[0] else ":", "color": ink, **look}
            frame.plot(n, part["drawn_frame_error"].sel(estimator=name), **look)
            film.plot(n, part["drawn_fit_error"].sel(estimator=name), **look)
        width = part["width_px"].values
        lost = part["marker_height"].values < design_shares.MIN_TRACKED_HEIGHT_PX
        sensor.plot(n, width, lw=1.2, color=ink)
        sensor.plot(n[~lost], width[~lost], "o", ms=3.5, color=ink)
        sensor.plot(n[lost], width[lost], "x", ms=4.5, color=ink)
    film.plot(n, cube["independent_fit_error"].isel(rate=0), "--", color=style.INK_COLOR, lw=0.9)
    titles = ("(a) one frame, %", "(b) amplitude from all frames, %", "(c) pixels across each")
    for axes, title in zip((frame, film, sensor), titles, strict=True):
        style.make_logarithmic(axes.xaxis, [2, 4, 8, 16, 32, 64])
        axes.set(title=title, xlabel="number of cameras N")
    least = min(float(cube[f"{k}fit_error"].min()) for k in ("", "drawn_", "independent_"))
    most = max(float(cube[f"{k}frame_error"].max()) for k in ("", "drawn_"))
    for axes in (frame, film):
        style.make_logarithmic(axes.yaxis, PERCENT_TICKS)
        axes.set_ylim(0.75 * least, 1.4 * most)
    style.make_logarithmic(sensor.yaxis, [100, 200, 500, 1000, 2000])
    low, cross = design_shares.MIN_TRACKED_HEIGHT_PX, {"ls": "none", "marker": "x", "ms": 4.5}
    rates = zip(cube["rate"].values, inks, strict=True)
    styles: dict[str, dict[str, Any]] = {f"{r:g} Hz": {"color": ink, "lw": 4} for r, ink in rates}
    styles |= {name: {"ls": "none", **look} for name, look in dots.items()}
    styles |= {"the law": law, "independent, averaged": {"ls": "--"}}
    styles |= {f"markers < {low:g} px high": cross}
    style.name_styles(sensor, styles)
    style.legend_below(drawing, sensor, 5)
    return drawing


def estimators(cube: xr.Dataset) -> Figure:
    """Plot errors of the estimators against the number of cameras and the noise of pixels."""
    drawing, (left, right) = style.subplots(1, 2, figsize=FIGURE_SIZE_IN)
    n = cube["equidistant_rig"].values
    for k, part in enumerate(iterate_slices(cube, "rule")):
        # the first, linear, coincides with the second, so it is drawn wider and below
        size = {"ms": 7, "lw": 4, "alpha": 0.5} if k == 0 else {"ms": 4, "lw": 1.3}
        look: Any = {"color": style.cycle_color(k), "marker": "osD^"[k % 4], **size}
        words = str(part["rule"].item())
        left.plot(n, 1e6 * part["equidistant_rig_error"], label=words, **look)
        right.plot(cube["noise"], 1e6 * part["noise_error"], **look)
    first = 1e6 * float(cube["equidistant_rig_error"].isel(equidistant_rig=0).min())
    for power, words in ((-0.5, "1/√N"), (-1.0, "1/N")):
        line = first * (n / n[0]) ** power
        left.plot(n, line, ":", color=style.INK_COLOR, lw=1)
        left.annotate(words, (n[-1], line[-1]), color=style.INK_COLOR, ha="right", va="top")
    style.log_axes(left, [4, 8, 16, 32, 64], [50, 100, 200, 500, 1000])
    left.set(title="(a) error of a deflection, µm", xlabel="number of cameras N")
    left.legend(loc="lower left", fontsize=7)
    right.set(title=f"(b) {design_shares.NOISY_CAMERAS} cameras, µm", ylim=(0, None))
    right.set_xlabel("noise of the images before rounding, px")
    return drawing


def noisy(cube: xr.Dataset) -> Figure:
    """Plot errors at equal pixels per second against the number of cameras and the noise."""
    drawing, (left, right) = style.subplots(1, 2, figsize=(7.2, 3.9))
    cube = cube.sortby("count")
    drawn, least = 1e6 * cube["noisy_share_error"], 1e6 * cube["least_share_error"]
    counts, noises = cube["count"].values, cube["image_noise"].values
    no_line: dict[str, Any] = {"ls": "none", "mfc": "none", "ms": 3.5}
    styles: list[dict[str, Any]] = [{**no_line, "marker": "o"}, {**no_line, "marker": "s"}, {}]

    def draw_approaches(axes: Axes, part: xr.DataArray, x: Array, ink: str, label: str) -> None:
        for values, look in zip(iterate_slices(part, "approach"), styles, strict=True):
            axes.plot(x, values, color=ink, label="_" if look else label, **look)

    shown = compute.SHOWN_NOISES_PX
    for noise, ink in zip(shown, style.ordered_colors(len(shown)), strict=True):
        words = f"{noise:g} px" if noise else "no noise"
        draw_approaches(left, drawn.sel(image_noise=noise), counts, ink, words)
        if noise:
            left.plot(counts, least.sel(image_noise=noise), ":", color=ink, lw=1.2)
    places = np.where(noises > 0, noises, 0.5 * np.min(noises[noises > 0], initial=1))
    some = (counts[0], counts[len(counts) // 2], counts[-1])
    for count, ink in zip(some, style.ordered_colors(len(some)), strict=True):
        draw_approaches(right, drawn.sel(count=count), places, ink, f"{count} cameras")
    few = least.sel(count=counts[0]).values[noises > 0]
    right.plot(noises[noises > 0], few, ":", color=style.INK_COLOR, lw=1.2)
    for axes, title in ((left, "(a) error of a deflection, µm"), (right, "(b) the same, µm")):
        style.make_logarithmic(axes.yaxis, [50, 100, 200, 300, 500])
        axes.set(title=title, ylim=(0.9 * min(float(drawn.min()), few.min()), None))
        axes.legend(loc="upper left" if axes is right else "lower left", fontsize=7)
    style.make_logarithmic(left.xaxis, [2, 4, 8, 16, 32, 64])
    left.set_xlabel("number of cameras N")
    right.set_xscale("log")
    right.set_xticks(places, [f"{noise:g}" for noise in noises])
    right.minorticks_off()
    right.set_xlabel("noise of the images before rounding, px")
    named = dict(zip(map(str, drawn["approach"].values), styles, strict=True))
    own = len(left.get_legend_handles_labels()[0])
    style.name_styles(left, named | {"bound": {"ls": ":", "lw": 1.2}})
    style.legend_below(drawing, left, 4, first=own)
    return drawing


def dithering(cube: xr.Dataset) -> Figure:
    """Plot the residual rounding error by motion, shake, and size of the markers."""
    drawing, grid = style.subplots(1, 3, figsize=(7.6, 3.4))
    panels = (
        ("fitted_amplitude", "(a) fitted amplitude, px", "amplitude of the image, px"),
        ("shake", "(b) mean of frames, px", "camera shake, px"),
        ("disc", "(c) centroid of a disc, px", "diameter of the marker, px"),
    )
    ends = {name: (cube[name].values.min(), cube[name].values.max()) for name, *_ in panels}
    swing = np.geomspace(*ends["fitted_amplitude"], 401)  # its axis is logarithmic
    shake, disc = (np.linspace(*ends[name], 201) for name in ("shake", "disc"))
    closed_forms = {
        "fitted_amplitude": (swing, np.sqrt(dither.amplitude_variance(swing))),
        "shake": (shake, np.sqrt(dither.shaken_variance(design_shares.SHAKE_FRAMES, shake))),
        "disc": (disc, [dither.disc_variance(one) ** 0.5 for one in disc]),
    }
    one_frame: Any = {"color": style.RED, "ls": "--", "lw": 1.2}
    for axes, (name, title, words) in zip(grid, panels, strict=True):
        axes.axhline(dither.FRAME_VARIANCE_PX2**0.5, label="one coordinate, one frame", **one_frame)
        axes.plot(*closed_forms[name], color=style.BLUE, lw=1.6, label="closed form")
        drawn = cube[f"drawn_{name}_error"]
        axes.plot(cube[name], drawn, "o", color=style.INK_COLOR, ms=2.4, label="drawn")
        axes.set(title=title, xlabel=words)
        style.make_logarithmic(axes.yaxis, [0.001, 0.003, 0.01, 0.03, 0.1, 0.3])
    endless, words = np.sqrt(dither.mean_variance(0.0, shake)), "infinitely many frames"
    grid[1].plot(shake, endless, ":", color=style.BLUE, lw=1.4, label=words)
    grid[1].set_ylim(0.01, 0.5)
    style.make_logarithmic(grid[0].xaxis, [0.1, 0.3, 1, 3, 10])
    style.legend_below(drawing, grid[1], 4)
    return drawing
