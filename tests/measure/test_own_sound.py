"""The sound of a measurement: from shapes with errors to levels with errors, files, refusals."""

import json
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from pydantic import ValidationError
from scipy.io import wavfile

from thesis_lib.acoustics import estimates
from thesis_lib.acoustics.surfaces import Screen, Surface
from thesis_lib.facts import setups
from thesis_lib.measure.radiation import of_measurement, radiated
from thesis_lib.measure.radiation.of_measurement import sound_of
from thesis_lib.measure.radiation.radiated import group_octaves
from thesis_lib.measure.recordings.manifest import Manifest
from thesis_lib.measure.recordings.validation import ChainError
from thesis_lib.measure.report.build import build_sound
from thesis_lib.studies.cubes import complex_of
from thesis_lib.vibration.structure import deflection_shape, resonance_frequency

PLATE = setups.thesis_plate((9, 6))
OMEGA = resonance_frequency(PLATE, 1)
TRUE = deflection_shape(PLATE, 1, PLATE.markers, 1e-3) * np.exp(0.7j)
OUTLINE = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * PLATE.extent
SURFACE = Surface.from_outline(OUTLINE, 1600, (PLATE.length / 2, PLATE.width / 2))
NOISE, COMMON = 4e-6, 1e-3  # m of a marker; of all together, relative
POINTS = np.array([[0.0, 0.3], [0.0, 0.2], [1.0, 0.5]])
CAMERAS = [
    {"name": name, "video": f"{name}.mp4", "exposure_s": 0.001, "board_images": name}
    for name in "AB"
]


def manifest(radiation=None, excitation=None, **structure):
    plate = {
        "kind": "plate", "length_mm": 668, "width_mm": 443, "thickness_mm": 19.8,
        "density_kg_m3": 7200, "youngs_modulus_pa": 1.4e11, "poissons_ratio": 0.31,
        "markers": {"columns": 9, "rows": 6, "spacing_mm": 668 / 9, "row_spacing_mm": 443 / 6,
                    "diameter_mm": 1},
    }  # fmt: skip
    values = {"structure": plate | structure, "cameras": CAMERAS, "radiation": radiation or {}}
    values |= {"excitation": excitation} if excitation else {}
    return Manifest.model_validate_json(json.dumps(values))


def measurement(shape=TRUE, noise=NOISE):
    """What a measurement would be, of a shape."""
    n = len(shape)
    each = dict.fromkeys(["standard_error", "error_of_scatter"], ("marker", np.full(n, noise)))
    common = COMMON * shape[None]
    values = each | {
        "amplitude_real": ("marker", shape.real), "amplitude_imag": ("marker", shape.imag),
        "deflection": ("marker", np.abs(shape)), "in_plane_excess": 0.9, "grid_scale": 1.0,
        "frequency": OMEGA / 2 / np.pi, "rest_position": (("axis", "marker"), np.zeros((3, n))),
        "shared_real": (("row", "marker"), common.real),
        "shared_imag": (("row", "marker"), common.imag),
    }  # fmt: skip
    return xr.Dataset(values, {"axis": ["x", "y", "z"]})


def exact():
    """Power of the true shape by Rayleigh's sum over 3600 cells."""
    fine = Surface.from_outline(OUTLINE, 3600)
    w = deflection_shape(PLATE, 1, fine.places, 1e-3)
    return float(np.ravel(fine.power_form(w[:, None], OMEGA))[0])


