"""Simply supported plate: order of the modes, shapes and response against closed forms."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scenes.convergence import orders
from scenes.mobility import drive_point_mobility

from thesis_lib.facts import setups
from thesis_lib.vibration.structure import (
    deflection_shape,
    full_response,
    peak_deflection,
    single_mode_distance,
)

PLATE = setups.thesis_plate()
SQUARE = replace(PLATE, length=0.5, width=0.5, force_position=(0.25, 0.25))
THESIS_ORDER = [(1, 1), (2, 1), (1, 2), (3, 1), (2, 2), (3, 2), (4, 1), (1, 3)]


def slope(x, y):
    return np.polyfit(np.log(x), np.log(y), 1)[0]


# Frequencies and the order of the modes.


def test_natural_frequencies_of_the_thesis_plate_are_those_of_the_closed_form(conforms):
    D = 1.4e11 * 0.0198**3 / (12 * (1 - 0.31**2))
    m, n = np.transpose(THESIS_ORDER)
    omega = pi**2 * np.sqrt(D / (7200 * 0.0198)) * ((m / 0.668) ** 2 + (n / 0.443) ** 2)
    conforms.closed_form(PLATE.angular_frequencies(8), omega, rtol=1e-13)
    conforms.closed_form(omega[:3] / (2 * pi), [305.5, 585.5, 942.1], atol=0.05)


def test_the_printed_order_is_not_that_of_the_frequencies():
    # Table 4.2 goes on with (2, 2) and (1, 4), which is the fifteenth.
    indices = [tuple(pair) for pair in PLATE.mode_indices(15)]
    assert indices[:8] == THESIS_ORDER
    assert indices.index((2, 2)) == 4
    assert indices.index((1, 4)) == 14


@given(st.floats(0.02, 50), st.integers(1, 80))
def test_order_is_ascending_and_no_lower_mode_is_missing(conforms, aspect, n):
    plate = replace(PLATE, length=aspect * PLATE.width)
    pairs = plate.mode_indices(n)
    omega = plate.angular_frequencies(n)
    assert pairs.shape == (n, 2)
    assert np.all(pairs >= 1)
    assert len({tuple(pair) for pair in pairs}) == n
    # Any of the first n modes has indices up to n, or n lower ones would stand in its row.
    m1, m2 = np.meshgrid(np.arange(1, n + 1), np.arange(1, n + 1))
    waves = (m1 * pi / plate.length) ** 2 + (m2 * pi / plate.width) ** 2
    lowest = np.sort(waves.ravel())[:n] * np.sqrt(plate.bending_stiffness / plate.mass_per_area)
    conforms.independent(omega, lowest, rtol=1e-12)


@pytest.mark.parametrize("mode", [1, 6])
def test_shapes_and_frequencies_solve_the_plates_equation_with_order_2(conforms, mode):
    # D ∇⁴φ = m ω² φ, with the thirteen-point biharmonic operator.
    centre = np.array([0.2, 0.15])
    exact = PLATE.mass_per_area * PLATE.angular_frequencies(mode)[-1] ** 2
    exact = exact * PLATE.mode_shapes([mode], centre[:, None])[0, 0]
    errors = []
    for h in (0.04, 0.02, 0.01):
        offset = h * np.arange(-2, 3)
        x, y = np.meshgrid(centre[0] + offset, centre[1] + offset, indexing="ij")
        w = PLATE.mode_shapes([mode], np.stack([x, y]))[0]
        laplacian = w[:-2, 1:-1] + w[2:, 1:-1] + w[1:-1, :-2] + w[1:-1, 2:] - 4 * w[1:-1, 1:-1]
        twice = laplacian[0, 1] + laplacian[2, 1] + laplacian[1, 0] + laplacian[1, 2]
        biharmonic = (twice - 4 * laplacian[1, 1]) / h**4
        errors.append(abs(PLATE.bending_stiffness * biharmonic - exact))
    conforms.order(orders(errors), 2, atol=0.05)


# Shapes.


def test_shapes_are_orthogonal_with_mean_square_one(conforms):
    nodes, weights = np.polynomial.legendre.leggauss(40)
    x, y = np.meshgrid((nodes + 1) / 2 * PLATE.length, (nodes + 1) / 2 * PLATE.width)
    shapes = PLATE.mode_shapes(range(1, 41), np.stack([x, y])).reshape(40, -1)
    weight = np.outer(weights, weights).ravel() / 4
    conforms.closed_form(shapes @ (weight * shapes).T, np.eye(40), atol=1e-12)


def test_edges_are_at_rest(conforms):
    s = np.linspace(0, 1, 33)
    for x, y in ((s, 0 * s), (s, 0 * s + 1), (0 * s, s), (0 * s + 1, s)):
        edge = np.stack([x * PLATE.length, y * PLATE.width])
        conforms.closed_form(PLATE.mode_shapes(range(1, 31), edge), 0, atol=1e-13)


def test_deflection_shape_has_the_given_peak_at_an_antinode(conforms):
    points = np.array([[1 / 2, 1 / 4], [1 / 2, 1 / 2]]) * np.array(PLATE.extent)[:, None]
    first, second = (deflection_shape(PLATE, mode, points, peak=0.01) for mode in (1, 2))
    conforms.closed_form([first[0], second[1]], 0.01, rtol=1e-14)
    conforms.closed_form(second[0], 0, atol=1e-17)


@pytest.mark.parametrize("grid", [(15, 10), (4, 7)])
def test_markers_are_cell_centres_and_x_runs_fastest(conforms, grid):
    plate = setups.thesis_plate(grid)
    x, y = np.meshgrid(*((np.arange(n) + 0.5) / n for n in grid))
    conforms.closed_form(plate.markers, [0.668 * x.ravel(), 0.443 * y.ravel()], rtol=1e-14)


# Static deflection of a square plate: Timoshenko and Woinowsky-Krieger, tables 8 and 23.


def test_point_load_at_the_centre_with_order_1_in_the_number_of_modes(conforms):
    # Deflection at the centre under a load there, in P a²/D: Lévy's single series.
    m = np.arange(1.0, 20_000, 2)
    alpha = m * pi / 2
    decay = np.exp(-2 * alpha)
    terms = (1 - decay) / (1 + decay) - 4 * alpha * decay / (1 + decay) ** 2
    exact = np.sum(terms / m**3) / (2 * pi**3)
    conforms.closed_form(exact, 0.01160, atol=5e-6)
    unit = 3.5 * SQUARE.length**2 / SQUARE.bending_stiffness
    numbers = 400 * 2 ** np.arange(6)
    sums = [full_response(SQUARE, SQUARE.force_point, 0.0, n, 3.5)[0] / unit for n in numbers]
    assert not np.any(np.imag(sums))
    errors = exact - np.real(sums)
    # Modes within a circle fall as r⁻⁴: what is left out is 1/(16π² N).
    conforms.closed_form(errors * numbers * 16 * pi**2, 1, atol=0.08)
    conforms.order(slope(numbers, errors), -1, atol=0.03)
    conforms.closed_form(np.real(sums[-1]), 0.01160, rtol=5e-4)


# Response to a force.


@pytest.mark.parametrize(("mode", "nanometres"), [(1, 62.6), (2, 32.9), (3, 12.2)])
def test_peak_for_one_newton_is_that_of_a_damped_oscillator(conforms, mode, nanometres):
    m, n = THESIS_ORDER[mode - 1]
    mass = 7200 * 0.668 * 0.443 * 0.0198
    D = 1.4e11 * 0.0198**3 / (12 * (1 - 0.31**2))
    omega_n = pi**2 * ((m / 0.668) ** 2 + (n / 0.443) ** 2) * np.sqrt(D / (7200 * 0.0198))
    drive = 2 * np.sin(m * pi * 0.055 / 0.668) * np.sin(n * pi * 0.055 / 0.443)
    closed = 2 * drive / (mass * 2 * 0.02 * omega_n**2 * np.sqrt(1 - 0.02**2))
    conforms.closed_form(peak_deflection(PLATE, mode), closed, rtol=1e-12)
    conforms.closed_form(1e9 * closed, nanometres, atol=0.06)


def test_mobility_tends_to_that_of_an_infinite_plate(conforms):
    # Cremer and Heckl: 1 / (8 √(D m)), as the mean over frequency and over the force's position.
    infinite = 1 / (8 * np.sqrt(PLATE.bending_stiffness * PLATE.mass_per_area))
    x, y = np.meshgrid((np.arange(8) + 0.5) / 8, (np.arange(8) + 0.5) / 8)
    points = np.stack([x.ravel() * PLATE.length, y.ravel() * PLATE.width]).T
    band = np.linspace(*PLATE.angular_frequencies(400)[[199, 399]], 400)
    driven = [replace(PLATE, force_position=tuple(point)) for point in points]
    mean = np.mean([drive_point_mobility(plate, band, 800).real for plate in driven])
    conforms.closed_form(mean, infinite, rtol=0.05)


def test_one_mode_is_all_of_the_response_at_its_resonance_as_damping_falls(conforms):
    # Without losses the resonance is all there is: the distance falls as ξ.
    less = [single_mode_distance(replace(PLATE, damping=xi), 1) for xi in (0.01, 0.005, 0.0025)]
    conforms.order(orders(less), 1, atol=0.05)


def test_modal_density_counts_the_modes(conforms):
    numbers = 250 * 2 ** np.arange(7)
    omega = PLATE.angular_frequencies(numbers[-1])[numbers - 1]
    first = PLATE.modal_density(omega) * omega
    k = np.sqrt(omega * np.sqrt(PLATE.mass_per_area / PLATE.bending_stiffness))
    # Lattice points in a quarter ellipse: its area, less half of those on the axes.
    second = first - (PLATE.length + PLATE.width) * k / (2 * pi) + 1 / 4
    conforms.independent(second, numbers, atol=8, rtol=2e-3)
    # Alone, the asymptotic density is too high by the axes' share, which falls as N^-½.
    conforms.order(slope(numbers, first / numbers - 1), -0.5, atol=0.03)
