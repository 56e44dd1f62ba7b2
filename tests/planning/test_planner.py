"""The planner: known optima, limits that are kept, plans that cannot be, files that are whole."""

import csv
import itertools
import json
import re
import shlex
import signal
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray as xr
from command import thesis
from refused import line_of
from scenes import plans
from scenes.plans import plate, scene_of

from thesis_lib.figure_sets.parametric import compute as studies
from thesis_lib.figure_sets.registry import validate_request
from thesis_lib.planning import errors, positions, report, search, structure_file
from thesis_lib.planning.planner import CAMERA_COLUMNS, ImpossibleError, pareto, plan
from thesis_lib.planning.report import PLAN_FILES, format_study_command, write_plan
from thesis_lib.planning.request import plan_request
from thesis_lib.studies.request import ParameterError
from thesis_lib.vision.pinhole import hemisphere_cameras, hemisphere_directions, project
from thesis_lib.vision.triangulation import point_covariance

OBJECTIVES = ("mean", "worst")
QUICK = {"counts": [2, 4], "starts": 1, "step_deg": 15, "trials": 60}


def point_body():
    """One marker that moves along Z."""
    return plans.body("point", np.zeros((3, 1)), np.array([[0.0], [0], [1]]), np.ones(1))


def best(scene, count, objective="mean", step=15.0, starts=2):
    grid = positions.candidate_positions(scene, np.radians(step))
    ((_, layout),) = search.best_layouts(scene, grid, [count], objective, starts, 0)
    return layout


def matrices(layout, size):
    rigs = [hemisphere_cameras(r, [a], [e], size[0] * f, size) for a, e, r, f in layout]
    return np.concatenate([rig.P for rig in rigs])


# The quantity that is optimised.


def test_variance_is_that_of_triangulation_by_cameras_of_the_hemisphere(conforms):
    scene = scene_of(plate())
    layout = np.array([[0.3, 0.4, 1.0, 0.6], [-1.2, 0.9, 1.1, 0.7], [2.5, 0.2, 0.9, 0.65]])
    P = matrices(layout, (640, 360))
    conforms.independent(positions.place_cameras(scene, layout, 640).P, P, rtol=1e-12)
    expected = point_covariance(P, scene.body.points)[2, 2]
    found = errors.normal_variances(errors.place_information(scene, layout).sum(axis=1)) / 640**2
    conforms.independent(found, expected, rtol=1e-9)


@pytest.mark.parametrize(
    ("azimuth", "elevation", "low", "high"), [(4, 41, 0.6, 0.9), (90, 20, 0.9, 1.05)]
)
def test_averaged_law_is_that_of_many_amplitudes_and_spares_narrow_pairs(
    conforms, azimuth, elevation, low, high
):
    scene = scene_of(plate(), peak=5e-3, tilt=np.pi)
    layout = positions.combine_positions(
        np.radians([[azimuth, elevation], [-azimuth, elevation]]), 1.0, 24 / 36
    )
    law = errors.average_predicted(scene, layout, 640)
    scales = np.linspace(*errors.AMPLITUDE_RANGE, 101)
    peaks = [replace(scene, peaks=tuple(scale * one for one in scene.peaks)) for scale in scales]
    metres = [errors.predict_errors(one, layout, 640) / errors.percent_factor(one) for one in peaks]
    mean = np.sqrt(np.mean(np.square(metres), axis=(0, 2))) * errors.percent_factor(scene)[:, 0]
    conforms.independent(law, mean.max(), rtol=0.02)
    noise = errors.average_error(scene) / 640 * np.sqrt(errors.layout_cost(scene, layout, "mean"))
    conforms.sampled(law / noise, above=low, below=high)


# Known optima.


@pytest.mark.parametrize("count", [2, 5])
def test_one_marker_is_seen_best_from_the_lowest_cone(conforms, count):
    low = np.radians(20)
    scene = scene_of(point_body(), elevations=(low, np.pi / 2), separation=0.05)
    layout = best(scene, count)
    closed = 1.0 / ((24 / 36) ** 2 * count * np.cos(low) ** 2)  # R²/(f² N sin²θ), θ from normal
    conforms.closed_form(errors.layout_cost(scene, layout, "mean"), closed, rtol=1e-6)
    conforms.closed_form(layout[:, 1], low, atol=1e-6)


