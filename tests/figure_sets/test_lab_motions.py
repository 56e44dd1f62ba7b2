"""Beyond chapter 5: aliases, torsion, the filmed plate and its sound."""

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, strategies as st

from thesis_lib.acoustics.planes import PlateSound
from thesis_lib.facts import setups
from thesis_lib.figure_sets import display
from thesis_lib.figure_sets.lab_modes import compute as lab_modes
from thesis_lib.figure_sets.lab_plate import compute as lab_plate
from thesis_lib.figure_sets.registry import validate_request
from thesis_lib.laboratory import tracking
from thesis_lib.laboratory.experiment import join_replicates
from thesis_lib.laboratory.rig import EXPOSURE_SAMPLES
from thesis_lib.measure.recordings.board import rows_on
from thesis_lib.measure.tracking.tracker import Tracker
from thesis_lib.plotting import selection
from thesis_lib.studies.schema import with_provenance
from thesis_lib.vibration import motion, structure
from thesis_lib.vibration.motion import Component
from thesis_lib.vibration.structure import deflection_shape, resonance_frequency

pytestmark = pytest.mark.slow  # by recordings of many frames

BEAM, PLATE = setups.thesis_beam(), setups.thesis_plate()
SIGMA = 0.02  # px
QUICK = {"width_px": 960, "frames": 12, "modes": [3], "trials": 0}
SMALL = {"plane_shape": [19, 13], "trials": 2}


def modes_study(**values):
    return validate_request("lab-modes", {"trials": 2, **values})


def plate_study(**values):
    return validate_request("lab-plate", {**SMALL, **values})


NODES, WEIGHTS = np.polynomial.legendre.leggauss(4)  # of an exposure, from −1 to 1


def look(sigma):
    """What films a rig: markers where they are in the mean of the exposure, with noise in px."""

    def one(rig):
        found = []
        for number, station in enumerate(rig.stations):
            times = tracking.frame_times(rig, station)
            exposure = station.sensor.exposure * np.sqrt(1 - 1 / EXPOSURE_SAMPLES**2)
            at = [times + node * exposure / 2 for node in NODES]
            seen = [tracking.true_centres(rig, station, each) for each in at]
            centres = np.tensordot(WEIGHTS / 2, seen, axes=1)
            noise = np.random.default_rng([0, rig.seed, number]).standard_normal(centres.shape)
            found.append(tracking.TrackedCentres(times, centres + sigma * noise))
        return found

    return one


def films(study, sigma=0.0):
    """The replicates of a study, by exact projections with noise of a known size."""
    if study.study == "modes":
        rigs_of, estimate = lab_modes.rigs_of, lab_modes.estimate_motions
    else:
        rigs_of, estimate = lab_plate.rigs_of, lab_plate.estimate_deflections
    replicates = []
    for number in range(study.trials + 1):
        data = tracking.record_tracks(rigs_of(study, number), study.frames, look(sigma))
        replicates.append(data.merge(estimate(study, data, number)))
    return join_replicates(replicates, ("tracks",))


def finished(cube, study):
    return with_provenance(cube, study, 0.0)


@pytest.fixture(scope="module")
def beam_cube():
    study = modes_study(trials=30)
    return finished(lab_modes.run(study, films(study, SIGMA)), study)


@pytest.fixture(scope="module")
def plate_cube():
    study = plate_study(trials=30, cases=["aperture", "cameras"])
    return finished(lab_plate.run(study, films(study, SIGMA)), study)


def of(cube, case, label=None):
    rows = cube["case"].values == case
    if label is not None:
        rows &= cube["label"].values == label
    return cube.isel(setting=np.flatnonzero(rows))


# Aliases.


@given(st.floats(1, 900), st.floats(10, 500), st.integers(8, 40))
def test_frames_cannot_tell_a_frequency_from_its_alias(conforms, frequency, rate, frames):
    shown = float(motion.fold_frequency(frequency, rate))
    assert 0 <= shown <= rate / 2 * (1 + 1e-12)
    turns = 2 * np.pi * np.arange(frames) / rate
    conforms.invariance(np.cos(frequency * turns), np.cos(shown * turns), atol=1e-6)
    every = motion.list_aliases(shown, rate, 1000.0)
    conforms.closed_form(np.abs(every - frequency).min(), below=1e-9 * rate + 1e-9)
    conforms.invariance(motion.fold_frequency(every, rate), shown, atol=1e-8)
    assert np.all(np.diff(every) > 0)


