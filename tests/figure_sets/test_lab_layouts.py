"""Where cameras stand: the laws by their closed forms, the trials by renders with other noise."""

import re
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
import xarray as xr
from refused import assert_refused
from scenes.layouts import layouts

from thesis_lib.facts import setups
from thesis_lib.figure_sets import display as figure_sets_display
from thesis_lib.figure_sets.display import as_svg
from thesis_lib.figure_sets.lab_layout import compute as ls
from thesis_lib.figure_sets.lab_layout import fits, tables
from thesis_lib.figure_sets.lab_layout import optima as numbers
from thesis_lib.figure_sets.lab_layout import recordings as film
from thesis_lib.figure_sets.lab_layout.parameters import LabElevation, LabLayout
from thesis_lib.figure_sets.registry import validate
from thesis_lib.laboratory.direct import times_of
from thesis_lib.laboratory.direct import true_centres as centres_at
from thesis_lib.laboratory.localisation import edge_scatter
from thesis_lib.laboratory.render import BeamView, Sensor
from thesis_lib.measure.fitting.harmonics import amplitude
from thesis_lib.measure.recordings.markers import on_surface
from thesis_lib.measure.tracking.homography import view_of
from thesis_lib.measure.tracking.tracker import Tracker, sharpen
from thesis_lib.studies.attributes import with_provenance
from thesis_lib.vibration.motion import amplitudes
from thesis_lib.vision import lens

OMEGA = 2 * np.pi * 4.25
PLAIN = {"lens_k1": 0.0, "exposure_ms": 0.01}


def true_centres(rig, station):
    """Where a camera has the markers in all of its frames."""
    return centres_at(rig, station, times_of(rig, station))


def elevation(**values):
    return validate("lab-elevation", {"trials": 40, **PLAIN, **values})


def layout(**values):
    return validate("lab-layout", {"trials": 40, "distance_mm": 600, **PLAIN, **values})


def spread_of(rig):
    """What the fit leaves of noise in the part of an amplitude that is in phase, about √(2/N)."""
    times = times_of(rig, rig.stations[0])
    return np.sqrt(2 / np.count_nonzero(times >= rig.motion.steady))


# The law of the geometry.


@pytest.mark.parametrize("azimuth", [10.0, 45.0])
def test_error_at_the_centre_is_that_of_the_closed_form(conforms, azimuth):
    study = elevation(elevations_deg=[5.0, 22.0, 45.0, 60.0], azimuth_deg=azimuth, distance_mm=800)
    for setting in study.settings()[:4]:
        rig = film.rig_of(study, setting)
        sigma = fits.law(rig, range(4), OMEGA, [0.01, 0.01])[12]
        focal = np.mean([camera.K[0, 0] for camera in rig.cameras])
        at_centre = 0.01 * spread_of(rig) * 0.8 / focal / (2 * np.cos(np.radians(setting.value)))
        # A period is no whole number of frames, and the focal lengths differ by half a percent.
        conforms.closed_form(sigma, at_centre, rtol=0.05)


def test_the_law_falls_like_the_reciprocal_cosine(conforms):
    study = elevation(elevations_deg=[1.0, 30.0, 60.0])
    errors = [fits.law(film.rig_of(study, s), range(4), OMEGA, [0.0, 0.01])[12]
              for s in study.settings()[:3]]  # fmt: skip
    conforms.order(
        np.array(errors) / errors[0],
        np.cos(np.radians(1.0)) / np.cos(np.radians([1.0, 30.0, 60.0])),
        rtol=2e-3,
    )


def test_the_law_grows_like_the_distance(conforms):
    study = layout(cases=["distance"], distances_mm=[1000.0, 4000.0])
    near, far = (fits.law(film.rig_of(study, s), range(2), OMEGA, [0.01, 0.01])[12]
                 for s in study.settings())  # fmt: skip
    conforms.order(far / near, 4, rtol=1e-3)


