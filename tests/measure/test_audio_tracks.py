"""Sound as recorders write it: its pace, its gaps, its tracks and channels; and sounds compared."""

import re
from pathlib import Path

import av
import numpy as np
import pytest
from command import thesis
from scenes.driven import write_wav
from scenes.sounds import claps, click, later, music, write_film

from thesis_lib.measure.recordings.audio import probe_audio, read_audio
from thesis_lib.measure.recordings.media import write_video
from thesis_lib.measure.recordings.media_info import MediaError
from thesis_lib.measure.synchronisation.alone import synchronise_videos
from thesis_lib.measure.synchronisation.audio import SynchronisationError

LOW = 8000
LONG = 0.1 * np.random.default_rng(3).standard_normal(130 * LOW)


def place_of_click(path):
    samples, rate, start = read_audio(path)
    return start + float(np.argmax(np.abs(samples))) / rate


# Pace and gaps.


@pytest.mark.slow
@pytest.mark.parametrize("pace", [-2e-4, 1e-2])
def test_a_pace_of_the_time_stamps_is_no_gap(conforms, tmp_path, pace):
    path = write_film(tmp_path / "a.mp4", [LONG], LOW, frames=2, frame_rate=1,
                      stamps=lambda pts: pts * (1 + pace))  # fmt: skip
    samples, rate, start = read_audio(path)
    conforms.closed_form(rate, LOW / (1 + pace), rtol=2e-7)
    conforms.closed_form(start, 0.0, atol=2e-4 + 0.13 * abs(pace))  # priming of 0.128 s
    assert abs(len(samples) - len(LONG)) < 2048
    stated = f"{rate:.2f} samples a second by its time stamps, 8000 stated"
    assert stated in probe_audio(path).source


@pytest.mark.nightly
def test_time_stamps_that_scatter_have_no_pace_of_their_own(conforms, tmp_path):
    rng = np.random.default_rng(0)
    for pace, error in ((0.0, 0.0), (5e-4, 3e-5)):
        path = write_film(
            tmp_path / "a.mp4", [LONG], LOW, frames=2, frame_rate=1,
            stamps=lambda pts, pace=pace: pts * (1 + pace) + rng.normal(0, 0.004 * LOW),
        )  # fmt: skip
        conforms.sampled(read_audio(path)[1], LOW / (1 + pace), rtol=error)


@pytest.mark.parametrize("jump", [0.021, -0.03])
def test_a_jump_of_the_time_stamps_is_a_gap(tmp_path, jump):
    path = write_film(tmp_path / "a.mp4", [LONG[: 20 * LOW]], LOW, frames=2,
                      stamps=lambda pts: pts * 1.0005 + (pts > 9 * LOW) * jump * LOW)  # fmt: skip
    with pytest.raises(MediaError, match=r"a\.mp4: the audio has a gap at 9\.\d+ s: .* by [+-]0\."):
        read_audio(path)


@pytest.mark.parametrize(
    ("ending", "codec", "container", "atol"),
    [
        ("mp4", "aac", {"movflags": "frag_keyframe+empty_moov"}, 1e-4),
        ("mp4", "aac", {}, 1e-4),
        ("mkv", "libopus", {}, 1.1e-3),
        ("avi", "libmp3lame", {}, 1e-3),
        ("ts", "aac", {}, 1e-3),
    ],
)
def test_the_encoder_s_priming_is_no_gap(conforms, tmp_path, ending, codec, container, atol):
    path = write_film(tmp_path / f"a.{ending}", [click(1.5, 0.5)], codec=codec,
                      pictures="libx264" if ending == "mp4" else "mpeg4",
                      container=container)  # fmt: skip
    conforms.closed_form(place_of_click(path), 0.5, atol=atol)


