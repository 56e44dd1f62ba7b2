"""Camera studies end to end: the cubes, their files, and the thesis's stated errors."""

import gc
import json
import resource
import subprocess
import sys
from dataclasses import replace
from functools import cache

import h5py
import numpy as np
import pytest
import xarray as xr

from benchmarks.reference import svd_triangulate
from thesis_lib.facts import claims
from thesis_lib.figure_sets import cube_file
from thesis_lib.figure_sets.parametric import compute as studies
from thesis_lib.figure_sets.parametric.figures import error_table
from thesis_lib.figure_sets.registry import validate_request
from thesis_lib.ledger import verdicts
from thesis_lib.studies import cubes, schema, storage
from thesis_lib.studies.schema import with_provenance
from thesis_lib.vibration.structure import deflection_shape, world_points
from thesis_lib.vision import rounding
from thesis_lib.vision.analytic_centre import analytic_centre
from thesis_lib.vision.pinhole import project
from thesis_lib.vision.simulation import measure_deflections

NAMES = ["beam-distance", "beam-aperture", "beam-resolution", "beam-arrays"]
UNITS = {
    "reference_deflection": "m",
    "measured_deflection": "m",
    "mean_error": "percent",
    "max_point_error": "percent",
    "point_error": "percent",
    "predicted_error": "percent",
    "mac": "1",
    "in_view": "1",
    "ground_sample_distance": "m/px",
    "camera_distance": "m",
    "camera_azimuth": "degree",
    "camera_elevation": "degree",
}
DIMENSIONS = {
    "reference_deflection": ("mode", "point"),
    "measured_deflection": ("setting", "mode", "trial", "point"),
    "mean_error": ("setting", "mode", "trial"),
    "max_point_error": ("setting", "mode", "trial"),
    "point_error": ("setting", "mode", "point"),
    "predicted_error": ("setting", "mode"),
    "mac": ("setting", "mode", "trial"),
    "in_view": ("setting",),
    "ground_sample_distance": ("setting",),
    "camera_distance": ("setting", "camera"),
    "camera_azimuth": ("setting", "camera"),
    "camera_elevation": ("setting", "camera"),
}
PLATES = [name.replace("beam", "plate") for name in NAMES]
HERTZ = {"beam": [6.312, 39.56, 110.8], "plate": [305.5, 585.5, 942.1]}


@cache
def cube_of(name, **values):
    return studies.run(validate_request(name, {"trials": 20, **values}))


@cache
def default_cube(name):
    return studies.run(validate_request(name, {}))


def whole_pixels(uv):
    """Nearest whole pixels, halves to even, blind to noise in the ninth decimal."""
    return np.rint(np.round(uv, 9))


@pytest.mark.parametrize("name", NAMES + PLATES)
def test_cube_keeps_the_contract(conforms, name):
    study, cube = validate_request(name, {"trials": 20}), cube_of(name)
    points = {"beam": 25, "plate": 150}[study.subject]
    sizes = {"setting": len(study.settings()), "mode": 3, "trial": 21, "point": points}
    assert sizes.items() <= dict(cube.sizes).items()
    assert cube.sizes["camera"] == max(cube["n_cameras"].values)
    assert {variable: cube[variable].dims for variable in cube.data_vars} == DIMENSIONS
    assert {variable: cube[variable].attrs["units"] for variable in cube.data_vars} == UNITS
    for variable in cube.variables.values():
        assert variable.attrs["long_name"]
        assert variable.dtype.kind in "fiU"  # no complex numbers, no objects
        assert "units" in variable.attrs or variable.dtype.kind == "U"
    on_setting = {"case", "parameter", "value", "n_cameras", "width_px", "height_px", "pair_order"}
    assert all(cube[coordinate].dims == ("setting",) for coordinate in on_setting)
    assert cube["x"].dims == cube["y"].dims == ("point",)
    np.testing.assert_array_equal(cube["mode"], [1, 2, 3])
    np.testing.assert_array_equal(cube["trial"], range(21))
    conforms.closed_form(cube["frequency"], HERTZ[study.subject], rtol=5e-4)
    np.testing.assert_array_equal([cube["x"], cube["y"]], study.structure.markers)