def test_no_camera_that_is_added_worsens_the_law():
    study = layout(cases=["subsets"])
    rig = film.rig_of(study, study.filmed_settings()[0])
    every = {chosen: np.mean(fits.law(rig, chosen, OMEGA, [0.01, 0.01]) ** 2)
             for n in range(2, 9) for chosen in combinations(range(8), n)}  # fmt: skip
    assert len(every) == 247
    for chosen, variance in every.items():
        for one in set(range(8)) - set(chosen):
            assert every[tuple(sorted((*chosen, one)))] < variance


@pytest.mark.parametrize("turn", [180.0, 0.0])
def test_layouts_that_a_symmetry_maps_onto_each_other_have_the_same_law(conforms, turn):
    first = [(20.0, 20.0), (100.0, 35.0), (-70.0, 50.0)]
    other = [((a + 180.0 if turn else -a), e) for a, e in first]  # a turn, or a mirror image
    both = []
    for directions in (first, other):
        study = layout(cases=["subsets"], directions_deg=directions, distance_mm=800)
        rig = film.rig_of(study, study.filmed_settings()[0])
        both.append(
            fits.law(rig, range(3), OMEGA, [0.01, 0.005])[:: -1 if directions is other else 1]
        )
    # The principal points differ from camera to camera, which no symmetry maps.
    np.testing.assert_allclose(*both, rtol=1e-3)
    study = layout(cases=["subsets"], directions_deg=first[::-1], distance_mm=800)
    backwards = film.rig_of(study, study.filmed_settings()[0])
    conforms.invariance(fits.law(backwards, range(3), OMEGA, [0.01, 0.005]), both[0], rtol=0.02)


# The law of the edges.


def test_scatter_of_a_circle_and_of_a_line_by_their_closed_forms(conforms):
    sensor = Sensor()
    scale = (2 * np.sqrt(np.pi) * np.sqrt(0.36 + 1 / 12) * (0.05 * 115 + 1 + 1 / 12)) / 170**2
    conforms.closed_form(edge_scatter(8, 8, sensor) ** 2, scale / (np.pi * 4), rtol=1e-12)
    flat = edge_scatter(8, 1e-3, sensor)
    conforms.closed_form(flat[1] ** 2, scale / 16, rtol=1e-4)  # two edges, each as long as wide
    conforms.closed_form(flat[0], above=100 * flat[1])
    conforms.invariance(edge_scatter(8, 3, sensor), edge_scatter(3, 8, sensor)[::-1], rtol=1e-7)
    conforms.closed_form(edge_scatter(32, 12, sensor), edge_scatter(8, 3, sensor) / 2, rtol=1e-7)
    loud = replace(sensor, shot=0.0, read=np.sqrt(4 * (0.05 * 115 + 1 + 1 / 12) - 1 / 12))
    conforms.closed_form(edge_scatter(8, 3, loud), 2 * edge_scatter(8, 3, sensor), rtol=1e-7)


def test_tracked_centres_scatter_as_the_edges_say(conforms):
    study = elevation(elevations_deg=[40.0], cases=["three-rows"], width_px=1200)
    rig = film.rig_of(study, study.filmed_settings()[0])
    station, _ = film.window_of(rig, rig.stations[0])
    camera, markers = station.camera, rig.markers
    length, width = markers.extent
    plane = np.array([[0, length, length, 0], [0, 0, width, width]])
    view = view_of(camera, markers, lens.project(camera, on_surface(markers.extent, plane)))
    light = BeamView(camera, markers, rig.motion, station.sensor).light(0.0)
    view = sharpen(light.recorded(station.sensor), view)
    found = np.array([
        Tracker(view).centres(light.recorded(station.sensor, np.random.default_rng(k)))
        for k in range(10)
    ])[:, :, markers.middle_row]  # fmt: skip
    scatter = found.std(axis=0, ddof=1)[:, 8:17]  # near the centre
    across = camera.K[0, 0] / 0.57 * markers.diameter
    law = edge_scatter(across, across * np.sin(np.radians(40)), station.sensor)
    conforms.sampled(np.sqrt(np.mean(scatter**2, axis=1)) / law, 1.0, atol=0.2)


