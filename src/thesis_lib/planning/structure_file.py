"""A structure from a file: markers with normals, mode shapes and frequencies, as netCDF.

The file has dimensions ``point`` and ``mode`` and, as xarray writes them,

============================  ==================  =======================================
variable                      dimensions          meaning
============================  ==================  =======================================
``x``, ``y``, ``z``           point               markers at rest in m
``nx``, ``ny``, ``nz``        point               normals; without them +Z
``shape``                     mode, point         deflection along the normal, in any scale
``frequency``                 mode                natural frequency in Hz
``mode``                      mode                optional: its number, else 1, 2, …
============================  ==================  =======================================

Anything else in the file is left alone. The peak of a mode is its largest deflection in the file.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import xarray as xr

from thesis_lib.arrays import Array
from thesis_lib.planning.positions import Body, body_of
from thesis_lib.studies import schema, storage
from thesis_lib.studies.request import ParameterError
from thesis_lib.text import has_hidden, one_line
from thesis_lib.vibration.structure import Structure

NEEDED_FIELDS = dict.fromkeys("xyz", ("point",)) | {
    "shape": ("mode", "point"),
    "frequency": ("mode",),
}
NORMAL_COLUMNS = ("nx", "ny", "nz")
MAX_POINTS = 1000
MAX_SIZE_M = 100.0  # m, as far as cameras may stand
MARKERS_ONLY = "the markers, not all nodes of a mesh"
NEEDED_FILE = "a netCDF file with x, y, z, shape and frequency"


class MeshError(ParameterError):
    """A structure file that is not one; the message is one line."""


def read_body(path: Path, modes: Sequence[int]) -> Body:
    """Return the modes wanted of the structure in a file.

    Raises
    ------
    MeshError
        In one line: the file, what is wrong with it, and what is needed.
    """
    if has_hidden(path.name):  # the plan is named for it
        raise MeshError(f"--structure: given {path.name!r}, allowed: a visible name")
    mesh = _open_table(path)
    for name, dims in NEEDED_FIELDS.items():
        if name not in mesh.variables:
            raise _refusal(path, f"has no variable {name}", f"{name}({', '.join(dims)})")
    has = [name for name in NORMAL_COLUMNS if name in mesh.variables]
    if has and len(has) < 3:
        raise _refusal(path, f"has {', '.join(has)} alone", "all of nx, ny, nz, or none")
    values = {name: _values(path, mesh, name, dims) for name, dims in NEEDED_FIELDS.items()}
    values |= {name: _values(path, mesh, name, ("point",)) for name in has}
    points = np.stack([values["x"], values["y"], values["z"]])
    if points.shape[1] > MAX_POINTS:
        allowed = f"at most {MAX_POINTS}: {MARKERS_ONLY}"
        raise _refusal(path, f"has {points.shape[1]} points", allowed)
    size = float(np.max(np.abs(points)))
    if size > MAX_SIZE_M:
        allowed = f"at most {MAX_SIZE_M:g} m (metres, not mm)"
        raise _refusal(path, f"has a coordinate of {size:g} m", allowed)
    if len(np.unique(points, axis=1).T) < points.shape[1]:
        raise _refusal(path, "has two points at one place", "different places")
    normals = np.stack([values[n] for n in NORMAL_COLUMNS]) if has else np.zeros_like(points)
    if not has:
        normals[2] = 1.0
    length = np.linalg.norm(normals, axis=0)
    if np.any(length < 1e-6):
        at = int(np.argmin(length))
        raise _refusal(path, f"the normal of point {at} has no direction", "a vector that is not 0")
    shapes, hertz = values["shape"], values["frequency"]
    if np.any(hertz < 0):
        raise _refusal(path, f"frequency is {hertz.min():g} Hz", "numbers from 0")
    given = mesh["mode"].values  # 0, 1, … where the file does not number them
    if "mode" not in mesh.variables:
        given = given + 1
    elif given.dtype.kind not in "iu" or len(set(given.tolist())) < len(given):
        raise _refusal(path, "has numbers in mode that repeat or are not whole", "1, 2, …")
    numbers = given.tolist()
    if not set(modes) <= set(numbers):
        allowed = f"modes that {path} has: {one_line(', '.join(map(str, numbers)))}"
        raise ParameterError(f"plan: modes: given {list(modes)}, allowed: {allowed}")
    rows = [numbers.index(mode) for mode in modes]
    peak = np.max(np.abs(shapes[rows]), axis=1)
    if np.any(peak <= 0):
        mode = modes[int(np.argmin(peak))]
        raise _refusal(path, f"shape of mode {mode} is 0 everywhere", "a shape that moves")
    moving, shape = normals / length, shapes[rows] / peak[:, None]
    return Body(path.stem, points, moving, shape, hertz[rows], tuple(modes), np.zeros((3, 0)))


def _refusal(path: Path, problem: str, needed: str) -> MeshError:
    return MeshError(f"--structure: {path} {problem}, needed: {needed}")


def _open_table(path: Path) -> xr.Dataset:
    if not path.is_file():
        raise _refusal(path, "is a folder" if path.is_dir() else "is not there", NEEDED_FILE)
    try:
        with xr.open_dataset(path, decode_times=False, create_default_indexes=False) as file:
            ours = {*NEEDED_FIELDS, *NORMAL_COLUMNS, "mode"}
            mesh = file[[name for name in file.variables if name in ours]]
            if mesh.nbytes > storage.HELD_BYTES:
                raise _refusal(path, f"says that it holds {mesh.nbytes / 1e6:.3g} MB", MARKERS_ONLY)
            return mesh.load()
    except MeshError:
        raise
    except Exception as error:  # the netCDF and HDF libraries raise what they like
        kind = f"is not readable as netCDF ({type(error).__name__})"
        raise _refusal(path, kind, NEEDED_FILE) from None


def _values(path: Path, mesh: xr.Dataset, name: str, dims: tuple[str, ...]) -> Array:
    variable = mesh[name]
    if set(variable.dims) != set(dims):
        given = ", ".join(map(str, variable.dims))
        raise _refusal(path, f"has {name}({given})", f"{name}({', '.join(dims)})")
    if variable.dtype.kind not in "fiu":
        raise _refusal(path, f"has {name} of type {variable.dtype}", "real numbers")
    values = variable.transpose(*dims).values.astype(float)
    if not values.size:
        raise _refusal(path, f"has no value in {name}", "at least one")
    if not np.all(np.isfinite(values)):
        at = np.argwhere(~np.isfinite(values))[0].tolist()
        raise _refusal(path, f"has {values[tuple(at)]} in {name}{at}", "finite numbers")
    return values


def modes_of(structure: Structure, modes: Sequence[int]) -> xr.Dataset:
    """Return the markers and mode shapes.

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
    body, kind = body_of(structure, "", modes), type(structure).__name__
    values = *body.points, body.shapes, body.frequencies, np.array(modes)
    table = schema.read_variables(__file__, "structure")
    named = schema.label_values(dict(zip(table, values, strict=True)), table)
    numbers = {"mode": named.pop("mode")}
    data = xr.Dataset(named, numbers, {"title": "Markers and mode shapes"})
    return schema.with_origin(data, f"thesis_lib.planning.structure_file, {kind}")


def write_modes(structure: Structure, modes: Sequence[int], path: Path) -> Path:
    """Write :func:`modes_of` to a netCDF file, whole or not at all; returns the file."""
    storage.write_netcdf(modes_of(structure, modes), Path(path))
    return Path(path)
