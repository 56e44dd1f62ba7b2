"""The cube of ``planner``: plans for standard questions, and the thesis's layouts."""

from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from thesis_lib.arrays import Array
from thesis_lib.facts import setups
from thesis_lib.figure_sets.planner.figure_set import READABLE_QUESTIONS, THESIS_QUESTIONS, Planner
from thesis_lib.planning import errors, planner, positions, sound
from thesis_lib.studies.schema import label_values, list_quantities, read_variables

_DROPPED_VARIABLES = ("chosen", "point_error", "marker", "normal", "reference_deflection")
VARIABLES = read_variables(__file__, "cube")
OF_THESIS = read_variables(__file__, "thesis")
FOR_SOUND = read_variables(__file__, "sound")


def run(study: Planner) -> xr.Dataset:
    """Compute the cube of the figure set ``planner``.

    It has the variables of a plan's cube along ``question``, and those of the thesis's layouts, at
    the first of the resolutions, along ``thesis_case`` and ``count``. Runs are compared by
    ``quantity``, ``value`` and ``unit``.
    """
    plans = {name: planner.plan(request) for name, request in study.questions.items()}
    cube = xr.concat(
        [_whole(planner.as_cube(one), one, study) for one in plans.values()],
        "question",
        join="outer",
        coords="minimal",
        compat="override",
        combine_attrs="drop_conflicts",
    )
    coords = {
        "question": list(plans),
        "count": sorted(study.counts),
        "structure": list(THESIS_QUESTIONS),
        "thesis_case": list(setups.camera_pairs()),
    }
    cube = cube.assign_coords(label_values(coords, VARIABLES))
    cube.attrs = {"cost_is": "pixels per second"}
    cube["averaged_law_ratio"].attrs = VARIABLES["averaged_law_ratio"].attributes
    own = np.array(
        [_of_thesis(study, plans[name], body) for body, name in THESIS_QUESTIONS.items()]
    )
    cube = cube.assign(
        label_values(dict(zip(OF_THESIS, np.moveaxis(own, 1, 0), strict=True)), OF_THESIS)
    )
    rows: list[tuple[str, float, str]] = []  # the published and compared quantities
    width = study.resolutions_px[0][0]
    for name in plans:
        one = cube.sel(question=name)
        for i in np.flatnonzero(one["width_px"].values == width):
            n = int(one["n_cameras"][i])
            expected = float(one["expected_error"][i])
            rows.append((f"{name}, {n} cameras, averaged error", expected, "percent"))
        best = cheapest_option(one, study.target_percent)
        rate = np.nan if best is None else float(one["cost"][best]) / 1e6
        rows.append((f"{name}, cheapest for the target", rate, "million pixels/s"))
    ratio = cube["simulated_error"] / cube["predicted_error"]
    rows.append(("simulated over predicted, least", float(ratio.min()), "1"))
    rows.append(("simulated over predicted, largest", float(ratio.max()), "1"))
    summary = list_quantities(rows)
    cube = cube.assign(label_values(summary, VARIABLES))
    return cube.assign(_for_sound(study, plans[READABLE_QUESTIONS["plate"]]))


def _whole(cube: xr.Dataset, made: planner.Plan, study: Planner) -> xr.Dataset:
    """Return a plan's cube with a row for every option asked for, NaN where none was found."""
    wanted = [(w, n) for w, _ in study.resolutions_px for n in sorted(study.counts)]
    have = [(one.resolution[0], len(one.layout)) for one in made.options]
    ratios = [
        errors.average_predicted(one.scene, one.layout, one.resolution[0]) / one.expected
        for one in made.options
    ]
    cube = (
        cube.drop_vars(_DROPPED_VARIABLES)
        .assign(averaged_law_ratio=("option", ratios))
        .pad(camera=(0, max(study.counts) - cube.sizes["camera"]), constant_values=np.nan)
        .astype(float)
        .assign_coords(option=list(map(str, have)))
        .reindex(option=list(map(str, wanted)))
        .drop_vars("option")
    )
    for name, column in zip(("width_px", "n_cameras"), zip(*wanted, strict=True), strict=True):
        cube[name] = ("option", list(column), cube[name].attrs)
    return cube


def _of_thesis(study: Planner, made: planner.Plan, body: str) -> Array:
    """Return ``OF_THESIS`` (variables, cases, counts) of a structure, at the first resolution."""
    scene, width = made.options[0].scene, study.resolutions_px[0][0]
    cases, counts = list(setups.camera_pairs()), sorted(study.counts)
    found: Array = np.full((len(OF_THESIS), len(cases), len(counts)), np.nan)
    factor = errors.average_error(scene) / width
    readable = replace(scene, rules=replace(scene.rules, tilt=float(np.radians(study.tilt_deg))))
    for (case, number), layout in study.thesis_layouts(body).items():
        cost = errors.layout_cost(scene, layout, "mean")
        if number not in counts or not np.isfinite(cost):
            continue
        point = errors.predict_errors(scene, layout, width)
        draws = study.trials, study.seed, "least-squares"
        drawn = errors.draw_errors(scene, layout, width, *draws)
        expected = factor * np.sqrt(cost)
        found[:, cases.index(case), counts.index(number)] = (
            expected,
            np.max(errors.objective_error(point, "mean")),
            np.max(errors.simulate_errors(scene, drawn, "mean", point)[0]),
            errors.average_predicted(scene, layout, width) / expected,
            np.mean(positions.visible_markers(readable, layout)),
        )
    return found


def _for_sound(study: Planner, made: planner.Plan) -> dict[str, Any]:
    """Return the plate's layouts for shape and sound, at the first resolution."""
    request = made.request.model_copy(update={"goal": "sound"})
    by_shape = [one for one in made.options if one.kind == 0]
    counts = sorted(study.counts)
    found = np.full((2, len(counts), 2, len(request.modes)), np.nan)
    shape, places = found[0, :, :, 0].copy(), np.full((3, len(counts), 2, max(counts)), np.nan)
    for plans in zip(by_shape, planner.optimise_for_sound(by_shape, request), strict=True):
        count = len(plans[0].layout)
        i = counts.index(count)
        for j, option in enumerate(plans):
            asked = option.scene, option.layout, option.resolution[0]
            drawn = errors.draw_errors(*asked, max(study.trials, 1), study.seed, "least-squares")
            found[0, i, j] = sound.predict_sound_errors(request.sounds, *asked)
            found[1, i, j] = sound.simulate_sound_errors(request.sounds, drawn)[0]
            shape[i, j] = errors.objective_error(option.point, "mean").max()
            angles, distance = np.degrees(option.layout[:, :2]), option.layout[:, 2:3]
            places[:, i, j, :count] = np.column_stack([angles, distance]).T
    values = dict(zip(FOR_SOUND, [*found, shape, *places, ["shape", "sound"]], strict=True))
    return label_values(values, FOR_SOUND)


def cheapest_option(one: xr.Dataset, target: float) -> int | None:
    """Return the cheapest option of a question that reaches a target, predicted and simulated."""
    kinds = [one[name].max("mode").values for name in ("predicted_error", "simulated_error")]
    worst, cost = np.max(kinds, axis=0), one["cost"].values
    good = [i for i in range(len(worst)) if worst[i] <= target]
    return min(good, key=lambda i: (cost[i], worst[i]), default=None)
