"""Measured shapes and motions in the universal file format, for modal software."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import pyuff
import xarray as xr

from thesis_lib.arrays import Array, ComplexArray, IntArray
from thesis_lib.measure.exchange.mesh import marker_edges

RESPONSE_CODE, RECEPTANCE_CODE, COHERENCE_CODE = 1, 4, 6  # UFF's numbers of functions
TRANSLATION_Z = 3  # and of a direction
SAMPLES_PER_PERIOD = 64  # of the period that is written
LINES_PER_DATASET = 40  # in one dataset 82, which some programs read to its 125th node only
MAX_UNEVENNESS = 1e-6  # of a step, within which times or frequencies are even


def write_uff(path: Path, data: xr.Dataset) -> None:
    """Write the markers and their motion as universal datasets 151, 164, 15, 82, 55 and 58.

    Markers are nodes 1, 2, … at their places on the structure (dataset 15, SI units by 164), lines
    join neighbours (82). The complex amplitude of the deflection at the frequency of the vibration
    is dataset 55, a shape along Z; and once more, node by node, one period of the fitted motion as
    a time response, dataset 58, which programs animate that know no shapes. Markers without a
    result are left out of both.

    Parameters
    ----------
    path : Path
        The file; it is overwritten.
    data : xarray.Dataset
        What :func:`~thesis_lib.measure.fitting.result.shape_result` returns.
    """
    frequency = float(data["frequency"])
    amplitude = data["amplitude_real"].values + 1j * data["amplitude_imag"].values
    nodes = np.arange(1, len(amplitude) + 1)
    known = np.isfinite(amplitude)
    name = _name(data)
    shape = amplitude[known]
    mode = _shape(name, amplitude, analysis_type=5, data_ch=2, freq_step_n=1, freq=frequency)
    times = np.arange(SAMPLES_PER_PERIOD) / (SAMPLES_PER_PERIOD * frequency)
    period = np.real(shape[:, None] * np.exp(2j * np.pi * frequency * times))
    responses = _responses(name, nodes[known], times, period)
    _write(path, [*_geometry(name, data), mode, *responses])


def write_modes(path: Path, data: xr.Dataset) -> None:
    """Write the markers and several modes: datasets 151, 164, 15, 82 and, for each, 55.

    Damped modes are complex eigenvectors with their eigenvalue in 1/s, steady tones are responses
    at a frequency. Markers without a result are left out.

    Parameters
    ----------
    path : Path
        The file; it is overwritten.
    data : xarray.Dataset
        What :func:`~thesis_lib.measure.modes.identify.modes_result` returns.
    """
    name, sets = _name(data), []
    for k in range(data.sizes["mode"]):
        one = data.isel(mode=k)
        shape = one["amplitude_real"].values + 1j * one["amplitude_imag"].values
        frequency, zeta = float(one["frequency"]), float(one["damping"])
        kind: dict[str, Any] = {"analysis_type": 5, "data_ch": 2, "freq_step_n": k + 1,
                                "freq": frequency}  # fmt: skip
        if zeta:
            eigenvalue = 2 * np.pi * frequency * complex(-zeta, np.sqrt(1 - zeta**2))
            kind = {"analysis_type": 3, "data_ch": 3, "mode_n": k + 1, "eig": eigenvalue,
                    "modal_a": 1 + 0j, "modal_b": 1 + 0j}  # fmt: skip
        sets.append(_shape(name, shape, **kind))
    _write(path, [*_geometry(name, data), *sets])


def _shape(name: str, amplitude: ComplexArray, **kind: Any) -> Any:
    """Return a dataset 55 of deflections along Z of the markers that have one."""
    known = np.isfinite(amplitude)
    shape = amplitude[known]
    return pyuff.prepare_55(
        id1=name, model_type=1, spec_data_type=8, data_type=5, n_data_per_node=3, load_case=1,
        node_nums=np.flatnonzero(known) + 1, r1=0 * shape, r2=0 * shape, r3=shape, **kind
    )  # fmt: skip


def write_motion(path: Path, data: xr.Dataset, moved: xr.Dataset) -> None:
    """Write the measured time history of every marker: datasets 151, 164, 15, 82 and 58.

    Parameters
    ----------
    path : Path
        The file; it is overwritten.
    data : xarray.Dataset
        As for :func:`write_uff`.
    moved : xarray.Dataset
        What :func:`~thesis_lib.measure.exchange.history.time_histories` returns. Deflections along
        Z are written, in m; 0 stands for what is missing, since the format has no sign for that,
        and a marker that is never seen is left out.
    """
    deflection = moved["displacement"].sel(axis="z").values.T / 1e3
    seen = np.isfinite(deflection).any(axis=1)
    nodes = np.flatnonzero(seen) + 1
    name = _name(moved)
    rows = np.nan_to_num(deflection[seen].astype(float))
    responses = _responses(name, nodes, moved["time"].values, rows)
    _write(path, [*_geometry(name, data), *responses])


def write_response(path: Path, data: xr.Dataset) -> None:
    """Write receptances by H1 and coherences of every marker: datasets 151, 164, 15, 82 and 58.

    The node after the markers' is where the force acts. Functions are of type 4, motion along Z in
    m over a force along Z in N, and coherences of type 6; markers that were lost are left out.

    Parameters
    ----------
    path : Path
        The file; it is overwritten.
    data : xarray.Dataset
        What :func:`~thesis_lib.measure.response.result.estimate_response` returns.
    """
    name, f = _name(data), data["frequency"].values
    curves = data["receptance_real"].values[0] + 1j * data["receptance_imag"].values[0]
    sets = [*_geometry(name, _with_force(data))]
    receptance = {"func_type": RECEPTANCE_CODE, "ordinate_spec_data_type": 8,
                  "ordinate_axis_units_lab": "m", "orddenom_spec_data_type": 13,
                  "orddenom_axis_units_lab": "N"}  # fmt: skip
    coherence = {"func_type": COHERENCE_CODE, "ordinate_spec_data_type": 0,
                 "ordinate_axis_units_lab": "", "orddenom_spec_data_type": 0,
                 "orddenom_axis_units_lab": ""}  # fmt: skip
    for k in np.flatnonzero(np.isfinite(curves).all(axis=1)):
        for kind, row in ((receptance, curves[k]), (coherence, data["coherence"].values[k])):
            sets.append(
                _function(
                    name, int(k) + 1, f, row, abscissa_spec_data_type=18, ref_dir=TRANSLATION_Z,
                    abscissa_axis_units_lab="Hz", ref_node=len(curves) + 1, **kind
                )
            )  # fmt: skip
    _write(path, sets)


def _with_force(data: xr.Dataset) -> xr.Dataset:
    """Return the markers with the force's point after them."""
    x, y = data["force_place"].values
    middle = np.array([data["x"].values.mean(), data["y"].values.mean()])
    shift = np.nanmean(data["rest_position"].values[:2], axis=1) - middle
    point = np.array([x + shift[0], y + shift[1], 0.0])
    values = {
        "x": ("node", np.append(data["x"].values, x)),
        "y": ("node", np.append(data["y"].values, y)),
        "rest_position": (("axis", "node"), np.c_[data["rest_position"].values, point]),
    }
    return xr.Dataset(values, attrs=data.attrs)


