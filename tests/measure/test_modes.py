"""Several modes in tracks: frequencies, damping, shapes and their errors; and what is refused."""

import re
from dataclasses import replace

import numpy as np
import pytest
import pyuff
import xarray as xr
from scenes.modes import BEAM, Truth, beam_modes, calibration_of, recorded, rest, rig, tracks

from thesis_lib.acoustics.radiation import AIR
from thesis_lib.measure.fitting.frequency import phase_lags
from thesis_lib.measure.fitting.harmonics import Fitted, Harmonics, rest_of
from thesis_lib.measure.modes.identify import (
    ModalError,
    ModeRequest,
    identify_modes,
    modal_assurance,
)
from thesis_lib.measure.modes.poles import block_of, fit_poles
from thesis_lib.measure.modes.shapes import estimate_shapes, without_outliers
from thesis_lib.measure.pipeline import Inputs, measure_modes
from thesis_lib.measure.recordings.manifest_parts import Excitation, ModeSearch, Radiation
from thesis_lib.measure.recordings.validation import ChainError
from thesis_lib.measure.report.warnings import check_modes
from thesis_lib.studies.cubes import complex_of
from thesis_lib.vibration.motion import Component, fold_frequency
from thesis_lib.vision.pinhole import project, projection_matrices

RIG = rig()
REST = rest(RIG)
BAND = (2.0, 130.0)


def similarity(found, truth):
    """MAC of complex shapes."""
    pairs = zip(complex_of(found, "amplitude"), truth_at_zero(found, truth), strict=True)
    return [float(modal_assurance(pair)[0, 1]) for pair in pairs]


def truth_at_zero(found, truth):
    return truth.shape_at(float(found["zero"]))


@pytest.fixture(scope="module")
def decay():
    """Three modes of the beam, by four cameras with unlike rates and rolling shutters."""
    truth = beam_modes()
    return truth, identify_modes(tracks(RIG, truth, lost=0.01), REST, ModeRequest(BAND, 3))[0]


def test_assurance_of_two_modes_is_over_the_markers_known_in_both():
    """Of (1, 1, 1) and (1, 1, ?) it is 1, of (1, 1, 1) and (1, −1, 3) 9/33, whatever a third is."""
    whole, part, other = np.array([[1, 1, 1], [1, 1, np.nan], [1, -1, 3]])
    found = modal_assurance([whole, part, other])
    np.testing.assert_allclose(found, [[1, 1, 9 / 33], [1, 1, 0], [9 / 33, 0, 1]], atol=1e-12)


@pytest.mark.parametrize("noisier", [1, 4])
def test_the_errors_of_phases_are_what_draws_scatter_by(noisier):
    """The normal is seen along both image coordinates, by a first camera that has more noise."""
    turn = np.array([[1, -1, 0], [1, 1, 0], [0, 0, np.sqrt(2)]]) * np.sqrt(0.5)  # 45°
    cameras = [replace(c, R_camera_world=turn @ c.R_camera_world) for c in RIG.cameras]
    P, count = projection_matrices(cameras), REST.points.shape[1]
    images = project(P, REST.points)
    step = 1e-6 * REST.frame.R[2][:, None]  # m along the normal
    slope = (project(P, REST.points + step) - images) / 1e-6
    sigma = np.full_like(images, 0.05)
    sigma[0] *= noisier
    covariance, rng, drawn = np.zeros((3, 3, 2, count)), np.random.default_rng(0), []
    covariance[1, 1] = covariance[2, 2] = 0.02
    for _ in range(200):
        real, imag = sigma * np.sqrt(0.02) * rng.standard_normal((2, *images.shape))
        parts = zip(
            images, real + slope * 0.002 * np.linspace(0.2, 1, count), imag, sigma, strict=True
        )
        own = [Harmonics(np.stack(part), covariance, noise) for *part, noise in parts]
        turns, errors = phase_lags(Fitted(cameras, own, images, REST.frame), 10.0, np.zeros(4))
        drawn.append(turns[1:])
    np.testing.assert_allclose(np.std(drawn, axis=0), errors[1:], rtol=0.15)