@pytest.mark.parametrize("objective", OBJECTIVES)
@pytest.mark.parametrize("count", [2, 4])
def test_exchange_finds_what_trying_every_set_finds(conforms, count, objective):
    scene = scene_of(plate(), separation=0.3)
    grid = positions.candidate_positions(scene, np.radians(40))
    rng = np.random.default_rng(count)
    grid = grid[rng.choice(len(grid), 14, replace=False)]
    known, near = errors.place_information(scene, grid), positions.too_near(scene, grid, grid)
    sets = itertools.combinations(range(14), count)
    sets = [c for c in sets if near[np.ix_(c, c)].sum() == count]  # each is near itself
    costs = [errors.combined_cost(known[:, list(c)], objective) for c in sets]
    starts = [[-1] * count] + [list(rng.permutation(14)[:count]) for _ in range(20)]
    layouts = [errors.exchange_cameras(known, near, start, objective)[0] for start in starts]
    least = min(layouts, key=lambda one: errors.combined_cost(known[:, one], objective))
    conforms.independent(errors.combined_cost(known[:, least], objective), min(costs), rtol=1e-9)
    assert tuple(sorted(least)) == sets[int(np.argmin(costs))]


def test_no_set_of_places_is_below_the_bound(conforms):
    scene = scene_of(plate())
    grid = positions.candidate_positions(scene, np.radians(40))
    known = errors.place_information(scene, grid)
    rng = np.random.default_rng(0)
    for weights in (np.full(20, 1 / 20), rng.dirichlet(np.ones(20))):
        bound = errors.lower_bound(known, 3, weights)
        for _ in range(300):
            three = rng.integers(0, len(grid), 3)  # places may be shared
            variance = errors.normal_variances(known[:, three].sum(axis=1))
            conforms.closed_form(bound, below=weights @ variance * (1 + 1e-9))
            conforms.closed_form(bound, below=variance.max() * (1 + 1e-9))
    scene = scene_of(point_body(), elevations=(np.radians(20), np.pi / 2))
    known = errors.place_information(scene, positions.candidate_positions(scene, np.radians(10)))
    closed = 1.0 / ((24 / 36) ** 2 * 4 * np.cos(np.radians(20)) ** 2)
    conforms.closed_form(errors.lower_bound(known, 4, np.ones(1)), closed, rtol=1e-3)


# Invariances.


def test_a_mirrored_room_has_mirrored_plans_of_equal_value(conforms):
    west = scene_of(plate(), sectors=np.radians([[30.0, 150, -90, 90]]), separation=0.2)
    east = scene_of(plate(), sectors=np.radians([[-150.0, -30, -90, 90]]), separation=0.2)
    one, other = best(west, 3), best(east, 3)
    cost = errors.layout_cost(west, one, "mean")
    conforms.invariance(errors.layout_cost(east, other, "mean"), cost, rtol=1e-3)
    mirrored = one * [-1, 1, 1, 1]
    assert positions.is_allowed(east, mirrored)
    conforms.invariance(errors.layout_cost(east, mirrored, "mean"), cost, rtol=1e-9)


# Limits.

LIMITS = {
    "tilt": {"tilt": np.radians(60)},
    "elevation": {"elevations": np.radians((30.0, 50.0))},
    "azimuth over a turn": {"azimuths": np.radians((170.0, 250.0))},
    "regions": {
        "boxes": np.array([[[-2.0, 0.1], [-2, 2], [-2, 2]]]),
        "spheres": np.array([[0.7, 0.0, 0.2, 0.6]]),
        "sectors": np.radians([[60.0, 90, -90, 90]]),
    },
    "separation": {"separation": 0.6, "distances": (0.9, 0.95)},
}


