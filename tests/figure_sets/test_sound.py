"""Sound studies end to end: the cubes, the law of rounding, and the thesis's stated errors."""

import base64
import hashlib
import warnings
from functools import cache

import numpy as np
import pytest
import xarray as xr

from thesis_lib.acoustics.planes import full_factor, plane_operator, plate_pistons
from thesis_lib.acoustics.radiation import rayleigh_pressure
from thesis_lib.facts import claims, setups
from thesis_lib.figure_sets.parametric import compute as studies
from thesis_lib.figure_sets.parametric import sound
from thesis_lib.figure_sets.registry import validate_request
from thesis_lib.ledger import verdicts
from thesis_lib.notebook import show as notebook
from thesis_lib.plotting.selection import viewer_data
from thesis_lib.studies import storage as studies_cache
from thesis_lib.studies.request import SOUND_READING
from thesis_lib.studies.schema import RUN_DEPENDENT, with_provenance
from thesis_lib.vibration.structure import deflection_shape, resonance_frequency, world_points
from thesis_lib.vision import rounding
from thesis_lib.vision.simulation import measure_deflections

STUDIES = ["distance", "aperture", "resolution", "arrays"]
PLANES = ["XZ", "YZ"]
NODAL = {(2, "YZ"), (3, "XZ")}  # of modes 1 to 3
TRIAL = ("setting", "mode", "trial")
FIELD = ("mode", "plane", "u", "z")
CONTRACT = {  # dimensions and unit
    "plane_error": ((*TRIAL, "plane"), "percent"),
    "plane_error_of_larger": ((*TRIAL, "plane"), "percent"),
    "predicted_error": (("setting", "mode", "plane"), "percent"),
    "independent_ratio": (("mode", "plane"), "1"),
    "largest_pressure": (("mode", "plane"), "Pa"),
    "deflection_error": (TRIAL, "percent"),
    "coherence": (("setting", "mode", "plane"), "1"),
    "radiated_share": (("setting", "mode", "plane", "radiation_mode"), "1"),
    "independent_share": (("mode", "plane", "radiation_mode"), "1"),
    "sum_error": (("mode", "plane"), "percent"),
    "sum_error_largest": (("mode", "plane"), "percent"),
    "best_and_worst": (("case", "mode", "extreme"), "1"),
    "radiation_efficiency": (("mode",), "1"),
    "piston_size": (("mode",), "1"),
    "pressure_reference_real": (FIELD, "Pa"),
    "pressure_reference_imag": (FIELD, "Pa"),
    "pressure_measured_real": (("case", "mode", "extreme", "plane", "u", "z"), "Pa"),
    "pressure_measured_imag": (("case", "mode", "extreme", "plane", "u", "z"), "Pa"),
    "in_view": (("setting",), "1"),
    "camera_distance": (("setting", "camera"), "m"),
    "camera_azimuth": (("setting", "camera"), "degree"),
    "camera_elevation": (("setting", "camera"), "degree"),
}
LEVELS = {"sound_power": "W", "sound_power_level": "dB", "largest_pressure_level": "dB"}


COARSE = (30, 20)  # what holds on a plane does so at as few points as at many


@cache
def both(study, **values):
    """Validated sound study, the plate's cube, and the sound cube made of it."""
    request = validate_request(f"sound-{study}", {"trials": 5, "plane_shape": COARSE, **values})
    plate = studies.run(validate_request(f"plate-{study}", request.plate_request))
    return request, plate, sound.run(request, plate)


@cache
def default_cubes(study):
    return both(study, trials=200, plane_shape=tuple(SOUND_READING["plane_shape"]))[1:]


# The contract.