@pytest.mark.slow
def test_modes_of_unlike_rates_and_rolling_shutters(decay):
    """The third has nearly four times the slowest camera's rate."""
    truth, found = decay
    np.testing.assert_allclose(found["frequency"], truth.frequency, rtol=1e-3)
    np.testing.assert_allclose(found["damping"], truth.damping, rtol=0.05)
    assert min(similarity(found, truth)) > 0.999
    np.testing.assert_allclose(found["noise"], 0.02, rtol=0.03)


@pytest.mark.slow
def test_markers_taken_for_their_neighbours_are_left_out_and_told():
    """The outer half of two rows change places in a tenth of one camera's frames."""
    truth = beam_modes()
    first, *others = tracks(RIG, truth)
    wrong, rows = first.uv.copy(), first.rows.copy()
    here, there = np.arange(15, 25), np.arange(40, 50)
    for k in range(0, len(wrong), 10):
        wrong[k][:, here], wrong[k][:, there] = first.uv[k][:, there], first.uv[k][:, here]
        rows[k][here], rows[k][there] = first.rows[k][there], first.rows[k][here]
    found, _ = identify_modes(
        [replace(first, uv=wrong, rows=rows), *others], REST, ModeRequest(BAND, 3)
    )
    np.testing.assert_allclose(found["left_out"], [0.1 * 20 / 75, 0, 0, 0], atol=2e-3)
    np.testing.assert_allclose(found["damping"], truth.damping, rtol=0.05)
    assert min(similarity(found, truth)) > 0.999


@pytest.mark.parametrize(("count", "off_px"), [(60, 3.0), (60, 1.0), (300, 5.0)])
def test_outliers_and_no_other_centres_are_left_out(count, off_px):
    truth, rng = beam_modes(), np.random.default_rng(0)
    track, omega = tracks(RIG, truth)[0], 2 * np.pi * truth.frequency
    stray = rng.permutation(track.uv[:, 0].size).reshape(len(track.uv), -1) < count
    uv = track.uv + off_px * stray[:, None] * rng.choice([-1, 1], track.uv.shape)
    block = block_of(track.times, uv.reshape(len(uv), -1), np.full(uv[0].size, 0.02))
    rates = np.stack([truth.damping * omega, omega * np.sqrt(1 - truth.damping**2)], axis=1)
    found = without_outliers(replace(track, uv=uv), block, rates, REST.places)
    np.testing.assert_array_equal(np.isnan(found.uv), np.stack([stray, stray], axis=1))


def test_a_camera_that_sees_a_marker_only_after_rest_measures_it_as_well():
    one, hidden = beam_modes(damping=(0.01,), amplitude=(2e-3,)), REST.images.copy()
    hidden[1, :, 40:45] = np.nan
    seen = tracks(RIG, one, seconds=1)
    blocks = [block_of(t.times, t.uv.reshape(len(t.uv), -1), np.ones(150)) for t in seen]
    poles = fit_poles(blocks, np.array([[-one.poles[0].real, one.poles[0].imag]]), damped=True)
    part, whole = (
        estimate_shapes(seen, blocks, poles, still)[0][0].amplitude
        for still in (replace(REST, images=hidden), REST)
    )
    np.testing.assert_allclose(part, whole, rtol=0, atol=1e-9)  # m


# What missing centres, and all else, do to standard errors.

UNLIKE = (59.94, 50.0, 60.0)  # frames per second


def decaying(*zeta):
    """One mode or more at the markers of three cameras, at 11.2, 20.4 and 23.7 Hz."""
    form = beam_modes().shape[: len(zeta)]
    return Truth(np.array([11.2, 20.4, 23.7])[: len(zeta)], np.array(zeta), form)


def with_losses(clean, seed, share, fastest=False):
    """Tracks with noise of 0.03 px that lack a share of centres: any, or the fastest."""
    rng, made = np.random.default_rng(seed), []
    for track in clean:
        speed = np.linalg.norm(np.gradient(track.uv, track.times, axis=0), axis=1)
        lost = rng.random(speed.shape) < share
        if fastest:
            lost = speed > np.quantile(speed, 1 - share)
        uv = track.uv + 0.03 * rng.standard_normal(track.uv.shape)
        made.append(replace(track, uv=np.where(lost[:, None], np.nan, uv)))
    return made


