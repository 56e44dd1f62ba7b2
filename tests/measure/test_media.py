"""Recordings: lossless round trips, grey levels, alignment of sound, and broken files named."""

import sys
from pathlib import Path

import numpy as np
import pytest
from refused import line_of
from scenes.sounds import write_film

from thesis_lib.measure.recordings.audio import read_audio
from thesis_lib.measure.recordings.media import read_frames, read_png, write_png, write_video
from thesis_lib.measure.recordings.media_info import MediaError, frame_clock, probe_media

RATE = 48000
SIZE = (64, 48)


def noise(n=30, size=SIZE, seed=0):
    return np.random.default_rng(seed).integers(0, 256, (n, size[1], size[0]), np.uint8)


def blurred(n=30):
    """Smooth moving images, grey levels from 0 to 255."""
    x, y = np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1]))
    waves = [127.5 + 135 * np.sin(0.1 * x + 0.07 * y + 0.05 * k) for k in range(n)]
    return np.clip(waves, 0, 255).astype(np.uint8)


def sound(seconds=0.5, seed=1):
    """Sound that 16 bits hold exactly."""
    levels = np.random.default_rng(seed).integers(-(2**15), 2**15, round(seconds * RATE))
    return levels / 2**15


@pytest.fixture(scope="module")
def video(tmp_path_factory):
    path = tmp_path_factory.mktemp("media") / "A.mkv"
    write_video(path, noise(), 60, sound())
    return path


def foreign(path, frames, pix_fmt="gray", tracks=(), **how):
    """A video as other programs write it."""
    film = {"frames": frames, "frame_rate": 60, "pictures": "ffv1", "pix_fmt": pix_fmt}
    return write_film(path, tracks, RATE, **film | how, layout="stereo")


