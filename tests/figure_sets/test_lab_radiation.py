"""From video to sound: what is asked, the sound of known errors, and recordings rendered again."""

from dataclasses import replace

import numpy as np
import pytest
from refused import refusal
from scenes.sounding import sounding
from scipy.stats import binom, chi2

from thesis_lib.acoustics.estimates import circular
from thesis_lib.acoustics.planes import Plane
from thesis_lib.acoustics.sources import AIR
from thesis_lib.acoustics.surfaces import Surface
from thesis_lib.figure_sets import recorded
from thesis_lib.figure_sets.lab_radiation import compute, figures, recordings, tables, tap
from thesis_lib.figure_sets.lab_radiation.parameters import RECORDED
from thesis_lib.figure_sets.lab_radiation.sound import PLANE, Heard, truth
from thesis_lib.figure_sets.lab_radiation.structures import driven
from thesis_lib.figure_sets.registry import validate
from thesis_lib.laboratory import outlined
from thesis_lib.measure.calibration.zhang import CalibrationError
from thesis_lib.measure.radiation.radiated import Tone, cells_for, radiated
from thesis_lib.studies.attributes import with_provenance
from thesis_lib.vision import lens

PEAK = 1e-3


def study(**values):
    return validate("lab-radiation", values)


def made(request, data):
    return with_provenance(compute.run(request, data), request, 0.0)


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"cases": []}, "cases"),
        ({"cases": ["plate", "plate"]}, "cases"),
        ({"cases": ["drum"]}, "drum"),
        ({"trials": 0}, "trials"),
        ({"azimuths_deg": [30]}, "2 to 6 different numbers"),
        ({"azimuths_deg": [30, 30]}, "azimuths_deg"),
        ({"frame_rate_hz": 46.3}, "shows the tone"),
        ({"exposure_ms": 15}, "exposure_ms"),
        ({"plate_distance_mm": 300}, "plate_distance_mm"),
        ({"beam_distance_mm": 400}, "see the whole structure"),
        ({"plate_distance_mm": 12000}, "at least 1 px high"),
        ({"amplitude_mm": 20}, "amplitude_mm"),
        ({"read_noise": -1}, "read_noise"),
        ({"air_density_kg_m3": 0}, "air_density_kg_m3"),
    ],
)
def test_what_says_nothing_is_refused_in_a_line(values, words):
    assert words in refusal("lab-radiation", **values)


def test_some_of_the_kept_recordings_are_not_rendered():
    whole = study().recordings
    assert study(trials=3, cases=["beam"], air_density_kg_m3=1.0).recordings == whole
    assert study(trials=RECORDED + 1).recordings.trials == RECORDED + 1
    own = study(trials=3, cases=["beam"], width_px=700).recordings
    assert (own.trials, own.cases) == (3, ["beam"])


# The sound.


@pytest.mark.parametrize("case", ["plate", "between", "beam", "l"])
def test_a_part_of_a_motion_is_what_the_force_makes_of_a_mode(case, conforms):
    """Components as they are rendered, summed with their phases, are the response of all modes."""
    own = driven(case)
    points = own.markers.centres
    parts = own.components(PEAK)
    summed = sum(
        one.amplitude * np.exp(1j * one.phase) * one.shape(own.structure, points) for one in parts
    )
    conforms.invariance(summed, PEAK * own.shape(points), rtol=1e-9, atol=1e-12)


def test_a_recording_sounds_as_measure_has_it(conforms):
    """Forms that are made once for all recordings give what :func:`radiated` makes of each."""
    own = driven("beam")
    heard, omega = Heard(own, AIR), 2 * np.pi * own.frequency
    shape = heard.without_noise(PEAK)
    known = circular(shape, np.full(len(shape), 3e-6**2), 1e-3 * shape[None])
    extent = own.structure.extent
    surface = Surface.of(
        np.array(own.corners), cells_for(extent, omega, AIR), (extent[0] / 2, extent[1] / 2)
    )
    planes = PLANE, Plane("YZ", PLANE.half_width, PLANE.bottom, PLANE.top, PLANE.shape)
    point = np.array([[0.0], [0.0], [1.0]])
    one = radiated(surface, heard.between, [Tone(omega)], known, point, planes, AIR).isel(tone=0)
    for name, found in (("power", heard.power(known)), ("efficiency", heard.efficiency(known))):
        conforms.invariance(found.value, one[name], rtol=1e-10)
        conforms.invariance(found.error, one[f"{name}_error"], rtol=1e-10)
    field = (one["field_real"] + 1j * one["field_imag"]).values[0]
    conforms.invariance((heard.matrix @ shape).reshape(PLANE.shape), field, rtol=1e-9)


