"""Shapes of the beam, its motion, and the force behind it, against closed forms."""

import numpy as np
import pytest

from thesis_lib.facts import setups
from thesis_lib.measure.recordings.board import on_surface, rows_on
from thesis_lib.vibration.motion import Component, Motion, steady_amplitudes

BEAM = setups.thesis_beam()
L, W = BEAM.extent
BENDING = Component("bending", 1, 4.25, 0.004, 0.3)
SECOND = Component("bending", 2, 12.0, 0.001, 1.0)
TORSION = Component("torsion", 1, 7.0, 0.002, -0.8)
PARTS = [BENDING, SECOND, TORSION]
PLACES = np.array([[0.05, 0.2, 0.45, 0.623], [0.0, 0.012, 0.03, 0.021]])


# Shapes.


@pytest.mark.parametrize("mode", [1, 3])
def test_bending_is_clamped_and_one_at_the_tip_all_across(conforms, mode):
    shape = Component("bending", mode).shape(BEAM, [[0, 1e-4, L, L], [W, W, 0, W]])
    conforms.closed_form(shape[[0, 2, 3]], [0, 1, 1], atol=1e-12)
    conforms.closed_form(shape[1] / 1e-4, 0, atol=5e-2)  # no slope; curvature grows like mode²


@pytest.mark.parametrize("mode", [1, 3])
def test_torsion_is_clamped_odd_across_and_one_at_the_tip_s_edge(conforms, mode):
    def shape(x, y):
        return Component("torsion", mode).shape(BEAM, np.stack([x, np.full_like(x, y)]))

    x = np.append(np.linspace(0, L, 5), L - 1e-5)
    left, middle, right = (shape(x, y) for y in (0, W / 2, W))
    conforms.invariance(left, -right, rtol=1e-7)
    conforms.closed_form(middle, 0, atol=1e-15)
    assert right[0] == 0
    conforms.closed_form(abs(right[4]), 1, atol=1e-12)
    # No moment at the free end: the twist has no slope there.
    conforms.closed_form(abs(right[4] - right[5]) / 1e-5, below=1e-2 * mode**2)


# Markers.


def test_markers_stand_in_rows_and_the_hole_comes_last(conforms):
    markers = rows_on(BEAM)
    rows = markers.positions[:, :75].reshape(2, 3, 25)
    conforms.closed_form(np.diff(rows[0], axis=1), 0.025, rtol=1e-7)
    conforms.closed_form(np.diff(rows[1], axis=0), 0.010, rtol=1e-7)
    conforms.closed_form(rows.mean(axis=(1, 2)), [L / 2, W / 2], rtol=1e-7)
    np.testing.assert_array_equal(markers.positions[:, 75], [0.024, 0.010])
    assert markers.count == 75
    conforms.closed_form(markers.positions[:, markers.middle_row], BEAM.markers, rtol=1e-7)
    assert rows_on(BEAM, hole=None).positions.shape == (2, 75)


def test_the_world_s_origin_is_the_beam_s_centre(conforms):
    conforms.closed_form(
        on_surface(BEAM.extent, [[0, L, L / 2], [0, W, W / 2]], [0.0, 0.1, 0.0]),
        [[-L / 2, L / 2, 0], [-W / 2, W / 2, 0], [0, 0.1, 0]],
        atol=1e-15,
    )


# Motion.


def test_nothing_moves_before_the_start_and_then_all_of_it(conforms):
    motion = Motion(BEAM, (BENDING,), start=1.0, ramp=0.5)
    before = np.linspace(0, 1, 50)
    np.testing.assert_array_equal(motion.deflection(PLACES, before), 0)
    np.testing.assert_array_equal(motion.force(before), 0)
    t = np.linspace(motion.steady, motion.steady + 1, 2000)
    tip = motion.coordinates(t)[0]
    assert motion.steady == 1.5
    conforms.closed_form(np.abs(tip).max(), 0.004, rtol=1e-4)
    conforms.closed_form(tip, 0.004 * np.sin(2 * np.pi * 4.25 * (t - 1.0) + 0.3), atol=1e-15)


# Force.


