"""Cubes as files: netCDF-4, whole or not at all, small or larger than memory."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
import xarray as xr

from thesis_lib import effort
from thesis_lib.chunks import HELD_BYTES, Outline
from thesis_lib.files import staging, whole_file

BITS = 13  # of a rounded mantissa: to 2⁻¹⁴, 0.006 %
_HDF5 = threading.RLock()  # the HDF5 library crashes if two threads use it at once
_LOADED_BYTES = 2**20  # variables of a large cube up to this size are read when it is opened
_STORED_BYTES = 2**18  # of a large variable are compressed together


class CubeError(ValueError):
    """A file that is not one of our cubes; the message is one line."""


def write(cube: xr.Dataset, path: Path, compact: bool = False) -> None:
    """Write a cube as netCDF-4, whole or not at all.

    Parameters
    ----------
    cube : xarray.Dataset
        What to write.
    path : pathlib.Path
        Where to.
    compact : bool
        Whether to compress it. Single precision, which is for what is drawn, is then rounded to
        ``BITS`` bits of mantissa; the file says so itself.
    """
    large = {str(n) for n, v in cube.data_vars.items() if "trial" in v.dims}
    large = large if cube.nbytes > HELD_BYTES else set()
    small = cube.drop_vars(large)
    encoding = {n: _compression(v) for n, v in small.variables.items()} if compact else {}

    def fill(part: Path) -> None:
        small.to_netcdf(part, engine="netcdf4", format="NETCDF4", encoding=encoding)
        if large:
            with netCDF4.Dataset(part, "a") as file:
                for name in cube.data_vars:
                    if name in large:
                        _copy(cube[name], file, _compression(cube[name], 4) if compact else {})

    with _HDF5:
        whole_file(path, fill)


def _compression(values: xr.Variable | xr.DataArray, level: int = 9) -> dict[str, Any]:
    """How a variable is stored in a compact cube; level 9 takes 15 times as long as 4 for 5 %."""
    if values.dtype.kind != "f" or values.size <= 1:
        return {}
    rounded = {"quantize_mode": "BitRound", "significant_digits": BITS}
    return {"zlib": True, "complevel": level, "shuffle": True} | (
        rounded if values.dtype == np.float32 else {}
    )


def _copy(values: xr.DataArray, file: netCDF4.Dataset, encoding: dict[str, Any]) -> None:
    """Copy a variable with settings and trials into a file, some trials of a setting at a time."""
    along = values.dims.index("trial")
    trial_bytes = max(1, values.nbytes // (values.sizes["trial"] * values.sizes["setting"]))
    step = min(values.sizes["trial"], max(1, _STORED_BYTES * values.sizes["mode"] // trial_bytes))
    if encoding:
        stored = [1 if dim in ("setting", "mode") else values.sizes[dim] for dim in values.dims]
        stored[along] = step
        encoding = {**encoding, "chunksizes": stored}
    dims = tuple(map(str, values.dims))
    target = _created(file, str(values.name), dims, values.dtype, values.attrs, **encoding)
    if encoding:  # what is stored together is written at once
        target.set_var_chunk_cache(size=_STORED_BYTES)
    for setting in range(values.sizes["setting"]):
        for first in range(0, values.sizes["trial"], step):
            here = {"setting": setting, "trial": slice(first, first + step)}
            target[tuple(here.get(str(dim), slice(None)) for dim in values.dims)] = values.isel(
                here
            ).values


def fill_in(outline: Outline, path: Path, seconds: Callable[[], float]) -> None:
    """Write an outline as netCDF-4 and fill it in there, whole or not at all.

    Parameters
    ----------
    outline : Outline
        What to write.
    path : pathlib.Path
        Where to.
    seconds : callable
        Tells, when all is done, what it took.
    """
    with staging(path.parent) as folder, _HDF5:
        part = folder / path.name
        outline.cube.to_netcdf(part, engine="netcdf4", format="NETCDF4")
        with netCDF4.Dataset(part, "a") as file:
            values = {
                name: _created(file, name, dims, kind, attributes, contiguous=True)
                for name, (dims, kind, attributes) in outline.large.items()
            }
            outline.fill(values)
            file.run_time_s = np.float64(seconds())
            file.peak_memory_mb = np.float64(effort.peak_memory_mb())
        part.replace(path)


def _created(
    file: netCDF4.Dataset, name: str, dims: tuple[str, ...], kind: Any, said: Mapping[Any, Any],
    **encoding: Any,
) -> Any:  # fmt: skip
    """A new variable of a file, to be filled in entirely."""
    variable = file.createVariable(name, kind, dims, fill_value=False, **encoding)
    variable.setncatts(dict(said))
    variable.set_auto_maskandscale(False)
    return variable


def opened(path: Path) -> xr.Dataset:
    """Open a netCDF file, with one-line errors.

    What is too large to be held stays on disk, and is read as it is needed; nothing of it is kept.
    """
    if not path.is_file():
        kind = "a folder, not a file" if path.is_dir() else "no such file"
        raise CubeError(f"{path}: {kind}; give a cube (.nc) that `thesis run` has written")
    try:
        with _HDF5:
            file = xr.open_dataset(path, engine="netcdf4", cache=False, lock=_HDF5)
            if file.nbytes <= HELD_BYTES:
                with file:
                    return file.load()
            for values in file.variables.values():
                if values.nbytes <= _LOADED_BYTES:
                    values.load()
            return file
    except Exception as error:  # the netCDF and HDF libraries raise what they like
        raise CubeError(f"{path}: not a readable netCDF file ({type(error).__name__})") from None
