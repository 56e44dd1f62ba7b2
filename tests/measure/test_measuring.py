"""Parts of a measurement of one's own recordings: sums, frequencies, models, files."""

import numpy as np
import pytest
import pyuff
import xarray as xr

from thesis_lib.measure.exchange import files
from thesis_lib.measure.fitting.frequency import FrequencyError, phase_advance, search_frequency
from thesis_lib.measure.fitting.harmonics import fit_harmonics, fit_parts, noise_near
from thesis_lib.measure.fitting.result import candidate_modes, scale_model
from thesis_lib.measure.recordings.manifest_parts import StructureSpec
from thesis_lib.measure.tracking.tracks import Recording
from thesis_lib.vision.pinhole import Camera
from thesis_lib.vision.simulation import assurance_criterion

IDEAL = Camera("A", np.diag([800.0, 800.0, 1.0]), np.zeros(5), np.eye(3), np.zeros(3), (640, 360))


def test_harmonics_by_parts_are_those_of_the_whole(conforms):
    rng = np.random.default_rng(1)
    times, omega = np.arange(90) / 60, 2 * np.pi * 4.25
    values = 300 + rng.normal(size=(90, 2, 7)) + 3 * np.cos(omega * times)[:, None, None]
    values[rng.random(values.shape) < 0.1] = np.nan
    whole = fit_harmonics(omega, times, values)
    middle = np.nanmean(values, axis=0)
    parts = ((times[k : k + 13], values[k : k + 13] - middle) for k in range(0, 90, 13))
    found = fit_parts(omega, parts).raised(middle)
    conforms.invariance(found.coefficients, whole.coefficients, atol=1e-10)
    conforms.invariance(found.sigma, whole.sigma, rtol=1e-9)
    conforms.invariance(found.covariance, whole.covariance, rtol=1e-9)


def tracks(
    folder, frequency, rates=(60.0, 60.0), seconds=4.0, noise=0.03, growth=0.0, size=5.0, seed=3
):
    """Tracks on disk of cameras of their own clocks that see 8 markers move at a frequency."""
    rng, made = np.random.default_rng(seed), []
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


def test_markers_that_a_codec_repeats_are_no_noise(conforms, tmp_path):
    """Their scatter is rounding, of any power near the frequency."""
    (own,) = tracks(tmp_path, 4.25, rates=(60.0,), noise=0.03)
    moving, frames = np.load(own.path), np.arange(240)
    still = np.full((240, 2, 3), 200.0)
    still[..., 1] += 1e-13 * (frames % 14 < 7)[:, None]  # 4.3 Hz
    still[..., 2] += 1e-12 * np.linspace(0, 1, 240)[:, None]
    powers = []
    for values in (moving, np.concatenate([moving, still], axis=2)):
        np.save(own.path, values)
        omega, (times, uv) = 2 * np.pi * 4.25, own.read_tracks(0.0, 4.0)
        powers.append(noise_near(own, fit_harmonics(omega, times, uv, 2), omega, 0.0, 4.0))
    conforms.invariance(powers[1], powers[0], rtol=1e-9)


@pytest.mark.parametrize(("frequency", "rates"), [(4.25, (60.0, 60.0)), (7.3, (50.0, 60.0, 120.0))])
def test_an_unknown_frequency_is_found(conforms, tmp_path, frequency, rates):
    recordings = tracks(tmp_path, frequency, rates=rates)
    conforms.closed_form(search_frequency(recordings, 0.3, 4.0), frequency, atol=2e-3)


def test_noise_alone_has_no_frequency(tmp_path):
    with pytest.raises(FrequencyError, match=r"no one frequency .* excitation\.frequency_hz"):
        search_frequency(tracks(tmp_path, 5.0, size=0.0, noise=0.1), 0.2, 4.0)
    with pytest.raises(FrequencyError, match="too short"):
        search_frequency(tracks(tmp_path, 5.0, seconds=0.3), 0.14, 0.2)


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


@pytest.mark.parametrize("rates", [(60.0, 60.0), (60.0,)])
def test_intervals_from_few_parts_hold_the_frequency(tmp_path, rates):
    found = [
        phase_advance(tracks(tmp_path, 4.25, rates, 1.2, seed=seed), 0.15, 1.2, 4.25, 2)
        for seed in range(80)
    ]
    off = np.array([abs(one.frequency - 4.25) for one in found])
    assert np.mean(off < [1.96 * one.deviation for one in found]) > 0.85
    assert np.mean(off < [one.margin for one in found]) > 0.97


@pytest.mark.parametrize("kind", ["beam", "plate"])
def test_a_mode_is_most_similar_to_itself(conforms, kind):
    modes = candidate_modes(StructureSpec(kind=kind))
    for mode in modes:
        shape = -3e-3 * mode.shape
        values = [assurance_criterion(shape, other.shape) for other in modes]
        assert modes[int(np.argmax(values))].name == mode.name
        conforms.invariance(scale_model(shape, mode.shape), shape, rtol=1e-7)
    one_row = candidate_modes(StructureSpec(markers={"rows": 1}))  # on the axis, without torsion
    assert all(mode.name.startswith("bending") for mode in one_row)


def test_the_universal_file_joins_neighbours_and_leaves_out_what_is_unknown(conforms, tmp_path):
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
    _, units, nodes, lines, shape, *responses = pyuff.UFF(str(tmp_path / "shapes.uff")).read_sets()
    joined = [tuple(part) for part in np.append(lines["nodes"], 0).reshape(-1, 3)[:, :2]]
    assert sorted(joined) == [(1, 2), (1, 4), (2, 3), (2, 5), (3, 6), (4, 5), (5, 6)]
    assert units["length"] == 1
    conforms.closed_form([nodes["x"], nodes["y"], nodes["z"]], places, rtol=1e-5)
    known = [0, 1, 3, 4, 5]
    assert [response["rsp_node"] - 1 for response in responses] == known
    conforms.closed_form(shape["r3"], amplitude[known], rtol=1e-4)
    spectrum = np.fft.rfft([response["data"] for response in responses])
    period = len(responses[0]["data"])
    conforms.closed_form(spectrum[:, 1] * 2 / period, amplitude[known], rtol=1e-4)
