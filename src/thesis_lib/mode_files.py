"""Markers, mode shapes and frequencies of a structure as a netCDF file, for other programs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import xarray as xr

from thesis_lib import cubes, storage
from thesis_lib.structures import Structure, deflection_shape


def modes_of(structure: Structure, modes: Sequence[int]) -> xr.Dataset:
    """Markers and mode shapes.

    Parameters
    ----------
    structure : Structure
        Beam, plate or panel.
    modes : sequence of int
        Numbers of the modes, from 1.

    Returns
    -------
    xarray.Dataset
        ``x``, ``y``, ``z`` of each ``point`` in m from the middle of the box around the structure,
        ``frequency(mode)`` in Hz, and ``shape(mode, point)``, which is 1 where the structure moves
        most.
    """
    half = np.array(structure.extent) / 2
    x, y = structure.markers - half[:, None]
    shapes = [deflection_shape(structure, mode, structure.markers, peak=1.0) for mode in modes]
    hertz = structure.angular_frequencies(max(modes)) / (2 * np.pi)
    places = {"x": x, "y": y, "z": np.zeros_like(x)}
    return cubes.with_origin(
        xr.Dataset(
            {
                **{
                    name: ("point", values, {"units": "m", "long_name": f"position along {name}"})
                    for name, values in places.items()
                },
                "shape": (
                    ("mode", "point"), np.array(shapes),
                    {"units": "1", "long_name": "mode shape along z, 1 where it is largest"},
                ),
                "frequency": (
                    "mode", hertz[np.array(modes) - 1],
                    {"units": "Hz", "long_name": "natural frequency"},
                ),
            },
            coords={"mode": ("mode", np.array(modes), {"units": "1", "long_name": "mode number"})},
            attrs={"title": "Markers and mode shapes"},
        ),
        f"thesis_lib.mode_files, {type(structure).__name__}",
    )  # fmt: skip


def write_modes(structure: Structure, modes: Sequence[int], path: Path) -> Path:
    """Write :func:`modes_of` to a netCDF file, whole or not at all; returns the file."""
    storage.write(modes_of(structure, modes), Path(path))
    return Path(path)