def test_detuning_costs_what_the_sinc_says(conforms):
    cycles = np.array([0.0, 0.2, 0.5, 1.0])
    conforms.closed_form(motion.detuning_loss(cycles, 500), 1 - np.sinc(cycles), atol=1e-5)
    few = 1 - np.sin(np.pi * 0.3) / (12 * np.sin(np.pi * 0.3 / 12))
    conforms.closed_form(motion.detuning_loss([0.3], 12)[0], few, rtol=1e-6)


def test_a_harmonic_explains_all_at_its_frequency_and_its_share_beside_noise(conforms):
    rng = np.random.default_rng(0)
    times = [start + np.arange(40) / 60 for start in (0.0, 0.007)]
    clean = [np.cos(2 * np.pi * 7.3 * t)[:, None] * [1.0, -2.0] for t in times]
    conforms.closed_form(lab_modes.share_explained([7.3], times, clean)[0], 1, rtol=1e-6)
    conforms.closed_form(lab_modes.read_frequency(times, clean, 60), 7.3, atol=1e-3)
    mixed = [own + 0.3 * rng.standard_normal(own.shape) for own in clean]
    share = np.mean([own.var() for own in clean]) / np.mean([own.var() for own in mixed])
    conforms.closed_form(lab_modes.share_explained([7.3], times, mixed)[0], share, atol=0.03)
    gappy = [np.column_stack([own, own[:, 0]]) for own in clean]
    gappy[0][3, 2] = np.nan
    conforms.closed_form(lab_modes.share_explained([7.3], times, gappy)[0], 1, rtol=1e-6)


# Bending and torsion, from exact projections.


def test_torsion_has_nothing_of_bending_over_the_rows(conforms):
    points = rows_on(BEAM).centres
    twist = Component("torsion").shape(BEAM, points)
    for mode in (1, 2, 3):
        bending = Component("bending", mode).shape(BEAM, points)
        conforms.invariance(
            abs(bending @ twist), below=1e-12 * np.linalg.norm(bending) * np.linalg.norm(twist)
        )


def test_a_fit_at_the_known_frequency_is_right_at_every_frame_rate(conforms):
    study = modes_study(cases=["known"])
    cube = lab_modes.run(study, films(study))
    conforms.closed_form(cube["mean_error"][:, :, 0], 0, atol=0.02)  # of order 1, exposure
    for name in ("bending", "torsion"):
        ratio = cube[f"{name}_amplitude"].isel(trial=0) / cube[f"{name}_reference"]
        conforms.closed_form(ratio, 1, atol=2e-3)
    conforms.closed_form(cube["torsion_phase"].isel(trial=0), 90, atol=0.2)
    conforms.closed_form(cube["mac"], 1, atol=1e-6)


def test_an_exposure_takes_what_the_sinc_says(conforms):
    seen = []
    for exposure in (1e-3, 2.0):
        study = modes_study(exposure_ms=exposure, modes=[3], cases=["known"], trials=0)
        recording = lab_modes.recordings_of(study, films(study))[0][0]
        fitted = recording.fit(recording.frequency).harmonics
        seen.append(np.array([h.coefficients[1] - 1j * h.coefficients[2] for h in fitted]))
    ratio = np.abs(np.vdot(*seen)) / np.linalg.norm(seen[0]) ** 2
    conforms.closed_form(ratio, np.sinc(recording.frequency * 2.0 / 1000), atol=2e-4)


@pytest.mark.nightly
def test_where_frames_suffice_reading_is_enough_and_where_they_do_not_it_is_wrong(
    conforms, beam_cube
):
    conforms.closed_form(beam_cube["read_frequency"], beam_cube["alias_frequency"], atol=0.05)
    read, known = of(beam_cube, "read"), of(beam_cube, "known")
    for m, enough in ((0, [False, True, True, True]), (1, [False, False, True, True])):
        errors = read["mean_error"].values[:, m, 0]
        limit = 1.1 * known["mean_error"].values[:, m, 0] + 0.02
        np.testing.assert_array_equal(errors < limit, enough)
        assert np.all(errors[~np.array(enough)] > 5)
    # Told or found, too few frames are as good as enough.
    for case in ("known", "found"):
        ratio = of(beam_cube, case)["predicted_error"] / known["predicted_error"].isel(setting=-1)
        conforms.sampled(ratio, 1, atol=0.12)