@pytest.fixture(scope="module", autouse=True)
def small_planes():
    """Fields on a few points, which no test looks at by itself: what takes most of the time."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(of_measurement, "PLANE_SHAPE", (3, 2))
        yield


TWO_POINTS = manifest({"points_mm": [[0, 0, 1000], [300, 200, 500]]})


@pytest.fixture(scope="module")
def made():
    return sound_of(measurement(), TWO_POINTS)


@pytest.fixture(scope="module")
def faster():
    return sound_of(measurement().assign(frequency=800.0), manifest())


def test_power_and_pressures_are_those_of_the_true_shape(made, conforms):
    conforms.closed_form(float(made["power"][0]) / exact(), 1, atol=5e-4)
    assert made.attrs["between"] == "model"
    assert made["level"].shape == (1, 2)
    level = 10 * np.log10(made["power"].values / 1e-12)
    conforms.invariance(made["power_level"].values, level, rtol=1e-12)
    assert float(made["left"][0]) < 1e-3


@pytest.mark.parametrize("kind", ["model", "spline"])
def test_standard_errors_are_the_scatter_of_measurements(kind, conforms):
    """Of 200 measurements that are drawn, all numbers err by what they say."""
    places, radius = SURFACE.places, 0.0005
    if kind == "model":
        own = radiated.fit_model(PLATE, PLATE.markers, radius, places)
    else:
        held = radiated.edge_places(OUTLINE, [0, 1, 2, 3], 0.07)
        own = radiated.fit_spline(PLATE.markers, held, places)

    power, plain = (of(own.moving, OMEGA) for of in (SURFACE.power_form, SURFACE.plane_wave_form))
    rows = SURFACE.pressure_matrix(own.moving, POINTS, OMEGA)

    def heard(shape):
        scatter = np.full(len(shape), NOISE**2)
        known = estimates.circular_estimate(shape, scatter, COMMON * shape[None])
        return {
            "power": estimates.estimate_quadratic_form(power, known),
            "efficiency": estimates.estimate_ratio(power, plain, known),
            "pressure": estimates.estimate_magnitude(rows, known),
        }

    draw, n = np.random.default_rng(8), len(TRUE)
    truth, found = heard(TRUE), []
    for _ in range(200):
        noise = NOISE * (draw.normal(size=n) + 1j * draw.normal(size=n))
        found.append(heard(TRUE * (1 + COMMON * draw.normal()) + noise))
    for name in truth:
        value, error = (
            np.array([getattr(one[name], part) for one in found]) for part in ("value", "error")
        )
        scatter = np.mean(error, axis=0) / value.std(axis=0)
        conforms.independent(scatter, 1 + 0 * scatter, atol=0.15)
        should = np.real(np.conj(TRUE) @ power @ TRUE) if name == "power" else truth[name].value
        within = np.abs(value - should) <= 2 * error
        assert np.all(np.mean(within, axis=0) > 0.92), name


def test_motion_in_the_plane_makes_the_sound_less_certain(conforms):
    """As much as markers that scatter by so much more."""
    wide = sound_of(measurement().assign(in_plane_excess=3.0), manifest())
    more = sound_of(measurement(noise=3 * NOISE), manifest())
    for name in ("power_error", "efficiency_error", "pressure_error", "band_power_level_error"):
        conforms.invariance(wide[name].values, more[name].values, rtol=1e-9)


def test_markers_tell_waves_of_two_spacings_and_no_shorter_ones(made, conforms):
    """A square plate of the same sheet with sides of √2 spacings has such waves in its mode 1."""
    side = np.sqrt(2) * float(made.attrs["spacing"])
    small = replace(PLATE, length=side, width=side)
    hertz = float(small.angular_frequencies(1)[0]) / (2 * np.pi)
    conforms.closed_form(made.attrs["highest"], hertz, rtol=1e-9)
    for factor, told in ((0.99, False), (1.01, True)):
        high = made.assign_coords(frequency=("tone", [factor * hertz]))
        assert ("shorter than two spacings" in build_sound(high, manifest()).page) is told


def test_what_a_plate_without_a_wall_radiates_is_estimated_from_its_markers(made, conforms):
    """By the true shape on finer cells; mode 1 is half a wave along and half a wave across."""
    screen = Screen.from_outline(OUTLINE, 900)
    w = deflection_shape(PLATE, 1, screen.places, 1e-3)[:, None]
    level = 10 * np.log10(float(screen.power_form(w, OMEGA)[0, 0]) / exact())
    std = float(made["no_wall_change_std"][0])
    conforms.independent(float(made["no_wall_change"][0]), level, atol=0.1)
    conforms.closed_form(std, above=0.1, below=0.5)  # dB; most of it by a thickness of 19.8 mm
    below = 343 / 2 * np.hypot(1 / PLATE.length, 1 / PLATE.width)
    conforms.closed_form(float(made["no_wall_below"][0]), below, rtol=2e-3)


def test_a_report_warns_of_a_missing_wall_where_it_matters(made, faster):
    """Longer waves than the plate go around it."""
    warning = "Without a wall the structure radiates less"
    for wall, told in (("yes", False), ("unknown", True)):
        own = manifest({"wall": wall})
        assert (warning in build_sound(made.assign_attrs(wall=wall), own).page) is told
        assert warning not in build_sound(faster.assign_attrs(wall=wall), own).page


def test_a_spline_comes_near_the_model_and_tells_what_it_does_not_know(conforms):
    spline = sound_of(measurement(noise=NOISE / 10), manifest({"between": "spline"}))
    assert spline.attrs["between"] == "spline"
    conforms.closed_form(float(spline["power"][0]) / exact(), 1, atol=0.02)
    assert float(spline["left"][0]) > 3 * float(spline["left_by_noise"][0])
    assert "interpolated surface misses" in build_sound(spline, manifest()).page


def test_another_shape_than_the_models_is_left_to_the_spline():
    x, y = PLATE.markers / 0.6
    free = (1 + x - y + 0.3 * x * y) * 1e-3 + 0j
    made = sound_of(measurement(free), manifest())
    assert made.attrs["between"] == "spline"


def test_a_spline_holds_planes_and_edges_at_rest(conforms):
    markers = PLATE.markers
    plane = 1 + 2 * markers[0] - markers[1]
    free = radiated.fit_spline(markers, np.empty((2, 0)), SURFACE.places)
    x, y = SURFACE.places
    conforms.closed_form(free.moving @ plane, 1 + 2 * x - y, rtol=1e-9)
    held = radiated.edge_places(np.array([[0, 0], [0.6, 0], [0.6, 0.4], [0, 0.4]]), [3], 0.05)
    conforms.closed_form(held[0], 0 * held[0], atol=1e-12)
    still = radiated.fit_spline(markers, held, held).moving @ plane
    conforms.closed_form(still, 0 * still, atol=1e-9)


def test_octaves_have_the_edges_of_the_standard():
    """Base ten: 1 kHz reaches from 10^2.85 to 10^3.15 Hz; what is in no band is in the total."""
    edges = 10 ** np.array([2.85, 3.15])
    inside, outside = edges * [1.0001, 0.9999], edges * [0.9999, 1.0001]
    found = {name: own.tolist() for name, own in group_octaves([*inside, *outside, 5.0]).items()}
    assert found == {"all": [0, 1, 2, 3, 4], "500": [2], "1000": [0, 1], "2000": [3]}


OTHER = deflection_shape(PLATE, 2, PLATE.markers, 5e-4) * np.exp(-0.4j)
OMEGAS = (OMEGA, 2 * np.pi * 600)  # in the octaves of 250 and 500 Hz
DECAYS = np.array([3.0, 8.0])  # 1/s
WRONG, SINCE = 0.05, 0.15  # relative error of these; time from the moment to the fit's middle, s


def modes(shapes=(TRUE, OTHER), decays=DECAYS, damped=True):
    """What a measurement of two modes would be, in which calibrations err for both alike."""
    several, omega = np.array(shapes), np.array(OMEGAS)
    shared, noise = COMMON * several[None], np.full(several.shape, NOISE)
    return measurement().assign(
        amplitude_real=(("mode", "marker"), several.real),
        amplitude_imag=(("mode", "marker"), several.imag),
        error_of_scatter=(("mode", "marker"), noise),
        standard_error=(("mode", "marker"), noise.copy()),
        shared_real=(("row", "mode", "marker"), shared.real),
        shared_imag=(("row", "mode", "marker"), shared.imag),
        frequency=("mode", omega / 2 / np.pi),
        damping=("mode", damped * decays / omega),
        damping_deviation=("mode", damped * WRONG * DECAYS / omega),
        scale_deviation=("mode", damped * WRONG * DECAYS * SINCE),
        zero=0.25,
    )


@pytest.fixture(scope="module")
def decaying():
    return sound_of(modes(), TWO_POINTS)


@pytest.fixture(scope="module")
def steady():
    return sound_of(modes(damped=False), TWO_POINTS)


@pytest.mark.slow
def test_each_of_several_tones_sounds_as_it_would_alone(steady, decaying, conforms):
    for k, shape in enumerate((TRUE, OTHER)):
        alone = measurement(shape).assign(frequency=OMEGAS[k] / 2 / np.pi)
        one = sound_of(alone, manifest({"points_mm": [[300, 200, 500]]})).isel(tone=0)
        for name in ("power", "efficiency", "pressure_real", "pressure_imag"):
            found = steady[name].isel(tone=k)
            found = found.isel(point=1) if "point" in found.dims else found
            conforms.invariance(float(found), float(one[name].squeeze()), rtol=1e-9)
        conforms.invariance(float(steady["power_error"][k]), float(one["power_error"]), rtol=1e-6)
        assert float(decaying["power_error"][k]) > 1.2 * float(one["power_error"])


def test_powers_of_tones_add_up_and_their_common_errors_too(steady, conforms):
    summed = [steady["power"].sum(), *steady["power"]]
    conforms.invariance(steady["band_power"].values, summed, rtol=1e-9)
    assert steady["band"].values.tolist() == ["all", "250", "500"]
    assert "energy" not in steady
    whole, each = float(steady["band_power_error"][0]), steady["power_error"].values
    conforms.closed_form(whole, above=1.05 * np.hypot(*each), below=np.sum(each))
    conforms.invariance(steady["band_power_error"].values[1:], each, rtol=1e-6)
    assert np.all(steady["mode_power_error"] >= SURFACE.sum_std * steady["mode_power"])
    mean = np.sum(np.abs(complex_of(steady, "pressure")) ** 2, axis=0) / 2
    level = 10 * np.log10(mean / 4e-10)
    conforms.invariance(steady["band_level"].values[0], level, atol=1e-3)


@pytest.mark.nightly
def test_errors_of_totals_and_energies_are_the_scatter_of_measurements(conforms, monkeypatch):
    """Of 60 that are drawn. A decay that is taken for too fast began too large."""
    monkeypatch.setattr(radiated, "MIN_SURFACE_NODES", 200)
    monkeypatch.setattr(radiated, "SCREEN_CELLS", (40, 20))
    draw, said = np.random.default_rng(5), manifest()
    rows = {"band_power": [], "energy": []}
    for _ in range(60):
        wrong = WRONG * DECAYS * draw.normal(size=2)
        size = (1 + COMMON * draw.normal()) * (1 + SINCE * wrong + 0j)[:, None]
        noise = NOISE * (draw.normal(size=(2, len(TRUE))) + 1j * draw.normal(size=(2, len(TRUE))))
        found = sound_of(modes(size * [TRUE, OTHER] + noise, DECAYS + wrong), said)
        for name, own in rows.items():
            own.append([found[name].values, found[f"{name}_error"].values])
    for own in rows.values():
        value, error = np.swapaxes(own, 0, 1)
        scatter = np.mean(error, axis=0) / value.std(axis=0)
        conforms.sampled(scatter, 1 + 0 * scatter, atol=0.25)


def test_energy_is_that_of_the_power_as_it_dies_away(decaying, conforms):
    times = np.linspace(0, 6, 60001)
    for k in range(2):
        falls = float(decaying["power"][k]) * np.exp(-2 * DECAYS[k] * times)
        conforms.independent(float(decaying["energy"][k]), np.trapezoid(falls, times), rtol=1e-6)


def test_a_sound_file_holds_modes_as_they_die_away_in_step(decaying, conforms):
    times = np.arange(48000) / 48000
    pressure = complex_of(decaying, "pressure")[:, 1]
    poles = 1j * np.array(OMEGAS) - DECAYS
    expected = np.real(pressure @ np.exp(poles[:, None] * times))
    found = of_measurement.audible_pressure(decaying, 1)[: len(times)]
    late = times > of_measurement.RISE_S
    conforms.closed_form(found[late], expected[late], atol=1e-9 * np.abs(expected).max())
    assert found[0] == 0


def test_a_sound_file_has_the_pressure_of_its_point(made, tmp_path, conforms):
    of_measurement.write_sound(tmp_path, made)
    rate, samples = wavfile.read(tmp_path / "heard-2.wav")
    assert rate == 48000
    middle = samples[rate : 2 * rate]
    size = abs(made["pressure_real"].values + 1j * made["pressure_imag"].values)[0, 1]
    conforms.closed_form(np.sqrt(2 * np.mean(middle**2)), size, rtol=2e-3)
    tone = np.abs(np.fft.rfft(middle * np.hanning(len(middle))))
    assert abs(np.argmax(tone) - OMEGA / 2 / np.pi) <= 1
    assert (tmp_path / "radiated.csv").read_text().count("power_level") == 1
    with xr.open_dataset(tmp_path / "radiated.nc") as again:
        xr.testing.assert_allclose(again.load()["power"], made["power"])


def test_what_has_no_sound_is_refused_in_a_line():
    crossed = [[0, 0], [668, 443], [668, 0], [0, 443]]
    for radiation, words in (
        ({"outline_mm": crossed}, r"corners \[x, y\] whose edges do not cross"),
        ({"between": "model", "outline_mm": "hull"}, "no model of this outline"),
    ):
        with pytest.raises(ValidationError, match=words):
            manifest(radiation)
    few = [[9, 9], [99, 9], [99, 99], [9, 99]]
    with pytest.raises(ValidationError, match="6 markers or more, given 4"):
        manifest(kind="flat", markers={"points_mm": few})


def test_a_structure_that_is_not_flat_and_markers_too_few_are_refused():
    high, few = modes(), modes()
    high["rest_position"].values[2, 0] = 0.02
    with pytest.raises(ChainError, match=r"20\.0 mm off the plane .* 13 mm; Rayleigh"):
        sound_of(high, manifest())
    few["standard_error"][0, 5:30] = np.nan  # each mode has enough by itself, both have not
    few["amplitude_real"][1, 30:] = np.nan
    with pytest.raises(ChainError, match="5 markers were measured, allowed: 6 or more"):
        sound_of(few, manifest())


def test_the_hull_is_around_the_markers(conforms):
    made = sound_of(measurement(), manifest({"outline_mm": "hull"}))
    width, height = 668 * 8 / 9 + 1, 443 * 5 / 6 + 1
    conforms.closed_form(float(made["area"]), width * height * 1e-6, rtol=1e-5)
