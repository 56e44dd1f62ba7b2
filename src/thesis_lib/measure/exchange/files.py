"""Export of measurements to other programs.

Formats are MATLAB's, ParaView's grids of the markers, and modal software's universal files; for
Python, the motion as SDyPy's dictionaries.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from datetime import datetime
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
import pyuff
import scipy
import xarray as xr

from thesis_lib.arrays import Array, ArrayLike, ComplexArray, IntArray
from thesis_lib.measure.exchange import history
from thesis_lib.measure.exchange.cameras import write_cameras
from thesis_lib.measure.tracking.tracks import Recording
from thesis_lib.studies import storage
from thesis_lib.studies.cubes import complex_of, iterate_slices
from thesis_lib.templates import render

MAX_EDGE_RATIO = 2.5  # times the median edge's length; longer edges span a gap
FRAMES_PER_PERIOD = 32
CELL_TYPES = {2: 3, 3: 5, 4: 9}  # VTK's codes of line, triangle and rectangle, by corners
RESPONSE_CODE, RECEPTANCE_CODE, COHERENCE_CODE = 1, 4, 6  # UFF's function types
TRANSLATION_Z = 3  # UFF's code of a direction
SAMPLES_PER_PERIOD = 64  # of the exported time response
LINES_PER_DATASET = 40  # of a dataset 82, of which some programs read only 125 nodes
MAX_UNEVENNESS = 1e-6  # of a step, within which an abscissa counts as even


def write_formats(
    folder: Path,
    data: xr.Dataset,
    moved: xr.Dataset | None = None,
    recordings: Sequence[Recording] = (),
) -> None:
    """Write a measurement into a folder, in all formats for its kind of result.

    `data` is what ``shape_result``, ``modes_result`` or ``estimate_response`` returns; `moved` is
    what :func:`~.history.time_histories` returns for it, required for a shape; `recordings` have
    the cameras in the frame of the calibration.
    """
    if moved is not None:
        storage.write_netcdf(moved, folder / "motion.nc")
        history.write_csv(folder / "motion.csv", moved)
        # In m along Z: datasets 151, 164, 15, 82 and 58. Missing values are 0, since the format
        # cannot mark them; a marker that is never seen is left out.
        rows = (moved["displacement"].sel(axis="z").values.T / 1e3).astype(float)
        responses = _responses(_title_of(moved), moved["time"].values, rows)
        _write_sets(folder / "motion.uff", _title_of(moved), data, responses)
    if "receptance_real" in data:
        write_response(folder / "response.uff", data)
    elif "mode" in data.dims:
        write_uff(folder / "modes.uff", data)
        for k, one in enumerate(iterate_slices(data, "mode"), 1):
            write_vtk(folder / "vtk" / f"mode-{k}", one)
    elif moved is not None:
        write_uff(folder / "shapes.uff", data)
        write_matlab(folder / "measured.mat", data, moved)
        write_vtk(folder / "vtk", data)
    if recordings:
        R, origin = data["frame_rotation"].values, data["frame_origin"].values
        cameras = [  # in the structure's axes
            replace(one, R_camera_world=one.R_camera_world @ R.T, centre=R @ (one.centre - origin))
            for one in (own.camera for own in recordings)
        ]
        write_cameras(folder / "cameras.yaml", cameras)
        write_cameras(folder / "cameras.toml", cameras)


def write_matlab(path: Path, data: xr.Dataset, moved: xr.Dataset) -> None:
    """Write shapes and motion as two structures, ``shape`` in SI units and ``motion`` in mm.

    Fields have the names of ``measured.nc`` and ``motion.nc``, and dimensions in the same order;
    ``shape.amplitude`` is complex, ``units`` has the unit of every field. Texts become cells.
    """
    values: dict[str, dict[str, object]] = {}
    for what, of in (("shape", data), ("motion", moved)):
        values[what] = {
            str(name): one.values.astype(object) if one.dtype.kind in "OSU" else one.values
            for name, one in of.variables.items()
        }
        units = {str(name): str(one.attrs.get("units", "")) for name, one in of.variables.items()}
        values[what]["units"] = units
    values["shape"]["amplitude"] = complex_of(data, "amplitude")
    scipy.io.savemat(path, values, do_compression=True, long_field_names=True, oned_as="column")


# Neighbouring markers, and one period of their motion as grids for ParaView.


def marker_faces(x: ArrayLike, y: ArrayLike) -> IntArray:
    """Return the faces between markers as indices from 0, with corners in one sense of rotation.

    `x` and `y` (markers,) are in m. Faces are rectangles (faces, 4) if the markers fill a grid
    of rows and columns, else triangles (faces, 3) (Delaunay) without those that span a gap; none if
    all markers stand on one line.
    """
    points = np.column_stack([np.asarray(x, float), np.asarray(y, float)])
    # Markers closer than a micrometre along an axis stand in one row or column
    column, row = (np.unique(side.round(6), return_inverse=True)[1] for side in points.T)
    columns, rows = column.max() + 1, row.max() + 1
    if min(columns, rows) >= 2 and len(points) == columns * rows:
        place = np.full((rows, columns), -1)
        place[row, column] = np.arange(len(points))
        if (place >= 0).all():
            corners = place[:-1, :-1], place[:-1, 1:], place[1:, 1:], place[1:, :-1]
            return np.stack(corners, axis=-1).reshape(-1, 4)
    try:
        found = scipy.spatial.Delaunay(points).simplices
    except (scipy.spatial.QhullError, ValueError):  # on one line, or fewer than three
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


def write_vtk(folder: Path, data: xr.Dataset) -> None:
    """Write ``period.pvd`` and the unstructured grids ``period-00.vtu`` … that it lists.

    Points are the markers at rest, in m. ``displacement`` is a vector in m for ParaView's *Warp By
    Vector*; ``deflection``, ``amplitude`` and ``standard_error`` in m and ``phase_deg`` are scalars
    for its colours. Markers without a result are left out.
    """
    folder.mkdir(parents=True, exist_ok=True)
    amplitude = complex_of(data, "amplitude")
    known = np.isfinite(amplitude) & np.isfinite(data["rest_position"].values).all(axis=0)
    points, amplitude = data["rest_position"].values[:, known].T, amplitude[known]
    x, y = data["x"].values[known], data["y"].values[known]
    cells = faces if len(faces := marker_faces(x, y)) else marker_edges(x, y)
    count, corners = cells.shape
    grid = {
        "points": points,
        "connectivity": cells,
        "offsets": corners * np.arange(1, count + 1),
        "types": np.full(count, CELL_TYPES[corners]),
        "amplitude": np.abs(amplitude),
        "phase_deg": np.degrees(np.angle(amplitude)),
        "standard_error": data["standard_error"].values[known],
        "marker": np.flatnonzero(known) + 1.0,
    }
    fixed = {name: _join_numbers(values) for name, values in grid.items()}
    period, times = 1 / float(data["frequency"]), {}
    for k in range(FRAMES_PER_PERIOD):
        deflection = np.real(amplitude * np.exp(2j * np.pi * k / FRAMES_PER_PERIOD))
        vector = np.column_stack([np.zeros((len(points), 2)), deflection])
        moved = {"displacement": _join_numbers(vector), "deflection": _join_numbers(deflection)}
        text = render(
            __file__, "period.vtu.j2", arrays=fixed | moved, points=len(points), cells=count
        )
        name = f"period-{k:02d}.vtu"
        (folder / name).write_text(text, encoding="utf-8")
        times[name] = k / FRAMES_PER_PERIOD * period
    listed = render(__file__, "period.pvd.j2", times=times)
    (folder / "period.pvd").write_text(listed, encoding="utf-8")


def _join_numbers(values: Array | IntArray) -> str:
    """Return numbers in a row, as VTK's files have them."""
    return " ".join(format(value, ".9g") for value in values.ravel().tolist())


