"""Cantilever beam: frequencies, shapes and response against closed forms."""

from dataclasses import replace
from decimal import Decimal, localcontext
from math import pi

import numpy as np
import pytest
from scenes.convergence import orders
from scenes.mobility import drive_point_mobility

from thesis_lib.facts import setups
from thesis_lib.vibration import structure

BEAM = setups.thesis_beam()
MODES = range(1, 31)


def at(*x):
    return np.stack([np.array(x, float), np.zeros(len(x))])


def test_natural_frequencies_of_the_thesis_beam(conforms):
    hertz = BEAM.angular_frequencies(3) / (2 * pi)
    conforms.closed_form(hertz, [6.312, 39.56, 110.8], atol=[0.0005, 0.005, 0.05])


def test_roots_solve_the_frequency_equation(conforms):
    beta = structure.cantilever_roots(60)
    table = [1.8751, 4.6941, 7.8548, 10.9955, 14.1372]  # as published
    conforms.closed_form(beta[:5], table, atol=5e-5)
    conforms.closed_form(np.cos(beta) + 1 / np.cosh(beta), 0, atol=1e-13)
    # One root in each interval of length π: none is missed.
    conforms.closed_form(np.floor(beta / pi), np.arange(60), atol=0)


def decimal_functions(x):
    """The cosine and sine of a decimal number, and the hyperbolic ones."""
    term, total = Decimal(1), [Decimal(0), Decimal(0)]
    for k in range(500):
        total[k % 2] += term if k % 4 < 2 else -term
        term *= x / (k + 1)
    return *total, (x.exp() + (-x).exp()) / 2, (x.exp() - (-x).exp()) / 2


def decimal_root(mode):
    beta = Decimal((2 * mode - 1) * pi / 2)
    for _ in range(9):
        cos, sin, cosh, sinh = decimal_functions(beta)
        beta -= (cos * cosh + 1) / (cos * sinh - sin * cosh)
    return beta


def decimal_shapes(beta, s):
    cos, sin, cosh, sinh = decimal_functions(beta)
    sigma = (sinh - sin) / (cosh + cos)
    parts = [decimal_functions(beta * Decimal(float(x))) for x in s]
    return [float(cosh - cos - sigma * (sinh - sin)) for cos, sin, cosh, sinh in parts]


def test_shapes_equal_the_textbook_formula_in_130_digits(conforms):
    # In doubles the formula loses all digits from mode 12 on; here e^β cancels harmlessly.
    s = np.arange(0, 17) / 16
    shapes = BEAM.mode_shapes(MODES, at(*(s * BEAM.length)))
    with localcontext(prec=130):
        roots = [decimal_root(mode) for mode in MODES]
        exact = [decimal_shapes(beta, s) for beta in roots]
    conforms.independent(structure.cantilever_roots(30), [float(r) for r in roots], rtol=4e-16)
    conforms.independent(shapes, exact, atol=1e-12)


@pytest.mark.parametrize(
    ("x", "derivative"), [(0.0, 0), (0.0, 1), (BEAM.length, 2), (BEAM.length, 3)]
)
def test_shapes_meet_the_boundary_conditions(conforms, x, derivative):
    k = structure.cantilever_roots(30) / BEAM.length
    values = BEAM.mode_shapes(MODES, at(x), derivative)[:, 0] / k**derivative
    conforms.closed_form(values, 0, atol=1e-10)


@pytest.mark.parametrize("derivative", [1, 2, 3])
def test_derivatives_are_the_limit_of_central_differences(conforms, derivative):
    x, modes = np.array([0.1, 0.3, 0.55]), [1, 2, 5]
    exact = BEAM.mode_shapes(modes, at(*x), derivative)
    errors = []
    for h in (4e-3, 2e-3, 1e-3):
        upper, lower = (BEAM.mode_shapes(modes, at(*(x + d)), derivative - 1) for d in (h, -h))
        errors.append(np.max(np.abs((upper - lower) / (2 * h) - exact)))
    conforms.order(orders(errors), 2, atol=0.05)


def test_shapes_are_orthogonal_with_mean_square_one(conforms):
    nodes, weights = np.polynomial.legendre.leggauss(200)
    shapes = BEAM.mode_shapes(MODES, at(*((nodes + 1) / 2 * BEAM.length)))
    conforms.closed_form(shapes @ (weights / 2 * shapes).T, np.eye(30), atol=1e-9)


