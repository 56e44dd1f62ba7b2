"""What a folder's sound tells: the force against truth, and sounds that are refused."""

import numpy as np
import pytest
from refused import line_of

from thesis_lib.measure.recordings.manifest import CameraFiles, Manifest, ManifestError
from thesis_lib.measure.recordings.manifest_parts import Excitation
from thesis_lib.measure.recordings.media import write_video
from thesis_lib.measure.synchronisation import audio as hearing
from thesis_lib.measure.synchronisation.audio import SynchronisationError
from thesis_lib.measure.synchronisation.listen import estimate_delays

RATE = 48000
FREQUENCY = 4.25
FORCE = 0.4 * np.exp(0.7j)


def force(t):
    """At rest for 1 s, then a tone that grows over two periods."""
    growing = np.clip((t - 1) * FREQUENCY / 2, 0, 1)
    return growing * np.real(FORCE * np.exp(2j * np.pi * FREQUENCY * t))


def folder_of(folder, sounds, rate=RATE, **excitation):
    """The manifest of videos with these sounds, whose images are few and small."""
    names = "ABCD"[: len(sounds)]
    for name, sound, own in zip(names, sounds, np.broadcast_to(rate, len(names)), strict=True):
        write_video(folder / f"{name}.mkv", np.zeros((3, 16, 16), np.uint8), 60, sound, int(own))
    cameras = [
        CameraFiles(name=name, video=f"{name}.mkv", exposure_s=0.004, board_images="s")
        for name in names
    ]
    return Manifest(cameras=tuple(cameras), excitation=Excitation(**excitation))


def refusal(manifest, folder, kind=SynchronisationError):
    return line_of(kind, estimate_delays, manifest, folder)


T = np.arange(4 * RATE) / RATE
NOISE = 0.1 * np.random.default_rng(0).standard_normal(len(T))


@pytest.mark.parametrize("rates", [(RATE, 44100), (96000, 8000)])
def test_cameras_of_unlike_sample_rates_are_put_on_one_clock(conforms, tmp_path, rates):
    starts = np.array([0.1, 0.2371])
    sounds = [force(np.arange(4 * rate) / rate + starts[k]) for k, rate in enumerate(rates)]
    found = estimate_delays(folder_of(tmp_path, sounds, rates), tmp_path)
    conforms.closed_form(found["delay"][1], 0.1371, atol=1e-4 / 60)
    turned = FORCE * np.exp(2j * np.pi * FREQUENCY * starts[0])
    conforms.closed_form(abs(complex(*found["force"]) / turned - 1), below=5e-4)
    begin, end = found["steady"]
    assert 0.9 + 2 / FREQUENCY < begin < 0.9 + 3.3 / FREQUENCY
    assert 3.9 < end <= 4


def test_a_frequency_that_cannot_be_filmed_is_refused(tmp_path):
    manifest = folder_of(tmp_path, [hum(T), hum(T)], frequency_hz=None)
    words = "given null, and the sound has 50 Hz, allowed: below half of the frame rate, 30 Hz"
    assert words in refusal(manifest, tmp_path, ManifestError)
    given = manifest.model_copy(update={"excitation": Excitation(frequency_hz=30.0)})
    (tmp_path / "A.mkv").unlink()  # before anything is read
    assert refusal(given, tmp_path, ManifestError).startswith("excitation.frequency_hz: given")


# Frequencies.


def hum(t):
    return 0.3 * np.sin(2 * np.pi * 50 * t) * np.clip(t - 1, 0, 1)


def faint(sounds, level=0.01):
    rng = np.random.default_rng(0)
    return [sound + level * rng.standard_normal(len(sound)) for sound in sounds]