TABLES = {
    "beam-distance": ("distance_mm", [("1", [500, 750, 1000, 1500])]),
    "beam-aperture": (
        "aperture_deg",
        [("2a", [16, 60, 110, 160]), ("2b", [170, 140, 100, 60]),
         ("2c", [16, 60, 110, 160]), ("2d", [170, 140, 100, 60])],
    ),
    "beam-resolution": ("width_px", [("3", [320, 640, 1280, 1920])]),
    "beam-arrays": (
        "n_cameras",
        [("4a", [2, 4, 6, 8, 10, 12]), ("4a'", [2, 4, 6, 8, 10, 12]), ("4b", [2, 4, 6, 8]),
         ("4c", [2, 4, 6, 8, 10, 12]), ("4d", [2, 4, 6, 8]), ("4e", [2, 4, 6, 8, 10, 12])],
    ),
}  # fmt: skip
TABLES |= {name.replace("beam", "plate"): table for name, table in TABLES.items()}
TABLES["plate-distance"] = ("distance_mm", [("1", [650, 750, 1000, 1500])])


@pytest.mark.parametrize("name", NAMES + PLATES)
def test_settings_stand_in_the_order_of_the_tables(name):
    parameter, rows = TABLES[name]
    cube = cube_of(name)
    expected = [(case, value) for case, values in rows for value in values]
    assert list(zip(cube["case"].values, cube["value"].values, strict=True)) == expected
    assert set(cube["parameter"].values) == {parameter}
    if parameter in ("n_cameras", "width_px"):
        np.testing.assert_array_equal(cube[parameter], cube["value"])


def test_resolutions_are_16_to_9():
    cube = cube_of("beam-resolution")
    np.testing.assert_array_equal(cube["height_px"], [180, 360, 720, 1080])


def test_case_4d_grows_from_the_steepest_pair_unless_asked_otherwise():
    reversed_, printed = (
        cube_of("beam-arrays"),
        studies.run(
            validate_request(
                "beam-arrays", {"trials": 0, "cases": ["4d"], "pair_order": {"4d": "printed"}}
            )
        ),
    )
    last = reversed_.isel(setting=reversed_["case"].values == "4d")
    np.testing.assert_array_equal(
        last["camera_elevation"].values[3, :8], [58, 58, 48, 48, 28, 28, 8, 8]
    )
    np.testing.assert_array_equal(
        printed["camera_elevation"].values[3], [8, 8, 28, 28, 48, 48, 58, 58]
    )
    assert set(last["pair_order"].values) == {"reversed"}
    assert set(printed["pair_order"].values) == {"printed"}


def test_absent_cameras_are_nan_and_no_other():
    cube = cube_of("beam-arrays")
    absent = np.arange(12) >= cube["n_cameras"].values[:, None]
    for variable in ("camera_distance", "camera_azimuth", "camera_elevation"):
        np.testing.assert_array_equal(np.isnan(cube[variable]), absent)
    for name, variable in cube.data_vars.items():
        assert "camera" in variable.dims or np.isfinite(variable).all(), name


def camera_matrix(distance, azimuth, elevation, focal_px, width, height):
    """One projection matrix, spelled out from the conventions."""
    t, p = np.radians([azimuth, elevation])
    towards = np.array([np.cos(p) * np.sin(t), np.cos(p) * np.cos(t), np.sin(p)])
    right, forward = np.array([-np.cos(t), np.sin(t), 0]), -towards
    R = np.array([right, np.cross(forward, right), forward])
    K = np.array([[focal_px, 0, width / 2], [0, focal_px, height / 2], [0, 0, 1]])
    return K @ np.column_stack([R, -R @ (distance * towards)])


