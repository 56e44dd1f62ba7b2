"""Measured motions as the dictionaries that Python's vibration packages hand to each other.

`SDyPy's proposal 5 <https://github.com/sdypy/sdypy/blob/main/docs/seps/sep-0005.rst>`_ says which
keys they have.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

MAX_UNEVENNESS = 1e-6  # of a step, within which times are even


def channels(motion: Path | xr.Dataset) -> list[dict[str, Any]]:
    """Return the deflections of the markers as SEP 5 dictionaries, one for each.

    Parameters
    ----------
    motion : Path or xarray.Dataset
        ``motion.nc`` of a measurement, or what is in it.

    Returns
    -------
    list of dict
        ``name``, ``data`` (times,) in ``unit_str``, which is m, ``quantity`` "d" (displacement),
        ``fs`` in Hz or, if the frames were not taken at even times, ``time`` in s;
        ``start_timestamp`` is not known. Markers that are never seen are left out.

    Examples
    --------
    >>> moved = xr.Dataset(
    ...     {"displacement": (("axis", "time", "marker"), [[[1.0], [3.0], [2.0]]])},
    ...     {"axis": ["z"], "time": [0.0, 0.5, 1.0], "marker": [1]},
    ... )
    >>> channels(moved)[0]["fs"], channels(moved)[0]["data"].tolist()
    (2.0, [0.001, 0.003, 0.002])
    """
    if isinstance(motion, Path):
        motion = xr.load_dataset(motion, engine="h5netcdf")
    times = motion["time"].values
    step = (times[-1] - times[0]) / (len(times) - 1)
    even = np.all(np.abs(np.diff(times) - step) < MAX_UNEVENNESS * step)
    clock: dict[str, Any] = {"fs": float(1 / step)} if even else {"time": times}
    deflection = motion["displacement"].sel(axis="z")
    return [
        {"name": f"marker {number} z", "data": row / 1e3, "unit_str": "m", "quantity": "d", **clock}
        for number, row in zip(
            motion["marker"].values, deflection.values.T.astype(float), strict=True
        )
        if np.isfinite(row).any()
    ]