def test_samples_that_are_no_numbers_are_damage(tmp_path):
    sound = LONG[:LOW].copy()
    sound[4321] = np.nan
    path = write_film(tmp_path / "a.mkv", [sound], LOW, frames=2, codec="pcm_f32le")
    with pytest.raises(MediaError, match=r"a\.mkv: damaged audio after 0\.\d+ s"):
        read_audio(path)


# Tracks and channels.


def test_a_sound_is_clipped_if_all_its_channels_are(tmp_path):
    waves = np.sin(np.arange(LOW) / 50 + np.array([[0.0], [np.pi / 2]]))
    for gains, least in (((2, 2), 0.6), ((2, 0.5), 0.0), ((0.5, 0.5), 0.0)):
        both = np.clip(np.array(gains)[:, None] * waves, -1, 1)
        path = write_film(tmp_path / "a.mkv", [both], LOW, frames=2, codec="pcm_s16le",
                          layout="stereo")  # fmt: skip
        sound = probe_audio(path)
        assert (sound.samples, sound.source) == (LOW, "")
        assert least * LOW <= sound.clipped <= (least + 0.1) * LOW


SOUND, NONE = click(1.0, 0.4), np.zeros(48000)


@pytest.mark.parametrize("damaged", [0, 1])
def test_a_damaged_track_is_passed_over(tmp_path, damaged):
    path = write_film(tmp_path / "a.mov", [LONG[: 2 * LOW]] * 2, LOW)
    whole, _, _ = read_audio(path)
    with av.open(str(path)) as file:
        packet = [one for one in file.demux(file.streams.audio[damaged]) if one.size][8]
        begin, end = packet.pos, packet.pos + packet.size
    data = bytearray(path.read_bytes())
    data[begin:end] = bytes([255]) * (end - begin)
    path.write_bytes(data)
    np.testing.assert_array_equal(read_audio(path)[0], whole)


@pytest.mark.parametrize(
    ("tracks", "layout", "words"),
    [
        ([np.stack([SOUND, SOUND])], "stereo", ""),
        ([np.stack([NONE, SOUND])], "stereo", "channel 2 of 2"),
        ([np.stack([SOUND, -SOUND])], "stereo", "channel 1 of 2"),
        ([np.stack([NONE, NONE, SOUND, NONE, NONE, NONE])], "5.1", "channel 3 of 6"),
        ([NONE, SOUND], "mono", "track 2 of 2"),
    ],
)
def test_the_track_and_channel_that_hold_the_sound_are_used(
    conforms, tmp_path, tracks, layout, words
):
    path = write_film(tmp_path / "a.mkv", tracks, codec="pcm_s16le", layout=layout)
    audio = probe_audio(path)
    assert words in audio.source
    assert words or not audio.source
    samples = np.concatenate(list(audio.blocks()))
    conforms.closed_form(audio.level, samples.std(), rtol=1e-2)
    conforms.closed_form(np.abs(samples).max(), 0.9, atol=1e-3)
    conforms.closed_form(place_of_click(path), 0.4, atol=1e-4)


@pytest.mark.parametrize("count", [7, 8, 10])
def test_every_channel_of_a_recorder_is_read(conforms, tmp_path, count):
    gains = np.arange(1, count + 1) / 100
    write_wav(tmp_path / "a.wav", *(gains[:, None] * np.sin(np.arange(LOW) / 5)), rate=LOW)
    levels = [probe_audio(tmp_path / "a.wav", k).level for k in range(1, count + 1)]
    conforms.closed_form(levels, gains / np.sqrt(2), rtol=1e-2)


def test_a_file_that_was_replaced_is_damaged(tmp_path):
    path = write_film(tmp_path / "a.mkv", [LONG[:LOW]], LOW, codec="pcm_s16le")
    track = probe_audio(path)
    write_video(path, np.zeros((3, 48, 64), np.uint8), 30, None)  # without sound
    with pytest.raises(MediaError, match=r"a\.mkv: damaged audio"):
        list(track.blocks())