@pytest.mark.parametrize("study", STUDIES)
def test_cube_keeps_the_contract(study):
    request, plate, cube = both(study)
    assert {name: cube[name].dims for name in cube.data_vars} == {
        name: dims for name, (dims, _) in CONTRACT.items()
    }
    assert {name: cube[name].attrs["units"] for name in cube.data_vars} == {
        name: unit for name, (_, unit) in CONTRACT.items()
    }
    for variable in cube.variables.values():
        assert variable.attrs["long_name"]
        assert variable.dtype.kind in "fiU"  # no complex numbers, no objects
        assert "units" in variable.attrs or variable.dtype.kind == "U"
    assert list(cube["plane"].values) == PLANES
    assert list(cube["extreme"].values) == ["best", "worst"]
    for name in ("case", "parameter", "value", "label", "n_cameras", "width_px", "height_px",
                 "pair_order", "mode", "frequency", "trial"):  # fmt: skip
        xr.testing.assert_identical(cube[name].variable, plate[name].variable)
    cases = list(dict.fromkeys(plate["case"].values.tolist()))
    assert cube["case_name"].values.tolist() == cases
    assert cube.sizes["case"] == len(cases)
    np.testing.assert_array_equal(cube["u"], request.planes[0].u)
    np.testing.assert_array_equal(cube["z"], request.planes[0].z)
    np.testing.assert_array_equal(cube["deflection_error"], plate["mean_error"])


@pytest.mark.parametrize("study", STUDIES)
def test_checksum_is_that_of_the_plates_deflections(study):
    _, plate, cube = both(study)
    content = np.ascontiguousarray(plate["measured_deflection"].values).tobytes()
    assert cube.attrs["deflections_sha256"] == hashlib.sha256(content).hexdigest()
    other = plate.copy(deep=True)
    other["measured_deflection"][0, 0, 0, 0] += 1e-6
    assert sound.deflection_checksum(other) != sound.deflection_checksum(plate)


def test_sound_takes_the_deflections_of_its_estimator():
    (_, squares, plain), (_, centres, cube) = (
        both("arrays", cases=("4c",), estimator=name)
        for name in ("least-squares", "analytic-centre")
    )
    assert (
        sound.deflection_checksum(squares)
        != sound.deflection_checksum(centres)
        == cube.attrs["deflections_sha256"]
    )
    many = {"setting": -1, "trial": slice(1, None)}
    assert cube["deflection_error"].isel(many).mean() < plain["deflection_error"].isel(many).mean()
    xr.testing.assert_equal(plain["predicted_error"], cube["predicted_error"])
    assert cube["predicted_error"].attrs["long_name"].endswith("of least squares")
    assert "least squares" not in plain["predicted_error"].attrs["long_name"]


@pytest.mark.parametrize("study", STUDIES)
def test_a_plane_has_no_error_exactly_where_it_is_nodal(conforms, study):
    _, _, cube = both(study)
    for mode in (1, 2, 3):
        for plane in PLANES:
            part = cube.sel(mode=mode, plane=plane)
            nodal = (mode, plane) in NODAL
            for name in ("plane_error", "predicted_error", "independent_ratio"):
                assert np.all(np.isnan(part[name]) == nodal)
            assert np.all(np.isfinite(part["plane_error_of_larger"]))
            assert np.all(part["plane_error_of_larger"] > 0)
    louder = cube["largest_pressure"].max("plane")
    ratio = cube["plane_error_of_larger"] / cube["plane_error"]
    expected = (cube["largest_pressure"] / louder).broadcast_like(ratio).transpose(*ratio.dims)
    conforms.invariance(
        ratio.where(ratio.notnull(), 0), expected.where(ratio.notnull(), 0), rtol=1e-7
    )


def test_mode_2_2_is_silent_on_both_planes(conforms):
    # What is left of its pressure is rounding, and neither plane's rounding is a reference.
    _, _, cube = both("distance", modes=(1, 5))
    silent, heard = cube.sel(mode=5), cube.sel(mode=1)
    conforms.invariance(
        silent["largest_pressure"].max(), below=1e-12 * heard["largest_pressure"].max()
    )
    for name in ("plane_error", "plane_error_of_larger", "predicted_error", "independent_ratio"):
        assert np.all(np.isnan(silent[name]))
        assert np.all(np.isfinite(heard[name]))