def test_markers_are_a_centred_row_inside_the_beam(conforms):
    x, y = BEAM.markers
    conforms.closed_form(1000 * x[[0, -1]], [11.5, 611.5], rtol=1e-12)
    conforms.closed_form(np.diff(x), 0.025, rtol=1e-12)
    conforms.closed_form(y, BEAM.width / 2, rtol=1e-7)


def test_modal_sum_at_rest_tends_to_the_static_deflection_with_order_3(conforms):
    a, EI, force = BEAM.force_position, BEAM.bending_stiffness, 2.5
    x = np.append(np.linspace(0, BEAM.length, 50), a)  # slowest where the force acts
    before, beyond = x**2 * (3 * a - x), a**2 * (3 * x - a)
    exact = force * np.where(x <= a, before, beyond) / (6 * EI)
    errors = [
        np.max(np.abs(structure.full_response(BEAM, at(*x), 0.0, n, force) - exact))
        for n in (25, 50, 100, 200, 400)
    ]
    conforms.closed_form(errors[-1], below=1e-5 * np.max(exact))
    # The terms fall as n⁻⁴, modulated by φₙ(a)²: order 3 on the whole, not at every doubling.
    conforms.order(np.mean(orders(errors)), 3, atol=0.1)


def test_response_is_reciprocal_between_force_and_receiver(conforms):
    one, other = 0.055, 0.48
    omega = np.sqrt(np.prod(BEAM.angular_frequencies(2)))
    there = structure.full_response(replace(BEAM, force_position=one), at(other), omega, 30)
    back = structure.full_response(replace(BEAM, force_position=other), at(one), omega, 30)
    conforms.invariance(there, back, rtol=1e-12)


def test_a_passive_beam_takes_power_at_every_frequency(conforms):
    omega = np.geomspace(1e-2, 1e5, 2000)
    conforms.invariance(drive_point_mobility(BEAM, omega, 50).real, above=0)


@pytest.mark.parametrize(("mode", "millimetres"), [(1, 5.52), (2, 0.789), (3, 0.252)])
def test_peak_is_that_of_a_damped_oscillator(conforms, mode, millimetres):
    omega_n, xi = BEAM.angular_frequencies(mode)[-1], BEAM.damping
    drive = abs(BEAM.mode_shapes([mode], BEAM.force_point)[0, 0])
    closed = 2 * drive / (BEAM.mass * 2 * xi * omega_n**2 * np.sqrt(1 - xi**2))
    conforms.closed_form(structure.peak_deflection(BEAM, mode), closed, rtol=1e-12)
    conforms.closed_form(1000 * closed, millimetres, rtol=2e-3)


def test_resonance_is_the_frequency_of_the_largest_displacement(conforms):
    heavy = replace(BEAM, damping=0.3)
    omega = np.linspace(0.5, 1.5, 20001) * heavy.angular_frequencies(1)[0]
    amplitude = np.abs(structure.modal_coordinates(heavy, omega, 1)[0])
    found, step = structure.resonance_frequency(heavy, 1), omega[1] - omega[0]
    conforms.independent(found, omega[np.argmax(amplitude)], atol=step)


def test_deflection_shape_peaks_at_the_tip_with_the_given_value(conforms):
    x = np.linspace(0, BEAM.length, 501)
    for mode in (1, 2, 7):
        shape = np.abs(structure.deflection_shape(BEAM, mode, at(*x), 5.5e-3))
        conforms.closed_form(shape[0], 0, atol=1e-15)
        conforms.closed_form([shape[-1], shape.max()], 5.5e-3, rtol=1e-12)


def test_one_mode_is_nearly_all_of_the_response_at_its_resonance(conforms):
    distances = [structure.single_mode_distance(BEAM, mode, n_modes=60) for mode in (1, 2, 3)]
    conforms.closed_form(max(distances), below=0.05)
    assert min(distances) > 0


def test_modal_density_counts_the_modes(conforms):
    omega = BEAM.angular_frequencies(60)
    fine = np.linspace(omega[19], omega[59], 20001)
    counted = np.sum(BEAM.modal_density((fine[1:] + fine[:-1]) / 2) * np.diff(fine))
    conforms.independent(counted, 40, rtol=1e-5)