# The universal file format.


def write_uff(path: Path, data: xr.Dataset) -> None:
    """Write the markers and their shapes as universal datasets 151, 164, 15, 82, 55 and 58.

    Markers are nodes 1, 2, … at their places on the structure (dataset 15, SI units by 164), lines
    join neighbours (82). The complex amplitude of each mode, or of the one deflection, is dataset
    55, a shape along Z: damped modes are complex eigenvectors with their eigenvalue in 1/s, sines
    are responses at a frequency. A single deflection also has one period of the fitted motion of
    each node as a time response, dataset 58, for programs that cannot animate shapes. Markers
    without a result are left out.
    """
    name, sets = _title_of(data), list[dict[str, Any]]()
    several = "mode" in data.dims
    for k, one in enumerate(iterate_slices(data, "mode") if several else [data], 1):
        shape = complex_of(one, "amplitude")
        frequency, zeta = float(one["frequency"]), float(one.get("damping", 0))
        kind: dict[str, Any] = {"analysis_type": 5, "data_ch": 2, "freq_step_n": k,
                                "freq": frequency}  # fmt: skip
        if zeta:
            eigenvalue = 2 * np.pi * frequency * complex(-zeta, np.sqrt(1 - zeta**2))
            kind = {"analysis_type": 3, "data_ch": 2, "mode_n": k, "eig": eigenvalue,
                    "modal_a": 1 + 0j, "modal_b": 1 + 0j}  # fmt: skip
        known = np.isfinite(shape)
        along = shape[known]
        sets.append(pyuff.prepare_55(
            id1=name, model_type=1, spec_data_type=8, data_type=5, n_data_per_node=3, load_case=1,
            node_nums=np.flatnonzero(known) + 1, r1=0 * along, r2=0 * along, r3=along, **kind
        ))  # fmt: skip
    if not several:
        times = np.arange(SAMPLES_PER_PERIOD) / (SAMPLES_PER_PERIOD * frequency)
        period = np.real(shape[:, None] * np.exp(2j * np.pi * frequency * times))
        sets += _responses(name, times, period)
    _write_sets(path, name, data, sets)


