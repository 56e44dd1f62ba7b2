"""Triangulation against independent methods, exact images, invariances and sampled statistics."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scenes import slabs
from scenes.convergence import orders
from scenes.slabs import box, moved_world

from benchmarks.reference import hartley_sturm, svd_triangulate
from thesis_lib.vision.pinhole import CameraArray, hemisphere_cameras, intrinsics, project
from thesis_lib.vision.triangulation import image_jacobian, point_covariance, triangulate

SIZE = (320, 180)
rigs = st.builds(slabs.rig, st.integers(2, 12), st.integers(0, 2**32 - 1))


def ring(n, distance=0.5, elevation=0.4, focal_px=213.3):
    azimuth = 2 * np.pi * np.arange(n) / n + 0.1
    return hemisphere_cameras(distance, azimuth, np.full(n, elevation), focal_px, SIZE)


def pair(azimuth=30.0, elevation=25.0, distance=0.5):
    angles = np.radians([azimuth, -azimuth])
    return hemisphere_cameras(distance, angles, np.radians([elevation] * 2), 213.3, SIZE)


def cost(P, uv, points):
    return np.sum((project(P, points) - uv) ** 2, axis=(0, 1))


def noisy(P, points, sigma=0.3, seed=1):
    uv = project(P, points)
    return uv + np.random.default_rng(seed).normal(0, sigma, uv.shape)


@given(rigs)
def test_exact_images_give_back_the_points(conforms, rig):
    points = box()
    exact = project(rig.P, points)
    conforms.closed_form(triangulate(rig.P, exact), points, atol=1e-12)
    conforms.closed_form(triangulate(rig.P, exact, steps=0), points, atol=1e-11)  # linear start


def test_intrinsics_may_be_skewed_and_stretched(conforms):
    rig = ring(3)
    K = np.stack([intrinsics(f, SIZE, 0.2, 1.7) for f in (200, 300, 500)])
    P = CameraArray(K, rig.R_camera_world, rig.centres, SIZE).P
    conforms.closed_form(triangulate(P, project(P, box())), box(), atol=1e-12)
    images = np.rint(project(P, box()))
    conforms.independent(triangulate(P, images), svd_triangulate(P, images), atol=1e-9)


@given(rigs, st.floats(0.1, 10), st.integers(0, 2**32 - 1))
def test_result_moves_and_scales_with_the_world(conforms, rig, factor, seed):
    R, t, back = moved_world(seed)
    uv = noisy(rig.P, box())
    here = triangulate(rig.P, uv, steps=8)
    moved = R @ here + t[:, None]
    conforms.invariance(triangulate(rig.P @ back, uv, steps=8), moved, atol=1e-10)
    grown = triangulate(rig.P * np.array([1, 1, 1, factor]), uv, steps=8)
    conforms.invariance(grown, factor * here, atol=1e-10 * factor)


@given(rigs, st.integers(0, 2**32 - 1))
def test_order_of_cameras_and_scale_of_their_matrices_do_not_matter(conforms, rig, seed):
    rng, n = np.random.default_rng(seed), len(rig)
    order, factors = rng.permutation(n), rng.uniform(0.01, 100, n) * rng.choice([-1, 1], n)
    uv = noisy(rig.P, box())
    other = triangulate((factors[:, None, None] * rig.P)[order], uv[order])
    conforms.invariance(other, triangulate(rig.P, uv), atol=1e-11)


@pytest.mark.parametrize(
    "rig",
    [pair(), pair(8, 10), pair(distance=1.5), ring(12), slabs.rig(4), slabs.rig(12)],
)
def test_whole_pixels_give_what_svd_and_gauss_newton_give(conforms, rig):
    """However many points there are, of whatever shape, and though one of them is bad."""
    images = np.rint(project(rig.P, box(20_001)))
    images[:, :, 3] += 200 * np.random.default_rng(0).normal(size=(len(rig), 2))
    whole = triangulate(rig.P, images)
    others = np.arange(500) != 3
    few = images[:, :, :500][:, :, others]
    conforms.independent(whole[:, :500][:, others], svd_triangulate(rig.P, few), atol=1e-9)
    folded = triangulate(rig.P, images[:, :, 667:1267].reshape(-1, 2, 20, 30))
    conforms.invariance(folded.reshape(3, -1), whole[:, 667:1267], atol=1e-13)


@settings(max_examples=50)
@given(rigs)
def test_no_neighbour_fits_better(conforms, rig):
    points = box()
    uv = noisy(rig.P, points)
    best = triangulate(rig.P, uv, steps=8)
    residual = uv - project(rig.P, best)
    J = image_jacobian(rig.P, best)
    gradient = np.einsum("nckp,ncp->kp", J, residual)
    curvature = np.einsum("nckp,ncp->kp", np.abs(J), np.abs(residual))
    conforms.closed_form(np.abs(gradient), below=1e-7 * curvature)
    least = cost(rig.P, uv, best)
    for step in 1e-4 * np.concatenate([np.eye(3), -np.eye(3)]):
        assert np.all(cost(rig.P, uv, best + step[:, None]) > least)


@pytest.mark.parametrize(
    "rig", [pair(), pair(8, 10), hemisphere_cameras(0.5, [0.0, np.pi], [0.35] * 2, 213.3, SIZE)]
)
def test_two_cameras_reach_the_global_optimum_of_hartley_and_sturm(conforms, rig):
    points = box(200)
    uv = np.rint(project(rig.P, points) + 0.3)
    optimum = hartley_sturm(*rig.P, uv)
    found = triangulate(rig.P, uv)
    conforms.independent(found, optimum, rtol=1e-7, atol=1e-9)
    best = cost(rig.P, uv, optimum)
    conforms.independent(cost(rig.P, uv, found), best, rtol=1e-9, atol=1e-12)


@given(rigs)
def test_jacobian_is_the_derivative_of_projection(conforms, rig):
    points = box(5)
    J = image_jacobian(rig.P, points)
    errors = []
    for h in (4e-3, 2e-3, 1e-3):
        steps = h * np.eye(3)[:, :, None]
        central = [(project(rig.P, points + s) - project(rig.P, points - s)) for s in steps]
        errors.append(np.max(np.abs(np.stack(central, axis=2) / (2 * h) - J)))
    conforms.order(orders(errors), 2, atol=[0.1, 0.05])
    conforms.independent(errors[2], below=1e-3 * np.max(np.abs(J)))


@given(st.integers(3, 12), st.floats(0.1, 1.4), st.floats(0.3, 3), st.floats(0.1, 2))
def test_cameras_on_a_cone_have_the_closed_form_uncertainty(
    conforms, n, from_normal, distance, sigma
):
    f = 213.3
    rig = ring(n, distance, np.pi / 2 - from_normal, f)
    C = point_covariance(rig.P, np.zeros(3), sigma)
    across = distance * sigma / (f * np.sqrt(n * (1 - np.sin(from_normal) ** 2 / 2)))
    normal = distance * sigma / (f * np.sqrt(n) * np.sin(from_normal))
    conforms.closed_form(np.sqrt(np.diag(C)), [across, across, normal], rtol=1e-12)
    conforms.closed_form(C - np.diag(np.diag(C)), 0, atol=1e-12 * np.max(C))


@pytest.mark.parametrize("rig", [pair(), ring(4), slabs.rig(12)])
def test_covariance_is_that_of_sampled_noise(conforms, rig):
    point, sigma, draws = np.array([0.2, -0.01, 0.005]), 0.02, 100_000
    uv = project(rig.P, point)[:, :, None]
    noise = np.random.default_rng(3).normal(0, sigma, (len(rig), 2, draws))
    sampled = np.cov(triangulate(rig.P, uv + noise))
    expected = point_covariance(rig.P, point, sigma)
    deviations = np.sqrt(np.diag(expected))
    relative = (sampled - expected) / np.outer(deviations, deviations)
    conforms.sampled(np.max(np.abs(relative)), below=0.05)


def test_one_place_determines_no_point():
    here = pair(azimuth=0.0)
    assert np.isnan(point_covariance(here.P, box())).all()
    with pytest.raises(ValueError, match="2 or more cameras"):
        point_covariance(here.P[:1], box())
