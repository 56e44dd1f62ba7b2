"""Motion over a recorded force, against the exact receptance; and forces that cannot be used."""

import json
import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
import pyuff
import xarray as xr
from scenes.driven import FINE, PLACE, RATES, Driven, random_force, swept_force, write_wav
from scenes.modes import calibration_of, recorded, rig
from scipy.signal import resample_poly
from sdypy import EMA

from thesis_lib.measure.exchange.cameras import read_cameras
from thesis_lib.measure.modes.identify import modal_assurance
from thesis_lib.measure.pipeline import Inputs, measure_motion
from thesis_lib.measure.recordings.force_table import ForceError
from thesis_lib.measure.recordings.manifest import Manifest
from thesis_lib.measure.recordings.manifest_parts import Excitation, Force, ModeSearch, Sweep
from thesis_lib.measure.recordings.media import write_video
from thesis_lib.measure.recordings.media_info import MediaError
from thesis_lib.measure.recordings.validation import check_recordings
from thesis_lib.measure.report import animation
from thesis_lib.measure.report.warnings import check_response
from thesis_lib.measure.response import result, signals
from thesis_lib.measure.tracking.tracks import Recording
from thesis_lib.studies.cubes import complex_of

SILENT = xr.Dataset(attrs={"synchronisation": "by no sound at all"})
SCALE = 2.0  # N at full scale


@dataclass(frozen=True)
class Scene:
    """Tracks of a driven beam, on disk, and what is true of them."""

    folder: Path
    truth: Driven
    recordings: list[Recording]
    manifest: Manifest

    def asked(self, kind="random", modes=None, **force):
        """The manifest with a kind of excitation, and fields of the force."""
        at = tuple(1e3 * x for x in self.truth.place)
        given = {"file": "force.wav", "full_scale_n": SCALE, "offset_s": 0.5, "at_mm": at}
        driven = Excitation(
            kind=kind, rest_duration_s=0.45, sound="room", modes=modes or ModeSearch()
        )
        changed = {"excitation": driven, "force": Force(**given | force)}
        return self.manifest.model_copy(update=changed)

    def responded(self, manifest):
        return result.estimate_response(manifest, self.recordings, self.folder)


def scene(folder, newtons, damping, seconds, noise=0.02, rates=RATES, place=PLACE):
    truth = Driven(newtons, damping, place)
    found, manifest = recorded(folder, rig(), truth, seconds, rates, noise)
    write_wav(folder / "force.wav", newtons / SCALE)
    cameras = zip(manifest.cameras, rates, strict=True)
    own = tuple(c.model_copy(update={"frame_rate_hz": r}) for c, r in cameras)
    beam = manifest.structure.model_copy(update={"damping": damping[0]})
    manifest = manifest.model_copy(update={"cameras": own, "structure": beam})
    return Scene(folder, truth, found, manifest)


@pytest.fixture(scope="module")
def driven(tmp_path_factory):
    """Noise of half a minute: unlike rates, rolling shutters, 3 of 4 cameras' clocks their own."""
    folder = tmp_path_factory.mktemp("driven")
    return scene(folder, random_force(31, 0.05), (0.1, 0.03), 30.0)


@pytest.fixture(scope="module")
def swept(tmp_path_factory):
    """A fast sweep, from rest to rest."""
    folder = tmp_path_factory.mktemp("swept")
    return scene(folder, swept_force(15, 8, 3, 44, 0.05), (0.02, 0.02), 14.0)


@pytest.fixture(scope="module")
def brief(tmp_path_factory):
    """Noise of a few seconds, for forces that cannot be used."""
    return scene(tmp_path_factory.mktemp("brief"), random_force(6, 0.05), (0.1, 0.03), 5.0)


@pytest.fixture(scope="module")
def averaged(driven):
    """What the noise gives by segments of 5 s."""
    return driven.responded(driven.asked(segment_s=5.0))


def off(data, truth, marker):
    """H1 over what is true, less one, and its standard error."""
    true = truth.receptance(data["frequency"].values)[marker]
    error = data["standard_error"].values[0, marker] / np.abs(true)
    return complex_of(data, "receptance")[0, marker] / true - 1, error


# From one clock to another.