def write_response(path: Path, data: xr.Dataset) -> None:
    """Write receptances by H1 and coherences of every marker: datasets 151, 164, 15, 82 and 58.

    The node after the markers is the point of the force. Functions are of type 4, motion along Z in
    m over a force along Z in N, and coherences of type 6; markers that were lost are left out.
    """
    name, f = _title_of(data), data["frequency"].values
    curves = complex_of(data, "receptance")[0]
    sets = []
    receptance = {"func_type": RECEPTANCE_CODE, "ordinate_spec_data_type": 8,
                  "ordinate_axis_units_lab": "m", "orddenom_spec_data_type": 13,
                  "orddenom_axis_units_lab": "N"}  # fmt: skip
    coherence = {"func_type": COHERENCE_CODE, "ordinate_spec_data_type": 0,
                 "ordinate_axis_units_lab": "", "orddenom_spec_data_type": 0,
                 "orddenom_axis_units_lab": ""}  # fmt: skip
    for k in np.flatnonzero(np.isfinite(curves).all(axis=1)):
        for kind, row in ((receptance, curves[k]), (coherence, data["coherence"].values[k])):
            sets.append(
                _function_set(
                    name, int(k) + 1, f, row, abscissa_spec_data_type=18, ref_dir=TRANSLATION_Z,
                    abscissa_axis_units_lab="Hz", ref_node=len(curves) + 1, **kind
                )
            )  # fmt: skip
    place, markers = data["force_place"].values, np.stack([data["x"].values, data["y"].values])
    x, y = np.c_[markers, place]  # the force's point is the last node
    places = np.c_[data["rest_position"].values, np.full(3, np.nan)]
    nodes = {"x": ("node", x), "y": ("node", y), "rest_position": (("axis", "node"), places)}
    _write_sets(path, name, xr.Dataset(nodes, attrs=data.attrs), sets)


def _title_of(data: xr.Dataset) -> str:
    return str(data.attrs.get("title", "deflection"))[:80]


def _write_sets(path: Path, name: str, data: xr.Dataset, results: Iterable[dict[str, Any]]) -> None:
    """Write a new file: header, units, nodes in ``data`` and the lines between, then results.

    Nodes not seen at rest are at their nominal positions, shifted by the mean offset of the others.
    """
    places, flat = data["rest_position"].values, np.stack([data["x"].values, data["y"].values])
    seen = np.isfinite(places).all(axis=0)
    shift = np.mean(places[:2, seen] - flat[:, seen], axis=1)  # of the origin, to the centre
    nominal = np.r_[flat + shift[:, None], np.zeros((1, len(seen)))]
    x, y, z = np.where(seen, places, nominal)
    nodes = np.arange(1, len(x) + 1)
    when = datetime.fromisoformat(str(data.attrs.get("created", "1970-01-01T00:00:00")))
    date, time = f"{when:%d-%b-%y}", f"{when:%H:%M:%S}"
    header = pyuff.prepare_151(
        model_name=name, description=name, db_app="thesis_lib", program="thesis_lib",
        date_db_created=date, time_db_created=time, date_db_saved=date, time_db_saved=time,
    ) | {"date_file_written": date, "time_file_written": time}  # fmt: skip
    units = pyuff.prepare_164(
        units_code=1, units_description="SI: m, N, s", temp_mode=1, length=1.0, force=1.0,
        temp=1.0, temp_offset=0.0)  # fmt: skip
    points = pyuff.prepare_15(
        node_nums=nodes, def_cs=0 * nodes, disp_cs=0 * nodes, color=0 * nodes + 1, x=x, y=y, z=z
    )
    sets = [header, units, points]
    pairs = marker_edges(data["x"].values, data["y"].values) + 1
    for k, start in enumerate(range(0, len(pairs), LINES_PER_DATASET)):
        part = pairs[start : start + LINES_PER_DATASET]
        pen = np.column_stack([np.zeros(len(part), int), part]).ravel()[1:]  # 0 lifts the pen
        trace = {"trace_num": k + 1, "n_nodes": len(pen), "nodes": pen}
        sets.append(pyuff.prepare_82(**trace, color=1, id="neighbouring markers"))
    file = pyuff.UFF(str(path))
    for k, one in enumerate(chain(sets, results)):
        file.write_sets(one, "add" if k else "overwrite")


