"""Calibrations that are reused: an earlier measurement's, and those of other programs."""

import json
import re
import time
import tomllib
from dataclasses import replace

import cv2
import numpy as np
import pytest
import xarray as xr
import yaml
from refused import line_of
from scenes import own
from scenes.calibration import BOARD, SIZE, observations, rig
from scenes.jackknife import deviations_of, differences

from thesis_lib.facts import setups
from thesis_lib.measure.calibration import uncertainty
from thesis_lib.measure.calibration.bundle_adjustment import adjust_bundle
from thesis_lib.measure.exchange import cameras as written
from thesis_lib.measure.exchange.cameras import (
    describe_reused,
    read_cameras,
    reuse_calibration,
    select_reusable,
)
from thesis_lib.measure.pipeline import measure_recordings
from thesis_lib.measure.recordings.manifest import ManifestError, read_manifest
from thesis_lib.measure.report.warnings import check_shape
from thesis_lib.studies import storage
from thesis_lib.vibration.motion import Component

CAMERAS = rig()


def assert_same(found, expected=CAMERAS, placed=True):
    """The same cameras, in numbers as a text has them."""
    assert [one.name for one in found.cameras] == [one.name for one in expected]
    assert found.placed == placed
    for one, other in zip(found.cameras, expected, strict=True):
        assert one.size == other.size
        np.testing.assert_allclose(one.K, other.K, rtol=1e-12)
        np.testing.assert_allclose(one.distortion, other.distortion, rtol=1e-12)
        if placed:
            np.testing.assert_allclose(one.R_camera_world, other.R_camera_world, atol=1e-12)
            np.testing.assert_allclose(one.centre, other.centre, atol=1e-12)


# What other programs write.


ODD_NAMES = ["it's", "C:\\A", "\\'", "12:30", "1e5", "#ü", "null", "yes", "true", "off", "1",
             'a "b": c', "カメラ", "<&>{{ x }}"]  # fmt: skip


def test_what_is_written_is_read_by_all_to_the_last_bit(tmp_path):
    odd = [replace(one, name=text) for text in ODD_NAMES for one in CAMERAS]
    for name in ("c.yaml", "c.toml"):
        written.write_cameras(tmp_path / name, odd)
        assert_same(read_cameras(tmp_path / name), odd)
    file = cv2.FileStorage(str(tmp_path / "c.yaml"), cv2.FILE_STORAGE_READ)
    toml = tomllib.loads((tmp_path / "c.toml").read_text(encoding="utf-8"))
    for k, one in enumerate(odd):
        node, table = file.getNode(f"camera_{k}"), toml[f"cam_{k}"]
        assert file.getNode("names").at(k).string() == one.name
        assert node.getNode("name").string() == table["name"] == one.name
        size = [node.getNode(name).real() for name in ("image_width", "image_height")]
        assert size == table["size"] == list(one.size)
        expected = {
            ("camera_matrix", "matrix"): one.K - [[0, 0, 0.5], [0, 0, 0.5], [0, 0, 0]],
            ("distortion_coefficients", "distortions"): one.distortion,
            ("rvec", "rotation"): cv2.Rodrigues(one.R_camera_world)[0],
            ("tvec", "translation"): one.t,
        }
        for (in_yaml, in_toml), values in expected.items():
            np.testing.assert_array_equal(node.getNode(in_yaml).mat().ravel(), np.ravel(values))
            np.testing.assert_array_equal(np.ravel(table[in_toml]), np.ravel(values))


def opencv(path, camera, **more):
    """As OpenCV's own camera_calibration writes one camera."""
    file = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    K = camera.K.copy()
    K[:2, 2] -= 0.5
    file.write("calibration_time", "Wed Nov 25 10:16:02 2026")
    file.write("image_width", camera.size[0])
    file.write("image_height", camera.size[1])
    file.write("fisheye_model", 0)
    file.write("camera_matrix", K)
    file.write("distortion_coefficients", camera.distortion[:, None])
    for key, value in more.items():
        file.write(key, value)
    file.release()