@pytest.mark.parametrize(
    ("name", "s", "focal_mm", "peak_mm"),
    [
        ("beam-distance", 2, 24.0, 5.5),
        ("beam-distance", 0, 25.0, 70.0),  # parts of the beam leave the sensor as it moves
        ("beam-aperture", 5, 24.0, 5.5),
        ("beam-resolution", 1, 24.0, 5.5),
        ("beam-arrays", 9, 24.0, 5.5),
        ("plate-distance", 1, 24.0, 10.0),
        ("plate-arrays", 13, 24.0, 10.0),
    ],
)
def test_nominal_run_is_the_thesis_written_as_a_loop(conforms, name, s, focal_mm, peak_mm):
    cube = cube_of(name, focal_length_mm=focal_mm, amplitude_mm=peak_mm).isel(setting=s)
    width, height = float(cube["width_px"]), float(cube["height_px"])
    n, points = int(cube["n_cameras"]), cube.sizes["point"]
    centre = {"beam": (0.623 / 2, 0.015), "plate": (0.334, 0.2215)}[name.split("-")[0]]
    P = np.stack(
        [
            camera_matrix(
                float(cube["camera_distance"][c]), float(cube["camera_azimuth"][c]),
                float(cube["camera_elevation"][c]), focal_mm / 36 * width, width, height,
            )
            for c in range(n)
        ]
    )  # fmt: skip
    seen = 0
    for m in range(3):
        reference = cube["reference_deflection"].values[m]
        measured = np.empty(points)
        for i in range(points):
            heights = []
            for z in (0.0, reference[i]):
                x, y = cube["x"].values[i] - centre[0], cube["y"].values[i] - centre[1]
                point = [x, y, z, 1]
                uv = np.array([(P[c] @ point)[:2] / (P[c] @ point)[2] for c in range(n)])
                heights.append(svd_triangulate(P, whole_pixels(uv)[:, :, None])[2, 0])
            seen += np.sum((uv >= 0) & (uv <= [width, height]), axis=1).tolist().count(2)
            measured[i] = heights[1] - heights[0]
        conforms.independent(
            cube["measured_deflection"].values[m, 0], measured, rtol=1e-6, atol=1e-9
        )
        error = 100 * np.abs(measured - reference) / np.max(np.abs(reference))
        conforms.independent(cube["point_error"].values[m], error, atol=1e-4)
        rms = np.sqrt(np.mean(error**2))
        conforms.independent(cube["mean_error"].values[m, 0], rms, rtol=1e-6)
        conforms.independent(cube["max_point_error"].values[m, 0], max(error), rtol=1e-6)
        mac = (measured @ reference) ** 2 / (measured @ measured * (reference @ reference))
        conforms.independent(cube["mac"].values[m, 0], mac, rtol=1e-6)
    conforms.independent(float(cube["in_view"]), seen / (n * points * 3), atol=1e-12)


@pytest.mark.parametrize("name", NAMES + PLATES)
def test_errors_follow_from_the_deflections(conforms, name):
    cube = cube_of(name)
    reference = cube["reference_deflection"]
    scale = 100 / abs(reference).max("point")
    error = abs(cube["measured_deflection"].astype(float) - reference) * scale
    mean = np.sqrt((error**2).mean("point")).transpose("setting", "mode", "trial")
    largest = error.max("point").transpose("setting", "mode", "trial")
    literal = error.isel(trial=0).transpose("setting", "mode", "point")
    conforms.independent(cube["mean_error"], mean, rtol=1e-5)
    conforms.independent(cube["max_point_error"], largest, rtol=1e-5)
    conforms.independent(cube["point_error"], literal, atol=1e-4)
    assert (cube["mean_error"] <= cube["max_point_error"]).all()
    assert (cube["mac"] <= 1 + 1e-12).all()
    assert (cube["mac"] >= 0).all()


