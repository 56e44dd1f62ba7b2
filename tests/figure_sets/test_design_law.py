"""The law of rounding for design: closed forms against Jacobians, drawings and brute force."""

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scenes.small import REQUESTS, small_cube
from scipy.stats import qmc

from thesis_lib.facts import setups
from thesis_lib.figure_sets.design_law import shares as design_shares, sweeps as design_sweeps
from thesis_lib.figure_sets.registry import validate_request
from thesis_lib.studies.cubes import read_published
from thesis_lib.vision import cone_law, dither, rounding, simulation
from thesis_lib.vision.pinhole import hemisphere_cameras, project
from thesis_lib.vision.triangulation import point_covariance, triangulate

SIZE = (320, 180)
distances, focals = st.floats(0.2, 20), st.floats(50, 5000)
angles = st.floats(0.05, 1.5)


@pytest.fixture(scope="module")
def study():
    return validate_request("design-law", REQUESTS["design-law"])


@pytest.fixture(scope="module")
def cube():
    return small_cube("design-law")


# Closed forms.


@given(distances, focals, st.integers(3, 64), angles)
def test_cone_covariance_is_that_of_the_jacobian(conforms, distance, focal, n, angle):
    closed = cone_law.cone_covariance(distance, focal, n, angle, 0.3)
    P = cone_law.cone_cameras(distance, angle, n, focal, SIZE).P
    scale = np.sqrt(np.outer(np.diag(closed), np.diag(closed)))
    conforms.closed_form(point_covariance(P, np.zeros(3), 0.3) / scale, np.eye(3), atol=1e-12)


@given(distances, focals, st.integers(2, 64), angles)
def test_deflection_error_of_a_cone_holds_from_two_cameras_on(conforms, distance, focal, n, angle):
    P = cone_law.cone_cameras(distance, angle, n, focal, SIZE).P
    exact = np.sqrt(point_covariance(P, np.zeros(3), cone_law.MOTION_PX)[2, 2])
    closed = cone_law.cone_deflection_error(distance, focal, n, angle)
    conforms.closed_form(closed, exact, rtol=1e-12)


@given(distances, focals, st.floats(0.05, 3.1), st.floats(0.02, 1.4), st.floats(-3, 3))
def test_noise_of_a_pair_is_that_of_the_jacobian_wherever_it_looks_from(
    conforms, d, f, alpha, phi, turn
):
    P = hemisphere_cameras(d, [turn + alpha / 2, turn - alpha / 2], [phi, phi], f, SIZE).P
    exact = np.sqrt(point_covariance(P, np.zeros(3), 0.5)[2, 2])
    closed = cone_law.pair_noise_error(d, f, alpha, phi, 0.5)
    conforms.closed_form(closed, exact, rtol=1e-9)


# Brute force: images, whole pixels and triangulation; no law.


def drawn(rig, points, draws):
    """Errors (3, moved, draws, markers) of motions from the first of points (3, 1 + moved, m)."""
    shift = qmc.Sobol(2 * len(rig), rng=0).random_base2(draws) - 0.5
    shift = np.moveaxis(shift.reshape(-1, len(rig), 2), 0, 2)[:, :, None, :, None]
    found = triangulate(rig.P, np.rint(project(rig.P, points)[:, :, :, None] + shift) - shift)
    return found[:, 1:] - found[:, :1] - (points[:, 1:] - points[:, :1])[:, :, None]


MOVED_PX = np.array([0.1, 0.5, 0.8, 1.3, 1.5, 2.2])  # of the image, about
DIRECTIONS = np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0], [0.6, -0.3, 0.7], [-0.2, 0.5, 0.8]])


def pair_error(distance, focal, aperture, elevation, motion):
    """Closed form of a pair for rounded motions (3, ...) of the centre in any direction, in m."""
    azimuth = [aperture / 2, -aperture / 2]
    P = hemisphere_cameras(distance, azimuth, [elevation] * 2, focal, SIZE).P
    moved = np.asarray(motion, float)
    images = project(P, np.stack([np.zeros_like(moved), moved], axis=1))
    variance = rounding.difference_variance(images[:, :, 1] - images[:, :, 0])
    u, v = np.sqrt(variance.mean(axis=0))
    return cone_law.pair_deflection_error(distance, focal, aperture, elevation, v, u)