def test_a_file_of_ros(tmp_path):
    camera = CAMERAS[2]
    K = camera.K - 0.5 * np.array([[0, 0, 1], [0, 0, 1], [0, 0, 0]])
    values = {
        "image_width": 1920, "image_height": 1080, "camera_name": "C",
        "camera_matrix": {"rows": 3, "cols": 3, "data": K.ravel().tolist()},
        "distortion_model": "plumb_bob",
        "distortion_coefficients": {"rows": 1, "cols": 5, "data": camera.distortion.tolist()},
    }  # fmt: skip
    (tmp_path / "ros.yaml").write_text(yaml.safe_dump(values), encoding="utf-8")
    assert_same(read_cameras(tmp_path / "ros.yaml"), [camera], placed=False)


def toml(unit="", scale=1.0, matrix=False, key="name"):
    """As aniposelib, or caliscope, writes cameras."""
    lines = []
    for k, one in enumerate(CAMERAS):
        K = one.K - 0.5 * np.array([[0, 0, 1], [0, 0, 1], [0, 0, 0]])
        turn = one.R_camera_world if matrix else np.ravel(cv2.Rodrigues(one.R_camera_world)[0])
        lines += [
            f"[cam_{k}]",
            f"{key} = {json.dumps(one.name)}",
            f"size = {list(one.size)}",
            f"matrix = {K.tolist()}",
            f"distortions = {one.distortion.tolist()}",
            f"rotation = {turn.tolist()}",
            f"translation = {(scale * one.t).tolist()}",
        ]
    return "\n".join([*lines, *(["[metadata]", f'units = "{unit}"'] if unit else [])])


@pytest.mark.parametrize(
    ("text", "unit"),
    [(toml("mm", 1e3), None), (toml(scale=1e3), "mm"), (toml(matrix=True, key="cam_id"), None)],
)
def test_toml_in_metres_or_millimetres(tmp_path, text, unit):
    (tmp_path / "array.toml").write_text(text, encoding="utf-8")
    assert_same(read_cameras(tmp_path / "array.toml", unit))


def test_what_pose2sim_and_caliscope_add(tmp_path):
    """Sizes as real numbers, whether a lens is a fisheye, and cameras that are to be ignored."""
    size = f"size = [{SIZE[0]}.0, {SIZE[1]}.0]\nfisheye = false"
    text = toml().replace(f"size = {list(SIZE)}", size).replace("[cam_3]", "[cam_3]\nignore = true")
    (tmp_path / "Calib.toml").write_text(f"{text}\n[metadata]\nadjusted = false\nerror = 0.0\n")
    assert_same(read_cameras(tmp_path / "Calib.toml"), CAMERAS[:3])


@pytest.mark.parametrize("ending", [".xml", ".json"])
def test_xml_and_json_of_opencv(tmp_path, ending):
    for camera in CAMERAS:
        turn, _ = cv2.Rodrigues(camera.R_camera_world)
        opencv(tmp_path / f"{camera.name}{ending}", camera, rvec=turn, tvec=camera.t[:, None])
    assert_same(read_cameras(tmp_path))


