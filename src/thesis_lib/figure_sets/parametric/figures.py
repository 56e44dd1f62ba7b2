"""Figures of these sets that are shown by name, drawn from their cubes."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from thesis_lib.figure_sets.parametric.sound import audible_planes
from thesis_lib.plotting import panels as figures
from thesis_lib.plotting.selection import best_and_worst, error_bars, rank_settings, select_settings
from thesis_lib.plotting.style import bar_beside, cycle_color, draw_map, place_panels, subplots
from thesis_lib.studies import schema


def turn(cube: xr.Dataset) -> Figure:
    """Plot field errors against the turn: lines by the law, dots simulated."""
    pairs = audible_planes(cube)
    drawing, axes = subplots(
        1,
        len(pairs),
        figsize=(2.1 * len(pairs) + 1, 2.8),
        layout="constrained",
        squeeze=False,
        sharey=True,
    )
    for panel, (mode, plane) in zip(axes[0], pairs, strict=True):
        one = cube.sel(mode=mode, plane=plane)
        for i, elevation in enumerate(cube["elevation"].values):
            part = one.sel(elevation=elevation)
            law = part["turned_law_error"]
            panel.plot(cube["law_turn"], law, color=cycle_color(i), lw=1, label=f"{elevation:g}°")
            panel.plot(cube["turn"], part["turned_simulated"], "o", color=cycle_color(i), ms=4)
        panel.set(title=f"mode {mode}, {plane}", xlabel="turned by, °")
    axes[0, 0].set(ylabel="field error, %", ylim=(0, None))
    axes[0, -1].legend(title="elevation", fontsize=7)
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
            pictures.append(draw_map(axes[name], values.values.T, u, z, limit))
            axes[name].set(title=title, xlabel=f"{plane[0]} in mm")
        axes[row[0]].set_ylabel("Z in mm")
        bar_beside(axes[row[0]], pictures[0], "Re p in Pa")
        bar_beside(axes[row[2]], pictures[2], "error in Pa")
    return drawing
