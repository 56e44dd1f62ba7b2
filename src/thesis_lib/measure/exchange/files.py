"""All files of a measurement that other programs open: one list of formats.

A format is a function that takes a path and a :class:`Measured`, and a line in :data:`FORMATS`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Literal

import numpy as np
import scipy.io
import xarray as xr

from thesis_lib.measure.exchange import history, uff
from thesis_lib.measure.exchange.cameras import in_structure_axes, write_aniposelib, write_opencv
from thesis_lib.measure.exchange.mesh import write_vtk
from thesis_lib.measure.tracking.tracks import Recording
from thesis_lib.studies import storage
from thesis_lib.vision.lens import Camera

Content = Literal["shape", "modes", "response", "motion", "cameras"]


@dataclass(frozen=True)
class Measured:
    """What a measurement has to write."""

    result: Literal["shape", "modes", "response"]
    #: What ``shape_result``, ``modes_result`` or ``estimate_response`` returns
    data: xr.Dataset
    #: What :func:`~thesis_lib.measure.exchange.history.time_histories` returns, if there is one
    motion: xr.Dataset | None = None
    recordings: Sequence[Recording] = ()  #: The cameras, in the frame of the calibration

    @cached_property
    def placed_cameras(self) -> list[Camera]:
        """The cameras in the structure's axes."""
        return in_structure_axes([own.camera for own in self.recordings], self.data)

    @property
    def available_contents(self) -> set[Content]:
        """What there is: the result, and perhaps motion and cameras."""
        return {
            self.result,
            *(("motion",) if self.motion is not None else ()),
            *(("cameras",) if self.recordings else ()),
        }


def write_formats(folder: Path, measured: Measured) -> None:
    """Write a measurement into a folder, in each format of what it holds."""
    for content, name, write in FORMATS:
        if content in measured.available_contents:
            write(folder / name, measured)


def _write_shape_grids(folder: Path, measured: Measured) -> None:
    folder.mkdir(exist_ok=True)
    write_vtk(folder, measured.data)


def _write_mode_grids(folder: Path, measured: Measured) -> None:
    for k in range(measured.data.sizes["mode"]):
        part = folder / f"mode-{k + 1}"
        part.mkdir(parents=True)
        write_vtk(part, measured.data.isel(mode=k))


def _motion_of(measured: Measured) -> xr.Dataset:
    assert measured.motion is not None  # as `available_contents` says
    return measured.motion


FORMATS: tuple[tuple[Content, str, Callable[[Path, Measured], None]], ...] = (
    ("motion", "motion.nc", lambda path, one: storage.write_netcdf(_motion_of(one), path)),
    ("motion", "motion.csv", lambda path, one: history.write_csv(path, _motion_of(one))),
    ("motion", "motion.uff", lambda path, one: uff.write_motion(path, one.data, _motion_of(one))),
    ("shape", "shapes.uff", lambda path, one: uff.write_uff(path, one.data)),
    ("shape", "measured.mat", lambda path, one: write_matlab(path, one.data, _motion_of(one))),
    ("shape", "vtk", _write_shape_grids),
    ("modes", "modes.uff", lambda path, one: uff.write_modes(path, one.data)),
    ("modes", "vtk", _write_mode_grids),
    ("response", "response.uff", lambda path, one: uff.write_response(path, one.data)),
    ("cameras", "cameras.yaml", lambda path, one: write_opencv(path, one.placed_cameras)),
    ("cameras", "cameras.toml", lambda path, one: write_aniposelib(path, one.placed_cameras)),
)
"""Content that a format needs, name of its file or folder, and what writes it."""


def write_matlab(path: Path, data: xr.Dataset, moved: xr.Dataset) -> None:
    """Write shapes and motion as two structures, ``shape`` in SI units and ``motion`` in mm.

    Fields have the names of ``measured.nc`` and ``motion.nc``, and dimensions in the same order;
    ``shape.amplitude`` is complex, ``units`` has the unit of every field.
    """
    amplitude = data["amplitude_real"].values + 1j * data["amplitude_imag"].values
    values = {"shape": _structure(data) | {"amplitude": amplitude}, "motion": _structure(moved)}
    scipy.io.savemat(path, values, do_compression=True, long_field_names=True, oned_as="column")


def _structure(data: xr.Dataset) -> dict[str, object]:
    """Return the variables by name, with what MATLAB keeps: numbers, and texts as cells."""
    fields: dict[str, object] = {}
    for name, variable in data.variables.items():
        texts = variable.dtype.kind in "OSU"
        fields[str(name)] = np.array(variable.values, dtype=object) if texts else variable.values
    units = {str(name): str(v.attrs.get("units", "")) for name, v in data.variables.items()}
    return fields | {"units": units}
