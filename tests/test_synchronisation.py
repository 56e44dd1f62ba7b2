"""Starts of cameras from their sound: errors against truth, ambiguity, bounds, bad recordings."""

from dataclasses import replace

import numpy as np
import pytest

from thesis_lib.experiment.synchronisation import (
    SynchronisationError,
    coupling_delay,
    cross_correlation_delays,
    delay_deviation,
    normalised_correlation,
    phase_delays,
    synchronise,
    tone_frequency,
    whole_frames,
)

RATE = 48000
FPS = 60
FREQUENCY = 4.25
PERIOD = 1 / FREQUENCY
POWER = 0.125  # of the tone, whose amplitude is 0.5


def tone(t):
    return 0.5 * np.sin(2 * np.pi * FREQUENCY * t + 0.3)


def transient(t):
    """Silence for 1 s, then a tone that grows over two periods, with a burst at its start."""
    t = np.maximum(t - 1, 0)
    growing = np.clip(t / (2 * PERIOD), 0, 1) * np.sin(2 * np.pi * FREQUENCY * t)
    return 0.5 * growing + 0.4 * np.exp(-12 * t) * np.sin(6 * np.pi * FREQUENCY * t)


def growing(t):
    """The same without the burst."""
    t = np.maximum(t - 1, 0)
    return 0.5 * np.clip(t / (2 * PERIOD), 0, 1) * np.sin(2 * np.pi * FREQUENCY * t)


def clap(t):
    """A steady tone, and a clap at 0.6 s."""
    since = np.maximum(t - 0.6, 0)
    return 0.5 * tone(t) + 0.6 * np.exp(-150 * since) * np.sin(2 * np.pi * 700 * since)


def recordings(signal, seed, snr_db=20.0, n=4, seconds=3.0, spread=0.3):
    """Recordings that start within `spread` seconds, and their true delays."""
    rng = np.random.default_rng(seed)
    starts = rng.uniform(0, spread, n)
    t = np.arange(round(seconds * RATE)) / RATE
    noise = np.sqrt(POWER / 10 ** (snr_db / 10)) * rng.standard_normal((n, len(t)))
    return [signal(t + start) + e for start, e in zip(starts, noise, strict=True)], (
        starts - starts[0]
    )


def errors(signal, draws, frequency=None, modulo=None, **options):
    """Errors of the delays in frames over random draws, shape (draws, cameras − 1)."""
    missed = []
    for seed in range(draws):
        signals, truth = recordings(signal, seed, **options)
        found = synchronise(signals, RATE, FPS, frequency)
        error = (found.delays - truth)[1:]
        missed.append(error if modulo is None else error - np.rint(error / modulo) * modulo)
    return FPS * np.array(missed)


# Conventions.


def test_a_camera_that_starts_later_has_a_positive_delay_and_sees_things_earlier():
    t = np.arange(RATE) / RATE
    early, late = (np.exp(-(((t + start - 0.6) / 0.002) ** 2)) for start in (0.0, 0.1))
    assert np.argmax(late) / RATE == pytest.approx(0.5)
    delays = cross_correlation_delays([early, late], RATE)
    np.testing.assert_allclose(delays, [0, 0.1], atol=1e-6)


@pytest.mark.parametrize("reference", [0, 2])
def test_delays_are_those_from_the_reference(reference):
    signals, truth = recordings(transient, 5)
    found = synchronise(signals, RATE, FPS, FREQUENCY, reference=reference)
    np.testing.assert_allclose(found.delays, truth - truth[reference], atol=0.005 / FPS)
    assert found.delays[reference] == 0


def test_sound_that_starts_after_the_picture_is_accounted_for():
    signals, truth = recordings(transient, 6)
    late = np.array([0.0, 0.02, 0.0, 0.05])
    cut = [x[round(s * RATE) :] for x, s in zip(signals, late, strict=True)]
    found = synchronise(cut, RATE, FPS, FREQUENCY, starts=late)
    np.testing.assert_allclose(found.delays, truth, atol=0.005 / FPS)


def test_whole_frames_are_the_thesis_s():
    np.testing.assert_array_equal(whole_frames([0, 0.1, -0.1, 0.009], 60), [0, 6, -6, 1])


