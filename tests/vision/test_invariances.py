"""What no estimator of points may depend on: frame, unit, order of cameras, other points."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenes.slabs import box, rig, rounded

from thesis_lib.vision.analytic_centre import analytic_centre
from thesis_lib.vision.interval import interval_estimate
from thesis_lib.vision.triangulation import triangulate

ESTIMATES = {
    "least-squares": lambda P, uv: triangulate(P, uv, steps=8),
    "analytic-centre": lambda P, uv: analytic_centre(P, uv).points,
    "interval": lambda P, uv: interval_estimate(P, uv, 0.05).points,
}
of_all = pytest.mark.parametrize("estimate", ESTIMATES.values(), ids=ESTIMATES)
counts, seeds = st.integers(2, 12), st.integers(0, 2**32 - 1)


@of_all
@settings(max_examples=50)
@given(counts, seeds, st.floats(0.1, 10))
def test_points_move_and_scale_with_the_world(conforms, estimate, n, seed, factor):
    rng = np.random.default_rng(seed)
    R = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    R *= np.linalg.det(R)
    t = rng.uniform(-1, 1, 3)
    back = np.block([[R.T, -R.T @ t[:, None]], [np.zeros((1, 3)), 1]])
    P = rig(n, seed).P
    uv = rounded(P, box())
    here, there = estimate(P, uv), estimate(P @ back, uv)
    conforms.invariance(there, R @ here + t[:, None], atol=1e-9)
    grown = estimate(P * np.array([1, 1, 1, factor]), uv)
    conforms.invariance(grown, factor * here, atol=1e-9 * factor)


@of_all
@settings(max_examples=50)
@given(counts, seeds)
def test_order_of_cameras_and_scale_of_their_matrices_do_not_matter(conforms, estimate, n, seed):
    rng = np.random.default_rng(seed)
    P, order = rig(n, seed).P, rng.permutation(n)
    uv = rounded(P, box())
    here = estimate(P, uv)
    conforms.invariance(estimate(P[order], uv[order]), here, atol=1e-9)
    scaled = P * rng.uniform(0.01, 100, (n, 1, 1))
    conforms.invariance(estimate(scaled, uv), here, atol=1e-9)


@of_all
def test_points_do_not_depend_on_each_other_or_on_how_they_are_laid_out(conforms, estimate):
    P = rig(12).P
    uv = rounded(P, box(9000))  # of several blocks
    whole = estimate(P, uv)
    folded = estimate(P, uv.reshape(12, 2, 30, 300))
    conforms.invariance(folded.reshape(3, -1), whole, atol=1e-12)
    for part in (slice(0, 1), slice(2990, 3020), slice(5990, 6010), slice(8999, 9000)):
        conforms.invariance(estimate(P, uv[..., part]), whole[:, part], atol=1e-12)
    holed, others = uv[..., :50].copy(), np.arange(50) != 7
    holed[3, 1, 7] = np.nan
    found = estimate(P, holed)
    assert np.isnan(found[:, 7]).all()
    conforms.invariance(found[:, others], whole[:, :50][:, others], atol=1e-12)
    assert np.isnan(estimate(P, np.full((12, 2, 3), np.nan))).all()
    assert estimate(P, uv[..., 0]).shape == (3,)
    assert estimate(P, uv[..., :0]).shape == (3, 0)


@pytest.mark.parametrize("estimate", [analytic_centre, interval_estimate])
def test_points_that_a_camera_does_not_see_are_not_feasible(estimate):
    P = rig(4).P
    uv = rounded(P, box(50))
    uv[2, 1, 7] = np.nan
    assert estimate(P, uv).feasible.tolist() == (np.arange(50) != 7).tolist()
    assert estimate(P, uv.reshape(4, 2, 10, 5)).feasible.shape == (10, 5)
