"""All files of a measurement that other programs open, in one go."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import scipy.io
import xarray as xr

from thesis_lib.measure.exchange import cameras, history, uff, vtk
from thesis_lib.measure.tracking.tracks import Recording
from thesis_lib.studies import storage


def write_formats(
    folder: Path, data: xr.Dataset, moved: xr.Dataset, recordings: Sequence[Recording]
) -> None:
    """Write motion, shape, period and cameras into a folder, in each format.

    Parameters
    ----------
    folder : Path
        It must be there.
    data : xarray.Dataset
        What :func:`~thesis_lib.measure.fitting.result.shape_result` returns.
    moved : xarray.Dataset
        What :func:`~thesis_lib.measure.exchange.history.time_histories` returns.
    recordings : sequence of Recording
        The cameras.
    """
    storage.write_netcdf(moved, folder / "motion.nc")
    history.write_csv(folder / "motion.csv", moved)
    uff.write_uff(folder / "shapes.uff", data)
    uff.write_motion(folder / "motion.uff", data, moved)
    write_matlab(folder / "measured.mat", data, moved)
    (folder / "vtk").mkdir(exist_ok=True)
    vtk.write_vtk(folder / "vtk", data)
    cameras.write_calibration(folder, [own.camera for own in recordings], data)


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