def test_narrow_lens_loses_part_of_the_beam():
    # 100 mm on a 36 mm sensor sees ±90 mm across at 500 mm, of a beam of ±312 mm.
    wide, narrow = (
        cube_of("beam-distance", focal_length_mm=f)["in_view"].values for f in (24.0, 100.0)
    )
    assert np.all(wide[1:] == 1)
    assert narrow[0] < 0.5
    assert np.all(np.diff(narrow) > 0)


def test_ground_sample_distance_follows_distance_and_resolution(conforms):
    step = cube_of("beam-distance")["ground_sample_distance"]
    conforms.closed_form(step, np.array([0.5, 0.75, 1, 1.5]) * 36 / 24 / 320, rtol=1e-7)
    conforms.closed_form(
        cube_of("beam-resolution")["ground_sample_distance"],
        0.5 * 36 / 24 / np.array([320, 640, 1280, 1920]),
        rtol=1e-7,
    )


@pytest.mark.parametrize("known", [False, True])
def test_shifting_the_pixel_grid_is_shifting_the_principal_point(conforms, known):
    study = validate_request("beam-aperture", {})
    cameras = study.settings()[1].cameras(24, 36)
    shapes = [deflection_shape(study.structure, m, study.structure.markers, 5.5e-3)
              for m in (1, 2)]  # fmt: skip
    points = world_points(study.structure, np.array([np.zeros(25), *shapes]))
    shifts = rounding.grid_shifts(4, 3, 2)
    measured = measure_deflections(cameras, points, shifts, known)
    for trial, shift in enumerate(shifts):
        K = cameras.K.copy()
        K[:, :2, 2] += shift
        moved = replace(cameras, K=K)
        alone = measure_deflections(moved, points, np.zeros((1, 2, 2)), known)
        conforms.invariance(measured[:, trial], alone[:, 0], atol=1e-11)


@pytest.mark.parametrize("known", [False, True])
def test_analytic_centre_takes_the_slabs_that_a_shifted_grid_leaves(conforms, known):
    study = validate_request("beam-aperture", {})
    cameras = study.settings()[1].cameras(24, 36)
    shape = deflection_shape(study.structure, 2, study.structure.markers, 5.5e-3)
    points = world_points(study.structure, np.array([np.zeros(25), shape]))
    shifts = rounding.grid_shifts(4, 3, 2)
    measured = measure_deflections(cameras, points, shifts, known, "analytic-centre")
    plain = measure_deflections(cameras, points, shifts, known)
    assert not np.allclose(measured, plain)
    for trial, shift in enumerate(shifts):
        slabs = np.rint(project(cameras.P, points) + shift[:, :, None, None])
        slabs -= shift[:, :, None, None]
        centre = analytic_centre(cameras.P, slabs)
        assert centre.feasible.all()
        rest = points[2, 0] if known else centre.points[2, 0]
        conforms.independent(measured[0, trial], centre.points[2, 1] - rest, atol=1e-12)


def test_prediction_of_the_analytic_centre_is_said_to_be_that_of_least_squares():
    plain = cube_of("beam-distance", trials=2)
    centre = cube_of("beam-distance", trials=2, estimator="analytic-centre")
    xr.testing.assert_equal(plain["predicted_error"], centre["predicted_error"])
    law = "rms error over the trials by the law of rounding"
    assert plain["predicted_error"].attrs["long_name"] == law
    assert centre["predicted_error"].attrs["long_name"] == f"{law}, of least squares"
    assert not np.allclose(plain["mean_error"], centre["mean_error"])
    words = []
    for cube, estimator in ((plain, "least-squares"), (centre, "analytic-centre")):
        study = validate_request("beam-distance", {"trials": 2, "estimator": estimator})
        whole = with_provenance(cube, study, 0.0)
        assert json.loads(whole.attrs["parameters"])["estimator"] == estimator
        words.append(whole.attrs["predicts"])
        assert words[-1] in error_table(whole).data
    assert words == ["law of rounding", "law of rounding of least squares"]


