"""From tracks to the shape: made-up tracks of known cameras, whose truth is exact."""

import re
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from scipy.signal import lfilter

from thesis_lib.facts import setups
from thesis_lib.laboratory.recording_files import manifest_of
from thesis_lib.laboratory.rig import default_rig
from thesis_lib.measure.calibration.bundle_adjustment import Network, step_network
from thesis_lib.measure.fitting.frequency import FrequencyError
from thesis_lib.measure.fitting.result import shape_result
from thesis_lib.measure.recordings.board import on_surface
from thesis_lib.measure.recordings.validation import ChainError
from thesis_lib.measure.report.warnings import check_shape
from thesis_lib.measure.tracking.tracks import Recording
from thesis_lib.vibration.motion import Component, Motion
from thesis_lib.vision.pinhole import project_points

BEAM = setups.thesis_beam()
PART = Component(amplitude=0.004, frequency=4.25)
DIRECTIONS = [(15, 30), (-10, 30), (170, 25), (190, 35)]
RATES = (60.0, 50.0, 60.0, 60.0)
DELAYS = (0.0, 0.0131, -0.0712, 0.1)
REST, BEGIN, END = 0.8, 1.6, 3.6
RIG = default_rig(BEAM, DIRECTIONS, components=(PART,))
POINTS = RIG.markers.centres
MOTION = Motion(BEAM, (PART,), 1.0, 0.4)
TRUE = PART.amplitude * PART.shape(BEAM, POINTS)


def recordings(folder, count=4, noise=0.0, readout=0.0, seed=0, lost=0.0, motion=MOTION, end=END):
    """Tracks on disk as exact cameras with noise see them, each row of an image at its time."""
    rng, made = np.random.default_rng(seed), []
    for k, station in enumerate(RIG.stations[:count]):
        rate, delay, camera = RATES[k], DELAYS[k], station.camera
        times = delay + np.arange(int((end + 0.2) * rate)) / rate
        uv = images(camera, motion, times[:, None])
        for _ in range(3 if readout else 0):
            rows = uv[:, 1] / camera.size[1] - 0.5
            uv = images(camera, motion, times[:, None] + readout * rows)
        uv += noise * rng.standard_normal(uv.shape)
        uv[rng.random(len(uv)) < lost] = np.nan
        uv[:, :, k] = np.nan  # one marker is hidden from each
        np.save(folder / f"{k}.npy", uv)
        made.append(Recording(camera, rate, delay, 1e-6, readout, folder / f"{k}.npy"))
    return made


def images(camera, motion, times):
    """Markers' images (frames, 2, markers) at times (frames, 1) or (frames, markers)."""
    shape = motion.shapes(POINTS)[0]
    heights = motion.coordinates(times)[0] * shape
    world = on_surface(BEAM.extent, POINTS[:, None], heights)
    return project_points(camera, world).swapaxes(0, 1)


def heard(frequency=4.25, of_force=1, end=END):
    """What the sound tells: the force leads the deflection by a quarter period less the damping."""
    phase = -np.pi / 2 - 2 * np.pi * 4.25 * MOTION.start + np.pi / 2 - BEAM.damping
    force = 0.3 * np.exp(1j * phase) * of_force
    return xr.Dataset(
        {
            "frequency": frequency,
            "of_sound": 4.25 if of_force else np.nan,
            "of_sound_deviation": 1e-6 if of_force else np.nan,
            "steady": ("end", [BEGIN, end]),
            "force": ("part", [force.real, force.imag]),
        }
    )


def manifest(**excitation):
    given = manifest_of(RIG)
    driven = given.excitation.model_copy(update={"rest_duration_s": REST, **excitation})
    pairs = zip(given.cameras, RATES, strict=True)
    cameras = tuple(one.model_copy(update={"frame_rate_hz": rate}) for one, rate in pairs)
    return given.model_copy(update={"excitation": driven, "cameras": cameras})