def standardised(truth, draws, share, fastest=False):
    """Errors over their standard errors: frequency, damping, scale (draws, modes), and shapes."""
    own, still = rig(3), rest(rig(3))
    asked, found = ModeRequest((2.0, 30.0), len(truth.frequency)), []
    for seed in range(draws):
        if seed % 10 == 0:  # cameras start at other times
            clean = tracks(own, truth, 4.0, UNLIKE, noise=0.0, seed=seed)
        one, _ = identify_modes(with_losses(clean, seed, share, fastest), still, asked)
        true = truth_at_zero(one, truth)
        off = complex_of(one, "amplitude") - true
        scatter = one["error_of_scatter"].values
        power = np.nansum(np.abs(true) ** 2, axis=1)
        scale = np.nansum(off * true.conj(), axis=1) / power
        alone = np.sqrt(np.nansum(np.abs(true * scatter) ** 2, axis=1)) / power
        free = (off - scale[:, None] * true) / scatter
        found.append((
            (one["frequency"] - truth.frequency) / one["frequency_deviation"],
            (one["damping"] - truth.damping) / one["damping_deviation"],
            scale.real / np.hypot(one["scale_deviation"], alone),
            np.stack([free.real, free.imag]),
        ))  # fmt: skip
    return [np.array(each) for each in zip(*found, strict=True)]


def rms(values):
    return float(np.sqrt(np.nanmean(np.square(values))))


@pytest.mark.slow
def test_standard_errors_hold_where_centres_are_missing():
    """With dampings that no start has; a gap that is filled pulls both rates by 5 and more."""
    *rates, shapes = standardised(decaying(0.01), 5, share=0.1, fastest=True)
    assert 0.6 < rms(rates) < 1.5
    assert 0.9 < rms(shapes) < 1.1


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("share", "fastest"), [(0.0, False), (0.02, False), (0.1, False), (0.1, True)]
)
@pytest.mark.parametrize("zeta", [(0.003,), (0.006, 0.009, 0.003)], ids=str)
def test_standard_errors_are_what_many_draws_scatter_by(zeta, share, fastest):
    """All cases have the same draws: enough of them to tell these limits from chance."""
    draws = 100 if len(zeta) > 1 else 150
    *rates, shapes = standardised(decaying(*zeta), draws, share, fastest)
    for values in rates:
        assert 0.8 < rms(values) < 1.2
        assert np.mean(np.abs(values) < 2) >= 0.92
        assert abs(values.mean()) < 0.25
    assert 0.9 < rms(shapes) < 1.1


def test_a_decay_that_is_over_errs_in_scale_by_half_of_what_it_does_in_damping():
    """e^{−αt} fitted to e^{−(α + δ)t}, ∞ long: its size is off by δ / 2α, and ζ by δ / α."""
    own = rig(3)
    seen = tracks(own, decaying(0.05), 4.0, UNLIKE)
    found, _ = identify_modes(seen, rest(own), ModeRequest((2.0, 30.0), 1))
    expected = found["damping_deviation"] / (2 * found["damping"])
    np.testing.assert_allclose(found["scale_deviation"], expected, rtol=0.06)


@pytest.mark.nightly
def test_starts_that_are_off_are_found_beyond_a_period():
    truth = beam_modes()
    late = (0.0, 0.012, -0.003, 0.0)
    found, _ = identify_modes(tracks(RIG, truth, off=late), REST, ModeRequest(BAND, 3))
    np.testing.assert_allclose(-found["lag"], late, atol=1e-4)
    assert min(similarity(found, truth)) > 0.999


@pytest.mark.slow
def test_cameras_out_of_step_tell_an_alias():
    """110.8 Hz shows at 9.2 Hz in all of them."""
    truth = beam_modes()
    found, _ = identify_modes(tracks(RIG, truth, rates=(60.0,) * 4), REST, ModeRequest(BAND, 3))
    np.testing.assert_allclose(found["frequency"], truth.frequency, rtol=1e-3)
    alias = fold_frequency(float(found["rival"][2]), 60.0)
    assert alias == pytest.approx(120 - truth.frequency[2], rel=1e-2)
    assert found["rival_out_of_step"][2] > 5 * found["out_of_step"][2]


def test_modes_that_are_given_are_not_taken_for_their_aliases():
    """To two cameras whose starts are off, an alias of a given mode may seem more in step."""
    own, truth = rig(2), beam_modes((0.01, 0.006), (2e-3, 1e-3j))
    seen = tracks(own, truth, 1.5, (60.0, 60.0), off=(0.0, 0.012))
    asked = ModeRequest(BAND, given=tuple(truth.frequency))
    found, _ = identify_modes(seen, rest(own), asked)
    np.testing.assert_allclose(found["frequency"], truth.frequency, rtol=2e-3)