@pytest.mark.few(5)
@pytest.mark.parametrize("objective", OBJECTIVES)
@pytest.mark.parametrize("limit", LIMITS)
def test_limits_are_kept_by_an_independent_check(limit, objective):
    scene = scene_of(plate(), **{"distances": (0.7, 1.5), "separation": 0.1, **LIMITS[limit]})
    layout = best(scene, 4, objective, 20.0, 1)
    r, tolerance = scene.rules, 1e-6
    azimuth, elevation, distance, _ = layout.T
    flat = distance * np.cos(elevation)
    up = distance * np.sin(elevation)
    where = np.stack([flat * np.sin(azimuth), flat * np.cos(azimuth), up], axis=1)
    turned = np.mod(azimuth - r.azimuths[0] + tolerance, 2 * np.pi) - tolerance
    width = r.azimuths[1] - r.azimuths[0]
    for value, (low, high) in (
        (distance, r.distances), (elevation, r.elevations), (turned, (0, width))
    ):  # fmt: skip
        assert np.all((value >= low - tolerance) & (value <= high + tolerance))
    for one, other in itertools.combinations(where, 2):
        assert np.linalg.norm(one - other) >= r.separation - tolerance
    for box in r.boxes:
        inside = np.all((where > box[:, 0] + tolerance) & (where < box[:, 1] - tolerance), axis=1)
        assert not inside.any()
    for sphere in r.spheres:
        assert np.all(np.linalg.norm(where - sphere[:3], axis=1) >= sphere[3] - tolerance)
    for west, east, bottom, top in r.sectors:
        turn = np.mod(azimuth - west, 2 * np.pi)
        inside = (turn > tolerance) & (turn < east - west - tolerance)
        assert not np.any(inside & (elevation > bottom) & (elevation < top))
    sight = where[:, :, None] - scene.body.points
    tilt = np.arccos(sight[:, 2] / np.linalg.norm(sight, axis=1))
    assert np.all(tilt <= r.tilt + tolerance)
    P = matrices(layout, (1600, 900))
    u, v = np.moveaxis(project(P, scene.body.deflected(scene.peaks)), 1, 0)
    assert np.all((u > -0.01) & (u < 1600.01) & (v > -0.01) & (v < 900.01))


# The front, the cheapest, the simulation.


@pytest.fixture(scope="module")
def made():
    return plan(plan_request({**QUICK, "counts": [2, 3, 4, 6], "trials": 200}))


def test_cheapest_reaches_the_target_and_nothing_cheaper_does(conforms, made):
    target, best_ = made.request.target_percent, made.options[made.chosen]
    conforms.sampled(best_.simulated.max(), below=target)
    assert np.all((best_.band[0] <= best_.simulated) & (best_.simulated <= best_.band[1]))
    for one in made.options:
        if one.cost < best_.cost:
            assert max(one.error, one.simulated.max()) > target
    costs, errors_ = np.array([(one.cost, one.error) for one in made.options]).T
    front = list(pareto(costs, errors_))
    assert np.all(np.diff(costs[front]) > 0)
    for cost, error in zip(costs, errors_, strict=True):
        assert np.any((costs[front] <= cost) & (errors_[front] <= error))


def test_what_is_as_accurate_but_for_noise_and_dearer_is_not_on_the_front():
    assert pareto([1, 2, 3, 4], [1.0, 1 - 1e-15, 1 - 2e-15, 0.9]) == [0, 3]


def test_counts_without_a_layout_are_told_as_left_out():
    told: list[str] = []
    values = {
        "counts": [2, 6, 8],
        "separation_mm": 750,
        "target_percent": None,
        "distances_mm": [500, 500],
    }
    made = plan(plan_request({**QUICK, **values}), tell=told.append)
    numbers = {len(one.layout) for one in made.options}
    assert numbers == {int(line.split()[0]) for line in told if " cameras placed" in line} == {2}
    assert "left out: 6 and 8 cameras, for which no layout was found" in told


def test_a_plan_is_confirmed_by_the_study_that_it_names(conforms):
    request = plan_request({**QUICK, "distances_mm": [500, 500], "target_percent": None,
                            "resolutions_px": [[640, 360]], "seed": 7,
                            "estimator": "analytic-centre"})  # fmt: skip
    made = plan(request)
    best_ = made.options[made.chosen]
    words = format_study_command(request, best_.layout, best_.resolution)
    assert words.startswith("thesis run beam-arrays")
    values = dict(word.partition("=")[::2] for word in shlex.split(words)[4::2])
    estimator = {"estimator": values.pop("estimator")}
    values = {key: json.loads(value) for key, value in values.items()} | estimator
    cube = studies.run(validate_request("beam-arrays", values))
    conforms.sampled(cube["predicted_error"].values[-1], best_.predicted, rtol=2e-2)
    assert int(cube["n_cameras"][-1]) == len(best_.layout)
    drawn = cube["mean_error"][-1].values[:, 1:]  # the same draws, angles to 0.001° apart
    conforms.independent(np.sqrt(np.mean(drawn**2, axis=1)), best_.simulated, rtol=3e-3)
    partly = request.model_copy(update={"in_view": 0.5})
    assert format_study_command(partly, best_.layout, best_.resolution) == ""


# Structures from files.


