"""Each way in which a folder of recordings can be wrong: one line, and nothing half-written."""

import json
import shutil

import numpy as np
import pytest
import yaml
from command import thesis
from scenes.manifests import SIZE, change, plain
from scenes.sounds import write_film

from thesis_lib.measure.recordings.media import write_png, write_video

(WIDTH, HEIGHT), RATE = SIZE, 60


def tone(frequency=8.0):
    """1.5 s of a force that begins after the rest."""
    t = np.arange(72000) / 48000
    return 0.5 * np.sin(2 * np.pi * frequency * t) * np.clip((t - 0.5) / 0.1, 0, 1)


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    """A folder with two cameras' files: noise for images, and no board in any."""
    folder = tmp_path_factory.mktemp("recordings")
    frames = np.random.default_rng(0).integers(0, 256, (9, HEIGHT, WIDTH), np.uint8)
    for name in "AB":
        write_video(folder / f"{name}.mkv", np.tile(frames, (10, 1, 1)), RATE, tone())
        for k in range(4):
            write_png(folder / "shots" / name / f"{k}.png", frames[k])
    return folder


# What can be done to a folder, by functions of it, of the manifest's values and of what is chosen.


def action(function):
    """The function with its choices given first, the folder and the values later."""
    return lambda *how, **named: lambda folder, values: function(folder, values, *how, **named)


@action
def given(folder, values, place, value=...):
    """A field of the manifest by its path; ``...`` leaves it out."""
    change(values, place, value)


@action
def both(folder, values, *changes):
    for one in changes:
        one(folder, values)


@action
def cut(folder, values, name, keep):
    """A file that is cut to a share of its length."""
    whole = (folder / name).read_bytes()
    (folder / name).write_bytes(whole[: int(keep * len(whole))])


@action
def renamed(folder, values, name, other):
    (folder / name).rename(folder / other)


@action
def video(folder, values, count=90, size=SIZE, sound=None):
    """Another video of the second camera."""
    frames = np.random.default_rng(1).integers(0, 256, (count, *size[::-1]), np.uint8)
    write_video(folder / "B.mkv", frames, RATE, tone() if sound is None else sound)


@action
def coded(folder, values, silent=False, **options):
    """The second camera's video as H.264 in MP4, with x264's options."""
    values["cameras"][1]["video"] = "B.mp4"
    write_film(folder / "B.mp4", [] if silent else [tone()], frames=90, frame_rate=RATE,
               pictures="libx264", options=options)  # fmt: skip


@action
def reused(folder, values, head="", **second):
    """A calibration of both cameras in TOML; None leaves out a value of the second."""
    lines = [head]
    for k, camera in enumerate("AB"):
        one = {
            "name": camera, "size": [WIDTH, HEIGHT],
            "matrix": [[60.0, 0.0, 31.5], [0.0, 60.0, 23.5], [0.0, 0.0, 1.0]],
            "distortions": [0.0] * 5, "rotation": [0.1 * k, 0.0, 0.0],
            "translation": [0.5 * k, 0.0, 1.0],
        } | (second if k else {})  # fmt: skip
        lines += [
            f"[cam_{k}]",
            *(f"{key} = {json.dumps(v)}" for key, v in one.items() if v is not None),
        ]
    (folder / "c.toml").write_text("\n".join(lines), encoding="utf-8")
    values["calibration"] = "c.toml"


