"""Parts of a measurement of one's own recordings: sums, frequencies, models, files, steps."""

from dataclasses import replace

import numpy as np
import pytest
import pyuff
import xarray as xr

from thesis_lib.facts import setups
from thesis_lib.laboratory.recording_files import render_frames
from thesis_lib.laboratory.rig import default_rig
from thesis_lib.measure.exchange import files
from thesis_lib.measure.fitting.frequency import FrequencyError, look_for, phase_advance
from thesis_lib.measure.fitting.harmonics import fit_harmonics, sums_of
from thesis_lib.measure.fitting.result import candidate_modes, scale_model
from thesis_lib.measure.recordings import media
from thesis_lib.measure.recordings.manifest import CameraFiles
from thesis_lib.measure.recordings.manifest_parts import StructureSpec
from thesis_lib.measure.tracking import tracks as recording_module
from thesis_lib.measure.tracking.tracks import Recording, record_track
from thesis_lib.vision.pinhole import Camera
from thesis_lib.vision.simulation import assurance_criterion

IDEAL = Camera("A", np.diag([800.0, 800.0, 1.0]), np.zeros(5), np.eye(3), np.zeros(3), (640, 360))


# Sums.


def test_harmonics_by_parts_are_those_of_the_whole(conforms):
    rng = np.random.default_rng(1)
    times, omega = np.arange(90) / 60, 2 * np.pi * 4.25
    values = 300 + rng.normal(size=(90, 2, 7)) + 3 * np.cos(omega * times)[:, None, None]
    values[rng.random(values.shape) < 0.1] = np.nan
    whole = fit_harmonics(omega, times, values)
    middle = np.nanmean(values, axis=0)
    parts = [sums_of(omega, times[k : k + 13], values[k : k + 13] - middle)
             for k in range(0, 90, 13)]  # fmt: skip
    found = sum(parts[1:], parts[0]).solve().raised(middle)
    conforms.invariance(found.coefficients, whole.coefficients, atol=1e-10)
    conforms.invariance(found.sigma, whole.sigma, rtol=1e-9)
    conforms.invariance(found.covariance, whole.covariance, rtol=1e-9)


# Frequency.


def tracks(folder, frequency, rates=(60.0, 60.0), seconds=4.0, noise=0.03, growth=0.0, size=5.0):
    """Tracks on disk of cameras of their own clocks that see 8 markers move at a frequency."""
    rng, made = np.random.default_rng(3), []
    for k, rate in enumerate(rates):
        delay = 0.137 * k
        t = np.arange(int(seconds * rate)) / rate + delay
        amplitude = size * np.linspace(0.2, 1, 16).reshape(2, 8)
        shape = amplitude * (1 + growth * (t[:, None, None] / seconds - 0.5))
        uv = 200 + shape * np.cos(2 * np.pi * frequency * t + 0.4)[:, None, None]
        path = folder / f"{k}.npy"
        np.save(path, uv + noise * rng.normal(size=uv.shape))
        made.append(Recording(IDEAL, rate, delay, 0.001, 0.0, path))
    return made


@pytest.mark.parametrize("frequency", [1.3, 4.25, 11.7, 27.9])
def test_an_unknown_frequency_is_found(conforms, tmp_path, frequency):
    recordings = tracks(tmp_path, frequency)
    conforms.closed_form(look_for(recordings, 0.2, 4.0), frequency, atol=2e-3)


def test_cameras_of_different_rates_agree_on_a_frequency(conforms, tmp_path):
    recordings = tracks(tmp_path, 7.3, rates=(50.0, 60.0, 120.0))
    conforms.closed_form(look_for(recordings, 0.3, 4.0), 7.3, atol=2e-3)


def test_noise_alone_has_no_frequency(tmp_path):
    with pytest.raises(FrequencyError, match=r"no one frequency .* excitation\.frequency_hz"):
        look_for(tracks(tmp_path, 5.0, size=0.0, noise=0.1), 0.2, 4.0)


def test_a_recording_too_short_for_a_frequency_is_told(tmp_path):
    with pytest.raises(FrequencyError, match="too short"):
        look_for(tracks(tmp_path, 5.0, seconds=0.3), 0.14, 0.2)


@pytest.mark.parametrize("frequency", [4.25, 110.8])  # the second is folded to 9.2 Hz
def test_the_advance_of_the_phase_corrects_a_frequency(conforms, tmp_path, frequency):
    recordings = tracks(tmp_path, frequency, seconds=10.0)
    found = phase_advance(recordings, 0.2, 10.0, frequency + 0.02, 1)
    conforms.sampled(found.frequency, frequency, atol=5 * found.deviation)
    # Cramér and Rao for the frequency of tones of amplitude A in noise σ, summed over the tones.
    power = 2 * sum((5 * np.linspace(0.2, 1, 16)) ** 2)
    bound = np.sqrt(6 * 0.03**2 / (power * 60 * 9.8**3)) / np.pi
    conforms.sampled(found.deviation, above=0.4 * bound, below=3 * bound)
    conforms.sampled(abs(found.frequency - frequency), below=5 * bound)


