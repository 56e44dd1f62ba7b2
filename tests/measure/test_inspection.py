"""Frames that repeat the one before are told from a vibration that turns, or that rests."""

import re

import numpy as np
import pytest

from thesis_lib.measure.recordings.media import read_frames, write_video
from thesis_lib.measure.recordings.media_info import MediaError, frame_clock
from thesis_lib.measure.recordings.validation import describe_repeats, find_repeats, note_changes
from thesis_lib.measure.report.warnings import note_pace

KINDS = {  # which frame is stored at k, and what is said
    "as they are": (lambda k: k, ""),
    "25 as 30": (lambda k: k - k // 6 - (k % 6 == 5), "1.% of the frames of camera A"),
    "15 as 60": (lambda k: k - k % 4, "7.% of the frames of camera A"),
    "25 as 60": (lambda k: int(25 * k / 60) * 2, "5.% of the frames of camera A"),
}


def frames(which, noise, count=120):
    """A disc that swings, after a rest; without noise as a strong compression leaves it."""
    y, x = np.mgrid[:96, :128]
    random = np.random.default_rng(0)
    scenes = []
    for k in range(count):
        at = 64 + (20 * np.sin(2 * np.pi * 4.25 * (k - 30) / 60) if k > 30 else 0)
        disc = 40 + 180 / (1 + np.exp(np.hypot(x - at, y - 48) - 30))
        scenes.append((disc + noise * random.standard_normal(x.shape)).astype(np.uint8))
    return [scenes[which(k)] for k in range(count)]


def repeats_in(path, count=120):
    """Frames of a film that repeat the one before, as the tracking finds them."""
    steps, across = np.zeros((2, count))
    for _ in note_changes(read_frames(path, stop=count, clock=frame_clock(path)), steps, across):
        pass
    return find_repeats(steps, across)


@pytest.mark.few(4)
@pytest.mark.slow
@pytest.mark.parametrize("noise", [0, 1.5])
@pytest.mark.parametrize(("which", "said"), KINDS.values(), ids=KINDS)
def test_repeated_frames_are_named(tmp_path, which, said, noise):
    write_video(tmp_path / "A.mkv", frames(which, noise), 60, None, codec="h264", crf=17)
    text = describe_repeats("A", repeats_in(tmp_path / "A.mkv"))
    assert re.match(said, text) if said else text == "", text


@pytest.mark.parametrize("hertz", [7.5, 1])
def test_a_motion_that_turns_between_two_frames_repeats_none(hertz):
    k = np.arange(300)
    x = np.cos(2 * np.pi * hertz * (k + 0.5) / 60)  # frames 0 and −1 are alike, and so on
    steps, across = np.zeros((2, 300))
    steps[1:], across[2:-1] = np.abs(np.diff(x)), np.abs(x[3:] - x[:-3])
    assert len(find_repeats(steps, across)) == 0


def test_what_cannot_be_decoded_is_found(tmp_path):
    path = tmp_path / "A.mkv"
    write_video(path, frames(lambda k: k, 1.5), 60, None)
    assert len(repeats_in(path)) == 0
    with pytest.raises(MediaError, match="ends before frame 120"):
        repeats_in(path, 121)


@pytest.mark.parametrize(("ppm", "code"), [(40, "clock-drift"), (1430, "frames-lost")])
def test_no_clock_is_blamed_for_lost_frames(ppm, code):
    assert note_pace("B", "A", 1e-6 * ppm).code == note_pace("B", "A", -1e-6 * ppm).code == code
    assert f"{ppm:,} ppm" in note_pace("B", "A", 1e-6 * ppm).text