def test_markers_that_tell_the_motion_tell_the_true_sound(conforms):
    for case in ("plate", "beam"):
        own = driven(case)
        heard, real = Heard(own, AIR), truth(own, PEAK, AIR)
        known = circular(heard.without_noise(PEAK), np.zeros(own.markers.count))
        conforms.independent(float(heard.power(known).value) / real.power, 1, atol=3e-4)
        conforms.independent(float(heard.efficiency(known).value) / real.efficiency, 1, atol=3e-4)
        off = np.sqrt(np.mean(np.abs(heard.matrix @ known.value - real.field) ** 2))
        assert off < 1e-3 * np.abs(real.field).max()


@pytest.mark.slow
def test_errors_of_known_size_come_out(conforms):
    request = study(trials=299, cases=["plate"], width_px=700)
    cube = made(request, sounding(request))
    for name in ("power", "efficiency"):
        of = cube.sel(group="plate", quantity_of=name)
        conforms.sampled(float(of["ratio"]), 1, rtol=0.13)
        assert binom.cdf(int(of["within"]), 300, tables.CHANCE) > 1e-3
    ratio = np.sqrt(np.mean(cube["field_error"] ** 2) / np.mean(cube["field_stated"] ** 2))
    conforms.sampled(float(ratio), 1, rtol=0.1)
    assert float(cube["by_calibration"][0]) > 30
    small = made(request, sounding(request, stated=0.5))
    conforms.sampled(float(small["ratio"].sel(group="all", quantity_of="power")), 2, rtol=0.13)
    assert "fewer than chance" in tables.sentences(small)
    assert "not as large as stated" in tables.sentences(small)


@pytest.mark.slow
def test_more_markers_tell_more_of_a_tone_between_modes():
    request = study(trials=1, cases=["plate"], width_px=700)
    cube = made(request, sounding(request))
    off = np.abs(cube["grid_interpolation"].values)
    assert off[0] > 1
    assert off[-1] < 0.05
    assert (np.diff(cube["grid_left"].values) < 0).all()
    assert (np.diff(cube["grid_spacing"].values) < 0).all()


@pytest.mark.slow
def test_errors_of_a_tap_s_powers_and_energies_are_what_draws_scatter_by(conforms, monkeypatch):
    """Six taps that differ by their noise; the first is the one that the cube has."""
    rig_of, off = tap.rig_of, []
    for seed in range(6):
        monkeypatch.setattr(
            tap, "rig_of", lambda *of, seed=seed: replace(rig_of(*of), seed=1000 + seed)
        )
        made = tap.of_tap(study(), 0.011, AIR)
        conforms.sampled(made["tap_all"] / made["tap_true_power"].sum(), 1, atol=0.08)
        off += [
            (made[f"tap_{of}"] - made[f"tap_true_{of}"]) / made[f"tap_{of}_error"]
            for of in ("power", "energy")
        ]
    ratio = float(np.sqrt(np.mean(np.square(off))))
    conforms.sampled(ratio, 1, atol=0.35)  # of 36, which are not independent
    whole = made["tap_heard"].sum(axis=0)
    assert np.abs(whole[:250]).max() > 2 * np.abs(whole[-250:]).max()
    hidden = tap.of_tap(study(), 3.0, AIR)  # px
    assert np.isnan(hidden["tap_power"]).all()
    assert {name: np.shape(of) for name, of in hidden.items()} == {
        name: np.shape(of) for name, of in made.items()
    }


@pytest.mark.slow
def test_figures_and_tables_take_some_of_the_structures():
    request = study(trials=2, cases=["l", "beam", "plate"], width_px=700)
    data = sounding(request)
    data["amplitude_real"][1, 2] = np.nan  # of a recording without a result
    cube = made(request, data)
    assert cube["count"].values.tolist() == [3, 2, 3, 8]
    drawn = figures.structures, figures.powers, figures.field, figures.tap, figures.markers
    for draw in drawn:
        assert draw(cube).axes
    shown = [
        tables.results(cube),
        tables.efficiency_table(cube).data,
        tables.parts_table(cube).data,
        tables.tap(cube),
    ]
    assert all("nan" not in text and text.count("\n") >= 3 for text in shown)