# Filming.


def test_a_part_of_the_sensor_sees_the_same(conforms):
    study = elevation(elevations_deg=[12.0], cases=["three-rows"])
    rig = film.rig_of(study, study.filmed_settings()[0])
    for station in rig.stations:
        part, corner = film.window_of(rig, station)
        moved = replace(rig, stations=(part,))
        conforms.invariance(
            true_centres(moved, part) + corner[:, None], true_centres(rig, station), rtol=1e-7
        )
        inside = true_centres(moved, part)
        assert inside.min() > 15
        assert np.all(inside.max(axis=(0, 2)) < np.array(part.camera.size) - 15)
        assert part.camera.size[1] < station.camera.size[1] / 4


@pytest.mark.slow
def test_frames_are_the_same_whoever_asks_and_quiet_ones_are_without_noise(conforms):
    silent = {"shot_noise": 0.0, "read_noise": 0.0}
    study = elevation(elevations_deg=[40.0], cases=["middle-row"], width_px=800, **silent)
    rig = film.rig_of(study, study.filmed_settings()[0])
    noisy, quiet = film.tracks(rig, 0)
    again = film.tracks(rig, 0)
    np.testing.assert_array_equal(noisy, again[0])
    np.testing.assert_array_equal(quiet, again[1])
    known = np.isfinite(quiet)
    assert known[:, 0].any(axis=1).mean() > 0.5  # at rest and in the steady period
    conforms.invariance(
        np.abs(noisy[known] - quiet[known]).max(), below=0.01
    )  # what steps of the fit leave
    conforms.invariance(np.sqrt(np.mean((noisy[known] - quiet[known]) ** 2)), below=1e-3)
    off = np.hypot(*np.moveaxis(quiet - true_centres(rig, rig.stations[0]), 1, 0))
    conforms.closed_form(np.nanmax(off), below=0.1)


def test_markers_of_the_middle_row_are_the_same_in_all_cases(conforms):
    beam = setups.beam()
    for case in ("three-rows", "middle-row", "coarse"):
        markers = film.markers_of(beam, case)
        conforms.closed_form(markers.centres[:, markers.middle_row], beam.markers, rtol=1e-7)
    assert film.markers_of(beam, "middle-row").count == 29
    assert film.markers_of(beam, "middle-row").hole is None


@pytest.fixture(scope="module")
def flat():
    """Cameras so low that no marker is found, and ones that find them, filmed."""
    study = elevation(elevations_deg=[3.0, 40.0], cases=["middle-row"], width_px=800, trials=5)
    data = film.run(study)
    return study, data, with_provenance(ls.run(study, data), study, 0.0)


def test_lost_markers_are_said_and_not_hidden(flat):
    study, data, cube = flat
    low, high = cube.isel(setting=0), cube.isel(setting=1)
    for name in ("measured_deflection", "mean_error", "max_point_error", "noise_error", "mac",
                 "bias_error", "centre_scatter", "wrong"):  # fmt: skip
        assert np.isnan(low[name]).all(), name
        assert np.isfinite(high[name]).all(), name
    assert float(low["lost"]) == 1
    np.testing.assert_array_equal(low["missing"], 1)
    assert float(high["lost"]) == 0
    np.testing.assert_array_equal(high["missing"], 0)
    assert np.isfinite(cube["predicted_error"]).all()  # which needs no marker to be found
    assert "middle-row, 3°" in tables.failures(cube)
    assert "| middle-row | 3° | — | — |" in tables.errors(cube)
    assert "| 100% |" in tables.errors(cube)
    figure_sets_display.figure(cube, "middle-row", 1)
    again = with_provenance(ls.run(study, data), study, 0.0)
    xr.testing.assert_identical(again.drop_attrs(deep=False), cube.drop_attrs(deep=False))