@pytest.mark.parametrize("share", [0.05, 0.4])
def test_a_band_is_known_between_uneven_stamps_rows_and_exposures(share):
    rng = np.random.default_rng(0)
    times = (np.arange(900) + rng.uniform(-0.1, 0.1, 900)) / 60
    late, exposure, f = np.array([0.0, 0.005, -0.006]), 1 / 100, 60 * share
    tone = np.sinc(f * exposure) * np.sin(2 * np.pi * f * (times[:, None] + late))
    wanted = np.arange(1.0, 14.0, 1 / 47)
    found = signals.interpolate_band(times, tone, 60.0, wanted, late, exposure)
    true = np.sin(2 * np.pi * f * wanted)[:, None] * np.ones(3)
    np.testing.assert_allclose(found, true, atol=0.015)


def test_missing_samples_are_bridged_and_gaps_are_told():
    times = np.arange(600) / 60
    values = np.sin(2 * np.pi * 5 * times)[:, None] * np.ones(2)
    values[300, 0] = np.nan
    values[100:140, 1] = np.nan
    found = signals.interpolate_band(times, values, 60.0, times)
    np.testing.assert_allclose(found[295:305, 0], np.sin(2 * np.pi * 5 * times[295:305]), atol=0.1)
    assert np.isnan(found[110:130, 1]).all()
    assert np.isfinite(found[:, 0]).all()


@pytest.mark.parametrize("lost", [4, 11])
@pytest.mark.parametrize("late", [0.0, 0.003])
def test_values_beyond_the_last_sample_that_is_there_are_unknown(lost, late):
    times = np.arange(200) / 60
    values = np.cos(2 * np.pi * 5 * (times + late))[:, None] * np.ones(2)
    values[-lost:, 0] = values[:lost, 1] = np.nan
    wanted = times[1:]
    found = signals.interpolate_band(times, values, 60.0, wanted, late)
    there = wanted <= times[-lost - 1] + late + 1e-9, wanted >= times[lost] + late - 1e-9
    np.testing.assert_array_equal(np.isfinite(found), np.stack(there, axis=1))
    true = np.cos(2 * np.pi * 5 * wanted)[:, None] * np.ones(2)
    np.testing.assert_allclose(found, np.where(np.isnan(found), np.nan, true), atol=0.1)


# Spectra.


def drawn(noise_of_force, noise_of_motion, seed, count=400):
    """H1 and H2 of a gain of 3, by white force and noise of so much power, a whole draw."""
    rng = np.random.default_rng(seed)
    cut = result.cut_of(64 * count, 64.0, 1.0)
    force = rng.standard_normal(64 * count)
    moved = 3 * force + 3 * np.sqrt(noise_of_motion) * rng.standard_normal(64 * count)
    heard = force + np.sqrt(noise_of_force) * rng.standard_normal(64 * count)
    found = result.segment_spectra(np.stack([heard, moved], axis=1), cut)
    return result.receptance_of_segments(found[:, :, 0], found[:, :, 1:], cut, np.array([np.nan]))


@pytest.mark.parametrize(("of_force", "of_motion"), [(0.0, 0.3), (0.3, 0.0)])
def test_standard_errors_of_every_estimator_are_what_draws_scatter_by(of_force, of_motion):
    """About what each tends to, which noise in force and motion moves."""
    draws = [drawn(of_force, of_motion, seed, 30) for seed in range(60)]
    receptance = [one["receptance_real"] + 1j * one["receptance_imag"] for one in draws]
    found = np.array(receptance)[:, :, 0, 2:-2]
    told = np.array([one["standard_error"][:, 0, 2:-2] for one in draws])
    h1, h2 = 3 / (1 + of_force), 3 * (1 + of_motion)
    for k, limit in enumerate((h1, h2, np.sqrt(h1 * h2))):
        off = (found[:, k] - limit) / told[:, k]
        z = np.concatenate([off.real, off.imag])
        assert np.sqrt(np.mean(z**2)) == pytest.approx(1, abs=0.12)
        assert np.mean(np.abs(z) < 2) > 0.93