@pytest.mark.parametrize("given", [4.25, None])
def test_the_frequency_is_measured_whether_it_is_given_or_not(conforms, tmp_path, given):
    sounds = faint([force(T + start) for start in (0.1, 0.0, 0.2)])
    found = estimate_delays(folder_of(tmp_path, sounds, frequency_hz=given), tmp_path)
    off = found["of_sound"] - FREQUENCY
    assert 1e-6 < found["of_sound_deviation"] < 1e-3
    conforms.sampled(abs(off), below=3.5 * found["of_sound_deviation"])
    assert found["frequency"] == (given or found["of_sound"])
    delays = found["delay"]
    conforms.closed_form(delays, [0, -0.1, 0.1], atol=2e-3 / 60)
    # By a fitted frequency the force is best known in the middle of its steady part.
    middle = np.mean(found["steady"])
    turned = FORCE * np.exp(2j * np.pi * FREQUENCY * 0.1)
    away = np.exp(2j * np.pi * (found["frequency"] - FREQUENCY) * middle)
    conforms.invariance(abs(complex(*found["force"]) / turned * away - 1), below=1e-3)


@pytest.mark.parametrize(
    ("sounds", "frequency", "words"),
    [([force(T)] * 2, 4.46,
      ["excitation.frequency_hz: given 4.46, but the sound of A has 4.25 Hz"]),
     ([NOISE] * 2, 4.25, ["A: 0.", "steady tone of 4.25 Hz", "0.706 s, 3 periods"]),
     ([force(T) + 0.3 * np.sin(2 * np.pi * 50 * T)] * 2, 4.25,
      ["A: a tone near 4.25 Hz", "80 %"]),
     ([force(T), hum(T) + force(T)], None, ["B: no steady tone", "(that of 4.2", "Hz is 6"]),
     ([force(T), force(1.1 * T)], None, ["B: its tone has 4.675", "that of A 4.25", "the same"])],
    ids=["5 % more", "noise", "hum", "hum of one", "two tones"],
)  # fmt: skip
def test_sounds_that_are_not_one_force_name_the_camera(tmp_path, sounds, frequency, words):
    message = refusal(folder_of(tmp_path, sounds, frequency_hz=frequency), tmp_path)
    for word in words:
        assert word in message


# A steady part that is given.


def test_the_given_steady_part_is_used(conforms, tmp_path):
    """After 3 s the force is half as large, which alone would be taken for the end of the part."""

    def stepped(t):
        return force(t) * np.where(t > 3, 0.5, 1)

    t = np.arange(6 * RATE) / RATE
    sounds = [stepped(t), stepped(t + 0.1)]
    manifest = folder_of(tmp_path, sounds, steady_interval_s=(3.2, 5.8), frequency_hz=None)
    found = estimate_delays(manifest, tmp_path)
    assert found["steady"].values.tolist() == [3.2, 5.8]
    middle = np.exp(2j * np.pi * 4.5 * (found["frequency"] - FREQUENCY))
    conforms.closed_form(abs(complex(*found["force"]) * middle / (FORCE / 2) - 1), below=1e-3)
    conforms.closed_form(found["delay"], [0, 0.1], atol=1e-4 / 60)
    sought = estimate_delays(folder_of(tmp_path, sounds), tmp_path)
    assert sought["steady"][1] < 3
    conforms.closed_form(abs(complex(*sought["force"]) / FORCE - 1), below=1e-3)


def test_a_camera_that_was_long_there_before_the_first_has_the_same_tone(conforms, tmp_path):
    """By its own clock half of the interval is at rest."""
    t = np.arange(-4 * RATE, 10 * RATE) / RATE
    sounds = [force(t[4 * RATE :]), force(t)]
    manifest = folder_of(tmp_path, sounds, steady_interval_s=(2.0, 8.0), frequency_hz=None)
    found = estimate_delays(manifest, tmp_path)
    conforms.closed_form(found["delay"], [0, -4], atol=1e-4 / 60)
    conforms.closed_form(float(found["frequency"]), FREQUENCY, rtol=1e-5)


@pytest.mark.parametrize(
    ("kind", "steady", "limits"),
    [("force", (2.0, 4.2), "from 0.000 to 4.000 s"),
     ("room", (2.0, 3.98), "from 0.100 to 3.950 s")],
)  # fmt: skip
def test_a_steady_part_outside_of_what_all_recorded_is_refused(tmp_path, kind, steady, limits):
    sound = force if kind == "force" else clapping()
    sounds = faint([sound(T), sound(T + 0.1), sound(T[: round(3.85 * RATE)] + 0.1)])
    manifest = folder_of(tmp_path, sounds, sound=kind, steady_interval_s=steady)
    message = refusal(manifest, tmp_path, ManifestError)
    assert message.endswith(f"allowed: within the recordings, {limits}")