@pytest.mark.parametrize("name", ["lab-elevation", "lab-layout"])
@pytest.mark.slow
def test_renders_with_other_noise_scatter_as_the_trials_do(conforms, name):
    own = (
        {"cases": ["middle-row"], "elevations_deg": [35.0], "azimuth_deg": 10}
        if name == "lab-elevation"
        else {"cases": ["aperture"], "half_apertures_deg": [30.0], "elevation_deg": 40.0}
    )
    values = {"width_px": 640, "frame_rate_hz": 34, "trials": 0, "distance_mm": 600, **own}
    filmed, foreseen = [], []
    for seed in range(2 if name == "lab-elevation" else 4):
        study = validate(name, {**values, "seed": seed})
        recording = study.filmed_settings()[0]
        data = film.run(study)
        rec = fits.measured(study, recording, data["tracks"].values[0], data["quiet"].values[0])
        row = rec.rig.markers.middle_row
        phase = np.angle(amplitudes(rec.rig.motion, rec.rig.markers.centres, 4.25)[row][-1])
        shapes = [np.real(amplitude(fit, OMEGA, 1e-3)[row] * np.exp(-1j * phase))
                  for fit in (rec.noisy, rec.quiet)]  # fmt: skip
        gains = fits.noise_gain(rec.noisy, OMEGA, 1e-3, rec.roots, row)
        filmed.append(np.mean((shapes[0] - shapes[1]) ** 2))
        foreseen.append(np.mean(np.sum(gains**2, axis=(0, 1))))
    ratio = np.sqrt(np.mean(filmed) / np.mean(foreseen))
    conforms.sampled(ratio, 1, atol=0.25)  # 50 and 100 errors of unequal markers


# Cubes from exact centres.


SIGMA = 0.02


@pytest.fixture(scope="module")
def sets():
    study = layout(cases=["subsets"], trials=40)
    data = layouts(study, SIGMA)
    return study, data, with_provenance(ls.run(study, data), study, 0.0)


def test_exact_centres_give_exact_shapes(conforms):
    for study in (elevation(elevations_deg=[7.0, 60.0]), layout(cases=["distance", "aperture"])):
        cube = ls.run(study, layouts(study))
        for name in ("mean_error", "max_point_error", "bias_error", "noise_error"):
            conforms.closed_form(cube[name], 0, atol=2e-4)
        conforms.closed_form(cube["mac"], 1, rtol=1e-7)
        for variable in cube.variables.values():
            assert {"units", "long_name"} <= set(variable.attrs)


@pytest.mark.slow
def test_with_one_noise_for_all_the_law_is_what_the_scatter_says(conforms, sets):
    _, _, cube = sets
    assert cube.sizes["setting"] == 247
    conforms.sampled(cube["centre_scatter"], SIGMA, rtol=0.1)
    ratio = cube["noise_error"].values / cube["predicted_error"].values
    conforms.sampled(ratio, 1, atol=0.15)
    drawn = np.sqrt((cube["mean_error"].isel(trial=slice(1, None)) ** 2).mean("trial"))
    conforms.sampled(drawn, cube["noise_error"], rtol=0.2)
    literal = cube["mean_error"].isel(trial=0).values / cube["noise_error"].values
    conforms.sampled(np.sqrt(np.mean(literal**2)), 1, atol=0.25)


@pytest.mark.slow
def test_a_setting_is_the_same_in_every_request(sets):
    _, data, cube = sets
    few = ls.run(layout(cases=["subsets"], trials=7), data)
    np.testing.assert_array_equal(
        few["measured_deflection"], cube["measured_deflection"].isel(trial=slice(8))
    )
    one = elevation(elevations_deg=[40.0], cases=["coarse"])
    more = elevation(elevations_deg=[20.0, 40.0], cases=["three-rows", "coarse"], trials=60)
    alone, among = (ls.run(study, layouts(study, SIGMA)) for study in (one, more))
    np.testing.assert_array_equal(
        alone["measured_deflection"].values[0],
        among["measured_deflection"].isel(setting=3, trial=slice(41)),
    )