@pytest.mark.slow
@pytest.mark.parametrize("values", [{}, {"speed_of_sound_m_s": 200.0}, {"grid": (30, 20)}])
def test_cube_tells_how_large_a_piston_is_for_the_wave(conforms, values):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        request, _, cube = both("distance", **values, plane_shape=(8, 6))
    omega = cube["frequency"].values * 2 * np.pi * np.sqrt(1 - 2 * 0.02**2)
    longer = max(0.668 / request.grid[0], 0.443 / request.grid[1])
    conforms.closed_form(
        cube["piston_size"], omega / request.speed_of_sound_m_s * longer, rtol=1e-12
    )


@pytest.mark.parametrize("amplitude", [10.0, "force"])
def test_absolute_levels_are_given_for_a_force_alone(amplitude):
    _, _, cube = both("distance", amplitude_mm=amplitude)
    assert {name for name in LEVELS if name in cube} == (
        set(LEVELS) if amplitude == "force" else set()
    )
    assert any("level" in name for name in cube) == (amplitude == "force")


def test_levels_are_those_of_a_plane_piston_of_low_frequency(conforms):
    """One newton at 305 Hz: power by the mean square velocity, level by the pressure's rms."""
    _, plate, cube = both("distance", amplitude_mm="force")
    structure = setups.thesis_plate()
    assert {name: cube[name].attrs["units"] for name in LEVELS} == LEVELS
    area = structure.length * structure.width
    for m in range(3):
        v = resonance_frequency(structure, m + 1) * plate["reference_deflection"].values[m]
        plane_wave = 1.21 * 343 * area * np.mean(v**2) / 2
        power = plane_wave * cube["radiation_efficiency"].values[m]
        conforms.closed_form(cube["sound_power"].values[m], power, rtol=1e-12)
        level = 10 * np.log10(power / 1e-12)
        conforms.closed_form(cube["sound_power_level"].values[m], level, atol=1e-9)
        pressure = cube["largest_pressure"].values[m].max()
        level = 20 * np.log10(pressure / np.sqrt(2) / 20e-6)
        conforms.closed_form(cube["largest_pressure_level"].values[m].max(), level, atol=1e-9)


# The numbers, by brute force.


@pytest.mark.parametrize(
    ("study", "setting", "mode", "trial"),
    [("distance", 0, 1, 0), ("distance", 3, 2, 4), ("aperture", 7, 3, 1), ("arrays", 20, 1, 5)],
)
def test_plane_errors_are_equation_6_8_of_direct_sums(conforms, study, setting, mode, trial):
    request, plate, cube = both(study)
    structure = setups.thesis_plate()
    omega = resonance_frequency(structure, mode)
    reference = plate["reference_deflection"].sel(mode=mode).values
    measured = plate["measured_deflection"].sel(mode=mode, trial=trial).isel(setting=setting)
    measured = measured.values.astype(float)
    largest, rms = [], []
    for plane in request.planes:
        p, p_ref = (
            rayleigh_pressure(plate_pistons(structure), 1j * omega * w, plane.points, omega)
            for w in (measured, reference)
        )
        largest.append(np.max(np.abs(p_ref)))
        rms.append(np.sqrt(np.mean(np.abs(p - p_ref) ** 2)))
    got = cube.sel(mode=mode, trial=trial).isel(setting=setting)
    for i, plane in enumerate(PLANES):
        of_larger = got["plane_error_of_larger"].sel(plane=plane)
        conforms.independent(float(of_larger), 100 * rms[i] / max(largest), rtol=1e-9)
        if (mode, plane) not in NODAL:
            error = float(got["plane_error"].sel(plane=plane))
            conforms.independent(error, 100 * rms[i] / largest[i], rtol=1e-9)


