"""Posterior means of noisy, rounded pixels against grids, centroids and draws; their noise."""

import numpy as np
import pytest
from scenes.slabs import box, faces, rig, rounded
from scipy.spatial import ConvexHull, Delaunay, HalfspaceIntersection
from scipy.special import log_ndtr, ndtr
from scipy.stats import truncnorm

from thesis_lib.vision import interval, simulation
from thesis_lib.vision.analytic_centre import analytic_centre, joint_centre
from thesis_lib.vision.pinhole import hemisphere_cameras, project
from thesis_lib.vision.triangulation import point_covariance, triangulate

COUNTS = [2, 64, 4, 16]
posterior = interval.interval_estimate


def on_grid(P, uv, sigma, about, spread, reach=5.0, number=61):
    """Mean and covariance of one point's likelihood, summed over a fine grid."""
    axis = np.linspace(-reach, reach, number)
    steps = np.stack(np.meshgrid(axis, axis, axis, indexing="ij")).reshape(3, -1)
    root = np.linalg.cholesky(spread)
    points = about[:, None] + root @ steps
    away = project(P, points) - uv[:, :, None]
    mass = np.prod(ndtr((0.5 - away) / sigma) - ndtr((-0.5 - away) / sigma), axis=(0, 1))
    mean = points @ mass / mass.sum()
    apart = points - mean[:, None]
    return mean, (apart * mass) @ apart.T / mass.sum()


@pytest.mark.slow
@pytest.mark.few(3)
@pytest.mark.parametrize("n", [2, 3, 5])
@pytest.mark.parametrize("sigma", [0.03, 0.1, 0.3])
def test_mean_and_covariance_are_those_of_a_fine_grid(conforms, n, sigma):
    P, points = rig(n).P, box(8)
    uv = rounded(P, points, sigma)
    found = posterior(P, uv, sigma)
    assert found.feasible.all()
    for i in range(8):
        C = found.covariance[..., i]
        mean, cov = on_grid(P, uv[:, :, i], sigma, found.points[:, i], C)
        deviation = np.sqrt(np.diag(cov))
        conforms.independent((found.points[:, i] - mean) / deviation, 0, atol=0.15)
        conforms.independent(np.sqrt(np.diag(C)) / deviation, 1, atol=0.12)


def centroid(rows):
    """Centroid and covariance of a polytope from its faces (a, b), a·X + b ≥ 0."""
    inside = np.zeros(3)
    corners = HalfspaceIntersection(-rows, inside).intersections
    corners = corners[ConvexHull(corners).vertices]
    simplices = corners[Delaunay(corners).simplices]
    volume = np.abs(np.linalg.det(simplices[:, 1:] - simplices[:, :1]))
    middle = simplices.mean(axis=1)
    mean = volume @ middle / volume.sum()
    apart = simplices - mean
    away = middle - mean
    second = np.einsum("sia,sib->sab", apart, apart) + 16 * np.einsum("sa,sb->sab", away, away)
    return mean, np.einsum("s,sab->ab", volume, second) / (20 * volume.sum())


@pytest.mark.parametrize("n", [2, 12])
def test_without_noise_it_is_the_centroid_of_the_polytope(conforms, n):
    P, points = rig(n).P, box(60)
    uv = rounded(P, points)
    found, central = posterior(P, uv), analytic_centre(P, uv)
    off, of_centre, ratio = np.empty((3, 3, 60))
    for i in range(60):
        scale = np.sqrt(np.diag(found.covariance[..., i]))
        start = central.points[:, i]
        to_start = np.block([[np.diag(scale), start[:, None]], [np.zeros(3), 1]])
        rows = faces(P, uv[:, :, i]) @ to_start
        mean, cov = centroid(rows / np.linalg.norm(rows[:, :3], axis=1, keepdims=True))
        deviation = np.sqrt(np.diag(cov))
        off[:, i] = ((found.points[:, i] - start) / scale - mean) / deviation
        of_centre[:, i] = mean / deviation
        ratio[:, i] = 1 / deviation
    conforms.independent(np.sqrt(np.mean(off**2)), 0, atol=0.06)
    conforms.independent(np.abs(off).max(), 0, atol=0.35)
    conforms.independent(np.median(ratio), 1, atol=0.08)  # spread is told somewhat too large
    assert np.mean(off**2) < 0.1 * np.mean(of_centre**2) or n == 2