def test_a_trial_depends_on_seed_number_and_camera_alone(conforms):
    few, many = ls.draws(layout(trials=2), 2, 25), ls.draws(layout(trials=5), 4, 25)
    np.testing.assert_array_equal(few, many[:2, :2])
    assert not np.any(ls.draws(layout(trials=2, seed=1), 2, 25) == few)
    conforms.sampled(ls.draws(layout(trials=200), 2, 25).std(), 1, atol=0.01)


def test_trials_keep_the_bias_and_have_the_noise_once(conforms):
    study = elevation(elevations_deg=[30.0], cases=["three-rows"], trials=300)
    data = layouts(study, SIGMA)
    at_rest = data["quiet"].isel(frame=0)
    for name in ("tracks", "quiet"):  # every camera sees the motion larger by a hundredth
        data[name] = data[name] + 0.01 * (data[name] - at_rest)
    cube = ls.run(study, data)
    reference = cube["reference_deflection"].values[0]
    expected = 100 * np.sqrt(np.mean((0.01 * reference) ** 2)) / np.abs(reference).max()
    conforms.sampled(cube["bias_error"].item(), expected, rtol=0.05)
    total = float(np.sqrt((cube["mean_error"].isel(trial=slice(1, None)) ** 2).mean()))
    both = np.hypot(cube["bias_error"].values, cube["noise_error"].values).item()
    conforms.sampled(total, both, rtol=0.05)


def test_markers_that_lean_and_shrink_have_noise_of_their_own(conforms):
    study = elevation(elevations_deg=[30.0], cases=["middle-row"])
    data = layouts(study, 0.0)
    rig = film.rig_of(study, study.filmed_settings()[0])
    row = rig.markers.middle_row
    rng = np.random.default_rng(1)
    root = np.array([[0.03, 0.0], [0.02, 0.01]])
    white = rng.standard_normal(data["tracks"].values[0, :, :, :, row].shape)
    data["tracks"].values[0, :, :, :, row] += np.einsum("ij,cfjm->cfim", root, white)
    rec = fits.measured(
        study, study.filmed_settings()[0], data["tracks"].values[0], data["quiet"].values[0]
    )
    covariance = np.einsum("cijm,ckjm->ik", rec.roots, rec.roots) / (4 * 25)
    conforms.sampled(covariance, root @ root.T, rtol=0.1)
    conforms.sampled(rec.scatter, [np.sqrt(np.diag(root @ root.T))] * 4, rtol=0.1)


def test_centres_of_other_markers_count_as_wrong_and_not_as_scatter(conforms):
    study = elevation(elevations_deg=[30.0], cases=["three-rows"])
    data = layouts(study, 0.01)
    row = film.rig_of(study, study.filmed_settings()[0]).markers.middle_row
    data["tracks"].values[0, 0, 10:20, 0, row.start] += 5.0  # one marker of one camera
    data["tracks"].values[0, 1, 3:7, :, row.start + 1] = np.nan
    frames = data.sizes["frame"]
    cube = ls.run(study, data)
    conforms.closed_form(cube["wrong"].item(), 10 / (4 * 25 * frames), rtol=0.01)
    conforms.closed_form(cube["lost"].item(), 4 / (4 * 25 * frames), rtol=0.01)
    conforms.sampled(cube["centre_scatter"], 0.01, rtol=0.1)
    text = tables.failures(cube)
    assert "taken for others in: three-rows, 30°" in text


# What the cubes come to.


