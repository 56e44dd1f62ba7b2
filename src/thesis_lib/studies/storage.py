"""Cubes as netCDF-4 files, written atomically, and a cache of them.

h5netcdf writes and reads them; it has wheels where the netCDF library has none.

A cached file is valid only while it matches the digest stored next to it. A file without a digest,
or with another one, was truncated, edited or copied by hand: a warning names it, and it is computed
again. Results of other package versions have other keys.
"""

import hashlib
import io
import json
import math
import re
import threading
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import h5netcdf
import h5py
import numpy as np
import xarray as xr

from thesis_lib import files
from thesis_lib.studies.cubes import CubeError
from thesis_lib.text import print_status

MAX_UNCHECKED_BYTES = 64 * 2**20  # of memory that a small unknown file may fill
MANTISSA_BITS = {  # of a rounded mantissa
    np.dtype(np.float32): 13,  # to 2⁻¹⁴, 0.006 %: plotted values
    np.dtype(np.float64): 23,  # to 2⁻²⁴, as in single precision: compared values
}
# Least number of steps in a large field's largest value: values are within 0.024 % of that
MIN_FIELD_STEPS = 2**11
_ROUNDED_ATTRIBUTE = "_QuantizeBitRoundNumberOfSignificantBits"
_SMALL_BYTES = 4096  # up to here compression costs more than it saves: HDF5 then adds an index
_HDF5_LOCK = threading.RLock()  # the HDF5 library crashes if two threads use it at once
_MAX_PACKING_RATIO = 100  # maximum accepted compression ratio
MIN_QUANTISED_BYTES = 2**19  # above it, plotted values are stored as multiples of a step


def write_netcdf(
    cube: xr.Dataset, path: Path, compact: bool = False, steps: Mapping[str, float] | None = None
) -> None:
    """Write a cube as netCDF-4, atomically.

    Parameters
    ----------
    compact : bool
        Whether to compress large variables. They are then rounded: to :data:`MANTISSA_BITS`, and
        large fields to multiples of a step, the largest value being at least
        :data:`MIN_FIELD_STEPS` of them. Attributes record it, and any reader decodes it.
    steps : mapping, optional
        By variable: the step that its values are multiples of, to store them as integers.
    """
    encoding: dict[Any, dict[str, Any]] = {}
    if compact:
        for name, values in cube.variables.items():
            if values.dtype.kind in "fu" and values.nbytes > _SMALL_BYTES:
                # level 9 takes 15 × as long as 4 for 5 %
                packing = {"compression": "gzip", "compression_opts": 9, "shuffle": True}
                encoding[name] = packing | {"chunksizes": values.shape}
        for name, data in cube.data_vars.items():
            if name not in encoding or data.dtype not in MANTISSA_BITS:
                continue
            if step := _step(data):
                encoding[name] |= _packed(step, "int16")
            elif name not in (steps or {}):
                cube = cube.assign({name: _round_mantissa(data.variable)})
    for name, given in (steps or {}).items():
        encoding[name] = encoding.get(name, {}) | _packed(given, "int32")
    image = io.BytesIO()  # in memory: HDF5 ends the process if it cannot write to a disk
    with _HDF5_LOCK:
        cube.to_netcdf(image, engine="h5netcdf", encoding=encoding)
        files.whole_file(path, lambda part: part.write_bytes(image.getvalue()))


def _step(values: xr.DataArray) -> np.float32 | None:
    """Return the step, a power of two, in multiples of which to store a large field, else None.

    Variables with trials have none, since the ledger computes with them.
    """
    if values.dtype != np.float32 or values.nbytes <= MIN_QUANTISED_BYTES or "trial" in values.dims:
        return None
    largest = float(np.fmax.reduce(np.abs(values.values), axis=None, initial=0.0))
    if not 0 < largest < np.inf:
        return None
    return np.float32(2.0 ** math.floor(math.log2(largest / MIN_FIELD_STEPS)))


def _packed(step: float | np.float32, dtype: str) -> dict[str, Any]:
    """Return the CF attributes of packed data for multiples of a step."""
    least = np.dtype(dtype).type(np.iinfo(dtype).min)
    return {"dtype": dtype, "scale_factor": step, "_FillValue": least}


def _round_mantissa(values: xr.Variable) -> xr.Variable:
    """Round mantissas as the netCDF library's *BitRound* does, and record the number of bits."""
    kept = MANTISSA_BITS[values.dtype]
    whole = np.dtype(f"u{values.dtype.itemsize}").type
    dropped = whole(np.finfo(values.dtype).nmant - kept)
    bits = np.ascontiguousarray(values.values).view(whole) + (whole(1) << (dropped - whole(1)))
    rounded = ((bits >> dropped) << dropped).view(values.dtype)
    finite = np.where(np.isfinite(values.values), rounded, values.values)
    return xr.Variable(values.dims, finite, values.attrs | {_ROUNDED_ATTRIBUTE: np.int32(kept)})