WRONG, FAILED = 2, 1  # exit status: the request, or what is in the files
CASES = {
    # The manifest.
    "a comma for a point": (given("excitation.frequency_hz", "4,25"), WRONG,
                            ['excitation.frequency_hz: given "4,25"', "in Hz"]),
    "places on a line": (
        given("structure.markers.points_mm", [[10 * k, 15] for k in range(1, 9)]), WRONG,
        ["structure.markers.points_mm", "not on one line"]),
    # Videos.
    "no video": (renamed("B.mkv", "B"), WRONG, ['cameras[1].video: given "B.mkv", no such file']),
    "a hidden sign": (given("cameras.1.video", "B\0.mkv"), WRONG, ["allowed: a path inside"]),
    "too long a name": (given("cameras.1.video", 300 * "B"), WRONG, ["no such file"]),
    "no pattern": (given("cameras.1.board_images", "b/**B-*.jpg"), WRONG, ["allowed: at least 3"]),
    "a cut video": (cut("B.mkv", 0.6), FAILED, ["B.mkv: ends before frame"]),
    "an MP4 without its index": (both(coded(), cut("B.mp4", 0.9)), WRONG,
                                 ["cut off before its index"]),
    "another size": (video(size=(96, 64)), WRONG, ["96 × 64 px, allowed: 64 × 48 px"]),
    "an image of another size": (
        lambda folder, _: write_png(folder / "shots/B/0.png", np.zeros((64, 96), np.uint8)), WRONG,
        ["cameras[1].board_images", "0.png: 96 × 64 px, allowed: 64 × 48 px"]),
    "interlaced": (coded(**{"x264-params": "tff=1"}), WRONG, ["B.mp4: interlaced", "progressive"]),
    "another frame rate": (given("cameras.1.frame_rate_hz", 50), WRONG,
                           ["60 frames per second, allowed: 50, its frame_rate_hz"]),
    "shorter than the rest": (video(count=24), WRONG, ["more than rest_duration_s, 0.5 s"]),
    "shorter, played slowly": (
        both(given("cameras.1.captured_hz", 240), given("excitation.sound", "none")), WRONG,
        ["0.375 s of images, allowed: more than rest_duration_s, 0.5 s"]),
    # Sound.
    "no sound": (coded(silent=True), WRONG, ["no audio track", "excitation.sound: none"]),
    "silence": (video(sound=np.zeros(72000)), WRONG, ["B.mkv: silent audio", "allowed: at least"]),
    "clipped": (video(sound=np.sign(tone())), FAILED, ["B: clipped audio"]),
    "another sound": (video(sound=0.3 * np.random.default_rng(2).standard_normal(72000)), FAILED,
                      ["B: correlation of"]),
    "sound cut off": (video(sound=tone()[:33600]), WRONG, ["its sound at 0.700 s"]),
    "another tone": (given("excitation.frequency_hz", 11.0), FAILED,
                     ["s of steady tone of 11 Hz"]),
    # Excitation.
    "an alias that stands still": (
        both(given("excitation.frequency_hz", 60.1), given("excitation.undersampled", True)), WRONG,
        ["at least 0.6 Hz from 60 Hz"]),
    "a steady part elsewhere": (given("excitation.steady_interval_s", [0.7, 9]), WRONG,
                                ["excitation.steady_interval_s: given [0.7, 9], allowed: within"]),
    # The board and its images.
    "no pictures": (renamed("shots/B", "other"), WRONG, ["cameras[1].board_images", "0 images"]),
    "images of a camera's own kind": (
        both(*(renamed(f"shots/B/{k}.png", f"shots/B/{k}.DNG") for k in range(4))), WRONG,
        ["0 images", ".jpg"]),
    "no board in any": (both(), FAILED, ["A: 0 of 4 board images show the board", "9 × 9 tiles"]),
    # A calibration that is reused.
    "no calibration": (given("calibration", "other"), WRONG, ["other: no calibration there"]),
    "a cut netCDF file": (both(reused(), renamed("c.toml", "c.nc"), given("calibration", "c.nc")),
                          WRONG, ["c.nc: no calibration"]),
    "calibrated in another size": (reused(size=[32, 24]), WRONG,
                                   ["B of 32 × 24 px, allowed: one B of 64 × 48 px"]),
    "a camera that is missing": (reused(name="C"), WRONG, ["C of 64 × 48 px, allowed: one B of"]),
    "a fisheye": (reused(fisheye=True), WRONG, ['camera B: distortion model "fisheye"', "Brown"]),
    "a rational lens": (reused(distortions=[0.1] * 8), WRONG, ["camera B: ", "8 coeff"]),
    "a mirror": (reused(rotation=[[1, 0, 0], [0, 1, 0], [0, 0, -1]]), WRONG,
                 ["camera B: rotation: given", "x right, y down"]),
    "calibrated in mm": (reused(translation=[500.0, 0.0, 1000.0]), WRONG,
                         ["m apart", "calibration.unit: mm"]),
    "calibrated in feet": (reused('[metadata]\nunits = "ft"'), WRONG,
                           ['lengths in "ft", allowed: m or mm']),
    "no places": (reused(translation=None), WRONG, ["does not say where", "poses: anew"]),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_what_is_wrong_is_one_line(recordings, tmp_path, case):
    change, status, words = CASES[case]
    folder = tmp_path / "recordings"
    driven = {"frequency_hz": 8.0, "rest_duration_s": 0.5}
    values = plain(structure={"kind": "flat"}, excitation=driven)
    shutil.copytree(recordings, folder)
    change(folder, values)
    (folder / "manifest.yaml").write_text(yaml.safe_dump(values, sort_keys=False))
    done = thesis("measure", folder / "manifest.yaml", "--out", tmp_path / "out")
    said = done.err.strip().splitlines()
    assert done.status == status, done.err
    assert said[-1].startswith("thesis: ")
    assert sum(line.startswith("thesis: ") for line in said) == 1
    assert [word for word in words if word not in said[-1]] == [], said[-1]
    assert done.warned == ()
    assert [path.name for path in tmp_path.glob("out/*") if path.name != ".steps"] == []
    if status == WRONG:
        assert not (tmp_path / "out").exists()