def test_the_optimum_of_a_curve_is_between_its_settings(conforms):
    x = np.array([5.0, 8, 12, 20, 30, 45, 60])
    curve = np.exp((np.log(x) - np.log(17)) ** 2)
    best = numbers.optimum(x, curve)
    conforms.closed_form(best.at, 17, rtol=0.03)
    conforms.closed_form(best.error, 1, rtol=0.01)
    reach = np.exp(np.sqrt(np.log(numbers.NEAR)))
    conforms.closed_form(best.low, 17 / reach, rtol=0.06)
    conforms.closed_form(best.high, 17 * reach, rtol=0.06)
    again = numbers.optimum(np.append(x[::-1], 3.0), np.append(curve[::-1], np.nan))
    assert again == best  # in any order, and without what is not known
    assert numbers.optimum(x[:2], curve[:2]) is None
    falling = numbers.optimum(x, x)
    conforms.closed_form((falling.at, falling.low), (5.0, 5.0), rtol=1e-6)


def test_settings_with_missing_markers_are_no_optimum():
    study = elevation(elevations_deg=[10.0, 20.0, 40.0, 60.0], cases=["three-rows"])
    cube = ls.run(study, layouts(study, SIGMA, lost=[0]))
    part = numbers.part_of(cube, "three-rows")
    assert numbers.complete(part)["value"].values.tolist() == [20, 40, 60]
    best = numbers.optimum(part["value"].values, numbers.expected(part))
    assert best.low >= 20 - 1e-9  # nothing is said beyond


@pytest.mark.slow
def test_tables_and_figures_show_every_case(sets):
    _, _, cube = sets
    part = numbers.part_of(cube, "subsets")
    error = numbers.expected(part)
    best = str(part["label"].values[np.argmin(np.where(part["n_cameras"] == 2, error, np.inf))])
    text = tables.numbers(cube)
    assert f"| 2 | 28 | {best}: " in text
    alone = r"from one side alone it is better than \d of the 8 of 3, \d of the 2 of 4"
    assert re.search(alone, text)
    assert tables.shares(cube).count("| 120 |") == 8
    assert tables.TABLES["slopes"](cube) == "The case distance was not asked for.\n"
    few = numbers.viewable(cube)
    assert few["n_cameras"].values.tolist() == sorted(few["n_cameras"].values.tolist())
    assert few.sizes["setting"] == 13  # best and worst of two to seven, and all eight
    figure_sets_display.figure(cube, "subsets", 1)
    other = layout(cases=["distance", "aperture"], trials=0)
    sweeps = with_provenance(ls.run(other, layouts(other, SIGMA)), other, 0.0)
    for case in ("distance", "aperture"):
        first = as_svg(sweeps, case, 1)
        assert first == as_svg(sweeps, case, 1)
    assert numbers.viewable(sweeps).sizes == sweeps.sizes
    for name in tables.TABLES:
        if name != "optima":
            assert "nan" not in tables.TABLES[name](sweeps)
    assert sweeps["parameter"].values.tolist() == ["distance_mm"] * 4 + ["aperture_deg"] * 4


def test_no_markers_at_all_draw_and_tell_all_the_same():
    study = layout(trials=3, directions_deg=LabLayout().directions_deg[:3])
    cube = with_provenance(ls.run(study, layouts(study, SIGMA, lost=range(9))), study, 0.0)
    for case in study.cases:
        figure_sets_display.figure(cube, case, 1)
    for name in tables.TABLES:
        tables.TABLES[name](cube)
    numbers.viewable(cube)


# Requests.