def test_exact_tracks_give_the_exact_shape(conforms, tmp_path):
    data = shape_result(manifest(), heard(), recordings(tmp_path))
    conforms.closed_form(data["deflection"], TRUE, atol=2e-5 * 0.004)
    conforms.closed_form(np.abs(data["quadrature"]).max(), below=1e-5 * 0.004)
    conforms.closed_form(data["phase"][8:], np.degrees(BEAM.damping - np.pi / 2), atol=0.02)
    assert data.attrs["most_similar"] == "bending 1"
    conforms.closed_form(float(data["mean_error"]), below=0.01)
    np.testing.assert_array_equal(data["cameras_seen"][:6], [3, 3, 3, 3, 4, 4])
    conforms.closed_form(data["missing"][0, :3], [1, 0, 0], rtol=1e-7)
    centres = [station.camera.centre for station in RIG.stations]
    conforms.closed_form(data["camera_centre"], centres, atol=1e-6)


def test_the_shape_is_corrected_for_the_bending_of_markers(conforms, tmp_path):
    """Points are tracked, so what edges would lose is added: half of the mean across the view."""
    data = shape_result(manifest(), heard(), recordings(tmp_path, noise=2e-5))
    bent = np.gradient(np.gradient(TRUE[:25], 0.025), 0.025)[7:18]
    views = 1 + 2 * np.mean(np.sin(np.radians(DIRECTIONS)[:, 0]) ** 2)
    added = np.mean((data["deflection"].values - TRUE)[7:18] / bent)
    conforms.closed_form(added, -views * 0.0025**2 / 8, rtol=0.1)


def spoiled(own, seed, noise=0.05, kept=1.0, like=0.0, fastest=False):
    """Exact recordings with noise, px, so alike from frame to frame, and a share of the centres."""
    rng, made = np.random.default_rng(seed), []
    for one in own:
        uv = np.array(one.centres)
        drawn = rng.standard_normal((len(uv) + 40, *uv.shape[1:]))
        drawn = lfilter([np.sqrt(1 - like**2)], [1, -like], drawn, axis=0)[40:]
        speed = np.linalg.norm(np.gradient(uv, axis=0), axis=1)
        lost = rng.random(speed.shape) > kept
        if fastest:
            lost = speed > np.nanquantile(speed, kept)
        path = one.path.with_name(f"spoiled-{one.path.name}")
        np.save(path, np.where(lost[:, None], np.nan, uv + noise * drawn))
        made.append(replace(one, path=path))
    return made


@pytest.mark.slow
@pytest.mark.parametrize(
    ("frequency", "how"), [(1.7, {"like": 0.5}), (4.25, {"kept": 0.9, "fastest": True})], ids=str
)
def test_standard_errors_are_what_noise_of_any_kind_scatters_by(
    conforms, tmp_path, monkeypatch, frequency, how
):
    """Alike by half from frame to frame; white and without the fastest centres."""
    monkeypatch.setattr("test_result.RATES", (30.0, 25.0, 29.97, 30.0))
    part = replace(PART, frequency=frequency)
    own = recordings(tmp_path, 3, motion=Motion(BEAM, (part,), 1.0, 0.4), end=BEGIN + 8)
    true, told = heard(frequency, of_force=0, end=BEGIN + 8), manifest(frequency_hz=frequency)
    off = []
    for seed in range(3):
        data = shape_result(told, true, spoiled(own, seed, **how))
        off.append(((data["deflection"] - TRUE) / data["standard_error"]).values[3:])
        assert not np.isnan(data["deflection"].values[3:]).any()
    conforms.sampled(np.sqrt(np.mean(np.square(off))), above=0.8, below=1.2)


def test_the_frequency_is_looked_for_where_centres_are_missing(conforms, tmp_path):
    """Markers that are seen in 80 % of the frames, and one of them only at first."""
    own = spoiled(recordings(tmp_path), 0, kept=0.8)
    edited(own[1], lambda t, uv: uv.__setitem__((t > 2.6, slice(None), 74), np.nan))
    data = shape_result(manifest(frequency_hz=None), heard(np.nan, of_force=0), own)
    error = float(data["frequency_deviation"])
    conforms.sampled(float(data["frequency"]), 4.25, atol=4 * error)
    conforms.sampled(float(data["growth"]), 0, atol=0.003)


def shown(data):
    """All that the report warns of, as one text."""
    return " ".join(note.text for note in check_shape(data.assign(ambiguous=0)))