def _name(data: xr.Dataset) -> str:
    return str(data.attrs.get("title", "deflection"))[:80]


def _write(path: Path, sets: Iterable[dict[str, Any]]) -> None:
    file = pyuff.UFF(str(path))
    for k, one in enumerate(sets):
        file.write_sets(one, "add" if k else "overwrite")


def _geometry(name: str, data: xr.Dataset) -> Iterator[dict[str, Any]]:
    """Yield the header, units, nodes and the lines between them."""
    places = data["rest_position"].values
    x, y, z = np.where(np.isfinite(places), places, 0.0)
    nodes = np.arange(1, len(x) + 1)
    when = datetime.fromisoformat(str(data.attrs.get("created", "1970-01-01T00:00:00")))
    date, time = f"{when:%d-%b-%y}", f"{when:%H:%M:%S}"
    yield pyuff.prepare_151(
        model_name=name, description=name, db_app="thesis_lib", program="thesis_lib",
        date_db_created=date, time_db_created=time, date_db_saved=date, time_db_saved=time,
    ) | {"date_file_written": date, "time_file_written": time}  # fmt: skip
    yield pyuff.prepare_164(
        units_code=1, units_description="SI: m, N, s", temp_mode=1, length=1.0, force=1.0,
        temp=1.0, temp_offset=0.0)  # fmt: skip
    yield pyuff.prepare_15(
        node_nums=nodes, def_cs=0 * nodes, disp_cs=0 * nodes, color=0 * nodes + 1, x=x, y=y, z=z
    )
    pairs = marker_edges(data["x"].values, data["y"].values) + 1
    for k, start in enumerate(range(0, len(pairs), LINES_PER_DATASET)):
        part = pairs[start : start + LINES_PER_DATASET]
        pen = np.column_stack([np.zeros(len(part), int), part]).ravel()[1:]  # 0 lifts it
        yield pyuff.prepare_82(
            trace_num=k + 1, n_nodes=len(pen), color=1, id="neighbouring markers", nodes=pen
        )


def _responses(name: str, nodes: IntArray, times: Array, rows: Array) -> Iterator[dict[str, Any]]:
    """Yield a time response along Z of every node, in m."""
    for node, row in zip(nodes, rows, strict=True):
        yield _function(
            name, int(node), times, row, func_type=RESPONSE_CODE, ref_node=0, ref_dir=0,
            abscissa_spec_data_type=17, abscissa_axis_units_lab="s", ordinate_spec_data_type=8,
            ordinate_axis_units_lab="m", orddenom_spec_data_type=0)  # fmt: skip


def _function(
    name: str, node: int, x: Array, row: Array | ComplexArray, **kind: Any
) -> dict[str, Any]:
    """Return a dataset 58 of a node along Z; an uneven abscissa is written value by value."""
    step = float(x[-1] - x[0]) / (len(x) - 1)
    even = bool(np.all(np.abs(np.diff(x) - step) < MAX_UNEVENNESS * step))
    made: dict[str, Any] = pyuff.prepare_58(
        binary=0, id1=name, rsp_node=node, rsp_dir=TRANSLATION_Z, abscissa_spacing=int(even),
        abscissa_min=float(x[0]), abscissa_inc=step if even else 0.0, z_axis_spec_data_type=0,
        data=row, x=x, **kind)  # fmt: skip
    return made
