"""Sound radiation: elementary sources, pistons, panels and power against closed forms."""

import warnings
from math import pi

import numpy as np
import pytest
from scenes.convergence import orders
from scipy.special import j1, struve

from thesis_lib.acoustics import radiation as rad
from thesis_lib.acoustics.planes import plate_pistons
from thesis_lib.acoustics.surfaces import Surface
from thesis_lib.facts import setups

C, RHO = rad.AIR.speed_of_sound, rad.AIR.density
A, B = 0.6, 0.4  # panel


def disc(radius, rings):
    """A disc as 3 n² cells of equal area, nearly square, placed at their centroids."""
    centres = []
    for i in range(rings):
        cells = 6 * i + 3
        inner, outer = radius * i / rings, radius * (i + 1) / rings
        half = pi / cells
        middle = 2 / 3 * (outer**3 - inner**3) / (outer**2 - inner**2) * np.sin(half) / half
        angle = (2 * np.arange(cells) + 1) * half
        centres.append(middle * np.stack([np.cos(angle), np.sin(angle)]))
    side = radius / rings * np.sqrt(pi / 3)
    return rad.Pistons(np.concatenate(centres, axis=1), (side, side))


def panel(nx, ny):
    """A panel of A × B as nx × ny pistons about the origin."""
    x = (np.arange(nx) + 0.5) / nx * A - A / 2
    y = (np.arange(ny) + 0.5) / ny * B - B / 2
    return rad.Pistons(np.stack([np.tile(x, ny), np.repeat(y, nx)]), (A / nx, B / ny))


def panel_mode(parts, m, n):
    """Velocities sin·sin of unit amplitude."""
    x, y = parts.centres
    return np.sin(m * pi * (x / A + 0.5)) * np.sin(n * pi * (y / B + 0.5))


def far_field(parts, v, directions, omega):
    """The far-field pressure times distance, p r e^{jkr}, in Pa m, shape (...)."""
    phase = omega / C * np.tensordot(parts.centres, np.asarray(directions, float)[:2], axes=(0, 0))
    return 1j * omega * RHO * parts.area / (2 * pi) * np.tensordot(v, np.exp(1j * phase), (0, 0))


def far_power(parts, v, omega, n=32):
    """Power by the far field's intensity over the half space, integrated to high order."""
    nodes, weights = np.polynomial.legendre.leggauss(n)
    cos, phi = (nodes[:, None] + 1) / 2, pi * np.arange(2 * n) / n
    sin = np.sqrt(1 - cos**2)
    u = np.stack([sin * np.cos(phi), sin * np.sin(phi), cos + 0 * phi])
    intensity = np.abs(far_field(parts, v, u, omega)) ** 2 / (2 * RHO * C)
    return np.sum(weights[:, None] / 2 * intensity) * pi / n


def random_velocity(n, seed=0):
    rng = np.random.default_rng(seed)
    return rng.normal(size=n) + 1j * rng.normal(size=n)


# Elementary sources.


@pytest.mark.parametrize("ka", [0.01, 1.0, 7.0])
def test_pressure_on_a_sphere_is_its_impedance_times_its_velocity(conforms, ka):
    a, v = 0.05, 0.3 - 0.2j
    omega = ka * C / a
    impedance = RHO * C * 1j * ka / (1 + 1j * ka)
    p = rad.pulsating_sphere(a, a, 4 * pi * a**2 * v, omega)
    conforms.closed_form(complex(p), impedance * v, rtol=1e-13)


def test_pulsating_sphere_obeys_eulers_equation_with_order_2(conforms):
    # v = −(dp/dr) / jωρ at the surface, by one-sided differences.
    a, v, omega = 0.05, 0.3, 1.7 * C / 0.05
    errors = []
    for h in (1e-3, 5e-4, 2.5e-4):
        p = rad.pulsating_sphere(a + h * np.arange(3), a, 4 * pi * a**2 * v, omega)
        slope = (-1.5 * p[0] + 2 * p[1] - 0.5 * p[2]) / h
        errors.append(abs(-slope / (1j * omega * RHO) - v))
    conforms.order(orders(errors), 2, atol=0.06)


def test_a_small_pulsating_sphere_is_a_monopole_with_order_2(conforms):
    omega, r = 2 * pi * 500, np.array([0.5, 1, 4])
    radii = 0.02 / 2 ** np.arange(4)
    exact = rad.monopole_pressure(r, 0.01j, omega)
    errors = [np.max(np.abs(rad.pulsating_sphere(r, a, 0.01j, omega) / exact - 1)) for a in radii]
    conforms.order(orders(errors), 2, atol=0.05)
    # e^{jka} / (1 + jka) = 1 − (ka)²/2 + …
    conforms.closed_form(errors[-1], (omega / C * radii[-1]) ** 2 / 2, rtol=0.01)


