"""The outline of a cube's structure, and the cells of its markers."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from thesis_lib.arrays import Array, IntArray
from thesis_lib.vibration.panel import Panel
from thesis_lib.vibration.structure import Structure


def outline(structure: Structure) -> tuple[tuple[str, str], Array, dict[str, Any]]:
    """A structure's closed curves as a coordinate (corner, xy) in m, a row of NaN after each.

    They are in world X and Y: outline, then holes the other way. The attributes tell what kind of
    structure it is, its sizes, and of a panel the grid of cells in which its markers are.
    """
    half = np.array(structure.extent) / 2
    about = {
        "units": "m",
        "long_name": "outline of the structure, then outlines of holes",
        "structure": type(structure).__name__.lower(),
        "length": np.float64(structure.extent[0]),
        "width": np.float64(structure.extent[1]),
    }
    if isinstance(structure, Panel):
        curves = [curve - half for curve in structure.contours]
        about["grid"] = np.array(structure.grid)
    else:
        curves = [half * [[-1, -1], [1, -1], [1, 1], [-1, 1]]]
    rows = [np.insert(curve, len(curve), np.nan, axis=0) for curve in curves]
    return ("corner", "xy"), np.concatenate(rows), about


def kind(cube: xr.Dataset) -> str:
    """Whether a cube is of a beam, a plate or a panel."""
    return str(cube["outline"].attrs["structure"])


def extent(cube: xr.Dataset) -> tuple[float, float]:
    """Length and width of a cube's structure in m."""
    about = cube["outline"].attrs
    return float(about["length"]), float(about["width"])


def contours(cube: xr.Dataset) -> list[Array]:
    """Closed curves in world X and Y, each (corners, 2) in m: outline, then holes the other way."""
    rows = cube["outline"].values
    ends = np.flatnonzero(np.isnan(rows[:, 0]))
    return [part[~np.isnan(part[:, 0])] for part in np.split(rows, ends)[:-1]]


def cells(cube: xr.Dataset) -> tuple[Array, Array, IntArray]:
    """Columns x and rows y of a plate's markers in m, and the cell of each marker, x fastest."""
    if (grid := cube["outline"].attrs.get("grid")) is not None:
        x, y = (
            (np.arange(count) + 0.5) * size / count
            for count, size in zip(grid, extent(cube), strict=True)
        )
    else:
        x, y = (np.unique(np.round(cube[axis].values, 9)) for axis in ("x", "y"))
    column, row = (
        np.argmin(np.abs(cube[name].values[:, None] - axis), axis=1)
        for name, axis in (("x", x), ("y", y))
    )
    return x, y, row * len(x) + column


def spread(values: Array, place: IntArray, count: int) -> Array:
    """Values of markers (..., markers) in their cells (..., count); NaN where there is none."""
    filled = np.full((*values.shape[:-1], count), np.nan)
    filled[..., place] = values
    return filled