@pytest.mark.parametrize("aperture", [16, 120])
@pytest.mark.parametrize("elevation", [10, 60])
def test_law_of_a_pair_is_that_of_draws_for_any_motion(conforms, aperture, elevation):
    alpha, phi, distance, focal = np.radians(aperture), np.radians(elevation), 0.5, 8000.0
    rig = hemisphere_cameras(distance, [alpha / 2, -alpha / 2], [phi, phi], focal, SIZE)
    moved = np.concatenate(distance / focal * MOVED_PX[:, None] * DIRECTIONS[:, None]).T
    points = np.concatenate([np.zeros((3, 1)), moved], axis=1)[..., None]
    found = np.sqrt(np.mean(drawn(rig, points, 13)[2] ** 2, axis=(1, 2)))
    law = pair_error(distance, focal, alpha, phi, moved)
    conforms.sampled(found, law, rtol=0.01, atol=1e-4 * distance / focal)
    # Deflections alone, over all amplitudes: the aperture is nowhere in it.
    bent = np.zeros((3, 257, 1))
    bent[2, :, 0] = np.linspace(0, distance / focal / np.cos(phi), 257)
    rms = np.sqrt(np.mean(drawn(rig, bent, 10)[2] ** 2))
    closed = distance / focal * np.sqrt(1 / 6) / np.sqrt(2) / np.cos(phi)
    conforms.sampled(rms, closed, rtol=0.01)
    conforms.closed_form(
        cone_law.pair_deflection_error(distance, focal, alpha, phi), closed, rtol=1e-12
    )


@pytest.mark.parametrize("elevation", [5, 85])
@pytest.mark.parametrize("aperture", [8, 180])
def test_closed_form_of_a_pair_holds_up_to_the_largest_motion(conforms, elevation, aperture):
    """Over the law with the gains of the moved centre."""
    phi, alpha = np.radians(elevation), np.radians(aperture)
    P = hemisphere_cameras(1, [alpha / 2, -alpha / 2], [phi, phi], 213, SIZE).P
    moved = cone_law.MAX_MOTION_FRACTION * np.outer([0, 0, 1], np.linspace(0.5, 1, 101))
    law = np.sqrt(np.mean(rounding.deflection_variance(P, np.zeros((3, 1)), moved)))
    closed = np.sqrt(np.mean(pair_error(1, 213, alpha, phi, moved) ** 2))
    conforms.sampled(closed / law, 1, atol=0.011)


def test_too_few_cameras_are_refused():
    with pytest.raises(ValueError, match="n_cameras: given 2, allowed: 3 or more"):
        cone_law.cone_covariance(1, 213, 2, 1)
    with pytest.raises(ValueError, match="n_cameras: given 1, allowed: 2 or more"):
        cone_law.cone_deflection_error(1, 213, [4, 1], 1)


@given(st.floats(0, 30), st.floats(0, 2), st.floats(0.01, 2))
def test_mean_over_amplitudes_is_that_of_many(conforms, displacement, least, more):
    scale = least + more * (np.arange(20000) + 0.5) / 20000
    many = np.mean(rounding.difference_variance(scale * displacement))
    closed = rounding.mean_difference_variance(displacement, least, least + more)
    conforms.closed_form(closed, many, atol=1e-4)


def test_all_directions_are_alike_at_two_thirds(conforms):
    conforms.closed_form(np.sin(cone_law.ISOTROPIC_ANGLE_RAD) ** 2, 2 / 3, rtol=1e-6)
    conforms.closed_form(np.degrees(cone_law.ISOTROPIC_ANGLE_RAD), 54.7356, atol=1e-4)
    sigmas = np.diag(cone_law.cone_covariance(1, 213, 5, float(cone_law.ISOTROPIC_ANGLE_RAD)))
    conforms.closed_form(sigmas, sigmas[0], rtol=1e-14)
    flat = np.diag(cone_law.cone_covariance(1, 213, 5, np.pi / 2))
    steep = np.diag(cone_law.cone_covariance(1, 213, 5, 1e-6))
    conforms.closed_form(flat[0] / steep[0], 2, rtol=1e-6)  # √2 in the error, at most
    assert steep[2] > 1e9 * steep[0]