def _responses(name: str, times: Array, rows: Array) -> Iterator[dict[str, Any]]:
    """Yield the time response along Z of every marker ever seen, in m; 0 where it is missing."""
    for k in np.flatnonzero(np.isfinite(rows).any(axis=1)):
        row = np.nan_to_num(rows[k])
        yield _function_set(
            name, int(k) + 1, times, row, func_type=RESPONSE_CODE, ref_node=0, ref_dir=0,
            abscissa_spec_data_type=17, abscissa_axis_units_lab="s", ordinate_spec_data_type=8,
            ordinate_axis_units_lab="m", orddenom_spec_data_type=0)  # fmt: skip


def _function_set(
    name: str, node: int, x: Array, row: Array | ComplexArray, **kind: Any
) -> dict[str, Any]:
    """Return a dataset 58 of a node along Z; an uneven abscissa is written value by value."""
    step = _even_step(x)
    made: dict[str, Any] = pyuff.prepare_58(
        binary=0, id1=name, rsp_node=node, rsp_dir=TRANSLATION_Z, abscissa_spacing=int(step > 0),
        abscissa_min=float(x[0]), abscissa_inc=step, z_axis_spec_data_type=0,
        data=row, x=x, **kind)  # fmt: skip
    return made


def _even_step(x: Array) -> float:
    """Return the step of evenly spaced times or frequencies; 0 if they are uneven."""
    step = float(x[-1] - x[0]) / (len(x) - 1)
    return step if np.all(np.abs(np.diff(x) - step) < MAX_UNEVENNESS * step) else 0.0


def sep005_channels(motion: Path | xr.Dataset) -> list[dict[str, Any]]:
    """Return the deflections of the markers as SEP 5 dictionaries, one for each.

    Python's vibration packages exchange these; `SDyPy's proposal 5
    <https://github.com/sdypy/sdypy/blob/main/docs/seps/sep-0005.rst>`_ defines their keys:
    ``name``, ``data`` (times,) in ``unit_str``, which is m, ``quantity`` "d" (displacement), ``fs``
    in Hz or, if the frames are not evenly spaced, ``time`` in s. Markers that are never seen
    are left out. `motion` is ``motion.nc`` of a measurement, or its dataset.

    Examples
    --------
    >>> moved = xr.Dataset(
    ...     {"displacement": (("axis", "time", "marker"), [[[1.0], [3.0], [2.0]]])},
    ...     {"axis": ["z"], "time": [0.0, 0.5, 1.0], "marker": [1]},
    ... )
    >>> (channel,) = sep005_channels(moved)
    >>> channel["fs"], channel["data"].tolist()
    (2.0, [0.001, 0.003, 0.002])
    """
    if isinstance(motion, Path):
        motion = xr.load_dataset(motion, engine="h5netcdf")
    times = motion["time"].values
    step = _even_step(times)
    clock: dict[str, Any] = {"fs": 1 / step} if step else {"time": times}
    rows = motion["displacement"].sel(axis="z").values.T.astype(float)
    return [
        {"name": f"marker {number} z", "data": row / 1e3, "unit_str": "m", "quantity": "d", **clock}
        for number, row in zip(motion["marker"].values, rows, strict=True)
        if np.isfinite(row).any()
    ]