@pytest.mark.parametrize("rest", ["rebuilt", "known"])
def test_noise_is_simulated_and_predicted_for_least_squares(conforms, rest):
    cube = cube_of("beam-aperture", trials=400, noise_px=0.2, rest=rest)
    drawn = np.sqrt(np.mean(cube["mean_error"].values[:, :, 1:] ** 2, axis=2))
    conforms.sampled(cube["predicted_error"] / drawn, 1, atol=0.05)
    law = "rms error over the trials by the law of rounding and noise"
    assert cube["predicted_error"].attrs["long_name"] == law
    clean = cube_of("beam-aperture", trials=400, rest=rest)
    assert (cube["predicted_error"] > clean["predicted_error"]).all()


@pytest.mark.nightly
def test_interval_is_told_the_noise_and_better_than_both_others(conforms):
    values = {"cases": ("4c",), "trials": 100, "modes": (1, 2)}
    for noise_px, gain in ((0.05, 0.9), (0.3, 1.01)):
        squares, centres, means = (
            np.sqrt((cube_of("plate-arrays", estimator=name, noise_px=noise_px, **values)
                     ["mean_error"].values[-1] ** 2).mean())
            for name in ("least-squares", "analytic-centre", "interval")
        )  # fmt: skip
        conforms.sampled(means / squares, below=gain)
        conforms.sampled(means / centres, below=1.01)
    study = validate_request("plate-arrays", {"estimator": "interval", "noise_px": 0.1})
    assert study.predicted_by == "law of rounding and noise of least squares"


def same(one, other):
    for variable in ("measured_deflection", "mean_error", "mac", "predicted_error"):
        xr.testing.assert_allclose(
            one[variable].drop_vars("setting", errors="ignore"),
            other[variable].drop_vars("setting", errors="ignore"), rtol=1e-6, atol=1e-10,
        )  # fmt: skip


def test_a_trial_does_not_depend_on_how_many_there_are():
    same(cube_of("beam-aperture").isel(trial=slice(8)), cube_of("beam-aperture", trials=7))


def test_a_setting_does_not_depend_on_the_others():
    alone = studies.run(validate_request("beam-aperture", {"trials": 20, "cases": ["2d", "2b"]}))
    together = cube_of("beam-aperture")
    for case in ("2b", "2d"):
        same(*(cube.isel(setting=cube["case"].values == case) for cube in (alone, together)))
    one = studies.run(validate_request("beam-distance", {"trials": 20, "distances_mm": [1000.0]}))
    same(one, cube_of("beam-distance").isel(setting=[2]))


def test_a_mode_does_not_depend_on_the_others():
    shuffled = studies.run(validate_request("beam-distance", {"trials": 20, "modes": [3, 1]}))
    np.testing.assert_array_equal(shuffled["mode"], [3, 1])
    same(shuffled, cube_of("beam-distance").sel(mode=[3, 1]))


def test_the_seed_changes_the_trials_but_not_the_nominal_run(conforms):
    one, other = cube_of("beam-distance"), cube_of("beam-distance", seed=1)
    conforms.invariance(one["mean_error"][..., 0], other["mean_error"][..., 0], atol=0)
    assert (one["mean_error"][..., 1:] != other["mean_error"][..., 1:]).all()


@pytest.mark.parametrize(
    ("name", "expected_mm", "atol"),
    [
        ("beam-distance", [5.52, 0.789, 0.252], 5e-3),
        ("plate-distance", [62.6e-6, 32.9e-6, 12.2e-6], 0.06e-6),
    ],
)
def test_force_gives_the_response_to_one_newton(conforms, name, expected_mm, atol):
    reference = cube_of(name, amplitude_mm="force")["reference_deflection"]
    unit = cube_of(name, amplitude_mm=1.0)["reference_deflection"]
    millimetres = (reference / unit).values
    conforms.closed_form(millimetres.T - expected_mm, 0, atol=atol)


