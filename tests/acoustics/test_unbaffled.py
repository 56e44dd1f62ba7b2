"""Sound of thin structures without a wall, against other solutions and closed forms."""

import numpy as np
import pytest
from numpy.polynomial.legendre import leggauss
from scipy.special import j0

from thesis_lib.acoustics.sources import AIR
from thesis_lib.acoustics.surfaces import Screen, Surface, cell_kernel

C = AIR.speed_of_sound
TURN = 2 * np.pi * (np.arange(96) + 0.5) / 96
GROWN = 1 / np.sqrt(np.sin(2 * np.pi / 96) / (2 * np.pi / 96))  # a polygon as large as the disc
DISC = GROWN * np.column_stack([np.cos(TURN), np.sin(TURN)])
SQUARE = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
RATIOS = 0.1, 0.25, 0.5, 1, 1.5, 2, 3, 4  # of the frequency to c/2L
STRIPS = {  # half-waves: power of one side over that in a wall, dB
    1: (-20, -11, -4, 1, 0, 0, 0, 0),
    2: (-30, -22, -16, -8, -1, 1, 0, 0),
    3: (-26, -17, -10, -5, -8, -5, 1, 0),
    5: (-28, -20, -12, -7, -11, -9, -3, -3),
}


def both(outline, shape, k, cells=400):
    """Power of one side without a wall and in one, of a displacement of 1."""
    screen, surface = Screen.from_outline(outline, cells), Surface.from_outline(outline, 1600)
    return [
        float(own.power_form(shape(*own.places)[:, None], k * C)[0, 0]) for own in (screen, surface)
    ]


def test_a_bulging_disc_has_the_table_of_levels(conforms):
    """Power of both sides over that of one side in a wall."""
    for ka, level in ((0.1, -27), (0.25, -19), (0.5, -13), (1, -6), (1.57, 1)):
        without, wall = both(DISC, lambda x, y: j0(2.405 * np.hypot(x, y)), ka)
        conforms.independent(10 * np.log10(2 * without / wall), level, atol=0.6)


@pytest.mark.parametrize("cells", [200, 400])
def test_a_stiff_disc_is_a_dipole_at_low_frequency(cells, conforms):
    """Air resists with the mass 8ρa³/3 (H. Lamb), and W = k²F²/24πρc."""
    k = 0.05
    without, _ = both(DISC, lambda x, y: 1 + 0 * x, k, cells)
    force = (k * C) ** 2 * 8 / 3 * AIR.density
    dipole = k**2 * force**2 / (24 * np.pi * AIR.density * C) / 2
    conforms.closed_form(without, dipole, rtol=0.02)


def test_far_above_its_edges_a_structure_needs_no_wall(conforms):
    outline = SQUARE * [0.6, 0.4]
    k = 3 * np.hypot(np.pi / 0.6, np.pi / 0.4)
    without, wall = both(outline, lambda x, y: np.sin(np.pi * x / 0.6) * np.sin(np.pi * y / 0.4), k)
    conforms.closed_form(10 * np.log10(without / wall), 0, atol=0.1)


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
    waves = np.exp(-1j * k * np.sin(np.pi / 2 * t)[:, None] * x) @ (
        w * np.sin(n * np.pi * (x + 1) / 2)
    )
    wall = np.sum(np.abs(waves) ** 2 * a) * k / 8
    return 10 * np.log10(without / wall)
