"""Stated deviations of calibrations against refits, and against the scatter of many of them."""

import numpy as np
import pytest
from scenes.calibration import BOARD, exact_images, observations, rig
from scenes.jackknife import (
    deviations_of,
    differences,
    of_covariance,
    refitted,
    transform_adjustment,
)
from scipy.spatial.transform import Rotation

from thesis_lib.laboratory.rig import default_poses
from thesis_lib.measure.calibration.bundle_adjustment import adjust_bundle
from thesis_lib.measure.calibration.uncertainty import jackknife_cameras

POINTS = BOARD.corners
ROUGH = 0.02  # px by which every corner is off by itself


def off(kind, shape, rng):
    """Errors of corners: independent ones, ones with heavy tails, and ones that go together.

    Those bend the whole board, anew in every image, as paper held by hand does.
    """
    own = rng.normal(size=shape) if kind in ("plain", "bent") else rng.standard_t(2.5, size=shape)
    if kind in ("plain", "tails"):
        return ROUGH * own
    x, y = POINTS[:2] / np.abs(POINTS[:2]).max()
    bends = np.array([x * x, x * y, y * y, x**3, y**3, x * x * y, x * y * y])
    return ROUGH * own + 0.03 * rng.normal(size=(*shape[:3], len(bends))) @ bends


def calibrated(kind, shots, seed):
    """Errors, stated deviations and the adjustment's, of one calibration with poses of its own."""
    rng = np.random.default_rng([seed, shots])
    pick = rng.permutation(12)[:shots]
    turns = Rotation.from_rotvec(rng.normal(0, 0.05, (shots, 3))).as_matrix()
    rotations, places = default_poses()
    places = places[pick] + rng.normal(0, 0.004, (shots, 3))
    uv = exact_images(rig(), turns @ rotations[pick], places)
    uv = uv + off(kind, uv.shape, rng)
    full = adjust_bundle(uv, POINTS, rig())
    stated = deviations_of(jackknife_cameras(uv, POINTS, full))
    return differences(full.cameras, rig()), stated, deviations_of(full)


@pytest.mark.slow
@pytest.mark.few(3)
@pytest.mark.parametrize("kind", ["plain", "tails", "bent, tails"])
@pytest.mark.parametrize("shots", [2, 4, 12])
def test_stated_deviations_are_the_scatter_of_independent_calibrations(conforms, kind, shots):
    """Nothing of the formula is assumed: 40 calibrations, each from poses of its own."""
    made = [calibrated(kind, shots, seed) for seed in range(40)]
    errors, stated, plain = (np.array(each) for each in zip(*made, strict=True))
    scatter = np.sqrt(np.mean(errors**2, axis=0))
    ratio = np.sqrt(np.mean(stated**2, axis=0)) / scatter
    # Too large rather than too small, the more so the fewer shots there are (Efron and Stein).
    conforms.sampled(np.exp(np.mean(np.log(ratio))), above=0.9, below=1.45)
    conforms.sampled(np.mean(np.abs(errors) < 2 * stated), above=0.88)
    if kind.startswith("bent"):  # what this is for: the adjustment's own are half of that
        old = np.sqrt(np.mean(plain**2, axis=0)) / scatter
        conforms.sampled(np.exp(np.mean(np.log(old))), below=0.65)
        conforms.sampled(np.mean(np.abs(errors) < 2 * plain), below=0.75)
    if kind == "plain":  # where corners are independent, the adjustment's own hold
        own = np.sqrt(np.mean(plain**2, axis=0)) / scatter
        conforms.sampled(np.exp(np.mean(np.log(own))), 1, atol=0.15)


def test_a_bend_that_all_images_share_widens_the_deviations(conforms):
    """In proportion, yet errors are up to three times as large: no image shows a flat board."""
    bow = POINTS[0] ** 2 / np.max(POINTS[0] ** 2)
    stated, errors = np.empty((2, 2, len(rig())))
    for k, bend in enumerate([0.5e-3, 1e-3]):
        points = POINTS + np.outer([0, 0, bend], bow - bow.mean())
        uv = exact_images(rig(), *default_poses(), points)
        uv += np.random.default_rng(2).normal(0, ROUGH, uv.shape)
        full = adjust_bundle(uv, POINTS, rig())
        stated[k] = jackknife_cameras(uv, POINTS, full).deviations[:, 0]
        errors[k] = [p.K[0, 0] - q.K[0, 0] for p, q in zip(full.cameras, rig(), strict=True)]
    conforms.sampled(stated[1] / stated[0], 2, rtol=0.1)
    conforms.sampled(np.max(np.abs(errors) / stated), below=4)


@pytest.mark.parametrize("cameras", [[0], [0, 1, 2, 3]])
def test_it_is_the_full_jackknife_without_a_refit(conforms, cameras):
    uv = observations()[cameras]
    uv = uv + off("bent, tails", uv.shape, np.random.default_rng(3))
    uv[0, 4] = np.nan if len(cameras) > 1 else uv[0, 4]
    full = adjust_bundle(uv, POINTS, [rig()[k] for k in cameras])
    stated = of_covariance(jackknife_cameras(uv, POINTS, full))
    conforms.independent(stated / refitted(uv, POINTS, full), 1, atol=0.1)


def test_frame_and_order_do_not_matter(conforms):
    uv = observations(0.02, 1)
    full = adjust_bundle(uv, POINTS, rig())
    R, t = Rotation.from_rotvec([0.3, -1.1, 0.4]).as_matrix(), np.array([2.0, -1.0, 0.5])
    own, other = (
        jackknife_cameras(uv, POINTS, one) for one in (full, transform_adjustment(full, R, t))
    )
    conforms.invariance(other.deviations, own.deviations, rtol=1e-6)
    mixed = np.random.default_rng(0).permutation(12)
    back = jackknife_cameras(uv[:, mixed], POINTS, adjust_bundle(uv[:, mixed], POINTS, rig()))
    conforms.invariance(back.deviations, own.deviations, rtol=1e-5)


def test_a_shot_that_nothing_can_do_without_widens_all(conforms):
    """A camera that a single shot ties to the others: without it there is no answer."""
    uv = observations(0.02)
    uv[3, 1:] = np.nan
    full = adjust_bundle(uv, POINTS, rig(), intrinsics=False, distortion=False)
    stated = jackknife_cameras(uv, POINTS, full)
    factor = np.diag(stated.covariance)[:24] / np.diag(full.covariance)[:24]
    conforms.invariance(factor, factor[0], rtol=1e-9)
    conforms.sampled(factor[0], above=1 - 1e-9, below=3)
