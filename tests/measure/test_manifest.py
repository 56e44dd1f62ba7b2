"""Manifests: round trips, defaults of the thesis, and silly ones refused in one line."""

import numpy as np
import pytest
import yaml
from refused import line_of
from scenes.manifests import change, plain

from thesis_lib.facts import setups
from thesis_lib.measure.fitting.result import model_of
from thesis_lib.measure.recordings.manifest import (
    ManifestError,
    image_paths,
    read_manifest,
    rename_options,
    write_manifest,
)
from thesis_lib.measure.recordings.manifest_parts import StructureSpec
from thesis_lib.measure.recordings.media import write_png, write_video
from thesis_lib.measure.recordings.validation import check_excitation, check_recordings


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    folder = tmp_path_factory.mktemp("recordings")
    frames = np.random.default_rng(0).integers(0, 256, (6, 48, 64), np.uint8)
    hiss = np.random.default_rng(1).uniform(-0.1, 0.1, 52800)
    for name in "AB":
        write_video(folder / f"{name}.mkv", np.tile(frames, (11, 1, 1)), 60, hiss)
        for k in range(12):
            write_png(folder / "shots" / name / f"{k}.png", frames[k % 6])
    return folder


def written(folder, values, name="manifest.yaml"):
    path = folder / name
    path.write_text(values if isinstance(values, str) else yaml.safe_dump(values))
    return path


def refusal(path, **options):
    message = line_of(ManifestError, lambda: read_manifest(path, **options))
    assert len(message) < 600
    assert message.startswith(f"{path}: ")
    return message.removeprefix(f"{path}: ")


def test_what_is_written_is_read(recordings):
    values = plain()
    assert [*check_recordings(read_manifest(written(recordings, values)), recordings)] == []
    values["cameras"][0] |= {"name": "Nikon D5 №1",
                             "corners_px": [[1, 2], [60, 2], [60, 40], [1, 40]]}  # fmt: skip
    values |= {"structure": {"markers": {"hole_mm": None}}, "excitation": {"frequency_hz": None}}
    manifest = read_manifest(written(recordings, values))
    write_manifest(manifest, recordings / "again.yaml")
    assert read_manifest(recordings / "again.yaml") == manifest


def test_old_names_are_read_and_reported(recordings, capsys):
    excitation = {"kind": "free_decay", "sound": "room", "rest_duration_s": 0.5}
    now = plain(excitation=excitation)
    wanted = read_manifest(written(recordings, now, "now.yaml"))
    assert capsys.readouterr().err == ""
    text = yaml.safe_dump(now).replace("board_images", "shots").replace("free_decay", "decay")
    old = written(recordings, text.replace("rest_duration_s", "rest_s"), "old.yaml")
    assert read_manifest(old) == wanted
    assert capsys.readouterr().err == (
        f"{old}: old names are read until version 2: rest_s is now rest_duration_s, "
        "kind: decay is now kind: free_decay, shots is now board_images\n"
    )
    asked = {"excitation.kind": "tone", "excitation.steady_s": [1, 2], "cameras.shots": None}
    now = {"excitation.steady_interval_s": [1, 2], "cameras.board_images": None}
    assert rename_options(asked) == {"excitation.kind": "sine"} | now


def test_the_default_structure_is_the_thesis_s_beam():
    structure = StructureSpec()
    assert model_of(structure) == setups.thesis_beam()
    points = structure.marker_points.reshape(2, 3, 25)
    np.testing.assert_allclose(points[:, 1], setups.thesis_beam().markers)
    np.testing.assert_allclose(points[1, :, 0], [0.005, 0.015, 0.025])
    np.testing.assert_allclose(structure.markers.hole_mm, [24.0, 10.0])