@pytest.mark.slow
def test_steady_tones_at_unlike_clocks():
    """Two tones, each with a shape of two modes; a clock that runs 40 ppm fast is found."""
    points = RIG.markers.centres
    one, two = (Component("bending", n).shape(BEAM, points) for n in (1, 2))
    mixed = np.array([2e-3 * one + 3e-4j * two, 5e-4 * two - 1e-4j * one])
    truth = Truth(np.array([7.3, 43.1]), np.zeros(2), mixed)
    seen = tracks(RIG, truth, seconds=12)
    fast = [replace(seen[0]), replace(seen[1], times=seen[1].times * (1 + 4e-5)), *seen[2:]]
    found, _ = identify_modes(fast, REST, ModeRequest((2.0, 60.0), damped=False))
    np.testing.assert_allclose(found["frequency"], truth.frequency, rtol=1e-5)
    assert np.all(found["damping"] == 0)
    assert min(similarity(found, truth)) > 0.9999
    np.testing.assert_allclose(found["pace"], [0, 4e-5, 0, 0], atol=2e-6)


@pytest.mark.slow
def test_modes_that_are_not_asked_for_by_number_stand_out(decay):
    truth, _ = decay
    found, _ = identify_modes(tracks(RIG, truth, seconds=3), REST, ModeRequest(BAND))
    assert len(found["frequency"]) == 3
    assert found["after"].max() < 6 < 100 < found["before"].max()


def test_curvature_of_images_is_no_mode():
    """A large motion alone: its double frequency, which rows and perspective add, is left out."""
    truth = beam_modes(damping=(0.005,), amplitude=(6e-3,))
    found, _ = identify_modes(tracks(RIG, truth, noise=0.005), REST, ModeRequest((2.0, 30.0), 1))
    assert found["after"].max() < 6
    assert float(found["noise"]) == pytest.approx(0.005, rel=0.05)


@pytest.mark.parametrize(
    ("truth", "change", "asked", "told"),
    [
        (beam_modes(amplitude=(0, 0, 0)), list, ModeRequest(BAND, 2),
         r"no mode from 2 to 130 Hz stands out.*tap or drive"),
        (beam_modes(), list, ModeRequest(BAND, given=(10.0, 10.1)),
         r"0.1 Hz apart, and 1.\d+ s .* film 10 s or more"),
        (beam_modes(),
         lambda seen: [replace(own, times=own.times[:20], uv=own.uv[:20], rows=own.rows[:20])
                       for own in seen],
         ModeRequest(BAND),
         "8 modes need 36: ask for fewer modes, or film longer"),
    ],
)  # fmt: skip
def test_tracks_that_do_not_tell_what_is_asked_are_refused(truth, change, asked, told):
    with pytest.raises(ModalError, match=told):
        identify_modes(change(tracks(RIG, truth, seconds=2)), REST, asked)


def test_a_neighbour_that_is_too_near_leaves_power_beside_its_mode():
    form = beam_modes(damping=(0.0, 0.0), amplitude=(1e-3, 1e-3)).shape
    pair = Truth(np.array([20.0, 20.3]), np.zeros(2), form)
    found, _ = identify_modes(
        tracks(RIG, pair, seconds=2), REST, ModeRequest(BAND, 1, damped=False)
    )
    assert found["beside"][0] > 30


def test_errors_hold_what_a_mode_that_is_not_fitted_does():
    """The further mode is found when it is tried, and what that changes counts as error."""
    one = beam_modes(damping=(0.0,), amplitude=(1e-3,)).shape[0]
    both = Truth(np.array([20.0, 20.8]), np.zeros(2), np.array([one, 0.1 * one]))
    first = Truth(both.frequency[:1], both.damping[:1], both.shape[:1])
    alone, pair = (
        identify_modes(tracks(RIG, truth, seconds=3), REST, ModeRequest(BAND, 1, damped=False))[0]
        for truth in (first, both)
    )
    off = np.abs(pair["frequency"][0] - 20.0)
    assert off > 5 * alone["frequency_deviation"][0]  # by noise alone it could not be
    assert off < 3 * pair["frequency_deviation"][0]


