"""A structure from a file: markers with normals, mode shapes and frequencies, as netCDF.

The page *The planner* lists its variables, with dimensions ``point`` and ``mode`` as xarray writes
them. Other variables are ignored. The peak of a mode is its largest deflection in the file.
"""

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np
import xarray as xr

from thesis_lib.arrays import Array
from thesis_lib.planning.positions import Body, build_body
from thesis_lib.studies import request, schema, storage
from thesis_lib.text import has_hidden, one_line
from thesis_lib.vibration.structure import Structure

NEEDED_FIELDS = dict.fromkeys("xyz", ("point",)) | {
    "shape": ("mode", "point"),
    "frequency": ("mode",),
}
NORMAL_COLUMNS = ("nx", "ny", "nz")
MAX_POINTS = 1000
MAX_SIZE_M = 100.0  # the largest distance of cameras
MARKERS_ONLY = "the markers, not all nodes of a mesh"
NEEDED_FILE = "a netCDF file with x, y, z, shape and frequency"


class StructureFileError(request.ParameterError):
    """An invalid structure file; the message is one line."""


def read_body(path: Path, modes: Sequence[int]) -> Body:
    """Read the structure in a file, with the requested modes.

    Raises
    ------
    StructureFileError
        With one line that names the file and what it needs.
    """
    if has_hidden(path.name):  # the plan is named after it
        raise StructureFileError(f"--structure: given {path.name!r}, allowed: a visible name")
    mesh = _open_table(path)
    has_normals = any(name in mesh.variables for name in NORMAL_COLUMNS)
    fields = NEEDED_FIELDS | (dict.fromkeys(NORMAL_COLUMNS, ("point",)) if has_normals else {})
    values = {name: _values(path, mesh, name, dims) for name, dims in fields.items()}
    points = np.stack([values["x"], values["y"], values["z"]])
    normals = np.array([values.get(name, 0 * points[0]) for name in NORMAL_COLUMNS])
    if not has_normals:
        normals[2] = 1.0
    length = np.linalg.norm(normals, axis=0)
    shapes, hertz = values["shape"], values["frequency"]
    given = mesh["mode"].values
    if "mode" not in mesh.variables:  # then xarray counts 0, 1, …
        given = given + 1
    for is_wrong, needed in (
        (points.shape[1] > MAX_POINTS, f"at most {MAX_POINTS} points: {MARKERS_ONLY}"),
        (np.max(np.abs(points)) > MAX_SIZE_M, f"coordinates up to {MAX_SIZE_M:g} m, not in mm"),
        (len(np.unique(points, axis=1).T) < points.shape[1], "points at different places"),
        (np.any(length < 1e-6), "normals that are not 0"),
        (np.any(hertz < 0), f"frequencies from 0, not {hertz.min():g} Hz"),
        (given.dtype.kind not in "iu" or len(np.unique(given)) < len(given), "modes 1, 2, …"),
    ):
        if is_wrong:
            raise _refusal(path, needed)
    numbers = given.tolist()
    if not set(modes) <= set(numbers):
        allowed = f"modes that {path} has: {one_line(', '.join(map(str, numbers)))}"
        raise request.ParameterError(f"plan: modes: given {list(modes)}, allowed: {allowed}")
    rows = [numbers.index(mode) for mode in modes]
    peak = np.max(np.abs(shapes[rows]), axis=1)
    if np.any(peak <= 0):
        raise _refusal(path, f"a shape of mode {modes[int(np.argmin(peak))]} that is not 0")
    moving, shape = normals / length, shapes[rows] / peak[:, None]
    return Body(path.stem, points, moving, shape, hertz[rows], tuple(modes), np.zeros((3, 0)))


def _refusal(path: Path, needed: str) -> StructureFileError:
    return StructureFileError(f"--structure: given {path}, needed: {needed}")


def _open_table(path: Path) -> xr.Dataset:
    if not path.is_file():  # xarray opens folders and addresses, too
        kind = "this is a folder, not a file" if path.is_dir() else "there is no such file"
        raise _refusal(path, f"{NEEDED_FILE}; {kind}")
    try:
        with xr.open_dataset(path, decode_times=False, create_default_indexes=False) as file:
            ours = {*NEEDED_FIELDS, *NORMAL_COLUMNS, "mode"}
            mesh = file[[name for name in file.variables if name in ours]]
            if mesh.nbytes > storage.MAX_UNCHECKED_BYTES:
                raise _refusal(path, f"not {mesh.nbytes / 1e6:.3g} MB, but {MARKERS_ONLY}")
            return mesh.load()
    except StructureFileError:
        raise
    except Exception as error:  # the netCDF and HDF libraries raise many types
        raise _refusal(path, f"{NEEDED_FILE} ({type(error).__name__})") from None


def _values(path: Path, mesh: xr.Dataset, name: str, dims: tuple[str, ...]) -> Array:
    values = np.array([])
    with suppress(KeyError, ValueError):  # missing, or of other dimensions
        if mesh[name].dtype.kind in "fiu":
            values = mesh[name].transpose(*dims).values.astype(float)
    if not (values.size and np.all(np.isfinite(values))):
        raise _refusal(path, f"{name}({', '.join(dims)}) of finite numbers, at least one")
    return values


def export_modes(structure: Structure, modes: Sequence[int]) -> xr.Dataset:
    """Return the markers and mode shapes of a structure.

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
    body, kind = build_body(structure, "", modes), type(structure).__name__
    values = *body.points, body.shapes, body.frequencies, np.array(modes)
    table = schema.read_variables(__file__, "structure")
    named = schema.label_values(dict(zip(table, values, strict=True)), table)
    numbers = {"mode": named.pop("mode")}
    data = xr.Dataset(named, numbers, {"title": "Markers and mode shapes"})
    return schema.with_origin(data, f"thesis_lib.planning.structure_file, {kind}")


def write_modes(structure: Structure, modes: Sequence[int], path: Path) -> Path:
    """Write :func:`export_modes` to a netCDF file, atomically, and return its path."""
    storage.write_netcdf(export_modes(structure, modes), Path(path))
    return Path(path)
