"""Camera studies end to end: the cubes, their files, and the thesis's stated errors."""

import gc
import resource
import subprocess
import sys
from functools import cache

import h5py
import numpy as np
import pytest
import xarray as xr

from benchmarks.reference import svd_triangulate
from thesis_lib.facts import claims
from thesis_lib.figure_sets import cube_file
from thesis_lib.figure_sets.parametric import compute as studies
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
PLATES = [name.replace("beam", "plate") for name in NAMES]
HERTZ = {"beam": [6.312, 39.56, 110.8], "plate": [305.5, 585.5, 942.1]}


@cache
def cube_of(name, **values):
    return studies.run(validate_request(name, {"trials": 20, **values}))


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
def test_settings_stand_in_the_order_of_the_tables(conforms, name):
    parameter, rows = TABLES[name]
    cube = cube_of(name)
    expected = [(case, value) for case, values in rows for value in values]
    assert list(zip(cube["case"].values, cube["value"].values, strict=True)) == expected
    assert set(cube["parameter"].values) == {parameter}
    if parameter in ("n_cameras", "width_px"):
        np.testing.assert_array_equal(cube[parameter], cube["value"])
    if parameter == "width_px":
        np.testing.assert_array_equal(cube["height_px"], [180, 360, 720, 1080])
    structure = validate_request(name, {}).structure
    np.testing.assert_array_equal([cube["x"], cube["y"]], structure.markers)
    conforms.closed_form(cube["frequency"], HERTZ[name.partition("-")[0]], rtol=5e-4)
    absent = np.arange(cube.sizes["camera"]) >= cube["n_cameras"].values[:, None]
    np.testing.assert_array_equal(np.isnan(cube["camera_azimuth"]), absent)


def test_case_4d_grows_from_the_steepest_pair_unless_asked_otherwise():
    printed = {"trials": 0, "cases": ["4d"], "pair_order": {"4d": "printed"}}
    asked = studies.run(validate_request("beam-arrays", printed))
    usual = cube_of("beam-arrays")
    usual = usual.isel(setting=usual["case"].values == "4d")
    for cube, order, expected in (
        (usual, "reversed", [58, 58, 48, 48, 28, 28, 8, 8]),
        (asked, "printed", [8, 8, 28, 28, 48, 48, 58, 58]),
    ):
        assert cube["camera_elevation"].values[3, :8].tolist() == expected
        assert set(cube["pair_order"].values) == {order}


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
        ("beam-distance", 0, 25.0, 70.0),  # parts of the beam leave the sensor as it moves
        ("beam-aperture", 5, 24.0, 5.5),
        ("plate-arrays", 13, 24.0, 10.0),
    ],
)
def test_nominal_run_is_the_thesis_written_as_a_loop(conforms, name, s, focal_mm, peak_mm):
    cube = cube_of(name, focal_length_mm=focal_mm, amplitude_mm=peak_mm).isel(setting=s)
    width, height = float(cube["width_px"]), float(cube["height_px"])
    n, points = int(cube["n_cameras"]), cube.sizes["point"]
    centre = {"beam": (0.623 / 2, 0.015), "plate": (0.334, 0.2215)}[name.split("-")[0]]
    axes = (cube[f"camera_{name}"].values[:n] for name in ("distance", "azimuth", "elevation"))
    places = zip(*axes, strict=True)
    P = np.stack([camera_matrix(*one, focal_mm / 36 * width, width, height) for one in places])
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
                whole = np.rint(np.round(uv, 9))  # blind to noise in the ninth decimal
                heights.append(svd_triangulate(P, whole[:, :, None])[2, 0])
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


@pytest.mark.parametrize("name", ["beam-arrays", "plate-distance"])
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


def test_ground_sample_distance_follows_distance_and_resolution(conforms):
    for name, distance, width in (
        ("distance", np.array([0.5, 0.75, 1, 1.5]), 320),
        ("resolution", 0.5, np.array([320, 640, 1280, 1920])),
    ):
        step = cube_of(f"beam-{name}")["ground_sample_distance"]
        conforms.closed_form(step, distance * 36 / 24 / width, rtol=1e-7)


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


@pytest.mark.slow
@pytest.mark.parametrize("rest", ["rebuilt", "known"])
def test_noise_is_simulated_and_predicted_for_least_squares(conforms, rest):
    cube = cube_of("beam-aperture", trials=400, noise_px=0.2, rest=rest)
    drawn = np.sqrt(np.mean(cube["mean_error"].values[:, :, 1:] ** 2, axis=2))
    conforms.sampled(cube["predicted_error"] / drawn, 1, atol=0.05)
    law = "rms error over the trials by the law of rounding and noise"
    assert cube["predicted_error"].attrs["long_name"] == law
    clean = cube_of("beam-aperture", trials=400, rest=rest)
    assert (cube["predicted_error"] > clean["predicted_error"]).all()


