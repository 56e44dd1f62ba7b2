"""Figures of the plate and of its sound: maps of deflection and pressure beside setup and bars."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from numpy.typing import NDArray

from thesis_lib import figures, outlines
from thesis_lib.panels import Panel
from thesis_lib.style import mosaic

Array = NDArray[np.float64]


def _diverging(count: int = 129) -> tuple[str, ...]:
    """Blue to orange over near-white, even in lightness and told apart with any colour vision.

    Straight lines in Oklab from the ends to the middle; `count` is odd, the middle is zero.
    """
    ends = {-1: (0.42, -0.045, -0.145), 1: (0.47, 0.105, 0.09)}
    middle = np.array([0.97, 0.0, 0.002])
    steps = np.linspace(-1, 1, count)
    lab = np.array([middle + abs(t) * (np.array(ends[1 if t > 0 else -1]) - middle) for t in steps])
    to_lms = np.array(
        [
            [1, 0.3963377774, 0.2158037573],
            [1, -0.1055613458, -0.0638541728],
            [1, -0.0894841775, -1.2914855480],
        ]
    )
    to_rgb = np.array(
        [
            [4.0767416621, -3.3077115913, 0.2309699292],
            [-1.2684380046, 2.6097574011, -0.3413193965],
            [-0.0041960863, -0.7034186147, 1.7076147010],
        ]
    )
    linear = np.clip((lab @ to_lms.T) ** 3 @ to_rgb.T, 0, 1)
    srgb = np.where(linear > 0.0031308, 1.055 * linear ** (1 / 2.4) - 0.055, 12.92 * linear)
    return tuple("#" + "".join(f"{round(255 * c):02x}" for c in color) for color in srgb)


DIVERGING = _diverging()
_CMAP = ListedColormap(list(DIVERGING), "diverging")


def plate_figure(cube: xr.Dataset, case: str, mode: int) -> Figure:
    """Setup, ideal shape, best and worst measured shape, bars."""
    part = figures.select(cube, case, mode)
    chosen = figures.best_and_worst(part)
    drawing, axes = mosaic(
        "abb;cde", figsize=(8.2, 5.6), layout="constrained", height_ratios=[1.15, 1]
    )
    figures.setup_panel(axes["a"], cube, part)
    figures.bar_panel(axes["b"], part, [figures.error_bars(cube, case, mode)])
    axes["b"].set(title="(d) mean (rms) error", ylabel="% of the largest deflection")
    reference = part["reference_deflection"].values * 1000
    shapes = [("(b) ideal", reference)]
    for index, word in ((chosen[0], "best"), (chosen[-1], "worst")):
        measured = part["measured_deflection"].isel(setting=index, trial=0).values * 1000
        shapes.append((f"(c) {word}: {part['label'].values[index]}", measured))
    limit = max(float(np.max(np.abs(values))) for _, values in shapes)
    picture: Any = None
    x, y, place = outlines.cells(cube)
    x, y, structure = 1000 * x, 1000 * y, outlines.structure_of(cube)
    middle = np.array(structure.extent) / 2
    for name, (title, values) in zip("cde", shapes, strict=True):
        placed = outlines.spread(values, place, len(x) * len(y))
        picture = draw_map(axes[name], placed.reshape(len(y), len(x)), x, y, limit)
        if isinstance(structure, Panel):
            for curve in outlines.contours(structure):
                axes[name].fill(*(1000 * (curve + middle)).T, fill=False, edgecolor="#444444")
        axes[name].plot(part["x"] * 1000, part["y"] * 1000, ".", color="#444444", markersize=1.2)
        axes[name].set(title=title, xlabel="x in mm")
    axes["c"].set_ylabel("y in mm")
    drawing.colorbar(picture, ax=[axes[name] for name in "cde"], shrink=0.8, label="w in mm")
    return drawing


def sound_figure(cube: xr.Dataset, case: str, mode: int) -> Figure:
    """Setup, bars of both planes, ideal, best and worst field on both planes."""
    part = figures.select(cube, case, mode)
    drawing, axes = mosaic(
        "abb;cde;fgh", figsize=(8.2, 7.4), layout="constrained", height_ratios=[1.2, 1, 1]
    )
    figures.setup_panel(axes["a"], cube, part)
    bars = [figures.error_bars(cube, case, mode, f"plane_error_{p}") for p in ("xz", "yz")]
    figures.bar_panel(axes["b"], part, bars)
    axes["b"].set(title="(c) rms error of the field", ylabel="% of the largest pressure")
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
    limits = {
        plane: max(float(abs(ideal.sel(plane=plane)).max()),
                   float(abs(measured.sel(plane=plane)).max()))
        for plane in ("XZ", "YZ")
    }  # fmt: skip
    for row, plane in zip(("cde", "fgh"), ("XZ", "YZ"), strict=True):
        silent = bool(nodal.sel(plane=plane))
        limit = max(limits.values()) if silent else limits[plane]
        fields = (
            (f"(b) {plane}, ideal{' (nodal)' if silent else ''}", ideal.sel(plane=plane).values),
            (f"best: {best}", measured.sel(plane=plane, extreme="best").values),
            (f"worst: {worst}", measured.sel(plane=plane, extreme="worst").values),
        )
        picture: Any = None
        for name, (title, values) in zip(row, fields, strict=True):
            picture = draw_map(axes[name], values.T, u, z, limit)
            axes[name].set(title=title, xlabel=f"{plane[0]} in mm")
        axes[row[0]].set_ylabel("Z in mm")
        drawing.colorbar(
            picture, ax=[axes[name] for name in row], shrink=0.85, label="Re p in Pa", pad=0.01
        )
    return drawing


def draw_map(axes: Axes, values: Array, across: Array, up: Array, limit: float) -> Any:
    """A map to scale: values (up, across) at the centres of their cells, zero in the middle."""
    half = [(a[1] - a[0]) / 2 for a in (across, up)]
    extent = (across[0] - half[0], across[-1] + half[0], up[0] - half[1], up[-1] + half[1])
    picture = axes.imshow(
        values, _CMAP, vmin=-limit, vmax=limit, extent=extent, origin="lower",
        interpolation="nearest",
    )  # fmt: skip
    axes.grid(visible=False)
    return picture
