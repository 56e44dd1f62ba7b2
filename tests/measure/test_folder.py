"""Folders as people have them: strange names, hidden files, other endings, chapters."""

import re
import shutil

import cv2
import numpy as np
import pytest
from command import refusal, thesis
from scenes.sounds import append_sony_rate

from thesis_lib.measure.recordings.manifest import image_paths, read_manifest
from thesis_lib.measure.recordings.media import write_video


@pytest.fixture(scope="module")
def video(tmp_path_factory):
    path = tmp_path_factory.mktemp("one") / "one.mov"
    write_video(path, [np.full((48, 64), 90, np.uint8)] * 20, 50, np.zeros(19200), codec="h264")
    return path


def new(folder, video, *names):
    folder.mkdir(exist_ok=True)
    for name in names:
        shutil.copy(video, folder / name)
    return thesis("measure", "--new", folder)


NAMES = ["B 10:22.mov", "[left] *.mov", "'a' \"b\".mov", "größe ÷.mov", "-x.mov", "#1: {a}.mov",
         f"{'long' * 15} 1.mov", f"{'long' * 15} 2.mov"]  # fmt: skip


def test_any_name_that_a_disk_allows_is_read_back(tmp_path, video, monkeypatch):
    folder = tmp_path / "a[b]: c"
    folder.mkdir()
    for name in NAMES:
        for k in range(3):
            picture = folder / f"{name.removesuffix('.mov')}-{k}.png"
            cv2.imwrite(str(picture), np.full((48, 64), 90 + k, np.uint8))
    monkeypatch.chdir(tmp_path)
    done = new(folder.relative_to(tmp_path), video, *NAMES)
    assert (done.status, done.err) == (0, "")
    manifest = read_manifest(folder / "manifest.yaml", check_files=True)
    assert {camera.video for camera in manifest.cameras} == set(NAMES)
    assert len({camera.name for camera in manifest.cameras}) == len(NAMES)
    for camera in manifest.cameras:
        stem = camera.video.removesuffix(".mov")
        found = [path.name for path in image_paths(camera, folder) if path]
        assert found == [f"{stem}-{k}.png" for k in range(3)], camera.video


def test_other_endings_are_read_or_named_and_hidden_files_are_none(tmp_path, video):
    (tmp_path / "board" / "a").mkdir(parents=True)
    for name in ("what.dat", "raw.h264", "notes.txt", "._a.mov", ".b.mov", "board/a/._0.png"):
        (tmp_path / name).write_bytes(b"none")
    done = new(tmp_path, video, "a.3gp", "b.odd")
    assert (done.status, done.err) == (0, "")
    manifest = read_manifest(tmp_path / "manifest.yaml", check_files=False)
    assert [camera.video for camera in manifest.cameras] == ["a.3gp", "b.odd"]
    assert "passed over: what.dat" in done.out
    assert re.search(r"thesis convert \S*raw\.h264 --rate-hz", done.out)
    assert "notes.txt" not in done.out
    assert "._" not in done.out


@pytest.mark.parametrize(
    ("names", "words"),
    [
        (["gps.mov", "gps.MP4"], "gps.MP4, gps.mov have one name"),
        (["GX010034.MP4", "GX020034.MP4", "GX010035.MP4"], "GX010034.MP4, GX020034.MP4 are chap"),
        (["a\tb.mov", "b.mov"], "characters that can be seen"),
    ],
)
def test_videos_that_are_not_of_one_camera_each_are_explained(tmp_path, video, names, words):
    said = refusal(new(tmp_path, video, *names))
    assert words in said
    assert "-p" not in said
    assert not (tmp_path / "manifest.yaml").exists()


def test_slow_motion_is_taken_at_its_own_rate(tmp_path, video):
    slow = tmp_path / "slow.mov"
    append_sony_rate(video, slow, "400.00", 50)
    folder = tmp_path / "f"
    done = new(folder, slow, "a.mov", "b.mov")
    assert "taken at 400" in done.out
    manifest = read_manifest(folder / "manifest.yaml", check_files=False)
    assert [(c.frame_rate_hz, c.captured_hz, c.rate_hz) for c in manifest.cameras] == [
        (50, 400, 400)] * 2  # fmt: skip
    done = new(tmp_path / "g", video, "a.mov", "b.mov")
    text = (tmp_path / "g" / "manifest.yaml").read_text(encoding="utf-8")
    assert text.count("captured_hz: null  # CHECK") == 2
    assert "a.mov: 64 × 48 px, 50 frames per second" in done.out


def test_a_packed_film_is_used_in_place_of_its_source(tmp_path, video):
    """Both would count as one recording in two files."""
    for name in ("a.mp4", "b.mov"):
        shutil.copy(video, tmp_path / name)
    assert thesis("convert", tmp_path / "a.mp4", "--rate-hz", "400").status == 0
    done = new(tmp_path, video)
    assert (done.status, done.err) == (0, "")
    manifest = read_manifest(tmp_path / "manifest.yaml", check_files=False)
    rates = {camera.video: camera.frame_rate_hz for camera in manifest.cameras}
    assert rates == {"a.mov": 400, "b.mov": 50}
    assert "passed over: a.mp4, since a.mov was packed from it" in done.out
