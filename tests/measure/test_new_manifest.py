"""``thesis measure --new``: a folder is looked at, and a commented manifest is in it."""

import re
import shlex

import cv2
import numpy as np
import pytest
import yaml
from command import refusal, thesis

from thesis_lib.files import project_root
from thesis_lib.laboratory.recording_files import example_manifest, example_rig
from thesis_lib.measure.feasibility.assess import assess_manifest
from thesis_lib.measure.feasibility.prediction import draft_manifest
from thesis_lib.measure.recordings.manifest import image_paths, read_manifest, write_manifest
from thesis_lib.measure.recordings.media import write_video
from thesis_lib.measure.report.animation import write_mp4
from thesis_lib.measure.report.figures import draw_prediction


@pytest.fixture
def folder(tmp_path):
    """Two cameras; one has its images in a folder, the other by their names; one has no sound."""
    picture = np.full((48, 64), 90, np.uint8)
    write_video(tmp_path / "left.mkv", [picture] * 20, 50, np.zeros(48000))
    write_mp4(tmp_path / "right.MP4", [np.dstack([picture] * 3)] * 20, 59.94)
    for place in (tmp_path / "board" / "left", tmp_path / "shots"):
        place.mkdir(parents=True)
    for k in range(4):
        cv2.imwrite(str(tmp_path / "board" / "left" / f"{k}.png"), picture)
    for k in range(2):
        cv2.imwrite(str(tmp_path / "shots" / f"right-{k}.jpg"), picture)
    (tmp_path / "notes.txt").write_text("on the day")
    return tmp_path


def test_what_files_show_is_in_the_manifest_and_what_is_missing_is_said(folder):
    given = ["-p", "structure.kind=plate", "-p", "board.tile_mm=30", "-p", "excitation.sound=room",
             "-p", "cameras.exposure_s=0.00005"]  # fmt: skip
    done = thesis("measure", "--new", folder, *given)
    assert (done.status, done.err) == (0, "")
    manifest = read_manifest(folder / "manifest.yaml", check_files=False)
    left, right = manifest.cameras
    assert (left.name, left.video, left.size, left.frame_rate_hz) == (
        "left", "left.mkv", (64, 48), 50.0)  # fmt: skip
    assert right.frame_rate_hz == pytest.approx(59.94, rel=1e-4)
    assert (left.board_images, right.board_images) == ("board/left", "shots/right-*.jpg")
    assert left.exposure_s == right.exposure_s == 5e-5
    assert manifest.structure.kind == "plate"
    assert (manifest.board.tile_mm, manifest.excitation.sound) == (30.0, "room")
    lines = done.out.splitlines()
    missing = "\n".join(line for line in lines if line.startswith("missing: "))
    for words in ("right.MP4 has no sound", "board images by right, at least 3", "[4, 2]"):
        assert words in missing
    assumed = "\n".join(line for line in lines if line.startswith("not given, so assumed: -p "))
    assert "structure.length_mm=623.0" in assumed
    assert "tile_mm" not in assumed
    assert "exposure_s" not in assumed
    text = (folder / "manifest.yaml").read_text(encoding="utf-8")
    assert "  length_mm: 623.0  # CHECK: length along x" in text


def test_images_of_a_camera_with_a_longer_name_are_not_taken(folder):
    picture = np.full((48, 64), 90, np.uint8)
    write_mp4(folder / "right-2.mp4", [np.dstack([picture] * 3)] * 20, 60)
    for name in ("right-2", "right-3", "right-2-0", "right-2-1", "right-2-2"):
        cv2.imwrite(str(folder / "shots" / f"{name}.jpg"), picture)
    assert thesis("measure", "--new", folder).status == 0
    cameras = read_manifest(folder / "manifest.yaml", check_files=False).cameras
    shots = {camera.name: image_paths(camera, folder) for camera in cameras}
    assert shots["right"] == [folder / "shots" / f"right-{k}.jpg" for k in range(4)]
    assert shots["right-2"] == [folder / "shots" / f"right-2-{k}.jpg" for k in range(3)]


@pytest.mark.parametrize(
    ("name", "given"), [("manifest.yaml", []), ("planned.yaml", ["-p", "cameras=3"])]
)
def test_the_assumed_fields_can_be_pasted_as_they_are_said(folder, name, given):
    first, file = thesis("measure", "--new", folder, *given), folder / name
    one = read_manifest(file, check_files=False)
    file.unlink()
    marks = "not given, so assumed: -p "
    said = [line[len(marks) :] for line in first.out.splitlines() if line.startswith(marks)]
    assert len(said) > 15
    pasted = [part for line in said for part in shlex.split(f"-p {line}")]
    assert len(pasted) == 2 * len(said)  # as a shell parts them, too
    second = thesis("measure", "--new", folder, *given, *pasted)
    assert marks not in second.out
    assert read_manifest(file, check_files=False) == one
    assert "CHECK:" not in file.read_text(encoding="utf-8")


GIVEN = {
    "force and radiation": (
        "excitation.kind=free_decay", "force.file=force.wav", "force.full_scale_n=2.5",
        "force.channel=2", "force.at_mm=[500, 15]", "radiation.points_mm=[[0, 0, 1000]]",
    ),
    "calibration": ("calibration.file=earlier", "calibration.poses=anew", "truth=truth.nc"),
}  # fmt: skip


