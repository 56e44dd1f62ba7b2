"""How far the sum of pistons is from Rayleigh's integral, for a plate's own modes.

Pistons at the middles of cells are a midpoint rule: its error falls with the square of their size,
so that two finer sums tell where it leads to.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from thesis_lib.acoustics import planes
from thesis_lib.acoustics.planes import Plane
from thesis_lib.acoustics.radiation import rayleigh
from thesis_lib.arrays import ComplexArray
from thesis_lib.facts import setups
from thesis_lib.figure_sets.parametric.parameters import camera_study
from thesis_lib.vibration.structure import resonance
from thesis_lib.web.markdown import table

FINER = (60, 40), (90, 60)  # pistons along and across, of the two finer sums
POINTS = (75, 50)  # of a plane
NODAL = 1e-6  # Pa, below which a plane has no pressure


def field(grid: tuple[int, int], mode: int, plane: Plane) -> ComplexArray:
    """Pressure on a plane of one mode by a grid of pistons, in Pa for 1 m/s at the antinode."""
    plate = setups.plate(grid)
    shape = plate.mode_shapes([mode], plate.markers)[0] / plate.shape_peak(mode)
    omega = resonance(setups.plate(), mode)
    return np.asarray(rayleigh(planes.pistons(plate), shape, plane.points, omega))


def sum_error(mode: int, plane: Plane) -> tuple[float, float]:
    """Rms and largest error on a plane of the sum of 150 pistons, in % of its largest pressure.

    NaN if the plane is nodal.
    """
    few, more, many = (field(grid, mode, plane) for grid in (setups.plate().grid, *FINER))
    ratio = FINER[1][0] / FINER[0][0]
    integral = many + (many - more) / (ratio**2 - 1)
    largest = np.max(np.abs(few))
    if largest < NODAL:
        return float("nan"), float("nan")
    off = 100 * np.abs(few - integral) / largest
    return float(np.sqrt(np.mean(off**2))), float(np.max(off))


def sums() -> str:
    """The same for modes 1 to 3 on both planes of chapter 6, as a table."""
    rows = []
    for mode in (1, 2, 3):
        for plane in camera_study("sound-distance").planes:  # type: ignore[attr-defined]
            mean, most = sum_error(mode, replace(plane, shape=POINTS))
            if np.isfinite(mean):
                rows.append([f"{mode}, {plane.name}", f"{mean:.2f}", f"{most:.2f}"])
    return table(["mode, plane", "mean error of the sum, %", "at most, %"], rows)
