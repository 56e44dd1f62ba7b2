"""Films as other cameras and programs write them: turned, covered, slowed down, cut, deep."""

from fractions import Fraction

import cv2
import numpy as np
import pytest
from scenes.sounds import append_sony_rate, copy_tracks, turn_film, write_film

from thesis_lib.measure.recordings.manifest import CameraFiles
from thesis_lib.measure.recordings.media import pack_frames, read_frames
from thesis_lib.measure.recordings.media_info import MediaError, frame_clock, probe_media
from thesis_lib.measure.recordings.validation import clock_of, is_slowed

WIDTH, HEIGHT, COUNT, RATE = 64, 48, 30, 30


def image(k, levels=(40, 220, 150)):
    """A square whose place tells the frame, and a mark that tells turns and mirrors."""
    ground, square, mark = levels
    grey = np.full((HEIGHT, WIDTH), ground, np.uint8)
    at = 2 * k % (WIDTH - 8)
    grey[4:20, at : at + 8] = square
    grey[-6:-2, 2:10] = mark
    return grey


def places(path, rate=RATE):
    """Where the square is in each frame."""
    clock = frame_clock(path)
    np.testing.assert_allclose(clock, np.arange(len(clock)) / rate, atol=1e-6 * RATE / rate)
    rows = [frame[4:20].mean(axis=0) for frame in read_frames(path, clock=clock)]
    return [round(np.flatnonzero(row > 130).mean() - 3.5) for row in rows]


def film(path, fmt="yuv420p", codec="libx264", count=COUNT, make=image, **how):
    frames = [make(k) for k in range(count)]
    return write_film(path, frames=frames, frame_rate=RATE, pictures=codec, pix_fmt=fmt,
                      options={"crf": "10", "g": "12"}, **how)  # fmt: skip


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    return film(tmp_path_factory.mktemp("films") / "plain.mp4")


TURNS = {  # the matrix of the film's track header, and what it makes of a frame
    "left and right": ((-1, 0, 0, 1), lambda x: x[:, ::-1]),
    "clockwise": ((0, 1, -1, 0), lambda x: np.rot90(x, -1)),
    "anticlockwise": ((0, -1, 1, 0), lambda x: np.rot90(x)),
}


@pytest.mark.parametrize(("matrix", "turned"), TURNS.values(), ids=TURNS)
def test_frames_are_turned_and_mirrored_as_they_are_to_be_shown(tmp_path, plain, matrix, turned):
    path = tmp_path / "turned.mp4"
    turn_film(plain, path, matrix)
    wanted = [turned(frame) for frame in read_frames(plain, stop=4)]
    found = list(read_frames(path, stop=4))
    np.testing.assert_array_equal(found, wanted)
    assert probe_media(path).size == wanted[0].shape[::-1]


@pytest.mark.parametrize("marked", [True, False])
def test_a_still_beside_the_film_is_not_the_film(tmp_path, plain, marked):
    """Drones and phones put an image before the film, marked as one or not."""
    still, path = tmp_path / "still.mkv", tmp_path / "covered.mkv"
    film(still, "yuvj420p", "mjpeg", count=1)
    copy_tracks([still, plain], path, still=marked)
    assert len(places(path)) == COUNT
    assert probe_media(path).frame_rate == RATE


@pytest.mark.parametrize(("name", "codec"), [("a.avi", "mpeg4"), ("a.ts", "libx264")])
def test_frames_that_are_stored_in_another_order_are_all_there(tmp_path, name, codec):
    path = film(tmp_path / name, codec=codec)
    assert places(path) == [2 * k % (WIDTH - 8) for k in range(COUNT)]


@pytest.mark.parametrize("share", [0.05, 0.55])
def test_frames_before_the_first_that_can_be_decoded_are_none(tmp_path, share):
    whole = film(tmp_path / "whole.ts", count=60)
    data = whole.read_bytes()
    path = tmp_path / "cut.ts"
    at = int(share * len(data)) // 188 * 188  # a packet of a transport stream
    path.write_bytes(data[: 3 * 188] + data[at:])
    found = places(path)
    assert 10 < len(found) < 60
    assert np.all(np.diff(found) % (WIDTH - 8) == 2)