def test_monopole_is_an_outgoing_spherical_wave(conforms):
    omega = 2 * pi * 700
    r = np.linspace(0.1, 3, 50)
    p = rad.monopole_pressure(r, 0.02, omega)
    conforms.closed_form(np.abs(p) * r, omega * RHO * 0.02 / (4 * pi), rtol=1e-13)
    # With e^{+jωt}, a point at a distance sees what the source did a time r/c ago.
    delayed = np.exp(-1j * omega * (r - r[0]) / C)
    conforms.closed_form(p / p[0] * r / r[0], delayed, rtol=1e-11)


def test_a_baffle_doubles_a_monopole(conforms):
    omega, r = 2 * pi * 700, np.array([0.1, 0.7, 2])
    unit = rad.piston_pressure(r, 1, 0.002, omega)
    conforms.closed_form(unit, 2 * rad.monopole_pressure(r, 0.002, omega), rtol=1e-14)
    one = rad.Pistons(np.zeros((2, 1)), (0.05, 0.04))
    points = np.stack([0.6 * r, 0 * r, 0.8 * r])
    conforms.closed_form(rad.transfer_pressure(one, points, omega)[:, 0], unit, rtol=1e-12)


# Rayleigh's integral: the circular piston.


@pytest.mark.parametrize("ka", [0.7, 8.0])
def test_circular_piston_on_its_axis_with_order_2(conforms, ka):
    a, v = 0.1, 0.4
    k = ka / a
    z = np.array([0.03, 0.1, 0.25, 1.0])
    far = np.sqrt(z**2 + a**2)
    exact = RHO * C * v * (np.exp(-1j * k * z) - np.exp(-1j * k * far))
    modulus = 2 * RHO * C * v * np.abs(np.sin(k / 2 * (far - z)))
    conforms.closed_form(np.abs(exact), modulus, rtol=1e-10)
    errors, above = [], np.stack([0 * z, 0 * z, z])
    for rings in (16, 32, 64, 128):
        p = rad.rayleigh_pressure(disc(a, rings), np.full(3 * rings**2, v), above, k * C)
        errors.append(np.max(np.abs(p - exact)))
    conforms.order(orders(errors), 2, atol=0.15)
    conforms.closed_form(errors[-1], below=1e-3 * np.max(modulus))


@pytest.mark.parametrize("ka", [0.3, 2.5])
def test_impedance_of_the_circular_piston_is_that_of_bessel_and_struve(conforms, ka):
    """Mean pressure on it over its velocity: 1 − J₁(2ka)/ka + jH₁(2ka)/ka of ρc.

    Pistons have no field between them, so it is taken just above, as dp/dz = −jωρv has it; the edge
    leaves an error of h² log h.
    """
    a = 0.1
    omega, exact = ka * C / a, RHO * C * (1 - j1(2 * ka) / ka + 1j * struve(1, 2 * ka) / ka)
    errors = []
    for rings in (8, 16, 32):
        parts = disc(a, rings)
        v, h = np.ones(3 * rings**2), 2 * parts.size[0]
        above = rad.rayleigh_pressure(parts, v, np.stack([*parts.centres, h * v]), omega)
        errors.append(abs(np.mean(above) + 1j * omega * RHO * h - exact))
    conforms.order(orders(errors), 1.8, atol=0.2)
    conforms.closed_form(errors[-1], below=0.01 * abs(exact))


def test_pressure_of_the_circular_piston_off_its_axis_in_the_far_field(conforms):
    # Directivity 2 J₁(ka sin θ) / (ka sin θ).
    a, ka = 0.1, 3.0
    theta = np.linspace(0.1, 1.5, 12)
    u = np.stack([np.sin(theta), 0 * theta, np.cos(theta)])
    s = ka * np.sin(theta)
    exact = 1j * RHO * ka * C / a * a**2 * j1(s) / s
    errors = []
    for rings in (8, 16, 32):
        parts = disc(a, rings)
        p = far_field(parts, np.ones(3 * rings**2), u, ka * C / a)
        errors.append(np.max(np.abs(p - exact)))
    conforms.order(orders(errors), 2, atol=0.15)


# Simply supported panels: C. E. Wallace, J. Acoust. Soc. Am. 51 (1972), 946-952.