# Recordings.


def test_a_narrow_structure_is_found_by_its_corners():
    """In one picture alone, rounded corners of a beam leave its perspective open."""
    film, own = study().recordings, driven("beam")
    for recording in range(4):
        rig = recordings.rig_of(film, "beam", recording)
        for camera, view in zip(
            rig.cameras, outlined.marked(rig, rig.cameras, own.corners), strict=True
        ):
            there = lens.project(camera, own.markers.world)
            off = np.hypot(*(view.to_image(own.markers.centres) - there))
            assert off.max() < 1.5


def test_cameras_that_find_no_board_have_no_result(monkeypatch):
    def none(_):
        raise CalibrationError("no board")

    monkeypatch.setattr(outlined, "calibrated", none)
    request = study(trials=1, cases=["beam"], width_px=700)
    data = recordings.measured(request.recordings, "beam", 0)
    assert all(np.isnan(values).all() for values in data.data_vars.values())


def test_a_run_that_was_stopped_goes_on(monkeypatch, tmp_path):
    request = study(trials=1, cases=["beam", "plate"], width_px=700).recordings
    monkeypatch.setattr(recordings, "workplace", lambda: tmp_path)
    whole, asked = sounding(study(trials=1, cases=["beam", "plate"], width_px=700)), []

    def measured(film, case, recording):
        asked.append((case, recording))
        if len(asked) == 3:
            raise KeyboardInterrupt
        return whole.isel(case=film.cases.index(case), trial=recording)

    monkeypatch.setattr(recordings, "measured", measured)
    with pytest.raises(KeyboardInterrupt):
        recordings.run(request)
    before = len(asked)
    data = recordings.run(request)
    assert len(asked) < before + 4
    np.testing.assert_allclose(data["amplitude_real"], whole["amplitude_real"], rtol=1e-6)


@pytest.fixture(scope="module")
def kept():
    (of,) = recorded.behind(study())
    data = of.kept()
    assert data is not None, "of other code: `thesis record`"
    return of, data


def test_none_of_the_kept_recordings_lost_a_marker(kept):
    _, data = kept
    assert dict(data.sizes) == {"case": 4, "trial": RECORDED + 1, "row": 2, "point": 96}
    assert float(data["missing"].max()) == 0
    assert float(data["board_views"].min()) > 0.8
    assert float(data["shared_kept"].min()) > 0.95


@pytest.mark.slow
def test_two_standard_errors_hold_what_they_should(kept):
    """Of 160 recordings: as many within, and errors as large, as chance allows once in a hundred.

    The errors are then within a tenth of what is stated.
    """
    cube = compute.run(study(), kept[1])
    of = cube.sel(group="all", quantity_of="power")
    count = int(of["count"])
    assert count == 4 * (RECORDED + 1)
    assert int(of["within"]) >= binom.ppf(0.01, count, tables.CHANCE)
    assert 0.9 < float(of["ratio"]) < 1.1
    for case in cube["structure"].values:
        own = cube.sel(group=case, quantity_of="power")
        n = int(own["count"])
        assert int(own["within"]) >= binom.ppf(0.01 / 4, n, tables.CHANCE), case
        low, high = np.sqrt(chi2.ppf([0.01 / 8, 1 - 0.01 / 8], n) / n)
        assert low < float(own["ratio"]) < high, case


@pytest.mark.slow
def test_a_recording_rendered_now_is_the_one_that_was_kept(kept):
    """One of those that are data, another in each run."""
    of, data = kept
    draw = np.random.default_rng()
    case, trial = (int(draw.integers(data.sizes[name])) for name in ("case", "trial"))
    own = data.isel(case=case, trial=trial)
    now = recordings.measured(of.request, of.request.cases[case], trial)
    scatter = float(own["scatter"].mean())
    for name in ("amplitude_real", "amplitude_imag"):
        np.testing.assert_array_equal(np.isnan(now[name]), np.isnan(own[name]))
        off = np.abs(now[name] - own[name])
        assert not (off > 1e-4 * np.abs(own[name]) + 0.1 * scatter).any(), (case, trial, name)
    np.testing.assert_allclose(now["scatter"], own["scatter"], rtol=0.1)
    for name in ("missing", "board_views"):
        np.testing.assert_allclose(now[name], own[name], atol=0.01, err_msg=f"{case}, {trial}")