SILLY = [  # place, value, words of the refusal
    ("cameras.0.width_px", 64.5, ["cameras[0].width_px: given 64.5", "whole number"]),
    ("cameras.0.exposure_s", 0.02, ["cameras[0].exposure_s: given 0.02", "/ frame_rate_hz, in s"]),
    ("cameras.0.captured_hz", 1000, ["cameras[0].exposure_s: given", "1 / captured_hz, in s"]),
    ("cameras.0.video", ..., ["cameras[0].video: missing", "inside the manifest's folder"]),
    ("cameras.1.video", "../x.mkv", ['cameras[1].video: given "../x.mkv", allowed: a path']),
    ("cameras.1.video", "/etc/passwd", ['cameras[1].video: given "/etc/passwd"', "inside"]),
    ("cameras.1.video", "shots/../A.mkv", ["the same as cameras[0].video"]),
    ("cameras.1.name", "a\nb", ['cameras[1].name: given "a\\nb"', "40 characters"]),
    ("cameras.0.board_images", "../shots", ["cameras[0].board_images", "inside"]),
    ("cameras.0.board_images", "shots/A/1*.png", ["cameras: given 3, 12 board images"]),
    ("cameras.0.board_images", ["a.png"] * 12,
     ['cameras[0].board_images[0]: given "a.png"', "no such"]),
    ("cameras.0.corners_px", [[0, 0], [9, 9], [9, 0], [0, 9]],
     ["cameras[0].corners_px: given", "convex"]),
    ("cameras", plain("A")["cameras"], ["cameras: given", "2 to 16"]),
    ("camera", [], ["camera: no such field (did you mean cameras?)"]),
    ("structure.markers.columns", 26, ["structure.markers: given", "on the structure"]),
    ("structure.markers.spacing_mm", 3, ["structure.markers", "do not overlap"]),
    ("structure.markers.hole_mm", [24, 31], ["structure.markers.hole_mm: given [24"]),
    ("structure.markers.detector", "blob",
     ['structure.markers.detector: given "blob", allowed: "disc"']),
    ("board", {"kind": "charuco", "mark_mm": 45}, ["board.mark_mm: given 45", "below tile_mm"]),
    ("board", {"kind": "charuco", "columns": 20, "rows": 20, "dictionary": "DICT_5X5_100"},
     ['board.dictionary: given "DICT_5X5_100"', "enough marks, here 200"]),
    ("truth", "truth.nc", ['truth: given "truth.nc"', "no such file"]),
]  # fmt: skip


@pytest.mark.parametrize(("place", "value", "words"), SILLY)
def test_a_silly_manifest_is_refused_in_one_line(recordings, place, value, words):
    message = refusal(written(recordings, change(plain(), place, value), "silly.yaml"))
    assert [word for word in words if word not in message] == []


TEXTS = [
    ("- 1\n- 2\n", ["given [1, 2]", "fields"]),
    ("cameras:\n\t- x\n", ["line 2"]),
    ("truth: a\ntruth: b\n", ["line 2", "truth is given twice"]),
    ("truth: 2020-01-01\n", ["date"]),
    ("truth: a\nboard: " + "9" * 5000, ["line 2", "given 999", "..."]),
    ("board:\n  ? [a, b]\n  : 1\n", ["line 2", "a field's name", "text"]),
]


@pytest.mark.parametrize(("text", "words"), TEXTS)
def test_what_is_no_manifest_names_the_line(tmp_path, text, words):
    message = refusal(written(tmp_path, text))
    assert [word for word in words if word not in message] == []


def test_a_missing_manifest_is_named(tmp_path):
    assert "no such file" in refusal(tmp_path / "none.yaml")
    assert "a folder, give the YAML file in it" in refusal(tmp_path)
    (tmp_path / "binary.yaml").write_bytes(bytes(range(128, 256)))
    assert "UTF-8" in refusal(tmp_path / "binary.yaml")


def test_links_do_not_lead_outside(tmp_path):
    outside, folder = tmp_path / "outside", tmp_path / "inside"
    (outside / "shots").mkdir(parents=True)
    (folder / "own").mkdir(parents=True)
    for name in ("A.mkv", "shots/0.png"):
        (outside / name).write_bytes(b"")
    (folder / "A.mkv").symlink_to(outside / "A.mkv")
    (folder / "shots").symlink_to(outside / "shots")
    (folder / "own" / "0.png").symlink_to(outside / "shots" / "0.png")
    values = change(plain(), "cameras.0.board_images", [None] * 3)
    values["cameras"][1]["board_images"] = [None] * 3
    assert "cameras[0].video" in refusal(written(folder, values), check_files=False)
    values["cameras"][0]["video"] = "C.mkv"
    for images in ("shots", "own"):
        values["cameras"][0]["board_images"] = images
        message = refusal(written(folder, values), check_files=False)
        assert "cameras[0].board_images" in message
    assert "0.png" in message


def test_a_list_of_shots_may_have_gaps(recordings):
    shots = ["shots/A/0.png", None, *[f"shots/A/{k}.png" for k in range(2, 12)]]
    values = change(plain(), "cameras.0.board_images", shots)
    manifest = read_manifest(written(recordings, values))
    paths = image_paths(manifest.cameras[0], recordings)
    assert paths[1] is None
    assert paths[2] == recordings / "shots/A/2.png"
    names = [path.name for path in image_paths(manifest.cameras[1], recordings)]
    assert names == [f"{k}.png" for k in range(12)]  # in the order of their numbers


@pytest.mark.parametrize(
    ("field", "value", "line"),
    [("frequency_hz", 30.0, "below half of the frame rate, 30 Hz"),
     ("rest_duration_s", 0, "at least 0.05 s, three frames")],
)  # fmt: skip
def test_an_excitation_that_cannot_be_filmed_is_named(recordings, field, value, line):
    values = change(plain(), f"excitation.{field}", value)
    values["cameras"][0]["frame_rate_hz"] = 120
    line = f"excitation.{field}: given {value:g}, allowed: {line}"
    assert [*check_excitation(read_manifest(written(recordings, values)))] == [line]
