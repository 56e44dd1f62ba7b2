"""Bundle adjustment against known rigs, differences, sampled statistics and OpenCV's own."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from scenes import jackknife
from scenes.calibration import BOARD, SIZE, as_found, exact_images, observations, rig
from scipy.spatial.transform import Rotation

from thesis_lib.laboratory.rig import default_poses
from thesis_lib.measure.calibration import bundle_adjustment as bundle
from thesis_lib.measure.calibration.rig import calibrate_camera, unify_corners
from thesis_lib.measure.calibration.uncertainty import jackknife_cameras
from thesis_lib.vision import pinhole

SIGMA = 0.01
POINTS = BOARD.corners


def rough():
    """The rig's cameras as they might be guessed: one lens for all, nowhere in particular."""
    K = np.array([[1250.0, 0, 960], [0, 1250, 540], [0, 0, 1]])
    return [pinhole.Camera(c.name, K, np.zeros(5), np.eye(3), np.zeros(3), SIZE) for c in rig()]


def without(uv, views):
    uv = uv.copy()
    for camera, shot in views:
        uv[camera, shot] = np.nan
    return uv


def test_derivatives_agree_with_differences(conforms):
    R, t = default_poses()
    network, points = bundle.Network(tuple(rig()), R, t), POINTS[None]
    for c in range(4):
        _, J = bundle.board_images(network, network.cameras[c], points)
        for k, h in enumerate([1e-5] * 12 + [1e-2] * 4 + [1e-4] * 4):
            step = np.zeros(network.unknowns)
            if k < 6:
                step[6 * c + k] = h
            elif k < 12:
                step[6 * 4 + k - 6 : 6 * 16 : 6] = h  # the same unknown of every board
            else:
                step[6 * 16 + 8 * c + k - 12] = h
            sides = (bundle.step_network(network, s * step) for s in (1, -1))
            plus, minus = (bundle.board_images(side, side.cameras[c], points)[0] for side in sides)
            difference = (plus - minus) / (2 * h)
            conforms.independent(J[k], difference, atol=1e-6 * np.abs(J[k]).max())


@pytest.mark.parametrize("absent", [[], [(0, 0), (1, 0), (2, 5), (3, 7), (1, 7), (0, 11)]])
def test_exact_images_give_back_the_rig(conforms, absent):
    result = bundle.adjust_bundle(without(observations(), absent), POINTS, rough())
    _, centres, rotations = bundle.align_cameras(result.cameras, rig())
    conforms.closed_form(np.abs(centres).max(), below=1e-9)
    conforms.closed_form(np.abs(rotations).max(), below=1e-9)
    conforms.closed_form(result.rms, below=1e-9)
    for camera, truth in zip(result.cameras, rig(), strict=True):
        conforms.closed_form(camera.K, truth.K, atol=1e-6)
        conforms.closed_form(camera.distortion, truth.distortion, atol=1e-9)


def test_a_thick_board_of_two_sides_puts_cameras_where_they_are(conforms):
    thick = replace(BOARD, thickness=0.008)
    R, t = default_poses()
    uv = exact_images(rig(), R, t)

    def seen_from_behind(images):
        return thick.corners_in_images(images)[..., 2, 0] < 0

    back = np.array([[0.0], [0.0], [-thick.thickness]])
    for c, s in np.argwhere(seen_from_behind(uv)):
        uv[c, s] = pinhole.project_points(rig()[c], R[s] @ (POINTS + back) + t[s][:, None])
    assert 0 < np.mean(seen_from_behind(uv)) < 1
    shots = as_found(uv, seed=2)
    single = [calibrate_camera(own, thick, SIZE) for own in shots]
    unified, _ = unify_corners(single, shots, thick, two_sided=True)
    off = []
    for board in (thick, BOARD):
        result = bundle.adjust_bundle(
            unified, board.corners_in_images(unified), [s.lens for s in single]
        )
        off.append(np.linalg.norm(bundle.align_cameras(result.cameras, rig())[1], axis=1).max())
    conforms.closed_form(off[0], below=1e-6)
    assert off[1] > 1e-3  # and without its thickness they are where they are not