@pytest.mark.parametrize("name", ["12:30:05.mkv", "a%03d.mkv", "http:/x.mkv", "-.mkv"])
def test_a_name_is_never_an_address(video, tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    Path(name).parent.mkdir(exist_ok=True)
    Path(name).write_bytes(video.read_bytes())
    assert probe_media(Path(name)) == probe_media(video)
    other = Path(f"concat:{video}")
    other.parent.mkdir(parents=True)
    other.write_text("not a video")
    with pytest.raises(MediaError, match="not a"):
        probe_media(other)


LISTS = {
    "list.mkv": "ffconcat version 1.0\nfile A.mkv\n",
    "list.m3u8": "#EXTM3U\n#EXT-X-TARGETDURATION:1\n#EXTINF:1,\nA.ts\n#EXT-X-ENDLIST\n",
    "list.txt": "words\n" * 99,
    "list.svg": "<svg xmlns='http://www.w3.org/2000/svg' width='9' height='9'></svg>",
}


@pytest.mark.parametrize("name", LISTS)
def test_what_names_other_files_is_no_recording(video, tmp_path, name):
    (tmp_path / "A.mkv").write_bytes(video.read_bytes())
    write_film(tmp_path / "A.ts", frames=noise(), frame_rate=60)
    (tmp_path / name).write_text(LISTS[name])
    with pytest.raises(MediaError):
        probe_media(tmp_path / name)


def cut(path, to, share):
    data = path.read_bytes()
    to.write_bytes(data[: int(share * len(data))])
    return to


# What is written comes back.


def test_lossless_frames_and_sound_come_back_exactly(conforms, video):
    conforms.invariance(np.stack(list(read_frames(video))), noise(), atol=0)
    np.testing.assert_array_equal(np.stack(list(read_frames(video, 7, 12))), noise()[7:12])
    samples, rate, start = read_audio(video)
    assert (rate, start) == (RATE, 0)
    conforms.invariance(samples, sound(), atol=0)
    info = probe_media(video)
    assert (info.size, info.frame_rate, info.frames) == (SIZE, 60, 30)
    assert info.duration == pytest.approx(0.5)


def test_h264_keeps_grey_levels_and_sound_with_its_picture(conforms, tmp_path):
    """A flash in frame 20 and a click at its time, both where they were put."""
    path, frames, audio = tmp_path / "A.mkv", blurred(40), np.zeros(32000)
    frames[20], audio[16000], audio[9000] = 220, 3.0, 0.5  # what is too loud is clipped
    write_video(path, frames, 60, audio, codec="h264")
    back = np.stack(list(read_frames(path))).astype(float)
    conforms.closed_form(np.sqrt(np.mean((back - frames) ** 2)), below=3)
    assert back.min() <= 3
    assert back.max() >= 252
    samples, rate, start = read_audio(path)
    np.testing.assert_array_equal(samples, np.minimum(audio, 1 - 2**-15))
    flash = np.argmin(np.ptp(back, axis=(1, 2)))
    conforms.closed_form(flash / 60, start + np.argmax(samples) / rate, atol=1e-9)


def test_the_same_recording_is_the_same_file(tmp_path):
    files = [tmp_path / f"{k}.mkv" for k in range(2)]
    for file in files:
        write_video(file, blurred(), 60, sound(), codec="h264")
    assert len({file.read_bytes() for file in files}) == 1


@pytest.mark.parametrize("rate", [30000 / 1001, 240])
def test_any_frame_rate_is_kept(conforms, tmp_path, rate):
    write_video(tmp_path / "A.mkv", noise(), rate, sound())
    info = probe_media(tmp_path / "A.mkv")
    conforms.closed_form(info.frame_rate, rate, rtol=1e-6)
    assert info.frames == len(list(read_frames(tmp_path / "A.mkv"))) == 30
    np.testing.assert_allclose(frame_clock(tmp_path / "A.mkv"), np.arange(30) / rate, rtol=2e-5)


# Recordings by others.


@pytest.mark.parametrize(
    ("pix_fmt", "limited"),
    [("yuv420p", False), ("yuv444p", True), ("yuv420p10le", True), ("bgr0", False)],
)
def test_any_range_is_read_as_full(conforms, tmp_path, pix_fmt, limited):
    path = foreign(tmp_path / "A.mkv", blurred(), pix_fmt, limited=limited)
    conforms.closed_form(np.stack(list(read_frames(path))), blurred(), atol=2)


def test_stereo_sound_is_mixed_and_starts_when_it_starts(conforms, tmp_path):
    samples = np.stack([sound(), sound(seed=2)])
    path = foreign(tmp_path / "A.mkv", noise(), tracks=[samples], codec="pcm_s16le", start=4800)
    mono, rate, start = read_audio(path)
    assert (rate, start) == (RATE, 0.1)
    conforms.closed_form(mono, samples.mean(axis=0), atol=2**-15)


# Broken files.


def test_padding_of_aac_is_dropped(conforms, tmp_path):
    tone = 0.5 * np.sin(2 * np.pi * 40 * np.arange(RATE // 2) / RATE)
    stereo = [np.stack([tone, tone])]
    path = foreign(tmp_path / "A.mp4", blurred(), "yuv420p", stereo, pictures="libx264")
    mono, _, start = read_audio(path)
    conforms.closed_form(abs(start), below=1e-3)
    conforms.closed_form(mono[2000:20000], tone[2000:20000], atol=0.02)


def refused(call, *words):
    message = line_of(MediaError, call)
    assert [word for word in words if word not in message] == []
    return message


def everything(path):
    return lambda: (probe_media(path), list(read_frames(path)), read_audio(path))


def test_what_is_missing_or_no_video_is_named(tmp_path, video):
    refused(everything(tmp_path / "none.mkv"), "none.mkv", "no such file")
    refused(everything(tmp_path), "a folder")
    refused(lambda: read_png(tmp_path / "none.png"), "none.png", "no such file")
    for name, content in (("empty.mkv", b""), ("zeros.mp4", bytes(5000))):
        (tmp_path / name).write_bytes(content)
        refused(everything(tmp_path / name), name, "not a video")
    refused(lambda: list(read_frames(video, 0, 31)), "A.mkv", "frame 30", "31")


@pytest.mark.parametrize("codec", ["ffv1", "h264"])
def test_a_truncated_video_names_the_frame(tmp_path, codec):
    write_video(tmp_path / "A.mkv", noise(), 60, sound(), codec=codec)
    path = cut(tmp_path / "A.mkv", tmp_path / "cut.mkv", 0.6)
    taken = []
    message = refused(lambda: taken.extend(read_frames(path)), "cut.mkv", "30 frames")
    assert f"frame {len(taken)}" in message
    assert 10 < len(taken) < 25


def test_damage_inside_names_the_frame(tmp_path):
    path = foreign(tmp_path / "A.mp4", noise(), "yuv420p", pictures="libx264")
    data = bytearray(path.read_bytes())
    data[len(data) // 2 : len(data) // 2 + 2000] = bytes(2000)
    path.write_bytes(data)
    refused(lambda: list(read_frames(path)), "A.mp4", "frame")


@pytest.mark.parametrize(("name", "rate", "unit"), [("A.mkv", 60, 6e-4), ("A.mp4", 960, 1e-9)])
def test_a_dropped_frame_is_named(tmp_path, name, rate, unit):
    times = [*range(12), *range(13, 31)]
    path = foreign(tmp_path / name, noise(), frame_rate=rate, pictures="libx264", times=times)
    refused(lambda: list(read_frames(path)), name, "frame 12 is missing")
    # Its time is known, so that the others can be used, each at its own time stamp.
    clock = frame_clock(path)
    np.testing.assert_allclose(clock, np.array(times) / rate, atol=unit)
    assert len(list(read_frames(path, clock=clock))) == len(times)


def test_a_track_that_is_missing_is_said(tmp_path):
    path = foreign(tmp_path / "A.mkv", noise())
    assert probe_media(path).sound_end is None
    refused(lambda: read_audio(path), "A.mkv", "no audio track")
    path = write_film(tmp_path / "B.mkv", [sound()], RATE, frames=0, codec="pcm_s16le")
    refused(lambda: probe_media(path), "B.mkv", "no video track")
    refused(lambda: list(read_frames(path)), "B.mkv", "no video track")


def test_a_track_of_sound_without_a_decoder_is_none(tmp_path):
    path = write_film(tmp_path / "A.mkv", [sound()], RATE, codec="pcm_s16le")
    assert probe_media(path).has_audio
    path.write_bytes(path.read_bytes().replace(b"A_PCM/INT/LIT", b"A_PCM/INT/XYZ"))
    assert not probe_media(path).has_audio
    refused(lambda: read_audio(path), "A.mkv", "no audio track")


@pytest.mark.parametrize(
    ("frames", "audio", "words"),
    [
        ([], [0.0], "no frames"),
        ([np.zeros((48, 64))], [0.0], "frame 0 is float64"),
        ([*noise(3), np.zeros((48, 32), np.uint8)], [0.0], "frame 3"),
        (noise(3), [np.nan], "audio"),
    ],
)
def test_what_cannot_be_written_leaves_no_file(tmp_path, frames, audio, words):
    refused(lambda: write_video(tmp_path / "A.mkv", frames, 60, audio), "A.mkv", words)
    assert list(tmp_path.iterdir()) == []


# Images.


@pytest.mark.parametrize("share", [0.0, 0.999])
def test_a_truncated_picture_is_refused_and_a_whole_one_comes_back(tmp_path, share):
    write_png(tmp_path / "1.png", noise()[0])
    np.testing.assert_array_equal(read_png(tmp_path / "1.png"), noise()[0])
    path = cut(tmp_path / "1.png", tmp_path / "2.png", share)
    refused(lambda: read_png(path), "2.png", "cut off")


def test_pictures_of_telephones_are_read(tmp_path, monkeypatch):
    heif = pytest.importorskip("pillow_heif", reason="pillow-heif is not installed")
    path, grey = tmp_path / "a.heic", blurred(1)[0]
    heif.encode("RGB", SIZE, np.stack([grey] * 3, axis=2).tobytes(), path, quality=100)
    off = np.abs(read_png(path).astype(int) - grey)
    assert off.max() < 12
    assert off.mean() < 2
    path.write_bytes(path.read_bytes()[:200])
    with pytest.raises(MediaError, match="not a readable image, or cut off"):
        read_png(path)
    monkeypatch.setitem(sys.modules, "pillow_heif", None)
    with pytest.raises(MediaError, match=r"HEIC needs pillow-heif: pip install thesis-lib\[heic\]"):
        read_png(path)
