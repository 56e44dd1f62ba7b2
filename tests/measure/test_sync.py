"""``thesis sync``: starts and clocks of made-up recordings of one room, with known truth."""

import json

import cv2
import numpy as np
import pandas as pd
import pytest
from command import thesis
from scenes.sounds import HeldSound, claps, later

from thesis_lib.measure.recordings.manifest import Manifest
from thesis_lib.measure.recordings.media import write_video
from thesis_lib.measure.synchronisation.alone import synchronise_videos
from thesis_lib.measure.synchronisation.drift import estimate_drifts, fit_drift
from thesis_lib.measure.synchronisation.listen import estimate_delays

RATE = 16000
SECONDS = 24


@pytest.fixture(scope="module")
def videos(tmp_path_factory):
    folder, sound = tmp_path_factory.mktemp("room"), claps(0, SECONDS + 4)
    clocks = {"A": (0.5, 0.0), "B": (1.7312, 30e-6), "C": (0.1117, -20e-6)}
    for k, (name, (start, fast)) in enumerate(clocks.items()):
        track = later(sound, start, SECONDS, fast=fast, seed=k)
        pictures = (np.zeros((16, 16), np.uint8) for _ in range(30 * SECONDS))
        write_video(folder / f"{name}.mkv", pictures, 30, track, RATE)
    return [folder / f"{name}.mkv" for name in clocks]


@pytest.mark.slow
def test_starts_and_drifts_are_the_true_ones(conforms, videos, tmp_path):
    (b, c), names = synchronise_videos(videos)
    assert names == ["A", "B", "C"]
    for one in (b, c):
        assert 0 < 1e6 * one.drift_deviation < 1
        assert 0 < one.delay_deviation < 2e-5
    before = {video: video.stat().st_mtime_ns for video in videos}
    done = thesis("sync", *videos, "--out", tmp_path / "sync")
    assert (done.status, done.err) == (0, "")
    table = pd.read_csv(tmp_path / "sync" / "sync.csv")
    conforms.sampled(table["starts_after_s"], [0, 1.2312, -0.3883], atol=1e-5)
    conforms.sampled(table["in_frames"], [0, 36.936, -11.649], atol=1e-3)
    conforms.sampled(table["clock_fast_by_ppm"], [0, 30, -20], atol=1)
    np.testing.assert_allclose(table["starts_after_s"][1:], [b.delay, c.delay], atol=1e-6)
    assert cv2.imread(str(tmp_path / "sync" / "sync.png")).shape[1] > 900
    assert {video: video.stat().st_mtime_ns for video in videos} == before


@pytest.mark.parametrize("rate", [16000, 22050])
def test_a_sound_that_starts_a_minute_late_is_found_at_any_rate(conforms, rate):
    """Of 22,050 samples a second 5 ms are no whole number: after a minute, 140 ms would be off."""
    rng = np.random.default_rng(0)
    loud = np.repeat(np.exp(1.2 * rng.standard_normal(600)), rate // 6)
    sound = 0.02 * np.clip(loud, 0, 10) * rng.standard_normal(len(loud))
    heard = sound, sound[60 * rate : 85 * rate]
    sources = [HeldSound(str(k), None, None, one, rate) for k, one in enumerate(heard)]
    conforms.closed_form(estimate_drifts(sources, {1: None})[1].delay, 60, atol=2e-5)


@pytest.mark.nightly
def test_standard_errors_of_drifts_are_their_scatter(conforms):
    off = []
    for seed in range(30):
        sound = claps(seed)
        one = later(sound, 0.1, 10, seed=seed + 100)
        other = later(sound, 0.4, 10, fast=15e-6, seed=seed + 200)
        found = fit_drift(one, other, RATE, (0.0, 0.0), 0.3)
        off.append([(found.drift - 15e-6) / found.drift_deviation,
                    (found.delay - 0.3) / found.delay_deviation])  # fmt: skip
    conforms.sampled(np.sqrt(np.mean(np.square(off))), 1.0, atol=0.35)


@pytest.mark.slow
def test_a_measurement_hears_the_same_starts_though_clocks_drift(conforms, videos):
    cameras = [
        {"name": v.stem, "video": v.name, "width_px": 16, "height_px": 16, "frame_rate_hz": 30,
         "exposure_s": 0.01, "board_images": "shots"}
        for v in videos
    ]  # fmt: skip
    excitation = {"sound": "room", "frequency_hz": 4.0}
    values = json.dumps({"cameras": cameras, "excitation": excitation})
    manifest = Manifest.model_validate_json(values)
    found = estimate_delays(manifest, videos[0].parent)
    middle = np.array([0.0, 1.2312 - 30e-6 * SECONDS / 2, -0.3883 + 20e-6 * SECONDS / 2])
    conforms.sampled(found["delay"].values, middle, atol=2e-5)
    told, clock = found.attrs["synchronisation"], f"camera {videos[1].stem}'s clock is fast by +"
    assert f"{clock}30." in told or f"{clock}29." in told
    assert "peak of the correlation" not in told  # which windows have replaced


@pytest.mark.slow
def test_names_are_neither_formulas_nor_commands_of_the_screen(videos, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names = ["=cmd|' -C calc'!A0.mkv", "-12:30:05\u202e\nA starts \x1b]0;title\x07.mkv"]
    for name, video in zip(names, videos[:2], strict=True):
        (tmp_path / name).symlink_to(video)
    done = thesis("sync", "--", *names)
    assert (done.status, done.err) == (0, "")
    assert len(done.out.splitlines()) == 2
    assert all(line.isprintable() for line in done.out.splitlines())
    table = pd.read_csv(tmp_path / "sync" / "sync.csv")
    assert table["video"].tolist() == ["'=cmd|' -C calc'!A0", "'" + names[1].removesuffix(".mkv")]
    assert table["starts_after_s"].dtype == float


def test_sounds_that_are_unlike_and_files_that_are_none_are_one_line(videos, tmp_path):
    pictures = np.zeros((30, 16, 16), np.uint8)
    write_video(tmp_path / "D.mkv", pictures, 30, np.zeros(0), RATE)
    write_video(tmp_path / "F.mkv", pictures, 30, later(claps(5), 0.2, 8, seed=9), RATE)
    (tmp_path / "link.mkv").symlink_to(videos[0])
    cases = {
        (videos[0],): (2, "two or more"),
        (videos[0], tmp_path / "link.mkv"): (2, "a video is given twice"),
        (videos[0], tmp_path): (2, "a folder, not a file"),
        (videos[0], tmp_path / "D.mkv"): (1, "D.mkv"),
        (videos[0], tmp_path / "F.mkv"): (1, "F: no sound in it matches that of A"),
    }
    for given, (status, words) in cases.items():
        done = thesis("sync", *given, "--out", tmp_path / "out")
        assert (done.status, done.out) == (status, "")
        assert len(done.err.splitlines()) == 1
        assert words in done.err
        assert not (tmp_path / "out" / "sync.csv").exists()
