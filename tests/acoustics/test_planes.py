"""The two planes: folded operator against Rayleigh's integral, its rms, symmetries and nodes."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest

from thesis_lib.acoustics.planes import Plane, full_factor, plane_operator, plate_pistons
from thesis_lib.acoustics.radiation import Medium, rayleigh_pressure, transfer_pressure
from thesis_lib.facts import setups
from thesis_lib.figure_sets.registry import validate_request
from thesis_lib.vibration.structure import deflection_shape, resonance_frequency

NAMES = ["XZ", "YZ"]
PLATE = setups.thesis_plate()
EPS = np.finfo(float).eps


def plane_of(name, shape=(149, 99)):
    return Plane(name, 0.334, 0.0445, 0.443, shape)


# Points.


def test_points_of_the_planes_are_those_of_the_reading(conforms):
    study = validate_request("sound-distance", {})
    assert study.planes == (plane_of("XZ"), plane_of("YZ"))
    for plane in study.planes:
        x, y, z = plane.points
        assert x.shape == (149, 99)
        along, aside = (x, y) if plane.name == "XZ" else (y, x)
        assert not np.any(aside)
        np.testing.assert_array_equal(along[:, 0], plane.u)
        np.testing.assert_array_equal(z[0], plane.z)
        assert (plane.u[0], plane.u[-1]) == (-0.334, 0.334)
        assert (plane.z[0], plane.z[-1]) == (0.0445, 0.443)
        conforms.invariance(plane.u, -plane.u[::-1], atol=1e-15)
        conforms.closed_form(np.diff(plane.u), 0.668 / 148, rtol=1e-12)


def test_pistons_are_the_plates_cells_about_its_centre(conforms):
    parts = plate_pistons(PLATE)
    assert parts.size == (0.668 / 15, 0.443 / 10)
    conforms.closed_form(parts.area * 150, 0.668 * 0.443, rtol=1e-14)
    conforms.invariance(parts.centres, -parts.centres[:, ::-1], atol=1e-15)
    conforms.closed_form(parts.centres, PLATE.markers - [[0.334], [0.2215]], atol=1e-15)


# The operator.


@pytest.mark.parametrize("columns", [1, 7, 8])
@pytest.mark.parametrize("grid", [(6, 4), (7, 5), (1, 1), (2, 1)])
@pytest.mark.parametrize("name", NAMES)
def test_operator_is_rayleighs_integral_for_even_and_odd_numbers(conforms, name, grid, columns):
    plate = replace(PLATE, grid=grid)
    plane = plane_of(name, (columns, 4))
    omega, water = 2 * pi * 200, Medium(1480, 998)
    real, imag = np.random.default_rng(0).normal(size=(2, grid[0] * grid[1]))
    v = real + 1j * imag
    exact = rayleigh_pressure(plate_pistons(plate), v, plane.points, omega, water)
    field = plane_operator(plate, plane, omega, water).field(v)
    assert field.shape == (columns, 4)
    conforms.independent(field, exact, atol=1e-13 * np.max(np.abs(exact)))


# Its rms.


@pytest.mark.parametrize(("grid", "columns"), [((15, 10), 21), ((14, 9), 20), ((15, 10), 1)])
@pytest.mark.parametrize("name", NAMES)
def test_rms_is_that_of_the_direct_sum(conforms, name, grid, columns):
    plate, plane = replace(PLATE, grid=grid), plane_of(name, (columns, 33))
    omega = resonance_frequency(plate, 2)
    v = np.random.default_rng(1).normal(size=(5, grid[0] * grid[1]))
    kernel = transfer_pressure(plate_pistons(plate), plane.points, omega).reshape(columns * 33, -1)
    exact = np.sqrt(np.mean(np.abs(v @ kernel.T) ** 2, axis=1))
    found = np.linalg.norm(v @ full_factor(plane_operator(plate, plane, omega)).T, axis=-1)
    conforms.independent(found, exact, rtol=1e-12)


# Symmetries and nodal planes.


@pytest.mark.parametrize("mode", [1, 2, 3])
@pytest.mark.parametrize("name", NAMES)
def test_field_of_a_mode_is_even_or_odd_about_the_plates_centre(conforms, name, mode):
    index, omega = PLATE.mode_indices(mode)[-1], resonance_frequency(PLATE, mode)
    v = 1j * omega * deflection_shape(PLATE, mode, PLATE.markers, 0.01)
    field = plane_operator(PLATE, plane_of(name), omega).field(v)
    parity = 1 if index[NAMES.index(name)] % 2 else -1
    scale = np.max(np.abs(v)) * 343 * 1.21
    conforms.invariance(field[::-1], parity * field, atol=100 * EPS * scale)
    silent = index[1 - NAMES.index(name)] % 2 == 0  # on a plane of antisymmetry, to rounding
    assert (np.max(np.abs(field)) < 100 * EPS * scale) == silent
