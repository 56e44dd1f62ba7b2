"""Flat radiators with and without a wall, against other rules and solutions, and closed forms."""

import numpy as np
import pytest
from numpy.polynomial.legendre import leggauss
from scenes.convergence import orders
from scenes.outlines import disc
from scipy.special import j0

from thesis_lib.acoustics.radiation import AIR
from thesis_lib.acoustics.surfaces import Screen, Surface, cell_kernel
from thesis_lib.vibration.polygons import clip_polygon, polygon_area, polygon_moments

PLATE = np.array([[0, 0], [0.6, 0], [0.6, 0.4], [0, 0.4]])
L = np.array([[0, 0], [0.6, 0], [0.6, 0.23], [0.21, 0.23], [0.21, 0.4], [0, 0.4]])
TURN = 2 * np.pi * (np.arange(120) + 0.5) / 120
DISC = 0.3 + 0.2 * np.column_stack([np.cos(TURN), np.sin(TURN)])
SHAPES = {
    "as one": lambda x, y: 1 + 0 * x,
    "tilting": lambda x, y: x - 0.2,
    "one half-wave": lambda x, y: np.sin(np.pi * x / 0.6) * np.sin(np.pi * y / 0.4),
    "three by two": lambda x, y: np.sin(3 * np.pi * x / 0.6) * np.cos(2 * np.pi * y / 0.4),
}


def rectangle(x, y, nodes=(40, 30)):
    """Gauss's nodes (2, n) and weights of a rectangle between two x and two y."""
    (u, a), (v, b) = map(leggauss, nodes)
    grid = np.meshgrid(x[0] + (u + 1) / 2 * np.ptp(x), y[0] + (v + 1) / 2 * np.ptp(y))
    return np.stack(grid).reshape(2, -1), np.outer(b, a).ravel() * np.ptp(x) * np.ptp(y) / 4


def sectors(corners, nodes=8):
    """The same of a polygon around (0.3, 0.3), as triangles of which this is a corner."""
    (u, a), centre, places, weights = leggauss(nodes), np.array([0.3, 0.3]), [], []
    s, t = np.meshgrid((u + 1) / 2, (u + 1) / 2)
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        aside = (1 - t.ravel())[:, None] * (start - centre) + t.ravel()[:, None] * (end - centre)
        places.append(centre + s.ravel()[:, None] * aside)
        turned = np.linalg.det([start - centre, end - centre])
        weights.append((s * np.outer(a, a)).ravel() * turned / 4)
    return np.concatenate(places).T, np.concatenate(weights)


OUTLINES = {
    "rectangle": (PLATE, lambda: rectangle((0, 0.6), (0, 0.4))),
    "L": (L, lambda: [np.concatenate(both, axis=-1) for both in zip(
        rectangle((0, 0.6), (0, 0.23)), rectangle((0, 0.21), (0.23, 0.4), (20, 20)), strict=True)]),
    "disc": (DISC, lambda: sectors(DISC, 6)),
}  # fmt: skip


def relative_error(surface, integral, shape, hertz):
    """Error of a surface's radiation efficiency, by nodes (2, n) and weights of its integral."""
    places, weights = integral
    v, (x, y), omega = weights * shape(*places), places, 2 * np.pi * hertz
    k, moving = omega / AIR.speed_of_sound, shape(*surface.places)[:, None]
    power = v @ np.sinc(k * np.hypot(x[:, None] - x, y[:, None] - y) / np.pi) @ v
    exact = k**2 / (2 * np.pi) * power / (v @ shape(*places))
    found = surface.power_form(moving, omega) / surface.plane_wave_form(moving, omega)
    return float(found[0, 0]) / exact - 1


@pytest.mark.few(1)
@pytest.mark.slow
@pytest.mark.parametrize("name", OUTLINES)
def test_the_stated_uncertainty_holds_what_sums_are_off_by(name, conforms):
    corners, integral = OUTLINES[name]
    surface, (places, weights) = Surface.from_outline(corners, 1600), integral()
    conforms.closed_form(surface.area, polygon_area(corners), rtol=1e-9)
    conforms.independent(weights.sum(), polygon_area(corners), rtol=1e-9)
    off = [
        relative_error(surface, (places, weights), shape, hertz)
        for hertz in (60, 300, 900)
        for shape in SHAPES.values()
    ]
    ratio = np.sqrt(np.mean(np.square(off))) / surface.sum_std
    conforms.independent(ratio, above=0.02, below=1)
    assert np.max(np.abs(off)) < 3 * surface.sum_std


def test_the_error_of_a_sum_falls_with_the_fourth_power_of_its_cells(conforms):
    shape, integral = SHAPES["three by two"], rectangle((0, 0.6), (0, 0.4))
    off = [
        relative_error(Surface.from_outline(PLATE, 4 * nodes), integral, shape, 900)
        for nodes in (24, 96, 384)
    ]
    conforms.order(orders(off), 4, atol=0.4)