@pytest.mark.parametrize("given", GIVEN.values(), ids=GIVEN)
def test_all_that_is_given_is_in_the_manifest(folder, given):
    done = thesis("measure", "--new", folder, *(part for one in given for part in ("-p", one)))
    assert (done.status, done.err) == (0, "")
    manifest = read_manifest(folder / "manifest.yaml", check_files=False).model_dump(mode="json")
    for name, value in (one.split("=") for one in given):
        inside = manifest
        for part in name.split("."):
            inside = inside[0] if isinstance(inside, list) else inside
            inside = inside[part]
        assert inside == yaml.safe_load(value), name
        if "file" in name or name == "truth":
            assert f"missing: {value}, no such file in {folder}" in done.out.splitlines()


def test_folders_that_are_none_or_have_no_videos_or_a_manifest(folder, tmp_path):
    (folder / "manifest.yaml").write_text("mine")
    (tmp_path / "empty").mkdir()
    for place, words in {
        folder: "is there already",
        tmp_path / "empty": "0 videos, allowed: 2 to 16",
        tmp_path / "none": "no such folder",
    }.items():
        assert words in refusal(thesis("measure", "--new", place))
    assert (folder / "manifest.yaml").read_text() == "mine"
    assert "-p is given" in thesis("measure", folder / "manifest.yaml", "-p", "a=1").err
    (folder / "manifest.yaml").unlink()
    done = thesis("measure", "--new", folder, "-p", "board.tile=30")
    assert "board.tile: no such field" in refusal(done)
    assert not (folder / "manifest.yaml").exists()


def test_where_no_hole_tells_the_ends_corners_are_asked_for(folder):
    done = thesis("measure", "--new", folder, "-p", "structure.markers.rows=2")
    (line,) = [line for line in done.out.splitlines() if "corners_px" in line]
    assert line.startswith("missing: corners_px of left and right")
    assert str(folder / "corners.html") in line
    assert (folder / "corners.html").is_file()
    text = (folder / "manifest.yaml").read_text(encoding="utf-8")
    assert text.count("    corners_px: null  # CHECK: the structure's corners (0, 0)") == 2
    (folder / "manifest.yaml").unlink()
    done = thesis("measure", "--new", folder)  # the thesis's beam has a hole
    assert "corners_px" not in done.out + (folder / "manifest.yaml").read_text(encoding="utf-8")


def test_the_guides_commands_lead_to_a_manifest_that_passes_the_check(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    page = (project_root() / "book" / "recordings.md").read_text(encoding="utf-8")
    blocks = re.findall(r"```console\n(.*?)```", page, flags=re.DOTALL)
    lines = "".join(blocks).replace("\\\n", " ").splitlines()
    commands = [shlex.split(line.removeprefix("$ ")) for line in lines]
    names = re.findall(r"(\w+)\.mp4", re.findall(r"```text\n(plate/.*?)```", page, re.DOTALL)[0])
    assert len(names) == 4
    picture = np.full((120, 160), 90, np.uint8)
    for name in names:
        (tmp_path / "plate" / "board" / name).mkdir(parents=True)
        write_mp4(tmp_path / "plate" / f"{name}.mp4", [np.dstack([picture] * 3)] * 20, 60)
        for k in range(3):
            cv2.imwrite(str(tmp_path / "plate" / "board" / name / f"{k}.jpg"), picture)
    for command in commands[:-1]:
        done = thesis(*command[1:])
        assert (done.status, done.err) == (0, ""), command
    assert {path.name for path in tmp_path.glob("*.pdf")} == {"board.pdf", "markers.pdf"}
    manifest = read_manifest(tmp_path / commands[-1][2], check_files=False)
    planned = draft_manifest({"cameras": 4, "structure.kind": "plate"})
    assert manifest.board == planned.board
    assert manifest.excitation.sound == planned.excitation.sound == "room"


def test_the_check_draws_where_cameras_stand_and_what_they_reach(tmp_path):
    manifest = example_manifest(example_rig())
    write_manifest(manifest, tmp_path / "manifest.yaml")
    done = thesis("measure", "--check", tmp_path / "manifest.yaml", "--out", tmp_path / "drawn")
    assert (done.status, done.err) == (0, "")
    for name in ("cameras", "errors"):
        assert f"Wrote {tmp_path / 'drawn' / name}.png" in done.out
        assert cv2.imread(str(tmp_path / "drawn" / f"{name}.png")).shape[1] > 900
    above = draw_prediction(manifest)["cameras"].axes[0]
    named = {text.get_text(): text.xy for text in above.texts}
    for camera in manifest.cameras:
        flat = camera.distance_mm * np.cos(np.radians(camera.elevation_deg))
        azimuth = np.radians(camera.azimuth_deg)
        place = flat * np.sin(azimuth), flat * np.cos(azimuth)
        np.testing.assert_allclose(named[camera.name], place, rtol=1e-9)
    shown = draw_prediction(manifest)["errors"].axes[0].collections[0].get_array()
    assert np.sqrt(np.mean(shown**2)) == pytest.approx(assess_manifest(manifest).rig.fit[0])