@pytest.mark.parametrize("n", [2, 16])
def test_much_noise_is_least_squares(conforms, n):
    P, sigma = rig(n).P, 2.0
    uv = rounded(P, box(200), sigma)
    found, least = posterior(P, uv, sigma), triangulate(P, uv)
    cov = point_covariance(P, least, np.sqrt(sigma**2 + 1 / 12))
    deviation = np.sqrt(np.einsum("ii...->i...", cov))
    conforms.independent((found.points - least) / deviation, 0, atol=0.01)
    scale = deviation[:, None] * deviation
    conforms.independent(found.covariance / scale, cov / scale, atol=0.002)


@pytest.mark.parametrize("sigma", [0.0, 0.3])
def test_order_of_cameras_their_scale_and_whole_pixels_do_not_matter(conforms, sigma):
    rng, n = np.random.default_rng(2), 7
    P = rig(n).P
    uv = rounded(P, box(100), sigma)
    here = posterior(P, uv, sigma)
    order, whole = rng.permutation(n), rng.integers(-40, 40, (n, 2))
    shifted = P.copy()
    shifted[:, :2] += whole[:, :, None] * P[:, 2:]
    others = [(P[order], uv[order]), (P * rng.uniform(0.1, 10, (n, 1, 1)), uv),
              (shifted, uv + whole[:, :, None])]  # fmt: skip
    for other in (
        *(posterior(*given, sigma) for given in others),
        interval.joint_interval(P, uv[:, :, None], sigma),
    ):
        conforms.invariance(other.points.reshape(3, 100), here.points, atol=1e-10)


def test_points_do_not_depend_on_how_they_are_laid_out(conforms):
    P = rig(12).P
    uv = rounded(P, box(9000), 0.05)
    folded = posterior(P, uv.reshape(12, 2, 30, 300), 0.05)
    conforms.invariance(folded.points.reshape(3, -1), posterior(P, uv, 0.05).points, atol=0)


def test_a_missing_image_spoils_its_own_point_only_in_every_estimate(conforms):
    P, others = rig(4).P, np.arange(50) != 7
    whole = rounded(P, box(50))
    holed = whole.copy()
    holed[2, 1, 7] = np.nan
    conforms.invariance(triangulate(P, holed)[:, others], triangulate(P, whole)[:, others], atol=0)
    assert np.isnan(triangulate(P, holed)[:, 7]).all()
    for estimate, atol in ((analytic_centre, 1e-13), (posterior, 1e-12)):
        found, expected = estimate(P, holed), estimate(P, whole)
        assert np.isnan(found.points[:, 7]).all()
        assert found.feasible.tolist() == others.tolist()
        conforms.invariance(found.points[:, others], expected.points[:, others], atol=atol)


def test_pixels_that_contradict_the_noise_leave_least_squares(conforms):
    P = rig(12).P
    uv = rounded(P, box(300), 0.2)
    clean, noisy = posterior(P, uv), posterior(P, uv, 0.2)
    assert noisy.feasible.all()
    lost = ~clean.feasible
    np.testing.assert_array_less(0.5, lost.mean())
    assert np.mean(lost == ~analytic_centre(P, uv).feasible) > 0.97
    least = triangulate(P, uv)[:, lost]
    conforms.invariance(clean.points[:, lost], least, atol=0)
    expected = point_covariance(P, least, np.sqrt(1 / 12 + interval.MIN_NOISE_PX**2))
    conforms.closed_form(clean.covariance[..., lost], expected, rtol=1e-9)


# Draws.