class _CachedFile(h5py.File):  # type: ignore[misc]  # h5py has no annotations
    """Read-only HDF5 file that looks up a variable once; h5netcdf does so some forty times."""

    def __init__(self, path: Path) -> None:
        super().__init__(path, "r")
        self._known: dict[str, Any] = {}

    def __getitem__(self, name: Any) -> Any:
        if not isinstance(name, str):
            return super().__getitem__(name)
        if name not in self._known:
            self._known[name] = super().__getitem__(name)
        return self._known[name]


def read_attributes(path: Path) -> dict[str, Any]:
    """Return the global attributes of a netCDF file."""
    with _HDF5_LOCK, h5py.File(path) as file:
        # Single numbers are stored as arrays of one
        return {k: v[0] if np.shape(v) == (1,) else v for k, v in file.attrs.items()}


def open_netcdf(path: Path) -> xr.Dataset:
    """Read a netCDF file, with one-line errors."""
    if not path.is_file():
        kind = "a folder, not a file" if path.is_dir() else "no such file"
        raise CubeError(f"{path}: {kind}; give a cube (.nc) that `thesis run` has written")
    try:
        with (
            _HDF5_LOCK,
            _CachedFile(path) as indexed,
            h5netcdf.File(indexed, decode_vlen_strings=True) as file,
        ):
            every, size = file.variables.values(), path.stat().st_size
            held = sum(math.prod(one.shape) * np.dtype(one.dtype).itemsize for one in every)
            # A small file that would fill the memory is no cube: none is packed as tightly.
            if held > max(MAX_UNCHECKED_BYTES, _MAX_PACKING_RATIO * size):
                said = f"{size / 1e6:.3g} MB say {held / 1e6:.3g} MB"
                raise CubeError(f"{path}: not a cube of this project ({said})")
            return xr.open_dataset(xr.backends.H5NetCDFStore(file), cache=False).load()
    except CubeError:
        raise
    except Exception as error:  # the netCDF and HDF libraries raise any exception
        raise CubeError(f"{path}: not a readable netCDF file ({type(error).__name__})") from None


RESULT_PACKAGES = (
    "numpy", "scipy", "scikit-fem", "xarray", "pandas", "h5py", "opencv-python-headless", "av",
)  # fmt: skip


@cache
def package_versions() -> dict[str, str]:
    """Return the versions of the installed packages that results are computed with."""
    found = {}
    for name in RESULT_PACKAGES:
        with suppress(PackageNotFoundError):
            found[name] = version(name)
    return found


def differing_packages() -> list[str]:
    """Describe the packages whose installed versions differ from the lock file."""
    lock = (files.shipped() / "requirements" / "book.txt").read_text(encoding="utf-8")
    pins = re.findall(r"^([\w.-]+)==([^\s;]+)", lock, re.MULTILINE)  # one for each Python
    return [
        f"{name} {here} is installed, the lock has {' or '.join(locked)}"
        for name, here in package_versions().items()
        if (locked := [pin for package, pin in pins if package == name]) and here not in locked
    ]


def _digest(path: Path) -> Path:
    return path.with_name(f".{path.name}.sha256")


def load_or_compute(
    path: Path, compute: Callable[[], xr.Dataset], key: str = "", others: Sequence[Path] = ()
) -> xr.Dataset:
    """Return a cached file's content if its key matches; else compute, write and read it.

    The attribute `run_time_s` is the computing time. A file that was changed is computed again,
    with a warning. So it is if one of the `others` was changed: files that `compute` writes itself,
    as they are too large for the memory.
    """
    stored = [path, *others]
    if path.exists():
        data: xr.Dataset | None = None
        with suppress(OSError, ValueError, CubeError):
            if _digest(path).read_text(encoding="ascii").split() == [*map(files.sha256, stored)]:
                data = open_netcdf(path)
        if data is None:
            print_status(f"{path} is not what was stored there; it is computed again")
        elif data.attrs.get("key", "") == key:
            return data
    begun = time.perf_counter()
    cube = compute()
    cube = cube.assign_attrs(run_time_s=time.perf_counter() - begun)
    write_netcdf(cube.assign_attrs({"key": key} if key else {}), path)
    digests = "".join(f"{files.sha256(one)}\n" for one in stored)
    files.whole_text(_digest(path), digests)  # valid from now on
    return open_netcdf(path)


def key_of(values: Any, paths: Iterable[Path] = ()) -> str:
    """Return the key of a step that depends on JSON values and on the contents of files.

    A file's digest is cached while its size, times and inode are the same; reading a gigabyte takes
    about a second, tracking it takes minutes.
    """
    stamps = [[path.name, files.sha256(path)] for path in paths]
    text = json.dumps([values, stamps, files.library_digest(), package_versions()])
    return hashlib.sha256(text.encode()).hexdigest()[:32]
