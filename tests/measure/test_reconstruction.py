"""From tracks to deflections: subsets, rigid motions, exact harmonics, sampled scatter."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, strategies as st
from refused import line_of
from scenes.convergence import orders
from scipy.special import j0

from thesis_lib.facts import setups
from thesis_lib.measure.fitting import harmonics, marker_size, reconstruction as rc
from thesis_lib.measure.fitting.harmonics import fit_harmonics, real_shape
from thesis_lib.measure.recordings.board import rows_on
from thesis_lib.vision.pinhole import hemisphere_cameras, project
from thesis_lib.vision.triangulation import triangulate

BEAM = setups.thesis_beam()
MARKERS = rows_on(BEAM)
WORLD = MARKERS.world[:, : MARKERS.count]
AZIMUTHS = np.radians([10, -10, 190, 170])
P = hemisphere_cameras(0.57, AZIMUTHS, np.radians([22.0] * 4), 1280.0, (1920, 1080)).P
OMEGA = 2 * np.pi * 4.25
SEEDS = st.integers(0, 2**32 - 1)


def rotation(seed):
    R = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
    return R * np.linalg.det(R)


def noise(shape, sigma=0.02, seed=0):
    return sigma * np.random.default_rng(seed).standard_normal(shape)


@pytest.mark.slow
@given(SEEDS)
def test_a_point_is_made_from_the_cameras_that_see_it(conforms, seed):
    rng = np.random.default_rng(seed)
    uv = project(P, WORLD) + noise((4, 2, 75), seed=seed)
    visible = rng.uniform(size=(4, 75)) < 0.6
    uv = np.where(visible[:, None], uv, np.nan)
    points, seen = rc.triangulate_seen(P, uv)
    np.testing.assert_array_equal(seen, visible.sum(axis=0))
    twice = np.flatnonzero(seen >= 2)
    assert np.isnan(np.delete(points, twice, axis=1)).all()
    expected = [triangulate(P[visible[:, k]], uv[visible[:, k]][:, :, k]) for k in twice]
    conforms.independent(points[:, twice], np.transpose(expected), atol=1e-12)


@given(SEEDS)
def test_the_beam_s_frame_undoes_any_rigid_motion(conforms, seed):
    R, t = rotation(seed), np.random.default_rng(seed).uniform(-1, 1, 3)
    frame = rc.fit_grid(R.T @ WORLD + t[:, None], WORLD)
    conforms.invariance(frame.R, R, atol=1e-12)
    conforms.invariance(frame.to_beam(R.T @ WORLD + t[:, None]), WORLD, atol=1e-13)
    conforms.invariance(frame.scale, 1, atol=1e-12)
    conforms.invariance(frame.rms, below=1e-13)
    conforms.invariance(frame.tilt, below=1e-6)


def test_a_wrong_scale_is_reported_and_not_taken_away(conforms):
    scale = 0.9
    frame = rc.fit_grid(scale * WORLD, WORLD)
    conforms.closed_form(frame.scale, scale, rtol=1e-12)
    expected = abs(scale - 1) * np.sqrt(np.mean(np.sum(WORLD**2, axis=0)))
    conforms.closed_form(frame.rms, expected, rtol=1e-9)
    conforms.closed_form(frame.to_beam(scale * WORLD), scale * WORLD, atol=1e-13)


def test_unknown_markers_are_left_out_of_the_fit_which_needs_three(conforms):
    holed = WORLD.copy()
    holed[:, 3:] = np.nan
    holed[:, 60] = WORLD[:, 60]  # of another row
    conforms.closed_form(rc.fit_grid(holed, WORLD).to_beam(WORLD), WORLD, atol=1e-12)
    holed[:, 2:] = np.nan
    assert line_of(ValueError, rc.fit_grid, holed, WORLD).startswith("fewer than three markers")


def series(coefficients, times):
    """Constant, then cosine and sine of each harmonic."""
    values = coefficients[0] + 0 * times[:, None]
    for n in range(1, (len(coefficients) - 1) // 2 + 1):
        c, s = coefficients[2 * n - 1 : 2 * n + 1]
        angle = n * OMEGA * times[:, None]
        values = values + c * np.cos(angle) + s * np.sin(angle)
    return values


TIMES = 0.731 + np.arange(70) / 60


@pytest.mark.parametrize("order", [1, 3])
def test_harmonics_are_found_exactly_however_many_values_are_missing(conforms, order):
    rng = np.random.default_rng(order)
    exact = rng.normal(size=(1 + 2 * order, 30))
    values = series(exact, TIMES)
    values[rng.uniform(size=values.shape) < np.linspace(0, 0.7, 30)] = np.nan
    found = fit_harmonics(OMEGA, TIMES, values, order)
    conforms.closed_form(found.coefficients, exact, atol=1e-10)
    conforms.closed_form(found.sigma, 0, atol=1e-10)
    conforms.closed_form(found.at(OMEGA, TIMES), series(exact, TIMES), atol=1e-9)


@pytest.mark.parametrize("gaps", [0.0, 0.5])
def test_the_covariance_is_the_scatter_of_many_draws(conforms, gaps):
    rng, draws, sigma = np.random.default_rng(7), 4000, 0.3
    missing = rng.uniform(size=70) < gaps
    values = series(np.ones((5, 1)), TIMES) + sigma * rng.standard_normal((70, draws))
    values[missing] = np.nan
    found = fit_harmonics(OMEGA, TIMES, values)
    expected = sigma**2 * found.covariance[..., 0]
    deviations = np.sqrt(np.diag(expected))
    off = (np.cov(found.coefficients) - expected) / np.outer(deviations, deviations)
    conforms.sampled(np.abs(off).max(), below=0.1)
    conforms.sampled(np.sqrt(np.mean(found.sigma**2)), sigma, rtol=0.01)
    conforms.sampled(found.coefficients.mean(axis=1), np.ones(5), atol=5 * sigma / draws**0.5)


@pytest.mark.parametrize(("known", "enough"), [(6, False), (7, True)])
def test_too_few_values_give_nothing(known, enough):
    values = series(np.ones((5, 2)), TIMES)
    values[: 70 - known, 0] = np.nan
    found = fit_harmonics(OMEGA, TIMES, values)
    assert np.isfinite(found.coefficients[:, 0]).all() == enough
    assert np.isfinite(found.sigma[0]) == enough
    assert np.isfinite(found.coefficients[:, 1]).all()


def test_unblurring_undoes_the_mean_over_an_exposure(conforms):
    exact, exposure = np.random.default_rng(2).normal(size=(5, 8)), 1 / 60
    x, weights = np.polynomial.legendre.leggauss(20)
    blurred = np.array([weights / 2 @ series(exact, np.array(t + exposure * x / 2)) for t in TIMES])
    found = fit_harmonics(OMEGA, TIMES, blurred)
    assert np.abs(found.coefficients - exact).max() > 1e-4
    back = found.unblurred(OMEGA * exposure)
    conforms.closed_form(back.coefficients, exact, atol=1e-12)
    loss = np.sinc(4.25 * exposure)
    conforms.closed_form(back.covariance[1, 1], found.covariance[1, 1] / loss**2, rtol=1e-12)
    conforms.invariance(back.covariance[0, 0], found.covariance[0, 0], rtol=1e-7)
    np.testing.assert_array_equal(back.sigma, found.sigma)


AT_ORIGIN = rc.Frame(np.eye(3), np.zeros(3), 0.0, 1.0, 0.0)


@pytest.mark.parametrize("phase", [-3.0, 0.5])
def test_the_shape_has_the_sign_that_the_expected_phase_tells(conforms, phase):
    """It leaves least imaginary; unknown markers stay unknown."""
    shape = np.array([0.1, 0.5, np.nan, -0.7, 2.0])
    amplitude = shape * np.exp(1j * phase)
    for error in (-1.4, 0.0, 1.4):  # any below a quarter turn
        found = real_shape(amplitude, phase + error)
        np.testing.assert_allclose(found, shape, atol=1e-12)
    np.testing.assert_allclose(real_shape(amplitude, phase + np.pi), -shape, atol=1e-12)
    rng = np.random.default_rng(0)
    mixed = rng.normal(size=9) + 1j * rng.normal(size=9)
    turns = np.exp(-1j * np.linspace(0, np.pi, 2001))
    most = np.max(np.sum(np.real(np.outer(turns, mixed)) ** 2, axis=1))
    conforms.independent(np.sum(real_shape(mixed, 0.0) ** 2), most, rtol=1e-5)


@pytest.mark.parametrize("points", [2, 6])
def test_interpolation_converges_with_the_order_of_its_points(conforms, points):
    errors, phases = [], np.linspace(0, 2 * np.pi, 24)
    for step in (1 / 60, 1 / 120, 1 / 240):
        times, at = step * np.arange(40), step * 20.5
        values = np.sin(np.add.outer(OMEGA * times, phases))
        found = rc.interpolate_frames(times, values, at, points)
        errors.append(np.abs(found - np.sin(OMEGA * at + phases)).max())
    conforms.order(orders(errors), points, atol=0.25)


def test_rest_and_instant_are_made_from_the_same_cameras(conforms):
    # Else a camera's error would not cancel.
    bias = 0.5 * np.random.default_rng(1).standard_normal((4, 2, 75))
    rest = project(P, WORLD) + bias
    moved = project(P, WORLD + np.array([[0], [0], [0.003]])) + bias
    whole = rc.deflection_at(P, AT_ORIGIN, rest, moved)
    rest[0, :, :20], moved[1, :, 10:30] = np.nan, np.nan
    rest[2:, 0, 15], moved[3, 1, 15] = np.nan, np.nan
    found = rc.deflection_at(P, AT_ORIGIN, rest, moved)
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(found)), [15])
    conforms.closed_form(found[30:], whole[30:], atol=1e-15)
    conforms.closed_form(np.abs(np.delete(found, 15) - 0.003).max(), below=4e-5)


GRID, RADIUS, WAVES = np.mgrid[-4:5, -4:5].reshape(2, -1) * 0.02, 0.006, np.array([[30.0], [20.0]])
WAVE = np.cos(WAVES * GRID).prod(axis=0)


def test_markers_on_a_wave_lose_the_mean_around_their_edges_and_on_a_plane_nothing(conforms):
    moved = np.array([j0(RADIUS * np.hypot(*WAVES)) * WAVE, 2 + GRID[0] - 3 * GRID[1]])
    moved[:, 9] = np.nan
    points = np.array([*GRID, 0 * WAVE])
    still = rc.Rest(np.full((4, 2, 81), np.nan), AT_ORIGIN, points, GRID, 0.0, RADIUS)
    found = marker_size.fit_correction(P, still, moved).correct_deflections(moved)
    off, before = (np.nanstd(w[0] - WAVE) for w in (found, moved))
    conforms.closed_form(off / before, below=0.2)
    conforms.invariance(np.nanmax(np.abs(found[1] - moved[1])), below=1e-14)


def test_cameras_that_see_edges_bend_unequally_agree_after_the_correction(conforms):
    phase = np.exp(1j * np.arange(64) * np.pi / 32)
    edge = GRID[..., None] + RADIUS * np.array([phase.real, phase.imag])[:, None]
    wave = 1e-5 * np.cos(WAVES[..., None] * edge).prod(axis=0)
    seen = [project(P, np.array([*edge, height])) for height in (0 * wave, wave)]
    x, y = np.moveaxis(seen, 2, 0)
    cross = x * np.roll(y, -1, -1) - np.roll(x, -1, -1) * y  # for the centroid of an edge's image
    uv = [((v + np.roll(v, -1, -1)) * cross).sum(-1) / (3 * cross.sum(-1)) for v in (x, y)]
    pairs = np.stack(uv, axis=2).swapaxes(0, 1)
    known = np.zeros((3, 3, 2, 81))  # without noise
    each = [harmonics.Harmonics(np.array([a, b - a, 0 * a]), known, 0 * a) for a, b in pairs]
    fit = harmonics.Fitted([SimpleNamespace(P=one) for one in P], each, pairs[:, 0], AT_ORIGIN)
    still = rc.Rest(fit.rest, AT_ORIGIN, fit.points, GRID, 0.0, RADIUS)
    both = fit, marker_size.correct_fit(fit, OMEGA, np.zeros(4), still)[0]
    off = [harmonics.motion_amplitude(own, OMEGA, 0.0) - [[0], [0], [1e-5]] * WAVE for own in both]
    conforms.independent(np.std(off[1]) / np.std(off[0]), below=0.3)


def test_a_deflection_errs_by_what_the_cameras_that_see_its_marker_state(conforms):
    """A tenth of the centres of an instant are missing at random."""
    world = np.tile(WORLD, 80)
    rest, moved = project(P, world), project(P, world + np.array([[0], [0], [0.003]]))
    shape, sigma = rest.shape, 0.05
    seen = np.random.default_rng(4).random((4, 1, shape[2])) < 0.9
    uv = np.where(seen, moved + noise(shape, sigma, 1), np.nan)
    still, each = rest + noise(shape, sigma, 2), np.full(shape, np.sqrt(2) * sigma)
    found, std = rc.measure_instant(P, AT_ORIGIN, still, uv, each)
    off = (found - 0.003) / std
    count = seen.sum(axis=(0, 1))
    np.testing.assert_array_equal(np.isfinite(off), count >= 2)
    for n in (2, 3, 4):
        conforms.sampled(np.sqrt(np.mean(off[count == n] ** 2)), 1, atol=0.1)