@pytest.mark.parametrize("mode", [1, 2, 3])
def test_fields_are_direct_sums(conforms, mode):
    request, plate, cube = both("distance")
    structure = setups.thesis_plate()
    omega = resonance_frequency(structure, mode)
    median = plate["mean_error"].sel(mode=mode).values[:, 1:]
    median = np.median(median, axis=1)
    chosen = cube["best_and_worst"].sel(mode=mode).values[0]
    assert median[chosen[0]] == median.min()
    assert median[chosen[1]] == median.max()
    for i, plane in enumerate(request.planes):
        shapes = [plate["reference_deflection"].sel(mode=mode)]
        shapes += [
            plate["measured_deflection"].sel(mode=mode, trial=0).isel(setting=s) for s in chosen
        ]
        got = [
            [cube[f"pressure_reference_{part}"].sel(mode=mode).isel(plane=i).values]
            + list(cube[f"pressure_measured_{part}"].sel(mode=mode).isel(case=0, plane=i).values)
            for part in ("real", "imag")
        ]
        peak = float(cube["largest_pressure"].sel(mode=mode).max())
        for shape, real, imag in zip(shapes, *got, strict=True):
            v = 1j * omega * shape.values.astype(float)
            exact = rayleigh_pressure(plate_pistons(structure), v, plane.points, omega)
            conforms.independent(real + 1j * imag, exact, atol=3e-7 * peak)


# Invariances.


def errors_of(cube):
    return np.stack([cube["plane_error"], cube["plane_error_of_larger"]])


def known(one, other):
    """The numbers of both, which must lack the same ones."""
    there = np.isfinite(one)
    np.testing.assert_array_equal(there, np.isfinite(other))
    return np.asarray(one)[there], np.asarray(other)[there]


def test_percentages_do_not_depend_on_density(conforms):
    air = both("distance")[2]
    water = both("distance", air_density_kg_m3=998.0)[2]
    conforms.invariance(*known(errors_of(water), errors_of(air)), rtol=1e-11)
    conforms.invariance(*known(water["predicted_error"], air["predicted_error"]), rtol=1e-11)
    louder = water["largest_pressure"] / air["largest_pressure"]
    conforms.invariance(louder.sel(mode=1), 998 / 1.21, rtol=1e-11)


@pytest.mark.parametrize("factor", [1e-6, -3.0])
def test_percentages_do_not_depend_on_amplitude_where_the_relative_deflections_are_the_same(
    conforms, factor
):
    request, plate, cube = both("distance")
    scaled = plate.copy()
    for name in ("reference_deflection", "measured_deflection"):
        scaled[name] = plate[name].astype(float) * factor
    other = sound.run(request, scaled)
    conforms.invariance(*known(errors_of(other), errors_of(cube)), rtol=1e-9)
    louder = other["largest_pressure"] / cube["largest_pressure"]
    conforms.invariance(louder.sel(mode=1), abs(factor), rtol=1e-9)


def test_percentages_depend_on_the_speed_of_sound():
    # Lest the invariances hold because nothing enters at all.
    slow = both("distance", speed_of_sound_m_s=290.0)[2]
    changed = slow["plane_error"] / both("distance")[2]["plane_error"]
    assert float(abs(changed - 1).max()) > 0.05


def test_perfect_deflections_have_no_error():
    request, plate, _ = both("distance")
    perfect = plate.copy()
    reference = plate["reference_deflection"]
    perfect["measured_deflection"] = (
        reference.broadcast_like(plate["measured_deflection"].astype(float))
    ).transpose(*plate["measured_deflection"].dims)
    cube = sound.run(request, perfect)
    assert float(cube["plane_error_of_larger"].max()) == 0