def test_each_picture_may_show_other_corners(conforms):
    uv = observations(SIGMA, 4)
    hidden = np.random.default_rng(5).random((*uv.shape[:2], 1, uv.shape[3])) < 0.4
    cut = np.where(hidden, np.nan, uv)
    result = bundle.adjust_bundle(cut, POINTS, rough())
    np.testing.assert_array_equal(np.isnan(result.residuals), np.isnan(cut))
    conforms.sampled(result.sigma, SIGMA, rtol=0.03)  # 7 100 coordinates: 4 σ
    _, centres, turns = bundle.align_cameras(result.cameras, rig())
    deviations = bundle.camera_deviations(result, result.covariance)
    conforms.sampled(np.abs(centres / deviations[0]).max(), below=4.5)
    conforms.sampled(np.abs(turns / deviations[1]).max(), below=4.5)
    shots = [list(row) for row in cut]
    single = [calibrate_camera(row, BOARD, SIZE) for row in shots]
    pulls = [(one.lens.K - c.K)[[0, 1, 0, 1], [0, 1, 2, 2]] / one.deviations
             for one, c in zip(single, rig(), strict=True)]  # fmt: skip
    conforms.sampled(np.abs(pulls).max(), below=4.5)


def test_opencvs_adjustment_of_several_cameras_agrees(conforms):
    uv = observations(SIGMA, 2)
    ours = bundle.adjust_bundle(uv, POINTS, rig())
    objects = [POINTS.T.astype(np.float32)] * 12
    images = [[(v - pinhole.HALF_PIXEL).T.astype(np.float32) for v in views] for views in uv]
    rms, Ks, _, Rs, ts = cv2.calibrateMultiview(
        objects, images, [SIZE] * 4, np.ones((4, 12), np.uint8), np.zeros(4, np.uint8),
        None, None, None, None, np.full(4, cv2.CALIB_FIX_K3, np.int32),
    )  # fmt: skip
    conforms.independent(rms / np.sqrt(2), ours.rms, rtol=0.02)
    deviations, _ = bundle.camera_deviations(ours, ours.covariance)
    turns = [cv2.Rodrigues(np.asarray(R))[0] for R in Rs]
    theirs = np.array([-R.T @ np.ravel(t) for R, t in zip(turns, ts, strict=True)])
    centres = np.array([c.centre for c in ours.cameras])
    for i in range(4):
        for j in range(i):
            lengths = [np.linalg.norm(c[i] - c[j]) for c in (theirs, centres)]
            conforms.independent(lengths[0], lengths[1], atol=4 * deviations.max())
        focal = np.array([Ks[i][0, 0], Ks[i][1, 1]])
        found = ours.cameras[i].K[[0, 1], [0, 1]]
        conforms.independent(np.abs(focal - found), below=4 * ours.deviations[i, :2])


@pytest.mark.parametrize(
    ("absent", "words"),
    [([(2, s) for s in range(12)], "C: shares no board images, directly"),
     ([(c, 7) for c in range(4)], "board image 7: shares no board images"),
     ([(c, s) for c in range(4) for s in range(12) if (c == 3) == (s < 8)],
      "D: shares no board images, directly")],
    ids=["camera", "shot", "apart"],
)  # fmt: skip
def test_cameras_and_shots_that_nothing_ties_to_the_others_are_named(absent, words):
    with pytest.raises(bundle.CalibrationError, match=f"^{words}"):
        bundle.adjust_bundle(without(observations(), absent), POINTS, rig())


def test_pictures_that_do_not_determine_the_lens_are_refused():
    """One board square to the camera: its distance and the focal length are one unknown."""
    camera = rig()[0]
    rotation = camera.R_camera_world.T @ np.diag([1.0, -1.0, -1.0])
    place = camera.centre + 0.65 * camera.R_camera_world[2]
    uv = exact_images([camera], rotation[None], place[None])
    with pytest.raises(bundle.CalibrationError, match=r"^adjustment: "):
        bundle.adjust_bundle(uv, POINTS, [camera])


