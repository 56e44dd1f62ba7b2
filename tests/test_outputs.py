"""Commands never replace what they did not write: one test over all that write."""

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from command import refusal, thesis

from thesis_lib import files
from thesis_lib.measure.recordings.media import write_png, write_video

MINE = b"the user's own"
FRAMES = np.random.default_rng(0).integers(0, 256, (8, 32, 32), np.uint8)
# What a command is given, in a folder that `stage` has filled, and all that it would write there.
COMMANDS = {
    "convert": ("convert cam1 --rate-hz 240", ["cam1.mov"]),
    "pack to a file": ("convert cam1 film.mov --rate-hz 240", ["film.mov"]),
    "pack onto a picture": ("convert cam1 cam1/0.png --rate-hz 240", ["cam1/0.png"]),
    "print board": ("print board", ["board.pdf"]),
    "print markers": ("print markers", ["markers.pdf"]),
    "print stand": ("print stand layout.yaml", ["stand.pdf"]),
    "sync": ("sync A.mkv B.mkv", ["sync/sync.csv", "sync/sync.png"]),
    "run": ("run beam-distance -p trials=1 --out here", ["here/beam-distance.nc"]),
    "run two": ("run beam-distance beam-aperture -p trials=1 --out here", ["here/index.html"]),
    "plan": ("plan -p counts=[2] --out here", ["here/plan.nc", "here/plan.html"]),
    "measure": (
        "measure whole.yaml --out here",
        ["here/report.html", "here/cameras.toml", "here/figures/deflection.svg",
         "here/.steps/tracks-00.npy"],
    ),
    "measure, inputs": ("measure whole.yaml --out ./cam1/..", ["cameras.toml", "report.html"]),
    "measure --check": ("measure --check layout.yaml --out here", ["here/cameras.png"]),
    "measure --new": ("measure --new .", ["manifest.yaml"]),
    "measure --new, planned": ("measure --new . -p cameras=4", ["planned.yaml"]),
    "measure --example": ("measure --example here", ["here/manifest.yaml", "here/notes.txt"]),
}  # fmt: skip


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """Two videos, a folder of images, and manifests."""
    folder = tmp_path_factory.mktemp("recorded")
    (folder / "cam1").mkdir()
    for k, frame in enumerate(FRAMES):
        write_png(folder / "cam1" / f"{k}.png", frame)
    for k, name in enumerate("AB"):
        sound = 0.1 * np.random.default_rng(k).standard_normal(48000)
        write_video(folder / f"{name}.mkv", FRAMES, 30, sound)
    assert thesis("measure", "--new", folder, "-p", "cameras=2").status == 0
    planned = (folder / "planned.yaml").rename(folder / "layout.yaml").read_text()
    for old, new in (("phone-1", "A"), ("phone-2", "B")):
        planned = planned.replace(f"{old}.mp4", f"{new}.mkv")
    planned = re.sub("board_images: .*", "board_images: cam1", planned)
    (folder / "whole.yaml").write_text(f"{planned}\ncalibration: cameras.toml\n")
    return folder


@pytest.fixture
def here(recorded, tmp_path, monkeypatch):
    folder = tmp_path / "here and now"
    shutil.copytree(recorded, folder)
    monkeypatch.chdir(folder)
    return folder


@pytest.mark.parametrize(
    ("command", "output"),
    [pytest.param(c, o, id=f"{n}: {o}") for n, (c, all_) in COMMANDS.items() for o in all_],
)
def test_no_command_replaces_a_file_of_the_users(here, command, output):
    """It is named in one line, before anything is computed; nothing else is written."""
    file = here / output
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_bytes(MINE)
    before = {path: path.read_bytes() for path in here.rglob("*") if path.is_file()}
    said = refusal(thesis(*command.split()))
    assert Path(output).name in said or "here:" in said or ".steps" in said
    assert {path: path.read_bytes() for path in here.rglob("*") if path.is_file()} == before


def test_a_measurement_never_replaces_what_it_reads(here):
    """Though the calibration was written by an earlier one into the same folder."""
    (here / "part").mkdir()
    (here / "part" / "calibration.nc").write_bytes(MINE)
    files.put_files(here / "part", here / "cam1")
    text = (here / "whole.yaml").read_text()
    for file in ("cam1/calibration.nc", "cam1"):
        (here / "whole.yaml").write_text(text.replace("cameras.toml", file))
        said = refusal(thesis("measure", "whole.yaml", "--out", "cam1"))
        assert "calibration.nc: is read by this command" in said
    assert (here / "cam1" / "calibration.nc").read_bytes() == MINE


