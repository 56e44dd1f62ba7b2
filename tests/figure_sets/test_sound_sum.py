"""The sum of pistons against Rayleigh's integral by another quadrature."""

from dataclasses import replace

import numpy as np
import pytest

from thesis_lib.facts import setups
from thesis_lib.figure_sets.parametric import sound_sum
from thesis_lib.figure_sets.parametric.parameters import camera_study
from thesis_lib.vibration.structure import resonance

PLANES = {plane.name: plane for plane in camera_study("sound-distance").planes}


def integral(mode, plane, nodes=80):
    """Gauss and Legendre's quadrature of p = jωρ/2π ∫ v e^(-jkR)/R dA, 1 m/s at the antinode."""
    plate = setups.plate()
    t, weight = np.polynomial.legendre.leggauss(nodes)
    (lx, ly), omega = plate.extent, resonance(plate, mode)
    x, y = (length * (t + 1) / 2 for length in (lx, ly))
    grid = np.stack(np.meshgrid(x, y, indexing="ij")).reshape(2, -1)
    v = plate.mode_shapes([mode], grid)[0] / plate.shape_peak(mode)
    area = np.outer(weight, weight).ravel() * lx * ly / 4
    points = plane.points.reshape(3, -1)
    found = np.empty(points.shape[1], complex)
    for i, (X, Y, Z) in enumerate(points.T):
        R = np.sqrt((X - grid[0] + lx / 2) ** 2 + (Y - grid[1] + ly / 2) ** 2 + Z**2)
        found[i] = np.sum(area * v * np.exp(-1j * omega / 343 * R) / R)
    return 1j * omega * 1.21 / (2 * np.pi) * found.reshape(plane.points.shape[1:])


@pytest.mark.parametrize(("mode", "name"), [(1, "XZ"), (1, "YZ"), (2, "XZ"), (3, "YZ")])
def test_error_of_the_sum_is_that_against_the_integral(conforms, mode, name):
    plane = replace(PLANES[name], shape=(15, 10))
    few = sound_sum.field(setups.plate().grid, mode, plane)
    off = 100 * np.abs(few - integral(mode, plane)) / np.max(np.abs(few))
    mean, most = sound_sum.sum_error(mode, plane)
    conforms.independent(mean, np.sqrt(np.mean(off**2)), rtol=0.01)
    conforms.independent(most, np.max(off), rtol=0.01)


def test_nodal_planes_have_none():
    assert np.isnan(sound_sum.sum_error(2, PLANES["YZ"])).all()


def test_table_has_the_planes_with_a_reference():
    rows = [line for line in sound_sum.sums().splitlines() if line[2:3].isdigit()]
    assert [row.split("|")[1].strip() for row in rows] == ["1, XZ", "1, YZ", "2, XZ", "3, YZ"]