def test_cameras_that_start_together_agree_at_every_alias_and_see_the_shape_at_each(conforms):
    study = modes_study(starts="together", exposure_ms=1e-3, cases=["read", "known"],
                        frame_rates_hz=[60.0, 120.0])  # fmt: skip
    cube = lab_modes.run(study, films(study, SIGMA))
    conforms.sampled(np.nanmax(cube["misfit"]), below=1.3)
    conforms.invariance(cube["found_frequency"], cube["read_frequency"], rtol=1e-7)
    read, known = of(cube, "read"), of(cube, "known")
    conforms.invariance(read["mean_error"], known["mean_error"], atol=0.05)


@pytest.mark.nightly
def test_trials_scatter_as_is_predicted(conforms, beam_cube):
    for case in ("known", "found"):
        part = of(beam_cube, case)
        rms = np.sqrt((part["mean_error"].isel(trial=slice(1, None)) ** 2).mean("trial"))
        conforms.sampled(rms / part["predicted_error"], 1, atol=0.05)
        for kind in ("bending", "torsion"):
            spread = part[f"{kind}_amplitude"].isel(trial=slice(1, None)).std("trial")
            conforms.sampled(spread / part[f"{kind}_standard_error"], 1, atol=0.25)


def test_static_torsion_is_saint_venant_s(conforms):
    summed = structure.tip_twist(BEAM, 0.01, 1e-6, modes=4000)
    angle = 0.01 * BEAM.force_position / structure.torsional_rigidity(BEAM)
    conforms.closed_form(summed, angle * BEAM.width / 2, rtol=1e-3)
    first, second = (structure.torsional_frequency(BEAM, n) for n in (1, 2))
    conforms.invariance(second, 3 * first, rtol=1e-6)
    below, at = (structure.tip_twist(BEAM, 0.01, share * first) for share in (0.5, 1))
    assert at > 10 * below


# The plate and its sound.


@pytest.fixture(scope="module")
def heard():
    study = plate_study()
    shape = deflection_shape(PLATE, 1, PLATE.markers, 1e-3)
    omega = resonance_frequency(PLATE, 1)
    return PlateSound.from_shape(PLATE, study.planes, study.medium, omega, shape)


def test_power_grows_with_the_square_of_the_amplitude_and_pressure_with_it(conforms, heard):
    more = 1.1 * heard.reference
    conforms.invariance(heard.power_errors(more), 21, rtol=1e-7)
    rms = np.sqrt(np.mean(np.abs(heard.fields(heard.reference)) ** 2, axis=(1, 2)))
    conforms.invariance(heard.plane_errors(more), 10 * rms / heard.largest, rtol=1e-7)


def test_expected_errors_of_the_sound_are_those_of_many_draws(conforms, heard):
    rng = np.random.default_rng(1)
    sigma = 2e-5 * (1 + rng.random(150))
    drawn = heard.reference + sigma * rng.standard_normal((20_000, 150))
    rms = np.sqrt(np.mean(heard.plane_errors(drawn) ** 2, axis=0))
    conforms.sampled(heard.expected_plane_errors(np.diag(sigma**2)), rms, rtol=0.03)
    power = np.sqrt(np.mean(heard.power_errors(drawn) ** 2))
    conforms.sampled(heard.expected_power_error(np.diag(sigma**2)), power, rtol=0.03)
    same = heard.expected_plane_errors(np.diag(np.full(150, 1e-5**2)))
    percent = 100 * 1e-5 / np.abs(heard.reference).max()
    conforms.sampled(same / percent, heard.independent_ratios, rtol=1e-7)


def test_an_exact_recording_has_exact_deflections_and_sound(conforms):
    study = plate_study(trials=0, cases=["cameras"], camera_counts=[4], modes=[1, 3])
    cube = lab_plate.run(study, films(study))
    conforms.closed_form(float(cube["mean_error"].max()), below=0.02)
    conforms.closed_form(np.nanmax(cube["plane_error"]), below=0.02)
    conforms.closed_form(float(np.abs(cube["power_error"]).max()), below=0.05)
    assert float(cube["missing"].max()) == 0