def test_own_results_are_replaced_and_those_that_were_edited_are_kept(here):
    command, out = ("measure", "--check", "layout.yaml", "--out", "here"), here / "here"
    assert thesis(*command).status == 0
    (out / "notes.txt").write_bytes(MINE)  # which no output replaces
    own = (out / "errors.png").read_bytes()
    assert thesis(*command).err == ""
    for k in (1, 2):
        (out / "errors.png").write_bytes(MINE + bytes(k))
        done = thesis(*command)
        assert done.status == 0
        assert f"it is kept as errors.{k}.png" in done.err
        assert (out / f"errors.{k}.png").read_bytes() == MINE + bytes(k)
        assert (out / "errors.png").read_bytes() == own
    assert (out / "notes.txt").read_bytes() == MINE


@pytest.fixture
def part(tmp_path):
    folder = tmp_path / "part"
    folder.mkdir()
    for name in "ab":
        (folder / name).write_text(name)
    (tmp_path / "out").mkdir()
    return folder


def test_results_of_a_command_that_was_killed_are_its_own(part, tmp_path, monkeypatch):
    """At every file between the record and the last one moved."""
    out, text = tmp_path / "out", 0
    for moved in (0, 1):
        files.put_files(part, out)
        for name in "ab":
            (part / name).write_text(f"{name} {(text := text + 1)}")
        left = iter(range(moved))

        def replace(self, target, own=Path.replace, left=left):
            if self.parent == part and next(left, None) is None:
                raise KeyboardInterrupt
            return own(self, target)

        with monkeypatch.context() as patch:
            patch.setattr(Path, "replace", replace)
            with pytest.raises(KeyboardInterrupt):
                files.put_files(part, out)
        for name in "ab":
            (part / name).write_text(name)
    files.put_files(part, out)
    assert [(out / name).read_text() for name in "ab"] == ["a", "b"]


@pytest.mark.parametrize("mine", ["a file", "a link", "a folder", "a record"])
def test_what_stands_in_the_way_is_refused_and_nothing_is_moved(part, tmp_path, mine):
    out = tmp_path / "out"
    elsewhere = tmp_path / "mine"
    if mine == "a file":
        (out / "b").write_bytes(MINE)
    elif mine == "a folder":
        (out / "b").mkdir()
    elif mine == "a record":
        (out / files.RECORD_NAME).write_bytes(MINE)
    else:
        (out / "b").symlink_to(elsewhere)
        elsewhere.write_text("b")  # even if it holds the same
    before = sorted(out.iterdir())
    with pytest.raises(files.RefusedError):
        files.put_files(part, out)
    with pytest.raises(files.RefusedError):
        files.check_outputs(out, [out / "b"])
    assert sorted(out.iterdir()) == before


def test_a_folder_of_the_users_is_no_cache(tmp_path):
    files.check_cache(tmp_path / "new")
    files.mark_cache(tmp_path / "new")
    files.check_cache(tmp_path / "new")
    (tmp_path / "mine").mkdir()
    files.check_cache(tmp_path / "mine")  # it is empty
    (tmp_path / "mine" / ".staging-ended").mkdir()
    files.check_cache(tmp_path / "mine")  # a kill came before the tag
    (tmp_path / "mine" / "tracks-00.npy").write_bytes(MINE)
    with pytest.raises(files.RefusedError, match="mine"):
        files.check_cache(tmp_path / "mine")


def test_only_what_a_record_proves_to_be_of_an_ended_process_is_swept(tmp_path):
    code = (
        "import os, sys, pathlib, thesis_lib.files as f\n"
        "with f.staging(pathlib.Path(sys.argv[1])): os._exit(9)"
    )
    subprocess.run([sys.executable, "-c", code, str(tmp_path)], check=False)
    (abandoned,) = tmp_path.iterdir()
    others = [tmp_path / f".staging-{name}" for name in ("mine", "elsewhere", "text")]
    for place in others:
        place.mkdir()
    elsewhere = {"thesis_lib": ["another host", 1]}
    (others[1] / files.OWNER_RECORD).write_text(json.dumps(elsewhere))
    (others[2] / files.OWNER_RECORD).write_text("[]")
    with files.staging(tmp_path), files.staging(tmp_path):  # one that is in use stays
        assert len(list(tmp_path.iterdir())) == 5
    assert not abandoned.exists()
    assert sorted(tmp_path.iterdir()) == sorted(others)
