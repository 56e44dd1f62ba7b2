"""Zhang's method and the board's symmetry against known cameras."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
import yaml
from scenes.calibration import BOARD, SIZE, as_found, exact_images, observations, rig
from scipy.spatial.transform import Rotation

from thesis_lib.laboratory.rig import default_poses
from thesis_lib.measure.calibration import rig as calibration_rig
from thesis_lib.measure.calibration.corners import BoardNotFound
from thesis_lib.measure.calibration.rig import (
    CalibrationError,
    calibrate_camera,
    central_corners,
    unify_corners,
)
from thesis_lib.measure.recordings.manifest import read_manifest
from thesis_lib.measure.report.warnings import check_board
from thesis_lib.measure.steps import calibrate_rig as calibrated_step

SIGMA = 0.01


def calibrated(shots):
    return [
        calibrate_camera(s, BOARD, SIZE, name=c.name) for c, s in zip(rig(), shots, strict=True)
    ]


def test_zhang_recovers_each_camera_within_its_deviations(conforms):
    for seed in range(3):
        found = calibrated(as_found(observations(SIGMA, seed), seed=seed))
        for camera, result in zip(rig(), found, strict=True):
            error = (result.lens.K - camera.K)[[0, 1, 0, 1], [0, 1, 2, 2]]
            conforms.sampled(np.abs(error[:2]).max(), below=0.002 * camera.K[0, 0])
            conforms.sampled(np.abs(error / result.deviations).max(), below=4)
            conforms.sampled(result.lens.distortion, camera.distortion, atol=3e-3)
            conforms.sampled(result.rms, SIGMA, rtol=0.1)
            assert result.lens.distortion[4] == 0


def test_board_poses_are_those_of_the_camera(conforms):
    camera, (R, t) = rig()[0], default_poses()
    result = calibrate_camera(observations()[0], BOARD, SIZE)
    for shot in range(len(R)):
        expected = camera.R_camera_world @ R[shot]
        conforms.closed_form(result.rotations[shot], expected, atol=1e-5)
        seen = camera.R_camera_world @ t[shot] + camera.t
        conforms.closed_form(result.translations[shot], seen, atol=1e-5)


def test_absent_shots_are_left_out_and_stay_in_their_place():
    shots = list(observations(SIGMA)[0])
    some = [uv if i % 3 else None for i, uv in enumerate(shots)]
    result = calibrate_camera(some, BOARD, SIZE)
    assert np.isnan(result.rotations).all((1, 2)).tolist() == [uv is None for uv in some]
    with pytest.raises(CalibrationError, match=r"^B: 2 of 4 board images show the board, needs 3$"):
        calibrate_camera([*shots[:2], None, None], BOARD, SIZE, name="B")


@pytest.mark.parametrize("sigma", [0.0, 0.3])
def test_parallel_boards_are_refused(sigma):
    """Turned about their normal alone, moved about before the camera."""
    camera, angles = rig()[0], np.radians(np.linspace(-40, 40, 6))
    turns = Rotation.from_rotvec(angles[:, None] * [0, 0, 1]).as_matrix()
    upright = np.diag([1.0, -1.0, -1.0])  # faces the camera
    places = np.random.default_rng(0).uniform(-0.05, 0.05, (6, 3)) + [0, 0, 0.65]
    rotations = camera.R_camera_world.T @ turns @ upright
    uv = exact_images([camera], rotations, places @ camera.R_camera_world + camera.centre)[0]
    uv += np.random.default_rng(0).normal(0, 1, uv.shape) * sigma
    with pytest.raises(CalibrationError, match=r"^A: the boards are parallel to within \d\.\d°"):
        calibrate_camera(uv, BOARD, SIZE, name="A")


def test_the_literal_way_uses_six_by_eight_central_corners():
    part = central_corners(BOARD)
    x, y = BOARD.corners[:2, part]
    assert len(part) == 48
    assert len(np.unique(x)) == 6
    assert len(np.unique(y)) == 8
    np.testing.assert_allclose([x.mean(), y.mean()], 0, atol=1e-12)


def same_up_to_symmetry(unified, exact):
    """Whether in each shot one reordering takes all cameras' corners to the exact order."""
    nx = BOARD.shape[0]
    index = np.arange(nx * nx).reshape(nx, nx)
    orders = [np.rot90(g, k).ravel() for g in (index, index[:, ::-1]) for k in range(4)]
    return all(
        any(np.nanmax(np.abs(unified[:, s][..., o] - exact[:, s])) < 0.1 for o in orders)
        for s in range(exact.shape[1])
    )