@pytest.mark.slow
def test_a_rolling_shutter_is_made_good_by_its_readout_time(conforms, tmp_path):
    rolling = recordings(tmp_path, readout=0.012)
    data = shape_result(manifest(), heard(), rolling)
    # The row moves with the marker by a hundredth of the image, so that little is left.
    conforms.closed_form(data["deflection"], TRUE, atol=1e-3 * 0.004)
    conforms.closed_form(np.abs(data["quadrature"]).max(), below=2e-3 * 0.004)
    ignored = shape_result(manifest(), heard(), [replace(own, readout=0.0) for own in rolling])
    assert np.abs(ignored["quadrature"]).max() > 10 * np.abs(data["quadrature"]).max()


@pytest.mark.parametrize("given", [np.nan, 4.27])
def test_the_frequency_is_that_of_the_tracks_where_no_force_tells_it(conforms, tmp_path, given):
    data = shape_result(manifest(), heard(given, of_force=0), recordings(tmp_path, noise=0.02))
    error = float(data["frequency_deviation"])
    conforms.sampled(error, below=1e-3)
    conforms.sampled(float(data["frequency"]), 4.25, atol=5 * error)
    conforms.closed_form(data["deflection"], TRUE, atol=2e-3 * 0.004)
    assert np.isnan(data["phase"]).all()


def test_a_vibration_that_dies_down_is_told(conforms, tmp_path):
    class Dying(Motion):
        def coordinates(self, times):
            t = np.asarray(times, float)
            return super().coordinates(t) * np.exp(-0.1 * (t - BEGIN))

    dying = Dying(BEAM, (PART,), 1.0, 0.4)
    data = shape_result(manifest(), heard(), recordings(tmp_path, noise=0.02, motion=dying))
    conforms.closed_form(float(data["growth"]), -0.2, atol=0.02)
    assert "amplitude changes by -" in shown(data)


def test_a_camera_off_its_clock_is_told_and_mended(conforms, tmp_path):
    own = recordings(tmp_path, noise=0.02)
    own[2] = replace(own[2], delay=own[2].delay + 0.5 / 60)
    data = shape_result(manifest(), heard(), own)
    assert "start of camera C 8.3" in shown(data)
    conforms.closed_form(data["lag"], [0, 0, -0.5 / 60, 0], atol=1e-4)
    conforms.sampled(np.nanmax(np.abs(data["deflection"] - TRUE)), below=0.005 * 0.004)


def test_two_cameras_are_enough(conforms, tmp_path):
    data = shape_result(manifest(), heard(), recordings(tmp_path, count=2))
    conforms.closed_form(data["deflection"][2:], TRUE[2:], atol=2e-5 * 0.004)
    assert np.isnan(data["deflection"][:2]).all()
    assert np.isnan(data["without_camera"]).all()
    assert "2 markers were seen by fewer" in shown(data)


def test_a_camera_that_does_not_fit_the_grid_is_refused_by_its_name(tmp_path):
    own = recordings(tmp_path, noise=0.02)
    zoom(own, [2], 1.02)
    with pytest.raises(ChainError, match="camera C fits worst"):
        shape_result(manifest(), heard(), own)


# What the tracks themselves tell against a result.


def edited(own, change):
    """The same recording with its centres (frames, 2, markers) changed at their times."""
    uv = np.array(own.centres)
    change(own.times, uv)
    np.save(own.path, uv)
    return own


def zoom(own, cameras, by):
    for k in cameras:
        middle = own[k].camera.K[:2, 2:]
        edited(own[k], lambda t, uv, c=middle: uv.__isub__(c).__imul__(by).__iadd__(c))


def test_clocks_that_run_at_different_speeds_are_told_and_mended(conforms, tmp_path):
    long, fast = 11.6, 300e-6
    own = recordings(tmp_path, noise=0.02, end=long)
    true = own[1].times - own[1].delay
    own[1] = replace(own[1], stamps=true * (1 + fast))
    data = shape_result(manifest(), heard(end=long), own)
    found, error = float(data["pace"][1]), float(data["pace_deviation"][1])
    conforms.sampled((found - fast) / error, 0, atol=4)
    assert error < 2e-6
    assert re.search("The clock of camera B runs (299|300|301)", shown(data))
    conforms.sampled(np.nanmax(np.abs(data["deflection"] - TRUE)), below=0.005 * 0.004)