def smoothed(frequency, seconds, values):
    """Spectra as a Hann window shows them on average: over time, times its autocorrelation."""
    n = 2 * len(frequency)
    window = np.hanning(round(seconds * 2 * frequency[-1]) + 1)
    beside = np.correlate(window, window, "full") / np.sum(window**2)
    half, weight = len(window) - 1, np.zeros(n)
    weight[: half + 1], weight[-half:] = beside[half:], beside[:half]
    return np.fft.fft(weight * np.fft.ifft(values))[: n // 2]


def test_the_blur_of_a_resonance_is_told():
    """Half its width is so many lines: to first order, H1 loses 1 / (3 lines²)."""
    narrow, seconds, rate, line = 3.0, 5.0, 100.0, 100
    fine = np.arange(round(rate * 100 * seconds)) / (100 * seconds)
    omega, own, zeta = 2 * np.pi * fine, 2 * np.pi * 12, narrow / (12 * seconds)
    true = 1 / (own**2 - omega**2 + 2j * zeta * own * omega)
    both = np.concatenate([true, [0], true[:0:-1].conj()])
    first, power = smoothed(fine, seconds, both), smoothed(fine, seconds, np.abs(both) ** 2).real
    shown = np.array([first, power / first.conj(), np.sqrt(power) * first / np.abs(first)])
    off = (shown - true)[:, ::line]
    told = result.estimate_blur(first[::line, None])[:, :, 0]
    peak = np.abs(true).max()
    near = np.abs(fine[::line] - 12) < 1
    np.testing.assert_allclose(told[:, near], off[:, near], atol=0.02 * peak)
    at = int(np.argmax(np.abs(true[::line])))
    assert abs(told[0, at]) / peak == pytest.approx(1 / (3 * narrow**2), rel=0.25)
    assert abs(told[1, at]) < 0.2 * abs(told[0, at])


@pytest.mark.parametrize("frequency", [20.0, 20.06])
def test_errors_hold_at_a_resonance_narrower_than_a_line(frequency):
    """Segments of 8 s, and a half-power width of 0.08 Hz."""
    force, rate, own = np.random.default_rng(0).normal(size=60_000), 100.0, 2 * np.pi * frequency
    cut = result.cut_of(len(force), rate, 8.0)
    lines = 2 * np.pi * np.fft.rfftfreq(len(force), 1 / rate), 2 * np.pi * cut.frequency
    whole, true = (1 / (own**2 - line**2 + 0.004j * own * line) for line in lines)
    moved = np.fft.irfft(whole * np.fft.rfft(force))
    F, X = (result.segment_spectra(values[:, None], cut) for values in (force, moved))
    found = result.receptance_of_segments(F[:, :, 0], X, cut, np.zeros(1))
    at = int(np.argmax(np.abs(true)))
    off = found["receptance_real"][:, 0, at] + 1j * found["receptance_imag"][:, 0, at] - true[at]
    assert (np.abs(off) < 1.5 * found["standard_error"][:, 0, at]).all()


# The whole chain.


@pytest.mark.slow
def test_receptance_is_that_of_the_structure_within_its_errors(driven, averaged):
    data = averaged
    f = data["frequency"].values
    assert f[-1] == pytest.approx(0.4 * min(RATES), abs=0.2)
    for marker in (10, 45, 74):
        apart, error = off(data, driven.truth, marker)
        quiet = f > 9  # where segments are long enough for what rings
        scatter = np.sqrt(np.mean(np.abs(apart / error)[quiet] ** 2) / 2)
        assert 0.8 < scatter < 1.2
    assert np.median(error) < 0.05
    mobility = complex_of(data, "mobility")
    expected = 2j * np.pi * f * complex_of(data, "receptance")
    np.testing.assert_allclose(mobility, expected, rtol=1e-12)
    assert int(data["drive"]) in (46, 21, 71)


@pytest.mark.slow
def test_a_sweep_from_rest_to_rest_is_right_however_fast(swept):
    manifest = swept.asked("sweep")
    data = swept.responded(manifest)
    k = int(data["drive"]) - 1
    apart, error = off(data, swept.truth, k)
    f = data["frequency"].values
    top = int(np.argmax(np.abs(swept.truth.receptance(f)[k])))
    assert abs(apart[top]) < 0.01
    inner = (f > 5) & (f < 38)
    assert 0.7 < np.sqrt(np.mean(np.abs(apart / error)[inner] ** 2) / 2) < 1.4
    np.testing.assert_allclose(data["sweep"], [3, 44], atol=1.3)  # it fades in and out
    assert float(data["sweep_duration"]) == pytest.approx(8, rel=0.1)
    codes = {one.code for one in check_response(data, manifest)}
    assert not codes & {"sweep-fast", "still-ringing"}


@pytest.mark.slow
def test_a_sweep_that_is_too_fast_for_its_segments_is_told_with_what_would_do(swept):
    manifest = swept.asked("sweep", segment_s=2.0)
    data = swept.responded(manifest)
    k = int(data["drive"]) - 1
    f = data["frequency"].values
    true = np.abs(swept.truth.receptance(f)[k])
    assert abs(np.max(np.abs(complex_of(data, "receptance")[0, k])) / true.max() - 1) > 0.1
    told = [one for one in check_response(data, manifest) if one.code == "sweep-fast"]
    assert len(told) == 1
    assert "more slowly, or use force.segment_s: whole" in told[0].text
    pattern = r"in ([\d.]+) s stays ([\d.]+) s .* at ([\d.]+) Hz, which takes ([\d.]+) s"
    seconds, stays, hertz, needs = map(float, re.search(pattern, told[0].text).groups())
    low, high = data["sweep"].values
    assert stays == pytest.approx(2 * 0.02 * hertz * seconds / abs(high - low), rel=0.05)
    assert needs == pytest.approx(4 / (2 * np.pi * 0.02 * hertz), rel=0.01)


def test_a_sweep_is_found_in_the_force():
    found = signals.find_sweep(swept_force(14, 10, 20, 5), FINE, Sweep())
    assert found.from_hz == pytest.approx(20, rel=0.1)
    assert found.to_hz == pytest.approx(5, rel=0.2)
    assert found.duration_s == pytest.approx(10, rel=0.1)


# Clocks.


@pytest.mark.nightly
def test_clocks_of_cameras_that_drift_are_put_in_step_by_the_pictures(driven, averaged):
    """As far apart after half a minute as by 30 ppm after five; and a start 4 ms late."""
    middle, fast = float(driven.recordings[0].times.mean()), 3e-4
    wrong = [own.scale_clock(1 + fast * k / 2, middle) for k, own in enumerate(driven.recordings)]
    wrong[3] = replace(wrong[3], delay=wrong[3].delay - 0.004)
    manifest = driven.asked(segment_s=5.0)
    right, data = averaged, replace(driven, recordings=wrong).responded(manifest)
    np.testing.assert_allclose(data["camera_pace"], fast * np.arange(4) / 2, atol=5e-6)
    np.testing.assert_allclose(data["camera_lag"], [0, 0, 0, 0.004], atol=1e-4)
    assert not right["camera_pace"].any()
    assert not right["camera_lag"].any()
    f, whole = (data[name].values for name in ("frequency", "standard_error"))
    apart = (complex_of(data, "receptance") - complex_of(right, "receptance"))[0, [10, 45, 74]]
    apart = np.abs(apart) / whole[0, [10, 45, 74]]
    assert np.all(np.sqrt(np.mean(apart[:, f > 4] ** 2, axis=1)) < 0.5)
    codes = [one.code for one in check_response(data, manifest)]
    assert codes.count("clock-drift") == 3
    assert codes.count("start-by-pictures") == 1


@pytest.mark.slow
def test_the_clock_of_a_sound_card_is_found_by_a_microphone_beside_the_force(tmp_path):
    """Started 1.234 s later, 60 ppm fast, at another sample rate, with a force of its own."""
    rng = np.random.default_rng(0)
    fast, late, rate, card = 6e-5, 1.234, 48000, 44100
    heard = 0.1 * rng.standard_normal(25 * rate)
    frames = (np.zeros((16, 16), np.uint8) for _ in range(250))
    write_video(tmp_path / "A.mkv", frames, 10.0, heard, rate)
    at = (np.arange(20 * card) / card) / (1 + fast) + late
    fine = resample_poly(heard, 4, 1)
    other = np.interp(at, np.arange(len(fine)) / (4 * rate), fine)
    tone = 0.5 * np.sin(2 * np.pi * 7 * at)
    write_wav(tmp_path / "force.wav", tone, other, rate=card)
    manifest = manifest_for(tmp_path, sound_channel=2, offset_s=None)
    found = signals.read_force(manifest, tmp_path, np.zeros(2))
    assert found.delay == pytest.approx(late, abs=2e-5)
    assert found.pace == pytest.approx(1 - fast, abs=3e-6)
    true = SCALE * 0.5 * np.sin(2 * np.pi * 7 * found.times)
    np.testing.assert_allclose(found.newtons, true, atol=2e-3 * SCALE)
    with pytest.raises(ForceError, match=r"channel 1 matches that of camera A .*sound_channel"):
        signals.read_force(manifest_for(tmp_path, offset_s=None), tmp_path, np.zeros(2))


def test_a_sound_track_of_a_camera_has_its_clock(tmp_path):
    tone = 0.5 * np.sin(2 * np.pi * 7 * np.arange(96000) / 48000)
    write_video(tmp_path / "B.mkv", (np.zeros((16, 16), np.uint8) for _ in range(20)), 10.0, tone)
    manifest = manifest_for(tmp_path, file="B.mkv", offset_s=None)
    assert signals.read_force(manifest, tmp_path, np.array([0.0, 0.7])).delay == 0.7


@pytest.mark.parametrize("rate", [150, 10_000])
@pytest.mark.parametrize("at_s", [0.3007, 1.0002])
def test_the_momentum_of_a_tap_in_a_table_is_kept(tmp_path, rate, at_s):
    """2T/π of half a sine; it is picked at 8 times the frame rate, and slow tables are kept."""
    t, length_s = np.arange(2 * rate) / rate, 10 / rate
    tap = np.sin(np.pi * np.clip((t - at_s) / length_s, 0, 1))
    np.savetxt(tmp_path / "tap.csv", np.column_stack([t, tap]), fmt="%.17g", delimiter=",")
    manifest = manifest_for(tmp_path, file="tap.csv", full_scale_n=None)
    found = signals.read_force(manifest, tmp_path, np.zeros(2))
    assert rate > 1000 or np.array_equal([found.times, found.newtons], [t, tap])
    picked = signals.interpolate_band(
        found.times, found.newtons[:, None], found.rate, np.arange(150) / 80
    )
    assert picked.sum() / 80 == pytest.approx(2 * length_s / np.pi, rel=0.02)


def manifest_for(folder, **force):
    given = {"file": "force.wav", "full_scale_n": SCALE, "offset_s": 0.0, "at_mm": [100.0, 15.0]}
    cameras = [
        {"name": name, "video": f"{name}.mkv", "board_images": "x*.png", "exposure_s": 0.01,
         "frame_rate_hz": 10.0} for name in "AB"
    ]  # fmt: skip
    values = {"cameras": cameras, "force": given | force, "excitation": {"kind": "random"}}
    return Manifest.model_validate_json(json.dumps(values))


# What cannot be used.


@pytest.mark.parametrize(
    ("gain", "told"),
    [(0, r"silent, allowed: a force that changes"),
     (40, r"channel 1 is clipped \(\d+ samples .* gain down")],
)  # fmt: skip
def test_a_sound_that_is_no_force_is_refused_in_one_line(tmp_path, gain, told):
    newtons = np.clip(gain * random_force(6, 0.05), -SCALE, SCALE * (1 - 2**-15))
    write_wav(tmp_path / "force.wav", newtons / SCALE)
    with pytest.raises((ForceError, MediaError), match=told) as error:
        signals.read_force(manifest_for(tmp_path), tmp_path, np.zeros(2))
    assert "\n" not in str(error.value)


def test_forces_and_films_that_do_not_fit_are_refused(brief):
    with pytest.raises(ForceError, match=r"from 90.000 to .* allowed: 4 s or more in common"):
        brief.responded(brief.asked(offset_s=90.0))
    rows = np.column_stack([np.arange(0, 6, 0.02), random_force(6)[::40]])
    np.savetxt(brief.folder / "slow.csv", rows, delimiter=",")
    manifest = brief.asked(file="slow.csv", full_scale_n=None)
    with pytest.raises(ForceError, match=r"slow.csv: 50 samples a second, allowed: at least 100"):
        brief.responded(manifest)
    manifest = brief.asked("sweep")
    sweep = Sweep(from_hz=60.0, to_hz=90.0)
    fast = manifest.excitation.model_copy(update={"sweep": sweep})
    with pytest.raises(ForceError, match=r"sweep: given 60 Hz, allowed: below 40 Hz.*faster"):
        brief.responded(manifest.model_copy(update={"excitation": fast}))


@pytest.mark.parametrize(
    ("kind", "begin", "end"), [("random", 1.0, 5.2), ("free_decay", 0.5, 5.47)]
)
def test_the_interval_of_a_decay_does_not_cut_off_what_began_it(brief, kind, begin, end):
    manifest = brief.asked(kind)
    steady = manifest.excitation.model_copy(update={"steady_interval_s": (1.0, 5.2)})
    manifest = manifest.model_copy(update={"excitation": steady})
    data = brief.responded(manifest)
    np.testing.assert_allclose(data["time"][[0, -1]], [begin, end], atol=0.02)
    short = [one for one in check_response(data, manifest) if one.code == "force-short"]
    assert len(short) == (kind == "free_decay")  # of all that was filmed


def test_a_force_is_checked_before_anything_is_calibrated(tmp_path):
    (tmp_path / "force.csv").write_text("i,force\n" + "".join(f"{k},1\n" for k in range(200)))
    manifest = manifest_for(tmp_path, file="force.csv", full_scale_n=None)
    assert "no column is clearly the time, of columns 1 (i), 2 (force)" in force_line(
        manifest, tmp_path
    )
    write_wav(tmp_path / "force.wav", 5e-5 * random_force(6, 0.05))
    assert "silent audio (rms" in force_line(manifest_for(tmp_path), tmp_path)


def force_line(manifest, folder):
    """What is said of the force before anything is measured."""
    (line,) = [one for one in check_recordings(manifest, folder) if one.startswith("force.file")]
    return line


def test_what_a_manifest_may_not_say_of_a_force_is_refused(tmp_path):
    values = manifest_for(tmp_path).model_dump(mode="json") | {"excitation": {"kind": "random"}}
    given = values["force"]
    for force, words in (
        ({"full_scale_n": None}, r"full_scale_n: given null.*above 0, in N"),
        ({"file": "x.csv"}, r"full_scale_n: given 2.0, allowed with a table"),
        ({"at_mm": [700.0, 15.0]}, r"at_mm: given .700.0, 15.0., allowed: null, or"),
    ):
        values["force"] = given | force
        with pytest.raises(ValueError, match=words):
            Manifest.model_validate_json(json.dumps(values))


# Report and files.


def read_curves(folder):
    sets = pyuff.UFF(str(folder / "response.uff")).read_sets()
    return [one for one in sets if one["type"] == 58]


@pytest.mark.nightly
def test_curves_go_to_a_report_and_files(driven, tmp_path):
    of, said = Inputs(SILENT, calibration_of(driven.recordings), driven.recordings), []
    page = measure_motion(driven.asked(), driven.folder, of, tmp_path, said.append)
    assert page.page.count("<figure>") == 3
    assert said[2].startswith("receptance of 75 markers from 2")
    names = [one.name for one in read_cameras(tmp_path).cameras]
    assert names == [own.camera.name for own in driven.recordings]
    data = xr.open_dataset(tmp_path / "response.nc")
    sets = read_curves(tmp_path)
    curves = [one for one in sets if one["func_type"] == 4]
    assert [one["rsp_node"] for one in curves] == list(range(1, 76))
    assert {(one["ref_node"], one["rsp_dir"], one["ref_dir"]) for one in curves} == {(76, 3, 3)}
    assert {one["ordinate_spec_data_type"] for one in curves} == {8}
    np.testing.assert_allclose(curves[45]["data"], complex_of(data, "receptance")[0, 45], rtol=1e-4)
    np.testing.assert_allclose(curves[45]["x"], data["frequency"], rtol=1e-4)
    same = [one["data"] for one in sets if one["func_type"] == 6]
    np.testing.assert_allclose(same[45], data["coherence"][45], rtol=1e-4)


@pytest.fixture(scope="module")
def tapped(tmp_path_factory):
    """A hammer's pulse of 4 ms; the structure rings as long as it is filmed. Truth, results."""
    folder, damping = tmp_path_factory.mktemp("tapped"), (0.02, 0.01)
    t = np.arange(int(6.5 * FINE)) / FINE
    pulse = np.where(t < 0.004, 1.8 * np.sin(np.pi * t / 0.004), 0.0)
    rates = (170.0, 160.0, 169.83, 160.0)
    own = scene(folder, pulse, damping, 5.5, 0.002, rates=rates, place=(0.3, 0.015))
    sound = SILENT.assign(steady=("end", [0.52, 5.5]))
    of, out = Inputs(sound, calibration_of(own.recordings), own.recordings), folder / "out"
    manifest = own.asked("free_decay", ModeSearch(to_hz=60.0, count=2))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(animation, "write_shape", lambda *_: None)  # what takes most of the time
        measure_motion(manifest, folder, of, out, lambda _: None)
    return own.truth, out


@pytest.mark.slow
def test_a_tap_has_modes_and_curves_in_one_report(tapped):
    truth, out = tapped
    text = (out / "report.html").read_text(encoding="utf-8")
    assert "<h2>Motion over force</h2>" in text
    assert "<h2>Modes</h2>" in text
    assert "still-ringing" in text
    data, marker = xr.open_dataset(out / "response.nc"), 24
    decayed = np.exp(-truth.damping[0] * truth.omega[0] * float(data["segment"]))
    missing = data["blur"][0, marker] / np.abs(truth.receptance(data["frequency"].values)[marker])
    near = np.abs(2 * np.pi * data["frequency"] / truth.omega[0] - 1) < 0.03
    np.testing.assert_allclose(missing[near], decayed, rtol=0.1)
    apart, error = off(data, truth, int(data["drive"]) - 1)
    assert 0.9 < np.median(np.abs(apart / error)) < 1.7  # of two normal parts it is 1.2
    assert np.min(error) < 0.01
    modes = xr.open_dataset(out / "modes.nc")
    np.testing.assert_allclose(modes["damping"], truth.damping, rtol=0.05)


@pytest.mark.slow
def test_another_library_finds_the_same_modes_in_the_exported_curves(tapped):
    """Complex poles by LSCF, shapes by LSFD, of the receptances in the universal file."""
    truth, out = tapped
    sets = [one for one in read_curves(out) if one["func_type"] == 4]
    f = sets[0]["x"]
    before = round(f[0] / (f[1] - f[0]))  # lines that it needs from 0 Hz on
    curves = np.pad([one["data"] for one in sets], ((0, 0), (before, 0)))
    lines = np.arange(curves.shape[1]) * (f[-1] - f[0]) / (len(f) - 1)
    model = EMA.Model(curves, lines, lower=3, upper=59, pol_order_high=12, frf_form="receptance")
    model.get_poles(method="lscf", show_progress=False)
    found, zeta = np.array(model.pole_freq[-1]), np.array(model.pole_xi[-1])
    modes = xr.open_dataset(out / "modes.nc")
    own = [int(np.argmin(np.abs(found - hertz))) for hertz in modes["frequency"].values]
    np.testing.assert_allclose(found[own], modes["frequency"], rtol=1e-3)
    np.testing.assert_allclose(zeta[own], modes["damping"], rtol=0.05)
    np.testing.assert_allclose(found[own], truth.omega / (2 * np.pi), rtol=1e-3)
    model.nat_freq, model.nat_xi = found[own], zeta[own]
    model.pole_ind = [[len(model.pole_freq) - 1, k] for k in own]
    model.get_constants()
    shape = modes["amplitude_real"].values + 1j * modes["amplitude_imag"].values
    assert min(modal_assurance([a, b])[0, 1] for a, b in zip(model.A.T, shape, strict=True)) > 0.999


@pytest.mark.nightly
def test_what_a_reader_should_know_is_told(driven, averaged):
    manifest, data = driven.asked(segment_s=5.0), averaged
    blurred = {"blur": 2.5 * data["standard_error"], "standard_error": 3 * data["standard_error"]}
    late = {"phase_deviation": 0 * data["phase_deviation"] + 0.5, "delay_deviation": 0.003}
    changes = {
        "The force covers": {"filmed": ("end", [0.0, 90.0])},
        "The force acts 1[0-9]{2} mm": {"force_place": ("xy", [0.65, 0.015])},
        "The curves rest on 3.0 averages": {"averages": 0 * data["averages"] + 3},
        "Half of the lines of marker 46": {"coherence": 0.5 * data["coherence"]},
        "The clock of the force is known to 3 ms": late,
        "The clock of the force runs 40 ppm fast": {"pace": 4e-5},
        "30% of the power of the force": {"beyond": 0.3},
        "Segments of 5 s": blurred,
    }
    for told, changed in changes.items():
        before, after = (check_response(one, manifest) for one in (data, data.assign(changed)))
        assert not [one for one in before if re.match(told, one.text)]
        assert [one for one in after if re.match(told, one.text)], told