def strip(**changed):
    """A curved strip, its normals outwards, as a structure file has it."""
    angle = np.linspace(-0.7, 0.7, 9)
    data = {
        "x": ("point", 0.3 * np.sin(angle)), "y": ("point", 0 * angle),
        "z": ("point", 0.3 * np.cos(angle)), "nx": ("point", 2 * np.sin(angle)),
        "ny": ("point", 0 * angle), "nz": ("point", 2 * np.cos(angle)),
        "shape": (("mode", "point"), np.stack([np.cos(2 * angle), 3 * np.sin(4 * angle)])),
        "frequency": ("mode", np.array([20.0, 55.0])),
    }  # fmt: skip
    data.update(changed)
    return xr.Dataset({name: value for name, value in data.items() if value is not None})


def written(tmp_path, data):
    path = tmp_path / "strip.nc"
    data.to_netcdf(path)
    return path


def test_file_gives_unit_normals_and_shapes_with_a_peak_of_one(tmp_path):
    body = structure_file.read_body(written(tmp_path, strip()), [1, 2])
    assert np.linalg.norm(body.normals, axis=0) == pytest.approx(1.0)
    assert np.max(np.abs(body.shapes), axis=1) == pytest.approx(1.0)
    assert body.frequencies.tolist() == [20.0, 55.0]
    flat = structure_file.read_body(written(tmp_path, strip(nx=None, ny=None, nz=None)), [2])
    assert np.array_equal(flat.normals[2], np.ones(9))
    numbered = strip().assign_coords(mode=[3, 7])
    assert structure_file.read_body(written(tmp_path, numbered), [7]).frequencies.tolist() == [55.0]


def test_the_pages_example_of_a_file_can_be_planned_for(tmp_path, monkeypatch):
    page = Path(__file__).parents[2] / "book" / "planner.md"
    (code,) = re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)
    monkeypatch.chdir(tmp_path)
    exec(code, {})
    words = ["-pcounts=[4]", "-ptarget_percent=null", "-pmodes=[1]", "-pstep_deg=20", "-pstarts=0",
             "-ptrials=10"]  # fmt: skip
    done = thesis("plan", "--structure", "strip.nc", *words, "--out", "made")
    assert done.status == 0, done.err
    with xr.open_dataset(tmp_path / "made" / "plan.nc") as cube:
        assert cube.attrs["structure_file"] == "strip.nc"


def test_a_turned_structure_is_measured_as_well(conforms):
    """The plate on its side, cameras around the whole sphere: the optimum does not change."""
    turn = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])  # Z to +Y
    body = plate()
    lying = scene_of(body, distances=(2.0, 2.0), elevations=(-np.pi / 2, np.pi / 2),
                     tilt=np.radians(70), separation=0.2, in_view=1.0)  # fmt: skip
    standing = replace(
        lying, body=replace(body, points=turn @ body.points, normals=turn @ body.normals)
    )
    one, other = (errors.layout_cost(s, best(s, 4, step=10.0), "mean") for s in (lying, standing))
    conforms.invariance(other, one, rtol=5e-3)


def test_cameras_that_see_parts_of_a_curved_structure_are_predicted_and_simulated(
    conforms, tmp_path
):
    body = structure_file.read_body(written(tmp_path, strip()), [1, 2])
    request = plan_request({
        "counts": [6], "modes": [1, 2], "in_view": 0.3, "tilt_deg": 55, "target_percent": None,
        "resolutions_px": [[640, 360]], "starts": 2, "step_deg": 15, "trials": 400,
    })  # fmt: skip
    made = plan(request, body)
    one = made.options[0]
    seen = positions.visible_markers(one.scene, one.layout)
    assert not seen.all()
    assert np.all(seen.sum(axis=0) >= 2)
    conforms.sampled(one.simulated, one.predicted, rtol=0.06)


BROKEN = {
    "no shape": (strip(shape=None), "shape(mode, point)"),
    "one normal": (strip(nx=None, ny=None), "nx(point)"),
    "words": (strip(frequency=("mode", ["low", "high"])), "frequency(mode)"),
    "named modes": (strip().assign_coords(mode=["a", "b"]), "modes 1, 2"),
    "NaN": (strip(x=("point", [np.nan, *range(8)])), "finite"),
    "negative": (strip(frequency=("mode", [1.0, -2.0])), "-2"),
    "millimetres": (strip(x=("point", np.linspace(-300, 300, 9))), "not in mm"),
    "twice": (strip(x=("point", np.zeros(9)), z=("point", np.zeros(9))), "different places"),
    "modes that are not there": (strip().assign_coords(mode=[2, 3]), "mode"),
    "empty": (strip().isel(point=slice(0, 0)), "at least one"),
}  # fmt: skip


