"""Measured shapes in the universal file format, for modal software."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyuff
import xarray as xr

RESPONSE, TRANSLATION_Z = 1, 3  # UFF's numbers of a time response and of a direction
SAMPLES = 64  # of the period that is written


def write(path: Path, data: xr.Dataset) -> None:
    """Write the markers and their motion as universal datasets 164, 15, 55 and 58.

    Markers are nodes 1, 2, … at their places on the structure (dataset 15, SI units by 164). The
    complex amplitude of the deflection at the frequency of the vibration is dataset 55, a shape
    along Z; and once more, node by node, one period of the fitted motion as a time response,
    dataset 58, which programs animate that know no shapes. Markers without a result are left out
    of both.

    Parameters
    ----------
    path : Path
        The file; it is overwritten.
    data : xarray.Dataset
        What :func:`~thesis_lib.measure.fitting.result.result` returns.
    """
    frequency = float(data["frequency"])
    amplitude = data["amplitude_real"].values + 1j * data["amplitude_imag"].values
    nodes = np.arange(1, len(amplitude) + 1)
    known = np.isfinite(amplitude)
    file = pyuff.UFF(str(path))
    name = str(data.attrs.get("title", "deflection"))[:80]
    places = data["rest_position"].values
    x, y, z = np.where(np.isfinite(places), places, 0.0)
    file.write_sets(pyuff.prepare_164(
        units_code=1, units_description="SI: m, N, s", temp_mode=1, length=1.0, force=1.0,
        temp=1.0, temp_offset=0.0), "overwrite")  # fmt: skip
    file.write_sets(pyuff.prepare_15(
        node_nums=nodes, def_cs=0 * nodes, disp_cs=0 * nodes, color=0 * nodes + 1, x=x, y=y, z=z),
        "add")  # fmt: skip
    shape = amplitude[known]
    file.write_sets(pyuff.prepare_55(
        id1=name, model_type=1, analysis_type=5, data_ch=2, spec_data_type=8, data_type=5,
        n_data_per_node=3, load_case=1, freq_step_n=1, freq=frequency, node_nums=nodes[known],
        r1=0 * shape, r2=0 * shape, r3=shape), "add")  # fmt: skip
    times = np.arange(SAMPLES) / (SAMPLES * frequency)
    turning = np.exp(2j * np.pi * frequency * times)
    for node, value in zip(nodes[known], shape, strict=True):
        file.write_sets(pyuff.prepare_58(
            binary=0, id1=name, func_type=RESPONSE, rsp_node=int(node), rsp_dir=TRANSLATION_Z,
            ref_node=0, ref_dir=0, abscissa_spacing=1, abscissa_min=0.0,
            abscissa_inc=float(times[1]), abscissa_spec_data_type=17, ordinate_spec_data_type=8,
            ordinate_axis_units_lab="m", abscissa_axis_units_lab="s",
            orddenom_spec_data_type=0, z_axis_spec_data_type=0,
            data=np.real(value * turning), x=times), "add")  # fmt: skip