# Errors against truth at 20 dB.


def test_a_steady_tone_is_aligned_within_0_005_frame_modulo_its_period():
    assert np.abs(errors(tone, 30, FREQUENCY, PERIOD)).max() < 0.005


@pytest.mark.parametrize("signal", [transient, growing, clap])
@pytest.mark.parametrize("frequency", [None, FREQUENCY])
def test_a_transient_is_aligned_within_0_02_frame_without_doubt(signal, frequency):
    missed = errors(signal, 12, frequency)
    assert np.abs(missed).max() < 0.02
    assert np.abs(missed).max() < 0.005  # what we have, to notice when it is lost


def test_correlation_of_a_tone_is_within_0_02_frame_modulo_its_period():
    assert np.abs(errors(tone, 12, None, PERIOD)).max() < 0.02


def test_starts_0_3_s_apart_in_either_direction_are_found():
    t = np.arange(3 * RATE) / RATE
    signals = [transient(t + start) for start in (0.3, 0.0, 0.6)]
    delays = cross_correlation_delays(signals, RATE)
    np.testing.assert_allclose(delays, [0, -0.3, 0.3], atol=1e-5)


@pytest.mark.parametrize("signal", [transient, clap])
def test_whole_frames_are_within_half_a_frame(signal):
    for seed in range(8):
        signals, truth = recordings(signal, seed)
        found = synchronise(signals, RATE, FPS, FREQUENCY)
        assert np.abs(found.frames - FPS * truth).max() < 0.505


def test_a_known_frequency_may_be_slightly_off():
    signals, truth = recordings(transient, 3)
    found = phase_delays(signals, RATE, FREQUENCY * 1.01, truth)
    np.testing.assert_allclose(found, truth, atol=0.005 / FPS)


def test_phases_only_correct_a_rough_guess():
    signals, truth = recordings(tone, 4)
    guess = truth + np.array([0, 0.3, -0.3, 0.2]) * PERIOD
    np.testing.assert_allclose(
        phase_delays(signals, RATE, FREQUENCY, guess), truth, atol=0.005 / FPS
    )


@pytest.mark.parametrize("rate", [8000, 44100])
def test_other_sample_rates_do_as_well(rate):
    t = np.arange(3 * rate) / rate
    signals = [transient(t + start) for start in (0.1, 0.0837)]
    for frequency in (None, FREQUENCY):
        found = synchronise(signals, rate, FPS, frequency)
        assert found.delays[1] == pytest.approx(-0.0163, abs=0.005 / FPS)


def test_levels_and_offsets_of_the_inputs_do_not_matter():
    signals, truth = recordings(transient, 7)
    changed = [g * x + c for g, c, x in zip((1, 0.2, 0.01, 0.5), (0, 0.1, -0.2, 0), signals,
                                            strict=True)]  # fmt: skip
    found = synchronise(changed, RATE, FPS)
    np.testing.assert_allclose(found.delays, truth, atol=0.005 / FPS)


# Correlation, frequency, scatter.


def test_correlation_is_that_of_the_overlap():
    rng = np.random.default_rng(0)
    a, b = rng.normal(size=50), rng.normal(size=40)
    lags, coefficients = normalised_correlation(a, b, 30)
    for lag, coefficient in zip(lags, coefficients, strict=True):
        j = [k for k in range(40) if 0 <= k + lag < 50]
        expected = np.corrcoef(a[np.array(j) + lag], b[j])[0, 1]
        assert coefficient == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("guess", [4.0, 4.25, 4.5])
def test_the_frequency_of_a_tone_is_found(guess):
    (signal, *_), _ = recordings(tone, 1)
    assert tone_frequency(signal, RATE, guess) == pytest.approx(FREQUENCY, abs=1e-3)


def test_delays_scatter_as_the_cramer_rao_bound_says():
    missed = errors(tone, 80, FREQUENCY, PERIOD, n=3, seconds=2.0, spread=0.05)
    periods = int(1.95 * FREQUENCY - 1)  # the first is left out
    bound = FPS * delay_deviation(FREQUENCY, 100, round(periods * PERIOD * RATE))
    scatter = np.sqrt(np.mean(missed**2))
    assert 0.85 < scatter / bound < 1.2
    assert abs(missed.mean()) < 4 * bound / np.sqrt(missed.size / 2)