@pytest.mark.parametrize(
    ("change", "told"),
    [(lambda rows: rows[..., ::-1], "wrong way round"),
     (lambda rows: rows * [[1], [np.nan], [np.nan]], "25 of 75 markers .* are on one line")],
)  # fmt: skip
def test_markers_that_do_not_tell_the_sides_are_refused(tmp_path, change, told):
    recordings, manifest = recorded(tmp_path, RIG, TWO_MODES, seconds=0.1)
    for own in recordings:
        uv = np.array(own.centres)
        np.save(own.path, change(uv.reshape(*uv.shape[:2], 3, -1)).reshape(uv.shape))
    with pytest.raises(ChainError, match=told):
        rest_of(manifest, recordings, 0.45)


def test_what_a_manifest_may_not_ask_is_refused():
    with pytest.raises(ValueError, match="allowed where kind is free_decay: null"):
        Excitation(kind="free_decay", frequency_hz=5.0)
    with pytest.raises(ValueError, match=r"sound: given .* allowed for several modes"):
        Excitation(kind="multisine", sound="none")


def known(calibration):
    """The same calibration with errors that are told: of places, and of focal lengths."""
    n = calibration.sizes["camera"]
    sigma = np.r_[np.tile([1e-4] * 3 + [2e-4] * 3, n), np.tile([1, 1, 2, 2, 0, 0, 0, 0], n)]
    return calibration.assign(covariance=(("unknown", "other"), np.diag(sigma**2)))


TWO_MODES = beam_modes(damping=(0.01, 0.006), amplitude=(2e-3, 1e-3j))


def measured(folder, told):
    """A measurement of two modes and their sound, from tracks on disk as the command leaves them.

    The manifest, the report, what was said, and the folder with the files.
    """
    recordings, manifest = recorded(folder, RIG, TWO_MODES)
    manifest = manifest.model_copy(update={"radiation": Radiation(points_mm=((0, 0, 800),))})
    sound = xr.Dataset({"steady": ("end", [0.5, 3.4])}, attrs={"synchronisation": "none"})
    calibration, said, out = calibration_of(recordings), [], folder / "out"
    inputs = Inputs(sound, known(calibration) if told else calibration, recordings)
    page = measure_modes(manifest, inputs, out, said.append).page
    return manifest, page, said, out


@pytest.fixture(scope="module")
def by_unknown(tmp_path_factory):
    """By a calibration whose errors are unknown."""
    return measured(tmp_path_factory.mktemp("unknown"), told=False)


@pytest.mark.slow
def test_motion_beside_modes_has_the_corrected_starts(conforms, tmp_path):
    """The sound says of the second camera that it starts 8 ms later than it does."""
    truth = beam_modes((0.01,), (2e-3,))
    recordings, manifest = recorded(tmp_path, RIG, truth, rates=(60.0, 50.0, 59.94, 60.0))
    recordings[1] = replace(recordings[1], delay=recordings[1].delay + 0.008)
    asked = {"modes": ModeSearch(to_hz=12.0, count=1)}
    driven = manifest.excitation.model_copy(update=asked)
    sound = xr.Dataset({"steady": ("end", [0.5, 3.4])}, attrs={"synchronisation": "none"})
    inputs = Inputs(sound, calibration_of(recordings), recordings)
    one = manifest.model_copy(update={"excitation": driven})
    measure_modes(one, inputs, tmp_path / "out", lambda line: None)
    moved = xr.load_dataset(tmp_path / "out" / "motion.nc").sel(time=slice(0.7, 3.0), axis="z")
    off = moved["displacement"] - 1e3 * truth.at((moved["time"].values - 0.5)[:, None])
    ratio = np.sqrt(np.mean(off**2)) / moved["standard_error"].mean()
    conforms.sampled(float(ratio), 1.0, atol=0.2)


