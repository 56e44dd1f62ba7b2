"""Standard errors of sound: exact moments, draws, closed forms of radiators."""

import numpy as np
import pytest
from scenes.outlines import disc
from scipy.special import j1

from thesis_lib.acoustics import estimates
from thesis_lib.acoustics.radiation import AIR
from thesis_lib.acoustics.surfaces import Surface

DRAWS = 3000
N = 5
RNG = np.random.default_rng(3)
ROWS = RNG.normal(size=(3, N)) + 1j * RNG.normal(size=(3, N))
SPREAD = RNG.normal(size=(2 * N, 2 * N)) * 0.15
TRUE = RNG.normal(size=N) + 1j * RNG.normal(size=N)
FORM = np.real(np.conj(ROWS).T @ ROWS)


def drawn(scale=1.0):
    """Measured amplitudes, with the covariance of their errors."""
    errors = np.random.default_rng(4).normal(size=(DRAWS, 2 * N)) @ (scale * SPREAD).T
    measured, C = TRUE + errors[:, :N] + 1j * errors[:, N:], scale**2 * SPREAD @ SPREAD.T
    return [estimates.Amplitudes(w, C) for w in measured]


def judged(found, truth, conforms, unbiased=0.0):
    """Scatter within 10 % of the standard errors, and the truth within two of them."""
    value, error = (np.array([getattr(one, name) for one in found]) for name in ("value", "error"))
    scatter = value.std(axis=0)
    conforms.independent(np.sqrt(np.mean(error**2, axis=0)), scatter, rtol=0.1)
    assert np.all(np.abs(value.mean(axis=0) - truth) < 5 * scatter / np.sqrt(len(value)) + unbiased)
    within = np.mean(np.abs(value - truth) < 2 * error, axis=0)
    assert np.all((within > 0.93) & (within < 0.975)), within


def test_powers_are_unbiased_and_their_errors_are_those_of_draws(conforms):
    found = [estimates.estimate_quadratic_form(FORM, one) for one in drawn(0.4)]
    judged(found, np.real(np.conj(TRUE) @ FORM @ TRUE), conforms)


def test_powers_of_modes_one_by_one_and_together(conforms):
    every = drawn(0.12)
    each = [estimates.estimate_squares(ROWS, one) for one in every]
    judged(each, np.abs(ROWS @ TRUE) ** 2, conforms)
    total = [estimates.estimate_sum(ROWS, one) for one in every]
    judged(total, np.sum(np.abs(ROWS @ TRUE) ** 2), conforms)
    conforms.invariance(float(total[0].value), each[0].value.sum(), rtol=1e-12)
    apart = np.hypot(float(each[0].error[0]), np.hypot(*each[0].error[1:]))
    assert abs(float(total[0].error) / apart - 1) > 0.05  # they see the same errors


@pytest.mark.parametrize("of", ["quadratic", "factored", "summed"])
def test_stated_variances_are_in_the_mean_those_of_the_estimates(of, conforms):
    """Exactly, over points that have the mean and the covariance of what is measured."""
    forms = {
        "quadratic": lambda known: estimates.estimate_quadratic_form(FORM, known),
        "factored": lambda known: estimates.estimate_squares(ROWS[:1], known),
        "summed": lambda known: estimates.estimate_sum(ROWS, known),
    }
    S = 0.12 * SPREAD
    away = np.sqrt(2 * N) * np.concatenate([S.T, -S.T])
    x = np.concatenate([TRUE.real, TRUE.imag])
    stated = [
        float(np.ravel(forms[of](estimates.Amplitudes(one[:N] + 1j * one[N:], S @ S.T)).error)[0])
        for one in x + away
    ]
    R = estimates.stack_matrix(ROWS[:1] if of == "factored" else ROWS)
    A = np.kron(np.eye(2), FORM) if of == "quadratic" else R.T @ R
    AS = A @ S @ S.T
    own = 2 * float(np.sum(AS * AS.T))
    slopes = 4 * float(x @ AS @ A @ x)
    assert own > 5e-4 * slopes  # else nobody would see it
    conforms.closed_form(np.mean(np.square(stated)), slopes + own, rtol=1e-9)


def test_quotients_and_absolute_values(conforms):
    each = drawn(0.2)
    truth = np.real(np.conj(TRUE) @ FORM @ TRUE) / np.sum(np.abs(TRUE) ** 2)
    ratios = [estimates.estimate_ratio(FORM, np.eye(N), one) for one in each]
    judged(ratios, truth, conforms, 0.01 * truth)
    pressures = [estimates.estimate_magnitude(ROWS, one) for one in each]
    judged(pressures, np.abs(ROWS @ TRUE), conforms, 0.01)


def test_what_all_amplitudes_share_does_not_average_out(conforms):
    w = np.full(400, 1 + 1j)
    noisy = estimates.circular_estimate(w, np.full(400, 1e-4))
    alone = estimates.estimate_quadratic_form(np.eye(400), noisy)
    conforms.closed_form(alone.error / alone.value, 2 * 0.01 / np.sqrt(800), rtol=2e-3)
    common = estimates.circular_estimate(w, np.zeros(400), 0.01 * w[None])
    shared = estimates.estimate_quadratic_form(np.eye(400), common)
    conforms.closed_form(shared.error / shared.value, 0.02, rtol=1e-3)  # 2 of a relative error


@pytest.mark.parametrize("ka", [0.3, 3.0])
def test_a_baffled_piston_has_the_resistance_of_its_bessel_function(ka, conforms):
    a, omega = 0.1, ka * AIR.speed_of_sound / 0.1
    surface = Surface.from_outline(disc(a), 1600)
    conforms.closed_form(surface.area, np.pi * a**2, rtol=1e-12)
    rigid, w = np.ones((surface.share.size, 1)), 1e-6
    power = float(np.ravel(surface.power_form(rigid, omega))[0]) * w**2
    plane = AIR.density * AIR.speed_of_sound * np.pi * a**2 * (omega * w) ** 2 / 2
    conforms.closed_form(power / plane, 1 - j1(2 * ka) / ka, rtol=1e-3)
    above = np.array([[0.0], [0.0], [0.5]])  # pressure on the axis, exactly
    k, far = omega / AIR.speed_of_sound, np.hypot(0.5, a)
    exact = 2 * AIR.density * AIR.speed_of_sound * omega * w * abs(np.sin(k * (far - 0.5) / 2))
    found = abs(surface.pressure_matrix(rigid, above, omega)[0, 0]) * w
    conforms.closed_form(found, exact, rtol=4e-3)