# Repeated rounding.


@pytest.mark.parametrize("amplitude", [0.03, 0.5, 2.3])
def test_swing_error_is_that_of_a_long_film_on_every_grid(conforms, amplitude):
    turn = 2 * np.pi * (np.arange(4001) + 0.3) / 4001
    shift = ((np.arange(500) + 0.5) / 500 - 0.5)[:, None]
    seen = np.rint(amplitude * np.cos(turn) + shift) - shift
    error = 2 * np.mean(seen * np.cos(turn), axis=1) - amplitude
    found = np.sqrt(np.mean(error**2))
    conforms.sampled(np.sqrt(dither.amplitude_variance(amplitude)), found, rtol=5e-3)


@pytest.mark.slow
@pytest.mark.parametrize(("frames", "times"), [(13.5, 1.4), (30, 1.2), (100, 1.05)])
def test_error_over_its_limit_by_the_frames_of_each_pixel_of_motion(conforms, frames, times):
    random = np.random.default_rng(0)
    peaks = 4.0 * (0.75 + 0.5 * (np.arange(3000) + 0.5) / 3000)[:, None]
    n = round(4.0 * frames)
    assert dither.useful_frames(peaks[:, 0]) == pytest.approx(13.5 * 4.0, rel=0.05)
    turn = random.uniform(0, 2 * np.pi, peaks.shape) + (
        2 * np.pi * random.uniform(0.02, 0.48, peaks.shape) * np.arange(n)
    )
    shift = random.uniform(-0.5, 0.5, peaks.shape)
    basis = np.stack([np.cos(turn), np.sin(turn), np.ones_like(turn)], axis=2)
    seen = np.rint(peaks * basis[..., 0] + shift) - shift
    error = (np.linalg.pinv(basis) @ seen[..., None])[:, 0, 0] - peaks[:, 0]
    floor = np.sqrt(np.mean(dither.amplitude_variance(peaks)))
    conforms.sampled(np.sqrt(np.mean(error**2)) / floor, times, atol=0.04)


def test_weighted_error_is_the_quadratic_form_of_the_covariance(conforms):
    random = np.random.default_rng(3)
    x, w = random.uniform(-3, 3, (2, 40)), random.normal(size=(2, 40))
    C = rounding.error_covariance(x[:, :, None] - x[:, None])
    exact = np.sqrt(np.einsum("ti,tij,tj->t", w, C, w))
    conforms.independent(cone_law.error_of_sum(x, w), exact, rtol=1e-12)
    # One coordinate alone: 1/12; a motion of whole pixels: nothing; of d px: d (1 − d)
    conforms.closed_form(cone_law.error_of_sum([0.3], [1]), np.sqrt(1 / 12), rtol=1e-12)
    conforms.closed_form(cone_law.error_of_sum([0.3, 5.3], [1, -1]), 0, atol=1e-7)
    conforms.closed_form(cone_law.error_of_sum([3, 3.0001], [1, -1]) ** 2, 9.999e-5, rtol=1e-9)


@given(st.floats(1e6, 1e10), st.integers(2, 64), st.floats(1, 1000))
def test_pixels_per_second_are_shared_out_to_the_last(conforms, total, n, rate):
    width, height, frames = cone_law.equal_pixel_rate(total, n, rate)
    if height > 10:
        conforms.invariance(n * width * height * frames, total, rtol=1e-14)
        assert abs(width * 9 / 16 - height) <= 0.5
        assert frames == pytest.approx(rate, rel=0.2)


# (a) The law.