def test_each_mode_may_have_its_amplitude(conforms):
    study = validate_request("beam-distance", {"trials": 0, "amplitude_mm": [1.0, 2.0, 4.0]})
    one = cube_of("beam-distance", amplitude_mm=1.0)["reference_deflection"].values
    several = studies.run(study)["reference_deflection"].values
    conforms.invariance(several, one * np.array([[1], [2], [4]]), rtol=1e-12)


def test_a_finer_grid_has_more_markers_between_the_same_edges(conforms):
    cube = cube_of("plate-distance", grid=(30, 20))
    assert cube.sizes["point"] == 600
    for edge, length in (("x", 0.668), ("y", 0.443)):
        conforms.closed_form(float(cube[edge].min() + cube[edge].max()), length, rtol=1e-6)
    coarse = cube_of("plate-distance")
    # The law does not know the number of markers: its mean over them stays.
    ratio = cube["predicted_error"] / coarse["predicted_error"]
    conforms.invariance(ratio, 1, atol=0.1)


def test_own_layout_joins_the_cases():
    layout = {"mine": [[[0, 30], [120, 30]], [[0, 30], [120, 30], [240, 30]]]}
    study = validate_request("beam-arrays", {"trials": 3, "cases": ["4b"], "layouts": layout})
    cube = studies.run(study)
    assert list(cube["case"].values) == ["4b"] * 4 + ["mine"] * 2
    np.testing.assert_array_equal(cube["camera_azimuth"].values[5, :4], [0, 120, 240, np.nan])


def written(path, name="beam-distance", seconds=0.25):
    study = validate_request(name, {"trials": 5})
    cube = with_provenance(studies.run(study), study, seconds)
    cube.attrs |= {"created": "2000-01-01T00:00:00+00:00", "peak_memory_mb": np.float64(300)}
    storage.write_netcdf(cube, path)
    return cube


def test_equal_runs_give_equal_bytes(tmp_path, monkeypatch):
    files = []
    for commit, seconds in (("abc", 0.25), ("abc", 0.25), ("0123456789ab+", 123.456)):
        monkeypatch.setattr(schema, "_commit", lambda commit=commit: commit)
        path = tmp_path / f"{len(files)}.nc"
        written(path, seconds=seconds)
        files.append(path.read_bytes())
    assert files[0] == files[1]
    # The run-dependent attributes are of fixed length: nothing else moves with them.
    assert len(files[2]) == len(files[0])
    assert 0 < sum(a != b for a, b in zip(files[0], files[2], strict=True)) < 40


@pytest.mark.parametrize("content", [None, b"not a cube"])
def test_what_is_not_a_cube_is_refused_in_one_line(tmp_path, content):
    path = tmp_path / "file.nc"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(cubes.CubeError, match=r"file\.nc") as caught:
        cube_file.read_cube(path)
    assert "\n" not in str(caught.value)


def test_a_cut_cube_is_refused_wherever_it_is_cut(tmp_path):
    whole, cut = tmp_path / "whole.nc", tmp_path / "cut.nc"
    values = np.linspace(0.0, 1.0, 3000, dtype=np.float32).reshape(3, 1000)
    cube = xr.Dataset({"a": (("x", "y"), values), "case": ("x", ["1", "2", "3"])})
    storage.write_netcdf(cube, whole, compact=True)
    content = whole.read_bytes()
    for size in range(0, len(content), len(content) // 20):
        cut.write_bytes(content[:size])
        with pytest.raises(cubes.CubeError, match=r"^[^\n]*cut\.nc[^\n]*$"):
            storage.open_netcdf(cut)
    xr.testing.assert_identical(storage.open_netcdf(whole)["case"], cube["case"])


@pytest.mark.parametrize("count", [10**8, 10**12], ids=["0.8 GB", "8 TB"])
def test_a_small_cube_that_would_fill_the_memory_is_refused(tmp_path, count):
    path = tmp_path / "bomb.nc"
    storage.write_netcdf(xr.Dataset({"a": ("x", np.zeros(3))}), path)
    with h5py.File(path, "a") as file:
        file.create_dataset("b", (count,), "f8", chunks=(2**20,)).make_scale("b")
    with pytest.raises(cubes.CubeError, match=r"^[^\n]*bomb\.nc: not a cube[^\n]* MB\)$"):
        storage.open_netcdf(path)


@pytest.mark.parametrize("limit", [1, 3000, 100_000])
def test_a_full_disk_is_an_error_and_not_the_end_of_the_process(tmp_path, limit):
    cube = xr.Dataset({"a": ("x", np.random.default_rng(0).random(30_000))})
    storage.write_netcdf(cube.assign(a=0 * cube["a"]), tmp_path / "a.nc")
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, hard))
    try:
        with pytest.raises(OSError, match="File too large"):
            storage.write_netcdf(cube, tmp_path / "a.nc")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    gc.collect()
    assert not storage.open_netcdf(tmp_path / "a.nc")["a"].any()
    assert [path.name for path in tmp_path.iterdir()] == ["a.nc"]