def test_frames_at_any_times_count_at_their_own(conforms, tmp_path):
    own, rng = recordings(tmp_path, noise=0.02), np.random.default_rng(4)
    for k, one in enumerate(own):
        even = one.times - one.delay
        stamps = even + 0.004 * np.sin(0.9 * even) + 4e-4 * rng.standard_normal(len(even))
        kept = rng.random(len(even)) > 0.05
        stamps = (stamps - stamps[0])[kept]
        uv = images(one.camera, MOTION, one.delay + stamps[:, None])
        np.save(one.path, uv + 0.02 * rng.standard_normal(uv.shape))
        own[k] = replace(one, stamps=stamps)
    data = shape_result(manifest(), heard(), own)
    assert "frames of camera B come unevenly" in shown(data)
    ratio = (data["deflection"] - TRUE) / data["standard_error"]
    conforms.sampled(np.sqrt(np.mean(ratio**2)), below=1.3)


@pytest.mark.parametrize(("late", "readout"), [(0.0, 0.0), (0.1, 0.03)])
def test_a_camera_that_is_touched_is_named_with_its_second(conforms, tmp_path, late, readout):
    """Whatever its clock says, and however late its rows are."""
    own = recordings(tmp_path, noise=0.02, readout=readout)

    def jump(times, uv):
        uv[times > 2.7] += np.array([[2.0], [1.5]])

    edited(own[3], jump)
    own[3] = replace(own[3], delay=own[3].delay + late)
    data = shape_result(manifest(), heard(), own)
    conforms.closed_form(data["jump"][3], 2.5, atol=0.1)
    conforms.closed_form(data["jump_time"][3], 2.7, atol=0.05)
    assert not data["jump"][:3].values.any()
    assert "camera D sees jumped by 2.5 px at 2.7" in shown(data)


def test_a_wrong_frequency_is_refused_with_the_right_one(tmp_path):
    wrong = heard(of_force=0).assign(frequency=6.1)
    with pytest.raises(FrequencyError, match=r"given 6\.1, which .* 0\.\d% .* near 4\.\d+ Hz"):
        shape_result(manifest(frequency_hz=6.1), wrong, recordings(tmp_path, noise=0.02))


def test_the_frequency_of_a_force_is_not_taken_for_a_given_one(conforms, tmp_path):
    own, off = recordings(tmp_path, noise=0.02), heard(6.1).assign(of_sound=6.1)
    data = shape_result(manifest(frequency_hz=None), off, own)
    assert np.isnan(data["frequency_given"])
    conforms.closed_form(data["other_frequency"], 4.25, atol=0.3)
    assert "most of the motion is at 4.2" in shown(data)


def test_another_tone_is_told(conforms, tmp_path):
    own = recordings(tmp_path, noise=0.02)
    for one in own:
        edited(one, lambda t, uv: uv.__iadd__(1.0 * np.sin(2 * np.pi * 11 * t)[:, None, None]))
    data = shape_result(manifest(), heard(), own)
    conforms.closed_form(data["other_frequency"], 11.0, atol=0.3)
    assert "another vibration, at 1" in shown(data)


def test_an_alias_is_named_by_the_cameras_starts(tmp_path):
    # At 60 frames a second 4.25 Hz looks like 64.25 Hz, but not to cameras that start apart.
    own = [one for one in recordings(tmp_path, noise=0.02) if one.rate == 60.0]
    false = heard(of_force=0).assign(frequency=64.25)
    data = shape_result(manifest(frequency_hz=64.25, undersampled=True), false, own)
    lags = dict(zip(data["alias"].values.round(2), data["alias_lag"].values, strict=True))
    assert lags[4.25] < 2 < 10 < lags[64.25]
    assert "64.25 Hz may be an alias of 4.25 Hz" in shown(data)


def test_corners_that_run_the_wrong_way_round_are_refused(tmp_path):
    own = recordings(tmp_path, noise=0.02)
    rows = POINTS.shape[1] // 3
    mirrored = np.arange(3 * rows).reshape(3, rows)[:, ::-1].ravel()
    for one in own:
        np.save(one.path, np.array(one.centres)[:, :, mirrored])
    with pytest.raises(ChainError, match="wrong way round"):
        shape_result(manifest(), heard(), own)