@pytest.mark.few(3)
@pytest.mark.parametrize("n", COUNTS)
@pytest.mark.parametrize("sigma", [0.0, 0.05, 0.3])
def test_scatter_of_draws_is_the_covariance(conforms, n, sigma):
    squares = []
    for seed in range(4):
        P, points = rig(n, seed).P, box(1500, seed)
        found = posterior(P, rounded(P, points, sigma, seed), sigma)
        root = np.linalg.cholesky(np.moveaxis(found.covariance, 2, 0))
        away = np.linalg.solve(root, (found.points - points).T[:, :, None])
        squares.append(np.mean(away**2))
    scatter = np.sqrt(np.mean(squares))
    # Of a hard polytope the spread is told a little too large.
    low, high = (0.95, 1.05) if sigma else (0.85, 1.03)
    conforms.sampled(scatter, above=low, below=high)


@pytest.mark.few(3)
@pytest.mark.parametrize("n", COUNTS)
@pytest.mark.parametrize("sigma", [0.0, 0.02, 0.1, 0.3, 0.5])
def test_never_worse_than_the_better_of_both_others_and_near_the_bound(conforms, n, sigma):
    """By three per cent; nine tenths of what the bound allows from a third of a pixel on."""
    squares, least = [], []
    rules = ("interval", "least-squares", "analytic-centre")
    for seed in range(12):
        rng = np.random.default_rng([seed, n])
        azimuth = 2 * np.pi * np.arange(n) / n + rng.uniform(0, 1.5, n)
        focal, size = simulation.CHECK_FOCAL_PX, simulation.CHECK_SIZE_PX
        P = hemisphere_cameras(0.75, azimuth, rng.uniform(0.3, 1.2, n), focal, size).P
        points = simulation.move_markers(rng, 400 if sigma >= 0.3 else 150)
        uv = project(P, points)
        uv = np.rint(uv + sigma * rng.standard_normal(uv.shape))
        z = simulation.estimate_points(P, uv, rules, sigma)[:, 2]
        squares.append((z[:, 1] - z[:, 0] - points[2, 1] + points[2, 0]) ** 2)
        if sigma:
            least.append(interval.least_covariance(P, points, sigma)[2, 2].sum(axis=0))
    squares = np.stack(squares, axis=1)
    mine, *others = np.sqrt(np.mean(squares, axis=(1, 2)))
    conforms.sampled(mine / min(others), below=1.03)
    if sigma >= 0.3:
        conforms.sampled(1 / np.mean(squares[0] / np.array(least)), above=0.9, below=1.05)


def test_joint_means_share_x_and_y_and_are_better(conforms):
    P, points = rig(8).P, np.repeat(box(2000)[:, None], 3, axis=1)
    points[2, 1:] += np.random.default_rng(5).uniform(-0.01, 0.01, (2, 2000))
    uv = rounded(P, points, 0.05)
    joint, alone = interval.joint_interval(P, uv, 0.05), posterior(P, uv, 0.05)
    assert joint.feasible.all()
    conforms.invariance(joint.points[:2, 0], joint.points[:2, 2], atol=1e-15)
    wrong, apart = joint.points - points, alone.points - points
    conforms.sampled(np.mean(wrong**2 / joint.covariance[[0, 1, 2], [0, 1, 2]]), 1, atol=0.06)
    gain = np.mean(wrong**2, axis=(1, 2)) / np.mean(apart**2, axis=(1, 2))
    conforms.sampled(gain[[0, 2]], below=[0.6, 1.0])


# The mass of a pixel.