@pytest.mark.parametrize("kind", ["netCDF-3", "HDF5", "empty HDF5"])
def test_a_cube_in_another_format_is_refused_in_one_line(tmp_path, kind):
    path = tmp_path / "foreign.nc"
    if kind == "netCDF-3":
        xr.Dataset({"a": ("x", [1.0, 2.0])}).to_netcdf(path, engine="scipy")
    else:
        with h5py.File(path, "w") as file:
            if kind == "HDF5":
                file.create_group("deep")["values"] = np.arange(5.0)
                file["values"] = np.arange(7.0)
    with pytest.raises(cubes.CubeError, match=r"^[^\n]*foreign\.nc[^\n]*$"):
        cube_file.read_cube(path)


@pytest.mark.parametrize("dtype", storage.MANTISSA_BITS, ids=str)
@pytest.mark.parametrize("kind", ["numbers", "halves", "tiny", "large", "odd"])
def test_rounded_mantissas_are_the_nearest(kind, dtype):
    random, bits, machine = np.random.default_rng(3), storage.MANTISSA_BITS[dtype], np.finfo(dtype)
    half = 2.0 ** -(bits + 1)
    values = {
        "numbers": random.normal(size=1000),
        "halves": 1 + (2 * np.arange(100) + 1) * half,  # between two
        "tiny": random.normal(size=1000) * 1e3 * float(machine.smallest_subnormal),
        "large": np.array([0.999, -0.999]) * machine.max,
        "odd": np.array([0.0, -0.0, np.nan, np.inf, -np.inf]),
    }[kind].astype(dtype)
    kept = storage._round_mantissa(xr.Variable("x", values)).values
    whole = np.dtype(f"u{dtype.itemsize}").type
    left = kept[np.isfinite(kept)].view(whole)
    assert not np.any(left & whole(2 ** (machine.nmant - bits) - 1))
    np.testing.assert_allclose(kept, values, rtol=half, atol=half * float(machine.tiny))
    assert np.array_equal(np.signbit(kept), np.signbit(values))


def test_physics_needs_neither_labels_nor_figures():
    forbidden = ["xarray", "matplotlib", "ipywidgets", "pandas", "pydantic", "h5py"]
    code = (
        "import sys; from thesis_lib.vision import pinhole, triangulation, rounding, optics, "
        "analytic_centre, interval, dither, cone_law, simulation; "
        "from thesis_lib.vibration import structure, panel, finite_elements, motion, polygons; "
        "from thesis_lib.acoustics import radiation, planes, surfaces, estimates; "
        f"print([m for m in {forbidden} if m in sys.modules], 'numpy' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[] True"


def test_most_stated_mean_errors_of_chapter_3_are_met(conforms):
    checks = [
        check
        for name in NAMES
        for check in verdicts.check_claims(default_cube(name), claims.claims_of(name))
        if check.claim.quantity == "mean_error"
    ]
    assert len(checks) == 66
    conforms.sampled(sum(check.inside for check in checks), above=0.7 * 66)
