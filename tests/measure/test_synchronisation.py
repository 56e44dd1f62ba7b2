"""Starts of cameras from their sound: errors against truth, ambiguity, bounds, bad recordings."""

from contextlib import suppress

import numpy as np
import pytest
from refused import line_of
from scenes.sounds import synchronise_sounds
from scipy.signal import resample_poly

from thesis_lib.measure.synchronisation.audio import (
    FILTER_REACH_SAMPLES,
    SynchronisationError,
    decimate_blocks,
    decimate_signal,
)
from thesis_lib.measure.synchronisation.delays import (
    correlation_coefficient,
    force_match,
    room_match,
)
from thesis_lib.measure.synchronisation.listen import whole_frames
from thesis_lib.measure.synchronisation.tones import find_tone, frequency_deviation, settle_interval

RATE = 48000
FPS = 60
FREQUENCY = 4.25
PERIOD = 1 / FREQUENCY
POWER = 0.125  # of the tone, whose amplitude is 0.5


def tone(t):
    return 0.5 * np.sin(2 * np.pi * FREQUENCY * t + 0.3)


def growing(t):
    """Silence for 1 s, then a tone that grows over two periods."""
    t = np.maximum(t - 1, 0)
    return 0.5 * np.clip(t / (2 * PERIOD), 0, 1) * np.sin(2 * np.pi * FREQUENCY * t)


def transient(t):
    """The same with a burst at its start."""
    since = np.maximum(t - 1, 0)
    return growing(t) + 0.4 * np.exp(-12 * since) * np.sin(6 * np.pi * FREQUENCY * since)


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
    signals = [signal(t + start) + e for start, e in zip(starts, noise, strict=True)]
    return signals, starts - starts[0]


def errors(signal, draws, frequency=None, modulo=None, **options):
    """Errors of the delays in frames over random draws, shape (draws, cameras − 1)."""
    missed = []
    for seed in range(draws):
        signals, truth = recordings(signal, seed, **options)
        found = synchronise_sounds(signals, RATE, frequency)
        error = (found.delays - truth)[1:]
        missed.append(error if modulo is None else error - np.rint(error / modulo) * modulo)
    return FPS * np.array(missed)


# Conventions.


def test_a_camera_that_starts_later_has_a_positive_delay_and_sees_things_earlier(conforms):
    t = np.arange(RATE) / RATE
    early, late = (np.exp(-(((t + start - 0.6) / 0.002) ** 2)) for start in (0.0, 0.1))
    conforms.closed_form(np.argmax(late) / RATE, 0.5, rtol=1e-6)
    low, other = (decimate_signal(x, RATE, 4000)[0] for x in (early, late))
    conforms.closed_form(force_match(low, other, 4000, FREQUENCY).delay, 0.1, atol=1e-6)


def test_sound_that_starts_after_the_picture_is_accounted_for(conforms):
    signals, truth = recordings(transient, 6)
    late = np.array([0.0, 0.02, 0.0, 0.05])
    cut = [x[round(s * RATE) :] for x, s in zip(signals, late, strict=True)]
    found = synchronise_sounds(cut, RATE, FREQUENCY, starts=late)
    conforms.closed_form(found.delays, truth, atol=0.005 / FPS)


def test_whole_frames_are_the_thesis_s(conforms):
    conforms.closed_form(whole_frames([0, 0.1, -0.1, 0.009], 60), [0, 6, -6, 1], atol=0)


# Errors against truth at 20 dB.


def test_a_steady_tone_is_aligned_within_0_005_frame_modulo_its_period(conforms):
    conforms.sampled(np.abs(errors(tone, 10, FREQUENCY, PERIOD)).max(), below=0.005)


@pytest.mark.parametrize("signal", [transient, growing, clap])
def test_a_transient_is_aligned_within_0_005_frame_without_doubt(conforms, signal):
    for seed in range(4):
        signals, truth = recordings(signal, seed)
        found = synchronise_sounds(signals, RATE, FREQUENCY)
        conforms.sampled(FPS * np.abs(found.delays - truth).max(), below=0.005)
        off = whole_frames(found.delays, FPS) - FPS * truth
        conforms.closed_form(np.abs(off).max(), below=0.505)
        assert not found.ambiguous
        assert any("Not ambiguous" in line for line in found.describe("ABCD", FPS))