@pytest.mark.parametrize("depth", [8, 12, 16])
def test_fewer_than_sixteen_bits_in_sixteen_fill_the_grey_levels(tmp_path, depth):
    def make(k):  # the first frames are dark
        return image(k, (10, 20, 15) if k < 20 else (40, 220, 150)).astype(np.uint16) << depth - 8

    path = film(tmp_path / "deep.mkv", "gray16le", "ffv1", make=make)
    wanted = [make(k) >> depth - 8 for k in range(COUNT)]
    assert np.abs(np.array(list(read_frames(path)), int) - wanted).max() <= depth // 16


def test_the_rate_of_the_sensor_is_read_where_a_film_says_it(tmp_path, plain):
    path = tmp_path / "slow.mp4"
    copy_tracks([plain], path, options={"movflags": "use_metadata_tags"},
                metadata={"com.android.capture.fps": "240.000000"})  # fmt: skip
    assert (probe_media(path).frame_rate, probe_media(path).captured_hz) == (RATE, 240)
    append_sony_rate(plain, tmp_path / "sony.mp4", 119.88, 29.97)
    assert probe_media(tmp_path / "sony.mp4").captured_hz == 119.88
    assert probe_media(plain).captured_hz is None


@pytest.mark.parametrize("name", ["slow.mp4", "stream.h264"])
def test_a_film_is_given_its_true_rate(tmp_path, name):
    source, target = film(tmp_path / name), tmp_path / "true.mov"
    before = source.read_bytes()
    assert pack_frames(source, target, 240) == (COUNT, (WIDTH, HEIGHT))
    assert source.read_bytes() == before
    np.testing.assert_allclose(frame_clock(target), np.arange(COUNT) / 240, atol=1e-9)
    assert places(target, 240) == [2 * k % (WIDTH - 8) for k in range(COUNT)]
    with pytest.raises(MediaError, match="the source itself"):
        pack_frames(target, target, 240)
    with pytest.raises(MediaError, match="give --rate-hz"):
        pack_frames(source, target)


@pytest.mark.parametrize(
    ("steps", "plays"),
    [([3, 4, 3, 5, 3, 4, 4, 3, 4], 900 / 33), ([4, 4, 8, 4, 12, 4, 4, 8, 4], 25)],
    ids=["uneven", "dropped"],
)
def test_frames_that_come_unevenly_stay_so_at_another_rate(tmp_path, steps, plays):
    """The rate at which they play is that of all frames, also of those that are dropped."""
    source, times = tmp_path / "uneven.mp4", np.cumsum([0, *steps]) / 100
    stamps = np.rint(1000 * times).astype(int).tolist()
    write_film(source, frames=[image(k) for k in range(10)], frame_rate=1000, pictures="libx264",
               pix_fmt="gray", times=stamps, tick=Fraction(1, 1000))  # fmt: skip
    pack_frames(source, tmp_path / "fast.mov", 20)
    clock = frame_clock(tmp_path / "fast.mov")
    np.testing.assert_allclose(clock, times * plays / 20, atol=2e-5)
    slow = CameraFiles(name="A", video=source.name, captured_hz=20, exposure_s=0.01)
    np.testing.assert_allclose(clock_of(slow, tmp_path), clock, atol=2e-5)
    copy_tracks([source], tmp_path / "true.mp4", options={"movflags": "use_metadata_tags"},
                metadata={"com.android.capture.fps": f"{plays:f}"})  # fmt: skip
    assert not is_slowed(tmp_path / "true.mp4")


def test_a_film_that_cannot_be_copied_is_used_as_it_is(tmp_path):
    source = film(tmp_path / "a.webm", codec="libvpx")
    with pytest.raises(MediaError, match="captured_hz: 20"):
        pack_frames(source, tmp_path / "fast.mov", 20)


def test_pictures_of_twelve_bits_are_packed_in_full(tmp_path):
    folder = tmp_path / "deep"
    folder.mkdir()
    for k in range(5):
        levels = image(k, (10, 20, 15) if k < 2 else (40, 220, 150)).astype(np.uint16) << 4
        cv2.imwrite(str(folder / f"{k}.tif"), levels)
    (folder / "._0.tif").write_bytes(b"macOS")
    pack_frames(folder, tmp_path / "deep.mov", 30)
    frames = list(read_frames(tmp_path / "deep.mov"))
    assert (frames[0].max(), frames[4].min(), frames[4].max()) == (20, 40, 220)
    assert len(frames) == 5