def test_a_file_of_kalibr(tmp_path):
    values, before, cameras, first = {}, np.eye(4), [], CAMERAS[0]  # whose axes are the world
    for k, one in enumerate(CAMERAS):
        pose = np.eye(4)
        pose[:3, :3] = one.R_camera_world @ first.R_camera_world.T
        pose[:3, 3] = one.R_camera_world @ (first.centre - one.centre)
        values[f"cam{k}"] = {
            "camera_model": "pinhole",
            "intrinsics": [*one.K[[0, 1], [0, 1]].tolist(), *(one.K[:2, 2] - 0.5).tolist()],
            "distortion_model": "radtan",
            "distortion_coeffs": one.distortion[:4].tolist(),
            "resolution": list(one.size),
            "rostopic": f"/cam{k}/image_raw",
        } | ({"T_cn_cnm1": (pose @ np.linalg.inv(before)).tolist()} if k else {})
        before, turn = pose, pose[:3, :3]
        centre = -turn.T @ pose[:3, 3]
        cameras.append(replace(one, name=f"cam{k}", R_camera_world=turn, centre=centre))
    path = tmp_path / "camchain.yaml"
    path.write_text(yaml.safe_dump(values), encoding="utf-8")
    assert_same(read_cameras(path), cameras)
    values["cam1"]["distortion_model"] = "equidistant"
    path.write_text(yaml.safe_dump(values), encoding="utf-8")
    with pytest.raises(ManifestError, match=r"cam1: distortion model .*equidistant"):
        read_cameras(path)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("huge.json", '{"camera_matrix": [' + ", ".join(["1" + "0" * 400] * 9) + "]}"),
        ("words.xml", "<opencv_storage><camera_matrix>a b</camera_matrix></opencv_storage>"),
        ("chain.yaml", "cam0: {intrinsics: 5, T_cn_cnm1: 3}\ncam1: {intrinsics: {}}"),
    ],
)
def test_hostile_calibrations_are_refused_in_one_line_at_once(tmp_path, name, text):
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    began = time.process_time()
    line = line_of(ManifestError, read_cameras, path)
    assert time.process_time() - began < 1
    assert line.startswith(str(path))
    assert len(line) < 400 + len(str(path))
    assert not re.search(r"Error|Exception|NoneType|object at|'(list|dict|str|float)'", line), line


def test_errors_go_with_their_cameras(tmp_path):
    """Two of the four, in another order; and none where those of the lenses are unknown."""
    whole = [replace(one, name=name) for one, name in zip(CAMERAS, "ABCD", strict=True)]
    draw = np.random.default_rng(0).standard_normal((56, 80))
    known = describe_reused(whole, draw @ draw.T)
    storage.write_netcdf(select_reusable(known), tmp_path / "calibration.nc")
    assert_same(read_cameras(tmp_path), whole)
    files = [{"name": name, "video": f"{name}.mkv", "exposure_s": 0.001} for name in "CA"]
    given = {"cameras": files, "calibration": "calibration.nc"}
    (tmp_path / "manifest.yaml").write_text(yaml.safe_dump(given), encoding="utf-8")
    manifest = read_manifest(tmp_path / "manifest.yaml", check_files=False)
    found = reuse_calibration(manifest, tmp_path)
    assert_same(found, [whole[2], whole[0]])
    poses, lenses = np.r_[12:18, 0:6], 24 + np.r_[16:24, 0:8]
    own = draw[np.r_[poses, lenses]]
    np.testing.assert_allclose(found.covariance, own @ own.T, rtol=1e-12)
    untold = known.assign(focal_deviation=known["focal_deviation"] * np.nan)
    storage.write_netcdf(select_reusable(untold), tmp_path / "calibration.nc")
    assert reuse_calibration(manifest, tmp_path).covariance is None


# How exact lenses that were calibrated before leave the cameras' places.


@pytest.mark.slow
def test_places_by_reused_lenses_are_as_exact_as_stated(conforms):
    """Lenses that are off as their covariance says, and then few images for the places."""
    points, n = BOARD.corners, 4
    held = np.diag(np.tile([2.0, 2, 2, 2, 2e-3, 2e-3, 1e-4, 1e-4], n) ** 2)
    errors, said, alone = [], [], []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        uv = observations(0.02, seed)[:, rng.permutation(12)[:6]]
        off = np.sqrt(np.diag(held)).reshape(n, 8) * rng.standard_normal((n, 8))
        lenses = [
            replace(
                one,
                K=one.K + np.array([[d[0], 0, d[2]], [0, d[1], d[3]], [0, 0, 0]]),
                distortion=one.distortion + np.r_[d[4:], 0],
            )
            for one, d in zip(CAMERAS, off, strict=True)
        ]
        full = adjust_bundle(uv, points, lenses, lenses=False)
        own = uncertainty.jackknife_cameras(uv, points, full)
        whole = uncertainty.add_lens_covariance(uv, points, full, held, own.covariance)
        errors.append(differences(full.cameras, CAMERAS)[8 * n :])
        said.append(deviations_of(replace(own, covariance=whole))[8 * n :])
        alone.append(deviations_of(own)[8 * n :])
    ratio = np.sqrt(np.mean(np.square(said), axis=0) / np.mean(np.square(errors), axis=0))
    # Wrong lenses show as misfits, too, which the jackknife alone has already: a little too large.
    conforms.sampled(np.exp(np.mean(np.log(ratio))), above=0.95, below=1.35)
    conforms.sampled(np.mean(np.abs(errors) < 2 * np.array(said)), above=0.9)
    conforms.sampled(np.mean(np.abs(errors) < 2 * np.array(alone)), below=0.85)