def test_levels_and_offsets_of_the_inputs_do_not_matter(conforms):
    signals, truth = recordings(transient, 7)
    gains, offsets = (1, 0.2, 0.01, 0.5), (0, 0.1, -0.2, 0)
    changed = [g * x + c for g, c, x in zip(gains, offsets, signals, strict=True)]
    found = synchronise_sounds(changed, RATE, FREQUENCY)
    conforms.invariance(found.delays, truth, atol=0.005 / FPS)


# Correlation, frequency, scatter.


@pytest.mark.slow
def test_delays_scatter_as_the_cramer_rao_bound_says(conforms):
    missed = errors(tone, 80, FREQUENCY, PERIOD, n=3, seconds=2.0, spread=0.05)
    periods = int(1.95 * FREQUENCY - 1)  # the first is left out
    # Of a phase the bound is 1 / (SNR · N) (Rife and Boorstyn 1974); a delay has two of them.
    samples = round(periods * PERIOD * RATE)
    bound = FPS * np.sqrt(2 / (100 * samples)) / (2 * np.pi * FREQUENCY)
    scatter = np.sqrt(np.mean(missed**2))
    conforms.sampled(scatter / bound, above=0.85, below=1.2)
    conforms.sampled(abs(missed.mean()), below=4 * bound / np.sqrt(missed.size / 2))


# Ambiguity.


def test_a_pure_tone_is_ambiguous_and_says_so(conforms):
    for seed in range(3):
        found = synchronise_sounds(recordings(tone, seed)[0], RATE, FREQUENCY)
        assert found.ambiguous
        conforms.closed_form(np.abs(found.delays).max(), below=0.51 * PERIOD)
        assert "Ambiguous by whole periods of 0.2353 s" in " ".join(found.describe("ABCD", FPS))


@pytest.mark.slow
def test_a_faint_transient_is_ambiguous_rather_than_wrong(conforms):
    """Whatever is claimed to be certain is right, however little the tone is disturbed."""
    claimed = 0
    for seed, part in enumerate(np.geomspace(0.001, 1, 40)):

        def mixed(t, part=part):
            return (1 - part) * tone(t) + part * transient(t)

        signals, truth = recordings(mixed, seed, n=2)
        found = synchronise_sounds(signals, RATE, FREQUENCY)
        if not found.ambiguous:
            claimed += 1
            conforms.closed_form(found.delays, truth, atol=0.02 / FPS)
    assert claimed > 5


def test_coupling_shifts_a_tone_by_the_phases_of_two_high_passes():
    """First-order corners of 2 and 3 Hz lead by arctan(corner / f)."""
    shift = (np.arctan(3 / FREQUENCY) - np.arctan(2 / FREQUENCY)) / (2 * np.pi * FREQUENCY)
    found = synchronise_sounds(recordings(clap, 0)[0], RATE, FREQUENCY)
    assert f"is shifted by {FPS * shift:.2g} frame" in " ".join(found.describe("ABCD", FPS))


# Bad recordings.


def test_a_small_error_of_the_frequency_is_found_in_a_long_recording():
    given = [tone(np.arange(60 * 8000) / 8000)] * 2, 8000
    line = line_of(SynchronisationError, synchronise_sounds, *given, 4.26)
    assert "given 4.26, but" in line
    synchronise_sounds(*given, 4.2505)


def test_noise_beyond_the_tone_s_band_does_not_count(conforms):
    signals, truth = recordings(growing, 3, 0)
    found = synchronise_sounds([0.5 * x for x in signals], RATE, FREQUENCY)
    conforms.closed_form(found.delays, truth, atol=0.05 / FPS)


# Blocks.


@pytest.mark.parametrize(("step", "length"), [(1, 20000), (3, 20001), (14, 19993)])
def test_a_signal_decimated_in_blocks_is_the_whole_one_decimated(conforms, step, length):
    x = np.random.default_rng(step).standard_normal(length)
    whole = resample_poly(x, 1, step)[FILTER_REACH_SAMPLES:-FILTER_REACH_SAMPLES] if step > 1 else x
    for seed in range(5):
        cuts = np.sort(np.random.default_rng(seed).integers(0, len(x), 12))
        parts = np.split(x, [*cuts, cuts[-1]])  # of any length, one of them empty
        blocks = np.concatenate(list(decimate_blocks(parts, step)))
        conforms.invariance(blocks, whole, atol=1e-12)
    conforms.invariance(decimate_signal(x, 48000, 48000 / step)[0], whole, atol=1e-12)


