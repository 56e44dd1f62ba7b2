"""How far the sum of pistons is from Rayleigh's integral, beside what cameras do to it."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np
import xarray as xr

from thesis_lib.acoustics.quadrature import enough_nodes, integral
from thesis_lib.arrays import Array, ComplexArray
from thesis_lib.vibration.structure import deflection_shape, resonance
from thesis_lib.web.markdown import table

MOST_NODES = 40_000  # planes that are so near that it takes more are left alone
ACROSS = 74  # steps between the points of a plane that are compared, or twice as many at most


def sum_errors(study: Any, fields: ComplexArray, largest: Array) -> dict[str, Array]:
    """Rms and largest error on each plane of the sum, in % of its largest pressure.

    Parameters
    ----------
    study : CameraStudy
        A sound study.
    fields : ndarray, shape (modes, planes, u, z), complex
        The sums, in Pa.
    largest : ndarray, shape (modes, planes)
        Largest pressures in Pa, NaN where a plane is nodal.

    Returns
    -------
    dict
        ``sum_error`` and ``sum_error_largest`` (modes, planes); NaN where a plane is nodal, or
        begins too near to the plate.
    """
    plate, found = study.structure, np.full((2, *largest.shape), np.nan)
    step = tuple(slice(None, None, max(1, (n - 1) // ACROSS)) for n in fields.shape[2:])
    near = np.prod(enough_nodes(plate, study.planes[0].bottom)) > MOST_NODES
    for m, (mode, peak) in enumerate(zip(study.modes, study.peaks_m, strict=True)):
        omega = resonance(plate, mode)
        shape = partial(deflection_shape, plate, mode, peak=peak)
        for p, plane in enumerate(study.planes):
            if near or np.isnan(largest[m, p]):
                continue
            points = plane.points[:, *step]
            whole = 1j * omega * integral(plate, shape, points, omega, study.medium)
            off = 100 * np.abs(fields[m, p][step] - whole) / largest[m, p]
            found[:, m, p] = np.sqrt(np.mean(off**2)), np.max(off)
    return {"sum_error": found[0], "sum_error_largest": found[1]}


def heard(cube: xr.Dataset) -> list[tuple[int, str]]:
    """Modes and planes of a sound study that have a reference pressure."""
    there = cube["independent_ratio"].notnull().transpose("mode", "plane").values
    modes, planes = cube["mode"].values.tolist(), cube["plane"].values.tolist()
    return [(modes[m], planes[p]) for m, p in np.argwhere(there)]


def sums(opened: Mapping[str, xr.Dataset]) -> str:
    """The sum's error beside those of the cameras, with the finest pixels and over all of them."""
    fine, rows = opened["sound-resolution"], []
    sharpest = fine["width_px"].values.argmax()
    for mode, plane in heard(fine):
        one = fine.sel(mode=mode, plane=plane)
        cells = (one["sum_error"], one["sum_error_largest"], one["predicted_error"][sharpest])
        every = [
            opened[f"sound-{study}"]["predicted_error"].sel(mode=mode, plane=plane).values
            for study in ("distance", "aperture", "resolution", "arrays")
        ]
        texts = [f"{float(cell):.2f}" for cell in cells]
        low, high = np.min(np.concatenate(every)), np.max(np.concatenate(every))
        rows.append([f"{mode}, {plane}", *texts, f"{low:.2f} to {high:.2f}"])
    sharp = f"of the cameras with {int(fine['width_px'].max())} px, %"
    header = ["mode, plane", "mean error of the sum, %", "at most, %", sharp, "of all cameras, %"]
    return table(header, rows)
