"""What a folder's sound tells: the force against truth, memory, and sounds that are refused."""

import time
import tracemalloc

import numpy as np
import pytest

from thesis_lib import setups
from thesis_lib.experiment import laboratory
from thesis_lib.experiment.listening import listen
from thesis_lib.experiment.manifest import CameraFiles, Excitation, Manifest, ManifestError
from thesis_lib.experiment.media import write_video
from thesis_lib.experiment.synchronisation import SynchronisationError

RATE = 48000
FREQUENCY = 4.25
FORCE = 0.4 * np.exp(0.7j)


def force(t):
    """At rest for 1 s, then a tone that grows over two periods."""
    growing = np.clip((t - 1) * FREQUENCY / 2, 0, 1)
    return growing * np.real(FORCE * np.exp(2j * np.pi * FREQUENCY * t))


def folder_of(folder, sounds, rate=RATE, **excitation):
    """The manifest of videos with these sounds, whose pictures are few and small."""
    names = "ABCD"[: len(sounds)]
    for name, sound in zip(names, sounds, strict=True):
        write_video(folder / f"{name}.mkv", np.zeros((3, 16, 16), np.uint8), 60, sound, rate)
    cameras = [
        CameraFiles(name=name, video=f"{name}.mkv", exposure_s=0.004, shots="s") for name in names
    ]
    return Manifest(cameras=tuple(cameras), excitation=Excitation(**excitation))


def refusal(manifest, folder, kind=SynchronisationError):
    with pytest.raises(kind) as error:
        listen(manifest, folder)
    assert "\n" not in str(error.value)
    return str(error.value)


@pytest.mark.parametrize("rate", [8000, 44100, RATE])
def test_delays_and_force_are_the_true_ones(tmp_path, rate):
    t = np.arange(4 * rate) / rate
    starts = np.array([0.1, 0.0, 0.2371])
    found = listen(folder_of(tmp_path, [force(t + start) for start in starts], rate), tmp_path)
    delays = found.synchronisation.delays
    np.testing.assert_allclose(delays, starts - starts[0], atol=1e-4 / 60)
    turned = FORCE * np.exp(2j * np.pi * FREQUENCY * starts[0])  # on A's clock
    assert abs(found.force / turned - 1) < 2e-4
    begin, end = found.steady
    assert 0.9 + 2 / FREQUENCY < begin < 0.9 + 3.3 / FREQUENCY
    assert 3.9 < end <= 4


@pytest.mark.parametrize("noise_db", [0, 20, 120])
def test_the_laboratory_s_sound_is_heard(tmp_path, noise_db):
    directions = [(10, 22), (100, 22), (190, 22)]
    rig = laboratory.default_rig(setups.beam(), directions, audio_noise_db=noise_db, seed=5)
    sounds = [laboratory.sound(rig, index) for index in range(3)]
    found = listen(folder_of(tmp_path, sounds), tmp_path)
    starts = np.array([station.start for station in rig.stations])
    error = 60 * np.abs(found.synchronisation.delays - (starts - starts[0])).max()
    assert error < 0.04 * 10 ** (-noise_db / 20) + 1e-3


def test_long_recordings_take_little_memory_and_time(tmp_path):
    t = np.arange(60 * RATE) / RATE
    manifest = folder_of(tmp_path, [force(t + start) for start in (0, 0.1, 0.2, 0.05)])
    began = time.perf_counter()
    listen(manifest, tmp_path)
    assert time.perf_counter() - began < 3
    tracemalloc.start()
    try:
        listen(manifest, tmp_path)
        assert tracemalloc.get_traced_memory()[1] < 150e6
    finally:
        tracemalloc.stop()


T = np.arange(4 * RATE) / RATE
NOISE = 0.1 * np.random.default_rng(0).standard_normal(len(T))


@pytest.mark.parametrize(
    ("sound", "frequency", "words"),
    [
        (force(T), 4.46, ["excitation.frequency_hz: given 4.46, but the sound of A has 4.25 Hz"]),
        (force(T), 4.05, ["excitation.frequency_hz: given 4.05, but the sound of A has 4.25 Hz"]),
        (NOISE, 4.25, ["A: 0.", "steady tone of 4.25 Hz", "0.706 s, 3 periods"]),
        (force(T)[: 2 * RATE], 4.25, ["A: 0.", "s of steady tone of 4.25 Hz", "3 periods"]),
        (0.4 * np.sin(2 * np.pi * (3 * T + 0.5 * T**2)), 4.25, ["A: ", "allowed: at least"]),
        (force(T) + 0.3 * np.sin(2 * np.pi * 50 * T), 4.25, ["A: a tone near 4.25 Hz", "80 %"]),
    ],
    ids=["5 % more", "5 % less", "noise", "short", "chirp", "hum"],
)  # fmt: skip
def test_a_sound_that_is_not_the_force_names_the_camera(tmp_path, sound, frequency, words):
    manifest = folder_of(tmp_path, [sound, sound], frequency_hz=frequency)
    message = refusal(manifest, tmp_path)
    for word in words:
        assert word in message


def test_another_sample_rate_is_named(tmp_path):
    manifest = folder_of(tmp_path, [force(T), force(T)])
    write_video(tmp_path / "B.mkv", np.zeros((3, 16, 16), np.uint8), 60, force(T), 44100)
    assert "B: sample rate 44100 Hz, allowed: 48000 Hz as A" in refusal(manifest, tmp_path)


@pytest.mark.parametrize("frequency", [None, 1e5, 30.0])
def test_a_frequency_that_cannot_be_filmed_is_refused_before_anything_is_read(tmp_path, frequency):
    manifest = folder_of(tmp_path, [force(T), force(T)], frequency_hz=frequency)
    (tmp_path / "A.mkv").unlink()
    assert refusal(manifest, tmp_path, ManifestError).startswith("excitation.frequency_hz: given")


def test_a_sound_too_coarse_for_the_frequency_is_refused(tmp_path):
    manifest = folder_of(tmp_path, [force(T[:32000])] * 2, 200, frequency_hz=27.0)
    assert "at most 25 Hz, 8 samples of the sound per period" in refusal(manifest, tmp_path)