@pytest.mark.parametrize("signal", [transient, growing, lambda t: growing(5 - t)])
def test_the_phase_of_a_tone_that_grows_or_fades_errs_by_the_noise_alone(signal):
    """What grows or fades is left out: none of it stays when there is no noise."""
    for snr_db, most in ((20.0, 0.005), (60.0, 1e-4)):
        for seed in range(8):
            signals, truth = recordings(signal, seed, snr_db, seconds=3.5)
            error = FPS * (phase_delays(signals, RATE, FREQUENCY, truth) - truth)
            assert np.abs(error).max() < most


def test_more_noise_scatters_more():
    rms = [np.sqrt(np.mean(errors(tone, 10, FREQUENCY, PERIOD, snr_db=s) ** 2)) for s in (6, 26)]
    assert 6 < rms[0] / rms[1] < 16


# Ambiguity.


def test_a_pure_tone_is_ambiguous_and_says_so():
    for seed in range(10):
        found = synchronise(recordings(tone, seed)[0], RATE, FPS, FREQUENCY)
        assert found.ambiguous
        assert found.period == pytest.approx(PERIOD)
        assert np.abs(found.delays).max() < 0.51 * PERIOD
        assert any("Ambiguous by whole periods of 0.2353 s" in line for line in found.describe())


def test_the_period_in_doubt_is_found_without_a_known_frequency():
    found = synchronise(recordings(tone, 2)[0], RATE, FPS)
    assert found.ambiguous
    assert found.period == pytest.approx(PERIOD, abs=1e-3)


@pytest.mark.parametrize("signal", [transient, growing, clap])
def test_a_transient_resolves_the_ambiguity(signal):
    for seed in range(10):
        found = synchronise(recordings(signal, seed)[0], RATE, FPS, FREQUENCY)
        assert not found.ambiguous
        assert any("Not ambiguous" in line for line in found.describe())


def test_a_faint_transient_is_ambiguous_rather_than_wrong():
    """Whatever is claimed to be certain is right, however little the tone is disturbed."""
    claimed = 0
    for seed, part in enumerate(np.geomspace(0.001, 1, 40)):
        signals, truth = recordings(
            lambda t, part=part: tone(t) + part * (transient(t) - tone(t)), seed, n=2
        )
        found = synchronise(signals, RATE, FPS, FREQUENCY)
        if not found.ambiguous:
            claimed += 1
            np.testing.assert_allclose(found.delays, truth, atol=0.02 / FPS)
    assert claimed > 5


def test_the_report_says_what_sound_cannot_show():
    text = " ".join(synchronise(recordings(transient, 0)[0], RATE, FPS, FREQUENCY).describe())
    for words in ("picture and its sound", "clocks", "AC-coupled", "clap",
                  "a tone of 4.25 Hz is shifted by 0.39 frame of 1/60 s"):  # fmt: skip
        assert words in text
    shift = (np.arctan(3 / FREQUENCY) - np.arctan(2 / FREQUENCY)) / (2 * np.pi * FREQUENCY) * FPS
    assert shift == pytest.approx(0.39, abs=0.005)
    assert FPS * coupling_delay(FREQUENCY) == pytest.approx(shift)


def test_the_report_s_shift_is_that_of_the_frequency_and_frame_rate():
    t = np.arange(3 * RATE) / RATE
    signals = [0.5 * np.sin(2 * np.pi * 10 * (t + start)) for start in (0.0, 0.02)]
    text = synchronise(signals, RATE, 30, 10.0).describe()[-1]
    assert "a tone of 10 Hz is shifted by 0.045 frame of 1/30 s" in text
    quiet = replace(synchronise(signals, RATE, 30), period=None, ambiguous=False).describe()[-1]
    assert "tones are shifted between corners of 2 and 3 Hz" in quiet


# Bad recordings.


def refused(signals, *words, rate=RATE, frequency=None, **options):
    with pytest.raises(SynchronisationError) as error:
        synchronise(signals, rate, FPS, frequency, **options)
    assert "\n" not in str(error.value)
    for word in words:
        assert word in str(error.value)


