"""The two planes: folded operator against Rayleigh's integral, its rms, symmetries and nodes."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest
from scipy import linalg

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


def velocity_of(mode, plate=PLATE, peak=0.01):
    return (
        1j * resonance_frequency(plate, mode) * deflection_shape(plate, mode, plate.markers, peak)
    )


def random_velocity(n, seed=0):
    rng = np.random.default_rng(seed)
    return rng.normal(size=n) + 1j * rng.normal(size=n)


def mode_number(pair):
    return [tuple(p) for p in PLATE.mode_indices(30)].index(pair) + 1


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


@pytest.mark.parametrize(
    "change",
    [
        {"half_width": 0.0},
        {"half_width": -0.1},
        {"half_width": float("nan")},
        {"bottom": 0.0},
        {"bottom": -0.1},
        {"bottom": float("nan")},
        {"top": 0.01},
        {"top": float("nan")},
        {"shape": (0, 5)},
        {"shape": (5, 0)},
    ],
)
def test_a_plane_behind_the_plate_or_without_points_is_refused(change):
    with pytest.raises(ValueError, match=r"plane: given .* needs half width > 0, 0 < bottom ≤ top"):
        replace(plane_of("XZ"), **change)


# The operator.


@pytest.mark.parametrize("rows", [1, 4])
@pytest.mark.parametrize("columns", [1, 2, 7, 8])
@pytest.mark.parametrize("grid", [(6, 4), (7, 4), (6, 5), (7, 5), (1, 1), (2, 1), (1, 3)])
@pytest.mark.parametrize("name", NAMES)
def test_operator_is_rayleighs_integral_for_even_and_odd_numbers(
    conforms, name, grid, columns, rows
):
    plate = replace(PLATE, grid=grid)
    plane = plane_of(name, (columns, rows))
    omega, water = 2 * pi * 200, Medium(1480, 998)
    v = random_velocity(grid[0] * grid[1])
    exact = rayleigh_pressure(plate_pistons(plate), v, plane.points, omega, water)
    field = plane_operator(plate, plane, omega, water).field(v)
    assert field.shape == (columns, rows)
    conforms.independent(field, exact, atol=1e-13 * np.max(np.abs(exact)))


@pytest.mark.parametrize("mode", [1, 2, 3])
@pytest.mark.parametrize("name", NAMES)
def test_field_on_the_thesis_planes_is_the_direct_sum(conforms, name, mode):
    omega, plane = resonance_frequency(PLATE, mode), plane_of(name)
    op = plane_operator(PLATE, plane, omega)
    for v in (random_velocity(150), random_velocity(150).real):
        direct = transfer_pressure(plate_pistons(PLATE), plane.points, omega) @ v
        conforms.independent(
            np.max(np.abs(op.field(v) - direct)), below=1e-12 * np.max(np.abs(direct))
        )


@pytest.mark.parametrize("name", NAMES)
def test_too_large_pistons_are_refused(name):
    coarse = replace(PLATE, grid=(3, 2))
    with pytest.raises(ValueError, match="use more and smaller pistons"):
        plane_operator(coarse, plane_of(name), 1.01 * pi / (PLATE.width / 2) * 343)


# Its rms.


def rms(op, velocity):
    """Root mean square of |p| over the plane for real velocities (..., pistons)."""
    return np.linalg.norm(velocity @ full_factor(op).T, axis=-1)


@pytest.mark.parametrize("columns", [20, 21])
@pytest.mark.parametrize("grid", [(15, 10), (14, 9)])
@pytest.mark.parametrize("name", NAMES)
def test_rms_is_that_of_the_direct_sum(conforms, name, grid, columns):
    plate, plane = replace(PLATE, grid=grid), plane_of(name, (columns, 33))
    omega = resonance_frequency(plate, 2)
    op = plane_operator(plate, plane, omega)
    v = np.random.default_rng(1).normal(size=(5, grid[0] * grid[1]))
    kernel = transfer_pressure(plate_pistons(plate), plane.points, omega).reshape(columns * 33, -1)
    exact = np.sqrt(np.mean(np.abs(v @ kernel.T) ** 2, axis=1))
    conforms.independent(rms(op, v), exact, rtol=1e-12)


def test_rms_of_fewer_points_than_pistons(conforms):
    for columns in (1, 2, 3):
        plane = plane_of("XZ", (columns, 2))
        op = plane_operator(PLATE, plane, 3000.0)
        v = random_velocity(150).real
        exact = np.sqrt(
            np.mean(np.abs(rayleigh_pressure(plate_pistons(PLATE), v, plane.points, 3000.0)) ** 2)
        )
        conforms.independent(rms(op, v), exact, rtol=1e-12)


@pytest.mark.parametrize("name", NAMES)
def test_rms_of_fields_that_all_but_cancel(conforms, name):
    """Where the quadratic form would have lost all digits, the factor still has some."""
    omega, plane = resonance_frequency(PLATE, 1), plane_of(name, (30, 20))
    op = plane_operator(PLATE, plane, omega)
    kernel = transfer_pressure(plate_pistons(PLATE), plane.points, omega).reshape(600, 150)
    stacked = np.concatenate([kernel.real, kernel.imag])
    _, strength, directions = linalg.svd(stacked, full_matrices=False)
    gram = stacked.T @ stacked / 600
    lost = 0
    for wanted in (1e-2, 1e-4, 1e-6, 1e-8):
        v = directions[np.argmin(np.abs(np.log(strength / strength[0] / wanted)))]
        # Rounding of the kernel alone moves the field by a few ulps of its largest part.
        exact = np.sqrt(np.mean(np.abs(kernel @ v) ** 2))
        largest = strength[0] / np.sqrt(600)
        assert exact < 5 * wanted * largest
        conforms.independent(rms(op, v), exact, rtol=1e-12, atol=20 * EPS * largest)
        form = np.sqrt(max(v @ gram @ v, 0))
        lost += abs(form - exact) > 1000 * EPS * largest
    assert lost >= 1


@pytest.mark.parametrize("name", NAMES)
def test_rms_of_silence_is_zero(conforms, name):
    op = plane_operator(PLATE, plane_of(name, (30, 20)), resonance_frequency(PLATE, 1))
    assert rms(op, np.zeros(150)) == 0
    # What is antisymmetric across a plane cancels on it altogether.
    x, y = plate_pistons(PLATE).centres
    conforms.closed_form(
        rms(op, y if name == "XZ" else x), below=10 * EPS * rms(op, np.abs(x) + np.abs(y))
    )


# Symmetries and nodal planes.


@pytest.mark.parametrize("mode", range(1, 6))
@pytest.mark.parametrize("name", NAMES)
def test_field_of_a_mode_is_even_or_odd_about_the_plates_centre(conforms, name, mode):
    index = PLATE.mode_indices(mode)[-1]
    field = plane_operator(PLATE, plane_of(name), resonance_frequency(PLATE, mode)).field(
        velocity_of(mode)
    )
    parity = 1 if index[NAMES.index(name)] % 2 else -1
    scale = np.max(np.abs(velocity_of(mode))) * 343 * 1.21
    conforms.invariance(field[::-1], parity * field, atol=100 * EPS * scale)


def largest(mode):
    """Largest pressure on both planes, and the most that the pistons could give there."""
    result = []
    for name in NAMES:
        plane, omega = plane_of(name), resonance_frequency(PLATE, mode)
        v = velocity_of(mode)
        field = np.max(np.abs(plane_operator(PLATE, plane, omega).field(v)))
        kernel = transfer_pressure(plate_pistons(PLATE), plane.points, omega)
        result.append((field, np.max(np.abs(kernel) @ np.abs(v))))
    return result


@pytest.mark.parametrize(
    ("pair", "nodal"), [((2, 1), {"YZ"}), ((1, 2), {"XZ"}), ((2, 2), {"XZ", "YZ"}), ((1, 1), set())]
)
def test_a_plane_of_antisymmetry_is_silent_to_rounding(conforms, pair, nodal):
    for name, (field, most) in zip(NAMES, largest(mode_number(pair)), strict=True):
        if name in nodal:
            conforms.invariance(field, below=100 * EPS * most)
        else:
            assert field > 0.05 * most