# A room.


def clapping(moments=(1.5, 2.1, 2.3), seed=0):
    """Claps at times in s."""
    rng = np.random.default_rng(seed)
    pitches, phases = rng.uniform(300, 4000, 40), rng.uniform(0, 2 * np.pi, 40)

    def sound(t):
        x = np.zeros(len(t))
        for moment in moments:
            near = np.flatnonzero((t >= moment) & (t < moment + 0.02))
            since = t[near] - moment
            tones = np.cos(2 * np.pi * pitches[:, None] * since + phases[:, None] + moment)
            x[near] += 0.02 * np.exp(-since / 0.002) * tones.sum(axis=0)
        return x

    return sound


@pytest.mark.parametrize("frequency", [None, 4.25])
def test_a_room_gives_the_starts_alone(conforms, tmp_path, frequency):
    sound = clapping()
    starts = np.array([0.1, 0.0, 0.37])
    sounds = faint([sound(T + start) for start in starts])
    manifest = folder_of(tmp_path, sounds, sound="room", frequency_hz=frequency)
    found = estimate_delays(manifest, tmp_path)
    conforms.closed_form(found["delay"], starts - starts[0], atol=0.005 / 60)
    assert not found["force"].any()
    np.testing.assert_equal(found["frequency"].item(), frequency or np.nan)
    assert np.isnan(found["of_sound"])
    # C starts last, at 0.27 s of A, and rests for 1 s; B ends first, at 3.9 s.
    conforms.closed_form(found["steady"], (1.27, 3.9), atol=1e-4)


def test_buttons_that_are_pressed_are_not_taken_for_claps(conforms, tmp_path):
    """A louder click at the start and the end of every file, as far from its ends."""
    sound, click = clapping(), 0.5 * np.exp(-np.arange(200) / 40) * np.cos(0.7 * np.arange(200))
    starts = np.array([0.0, 0.3])
    sounds = faint([sound(T + start) for start in starts])
    for x in sounds:
        x[5000:5200] += click
        x[-9000:-8800] += click
    found = estimate_delays(folder_of(tmp_path, sounds, sound="room"), tmp_path)
    conforms.closed_form(found["delay"], starts, atol=0.005 / 60)


def test_rooms_that_tell_too_little_are_refused(tmp_path):
    sound = clapping()
    good = faint([sound(T), sound(T + 0.1)])
    manifest = folder_of(tmp_path, good, sound="room", rest_duration_s=3.95)
    assert "allowed: less than the 3.900 s" in refusal(manifest, tmp_path, ManifestError)
    unlike = faint([sound(T), clapping((1.2, 2.0, 2.9), 1)(T)])
    message = refusal(folder_of(tmp_path, unlike, sound="room"), tmp_path)
    assert message.startswith("B: no sound in it matches that of A beyond doubt; clap")


# Recordings longer than what is correlated at a time.


def low(sound, seconds, starts, rate=8000):
    """What cameras record of a sound, with faint noise."""
    t = np.arange(round(seconds * rate)) / rate
    return faint([sound(t + start) for start in starts], 1e-3)


def test_a_late_event_is_found_in_a_later_span(conforms, tmp_path, monkeypatch):
    sounds = low(lambda t: force(t - 49), 70, (0.0, 2.3, 1.1))  # at rest for 50 s
    manifest = folder_of(tmp_path, sounds, 8000, rest_duration_s=47)
    whole = estimate_delays(manifest, tmp_path)
    monkeypatch.setattr(hearing, "SPAN_SAMPLES", 1 << 16)  # 16 s at 4 kHz
    found = estimate_delays(manifest, tmp_path)
    for one in (whole, found):
        assert not one["ambiguous"]
        conforms.closed_form(one["delay"], [0, 2.3, 1.1], atol=1e-3 / 60)
    conforms.invariance(abs(complex(*found["force"]) / complex(*whole["force"]) - 1), below=1e-3)
    conforms.invariance(found["steady"], whole["steady"], atol=0.1)
