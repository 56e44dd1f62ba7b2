"""Chapter 5's cubes from synthetic recordings: exact projections, and noise of a known size."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from scenes.laboratory import MATCH, estimated, recordings, replicates

from thesis_lib.facts import setups
from thesis_lib.figure_sets.experiment import compute as es, methods as shapes
from thesis_lib.figure_sets.experiment.figure_set import ExperimentResolution, method_of
from thesis_lib.figure_sets.registry import validate_request
from thesis_lib.measure.recordings.board import rows_on
from thesis_lib.vibration.motion import Component

pytestmark = pytest.mark.slow  # by replicates of the recordings

BEAM = setups.thesis_beam()
MARKERS = rows_on(BEAM)
SIGMA = 0.02  # px
QUIET = {"audio_noise_db": 120.0}  # clocks are exact then
REPLICATES = 13


def resolution(**values):
    return validate_request("experiment-resolution", {"trials": REPLICATES - 1, **QUIET, **values})


def cameras(**values):
    return validate_request("experiment-cameras", {"trials": REPLICATES - 1, **QUIET, **values})


@pytest.fixture(scope="module")
def noisy():
    return replicates(resolution().recordings, REPLICATES, SIGMA)


@pytest.fixture(scope="module")
def exact():
    return replicates(resolution().recordings, 1)


@pytest.fixture(scope="module")
def cubes(noisy):
    return {study.name: es.run(study, noisy) for study in (resolution(), cameras())}


def of(cube, case, label=None):
    chosen = cube.isel(setting=np.flatnonzero(cube["case"].values == case))
    if label is not None:
        chosen = chosen.isel(setting=np.flatnonzero(chosen["label"].values == label))
    return chosen


# What the cubes are.


def test_errors_are_those_of_the_measured_deflections(conforms, cubes):
    for cube in cubes.values():
        reference = cube["reference_deflection"].values[0]
        scale = 100 / np.abs(reference).max()
        error = np.abs(cube["measured_deflection"].values[:, 0] - reference) * scale
        conforms.independent(
            cube["mean_error"][:, 0], np.sqrt(np.mean(error**2, axis=-1)), atol=1e-5
        )
        conforms.independent(cube["max_point_error"][:, 0], error.max(axis=-1), atol=1e-5)
        conforms.independent(cube["point_error"][:, 0], error[:, 0], atol=1e-5)


def test_all_eleven_sets_of_cameras_are_there(cubes):
    cube = cubes["experiment-cameras"]
    every = ["–".join(names) for n in (2, 3, 4) for names in combinations("ABCD", n)]
    for case in ("literal-all", "harmonic-all"):
        assert of(cube, case)["label"].values.tolist() == every
        # A set is the same whichever list it is in.
        for label in ("A–B", "A–B–C", "A–B–C–D"):
            one, other = of(cube, method_of(case), label), of(cube, case, label)
            np.testing.assert_array_equal(one["measured_deflection"], other["measured_deflection"])


# Trials.


def test_trials_do_not_depend_on_the_other_settings(noisy, cubes):
    alone = es.run(resolution(cases=["aligned"], widths_px=[1280]), noisy)
    whole = of(cubes["experiment-resolution"], "aligned", "1280×720")
    for name in ("measured_deflection", "mean_error", "predicted_error", "amplitude"):
        np.testing.assert_array_equal(alone[name], whole[name])


@pytest.mark.parametrize("case", ["aligned", "harmonic-all"])
def test_trials_scatter_as_is_predicted(conforms, cubes, case):
    part = of(cubes[f"experiment-{'cameras' if case == 'harmonic-all' else 'resolution'}"], case)
    measured = part["measured_deflection"].values[:, 0].astype(float)
    scale = 100 / np.abs(part["reference_deflection"].values).max()
    scatter = scale * np.sqrt(np.mean(measured.var(axis=1, ddof=1), axis=1))
    conforms.sampled(scatter, part["predicted_error"].values[:, 0], rtol=0.15)


# The methods.


def test_exact_tracks_give_the_exact_shape(conforms, exact):
    cube = es.run(resolution(trials=0), exact)
    np.testing.assert_array_less(of(cube, "harmonic")["mean_error"], 1e-3)
    np.testing.assert_array_less(of(cube, "aligned")["mean_error"], 100 * 4e-5)
    assert float(of(cube, "literal")["mean_error"].max()) > 0.02
    conforms.closed_form(of(cube, "harmonic")["mac"], 1, atol=1e-9)
    fitted = cube.isel(setting=np.flatnonzero(cube["case"].values != "matched"))
    conforms.closed_form(fitted["grid_scale"], 1, atol=1e-9)
    conforms.closed_form(float(fitted["grid_residual"].max()), below=1e-10)
    conforms.closed_form(float(fitted["predicted_error"].max()), below=1e-3)


def test_whole_pixels_cost_less_the_more_of_them_there_are(conforms):
    study = resolution(trials=6, cases=["matched", "literal"])
    cube = es.run(study, replicates(study.recordings, 7))
    matched = of(cube, "matched")
    # A coordinate that is rounded to steps of MATCH scatters by MATCH / √12.
    conforms.closed_form(matched["centre_scatter"], MATCH / np.sqrt(12), rtol=0.1)
    medians = matched["mean_error"][:, 0, 1:].median("trial").values
    assert medians[0] > medians[1] > medians[2]
    assert medians[2] > of(cube, "literal")["mean_error"][2, 0, 1:].median()


def test_whole_frames_are_counted_from_the_first_of_the_cameras(conforms):
    starts = np.array([0.0, 0.10, 0.10 - 2.5 / 60, 0.10 - 3.8 / 60])
    data = recordings(resolution(widths_px=[1920]).recordings, starts=starts)
    tracks = shapes.select_tracks(data, ("literal", "BCD", 1920))
    conforms.closed_form(tracks.frames, np.rint((starts[1:] - starts[1]) * 60), atol=0)


def test_the_amplitude_phase_and_mobility_are_those_of_the_model(conforms, exact):
    cube = of(es.run(resolution(trials=0), exact), "harmonic")
    reference = cube["reference_deflection"].values[0]
    conforms.closed_form(
        cube["amplitude"].values[:, 0], np.abs(reference)[None].repeat(3, 0), atol=4e-9
    )
    xi = BEAM.damping
    lag = np.degrees(np.arctan(np.sqrt(1 - 2 * xi**2) / xi))
    conforms.closed_form(cube["phase"][:, 0, 3:], -lag, atol=1e-3)
    real, imaginary = cube["mobility_reference"].values
    conforms.closed_form(cube["mobility_real"], real, rtol=1e-4)
    conforms.closed_form(cube["mobility_imag"], imaginary, rtol=1e-3)
    # One mode: |Y| = ω φ² / (m 2ξ ωₙ² √(1 − ξ²)) at the displacement resonance.
    omega = 2 * np.pi * 4.25
    natural = omega / np.sqrt(1 - 2 * xi**2)
    drive = Component().shape(BEAM, BEAM.force_point)[0]
    expected = omega * drive**2 / (BEAM.mass / 4 * 2 * xi * natural**2 * np.sqrt(1 - xi**2))
    conforms.closed_form(np.hypot(real, imaginary), expected, rtol=1e-9)


def whole_frames(offset):
    """A study at 5 Hz, 12 frames to a period, and recordings aligned to whole frames.

    Every maximum then lies equally far, `offset` frames, from the frame that is nearest.
    """
    study = resolution(frequency_hz=5.0, trials=0, widths_px=[1920], cases=["literal"])
    request = study.recordings.model_copy(update={"widths_px": [1920]})
    peak = es.rig_of(request).motion.start + 0.25 / 5  # sin ω(t − start), the envelope apart
    first = peak % (1 / 60) + offset / 60
    data = recordings(request, starts=first + np.array([0, 3, 7, 2]) / 60)
    return study, estimated(request, [data])


@pytest.mark.parametrize("offset", [-0.35, 0.48])
def test_a_missed_peak_costs_what_the_cosine_says(conforms, offset):
    study, data = whole_frames(offset)
    cube = es.run(study, data)
    loss = 1 - np.cos(2 * np.pi * 5 * offset / 60)
    measured = cube["measured_deflection"].values[0, 0, 0]
    reference = cube["reference_deflection"].values[0]
    conforms.closed_form(measured, (1 - loss) * reference, atol=1e-8)
    rms = 100 * np.sqrt(np.mean(reference**2)) / np.abs(reference).max()
    conforms.closed_form(float(cube["mean_error"][0, 0, 0]), loss * rms, atol=2e-4)


def tracks(data, method):
    return shapes.select_tracks(data, (method, "ABCD", 1920))


@pytest.mark.parametrize("method", ["aligned", "harmonic"])
def test_the_other_methods_do_not_care_when_the_cameras_start(conforms, method):
    starts = np.random.default_rng(0).uniform(0, 0.25, 4)
    data = recordings(resolution(widths_px=[1920]).recordings, starts=starts)
    instant = shapes.find_maxima(data, BEAM.damping)
    found, _ = shapes.measure_deflection(tracks(data, method), instant, method, np.zeros(4))
    shape = 0.004 * Component().shape(BEAM, MARKERS.positions[:, :75])
    conforms.invariance(found, shape, atol=2e-7)


@pytest.mark.parametrize("method", ["aligned", "harmonic"])
def test_a_wrong_clock_costs_its_camera_s_part(conforms, exact, method):
    # All cameras but the reference are wrong by the same phase: the aligned way reads them at the
    # reference's peak, the harmonic one at the peak of their mean.
    data = exact.assign(delay=exact["delay"] + np.array([0, 1, 1, 1]) * 0.5 / 60)
    instant = shapes.find_maxima(exact, BEAM.damping)
    found, _ = shapes.measure_deflection(tracks(data, method), instant, method, np.zeros(4))
    shape = 0.004 * Component().shape(BEAM, MARKERS.positions[:, :75])
    share = 1 - np.vdot(found, shape) / np.vdot(shape, shape)
    angle = instant.omega * 0.5 / 60
    mean = (1 + 3 * np.exp(1j * angle)) / 4
    loss = 1 - (mean.real if method == "aligned" else abs(mean))
    conforms.closed_form(share, loss, rtol=0.2)


def test_the_instants_are_the_maxima_of_the_steady_part(conforms, exact):
    instant = shapes.find_maxima(exact, BEAM.damping)
    begin, end = exact["steady"].values
    assert np.all((instant.times > begin) & (instant.times < end))
    conforms.closed_form(np.diff(instant.times), 1 / 4.25, rtol=1e-7)
    rig = es.rig_of(resolution().recordings)
    tip = rig.motion.coordinates(instant.times + rig.stations[0].start)[0]
    conforms.closed_form(tip, 0.004, rtol=1e-8)


def test_the_maximum_is_one_that_all_cameras_recorded(conforms):
    """A camera that started first ends first: whichever maximum is left to it, that one is read."""
    _, data = whole_frames(0.2)
    instant, whole = shapes.find_maxima(data, BEAM.damping), tracks(data, "literal")
    assert len(instant.times) > 3
    expected = np.cos(2 * np.pi * 5 * 0.2 / 60) * 0.004
    expected = expected * Component().shape(BEAM, MARKERS.positions[:, :75])
    times = np.where(np.isfinite(whole.uv).all(axis=(2, 3)), whole.times, np.inf)
    for time in instant.times:
        there = np.abs(times - time) < 1 / 60
        uv = whole.uv.copy()
        uv[2] = np.where(there[2, :, None, None], uv[2], np.nan)
        found, _ = shapes.measure_deflection(replace(whole, uv=uv), instant, "literal", np.zeros(4))
        conforms.closed_form(found, expected, atol=4e-8)
    none = replace(whole, uv=np.where(np.arange(4)[:, None, None, None] == 2, np.nan, whole.uv))
    with pytest.raises(ValueError, match="recorded by all cameras"):
        shapes.measure_deflection(none, instant, "literal", np.zeros(4))


# Missing markers.


def test_markers_that_too_few_cameras_see_are_missing_and_counted(conforms, noisy):
    noisy = noisy.isel(replicate=slice(1))
    data = noisy.copy(deep=True)
    row = MARKERS.middle_row.start
    marker = np.arange(75)
    camera = data["camera"].values
    for name, place in (("C", 4), ("D", 4), ("D", 9)):
        data["tracks"].values[camera == name, ..., marker == row + place] = np.nan
    cube = es.run(cameras(cases=["literal-all", "harmonic-all"], trials=5), data)
    whole = es.run(cameras(cases=["literal-all", "harmonic-all"], trials=5), noisy)
    left = [set(str(label).split("–")) for label in cube["label"].values]
    lost = [sum(len(names - set(blind)) < 2 for blind in ("CD", "D")) for names in left]
    conforms.closed_form(np.ravel(cube["missing"]), np.divide(lost, 25), rtol=1e-7)
    others = {"point": np.delete(np.arange(25), [4, 9])}
    measured, expected = (one["measured_deflection"].isel(others) for one in (cube, whole))
    conforms.invariance(measured, expected, atol=2e-6)
    for name in ("mean_error", "max_point_error", "predicted_error", "mac"):
        assert np.isfinite(cube[name].values).all()


# Requests.


def test_the_default_rig_is_the_thesis_s_and_parameters_reach_it():
    study = ExperimentResolution()
    assert list(study.directions_deg.values()) == [(10, 22), (-10, 22), (190, 22), (170, 22)]
    rig = es.rig_of(study.recordings)
    assert {(s.frame_rate, s.sensor.exposure) for s in rig.stations} == {(60, 1 / 250)}
    assert rig.cameras[0].size == (1920, 1080)
    assert rig.motion.components == (Component("bending", 1, 4.25, 0.004),)
    np.testing.assert_allclose([np.linalg.norm(c.centre) for c in rig.cameras], 0.57)
    values = {"focal_length_mm": 30.0, "distance_mm": 700.0, "azimuth_deg": 20.0,
              "elevation_deg": 35.0, "lens_k1": 0.0, "frequency_hz": 5.0, "amplitude_mm": 2.0,
              "frame_rate_hz": 100.0, "exposure_ms": 2.0, "shot_noise": 0.1, "read_noise": 2.0,
              "audio_noise_db": 30.0, "seed": 9}  # fmt: skip
    rig = es.rig_of(validate_request("experiment-resolution", values).recordings)
    camera, station = rig.cameras[1], rig.stations[1]
    assert camera.K[0, 0] == pytest.approx(1600, rel=0.006)
    x, y, z = camera.centre / 0.7
    assert np.degrees([np.arctan2(x, y), np.arcsin(z)]).tolist() == pytest.approx([-20, 35])
    np.testing.assert_array_equal(camera.distortion, 0)
    assert rig.motion.components == (Component("bending", 1, 5.0, 0.002),)
    assert (station.frame_rate, station.sensor.exposure) == (100, 0.002)
    assert (station.sensor.shot, station.sensor.read) == (0.1, 2.0)
    assert (rig.audio_noise_db, rig.seed) == (30, 9)
