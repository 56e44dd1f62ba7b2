"""The compiled triangulation gives what the NumPy one and an independent one give."""

import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from thesis_lib.vision import triangulation
from thesis_lib.vision.pinhole import (
    CameraArray,
    hemisphere_directions,
    hemisphere_rotations,
    intrinsics,
    project,
)
from thesis_lib.vision.triangulation import triangulate

SIZE = (320, 180)
CLOSE = 1e-9 * 5.5e-3  # m: a thousand-millionth of the beam's deflection


def rig(n, seed=0):
    """Cameras at unequal distances, with unequal and skewed lenses, any scale and sign of P."""
    rng = np.random.default_rng(seed + n)
    azimuth, elevation = 2 * np.pi * np.arange(n) / n + 0.1, rng.uniform(0.2, 1.2, n)
    centres = rng.uniform(0.4, 3, (n, 1)) * hemisphere_directions(azimuth, elevation)
    K = np.stack([intrinsics(f, SIZE, 0.1, 1.2) for f in rng.uniform(150, 1500, n)])
    P = CameraArray(K, hemisphere_rotations(azimuth, elevation), centres, SIZE).P
    return P * (rng.uniform(0.01, 100, n) * rng.choice([-1, 1], n))[:, None, None]


def images(P, n_points, reach=(0.31, 0.02, 0.01)):
    """Whole-pixel images."""
    limits = np.array(reach)[:, None]
    points = np.random.default_rng(n_points).uniform(-limits, limits, (3, n_points))
    return np.rint(project(P, points))


@pytest.fixture
def compiled():
    return pytest.importorskip("thesis_lib.vision.compiled", reason="numba is not installed")


@pytest.fixture
def fast(compiled, monkeypatch):
    """Triangulation that always takes the compiled way."""

    def call(P, uv, steps=3):
        with monkeypatch.context() as patch:
            patch.setattr(triangulation, "_COMPILED_ABOVE", -1)
            return triangulate(P, uv, steps)

    return call


@pytest.mark.slow
@pytest.mark.parametrize("steps", [0, 1, 3])
@pytest.mark.parametrize("n", [2, 3, 4, 12, 40])
def test_both_ways_give_the_same(conforms, fast, n, steps):
    P = rig(n)
    uv = images(P, 3000)
    conforms.independent(fast(P, uv, steps), triangulate(P, uv, steps), atol=CLOSE)


@pytest.mark.parametrize("part", [(0, 0), (0, 1), (-1, 0), (1, 0), (1, 1), (3, 17)])
def test_any_number_of_points(conforms, compiled, fast, part):
    # Blocks and points over: each point is computed as if it were alone.
    P, (blocks, more) = rig(4), part
    whole = images(P, 4 * compiled.BLOCK_POINTS)
    size = abs(blocks) * compiled.BLOCK_POINTS + (more if blocks >= 0 else -1)
    found, expected = fast(P, whole[:, :, :size]), fast(P, whole)[:, :size]
    assert found.shape == expected.shape
    if size:
        conforms.invariance(found, expected, atol=0)


@pytest.mark.parametrize("hidden", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("n", [2, 4])
def test_hidden_images_spoil_their_own_points_only(fast, n, hidden):
    P = rig(n)
    whole = images(P, 700)
    holed = whole.copy()
    lost = [0, 3, 255, 256, 699]
    holed[n - 1, 1, lost] = hidden
    holed[:, :, 300] = hidden
    with np.errstate(invalid="ignore"):
        found, expected = fast(P, holed), triangulate(P, holed)
    np.testing.assert_array_equal(np.isnan(found), np.isnan(expected))
    assert np.isnan(found[:, [*lost, 300]]).all()
    others = np.delete(np.arange(700), [*lost, 300])
    np.testing.assert_array_equal(found[:, others], fast(P, whole)[:, others])


@pytest.mark.parametrize("n", [2, 4, 12])
def test_points_behind_cameras(conforms, fast, n):
    P = rig(n)
    uv = images(P, 2000, reach=(4, 4, 4))  # beyond the cameras, which stand 0.4 to 3 m away
    found, expected = fast(P, uv), triangulate(P, uv)
    scaled = P * np.sign(np.linalg.det(P[:, :, :3]))[:, None, None]
    depth = scaled[:, 2, :3] @ expected + scaled[:, 2, 3:]
    assert np.sum((depth < 0).any(axis=0) & (depth > 0).any(axis=0)) > 500
    # Close to a camera's plane images lie far out, and their last digits decide too much: by how
    # much differs between machines, so these points are only held to what counts as settled.
    last = 1 + 1e-14 * np.random.default_rng(0).choice([-1, 1], (5, *uv.shape))
    digits = np.max(np.abs([triangulate(P, uv * one) - expected for one in last]), axis=(0, 1))
    settled = np.max(np.abs(triangulate(P, uv, steps=2) - expected), axis=0) < 1e-7
    sure = settled & (digits < CLOSE / 10)
    conforms.independent(np.mean(sure), above=0.9)
    difference = np.max(np.abs(found - expected), axis=0)
    conforms.independent(difference[sure], below=CLOSE)
    conforms.independent(difference[settled], below=1e-7)


def test_images_in_any_order_in_memory(conforms, fast):
    P = rig(3)
    uv = images(P, 600)
    turned = np.asfortranarray(uv).reshape(3, 2, 20, 30)[:, :, ::-1]
    conforms.invariance(fast(P, turned), fast(P, uv).reshape(3, 20, 30)[:, ::-1], atol=0)


def test_threads_may_share_the_work(conforms, fast, compiled):
    P = rig(4)
    uv = images(P, 40_000)
    with ThreadPoolExecutor(2) as pool:
        parts = np.split(uv, 4, axis=2)
        P_, middle = map(np.ascontiguousarray, triangulation.centre_projections(P))

        def solve(part):
            points = np.empty((3, part.shape[2]))
            compiled.solve_points(P_, middle, np.ascontiguousarray(part), 3, points)
            return points

        found = np.concatenate(list(pool.map(solve, parts)), axis=1)
    conforms.invariance(found, fast(P, uv), atol=0)


@pytest.mark.parametrize("more", [0, 1])
def test_only_more_than_a_million_points_are_compiled_for(conforms, compiled, monkeypatch, more):
    called = []
    solve = compiled.solve_points
    monkeypatch.setattr(compiled, "solve_points", lambda *a: (called.append(1), solve(*a)))
    P = rig(2)
    uv = np.tile(images(P, 1000), 1000)
    uv = np.concatenate([uv, uv[:, :, :more]], axis=2)
    found = triangulate(P, uv)
    assert len(called) == more
    conforms.independent(found[:, -1000:], triangulate(P, uv[:, :, -1000:]), atol=CLOSE)


def test_without_numba_numpy_does_the_same(conforms, monkeypatch):
    monkeypatch.setitem(sys.modules, "numba", None)  # an import is then refused
    monkeypatch.delitem(sys.modules, "thesis_lib.vision.compiled", raising=False)
    P = rig(4)
    uv = images(P, 5000)
    expected = triangulate(P, uv)
    monkeypatch.setattr(triangulation, "_COMPILED_ABOVE", -1)
    conforms.invariance(triangulate(P, uv), expected, atol=0)


def test_few_points_import_no_compiler():
    code = (
        "import sys, numpy as np; from thesis_lib.vision.triangulation import triangulate;"
        "triangulate(np.random.default_rng(0).normal(size=(2, 3, 4)), np.ones((2, 2, 9)));"
        "print('numba' in sys.modules, 'thesis_lib.vision.compiled' in sys.modules)"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.split() == ["False", "False"]