@pytest.mark.nightly
def test_the_plate_s_trials_scatter_as_is_predicted(conforms, plate_cube):
    drawn = plate_cube.isel(trial=slice(1, None))
    for error, name in (("mean_error", "predicted_error"), ("power_error", "predicted_power_error"),
                        ("plane_error", "predicted_plane_error")):  # fmt: skip
        rms = np.sqrt((drawn[error] ** 2).mean("trial"))
        ratio = (plate_cube[name] / rms).values
        conforms.sampled(ratio[np.isfinite(ratio)], 1, atol=0.3)
        conforms.sampled(np.nanmedian(ratio), 1, atol=0.06)
    conforms.sampled(plate_cube["mean_error"][:, :, 0], plate_cube["predicted_error"], rtol=0.3)


def test_a_missing_marker_is_put_on_a_smooth_surface(conforms):
    x, y = PLATE.markers
    missing = np.zeros(150, bool)
    missing[[17, 80, 81]] = True
    fill = lab_plate.surface_matrix(PLATE.markers, missing)
    plane = 2 + 3 * x - y
    conforms.closed_form(fill @ np.where(missing, 0, plane), plane, atol=1e-9)
    shape = PLATE.mode_shapes([3], PLATE.markers)[0]
    conforms.closed_form(fill @ np.where(missing, 0, shape), shape, atol=0.05)


def test_neighbours_of_noise_are_not_correlated_and_those_of_a_shape_are(conforms):
    grid, noise = (15, 10), np.random.default_rng(0).standard_normal((2000, 150))
    conforms.sampled(abs(lab_plate.neighbour_correlation(noise, grid)), below=0.01)
    conforms.closed_form(lab_plate.neighbour_correlation(np.ones((1, 150)), grid), 1, rtol=1e-6)


@pytest.mark.parametrize(("name", "case"), [("lab-modes", "known"), ("lab-plate", "cameras")])
def test_without_trials_everything_is_still_shown(name, case):
    few = {"camera_counts": [2]} if name == "lab-plate" else {"frame_rates_hz": [120.0]}
    study = validate_request(name, {"trials": 0, "cases": [case], "modes": [2], **few})
    run = lab_modes.run if name == "lab-modes" else lab_plate.run
    cube = finished(run(study, films(study, SIGMA)), study)
    json.dumps(selection.viewer_data(cube))
    assert "<svg" in display.as_svg(cube, case, 2)
    texts = [("parts",), ("conditions",)] if name == "lab-modes" else [("plate", 2), ("ratios",)]
    shown = [display.fill_text(cube, *of) for of in texts]
    assert name == "lab-modes" or "nan" not in "".join(shown)


# Rendered pictures.


@pytest.mark.nightly
def test_a_rendered_plate_without_noise_loses_what_its_markers_average(conforms):
    study = plate_study(cases=["cameras"], camera_counts=[2], modes=[3], trials=0, shot_noise=0,
                        read_noise=0, frames=8)  # fmt: skip
    cube = lab_plate.run(study, lab_plate.EXPERIMENT.load(study))
    shape = cube["reference_deflection"].values[0]
    measured = cube["measured_deflection"].values[0, 0, 0]
    lost = 1 - measured @ shape / (shape @ shape)
    loss = float(cube["marker_loss"][0])
    conforms.closed_form(lost / loss, 1, atol=0.2)
    conforms.closed_form(float(cube["mean_error"].max()), below=0.3)


@pytest.mark.nightly
def test_the_tracker_knows_where_markers_go_between_frames_that_are_far_apart(
    conforms, monkeypatch
):
    # Twice the amplitude that is allowed, nearly two periods from frame to frame.
    study = modes_study(**QUICK, frame_rates_hz=[60.0], torsion_mm=0)
    rig = lab_modes.rigs_of(study)[0]
    parts = (replace(rig.motion.components[0], amplitude=0.003),)
    rig = replace(rig, stations=rig.stations[:1], motion=replace(rig.motion, components=parts))
    (told,) = tracking.track_cameras(rig)
    monkeypatch.setattr(tracking, "Tracker", lambda view, turn: Tracker(view, 0.0))
    (untold,) = tracking.track_cameras(rig)  # which tries the places before, too
    monkeypatch.setattr(tracking, "Tracker", lambda view, turn: Tracker(view, 1e-9))
    (straight_on,) = tracking.track_cameras(rig)
    for found in (told, untold):
        assert found.missing < 0.03
        conforms.closed_form(np.nanmax(found.error(rig, rig.stations[0])), below=1)
    assert straight_on.missing > 5 * told.missing