def test_a_result_depends_on_what_it_is_of_alone():
    """Not on how many trials, or which other settings and modes, are asked for."""
    for name, values, part in (
        ("beam-aperture", {"trials": 7}, {"trial": slice(8)}),
        ("beam-aperture", {"cases": ["2d", "2b"]}, {"setting": [12, 13, 14, 15, 4, 5, 6, 7]}),
        ("beam-distance", {"distances_mm": [1000.0]}, {"setting": [2]}),
        ("beam-distance", {"modes": [3, 1]}, {"mode": [2, 0]}),
    ):
        alone = studies.run(validate_request(name, {"trials": 20, **values}))
        among = cube_of(name).isel(part)
        for variable in ("measured_deflection", "mean_error", "mac"):
            np.testing.assert_allclose(alone[variable], among[variable], rtol=1e-6, atol=1e-10)
    one, other = cube_of("beam-distance"), cube_of("beam-distance", seed=1)
    np.testing.assert_array_equal(one["mean_error"][..., 0], other["mean_error"][..., 0])
    assert (one["mean_error"][..., 1:] != other["mean_error"][..., 1:]).all()


def test_amplitudes_are_given_once_for_each_mode_or_by_a_newton(conforms):
    def deflection(name, **values):
        asked = validate_request(name, {"trials": 0, **values})
        return studies.run(asked)["reference_deflection"].values

    for name, expected_mm, atol in (
        ("beam-distance", [5.52, 0.789, 0.252], 5e-3),
        ("plate-distance", [62.6e-6, 32.9e-6, 12.2e-6], 0.06e-6),
    ):
        unit = deflection(name, amplitude_mm=1.0)
        ratio = deflection(name, amplitude_mm="force") / unit
        conforms.closed_form(ratio.T - expected_mm, 0, atol=atol)
    several = deflection(name, amplitude_mm=[1.0, 2.0, 4.0])
    conforms.invariance(several, unit * np.array([[1], [2], [4]]), rtol=1e-12)


# Files.


def test_equal_runs_give_equal_bytes(tmp_path, monkeypatch):
    files = []
    study = validate_request("beam-distance", {"trials": 5})
    for commit, seconds in (("abc", 0.25), ("abc", 0.25), ("0123456789ab+", 123.456)):
        monkeypatch.setattr(schema, "describe_commit", lambda commit=commit: commit)
        cube = with_provenance(studies.run(study), study, seconds)
        cube.attrs |= {"created": "2000-01-01T00:00:00+00:00", "peak_memory_mb": np.float64(300)}
        storage.write_netcdf(cube, tmp_path / "cube.nc")
        files.append((tmp_path / "cube.nc").read_bytes())
    assert files[0] == files[1]
    # The run-dependent attributes are of fixed length: nothing else moves with them.
    assert len(files[2]) == len(files[0])
    assert 0 < sum(a != b for a, b in zip(files[0], files[2], strict=True)) < 40


@pytest.mark.parametrize("kind", ["missing", "netCDF-3", "HDF5", "would fill memory"])
def test_what_is_no_cube_is_refused_in_one_line(tmp_path, kind):
    path = tmp_path / "file.nc"
    if kind == "netCDF-3":
        xr.Dataset({"a": ("x", [1.0, 2.0])}).to_netcdf(path, engine="scipy")
    elif kind == "HDF5":
        with h5py.File(path, "w") as file:
            file.create_group("deep")["values"] = np.arange(5.0)
    elif kind == "would fill memory":
        storage.write_netcdf(xr.Dataset({"a": ("x", np.zeros(3))}), path)
        with h5py.File(path, "a") as file:
            file.create_dataset("b", (10**12,), "f8", chunks=(2**20,)).make_scale("b")
    with pytest.raises(cubes.CubeError, match=r"^[^\n]*file\.nc[^\n]*$"):
        cube_file.read_cube(path)


@pytest.mark.parametrize("limit", [1, 100_000])
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
        for check in verdicts.check_claims(
            studies.run(validate_request(name, {})), claims.claims_of(name)
        )
        if check.claim.quantity == "mean_error"
    ]
    assert len(checks) == 66
    conforms.sampled(sum(check.inside for check in checks), above=0.7 * 66)