@pytest.mark.slow
def test_relative_error_grows_as_the_inverse_root_below_a_pixel_and_whole_ones_are_exact(
    conforms, cube
):
    motion = cube["motion"].values
    small = motion < 0.03
    for name, tolerance in (("motion_error", 0.01), ("drawn_motion_error", 0.15)):
        conforms.closed_form(cube[name].sel(motion=[1, 2, 3, 4, 5]), 0, atol=1e-9)
        conforms.closed_form(cube[name].sel(motion=[0.5, 1.5, 4.5]), 0.5, rtol=1e-9)
        relative = cube[name].values[small] / motion[small]
        conforms.order(simulation.fit_exponent(motion[small], relative), -0.5, atol=tolerance)


@pytest.mark.slow
def test_law_is_the_simulation_for_every_setting_of_the_thesis(conforms, cube):
    assert cube["law_error"].shape == (112, 3)
    ratio = cube["law_error"].values / cube["simulated_error"].values
    # An rms over 60 trials of 25 or 150 markers, whose errors go together: a few percent each.
    conforms.sampled(np.abs(np.median(ratio) - 1), below=0.015)
    conforms.sampled(np.std(ratio), below=0.04)
    conforms.sampled(np.abs(ratio - 1), below=0.2)


# (b) The cone.


@pytest.mark.slow
def test_cone_of_the_cube(conforms, cube):
    conforms.closed_form(float(cube["cone_difference"]), below=1e-12)
    conforms.independent(cube["cone_error"], cube["cone_jacobian_error"], rtol=1e-12)
    ratio = cube["cone_drawn_error"] / cube["cone_error"]
    conforms.sampled(ratio, 1, atol=0.1)
    conforms.sampled(np.mean(ratio, axis=0), 1, atol=0.03)
    x, z = (cube["cone_error"].sel(axis=axis).values for axis in "XZ")
    crossing = np.interp(0, x - z, cube["angle"].values)
    conforms.closed_form(crossing, np.degrees(cone_law.ISOTROPIC_ANGLE_RAD), atol=0.1)


# (c) The findings.


def of(cube, kind, finding):
    return cube[f"{kind}_exponent"].sel(finding=finding).values


@pytest.mark.slow
def test_findings_follow_the_law_at_the_centre_over_all_markers_and_far_below_a_pixel(
    conforms, cube
):
    powers = {"distance": 1, "resolution": -1, "number": -0.5, "elevation": -1}
    for finding, power in powers.items():
        conforms.order(of(cube, "centre", finding), power, atol=1e-9)
    conforms.order(of(cube, "expected", "distance"), above=0.85, below=1)
    conforms.order(of(cube, "expected", "resolution"), above=-1, below=-0.9)
    conforms.order(of(cube, "expected", "number"), -0.5, atol=0.005)
    conforms.order(of(cube, "expected", "elevation"), above=-1, below=-0.6)
    assert np.isnan(of(cube, "expected", "aperture")).all()
    for finding, power in (("distance", 0.5), ("resolution", -0.5), ("number", -0.5)):
        conforms.order(of(cube, "small", finding), power, atol=0.02)


def test_closed_forms_are_the_first_order_at_the_centre(conforms, study):
    many = np.zeros((3, 2001, 1))  # a marker at the centre, over ten pixels of motion
    # so that a pixel is nothing to the distance
    tele = study.model_copy(update={"focal_length_mm": 1000 * study.focal_length_mm})
    for finding in design_sweeps.SWEPT_FINDINGS:
        for value in design_sweeps.sweep_values("plate", finding)[::20]:
            cameras, _, noisy = design_sweeps.step_rig(study, "plate", finding, float(value))
            noise = design_sweeps.noise_error(cameras, np.zeros((3, 1)))
            conforms.closed_form(noisy, noise, rtol=1e-9)
            far, error, _ = design_sweeps.step_rig(tele, "plate", finding, float(value))
            up = project(far.P, np.array([[0, 0], [0, 0], [0, 1e-6]]))
            many[2, 1:, 0] = 1e-5 / np.ptp(up[0, 1]) * (np.arange(2000) + 0.5) / 2000
            conforms.closed_form(error, design_sweeps.exact_rms(far, many), rtol=2e-3)


# (d) Equal pixels per second.