def test_a_common_factor_is_its_own_error(conforms):
    # 7 % too much everywhere: e = 0.07 w, so the rms error is 7 % of the rms field.
    request, plate, _ = both("distance")
    more = plate.copy()
    more["measured_deflection"] = (
        (1.07 * plate["reference_deflection"])
        .broadcast_like(plate["measured_deflection"])
        .transpose(*plate["measured_deflection"].dims)
    )
    cube = sound.run(request, more)
    field = cube["pressure_reference_real"].astype(float) ** 2
    field = np.sqrt((field + cube["pressure_reference_imag"].astype(float) ** 2).mean(["u", "z"]))
    expected = 7 * field / cube["largest_pressure"].max("plane")
    got = cube["plane_error_of_larger"].isel(setting=0, trial=0)
    for mode in (1, 2, 3):
        louder = cube["largest_pressure"].sel(mode=mode).values.argmax()
        conforms.closed_form(
            float(got.sel(mode=mode)[louder]), float(expected.sel(mode=mode)[louder]), rtol=1e-6
        )


# The law of rounding.

N_TRIALS = 1500


def measured_errors(request, setting, reference, trials):
    """Errors of the markers (modes, trials, markers) for both readings of the rest position.

    Rest and deflections are measured once: the readings differ in what is subtracted.
    """
    rests = np.zeros((2, reference.shape[1]))
    points = world_points(request.structure, np.concatenate([rests, reference]))
    rig = setting.cameras(request.focal_length_mm, request.sensor_width_mm)
    shifts = rounding.grid_shifts(request.seed, trials, len(rig))[1:]
    heights = measure_deflections(rig, points, shifts, rest_is_known=True)
    known = heights[1:] - reference[:, None]
    return {"known": known, "rebuilt": known - heights[0]}


def rms_over_trials(squares):
    """Root of the mean of squared errors (..., trials), and its relative standard error."""
    mean = np.mean(squares, axis=-1)
    return np.sqrt(mean), np.std(squares, axis=-1) / mean / 2 / np.sqrt(squares.shape[-1])


def plane_factors(request):
    """Factors that give the rms pressure error of each mode and plane from marker errors."""
    return [
        [
            resonance_frequency(request.structure, mode)
            * full_factor(
                plane_operator(
                    request.structure, plane, resonance_frequency(request.structure, mode)
                )
            )
            for plane in request.planes
        ]
        for mode in request.modes
    ]


@pytest.mark.slow
@pytest.mark.parametrize(
    "study", [STUDIES[0], *(pytest.param(s, marks=pytest.mark.nightly) for s in STUDIES[1:])]
)
def test_predicted_errors_are_the_rms_over_trials(conforms, study):
    """Plate within 3 %, sound within 5 %, at every setting and mode, for both rests.

    The squared error of a plane scatters about as much as its mean, for few patterns carry it. So
    its root mean over 1500 trials is known to 1.7 % at worst: three of these are still within
    the 5 % to be shown, and a law that is off by 7 % somewhere would be found out.
    """
    request = both(study, trials=0)[0]
    cubes_of = {rest: both(study, trials=0, rest=rest)[1:] for rest in ("known", "rebuilt")}
    reference = cubes_of["known"][0]["reference_deflection"].values
    amplitude = np.max(np.abs(reference), axis=1)
    factors = plane_factors(request)
    seen = 0
    for s, setting in enumerate(request.settings()):
        errors = measured_errors(request, setting, reference, N_TRIALS)
        for rest, (plate, cube) in cubes_of.items():
            simulated, uncertain = rms_over_trials(np.mean(errors[rest] ** 2, axis=-1))
            assert np.all(3 * uncertain < 0.03)
            law = plate["predicted_error"].values[s] / 100 * amplitude
            conforms.sampled(law / simulated, 1, atol=0.03)
            for m, mode in enumerate(request.modes):
                for p, plane in enumerate(PLANES):
                    if (mode, plane) in NODAL:
                        continue
                    squares = np.sum((errors[rest][m] @ factors[m][p].T) ** 2, axis=-1)
                    simulated, uncertain = rms_over_trials(squares)
                    assert 3 * uncertain < 0.05
                    law = cube["predicted_error"].values[s, m, p] / 100
                    law *= cube["largest_pressure"].values[m, p]
                    conforms.sampled(law / simulated, 1, atol=0.05)
                    seen += 1
    assert seen == 2 * len(request.settings()) * 4


