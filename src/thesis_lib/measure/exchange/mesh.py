"""Which markers are neighbours, and one period of their motion as grids for ParaView."""

from __future__ import annotations

from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike
from scipy.spatial import Delaunay, QhullError

from thesis_lib.arrays import Array, IntArray

MAX_ROW_OFFSET_M = 1e-6  # m; markers closer than this along an axis stand in one row or column
MAX_EDGE_RATIO = 2.5  # times the middle edge's length, beyond which an edge spans a gap


def marker_faces(x: ArrayLike, y: ArrayLike) -> IntArray:
    """Return the faces between markers, counted from 0, with corners in one sense of rotation.

    Parameters
    ----------
    x, y : array_like, shape (markers,)
        Places in m.

    Returns
    -------
    ndarray of int, shape (faces, 4) or (faces, 3)
        Rectangles if the markers fill a grid of rows and columns, else triangles (Delaunay) without
        those that span a gap; none if all markers stand on one line.
    """
    points = np.column_stack([np.asarray(x, float), np.asarray(y, float)])
    column, row = (_classes(values) for values in points.T)
    columns, rows = column.max() + 1, row.max() + 1
    if min(columns, rows) >= 2 and len(points) == columns * rows:
        place = np.full((rows, columns), -1)
        place[row, column] = np.arange(len(points))
        if (place >= 0).all():
            corners = place[:-1, :-1], place[:-1, 1:], place[1:, 1:], place[1:, :-1]
            return np.stack(corners, axis=-1).reshape(-1, 4)
    try:
        found = Delaunay(points).simplices
    except (QhullError, ValueError):  # on one line, or fewer than three
        return np.empty((0, 3), int)
    sides = np.linalg.norm(points[found] - points[np.roll(found, 1, axis=1)], axis=2)
    return np.asarray(found[sides.max(axis=1) <= MAX_EDGE_RATIO * np.median(sides)], int)


def marker_edges(x: ArrayLike, y: ArrayLike) -> IntArray:
    """Return lines between neighbours, (lines, 2), each once; along the row if all stand in one."""
    corners = marker_faces(x, y)
    if not len(corners):
        order = np.lexsort((np.asarray(y, float), np.asarray(x, float)))
        return np.column_stack([order[:-1], order[1:]])
    pairs = np.stack([corners, np.roll(corners, -1, axis=1)], axis=-1).reshape(-1, 2)
    return np.unique(np.sort(pairs, axis=1), axis=0)


def _classes(values: Array) -> IntArray:
    """Return the numbers of values in ascending order; those that are as good as equal have one."""
    order = np.argsort(values)
    number = np.empty(len(values), int)
    number[order] = np.concatenate([[0], np.cumsum(np.diff(values[order]) > MAX_ROW_OFFSET_M)])
    return number


FRAMES_PER_PERIOD = 32  # of a period
CELL_TYPES = {2: 3, 3: 5, 4: 9}  # VTK's numbers of a line, a triangle and a rectangle, by corners


def write_vtk(folder: Path, data: xr.Dataset) -> None:
    """Write ``period.pvd`` and the unstructured grids ``period-00.vtu`` … that it lists.

    Points are the markers at rest, in m. ``displacement`` is a vector in m for ParaView's *Warp By
    Vector*; ``deflection``, ``amplitude`` and ``standard_error`` in m and ``phase_deg`` are numbers
    for its colours. Markers without a result are left out.

    Parameters
    ----------
    folder : Path
        Folder to write into.
    data : xarray.Dataset
        What :func:`~thesis_lib.measure.fitting.result.shape_result` returns.
    """
    amplitude = data["amplitude_real"].values + 1j * data["amplitude_imag"].values
    known = np.isfinite(amplitude) & np.isfinite(data["rest_position"].values).all(axis=0)
    points, amplitude = data["rest_position"].values[:, known].T, amplitude[known]
    x, y = data["x"].values[known], data["y"].values[known]
    cells = marker_faces(x, y) if len(marker_faces(x, y)) else marker_edges(x, y)
    fixed = {
        "amplitude": np.abs(amplitude),
        "phase_deg": np.degrees(np.angle(amplitude)),
        "standard_error": data["standard_error"].values[known],
        "marker": np.flatnonzero(known) + 1.0,
    }
    period, rows = 1 / float(data["frequency"]), []
    for k in range(FRAMES_PER_PERIOD):
        deflection = np.real(amplitude * np.exp(2j * np.pi * k / FRAMES_PER_PERIOD))
        vector = np.column_stack([np.zeros((len(points), 2)), deflection])
        values = {"displacement": vector, "deflection": deflection} | fixed
        name = f"period-{k:02d}.vtu"
        (folder / name).write_text(_grid(points, cells, values), encoding="utf-8")
        time = f"{k / FRAMES_PER_PERIOD * period:.9g}"
        rows.append(f'<DataSet timestep="{time}" group="" part="0" file="{name}"/>')
    listed = _file("Collection", "<Collection>\n" + "\n".join(rows) + "\n</Collection>")
    (folder / "period.pvd").write_text(listed, encoding="utf-8")


def _grid(points: Array, cells: IntArray, values: dict[str, Array]) -> str:
    """Return an unstructured grid as text."""
    count, corners = cells.shape
    arrays = [_array("connectivity", cells), _array("offsets", corners * np.arange(1, count + 1))]
    arrays.append(_array("types", np.full(count, CELL_TYPES[corners])))
    return _file(
        "UnstructuredGrid",
        f'<UnstructuredGrid>\n<Piece NumberOfPoints="{len(points)}" NumberOfCells="{count}">\n'
        f"<Points>\n{_array('points', points)}\n</Points>\n"
        "<Cells>\n" + "\n".join(arrays) + "\n</Cells>\n"
        '<PointData Scalars="deflection" Vectors="displacement">\n'
        + "\n".join(_array(name, each) for name, each in values.items())
        + "\n</PointData>\n</Piece>\n</UnstructuredGrid>",
    )


def _array(name: str, values: Array | IntArray) -> str:
    whole = values.dtype.kind == "i"
    kind, form = ("Int64", "d") if whole else ("Float64", ".9g")
    wide = f' NumberOfComponents="{values.shape[1]}"' if values.ndim == 2 and not whole else ""
    text = " ".join(format(value, form) for value in values.ravel())
    return (
        f'<DataArray type="{kind}" Name={quoteattr(name)}{wide} format="ascii">{text}</DataArray>'
    )


def _file(kind: str, inner: str) -> str:
    return (
        f'<?xml version="1.0"?>\n<VTKFile type="{kind}" version="1.0" '
        f'byte_order="LittleEndian" header_type="UInt64">\n{inner}\n</VTKFile>\n'
    )