def test_alignment_undoes_any_rigid_motion(conforms):
    R, t = Rotation.from_rotvec([0.2, 2.0, -0.7]).as_matrix(), np.array([1.0, -3.0, 0.2])
    away = bundle.transform_network(bundle.Network(tuple(rig()), *default_poses()), R, t).cameras
    for count in (1, 2, 4):  # the axes alone fix what few centres leave open
        cameras, centres, rotations = bundle.align_cameras(away[:count], rig()[:count])
        conforms.invariance(np.abs(centres).max(), below=1e-12)
        conforms.invariance(np.abs(rotations).max(), below=1e-12)
        for a, b in zip(cameras, rig(), strict=False):
            conforms.invariance(a.P, b.P, atol=1e-9)


# What is stated of a calibration, against refits and against the scatter of many of them.

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
    full = bundle.adjust_bundle(uv, POINTS, rig())
    stated = jackknife.deviations_of(jackknife_cameras(uv, POINTS, full))
    return jackknife.differences(full.cameras, rig()), stated, jackknife.deviations_of(full)


@pytest.mark.slow
@pytest.mark.few(1)
@pytest.mark.parametrize("kind", ["bent, tails", "plain", "tails"])
@pytest.mark.parametrize("shots", [12, 4, 2])
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
        full = bundle.adjust_bundle(uv, POINTS, rig())
        stated[k] = jackknife_cameras(uv, POINTS, full).deviations[:, 0]
        errors[k] = [p.K[0, 0] - q.K[0, 0] for p, q in zip(full.cameras, rig(), strict=True)]
    conforms.sampled(stated[1] / stated[0], 2, rtol=0.1)
    conforms.sampled(np.max(np.abs(errors) / stated), below=4)


@pytest.mark.parametrize("cameras", [[0], [0, 1, 2, 3]])
def test_it_is_the_full_jackknife_without_a_refit(conforms, cameras):
    uv = observations()[cameras]
    uv = uv + off("bent, tails", uv.shape, np.random.default_rng(3))
    uv[0, 4] = np.nan if len(cameras) > 1 else uv[0, 4]
    full = bundle.adjust_bundle(uv, POINTS, [rig()[k] for k in cameras])
    stated = jackknife.of_covariance(jackknife_cameras(uv, POINTS, full))
    conforms.independent(stated / jackknife.refitted(uv, POINTS, full), 1, atol=0.1)


def test_frame_and_order_do_not_matter(conforms):
    uv = observations(0.02, 1)
    full = bundle.adjust_bundle(uv, POINTS, rig())
    R, t = Rotation.from_rotvec([0.3, -1.1, 0.4]).as_matrix(), np.array([2.0, -1.0, 0.5])
    own, other = (
        jackknife_cameras(uv, POINTS, one)
        for one in (full, jackknife.transform_adjustment(full, R, t))
    )
    conforms.invariance(other.deviations, own.deviations, rtol=1e-6)
    mixed = np.random.default_rng(0).permutation(12)
    back = jackknife_cameras(
        uv[:, mixed], POINTS, bundle.adjust_bundle(uv[:, mixed], POINTS, rig())
    )
    conforms.invariance(back.deviations, own.deviations, rtol=1e-5)


def test_a_shot_that_nothing_can_do_without_widens_all(conforms):
    """A camera that a single shot ties to the others: without it there is no answer."""
    uv = observations(0.02)
    uv[3, 1:] = np.nan
    full = bundle.adjust_bundle(uv, POINTS, rig(), lenses=False)
    stated = jackknife_cameras(uv, POINTS, full)
    factor = np.diag(stated.covariance)[:24] / np.diag(full.covariance)[:24]
    conforms.invariance(factor, factor[0], rtol=1e-9)
    conforms.sampled(factor[0], above=1 - 1e-9, below=3)
