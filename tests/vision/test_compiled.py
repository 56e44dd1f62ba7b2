"""The compiled triangulation gives what the NumPy one and an independent one give."""

import sys

import numpy as np
import pytest
from scenes.slabs import box, rig, rounded

from thesis_lib.vision import triangulation
from thesis_lib.vision.triangulation import triangulate

CLOSE = 1e-9 * 5.5e-3  # m: a thousand-millionth of the beam's deflection


def matrices(n):
    """Projection matrices of any scale and sign."""
    rng = np.random.default_rng(n)
    return rig(n).P * (rng.uniform(0.01, 100, n) * rng.choice([-1, 1], n))[:, None, None]


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
@pytest.mark.parametrize(("n", "steps"), [(2, 0), (3, 1), (4, 3), (12, 3)])
def test_both_ways_give_the_same(conforms, fast, compiled, n, steps):
    P = matrices(n)
    uv = rounded(P, box(4 * compiled.BLOCK_POINTS + 17))
    found = fast(P, uv, steps)
    conforms.independent(found, triangulate(P, uv, steps), atol=CLOSE)
    for size in (1, compiled.BLOCK_POINTS - 1, 3 * compiled.BLOCK_POINTS + 17):  # as if alone
        conforms.invariance(fast(P, uv[:, :, :size], steps), found[:, :size], atol=0)
    turned = np.asfortranarray(uv[:, :, :600]).reshape(n, 2, 20, 30)[:, :, ::-1]
    expected = found[:, :600].reshape(3, 20, 30)[:, ::-1]
    conforms.invariance(fast(P, turned, steps), expected, atol=0)


@pytest.mark.parametrize(("n", "hidden"), [(2, np.nan), (4, -np.inf)])
def test_hidden_images_spoil_their_own_points_only(fast, n, hidden):
    P = matrices(n)
    whole = rounded(P, box(700))
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


def test_without_numba_numpy_does_the_same(conforms, monkeypatch):
    monkeypatch.setitem(sys.modules, "numba", None)  # an import is then refused
    monkeypatch.delitem(sys.modules, "thesis_lib.vision.compiled", raising=False)
    P = matrices(4)
    uv = rounded(P, box(5000))
    expected = triangulate(P, uv)
    monkeypatch.setattr(triangulation, "_COMPILED_ABOVE", -1)
    conforms.invariance(triangulate(P, uv), expected, atol=0)
