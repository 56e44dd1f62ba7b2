"""Estimate what a structure radiates without the rigid wall that Rayleigh's integral assumes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr

from thesis_lib.acoustics import estimates
from thesis_lib.acoustics.sources import Medium
from thesis_lib.acoustics.surfaces import Screen, Surface
from thesis_lib.arrays import Array
from thesis_lib.studies.schema import label_values, parse_variables

SCREEN_CELLS = (
    400,
    200,
)  # of the screen, and of one whose answer differs by the error: 0.1 dB or less
DECIBELS_PER_NEPER = 10 / np.log(10)
VARIABLES = parse_variables("""
    no_wall_change(tone) [dB] estimated sound power level of one side without a wall, less that in a
        rigid wall
    no_wall_change_std(tone) [dB] standard uncertainty of the estimated change without a wall, by
        markers, cells and thickness
    no_wall_below(tone) [Hz] frequency below which the structure radiates less without a wall: where
        sound is as long as the flexural waves, or as twice the narrower side
""")


def estimate_change(
    surface: Surface,
    moving: Array,
    screens: Sequence[tuple[Screen, Array]],
    omegas: Sequence[float],
    shapes: estimates.Amplitudes,
    medium: Medium,
    narrow: float,
    thickness: float,
) -> xr.Dataset:
    """Compare the power of one side without a wall with that in one, tone by tone.

    Parameters
    ----------
    surface, moving
        The structure in a wall, and how its nodes move by the markers, (nodes, markers).
    screens : sequence of (Screen, ndarray)
        The structure without a wall by finer and by coarser cells, and how these move by the
        markers, (cells, markers).
    omegas : sequence of float
        Frequencies in rad/s.
    shapes : Amplitudes
        Of the markers in m, one tone after the other.
    medium : Medium
        The air.
    narrow, thickness : float
        Of the structure in m. An ellipse of their ratio moves more air than a thin strip, by that
        ratio, all of which counts as uncertain.

    Returns
    -------
    xarray.Dataset
        :data:`VARIABLES`; NaN where cells are too coarse, or where errors are all there is.
    """
    thick = 2 * DECIBELS_PER_NEPER * np.log1p(thickness / narrow)
    rows = []
    for number, omega in enumerate(omegas):
        n = moving.shape[1]
        shape = shapes.part(np.arange(number * n, (number + 1) * n))
        wall = surface.power_form(moving, omega, medium)
        fine, coarse = (
            estimates.estimate_ratio(screen.power_form(by, omega, medium), wall, shape)
            for screen, by in screens
        )
        square = float(estimates.estimate_ratio(*surface.wavenumber_forms(moving), shape).value)
        k = max(np.sqrt(max(square, 0.0)), np.pi / narrow)
        with np.errstate(invalid="ignore", divide="ignore"):
            level, other = (DECIBELS_PER_NEPER * np.log(one.value) for one in (fine, coarse))
            noise = DECIBELS_PER_NEPER * fine.error / fine.value
            std = np.sqrt(noise**2 + (level - other) ** 2 + thick**2)
        known = level if np.isfinite(std) else np.nan
        rows.append((known, std, k * medium.speed_of_sound / (2 * np.pi)))
    return xr.Dataset(label_values(dict(zip(VARIABLES, np.array(rows).T, strict=True)), VARIABLES))