@pytest.mark.parametrize("deviation", [0.02, 1.0, 30.0])
def test_mass_and_slopes_are_those_of_a_truncated_normal(conforms, deviation):
    away = np.linspace(0, 0.5 + 4 * deviation, 40) * np.array([[1], [-1]])
    log_mass, G, H = interval.pixel_mass(away, deviation**2)
    low, high = (away - 0.5) / deviation, (away + 0.5) / deviation
    conforms.independent(np.exp(log_mass), ndtr(high) - ndtr(low), rtol=1e-9)
    mean, variance = truncnorm.stats(low, high, moments="mv")
    conforms.independent(G * deviation, mean, atol=1e-9)
    conforms.independent(1 - H * deviation**2, variance, rtol=1e-6, atol=1e-12)
    out = np.array([10.0, 30, 100]) / 0.1 - 5  # far out, of a narrow pixel
    log_mass, G, H = interval.pixel_mass(np.array([10.0, 30, 100]), 0.01)
    conforms.closed_form(log_mass, log_ndtr(-out), rtol=1e-12)
    conforms.closed_form(G * 0.1, out + 1 / out, rtol=1e-3)
    conforms.closed_form((1 - H * 0.01) * out**2, 1, rtol=0.02)


ESTIMATES = (triangulate, posterior, interval.joint_interval, analytic_centre, joint_centre)
WRONG_SHAPES = [
    (np.ones((1, 3, 4)), np.ones((1, 2, 1, 5)), "P: given shape"),
    (np.ones((2, 3, 4)), np.ones((3, 2, 1, 5)), "uv: given shape"),
    (np.ones((2, 3, 4)), np.ones(2), "uv: given shape"),
]


@pytest.mark.parametrize(("P", "uv", "named"), WRONG_SHAPES)
def test_a_wrong_shape_is_named(P, uv, named):
    for estimate in ESTIMATES:
        with pytest.raises(ValueError, match=named):
            estimate(P, uv)
    for joint in (interval.joint_interval, joint_centre):
        with pytest.raises(ValueError, match="uv: given shape"):
            joint(P[:1].repeat(2, 0), np.ones((2, 2)))


# How much noise there is.


def test_information_is_that_of_all_pixels_averaged_over_places(conforms):
    place, h, sigma = np.linspace(-0.5, 0.5, 2001)[:-1, None] + 0.00025, 1e-4, 0.3
    m = np.arange(-8, 9)

    def chance(u):
        return ndtr((m + 0.5 - u) / sigma) - ndtr((m - 0.5 - u) / sigma)

    slope = (chance(place + h) - chance(place - h)) / (2 * h)
    p = chance(place)
    each = np.where(p > 1e-250, slope**2 / np.maximum(p, 1e-250), 0)
    conforms.independent(np.mean(each.sum(axis=1)), interval.pixel_information(sigma), rtol=1e-3)
    wide = np.array([1.0, 3.0])
    product = [interval.pixel_information(s) * (s**2 + 1 / 12) for s in wide]
    conforms.closed_form(product, 1, atol=1e-3)
    scaled = [interval.pixel_information(s) * s for s in (1e-4, 1e-2)]
    conforms.invariance(scaled[1], scaled[0], rtol=1e-6)


@pytest.mark.slow
@pytest.mark.few(1)
@pytest.mark.parametrize(("n", "sigma"), [(3, 0.1), (4, 0.03), (12, 0.02)])
def test_noise_is_found_again(conforms, n, sigma):
    P = rig(n).P
    images = [rounded(P, box(400, seed), sigma, seed) for seed in range(5)]
    every = [interval.estimate_noise(P, uv) for uv in images]
    assert all(one.least <= one.best <= one.most for one in every)
    conforms.sampled(np.mean([one.best for one in every]), sigma, atol=0.012)
    assert sum(one.least <= sigma <= one.most for one in every) >= 4  # of 95 % intervals


def test_points_that_are_not_seen_are_left_out_and_without_any_it_is_refused(conforms):
    P = rig(6).P
    uv = rounded(P, box(60), 0.1)
    holed = np.concatenate([uv, np.full((6, 2, 9), np.nan)], axis=2)
    one, other = interval.estimate_noise(P, uv), interval.estimate_noise(P, holed)
    conforms.invariance(one.best, other.best, atol=0)
    with pytest.raises(ValueError, match="uv: given no point"):
        interval.estimate_noise(P, holed[..., 60:])
    for sigma in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(ValueError, match="sigma_px: given"):
            interval.pixel_information(sigma)