def test_a_clipped_polygon_has_the_moments_of_its_part(conforms):
    """A triangle cut to a trapezium, and an L of which two parts lie in the box."""
    triangle = clip_polygon([[0, 0], [2, 0], [0, 2]], [0, 0], [1, 1])
    whole, centre, variances = polygon_moments(triangle)
    conforms.closed_form(whole, 1, rtol=1e-12)
    u = [[0, 0], [3, 0], [3, 2], [2, 2], [2, 1], [1, 1], [1, 2], [0, 2]]
    whole, centre, variances = polygon_moments(clip_polygon(u, [0, 1.5], [3, 2]))
    conforms.closed_form(whole, 1, rtol=1e-12)
    conforms.closed_form(centre, [1.5, 1.75], rtol=1e-12)
    conforms.closed_form(variances, [1 / 12 + 1, 0.25 / 12], rtol=1e-12)
    assert polygon_moments(clip_polygon(u, [5, 5], [6, 6]))[0] == 0


# Without a wall.

C = AIR.speed_of_sound
UNIT_DISC = disc(1.0)
RATIOS = 0.1, 0.25, 0.5, 1, 1.5, 2, 3, 4  # of the frequency to c/2L
STRIPS = {  # half-waves: power of one side over that in a wall, dB
    1: (-20, -11, -4, 1, 0, 0, 0, 0),
    2: (-30, -22, -16, -8, -1, 1, 0, 0),
    3: (-26, -17, -10, -5, -8, -5, 1, 0),
    5: (-28, -20, -12, -7, -11, -9, -3, -3),
}


def both(outline, shape, k, cells=400):
    """Power of one side without a wall and in one, of a displacement of 1."""
    parts = Screen.from_outline(outline, cells), Surface.from_outline(outline, 1600)
    return [float(own.power_form(shape(*own.places)[:, None], k * C)[0, 0]) for own in parts]


def test_a_bulging_disc_has_the_table_of_levels(conforms):
    """Power of both sides over that of one side in a wall."""
    for ka, level in ((0.1, -27), (0.25, -19), (0.5, -13), (1, -6), (1.57, 1)):
        without, wall = both(UNIT_DISC, lambda x, y: j0(2.405 * np.hypot(x, y)), ka)
        conforms.independent(10 * np.log10(2 * without / wall), level, atol=0.6)


def test_an_angle_that_no_cell_fits_is_not_estimated():
    """Its legs are a 25th of their length; cells are a 20th, or a 14th."""
    angle = np.array([[0, 0], [50, 0], [50, 2], [2, 2], [2, 50], [0, 50]]) / 100
    for cells in (400, 200):
        without, wall = both(angle, lambda x, y: 1 + 0 * x, 0.5, cells)
        assert np.isnan(without)
        assert wall > 0


def test_a_stiff_disc_is_a_dipole_at_low_frequency(conforms):
    """Air resists with the mass 8ρa³/3 (H. Lamb), and W = k²F²/24πρc."""
    k = 0.05
    without, _ = both(UNIT_DISC, lambda x, y: 1 + 0 * x, k)
    force = (k * C) ** 2 * 8 / 3 * AIR.density
    dipole = k**2 * force**2 / (24 * np.pi * AIR.density * C) / 2
    conforms.closed_form(without, dipole, rtol=0.02)


@pytest.mark.few(2)
@pytest.mark.parametrize("n", STRIPS)
def test_a_strip_without_a_wall_has_the_table_of_levels(n, conforms):
    """Of infinite length, by cells that are added up along it."""
    found = [strip(n, np.pi * ratio / 2) for ratio in RATIOS]
    conforms.independent(found, STRIPS[n], atol=0.6)


def strip(n, k, count=48):
    """Level of a strip of width 2 with n half-waves: one side without a wall over one in a wall."""
    across, along = 2 / (count + 0.5), 0.3 / k
    kernel = cell_kernel((count, 900), np.array([across, along]), k)
    fade = np.cos(np.pi / 2 * np.clip(np.linspace(-1, 1, 900), 0, 1)) ** 2  # no end far away
    line = kernel @ (fade * np.where(np.arange(900), 2, 1))
    v = np.sin(n * np.pi * (np.arange(count) + 0.75) * across / 2)
    apart = np.abs(np.arange(count)[:, None] - np.arange(count))
    without = np.real(np.vdot(v, np.linalg.solve(line[apart], -1j * k * v))) * across / 4
    (x, w), (t, a) = leggauss(200), leggauss(80)
    shape = np.sin(n * np.pi * (x + 1) / 2)
    waves = np.exp(-1j * k * np.sin(np.pi / 2 * t)[:, None] * x) @ (w * shape)
    wall = np.sum(np.abs(waves) ** 2 * a) * k / 8
    return 10 * np.log10(without / wall)