@pytest.mark.parametrize("rest", ["known", "rebuilt"])
def test_what_is_simulated_above_is_what_the_cubes_hold(conforms, rest):
    request, plate, cube = both("arrays", rest=rest)
    reference = plate["reference_deflection"].values
    factors = plane_factors(request)
    for s in (0, 9, 25):
        errors = measured_errors(request, request.settings()[s], reference, 5)[rest]
        rms = 100 * np.sqrt(np.mean(errors**2, axis=-1)) / 0.01
        peak = np.max(np.abs(reference), axis=1)[:, None] / 0.01
        conforms.invariance(plate["mean_error"].values[s, :, 1:], rms / peak, rtol=1e-9)
        for m in range(3):
            for p in range(2):
                rms = np.linalg.norm(errors[m] @ factors[m][p].T, axis=-1)
                of_larger = 100 * rms / cube["largest_pressure"].values[m].max()
                got = cube["plane_error_of_larger"].values[s, m, 1:, p]
                conforms.invariance(got, of_larger, rtol=1e-4)  # float32 on disk


def test_variances_of_the_markers_alone_do_not_predict_the_plane_errors(conforms):
    """Opposite cameras: what all markers share is more than twice what each has of its own."""
    request, plate, cube = both("aperture", trials=500, cases=("2d",))
    factor = plane_factors(request)[0][0]
    reference = plate["reference_deflection"].values[0]
    points = world_points(request.structure, np.stack([0 * reference, reference]))
    for s, setting in enumerate(request.settings()):
        rig = setting.cameras(24, 36)
        variance = rounding.deflection_variance(rig.P, points[:, 0], points[:, 1])
        alone = 100 * np.sqrt(np.sum(factor**2 * variance))
        alone /= float(cube["largest_pressure"].sel(mode=1, plane="XZ"))
        errors = cube["plane_error"].sel(mode=1, plane="XZ").isel(setting=s, trial=slice(1, None))
        simulated = np.sqrt(float((errors**2).mean()))
        conforms.sampled(alone, below=0.7 * simulated)


@pytest.mark.parametrize("known", [False, True])
@pytest.mark.parametrize(("study", "setting", "mode"), [("distance", 0, 1), ("arrays", 1, 3)])
def test_diagonal_of_the_covariance_is_the_variance(conforms, study, setting, mode, known):
    request = validate_request(f"sound-{study}", {})
    plate = request.structure
    w = deflection_shape(plate, mode, plate.markers, 0.01)
    rest, moved = np.moveaxis(world_points(plate, np.stack([0 * w, w])), 1, 0)
    P = request.settings()[setting].cameras(24, 36).P
    covariance = rounding.deflection_covariance(P, rest, moved, known)
    variance = rounding.deflection_variance(P, rest, moved, known)
    conforms.invariance(np.diag(covariance), variance, rtol=1e-9, atol=1e-12 * variance.max())
    conforms.invariance(covariance, covariance.T, atol=1e-12 * variance.max())
    eigenvalues = np.linalg.eigvalsh(covariance)
    conforms.invariance(eigenvalues[0], above=-1e-12 * eigenvalues[-1])


@pytest.mark.nightly
@pytest.mark.parametrize("known", [False, True])
def test_covariance_is_that_of_sampled_errors(conforms, known):
    request = validate_request("sound-distance", {})
    plate = request.structure
    w = deflection_shape(plate, 2, plate.markers, 0.01)
    points = world_points(plate, np.stack([0 * w, w]))
    rig = request.settings()[1].cameras(24, 36)
    law = rounding.deflection_covariance(rig.P, points[:, 0], points[:, 1], known)
    every = measure_deflections(rig, points, rounding.grid_shifts(0, 8000, 2)[1:], known)[0] - w
    apart = []
    for n in (500, 2000, 8000):
        errors = every[:n]
        sampled = errors.T @ errors / n
        apart.append(np.linalg.norm(sampled - law) / np.linalg.norm(law))
        # Every entry is a mean of n products: what they scatter, added over all entries.
        scatter = np.sum((errors**2).T @ errors**2 / n - sampled**2) / n
        sampling = np.sqrt(scatter) / np.linalg.norm(law)
        conforms.sampled(apart[-1], sampling, rtol=0.15)  # sampling alone explains it
    conforms.order(np.log(apart[0] / apart[-1]) / np.log(16), 0.5, atol=0.05)