FAMILIES = [(3, 1), (2, 1), (1, 2), (2, 2)]  # odd and even


def wallace(m, n, k, nodes=80):
    """Radiation efficiency by Wallace's integral over a quarter of the half space."""
    t, w = np.polynomial.legendre.leggauss(nodes)
    t, w = (t + 1) * pi / 4, w * pi / 4
    theta, phi = t[:, None], t
    alpha = k * A * np.sin(theta) * np.cos(phi)
    beta = k * B * np.sin(theta) * np.sin(phi)
    wave = (np.cos if m % 2 else np.sin)(alpha / 2) * (np.cos if n % 2 else np.sin)(beta / 2)
    resonant = ((alpha / (m * pi)) ** 2 - 1) * ((beta / (n * pi)) ** 2 - 1)
    total = np.sum(w[:, None] * w * (wave / resonant) ** 2 * np.sin(theta))
    return 64 * k**2 * A * B / (pi**6 * m**2 * n**2) * total


@pytest.mark.parametrize("ka", [0.5, 6.0])
@pytest.mark.parametrize(("m", "n"), FAMILIES)
def test_radiation_efficiency_of_a_panel_is_wallaces_with_order_2(conforms, m, n, ka):
    k = ka / A
    exact = wallace(m, n, k)
    errors = []
    for refined in (1, 2, 4):
        parts = panel(12 * refined, 8 * refined)
        sigma = rad.radiation_efficiency(parts, panel_mode(parts, m, n), k * C)
        errors.append(abs(sigma / exact - 1))
    conforms.order(orders(errors), 2, atol=0.1)
    conforms.closed_form(errors[-1], below=0.02)


def test_a_measured_surface_radiates_by_wallaces_integral(conforms):
    """With as many nodes as `thesis measure` takes."""
    own = Surface.from_outline(np.array([[0, 0], [A, 0], [A, B], [0, B]]), 1600, (A / 2, B / 2))
    x, y = own.places
    shape = np.stack([np.sin(m * pi * x / A) * np.sin(n * pi * y / B) for m, n in FAMILIES], -1)
    for ka in (0.5, 6.0):
        power, wave = (form(shape, ka / A * C) for form in (own.power_form, own.plane_wave_form))
        exact = [wallace(m, n, ka / A) for m, n in FAMILIES]
        conforms.closed_form(np.diag(power) / np.diag(wave), np.array(exact), rtol=3e-4)


def test_rayleighs_integral_tends_to_the_far_field(conforms):
    parts = panel(12, 8)
    v, omega = random_velocity(96), 3 * C / A
    u = np.array([[0.3], [-0.5], [np.sqrt(1 - 0.34)]])
    far = far_field(parts, v, u, omega)[0]
    errors = []
    for r in (50, 100, 200, 400):
        p = rad.rayleigh_pressure(parts, v, r * u, omega)[0]
        errors.append(abs(p * r * np.exp(1j * omega / C * r) - far))
    conforms.order(orders(errors), 1, atol=0.05)


# Power.


@pytest.mark.parametrize("ka", [0.3, 9.0])
def test_radiation_matrix_gives_the_power_of_the_far_field(conforms, ka):
    parts = panel(12, 8)
    omega = ka * C / A
    for v in (random_velocity(96), panel_mode(parts, 2, 1), panel_mode(parts, 2, 2)):
        power = rad.sound_power(parts, v, omega)
        conforms.independent(far_power(parts, v, omega), power, rtol=1e-3)


def test_resistive_forces_are_those_of_the_whole_matrix(conforms):
    parts, omega = panel(24, 16), 3 * C / A  # of which a block takes a third
    v = np.stack([random_velocity(384), panel_mode(parts, 2, 1)], axis=1)
    whole = rad.radiation_matrix(parts, omega) @ v
    conforms.invariance(rad.resistive_forces(parts, v, omega), whole, rtol=1e-9)


def test_power_and_efficiency_scale_as_they_must(conforms):
    parts, omega = panel(6, 4), 3 * C / A
    v, dense = random_velocity(24), rad.Medium(C, 2 * RHO)
    power = rad.sound_power(parts, v, omega)
    conforms.invariance(rad.sound_power(parts, 3j * v, omega), 9 * power, rtol=1e-12)
    conforms.invariance(rad.sound_power(parts, v, omega, dense), 2 * power, rtol=1e-12)
    sigma = rad.radiation_efficiency(parts, v, omega)
    fast = rad.Medium(2 * C, 2 * RHO)  # only k matters to the efficiency
    conforms.invariance(rad.radiation_efficiency(parts, 3j * v, 2 * omega, fast), sigma, rtol=1e-12)