@pytest.mark.parametrize("what", [*BROKEN, "another kind of file"])
def test_a_file_that_is_no_structure_is_refused_in_one_line(tmp_path, what):
    data, words = BROKEN.get(what, (strip(), ""))
    path = written(tmp_path, data)
    if what not in BROKEN:
        path.write_text("solid cube\nendsolid\n")
    line = line_of(ParameterError, structure_file.read_body, path, [1])
    assert words in line
    assert str(path) in line


def test_a_small_file_that_would_fill_the_memory_is_refused(tmp_path):
    path = written(tmp_path, strip(x=None))
    huge = {"shape": (10**12,), "dtype": "f8", "chunks": (2**20,), "compression": "gzip"}
    with h5py.File(path, "a") as file:
        file.create_dataset("x", **huge).make_scale("x")
    with pytest.raises(structure_file.StructureFileError, match=r"8e\+06 MB, but the markers"):
        structure_file.read_body(path, [1])
    path = written(tmp_path, strip())
    with h5py.File(path, "a") as file:  # what is of no use here is left alone
        file.create_dataset("stress", **huge).make_scale("stress")
    assert structure_file.read_body(path, [1]).points.shape == (3, 9)


# Requests that are wrong, and plans that cannot be.

BAD = [
    ("boddy", "beam", "did you mean body"),
    ("counts", [1], "counts[0]"),
    ("frame_rates_hz", [10, 30], "276.9 Hz or more, since mode 3"),
    ("distances_mm", [300, 1500], "more than 3"),
    ("elevations_deg", [50, 40], "elevations_deg"),
    ("forbidden_boxes_mm", [[1, 0, 0, 1, 0, 1]], "forbidden_boxes_mm"),
    ("plane", "YZ", 'with goal "sound-plane"'),
    ("plate_mm", [600, 400, 3], 'with body "plate"'),  # the body is a beam
]


@pytest.mark.parametrize(("field", "value", "words"), BAD)
def test_wrong_requests_are_refused_in_one_line(field, value, words):
    with pytest.raises(ParameterError) as refused:
        plan(plan_request({field: value}))
    assert not isinstance(refused.value, ImpossibleError)
    text = str(refused.value)
    assert text.startswith("plan: ")
    assert text.isprintable()
    assert words in text


IMPOSSIBLE = [
    ({"target_percent": 0.001}, ["resolutions_px and counts (it takes more than 20000 px across"]),
    ({"target_percent": 1, "resolutions_px": [[320, 180]], "elevations_deg": [75, 90]},
     ["px across); of the limits", "elevations_deg=[75.0, 90.0] costs most"]),
    # 5.55 % by the law, which is below the target, and 5.81 % in the simulation
    ({"target_percent": 5.7, "resolutions_px": [[640, 360]], "distances_mm": [500, 500], "seed": 7},
     ["target_percent: given 5.7 %", "reaches 5.81 %"]),
    ({"tilt_deg": 5, "elevations_deg": [5, 30]}, ["binding", "tilt_deg=5.0"]),
    ({"forbidden_spheres_mm": [[0, 0, 0, 2000]]}, ["_spheres_mm=[[0.0, 0.0, 0.0, 2000.0]]"]),
    ({"separation_mm": 50_000}, ["2 cameras find no room", "separation_mm=50000.0"]),
    ({"in_view": 0.01, "focal_lengths_mm": [400]}, ["marker 1 of 25", "two cameras must see it"]),
]  # fmt: skip


@pytest.mark.parametrize(("values", "words"), IMPOSSIBLE)
def test_impossible_plans_name_the_limit_that_binds(values, words):
    line = line_of(ImpossibleError, plan, plan_request({**QUICK, **values}))
    assert line.startswith("plan: ")
    assert all(word in line for word in words), line


def test_the_binding_limit_is_binding():
    """What the answer names, eased, makes the plan possible."""
    values = {**QUICK, "focal_lengths_mm": [60], "target_percent": None}
    with pytest.raises(ImpossibleError, match="distances_mm"):
        plan(plan_request({**values, "distances_mm": [500, 800]}))
    assert plan(plan_request({**values, "distances_mm": [500, 3000]}))