# A room.


def test_a_correlation_is_within_1_where_an_overlap_holds_nothing():
    """A burst at the end of one and at the start of the other, of 3 s, with silence between."""
    burst, gap = np.random.default_rng(0).standard_normal((2, 3000)), np.zeros(9000)
    one, other = np.concatenate([burst[0], gap]), np.concatenate([gap, burst[1]])
    for a, b in ((one, other), (other, one), (one, one)):
        lags, c = correlation_coefficient(1e3 * a, b, 11_000)
        assert np.abs(c).max() <= 1 + 1e-9
        overlap = [a[max(k, 0) : len(b) + k] for k in lags]
        assert not np.any(c[[not one.any() for one in overlap]])


@pytest.mark.parametrize("delay", [30.0, 72.0, -30.0])
def test_a_short_recording_is_found_anywhere_in_a_long_one(conforms, delay):
    """Of 40 s in one of 120 s; more than half of it apart from the other's start."""
    rate, begin = 500, abs(delay) + 5
    both = []
    for seed, (start, seconds) in enumerate([(0, 120), (abs(delay), 40)]):
        t = start + np.arange(seconds * rate) / rate
        x = np.sin(2 * np.pi * 7.3 * t) * np.clip(np.minimum(t - begin, begin + 15 - t) / 0.3, 0, 1)
        both.append(x + 0.003 * np.random.default_rng(seed).standard_normal(len(t)))
    found = force_match(*both[:: 1 if delay > 0 else -1], rate, 7.3)
    assert found.certain
    conforms.closed_form(found.delay, delay, atol=1e-3)
    noise = 0.02 * np.random.default_rng(2).standard_normal((2, 60_000))
    heard = noise[0], noise[0, 40_000:50_000] + 0.1 * noise[1, :10_000]
    room = room_match(*heard[:: 1 if delay > 0 else -1], 16_000)
    assert room.certain
    conforms.closed_form(room.delay, np.sign(delay) * 2.5, atol=1e-5)


def noise_of(rng, n, colour):
    """Noise whose power falls with the frequency to the power `colour`, rms 1."""
    spectrum = np.fft.rfft(rng.standard_normal(n))
    spectrum /= np.maximum(np.fft.rfftfreq(n, 1 / RATE), 5) ** (colour / 2)
    x = np.fft.irfft(spectrum, n)
    return x / x.std()


def heard(seed, level_db, seconds=11, colour=0, moments=(6.0,)):
    """What two microphones hear of claps of 5 ms, `level_db` above their own noises, rms 0.02."""
    rng = np.random.default_rng(seed)
    starts = rng.uniform(0, 5, 2)
    n, length = round(seconds * RATE), round(0.005 * RATE)
    clap = rng.standard_normal(length) * np.exp(-np.arange(length) / length * 3)
    clap *= 10 ** (level_db / 20) / np.sqrt(np.mean(clap**2))
    f = np.fft.rfftfreq(2 * length)
    signals = []
    for start in starts:
        x = noise_of(rng, n, colour)
        for moment in moments:
            first, between = divmod((moment - start) * RATE, 1)
            late = np.exp(-2j * np.pi * f * between)
            shifted = np.fft.irfft(np.fft.rfft(clap, 2 * length) * late)
            x[int(first) : int(first) + 2 * length] += shifted
        signals.append(0.02 * x)
    return signals, starts - starts[0]


@pytest.mark.slow
@pytest.mark.parametrize(("level_db", "colour", "least"), [(-10, 0, 0), (10, 2, 3), (20, 0, 3)])
def test_a_clap_in_independent_noise_is_found_or_refused(conforms, level_db, colour, least):
    """Starts are up to 5 s apart; at least so many of three recordings must be found."""
    found = 0
    for seed in range(3):
        signals, truth = heard(seed, level_db, colour=colour)
        with suppress(SynchronisationError):
            delays = synchronise_sounds(signals, RATE).delays
            conforms.closed_form(delays, truth, atol=0.005 / FPS)
            found += 1
    assert found >= least