def test_growth_is_seen(conforms, tmp_path):
    found = phase_advance(tracks(tmp_path, 4.25, seconds=10.0, growth=0.2), 0.2, 10.0, 4.25, 1)
    conforms.closed_form(found.growth, 0.2 * 9.8 / 10, rtol=0.05)


# Models.


@pytest.mark.parametrize("kind", ["beam", "plate"])
def test_a_mode_is_most_similar_to_itself(conforms, kind):
    structure = StructureSpec(kind=kind)
    modes = candidate_modes(structure)
    for mode in modes:
        values = [assurance_criterion(-3e-3 * mode.shape, other.shape) for other in modes]
        assert modes[int(np.argmax(values))].name == mode.name
        conforms.invariance(
            scale_model(-3e-3 * mode.shape, mode.shape), -3e-3 * mode.shape, rtol=1e-7
        )


def test_one_row_on_the_axis_sees_no_torsion():
    structure = StructureSpec(markers={"rows": 1})
    assert all(mode.name.startswith("bending") for mode in candidate_modes(structure))


def test_a_flat_structure_has_no_model():
    assert candidate_modes(StructureSpec(kind="flat")) == []


# Universal file.


def test_the_universal_file_holds_nodes_shape_and_motion(conforms, tmp_path):
    rng = np.random.default_rng(5)
    amplitude = rng.normal(size=6) + 1j * rng.normal(size=6)
    amplitude[2] = np.nan
    places = rng.normal(size=(3, 6))
    data = xr.Dataset(
        {
            "frequency": 4.25,
            "amplitude_real": ("marker", amplitude.real),
            "amplitude_imag": ("marker", amplitude.imag),
            "rest_position": (("axis", "marker"), places),
            "x": ("marker", [0.0, 0.1, 0.2, 0.0, 0.1, 0.2]),
            "y": ("marker", [0.0, 0.0, 0.0, 0.1, 0.1, 0.1]),
        },
        attrs={"title": "a beam"},
    )
    files.write_uff(tmp_path / "shapes.uff", data)
    file = pyuff.UFF(str(tmp_path / "shapes.uff"))
    assert list(file.get_set_types()) == [151, 164, 15, 82, 55] + 5 * [58]
    header, units, nodes, lines, shape, *responses = file.read_sets()
    assert header["model_name"].strip() == "a beam"
    joined = [tuple(part) for part in np.append(lines["nodes"], 0).reshape(-1, 3)[:, :2]]
    assert sorted(joined) == [(1, 2), (1, 4), (2, 3), (2, 5), (3, 6), (4, 5), (5, 6)]
    assert units["length"] == 1
    conforms.closed_form([nodes["x"], nodes["y"], nodes["z"]], places, rtol=1e-5)
    known = [0, 1, 3, 4, 5]
    np.testing.assert_array_equal(shape["node_nums"], np.add(known, 1))
    conforms.closed_form(shape["r3"], amplitude[known], rtol=1e-4)
    conforms.closed_form(shape["freq"], 4.25, rtol=1e-6)
    for k, response in zip(known, responses, strict=True):
        assert response["rsp_node"] == k + 1
        assert response["rsp_dir"] == 3
        spectrum = np.fft.rfft(response["data"]) * 2 / len(response["data"])
        conforms.closed_form(spectrum[1], amplitude[k], rtol=1e-4)


# Steps.


class StopError(Exception):
    """Someone pulls the plug."""


@pytest.mark.slow
@pytest.mark.few(1)
@pytest.mark.parametrize("shares", [(), (0.5, 1)])
def test_tracking_goes_on_where_it_was_stopped(tmp_path, monkeypatch, shares):
    rig = default_rig(setups.thesis_beam(), [(10, 30), (-10, 30)], size=(960, 540))
    rig = replace(rig, duration=0.5, motion=replace(rig.motion, start=0.3, ramp=0.2))
    station = rig.stations[0]
    media.write_video(tmp_path / "A.mkv", render_frames(rig, 0), 60, np.zeros(24000), 48000)
    files = CameraFiles(name="A", video="A.mkv", width_px=960, height_px=540, exposure_s=0.004,
                        board_images="shots")  # fmt: skip
    monkeypatch.setattr(recording_module, "FRAMES_PER_STATE", 7)

    def run(name, key="k", tick=lambda done: None):
        camera, markers, path = station.camera, rig.markers, tmp_path / name
        notes.append(
            record_track(files, tmp_path, clock, camera, markers, 0.445, path, key, tick, shares)
        )
        return np.load(path)

    notes, clock = [], np.arange(30) / 60
    whole = run("whole.npy")
    assert whole.shape == (30, *([4] if shares else []), 2, 75)
    assert np.isfinite(whole).mean() > (0.8 if shares else 0.95)
    done = []

    def stop(frames):
        done.append(frames)
        if sum(done) == 18:
            raise StopError

    with pytest.raises(StopError):
        run("part.npy", tick=stop)
    again = []
    np.testing.assert_array_equal(run("part.npy", tick=again.append), whole)
    assert again[0] == 14  # two times seven frames were kept
    assert sum(again) == 30
    again.clear()
    run("part.npy", tick=again.append)
    assert again == [30]
    again.clear()
    run("part.npy", key="another", tick=again.append)  # of something else: all anew
    assert again[0] == 0
    assert all(told == notes[0] for told in notes)