def test_a_file_is_named_as_it_was_given(tmp_path, monkeypatch):
    (tmp_path / "a.wav").write_text("no sound")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(MediaError, match=r"^a\.wav: not a video"):
        read_audio(Path("a.wav"))


# Sounds compared.


def sound_file(path, sound, rate=16000, **how):
    codec = {"wav": "pcm_s16le", "flac": "flac", "mp3": "libmp3lame", "m4a": "aac",
             "ogg": "libopus", "mkv": "pcm_s16le"}[path.suffix[1:]]  # fmt: skip
    return write_film(path, [sound], rate, codec=codec, frames=2 * (path.suffix == ".mkv"), **how)


@pytest.mark.parametrize(
    ("scene", "rate", "ending"), [(claps, 44100, "wav"), (music, 48000, "m4a")]
)
def test_sounds_of_any_rate_and_file_are_put_on_one_clock(conforms, tmp_path, scene, rate, ending):
    sound = scene(1)
    one = sound_file(tmp_path / "one.mkv", later(sound, 0.3, 9, seed=1))
    heard = later(sound, 1.5345, 8, fast=2e-5, to_rate=rate, seed=2)
    other = sound_file(tmp_path / f"other.{ending}", -heard, rate)
    (found,), _ = synchronise_videos([one, other])
    conforms.sampled(found.delay, 1.2345, atol=3e-5)
    conforms.sampled(found.fast, 2e-5, atol=4e-6)
    assert 1e-7 < found.delay_deviation < 2e-5


@pytest.mark.parametrize("true", ["samples", "stamps"])
def test_a_pace_of_500_ppm_is_found_whichever_clock_is_right(conforms, tmp_path, true):
    """By the time stamps it is the second camera's clock that is fast, or its samples are slow."""
    sound = claps(4)
    one = sound_file(tmp_path / "one.mkv", later(sound, 0.3, 10, seed=1))
    fast = 0.0 if true == "samples" else -5e-4
    other = write_film(tmp_path / "other.mp4", [later(sound, 1.5345, 9, fast=fast, seed=2)], 16000,
                       stamps=lambda pts: pts * 1.0005)  # fmt: skip
    (found,), _ = synchronise_videos([one, other])
    conforms.sampled(found.delay, 1.2345, atol=1e-4)
    conforms.sampled(found.fast, 5e-4 if true == "samples" else 0.0, atol=1e-5)


HUM = 0.3 * np.sin(2 * np.pi * 50 * np.arange(160000) / 16000 + np.array([[1], [2]]))
UNLIKE = {
    "claps": (claps(1), claps(2)),
    "music of one beat": (music(1), music(2)),
    "one beat alone": (np.tile(claps(3)[:8000], 20), np.tile(claps(3)[:8000], 17)),
    "hum": HUM + 0.01 * np.random.default_rng(0).standard_normal(HUM.shape),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", UNLIKE)
def test_sounds_that_are_unlike_or_repeat_are_refused(tmp_path, name):
    paths = [
        sound_file(tmp_path / f"{k}.wav", sound / (1.1 * np.abs(sound).max()))
        for k, sound in zip("ab", UNLIKE[name], strict=True)
    ]
    with pytest.raises(SynchronisationError, match="no sound in it matches that of a"):
        synchronise_videos(paths)


def test_the_command_takes_sounds_and_says_what_it_used(tmp_path):
    sound = claps(5)
    one = sound_file(tmp_path / "one.wav", later(sound, 0.3, 9, seed=1))
    heard = later(sound, 0.8, 8, seed=2)
    other = write_film(tmp_path / "other.mkv", [np.stack([0 * heard, heard])], 16000,
                       codec="pcm_s16le", layout="stereo")  # fmt: skip
    done = thesis("sync", one, other, "--out", tmp_path / "sync")
    assert (done.status, done.err) == (0, "")
    assert re.match(r"other starts \+0\.(50000|49999)\d+ ± 0\.0{6}\d\d s after one", done.out)
    assert "other's sound: channel 2 of 2" in done.out