@pytest.mark.slow
def test_a_zoom_since_the_board_was_filmed_is_told(tmp_path):
    def told(zoomed, by):
        own = recordings(tmp_path, noise=0.02)
        zoom(own, zoomed, by)
        return shown(shape_result(manifest(), heard(), own))

    assert "zoom" not in told([], 1)
    assert "zoom or crop since the board" in told([0, 1, 2, 3], 1.005)
    assert "zoomed or cropped" in told([2], 1.003)


def test_motion_in_the_plane_widens_standard_errors(conforms, tmp_path):
    # Two cameras, of which one sees a tenth of all motion less, as its video was compressed.
    own = recordings(tmp_path, noise=0.02, count=2)
    edited(own[1], lambda t, uv: uv.__isub__(0.1 * (uv - uv[:20].mean(axis=0))))
    data = shape_result(manifest(), heard(), own)
    assert float(data["in_plane_excess"]) > 5
    assert "in the plane of the structure" in shown(data)
    off = (data["deflection"] - TRUE) / data["standard_error"]
    conforms.sampled(np.sqrt(np.nanmean(off**2)), below=4)
    off = (data["deflection"] - TRUE) / data["error_of_scatter"]
    conforms.sampled(np.sqrt(np.nanmean(off**2)), above=15)


@pytest.mark.nightly
def test_standard_errors_hold_what_drawn_calibrations_do(conforms, tmp_path):
    """Cameras that are off as a covariance says: shapes scatter by what standard errors say."""
    own = recordings(tmp_path, noise=0.002)
    network = Network(tuple(one.camera for one in own), np.zeros((0, 3, 3)), np.zeros((0, 3)))
    each = [np.repeat([2e-4, 2e-4], 3)] * 4 + [np.array([1, 1, 1, 1, 1e-3, 1e-3, 1e-4, 1e-4])] * 4
    scale, rng = np.concatenate(each), np.random.default_rng(1)
    errors = []
    for _ in range(20):
        cameras = step_network(network, scale * rng.standard_normal(len(scale))).cameras
        off = [replace(one, camera=camera) for one, camera in zip(own, cameras, strict=True)]
        errors.append(shape_result(manifest(), heard(), off)["deflection"] - TRUE)
    data = shape_result(manifest(), heard(), own, np.diag(scale**2))
    errors, stated = np.array(errors)[:, 6:], data["standard_error"].values[6:]
    alone = data["error_of_scatter"].values[6:]
    conforms.sampled(np.sqrt(np.mean(errors**2)), np.sqrt(np.mean(stated**2)), rtol=0.25)
    conforms.sampled(np.mean(np.abs(errors) < 2 * stated), above=0.88)
    assert np.sqrt(np.mean(errors**2)) > 3 * np.sqrt(np.mean(alone**2))


def test_shapes_without_a_camera_differ_as_stated_however_unlike_the_cameras_scatter(
    conforms, tmp_path
):
    own, rng = recordings(tmp_path), np.random.default_rng(0)
    for one, noise in zip(own, (0.05, 0.05, 0.05, 0.15), strict=True):
        edited(one, lambda t, uv, sigma=noise: uv.__iadd__(sigma * rng.standard_normal(uv.shape)))
    data = shape_result(manifest(), heard(), own)
    ratio = ((data["without_camera"] - data["deflection"]) / data["without_deviation"]).values
    assert np.isfinite(ratio[:, 4:]).all()
    conforms.sampled(np.sqrt(np.mean(ratio[:, 4:] ** 2, axis=1)), 1, atol=0.3)


@pytest.mark.nightly
def test_standard_errors_are_the_scatter_of_repeated_recordings(conforms, tmp_path):
    shapes = []
    for seed in range(40):
        own = recordings(tmp_path, noise=0.05, seed=seed, lost=0.1)
        data = shape_result(manifest(), heard(), own)
        shapes.append(data["deflection"].values)
    predicted = np.sqrt(np.mean(data["standard_error"].values ** 2))
    conforms.sampled(np.sqrt(np.mean((np.array(shapes) - TRUE) ** 2)), predicted, rtol=0.06)
    assert all("lost" in line for _, line in check_shape(data.assign(ambiguous=0)))
