"""Figures of the rendered plate."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from thesis_lib.plotting import panels as figures
from thesis_lib.plotting.selection import best_and_worst, error_bars, ranking, select
from thesis_lib.plotting.style import draw_map, mosaic

TITLES = {
    "distance": "distance d",
    "aperture": "aperture α",
    "elevation": "elevation φ",
    "resolution": "resolution",
    "cameras": "number of cameras",
}


def filmed_plate_figure(cube: xr.Dataset, case: str, mode: int) -> Figure:
    """Setup, errors of deflection and sound, maps of the deflection and the field and of errors."""
    part = select(cube, case, mode)
    drawing, axes = mosaic(
        "abc;def;ghi", figsize=(8.2, 6.6), layout="constrained", height_ratios=[1.3, 1, 1.1]
    )
    figures.setup_panel(axes["a"], cube, part)
    axes["a"].set_title(f"(a) {TITLES.get(case, case)} varied")
    figures.bar_panel(axes["b"], part, [error_bars(cube, case, mode)])
    axes["b"].set(title="(b) deflection", ylabel="error in % of the largest")
    bars = [error_bars(cube, case, mode, f"plane_error_{p}") for p in ("xz", "yz")]
    figures.bar_panel(axes["c"], part, bars)
    silent = [one.name for one in bars if np.isnan(one.literal).all()]
    planes = {"": "XZ, YZ (light)", "XZ": "YZ", "YZ": "XZ"}.get("".join(silent), "nodal planes")
    axes["c"].set_title(f"(c) pressure: {planes}")
    handles = axes["b"].get_legend_handles_labels()
    for name in "bc":
        legend = axes[name].get_legend()
        if legend is not None:
            legend.remove()
        axes[name].set_ylim(top=axes[name].get_ylim()[1] / 1.25)  # the legend stands outside
    drawing.legend(*handles, loc="outside lower center", ncols=4)
    chosen = best_and_worst(part)
    words = [
        f"{word}:\n{part['label'].values[index]}"
        for word, index in zip(ranking(part), (chosen[0], chosen[-1]), strict=True)
    ]
    _deflections(drawing, [axes[name] for name in "def"], part, (chosen[0], chosen[-1]), words)
    _fields(drawing, [axes[name] for name in "ghi"], cube, case, mode, words)
    return drawing


def _deflections(
    drawing: Figure, axes: list[Axes], part: xr.Dataset, chosen: tuple[int, int], words: list[str]
) -> None:
    x, y = (np.unique(np.round(part[axis].values, 9)) * 1000 for axis in ("x", "y"))
    reference = part["reference_deflection"].values
    errors = [(part["measured_deflection"].values[i, 0] - reference) * 1e6 for i in chosen]
    largest = max(float(np.nanmax(np.abs(error))) for error in errors)
    peak = 1000 * float(np.abs(reference).max())
    shown = [
        ("(d) true deflection", reference * 1000, peak),
        *((f"error, {word}", error, largest) for word, error in zip(words, errors, strict=True)),
    ]
    pictures = []
    for one, (title, values, limit) in zip(axes, shown, strict=True):
        pictures.append(draw_map(one, values.reshape(len(y), len(x)), x, y, limit))
        one.set_title(title, fontsize=8)
        one.set_xlabel("x in mm")
    axes[0].set_ylabel("y in mm")
    drawing.colorbar(pictures[0], ax=axes[0], shrink=0.8, label="w in mm")
    drawing.colorbar(pictures[1], ax=axes[1:], shrink=0.8, label="error in µm")


def _fields(
    drawing: Figure, axes: list[Axes], cube: xr.Dataset, case: str, mode: int, words: list[str]
) -> None:
    """The true field on the louder plane, and the errors of the field there."""
    part = cube.sel(mode=mode)
    largest = part["largest_pressure"]
    plane = str(part["plane"].values[np.argmax(np.nan_to_num(largest.values))])
    scale = float(largest.sel(plane=plane))
    u, z = cube["u"].values * 1000, cube["z"].values * 1000
    c = cube["case_name"].values.tolist().index(case)
    true = part["pressure_reference_real"].sel(plane=plane).values
    filmed = part["pressure_measured_real"].isel(case=c).sel(plane=plane)
    errors = [100 * (filmed.sel(extreme=e).values - true) / scale for e in ("best", "worst")]
    limit = max(float(np.abs(error).max()) for error in errors)
    shown = [
        (f"(e) true pressure, {plane}", 100 * true / scale, 100.0),
        *((f"error, {word}", error, limit) for word, error in zip(words, errors, strict=True)),
    ]
    pictures = []
    for one, (title, values, top) in zip(axes, shown, strict=True):
        pictures.append(draw_map(one, values.T, u, z, top))
        one.set_title(title, fontsize=8)
        one.set_xlabel(f"{plane[0]} in mm")
    axes[0].set_ylabel("Z in mm")
    drawing.colorbar(pictures[0], ax=axes[0], shrink=0.8, label="Re p in % of the largest")
    drawing.colorbar(pictures[1], ax=axes[1:], shrink=0.8, label="error of Re p in %")