@pytest.mark.slow
@pytest.mark.parametrize("told", [False, True], ids=["unknown", "known"])
@pytest.mark.few(1)
def test_the_sound_of_modes_is_that_of_the_true_ones(by_unknown, tmp_path, conforms, told):
    """Waves far longer than the beam: each mode is a point source before a wall."""
    _, page, said, out = measured(tmp_path, told) if told else by_unknown
    assert {"radiated.nc", "radiated.csv", "heard-1.wav"} <= {p.name for p in out.iterdir()}
    assert "<h2>Sound</h2>" in page
    assert "heard-1.wav" in page
    assert sum("sound power of" in line for line in said) == 3
    found, data = xr.load_dataset(out / "radiated.nc"), xr.load_dataset(out / "modes.nc")
    assert ("shared_real" in data) is told
    x = (np.arange(4000) + 0.5) / 4000 * BEAM.length
    places = np.stack([x, np.full_like(x, BEAM.width / 2)])
    since = float(data["zero"]) - 0.5  # the first half second is rest
    tips = np.array([2e-3, 1e-3]) * np.exp(np.real(TWO_MODES.poles) * since)
    omega, alpha = np.abs(TWO_MODES.poles), -np.real(TWO_MODES.poles)
    mean = [abs(np.mean(Component("bending", n).shape(BEAM, places))) for n in (1, 2)]
    strength = omega * np.array(mean) * tips * BEAM.length * BEAM.width  # m³/s
    power = AIR.density * (omega * strength) ** 2 / (4 * np.pi * AIR.speed_of_sound)
    for name, true in (("power", power), ("energy", power / (2 * alpha))):
        value, error = found[name].values, found[f"{name}_error"].values
        conforms.sampled(value, true, atol=3 * error)
        conforms.closed_form(error / value, below=0.05)
    whole = found.sel(band="all")
    most = 3 * float(whole["band_power_error"])
    conforms.sampled(float(whole["band_power"]), power.sum(), atol=most)


@pytest.mark.slow
def test_modes_go_to_a_report_and_files(by_unknown):
    """Other programs' readers find the same."""
    truth, (manifest, text, said, out) = TWO_MODES, by_unknown
    assert text.count("data-tl-fragment=") >= 4  # two of shapes, two of sound
    assert said[1].startswith("mode 1: 6.31")
    data = xr.open_dataset(out / "modes.nc")
    np.testing.assert_allclose(data["frequency"], truth.frequency, rtol=1e-3)
    np.testing.assert_allclose(data["damping"], truth.damping, rtol=0.05)
    assert float(data["mac"].max("candidate").min()) > 0.999
    sets = pyuff.UFF(str(out / "modes.uff")).read_sets()
    sets = [one for one in sets if one["type"] == 55]
    assert {(one["data_ch"], one["n_data_per_node"]) for one in sets} == {(2, 3)}  # a vector each
    eigenvalues = np.array([one["eig"] for one in sets])
    np.testing.assert_allclose(np.abs(eigenvalues) / (2 * np.pi), data["frequency"], rtol=1e-5)
    np.testing.assert_allclose(-eigenvalues.real / np.abs(eigenvalues), data["damping"], rtol=1e-4)
    shape = data["amplitude_real"].values + 1j * data["amplitude_imag"].values
    np.testing.assert_allclose(sets[1]["r3"], shape[1], rtol=1e-4, atol=1e-9)
    assert (out / "vtk" / "mode-2" / "period.pvd").is_file()
    assert (out / "mode-1.mp4").stat().st_size > 1000
    alias = {"rival": ("mode", [66.0, np.nan]), "rival_out_of_step": ("mode", [9.0, np.nan]),
             "out_of_step": ("mode", [8.0, 1.0])}  # fmt: skip
    alike, others = {"assurance": (("mode", "other"), np.ones((2, 2)))}, data["camera"] != "A"
    changes = {
        "Near 6.31": {"beside": ("mode", [20.0, 1.0])},
        "6.31[0-9]* Hz may be an alias of 66 Hz": alias,
        "The damping at 6.31[0-9]* Hz is known to 50% only":
            {"damping_deviation": 0.5 * data["damping"]},
        "The shapes at 6.31[0-9]* and 39.5[0-9]* Hz look alike": alike,
        "3.0% of the marker images of camera A move unlike":
            {"left_out": data["left_out"].where(others, 0.03)},
        "Camera A lost 50%": {"missing": data["missing"].where(others, 0.5)},
    }  # fmt: skip
    for told, changed in changes.items():
        before, after = (check_modes(one, manifest) for one in (data, data.assign(changed)))
        assert not [one for _, one in before if re.match(told, one)]
        assert [one for _, one in after if re.match(told, one)]
