"""One period of the fitted motion for ParaView: a file for each instant and a list of them."""

from __future__ import annotations

from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np
import xarray as xr

from thesis_lib.arrays import Array, IntArray
from thesis_lib.measure.exchange.mesh import marker_edges, marker_faces

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