def test_covariance_of_two_roundings_is_that_of_all_shifts(conforms):
    n = 20_000
    shift = (np.arange(n) + 0.5) / n - 0.5
    for distance in (0, 0.1, 0.5, 0.77, 1, 3.25, -0.4):
        one, other = (np.rint(u + shift) - u - shift for u in (0.3, 0.3 + distance))
        law = rounding.error_covariance(distance)
        conforms.closed_form(law, np.mean(one * other), atol=2 / n)


# Errors of the pistons average out.


@pytest.mark.parametrize("mode", [1, 2, 3])
def test_ratio_of_field_to_deflection_error_falls_as_the_root_of_the_number_of_markers(
    conforms, mode
):
    grids = [(12, 8), (15, 10), (21, 14), (30, 20)]
    request = validate_request("sound-distance", {"plane_shape": COARSE})
    plane = request.planes[0 if mode < 3 else 1]
    ratios = []
    for grid in grids:
        plate = setups.thesis_plate(grid)
        omega = resonance_frequency(plate, mode)
        op = plane_operator(plate, plane, omega)
        w = deflection_shape(plate, mode, plate.markers, 0.01)
        # Field error over the largest pressure, for independent errors of a unit of the largest w.
        independent = np.linalg.norm(full_factor(op)) * np.max(np.abs(w))
        ratios.append(independent / np.max(np.abs(op.field(w))))
    markers = [nx * ny for nx, ny in grids]
    exponent = np.polyfit(np.log(markers), np.log(ratios), 1)[0]
    conforms.order(exponent, above=-0.55, below=-0.45)


def test_ratio_in_the_cube_is_that_of_independent_errors(conforms):
    request, plate, cube = both("distance")
    rng = np.random.default_rng(0)
    errors = rng.normal(size=(4000, 150))
    factor = plane_factors(request)[0][0]
    field = np.sqrt(np.mean(np.sum((errors @ factor.T) ** 2, axis=-1)))
    deflection = 1 / np.max(np.abs(plate["reference_deflection"].values[0]))
    ratio = field / float(cube["largest_pressure"][0].max()) / deflection
    conforms.closed_form(
        float(cube["independent_ratio"].sel(mode=1, plane="XZ")),
        ratio * float(cube["largest_pressure"][0].max() / cube["largest_pressure"][0, 0]),
        rtol=0.03,
    )


# The thesis's stated errors.


def checks_of(subject, index, quantities):
    return [
        check
        for study in STUDIES
        for check in verdicts.check_claims(
            default_cubes(study)[index], claims.claims_of(f"{subject}-{study}")
        )
        if check.claim.quantity in quantities
    ]


@pytest.mark.slow
def test_most_stated_mean_errors_of_chapter_4_are_met(conforms):
    checks = checks_of("plate", 0, {"mean_error"})
    assert len(checks) >= 66
    conforms.sampled(sum(check.inside for check in checks), above=0.75 * len(checks))


@pytest.mark.slow
def test_most_stated_plane_errors_of_chapter_6_are_met(conforms):
    checks = checks_of("sound", 1, {"plane_error_xz", "plane_error_yz"})
    assert len(checks) >= 70
    conforms.sampled(sum(check.inside for check in checks), above=0.85 * len(checks))


# Nothing is computed twice, and nothing is stale.


@pytest.fixture
def library(tmp_path, monkeypatch):
    """A library of one file, and a cache of its own."""
    file = tmp_path / "library.py"
    file.write_text("one")
    monkeypatch.setattr(studies_cache, "cache_folder", lambda: tmp_path / "cache")
    monkeypatch.setattr(studies_cache, "library_files", lambda: [file])
    return file