# From folder to shape.


@pytest.fixture(scope="module")
def first(tmp_path_factory):
    """A measurement with a calibration of its own, its folder and manifest."""
    folder = tmp_path_factory.mktemp("first")
    part = Component(amplitude=0.003, frequency=6.3)
    scene = own.short_rig(setups.thesis_beam(), [(12, 30), (-150, 35)], part, steady=0.8)
    path = own.make(folder, scene, {})
    measure_recordings(path, folder / "measured", lambda line: None)
    return folder


def again(first, calibration, pictures=True):
    """The same recordings by another calibration, with pictures of the board or without."""
    values = yaml.safe_load((first / "manifest.yaml").read_text(encoding="utf-8"))
    values["calibration"] = calibration
    for camera in values["cameras"] if not pictures else []:
        del camera["board_images"]
    path = first / "again.yaml"
    path.write_text(yaml.safe_dump(values), encoding="utf-8")
    return own.shape_of(path, first / "again" / ".steps")


@pytest.mark.nightly
def test_a_reused_calibration_gives_the_same_shape(conforms, first):
    """With its places found anew from the same images."""
    before = xr.load_dataset(first / "measured" / "measured.nc")
    data = again(first, {"file": "measured", "poses": "anew"})
    most = float(np.abs(before["deflection"]).max())
    conforms.independent(data["deflection"], before["deflection"], atol=1e-4 * most)
    ratio = np.sqrt(np.mean(data["standard_error"] ** 2 / before["standard_error"] ** 2))
    conforms.independent(float(ratio), 1, atol=0.3)
    np.testing.assert_allclose(data["focal_deviation"], before["focal_deviation"])
    assert (data["shots_used"] > 0).all()
    page = measure_recordings(first / "again.yaml", first / "again", lambda line: None).page
    assert "comes from the calibration that was reused" not in page


@pytest.mark.nightly
@pytest.mark.parametrize("exact", [True, False])
def test_a_calibration_with_its_places_needs_no_pictures(conforms, first, exact):
    """Of the library it tells how exact it is, as the file of another program does not."""
    before = xr.load_dataset(first / "measured" / "measured.nc")
    data = again(first, "measured" if exact else "measured/cameras.yaml", pictures=False)
    most = float(np.abs(before["deflection"]).max())
    conforms.independent(data["deflection"], before["deflection"], atol=1e-4 * most)
    told = " ".join(note.text for note in check_shape(data))
    assert ("does not state its uncertainty" in told) == (not exact)
    assert np.isnan(data["focal_deviation"]).all() == (not exact)
    assert (data["shots_used"] == 0).all()
    if exact:
        ratio = np.sqrt(np.mean(data["standard_error"] ** 2 / before["standard_error"] ** 2))
        conforms.independent(float(ratio), 1, atol=1e-3)


def test_pictures_are_needed_unless_the_places_are_known(tmp_path):
    cameras = [{"name": n, "video": f"{n}.mkv", "exposure_s": 0.001} for n in "AB"]
    path = tmp_path / "manifest.yaml"
    path.write_text(yaml.safe_dump({"cameras": cameras, "calibration": "c.nc"}), encoding="utf-8")
    assert read_manifest(path, check_files=False).calibration.file == "c.nc"
    anew = {"cameras": cameras, "calibration": {"file": "c.nc", "poses": "anew"}}
    path.write_text(yaml.safe_dump(anew), encoding="utf-8")
    with pytest.raises(ManifestError, match=r"cameras\[0\]\.board_images: given null"):
        read_manifest(path, check_files=False)
