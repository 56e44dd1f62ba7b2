"""What is drawn of a cube's structure: its outline and holes, and the cells of its markers."""

from __future__ import annotations

import json

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from thesis_lib.figure_sets.registry import STUDIES, validate
from thesis_lib.vibration.panel import Panel
from thesis_lib.vibration.structure import Structure

Array = NDArray[np.float64]


def structure_of(cube: xr.Dataset) -> Structure:
    """The structure that a cube's parameters ask for; only panels have other sizes than printed."""
    name = cube.attrs["figure_set"]
    if STUDIES[name].subject == "shape":
        return validate(name, json.loads(cube.attrs["parameters"])).structure
    return STUDIES[name]().structure


def contours(structure: Structure) -> list[Array]:
    """Closed curves in world X and Y, each (corners, 2) in m: outline, then holes the other way."""
    half = np.array(structure.extent) / 2
    if isinstance(structure, Panel):
        return [curve - half for curve in structure.contours]
    return [half * [[-1, -1], [1, -1], [1, 1], [-1, 1]]]


def cells(cube: xr.Dataset) -> tuple[Array, Array, NDArray[np.int64]]:
    """Columns x and rows y of a plate's markers in m, and the cell of each marker, x fastest."""
    structure = structure_of(cube)
    if isinstance(structure, Panel):
        x, y = (
            (np.arange(count) + 0.5) * size / count
            for count, size in zip(structure.grid, structure.extent, strict=True)
        )
    else:
        x, y = (np.unique(np.round(cube[axis].values, 9)) for axis in ("x", "y"))
    column, row = (
        np.argmin(np.abs(cube[name].values[:, None] - axis), axis=1)
        for name, axis in (("x", x), ("y", y))
    )
    return x, y, row * len(x) + column


def spread(values: Array, place: NDArray[np.int64], count: int) -> Array:
    """Values of markers (..., markers) in their cells (..., count); NaN where there is none."""
    filled = np.full((*values.shape[:-1], count), np.nan)
    filled[..., place] = values
    return filled
