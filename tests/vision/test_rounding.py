"""The law of rounding against enumeration and simulation."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from thesis_lib.figure_sets.parametric import compute as studies
from thesis_lib.figure_sets.registry import validate_request
from thesis_lib.vision import rounding
from thesis_lib.vision.pinhole import CameraArray, hemisphere_rotations, intrinsics, project
from thesis_lib.vision.simulation import measure_deflections
from thesis_lib.vision.triangulation import triangulation_gain

STUDIES = ["beam-distance", "beam-arrays", "beam-aperture", "beam-resolution"]


@given(st.floats(-5, 5))
def test_difference_variance_is_that_of_all_shifts(conforms, displacement):
    n = 20_000
    shift = (np.arange(n) + 0.5) / n - 0.5  # every position of the grid, evenly
    error = np.rint(displacement + shift) - np.rint(shift) - displacement
    conforms.closed_form(abs(np.mean(error)), below=1.5 / n)
    conforms.closed_form(rounding.difference_variance(displacement), np.var(error), atol=2 / n)


def test_difference_variance_is_zero_for_whole_pixels_and_a_quarter_at_most(conforms):
    whole = np.arange(-4, 5)
    conforms.closed_form(rounding.difference_variance(whole), 0, atol=0)
    conforms.closed_form(rounding.difference_variance(whole + 0.5), 0.25, rtol=1e-7)
    displacements = np.linspace(-3, 3, 1001)
    variance = rounding.difference_variance(displacements)
    conforms.invariance(variance, rounding.difference_variance(-displacements), rtol=1e-7)
    conforms.invariance(variance, rounding.difference_variance(displacements + 7), rtol=1e-7)
    conforms.closed_form(np.mean(variance[:-1]), 1 / 6, rtol=1e-3)  # two independent roundings


def test_shifts_belong_to_seed_trial_and_camera_alone(conforms):
    many = rounding.grid_shifts(7, 20, 12)
    assert not many[0].any()  # the nominal run
    conforms.invariance(rounding.grid_shifts(7, 8, 12), many[:9], atol=0)
    conforms.invariance(rounding.grid_shifts(7, 20, 12, 15), many[15:], atol=0)
    conforms.invariance(rounding.grid_shifts(7, 20, 3), many[:, :3], atol=0)
    assert not np.any(rounding.grid_shifts(8, 20, 12)[1:] == many[1:])
    assert len(np.unique(many[1:])) == 20 * 12 * 2


def test_shifts_are_uniform_over_a_pixel_and_independent(conforms):
    shifts = rounding.grid_shifts(0, 4000, 2)[1:].reshape(4000, 4)
    assert np.max(np.abs(shifts)) <= 0.5
    for column in shifts.T:
        counts = np.histogram(column, bins=10, range=(-0.5, 0.5))[0]
        chi_squared = np.sum((counts - 400) ** 2 / 400)  # 9 degrees of freedom, p = 1e-4
        conforms.sampled(chi_squared, below=33.7)
    correlation = np.corrcoef(shifts.T) - np.eye(4)
    conforms.sampled(np.max(np.abs(correlation)), below=0.07)


@pytest.mark.few(3)
@pytest.mark.parametrize("name", STUDIES)
@pytest.mark.parametrize("rest", ["rebuilt", "known"])
def test_predicted_error_is_the_rms_over_trials(conforms, name, rest):
    cube = studies.run(validate_request(name, {"trials": 2000, "rest": rest}))
    simulated = np.sqrt(np.mean(cube["mean_error"].values[:, :, 1:] ** 2, axis=2))
    conforms.sampled(cube["predicted_error"] / simulated, 1, atol=0.03)


@pytest.mark.parametrize("pixels", [1, 3])
def test_motion_by_whole_pixels_is_measured_without_error(conforms, pixels):
    """By parallel cameras along −Y, to which whole pixels of height and of disparity exist."""
    K = np.stack([intrinsics(200, (320, 180))] * 2)
    centres = np.array([[0.1, 0.5, 0], [-0.1, 0.5, 0]])
    rig = CameraArray(K, hemisphere_rotations([0, 0], [0, 0]), centres, (320, 180))
    step = 0.5 / 200  # metres per pixel at the origin
    shifts = np.repeat(rounding.grid_shifts(0, 50, 1), 2, axis=1)  # the same in both cameras
    # Of half a pixel more one or the other whole one is seen, never the half between them.
    for moved, off in ((pixels, 0), (pixels + 0.5, step / 2)):
        points = np.zeros((3, 2, 9))
        points[0], points[2, 1] = np.linspace(-0.1, 0.1, 9), moved * step
        error = measure_deflections(rig, points, shifts) - moved * step
        conforms.closed_form(np.abs(error), off, atol=1e-12)


@pytest.mark.parametrize("height", [0.004, 0.15])  # so high that the gains differ from rest
def test_variance_is_that_of_the_linearised_measurement(conforms, height):
    # The law itself, without the non-linearity of triangulation: gains times sampled roundings.
    rng = np.random.default_rng(5)
    study = validate_request("beam-aperture", {})
    P = study.settings()[2].cameras(24, 36).P
    rest = np.array([0.2, 0.01, 0.0])
    deflected = rest + [0, 0, height]
    shift = rng.uniform(-0.5, 0.5, (2, 2, 400_000))

    def rounding_error(point):
        uv = project(P, point)[:, :, None] + shift
        return np.rint(uv) - uv

    after = np.einsum("nc,nct->t", triangulation_gain(P, deflected)[2], rounding_error(deflected))
    before = np.einsum("nc,nct->t", triangulation_gain(P, rest)[2], rounding_error(rest))
    for known, sampled in ((False, after - before), (True, after)):
        law = rounding.deflection_variance(P, rest, deflected, known)
        conforms.sampled(law, np.var(sampled), rtol=0.01)


@pytest.mark.parametrize("displacement", [0.0, 2.3, -2.5, 40.9])
@pytest.mark.parametrize("width", [0.0, 1e-9, 1e-5])
def test_the_mean_over_a_narrow_range_is_the_variance_in_it(conforms, displacement, width):
    mean = rounding.mean_difference_variance(displacement, 1, 1 + width)
    conforms.closed_form(mean, rounding.difference_variance(displacement), atol=1e-3)


# Noise before rounding.


@pytest.mark.parametrize("noise", [0.03, 0.4])
def test_noise_blurs_the_law_and_adds_its_own(conforms, noise):
    rng = np.random.default_rng(3)
    place, first, second = rng.uniform(-0.5, 0.5, 200_000), *rng.normal(0, noise, (2, 200_000))
    for displacement in (0.0, 0.2, 0.5, 1.7):
        error = np.rint(place + displacement + second) - np.rint(place + first) - displacement
        law = 2 * noise**2 + rounding.noisy_difference_variance(displacement, noise)
        conforms.sampled(np.mean(error**2), law, rtol=0.02)


@pytest.mark.slow
@pytest.mark.parametrize(("known", "noise_px"), [(False, 0.05), (True, 0.3)])
def test_covariance_with_noise_is_that_of_draws(conforms, known, noise_px):
    study = validate_request("beam-arrays", {"cases": ["4d"]})
    cameras = study.settings()[1].cameras(24, 36)
    x, y = study.structure.markers[:, ::8]
    rest = np.stack([x - x.mean(), y, np.zeros_like(x)])
    points = np.stack([rest, rest + np.array([0, 0, 2e-3])[:, None]], axis=1)
    trials = 20_000
    noise = noise_px * rounding.image_noise(5, trials, [1], len(cameras), points.shape[2])
    shifts = rounding.grid_shifts(5, trials, len(cameras))
    found = measure_deflections(cameras, points, shifts, known, noise=noise, noise_px=noise_px)
    error = found[0, 1:] - 2e-3
    arguments = cameras.P, points[:, 0], points[:, 1], known
    law = rounding.deflection_covariance(*arguments, noise_px)
    scale = np.sqrt(np.diag(law))[:, None] * np.sqrt(np.diag(law))
    conforms.sampled(error.T @ error / trials / scale, law / scale, atol=0.04)
    variance = rounding.deflection_variance(*arguments, noise_px=noise_px)
    conforms.closed_form(np.diag(law), variance, rtol=1e-9)