def test_bad_recordings_are_named():
    good, *_ = recordings(transient, 0)[0]
    names = ["A", "B"]
    refused([good, 0 * good], "B: silent", names=names)
    refused([good, np.clip(3 * good, -1, 1)], "B: clipped", "at most 2 %", names=names)
    refused([good, good[: RATE // 4]], "B: 0.250 s", "at least 0.500 s", names=names)
    refused([good, good[: RATE // 3]], "recording 1: 0.333 s", "0.588 s", frequency=FREQUENCY)
    refused([good, good], "B: sample rate 44100 Hz, allowed: 48000 Hz", rate=[RATE, 44100],
            names=names)  # fmt: skip
    refused([good, np.where(good > 0, np.nan, good)], "B: audio", names=names)
    refused([good, np.stack([good, good])], "B: audio of shape", names=names)
    refused([good], "given 1 recordings, allowed: at least 2")


def test_a_recording_of_something_else_is_named():
    good, *_ = recordings(transient, 0)[0]
    noise = 0.1 * np.random.default_rng(0).standard_normal(len(good))
    refused([good, noise], "recording 1: correlation of", "same sound")


def test_a_tone_that_just_fits_is_not_clipped():
    t = np.arange(3 * RATE) / RATE
    full = [np.sin(2 * np.pi * FREQUENCY * (t + start)) for start in (0, 0.05)]
    assert synchronise(full, RATE, FPS, FREQUENCY).delays[1] == pytest.approx(0.05, abs=1e-5)


def test_a_sound_that_is_no_steady_tone_is_named():
    t = np.arange(4 * RATE) / RATE
    names = ["A", "B"]
    noise = 0.1 * np.random.default_rng(0).standard_normal(len(t))
    refused([noise, noise], "A: 0.", "steady tone of 4.25 Hz, allowed: at least 0.706 s, 3",
            frequency=FREQUENCY, names=names)  # fmt: skip
    short = tone(t) * (t < 3.6 * PERIOD)
    refused([short, short], "A: ", "steady tone", frequency=FREQUENCY, names=names)
    chirp = 0.5 * np.sin(2 * np.pi * (3 * t + 0.5 * t**2))
    refused([chirp, chirp], "A: ", "allowed: at least", frequency=FREQUENCY, names=names)
    hum = tone(t) + 0.4 * np.sin(2 * np.pi * 50 * t)
    refused([tone(t), hum], "B: a tone near 4.25 Hz is 61 % of the sound, allowed: at least 80 %",
            frequency=FREQUENCY, names=names)  # fmt: skip


@pytest.mark.parametrize("given", [4.05, 4.35, 4.46])
def test_another_frequency_than_the_sound_s_is_named(given):
    t = np.arange(6 * RATE) / RATE
    words = f"excitation.frequency_hz: given {given}, but the sound of recording 0 has 4.25 Hz"
    refused([tone(t), tone(t)], words, frequency=given)
    synchronise([tone(t), tone(t)], RATE, FPS, 4.27)


def test_a_small_error_of_the_frequency_is_found_in_a_long_recording():
    t = np.arange(60 * 8000) / 8000
    refused([tone(t), tone(t)], "given 4.26, but", rate=8000, frequency=4.26)
    synchronise([tone(t), tone(t)], 8000, FPS, 4.2505)


@pytest.mark.parametrize("given", [1e5, 6001.0])
def test_a_frequency_too_high_for_the_sound_is_refused_at_once(given):
    good, *_ = recordings(transient, 0)[0]
    refused(
        [good, good],
        f"excitation.frequency_hz: given {given:g}",
        "6000 Hz, 8 samples",
        frequency=given,
    )
    with pytest.raises(SynchronisationError, match="8 samples of the sound per period"):
        phase_delays([good, good], RATE, given, [0, 0])


@pytest.mark.parametrize("snr_db", [0, 10])
def test_noise_beyond_the_tone_s_band_does_not_count(snr_db):
    signals, truth = recordings(growing, 3, snr_db)
    found = synchronise([0.5 * x for x in signals], RATE, FPS, FREQUENCY)
    np.testing.assert_allclose(found.delays, truth, atol=0.05 / FPS)
