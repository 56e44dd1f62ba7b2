"""Figures of these sets that are shown by name, drawn from their cubes."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from thesis_lib.figure_sets.parametric.sound import audible_planes
from thesis_lib.figure_sets.parametric.sound_turn import turn_summary
from thesis_lib.figure_sets.parametric.tables import compare_frequencies
from thesis_lib.plotting import panels as figures
from thesis_lib.plotting.selection import best_and_worst, error_bars, rank_settings, select_settings
from thesis_lib.plotting.style import bar_beside, draw_map, ordered_colors, place_panels, subplots
from thesis_lib.studies import schema
from thesis_lib.studies.cubes import iterate_slices

TEXTS = {
    "turn": lambda cube: {"audible": audible_planes(cube)},
    "turn-summary": turn_summary,
    "modes": compare_frequencies,
}


def turn(cube: xr.Dataset) -> Figure:
    """Plot field errors against the turn: lines by the law, dots simulated."""
    pairs = audible_planes(cube)
    size, how = (2.1 * len(pairs) + 1, 3.1), {"squeeze": False, "sharey": True}
    drawing, axes = subplots(1, len(pairs), figsize=size, layout="constrained", **how)
    for panel, (mode, plane) in zip(axes[0], pairs, strict=True):
        one = cube.sel(mode=mode, plane=plane)
        inks = ordered_colors(cube.sizes["elevation"])
        for part, ink in zip(iterate_slices(one, "elevation"), inks, strict=True):
            law, words = part["turned_law_error"], f"elevation {part['elevation'].item():g}°"
            panel.plot(cube["law_turn"], law, color=ink, lw=1, label=words)
            panel.plot(cube["turn"], part["turned_simulated"], "o", color=ink, ms=4)
        panel.set(title=f"mode {mode}, {plane}", xlabel="turned by, °")
    axes[0, 0].set(ylabel="field error, %", ylim=(0, None))
    once = axes[0, 0].get_legend_handles_labels()
    drawing.legend(*once, loc="outside lower center", ncols=4, fontsize=7)
    return drawing


def plate_figure(cube: xr.Dataset, case: str, mode: int) -> Figure:
    """Draw the setup, ideal shape, best and worst measured shape, and bars."""
    part = select_settings(cube, case, mode)
    chosen = best_and_worst(part)
    drawing, axes = place_panels(
        "abb;cde", (8.2, 5.6), (0.6, 0.85, 0.5, 0.3), (0.75, 0.75), (1.5, 1)
    )
    figures.setup_panel(axes["a"], cube, part)
    figures.bar_panel(axes["b"], part, [error_bars(cube, case, mode)])
    axes["b"].set(title="(d) mean (rms) error", ylabel="% of the largest deflection")
    reference = part["reference_deflection"].values * 1000
    shapes = [("(b) ideal", reference)]
    for index, word in zip((chosen[0], chosen[-1]), rank_settings(part), strict=True):
        measured = part["measured_deflection"].isel(setting=index, trial=0).values * 1000
        shapes.append((f"(c) {word}: {part['label'].values[index]}", measured))
    limit = max(float(np.max(np.abs(values))) for _, values in shapes)
    picture: Any = None
    x, y, place = schema.marker_cells(cube)
    x, y, middle = 1000 * x, 1000 * y, np.array(schema.structure_extent(cube)) / 2
    for name, (title, values) in zip("cde", shapes, strict=True):
        cells = schema.fill_cells(values, place, len(x) * len(y)).reshape(len(y), len(x))
        picture = draw_map(axes[name], cells, x, y, limit)
        if schema.structure_kind(cube) == "panel":
            for curve in schema.structure_contours(cube):
                axes[name].fill(*(1000 * (curve + middle)).T, fill=False, edgecolor="#444444")
        axes[name].plot(part["x"] * 1000, part["y"] * 1000, ".", color="#444444", ms=1.2)
        axes[name].set(title=title, xlabel="x in mm")
    axes["c"].set_ylabel("y in mm")
    bar_beside(axes["e"], picture, "w in mm")
    return drawing


def sound_figure(cube: xr.Dataset, case: str, mode: int) -> Figure:
    """Draw the setup, bars of both planes, and on both the ideal field, best and worst error."""
    part = select_settings(cube, case, mode)
    drawing, axes = place_panels(
        "abb;cde;fgh", (8.2, 8.0), (0.6, 0.75, 0.5, 0.3), (0.95, 0.8), (1.6, 1, 1)
    )
    figures.setup_panel(axes["a"], cube, part)
    bars = [error_bars(cube, case, mode, f"plane_error_{p}") for p in ("xz", "yz")]
    figures.bar_panel(axes["b"], part, bars)
    axes["b"].set(title="(d) rms error of the field", ylabel="% of the largest pressure")
    u, z = cube["u"].values * 1000, cube["z"].values * 1000
    c = cube["case_name"].values.tolist().index(case)
    measured = cube["pressure_measured_real"].isel(case=c).sel(mode=mode)
    first = int(np.flatnonzero(cube["case"].values == case)[0])
    best, worst = (
        part["label"].values[int(i) - first]
        for i in cube["best_and_worst"].isel(case=c).sel(mode=mode).values
    )
    nodal = part["independent_ratio"].isnull()
    ideal = part["pressure_reference_real"]
    loudest = float(abs(ideal).max())
    scale, unit = (1000, "kPa") if loudest >= 1000 else (1, "Pa")
    for letter, row, plane in zip("bc", ("cde", "fgh"), ("XZ", "YZ"), strict=True):
        silent = bool(nodal.sel(plane=plane))
        true = ideal.sel(plane=plane)
        wrong = measured.sel(plane=plane) - true
        of_true = loudest if silent else float(abs(true).max())
        fields = (
            (f"({letter}) {plane}, ideal{' (nodal)' if silent else ''}", true, of_true),
            (f"error, best shape:\n{best}", wrong.sel(extreme="best"), float(abs(wrong).max())),
            (f"error, worst shape:\n{worst}", wrong.sel(extreme="worst"), float(abs(wrong).max())),
        )
        pictures = []
        for name, (title, values, limit) in zip(row, fields, strict=True):
            of = scale if values is true else 1
            pictures.append(draw_map(axes[name], values.values.T / of, u, z, limit / of))
            axes[name].set(title=title, xlabel=f"{plane[0]} in mm")
        axes[row[0]].set_ylabel("Z in mm")
        bar_beside(axes[row[0]], pictures[0], f"Re p in {unit}")
        bar_beside(axes[row[2]], pictures[2], "error in Pa")
    return drawing