@pytest.mark.parametrize("name", ["lab-elevation", "lab-layout"])
@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"frequency_hz": 8}, ["frequency_hz: given 8", "an eighth of the frame rate"]),
        ({"frequency_hz": 0.5}, ["frequency_hz: given 0.5", "from 1"]),
        ({"exposure_ms": 17}, ["exposure_ms: given 17", "time between frames", "ms"]),
        ({"exposure_ms": 0}, ["exposure_ms: given 0", "above 0"]),
        ({"distance_mm": 300}, ["distance_mm: given 300", "reach"]),
        ({"distance_mm": 400}, ["distance_mm: given 400", "see the whole beam"]),
        ({"focal_length_mm": 50}, ["distance", "see the whole beam"]),
        ({"amplitude_mm": 7}, ["amplitude_mm: given 7", "at most 6"]),
        ({"periods": 0}, ["periods: given 0", "1 to 20"]),
        ({"width_px": 200}, ["width_px: given 200", "320 to 1920"]),
        ({"width_px": 640.5}, ["width_px: given 640.5", "whole number"]),
        ({"lens_k1": -1}, ["lens_k1: given -1", "-0.3 to 0.3"]),
        ({"shot_noise": -0.1}, ["shot_noise: given -0.1", "from 0 to 50"]),
        ({"cases": []}, ["cases: given []"]),
        ({"cases": ["best"]}, ["cases", 'given "best"']),
        ({"trials": -1}, ["trials: given -1", "0 to 10000"]),
        ({"seed": 2**63}, ["seed: given", "2^63"]),
        ({"azimuth_deg": 0}, ["azimuth_deg: given 0", "above 0"]),
        ({"modes": [2]}, ["no parameter modes"]),
        ({"cube": "x.txt"}, ['cube: given "x.txt"', ".nc"]),
        ({"frequency_hz": float("nan")}, ["frequency_hz"]),
    ],
)
def test_silly_parameters_are_refused_in_one_line(name, values, words):
    assert_refused(name, values, words)


@pytest.mark.parametrize(
    ("name", "values", "words"),
    [
        ("lab-elevation", {"elevations_deg": [0.5]}, ["elevations_deg[0]: given 0.5", "1 to 80"]),
        ("lab-elevation", {"elevations_deg": [81]}, ["elevations_deg[0]: given 81", "1 to 80"]),
        ("lab-elevation", {"elevations_deg": []}, ["elevations_deg: given []"]),
        ("lab-elevation", {"elevations_deg": [9, 9]}, ["elevations_deg: given [9.0, 9.0]"]),
        ("lab-elevation", {"coarse_width_px": 100}, ["coarse_width_px: given 100"]),
        ("lab-layout", {"distances_mm": [300]}, ["distances_mm: given 300", "reach"]),
        ("lab-layout", {"distances_mm": [420]}, ["distances_mm: given 420", "case distance"]),
        ("lab-layout", {"half_apertures_deg": [180]}, ["half_apertures_deg[0]: given 180"]),
        ("lab-layout", {"directions_deg": [[10, 20]]}, ["directions_deg: given [[10", "2 to 8"]),
        ("lab-layout", {"directions_deg": [[10, 20], [370, 20]]}, ["directions_deg", "370"]),
        ("lab-layout", {"directions_deg": [[10, 20], [350, 20], [-10, 20]]},
         ["directions_deg: given [[10", "different"]),
        ("lab-layout", {"directions_deg": [[10, 20], [50, 0]]}, ["directions_deg[1][1]: given 0"]),
        ("lab-layout", {"directions_deg": [[10 * k, 22] for k in range(9)]}, ["2 to 8"]),
        ("lab-layout", {"directions_deg": [[10, 22], [90, 60]]}, ["see the whole beam", "subsets"]),
        ("lab-layout", {"elevation_deg": 60}, ["see the whole beam", "case aperture, 110°"]),
    ],
)  # fmt: skip
def test_silly_places_are_refused_in_one_line(name, values, words):
    assert_refused(name, values, words)


def test_a_case_that_is_not_run_refuses_nothing():
    validate("lab-layout", {"cases": ["subsets"], "distances_mm": [420]})
    validate("lab-layout", {"cases": ["distance"], "distance_mm": 330, "elevation_deg": 30})


def test_what_is_filmed_does_not_depend_on_the_trials():
    one, other = elevation(trials=3), elevation(trials=99, cube="a.nc")
    assert one.recordings == other.recordings
    assert one.recordings.digest == other.recordings.digest
    assert elevation(seed=1).recordings.digest != one.recordings.digest
    assert len(LabLayout().filmed_settings()) == 9
    assert len(LabLayout().settings()) == 255
    assert len(LabElevation().filmed_settings()) == len(LabElevation().settings()) == 27