@pytest.mark.slow
def test_number_of_cameras_cancels_and_frames_cost_their_root(conforms, cube, study):
    total = cube["count"] * cube["width_px"] * cube["height_px"] * cube["frame_rate"]
    conforms.invariance(total, study.pixels_per_second, rtol=1e-13)
    average = cube["average_error"]
    conforms.closed_form(average / average[0], 1, atol=0.01)  # whole pixels of width
    conforms.closed_form(average[:, 1] / average[:, 0], np.sqrt(8), rtol=0.01)
    slow = cube["frame_error"].isel(rate=0)
    conforms.closed_form(np.abs(slow / average.isel(rate=0) - 1), below=0.12)
    independent = cube["independent_fit_error"]
    conforms.closed_form(independent / independent[0, 0], 1, atol=0.01)


@pytest.mark.slow
def test_drawn_frames_and_films_are_the_law(conforms, cube):
    frames = cube["drawn_frame_error"].isel(estimator=0) / cube["frame_error"]
    conforms.sampled(frames, 1, atol=0.12)
    films = cube["drawn_fit_error"].isel(estimator=0) / cube["fit_error"]
    conforms.sampled(films, 1, atol=0.4)  # 60 numbers each: 9 % of one deviation
    conforms.sampled(abs(float(films.mean()) - 1), below=0.1)


# With noise.


@pytest.mark.slow
def test_no_draw_is_below_the_bound_beyond_its_sampling_error(conforms, cube):
    interval, std = (
        cube[f"noisy_share_error{kind}"].sel(approach="interval").values for kind in ("", "_std")
    )
    below = (cube["least_share_error"].values - interval) / std
    conforms.sampled(below, below=3.5)


def test_standard_error_of_an_rms_is_its_scatter(conforms):
    random, shape = np.random.default_rng(2), (400, 2000)
    rare = random.standard_normal(shape) * (random.random(shape) < 0.2)
    rms, std = simulation.rms_with_std(rare)
    conforms.sampled(np.sqrt(np.mean(std**2)) / np.std(rms), 1, atol=0.08)
    assert np.isnan(simulation.rms_with_std([[2.0]])[1])


def test_standard_error_of_a_frame_is_the_scatter_of_other_trials(conforms, study):
    points = design_sweeps.mode_shapes(setups.thesis_beam(), study.amplitude_mm / 1000)
    rig = study.settings()[0].cameras(study.focal_length_mm, study.sensor_width_mm)
    draws = (study.model_copy(update={"seed": seed, "trials": 20}) for seed in range(60))
    errors = [design_shares.one_frame(rig, points, draw)[0] for draw in draws]
    rms, std = np.array([simulation.rms_with_std(one) for one in errors]).T
    conforms.sampled(np.sqrt(np.mean(std**2)) / np.std(rms), 1, atol=0.25)


def test_the_tracker_follows_markers_from_that_height_on():
    """As published: where markers are higher every one has a result, and lower they are lost."""
    published = read_published("lab-elevation")
    lab = validate_request("lab-elevation", {})
    heights = {}
    for setting in lab.settings():
        focal = lab.focal_length_mm / lab.sensor_width_mm * setting.resolution_px[0]
        sine = np.sin(np.radians(setting.directions_deg[0][1]))
        high = 1000 * design_shares.MARKER_DIAMETER_M * focal / setting.distance_mm * sine
        heights[setting.case, float(setting.value)] = high
    for _, row in published[published["error"] == "mean_error"].iterrows():
        if row["case"] != "middle-row":  # a row without neighbours is lost earlier
            fine = bool(row["median"] < 0.1)
            assert fine == (
                heights[row["case"], float(row["value"])] > design_shares.MIN_TRACKED_HEIGHT_PX
            )


def test_tolerated_noise_leaves_half_of_the_gain(conforms):
    n, noise = 16, design_shares.noise_tolerance(16, 6, 0)
    rules = ("least-squares", "analytic-centre")
    gains = []
    for one in (0.0, noise):
        errors = simulation.deflection_errors((0.75,) * n, 6, 100, one, seed=0, rules=rules)
        least, centre = simulation.rms_over_layouts(errors)
        gains.append(1 - centre / least)
    conforms.sampled(gains[1] / gains[0], 0.5, atol=0.1)