@pytest.fixture
def computed(monkeypatch):
    """Names of the studies that were computed, in turn."""
    names = []
    run = studies.run

    def counting(study, *more, **values):
        names.append(study.name)
        return run(study, *more, **values)

    monkeypatch.setattr(studies, "run", counting)
    return names


def test_deflections_are_computed_once_for_parameters_and_library(library, computed):
    values = {"trials": 2, "distances_mm": [750.0]}

    def cached(**more):
        return studies_cache.cached_study(
            validate_request("plate-distance", {**values, **more}), studies.run
        )

    first = cached()
    assert computed == ["plate-distance"]
    again = cached()
    assert set(again.attrs) == set(first.attrs)
    same = {name: first.attrs[name] for name in RUN_DEPENDENT}
    xr.testing.assert_identical(again.assign_attrs(same), first)
    cached(cube="somewhere.nc")
    assert len(computed) == 1
    other = cached(seed=1)
    assert len(computed) == 2
    assert sound.deflection_checksum(other) != sound.deflection_checksum(first)
    library.write_text("two")
    again = cached()
    assert len(computed) == 3
    assert sound.deflection_checksum(again) == sound.deflection_checksum(first)
    library.write_text("one")
    cached()
    assert len(computed) == 3


def test_plate_and_sound_notebooks_share_the_deflections(library, computed):
    values = {"trials": 2, "distances_mm": [750.0]}
    plate = notebook.study("plate-distance", values)
    quick = {**values, "plane_shape": [8, 6]}
    cube = notebook.study("sound-distance", quick)
    assert computed == ["plate-distance"]
    assert cube.attrs["deflections_sha256"] == sound.deflection_checksum(plate)
    notebook.study("sound-distance", {**quick, "speed_of_sound_m_s": 340.0})
    assert len(computed) == 1
    notebook.study("sound-distance", {**quick, "amplitude_mm": 9.0})
    assert computed == ["plate-distance"] * 2


# What the viewer draws.


def decoded(field):
    """Complex pressure at every second point of a plane, as the page reads it."""
    real, imaginary = (
        np.frombuffer(base64.b64decode(field[part]), np.int8) for part in ("re", "im")
    )
    return field["scale"] / 127 * (real + 1j * imaginary)


def test_the_viewer_draws_the_ideal_field_and_what_the_errors_add():
    """Errors have a scale of their own: next to the field itself they would hardly be seen."""
    request, _, plain = both("distance")
    data = viewer_data(with_provenance(plain, request, 0.0))
    case, k = data["cases"][0], data["modes"][0]["mode"]
    for p, plane in enumerate(PLANES):
        pressure = {
            one: plain[f"pressure_{one}_real"] + 1j * plain[f"pressure_{one}_imag"]
            for one in ("reference", "measured")
        }
        ideal = pressure["reference"].isel(mode=0, plane=p, u=slice(None, None, 2))
        ideal = ideal.isel(z=slice(None, None, 2)).transpose("u", "z").values.ravel()
        sent = data["modes"][0]["fields"][plane]
        np.testing.assert_allclose(decoded(sent), ideal, atol=sent["scale"] / 127)
        for extreme in ("best", "worst"):
            sent = case["extremes"][str(k)][extreme]["fields"][plane]
            got = pressure["measured"].isel(case=0, mode=0, plane=p, u=slice(None, None, 2))
            got = got.sel(extreme=extreme).isel(z=slice(None, None, 2)).transpose("u", "z")
            error = got.values.ravel() - ideal
            np.testing.assert_allclose(decoded(sent), error, atol=sent["scale"] / 127)
            assert sent["scale"] < 0.3 * np.abs(ideal).max()
    silent = {
        (mode["mode"], plane)
        for mode in data["modes"]
        for plane in PLANES
        if plane not in mode["fields"]
    }
    assert silent == NODAL