@pytest.mark.parametrize("seed", range(2))
def test_symmetric_origins_are_brought_together(seed):
    exact = observations()
    shots = as_found(observations(SIGMA, seed), seed=seed)
    assert not same_up_to_symmetry(np.array(shots), exact)
    absent = [(0, 0), (1, 4), (2, 4), (3, 7), (0, 7), (0, 11)]
    for c, s in absent:
        shots[c][s] = None
    unified, _ = unify_corners(calibrated(shots), shots, BOARD, two_sided=True)
    assert same_up_to_symmetry(unified, exact)
    gone = np.argwhere(np.isnan(unified).all(axis=(2, 3)))
    assert sorted(map(tuple, gone.tolist())) == sorted(absent)


def test_one_sided_boards_turn_but_do_not_flip():
    shots = as_found(observations(SIGMA))[:2]  # both before the front
    unified, _ = unify_corners(calibrated(as_found(observations(SIGMA)))[:2], shots, BOARD)
    assert same_up_to_symmetry(unified, observations()[:2])


@pytest.mark.parametrize("moved", [[5], [1, 3, 5, 7, 9]])
def test_a_pose_between_whose_pictures_a_camera_moved_is_left_out(moved):
    uv = observations(SIGMA)
    other = [replace(camera, centre=camera.centre + [0.03, 0, 0]) for camera in rig()]
    uv[1, moved] = observations(cameras=other)[1, moved]
    shots = as_found(uv)
    if len(moved) > 4:
        with pytest.raises(CalibrationError, match=r"^5 of 12 poses are up to [23]\d\.\d mm off"):
            unify_corners(calibrated(shots), shots, BOARD, two_sided=True)
        return
    unified, off = unify_corners(calibrated(shots), shots, BOARD, two_sided=True)
    assert list(off) == moved
    assert 0.02 < off[5] < 0.04
    assert np.isnan(unified[:, 5]).all()
    assert np.isfinite(np.delete(unified, 5, axis=1)).all()


def test_cameras_without_common_shots_are_named():
    shots = as_found(observations(SIGMA))
    late = [*shots[:3], np.roll(shots[3], 1, axis=0)]
    with pytest.raises(CalibrationError, match=r"^D: shares 12 board images .* show one pose"):
        unify_corners(calibrated(late), late, BOARD, two_sided=True)
    shots[3] = [uv if s < 6 else None for s, uv in enumerate(shots[3])]
    for c in range(3):
        shots[c] = [uv if s > 4 else None for s, uv in enumerate(shots[c])]
    with pytest.raises(CalibrationError, match=r"^D: shares 1 board images with A, needs 2"):
        unify_corners(calibrated(shots), shots, BOARD, two_sided=True)


# All cameras of a folder, from corners that are given in place of images.


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A manifest, and a function that calibrates its cameras from corners or refusals by shot."""
    cameras = [
        {"name": c.name, "video": f"{c.name}.mkv", "exposure_s": 0.001, "width_px": SIZE[0],
         "height_px": SIZE[1], "board_images": [f"{c.name}-{k:02d}.png" for k in range(12)]}
        for c in rig()
    ]  # fmt: skip
    path = tmp_path / "manifest.yaml"
    path.write_text(yaml.safe_dump({"cameras": cameras}), encoding="utf-8")
    manifest = read_manifest(path, check_files=False)

    def calibrate(shots):
        by_name = {f"{c.name}-{k:02d}.png": uv for c, row in zip(rig(), shots, strict=True)
                   for k, uv in enumerate(row)}  # fmt: skip

        def find(name, _):
            if isinstance(by_name[name], str):
                raise BoardNotFound(by_name[name])
            return by_name[name]

        monkeypatch.setattr(calibration_rig, "read_png", lambda path: path.name)
        monkeypatch.setattr(calibration_rig, "find_corners", find)
        for name in by_name:
            (tmp_path / name).touch()
        return calibrated_step(manifest, tmp_path, tmp_path)

    return calibrate


def of_note(data):
    names = ("reprojection_rms", "single_rms")
    part = xr.Dataset({name: data[name] for name in names})
    return [note.code for note in check_board(part)]


def test_a_board_at_rest_is_not_said_to_move(folder):
    assert of_note(folder(as_found(observations(SIGMA)))) == []


def test_lenses_do_not_suffer_from_a_board_that_moves_between_the_cameras(conforms, folder):
    (R, t), rng = default_poses(), np.random.default_rng(5)
    seen = [exact_images([c], R, t + rng.normal(0, 1e-3, t.shape))[0] for c in rig()]
    data = folder(as_found(seen + rng.normal(0, SIGMA, (4, 12, 2, 64))))
    assert of_note(data) == ["board-moved"]
    off = data["K"].values[:, [0, 1], [0, 1]] - [c.K[[0, 1], [0, 1]] for c in rig()]
    conforms.sampled(np.abs(off).max(), below=1)  # px; 11 if adjusted together
    conforms.sampled(np.abs(off[:, 0] / data["focal_deviation"].values).max(), below=4)