def harmonic(signal, t, frequency):
    """Complex amplitude over whole periods, time factor e^{+jωt}."""
    return 2 * np.mean(signal * np.exp(-2j * np.pi * frequency * t))


@pytest.mark.parametrize("part", [BENDING, Component("bending", 2, 12.0, 0.001)])
def test_the_steady_force_is_that_of_one_mode_at_its_displacement_resonance(conforms, part):
    motion, n = Motion(BEAM, (part,), 1.0, 0.5), 1000
    t = motion.steady + np.arange(n) / n / part.frequency
    F = harmonic(motion.force(t), t, part.frequency)
    w = harmonic(motion.coordinates(t)[0], t, part.frequency)
    xi, omega = BEAM.damping, 2 * np.pi * part.frequency
    # At ω = ωₙ √(1 − 2ξ²): |ωₙ² − ω² + 2jξωₙω| = 2ξωₙ² √(1 − ξ²).
    natural = omega / np.sqrt(1 - 2 * xi**2)
    modal = BEAM.mass / 4  # mean of the square of a shape of 1 at the tip
    drive = part.shape(BEAM, BEAM.force_point)[0]
    expected = modal * 2 * xi * natural**2 * np.sqrt(1 - xi**2) * part.amplitude / abs(drive)
    conforms.closed_form(abs(F), expected, rtol=1e-9)
    # The displacement lags by a quarter period, less ξ.
    lag = np.angle(F * np.sign(drive) / w)
    conforms.closed_form(lag, np.arctan(np.sqrt(1 - 2 * xi**2) / xi), atol=1e-9)
    conforms.closed_form(lag, np.pi / 2 - xi, atol=2e-5)


def test_components_add_up_and_torsion_takes_no_force_on_the_axis(conforms):
    motion = Motion(BEAM, tuple(PARTS))
    t = np.linspace(0, 4, 40)
    alone = sum(Motion(BEAM, (part,)).deflection(PLACES, t) for part in PARTS)
    conforms.invariance(motion.deflection(PLACES, t), alone, atol=1e-16)
    conforms.closed_form(Motion(BEAM, (TORSION,)).force(t), 0, atol=0)


# Amplitudes.


def test_complex_amplitudes_are_the_first_harmonic_of_the_deflection(conforms):
    """Components are told apart by their frequency; over four seconds all have whole periods."""
    motion, n = Motion(BEAM, tuple(PARTS), 1.1, 0.5), 400
    t = motion.steady + np.arange(n) * 4 / n
    w = motion.deflection(PLACES, t)
    for part in PARTS:
        factor = np.exp(-2j * np.pi * part.frequency * t)
        expected = 2 / n * np.tensordot(factor, w, axes=1)
        found = steady_amplitudes(motion, PLACES, part.frequency)
        conforms.independent(found, expected, atol=1e-15)
    np.testing.assert_array_equal(steady_amplitudes(motion, PLACES, 5.0), 0)


def test_driving_the_mode_by_the_force_gives_the_motion_back(conforms):
    # m (q̈ + 2ξωₙq̇ + ωₙ²q) = F φ(x_F), integrated by Runge and Kutta's method of order 4.
    motion, xi = Motion(BEAM, (BENDING,), 0.2, 0.5), BEAM.damping
    natural = 2 * np.pi * BENDING.frequency / np.sqrt(1 - 2 * xi**2)
    drive, h = BENDING.shape(BEAM, BEAM.force_point)[0] / (BEAM.mass / 4), 1e-3
    t = np.arange(0, 1.5, h)
    load = drive * motion.force(np.arange(0, 1.5 + h, h / 2))

    def rate(y, a):
        return np.array([y[1], a - 2 * xi * natural * y[1] - natural**2 * y[0]])

    y, path = np.zeros(2), []
    for k in range(len(t)):
        path.append(y[0])
        a, b, c = load[2 * k : 2 * k + 3]
        k1 = rate(y, a)
        k2 = rate(y + h / 2 * k1, b)
        k3 = rate(y + h / 2 * k2, b)
        y = y + h / 6 * (k1 + 2 * k2 + 2 * k3 + rate(y + h * k3, c))
    conforms.independent(path, motion.coordinates(t)[0], atol=1e-6 * 0.004)