def test_two_pistons_that_meet_are_one_of_double_area_or_in_opposition_silent(conforms):
    k, side = 8.0, 0.02
    one = rad.Pistons(np.zeros((2, 1)), (2 * side, side))
    exact_power = rad.sound_power(one, [1.0], k * C)
    power, silence, distances = [], [], 0.04 / 2 ** np.arange(4)
    for d in distances:
        two = rad.Pistons(np.array([[-d / 2, d / 2], [0, 0]]), (side, side))
        power.append(abs(rad.sound_power(two, [1.0, 1.0], k * C) / exact_power - 1))
        silence.append(rad.sound_power(two, [1.0, -1.0], k * C))
    for errors in (power, silence):
        conforms.order(orders(errors), 2, atol=0.02)
    # (1 + sinc kd) / 2 = 1 − (kd)²/12 + …
    conforms.closed_form(power[-1], (k * distances[-1]) ** 2 / 12, rtol=0.01)


# The kernel.


@pytest.mark.parametrize("kind", [complex, float])
def test_field_is_the_direct_expression(conforms, kind):
    parts = plate_pistons(setups.thesis_plate())
    rng = np.random.default_rng(3)
    v = rng.normal(size=150) + (1j * rng.normal(size=150) if kind is complex else 0)
    points = rng.uniform([[-1], [-1], [0.005]], [[1], [1], [3]], (3, 1000)).reshape(3, 20, 50)
    omega = 2 * pi * 942
    x, y = parts.centres
    X, Y, Z = points[..., None]
    R = np.sqrt((X - x) ** 2 + (Y - y) ** 2 + Z**2)
    kernel = 1j * omega * RHO * parts.area / (2 * pi) * np.exp(-1j * omega / C * R) / R
    direct = kernel @ v
    peak = np.max(np.abs(direct))
    transferred = rad.transfer_pressure(parts, points, omega) @ v
    for field in (rad.rayleigh_pressure(parts, v, points, omega), transferred):
        assert field.shape == (20, 50)
        conforms.independent(np.max(np.abs(field - direct)), below=1e-12 * peak)


# Levels.


def test_levels_are_of_the_rms_pressure_and_re_one_picowatt(conforms):
    conforms.closed_form(rad.pressure_level(2e-5 * np.sqrt(2) * np.exp(0.4j)), 0, atol=1e-12)
    conforms.closed_form(rad.pressure_level(1.0), 90.9691, atol=1e-4)
    conforms.closed_form(rad.power_level([1e-12, 2e-12, 1]), [0, 3.0103, 120], atol=1e-4)
    assert rad.pressure_level([0.0])[0] == rad.power_level([0.0])[0] == -np.inf


# What is refused.


@pytest.mark.parametrize(
    "call",
    [
        lambda omega: rad.transfer_pressure(panel(6, 4), np.ones((3, 1)), omega),
        lambda omega: rad.rayleigh_pressure(panel(6, 4), np.ones(24), np.ones((3, 1)), omega),
        lambda omega: rad.sound_power(panel(6, 4), np.ones(24), omega),
    ],
)
def test_pistons_must_be_small_against_the_wavelength(call):
    side = 0.1  # of the panel's 6 × 4 pistons
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        call(0.999 / side * C)
    with pytest.warns(UserWarning, match=r"k times the size of a piston is 1\.00 at"):
        call(1.001 / side * C)
    with pytest.raises(ValueError, match=r"is 3\.14 at .* Hz, needs at most π"):
        call(1.0001 * pi / side * C)


@pytest.mark.parametrize(
    ("call", "given", "words"),
    [
        (rad.Medium, (np.nan, 1.21), "speed_of_sound: given"),
        (rad.Medium, (343, 0.0), "density: given"),
        (rad.monopole_pressure, (1, 1, -1.0), "omega: given .*, needs a positive finite number"),
        (rad.check_pistons, (rad.Pistons(np.zeros((2, 1)), (0.01, 0.1)), 35 * C), r"is 3\.5"),
        (rad.transfer_pressure, (panel(6, 4), [[0], [0], [-0.1]], 1e3), "Z = .*, needs Z > 0"),
        (rad.pulsating_sphere, ([0.2, 0.09], 0.1, 1, 1000), r"distance: given 0\.09 m"),
        (rad.monopole_pressure, ([1, 0], 1, 1000), "distance: given 0"),
    ],
)
def test_what_cannot_be_is_refused(call, given, words):
    with pytest.raises(ValueError, match=words):
        call(*given)