# The command.


def test_command_writes_four_whole_files_and_says_what_it_found(tmp_path):
    words = [f"-p{key}={json.dumps(value)}" for key, value in QUICK.items()]
    done = thesis("plan", *words, "--out", "made", cwd=tmp_path)
    assert done.status == 0, done.err
    folder = tmp_path / "made"
    assert sorted(folder.glob("[!.]*")) == sorted(folder / name for name in PLAN_FILES)
    assert "cameras of" in done.out
    said = thesis("compare", "made/plan.nc", cwd=tmp_path).err
    assert said.endswith("a result of `thesis plan`; compare takes those of `thesis run`\n")
    with xr.open_dataset(folder / "plan.nc") as cube:
        assert all({"units", "long_name"} <= set(cube[name].attrs) for name in cube.variables)
        chosen = cube.isel(option=int(cube["chosen"]))
        text = (folder / "plan.csv").read_text(encoding="utf-8")
        header, *rows = csv.reader(text.splitlines())
        assert tuple(header) == CAMERA_COLUMNS
        assert len(rows) == int(chosen["n_cameras"])
        x, y, z, azimuth, elevation, distance = np.array([row[1:7] for row in rows], float).T
        place = chosen["camera_position"].values[: len(rows)]
        np.testing.assert_allclose(np.stack([x, y, z], axis=1), 1000 * place, atol=2e-3)
        directions = hemisphere_directions(np.radians(azimuth), np.radians(elevation))
        np.testing.assert_allclose(distance[:, None] * directions, 1000 * place, atol=0.05)
    page = (folder / "plan.html").read_text(encoding="utf-8")
    assert "http://" not in page.replace("http://www.w3.org", "")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["target_percent=0.0001", "-p", "counts=[2]", "-p", "starts=0"], "target_percent: given"),
        (["body=plate", "--structure", "nothing.nc"], "given beside --structure"),
        (["modes=[1]", "--structure", ".", "--out", "made"], "this is a folder, not a file"),
        (["counts=[2]", "--out", "."], "--out"),
    ],
)
def test_command_refuses_in_one_line_and_writes_nothing(tmp_path, words, said):
    out = [] if "--out" in words else ["--out", "made"]
    done = thesis("plan", "-p", *words, *out, cwd=tmp_path)
    assert (done.status, done.out) == (2, "")
    *progress, refusal = done.err.splitlines()
    assert refusal.startswith("thesis: ")
    assert said in refusal
    assert all("camera" in line for line in progress)
    assert not list(tmp_path.iterdir())


def test_structures_of_one_name_have_folders_of_their_own(tmp_path, monkeypatch):
    made = []
    monkeypatch.setattr(report, "write_plan", lambda _, folder, *__: made.append(folder) or [])
    monkeypatch.chdir(tmp_path)
    for place, width in (("a", 0.1), ("b", 0.2), ("c", 0.1)):
        (tmp_path / place).mkdir()
        file = written(tmp_path / place, strip(y=("point", np.linspace(0, width, 9))))
        assert thesis("plan", "--structure", file).status == 0
    assert made[0] == made[2] != made[1]
    assert all(folder.name.startswith("plan-strip-") for folder in made)


@pytest.mark.nightly
@pytest.mark.usefixtures("interrupts_ignored")
def test_interrupted_command_leaves_nothing_half_written(checkout, start, tmp_path):
    words = ["-p", "counts=[2,12,24]", "-p", "starts=50", "-p", "body=plate"]
    log = tmp_path / "log.txt"
    command = start(checkout, log, "plan", *words, "--out", str(tmp_path / "made"))
    command.wait_for(lambda: "2 cameras placed" in command.said())
    command.process.send_signal(signal.SIGINT)
    command.process.wait(timeout=60)
    assert command.process.returncode == 130
    assert not (tmp_path / "made").exists()


@pytest.mark.slow
def test_a_plan_that_cannot_be_written_leaves_the_old_one(tmp_path, monkeypatch):
    request = plan_request({**QUICK, "counts": [2], "starts": 0, "trials": 5,
                            "target_percent": None})  # fmt: skip
    folder = tmp_path / "made"
    write_plan(request, folder)
    before = {path.name: path.read_bytes() for path in folder.iterdir()}

    def fail(*_):
        raise OSError("no space left on device")

    monkeypatch.setattr(report, "build_page", fail)
    with pytest.raises(OSError, match="no space"):
        write_plan(request, folder)
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before
