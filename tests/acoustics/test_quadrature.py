"""Rayleigh's integral by Gauss's rule: against adaptive quadrature, itself, and sums of pistons."""

from dataclasses import replace

import numpy as np
import pytest
from scenes.convergence import orders
from scipy.integrate import dblquad

from thesis_lib.acoustics.planes import plate_pistons
from thesis_lib.acoustics.radiation import AIR, integrate_pressure, rayleigh_pressure
from thesis_lib.facts import setups
from thesis_lib.vibration.structure import resonance_frequency

PLATE = setups.thesis_plate()
L, W = PLATE.extent
NEAR = 0.0445  # m, where the studies' planes begin
POINTS = np.array([[0.0, 0.1, 0.334, 0.0], [0.0, 0.0, 0.0, 0.2], [NEAR, NEAR, 0.2, NEAR]])


def velocity(mode):
    return lambda places: PLATE.mode_shapes([mode], places)[0]


@pytest.mark.parametrize("mode", [1, 9])
def test_integral_is_that_of_adaptive_quadrature(conforms, mode):
    omega = resonance_frequency(PLATE, mode)
    k, scale = omega / AIR.speed_of_sound, 1j * omega * AIR.density / (2 * np.pi)
    m1, m2 = PLATE.mode_indices(mode)[-1]

    def whole(part, X, Y, Z):
        def sent(y, x):
            R = np.sqrt((X + L / 2 - x) ** 2 + (Y + W / 2 - y) ** 2 + Z**2)
            v = 2 * np.sin(m1 * np.pi * x / L) * np.sin(m2 * np.pi * y / W)
            return part(np.exp(-1j * k * R)) * v / R

        return dblquad(sent, 0, L, 0, W, epsabs=1e-10, epsrel=1e-8)[0]

    found = integrate_pressure(PLATE, velocity(mode), POINTS[:, :2], omega)
    exact = [scale * (whole(np.real, *p) + 1j * whole(np.imag, *p)) for p in POINTS[:, :2].T]
    conforms.independent(found, np.array(exact), atol=1e-6 * np.max(np.abs(exact)))


def test_rule_gains_digits_with_every_node_at_the_rate_that_sizes_it(conforms):
    """Along the length; across there are nodes enough."""
    above, omega = np.array([[0.0], [0.0], [NEAR]]), resonance_frequency(PLATE, 1)
    exact = integrate_pressure(PLATE, velocity(1), above, omega, nodes=(160, 120))
    counts = np.arange(40, 81, 4)
    found = [integrate_pressure(PLATE, velocity(1), above, omega, nodes=(n, 120)) for n in counts]
    rate = -np.polyfit(counts, np.log(np.abs(found - exact)[:, 0]), 1)[0]
    conforms.order(rate / (2 * np.arcsinh(NEAR / (L / 2))), 1, atol=0.1)


def test_sums_of_pistons_come_to_it_with_order_2(conforms):
    omega = resonance_frequency(PLATE, 1)
    exact, off = integrate_pressure(PLATE, velocity(1), POINTS, omega), []
    for times in (2, 4, 8):
        fine = replace(PLATE, grid=(15 * times, 10 * times))
        moving = fine.mode_shapes([1], fine.markers)[0]
        off.append(np.abs(rayleigh_pressure(plate_pistons(fine), moving, POINTS, omega) - exact))
    conforms.order(orders(off), 2, atol=0.05)


def test_a_plate_that_moves_as_a_whole_far_away_is_one_piston(conforms):
    far, omega = np.array([[0.0], [0.0], [400.0]]), 200.0
    found = integrate_pressure(PLATE, lambda places: np.ones(places.shape[1]), far, omega)
    closed = omega * AIR.density * L * W / (2 * np.pi * 400)
    conforms.closed_form(np.abs(found), closed, rtol=1e-6)