def hum(t):
    return np.sin(2 * np.pi * 50 * t) + 0.4 * np.sin(2 * np.pi * 150 * t + 1)


def test_a_clap_is_found_through_a_louder_hum(conforms):
    signals, truth = heard(2, 20)
    t = np.arange(len(signals[0])) / RATE
    signals = [x + 0.2 * hum(t + d) for x, d in zip(signals, truth, strict=True)]
    delays = synchronise_sounds(signals, RATE).delays
    conforms.closed_form(delays, truth, atol=0.005 / FPS)


# The frequency of a tone that is sought.


@pytest.mark.slow
def test_what_repeats_or_is_not_shared_is_refused_in_a_room():
    rng = np.random.default_rng(0)
    n = 8 * RATE
    t = np.arange(n) / RATE
    rattle = np.zeros(n + RATE)
    knock = rng.standard_normal(300) * np.exp(-np.arange(300) / 80)
    for k in range(0, len(rattle) - 300, round(PERIOD * RATE)):
        rattle[k : k + 300] += knock
    pairs = {
        "noise": [noise_of(rng, n, 0), noise_of(rng, n, 0)],
        "rumble": [noise_of(rng, n, 3), noise_of(rng, n, 3)],
        "hum": [hum(t) + 0.1 * noise_of(rng, n, 1), hum(t + 0.3) + 0.1 * noise_of(rng, n, 1)],
        "rattle": [rattle[s : s + n] + 0.1 * noise_of(rng, n, 0) for s in (0, 20000)],
    }
    for signals in pairs.values():
        given = [0.05 * x for x in signals], RATE
        line = line_of(SynchronisationError, synchronise_sounds, *given)
        assert "recording 1: no sound in it matches" in line


@pytest.mark.parametrize("frequency", [0.7, 212.0])
def test_a_tone_is_found_and_its_error_is_the_noise_s(conforms, frequency):
    """Over draws, the error over its stated deviation scatters by 1."""
    t = np.arange(0, max(8, 8 / frequency), 1 / 2000)
    off = []
    for seed in range(30):
        noise = 0.1 * np.random.default_rng(seed).standard_normal(len(t))
        x = 0.3 * np.sin(2 * np.pi * frequency * t + seed) + noise
        found, seconds = find_tone(x, 2000, "A", (0.0, t[-1]))
        conforms.closed_form(seconds, t[-1], atol=0.05 + 0.4 / frequency)
        low, rate = decimate_signal(x, 2000, 64 * frequency)
        off.append((found - frequency) / frequency_deviation(low, rate, found))
    conforms.sampled(np.sqrt(np.mean(np.square(off))), above=0.7, below=1.35)


@pytest.mark.parametrize("share", [0.06, 0.2, 0.5, 0.9])
def test_a_tone_is_steady_however_short_a_part_it_is(conforms, share):
    rate, begin, end = 64 * 7.3, 5.0, 5.0 + 60 * share
    t = np.arange(0, 60, 1 / rate)
    x = np.sin(2 * np.pi * 7.3 * t) * np.clip(np.minimum(t - begin, end - t) / 0.3, 0, 1)
    found = settle_interval(x + 0.003 * np.random.default_rng(0).standard_normal(len(t)), rate, 7.3)
    conforms.closed_form(found, [begin + 0.3, min(end - 0.3, 60)], atol=0.15)


@pytest.mark.nightly
def test_five_minutes_of_tone_do_not_drown_what_tells_its_periods_apart(conforms):
    """A clap after 200 s; at a low rate, which makes the same noise denser."""
    rate, rng = 8000, np.random.default_rng(1)
    starts, t = rng.uniform(0, 0.3, 2), np.arange(300 * rate) / rate
    spread, signals = np.sqrt(POWER / 100), []
    for start in starts:
        since = np.maximum(t + start - 200, 0)
        clapped = 0.4 * np.exp(-150 * since) * np.sin(2 * np.pi * 700 * since)
        signals.append(tone(t + start) + clapped + spread * rng.standard_normal(len(t)))
    found = synchronise_sounds(signals, rate, FREQUENCY)
    assert not found.ambiguous
    conforms.closed_form(found.delays, starts - starts[0], atol=0.002 / FPS)
