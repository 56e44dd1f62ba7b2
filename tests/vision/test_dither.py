"""What many frames gain: closed forms against frames that are drawn, rounded and averaged."""

import numpy as np
import pytest

from thesis_lib.facts import setups
from thesis_lib.vibration.structure import deflection_shape, world_points
from thesis_lib.vision import dither, rounding
from thesis_lib.vision.pinhole import project
from thesis_lib.vision.triangulation import triangulate

GOLDEN = (np.sqrt(5) - 1) / 2


def phases(frames):
    """Phases of a sinusoid filmed at a rate that has no ratio to its frequency."""
    return 2 * np.pi * (np.arange(frames) * GOLDEN % 1)


def grids(n):
    """Places of the pixel grid, evenly spaced over one pixel."""
    return (np.arange(n) + 0.5) / n - 0.5


@pytest.mark.parametrize("amplitude", [0.1, 0.5, 2.3])
def test_motion_dithers_as_its_bessel_functions_say(conforms, amplitude):
    theta, c = phases(4000), grids(1501)[:, None]
    u = np.rint(c + amplitude * np.cos(theta)) - c
    mean = np.mean(np.mean(u, axis=1) ** 2)
    fitted = np.mean((2 * np.mean(u * np.cos(theta), axis=1) - amplitude) ** 2)
    conforms.sampled(dither.mean_variance(amplitude), mean, rtol=0.03)
    conforms.sampled(dither.amplitude_variance(amplitude), fitted, rtol=0.03)


@pytest.mark.parametrize("amplitude", [1e-5, 0.05, 0.49])
def test_amplitude_below_half_a_pixel_has_a_closed_form(conforms, amplitude):
    # A grid line within the motion, at d from its middle, turns it into a square wave, whose fit
    # is (2/π) √(1 − (d/a)²); one outside (1 − 2a of them) shows no motion.
    a = amplitude
    inside = 2 * a * ((2 / np.pi) ** 2 * 2 / 3 - 2 * a * (2 / np.pi) * np.pi / 4 + a**2)
    conforms.closed_form(dither.amplitude_variance(a), inside + (1 - 2 * a) * a**2, rtol=1e-9)


@pytest.mark.parametrize("shake", [0.05, 0.3, 1.0])
def test_shake_dithers_as_its_characteristic_function_says(conforms, shake):
    rng, c = np.random.default_rng(0), grids(4000)[:, None]
    one = np.exp(-2 * np.pi**2 * shake**2) / (np.sqrt(2) * np.pi)
    assert dither.mean_variance(0, shake) >= one**2 * (1 - 1e-12)
    if shake >= 0.3:
        conforms.sampled(dither.mean_variance(0, shake), one**2, rtol=1e-2)
    for frames in (1, 4, 30):
        u = np.rint(c + shake * rng.standard_normal((4000, frames))) - c
        drawn = np.mean(np.mean(u, axis=1) ** 2)
        conforms.sampled(dither.shaken_variance(frames, shake), drawn, rtol=0.1)


def test_shake_and_motion_dither_together(conforms):
    rng, theta, c = np.random.default_rng(0), phases(20_000), grids(401)[:, None]
    noise = rng.standard_normal(theta.shape)  # one shake for all grids
    u = np.rint(c + 0.4 * np.cos(theta) + 0.15 * noise) - c - 0.15 * noise
    fitted = np.mean((2 * np.mean(u * np.cos(theta), axis=1) - 0.4) ** 2)
    conforms.sampled(dither.amplitude_variance(0.4, 0.15), fitted, rtol=0.1)


@pytest.mark.parametrize("diameter", [3, 8.5, 25])
def test_centroid_of_a_disc_is_as_exact_as_its_lattice_sum(conforms, diameter):
    rng, n = np.random.default_rng(0), int(diameter) // 2 + 2
    line = np.arange(-n, n + 1.0)
    squared = []
    for x, y in rng.uniform(-0.5, 0.5, (3000, 2)):
        inside = (line - x) ** 2 + (line[:, None] - y) ** 2 <= diameter**2 / 4
        squared.append((np.sum(inside * line) / np.sum(inside) - x) ** 2)
    conforms.sampled(np.sqrt(dither.disc_variance(diameter)), np.sqrt(np.mean(squared)), rtol=0.06)


@pytest.mark.parametrize(("distance_mm", "peak_mm"), [(500, 30), (1500, 5.5)])
def test_deflection_of_a_vibration_is_as_exact_as_predicted(conforms, distance_mm, peak_mm):
    beam = setups.thesis_beam()
    shape = deflection_shape(beam, 1, beam.markers, peak_mm / 1000)
    points = world_points(beam, np.stack([0 * shape, shape]))
    setting = setups.distance_settings([distance_mm], 30, 25, (320, 180))[0]
    P, theta = setting.cameras(24, 36).P, phases(500)
    moving = points[:, 0, :, None] + (points[:, 1] - points[:, 0])[:, :, None] * np.cos(theta)
    images = project(P, moving)
    errors = []
    for shift in rounding.grid_shifts(0, 120, 2)[1:, :, :, None, None]:
        height = triangulate(P, np.rint(images + shift) - shift)[2]
        errors.append(2 * np.mean(height * np.cos(theta), axis=-1) - shape)
    found = np.sqrt(np.mean(np.square(errors)))
    expected = np.sqrt(np.mean(dither.deflection_variance(P, points[:, 0], points[:, 1])))
    conforms.sampled(expected, found, rtol=0.06)
    one_pair = rounding.deflection_variance(P, points[:, 0], points[:, 1])
    assert expected < np.sqrt(np.mean(one_pair))
