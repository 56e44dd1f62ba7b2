"""Find the best camera layouts, their cost, and the cheapest one that reaches the target.

A plan is returned as a labelled cube, and as a table of cameras.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr
from pydantic_core import PydanticCustomError

from thesis_lib.arrays import Array, stack_padded
from thesis_lib.planning import errors, positions, search, sound
from thesis_lib.planning.errors import exchange_cameras, layout_cost, place_information
from thesis_lib.planning.positions import Body, Scene, candidate_positions, too_near
from thesis_lib.planning.request import MAX_CAMERAS, PlanRequest
from thesis_lib.studies.fields import MAX_WIDTH_PX, format_given
from thesis_lib.studies.request import ParameterError
from thesis_lib.studies.schema import label_values, read_variables
from thesis_lib.templates import join_words


class ImpossibleError(ParameterError):
    """A request without a plan; the message is one line and names the binding limit."""


def ease_limits(scene: Scene) -> dict[str, Scene]:
    """Return, by parameter, the scene without its limit; distances keep clear of the body."""
    reach, rules = scene.body.reach + max(scene.peaks), scene.rules
    free: dict[str, dict[str, Any]] = {
        "separation_mm": {"separation": 0.0},
        "tilt_deg": {"tilt": np.pi / 2},
        "in_view": {"in_view": 1e-6},  # one marker
        "elevations_deg": {"elevations": (-np.pi / 2, np.pi / 2)},
        "azimuths_deg": {"azimuths": (-np.pi, np.pi)},
        "distances_mm": {"distances": (1.05 * reach, 100 * max(reach, rules.distances[1]))},
        "forbidden_boxes_mm": {"boxes": np.zeros((0, 3, 2))},
        "forbidden_spheres_mm": {"spheres": np.zeros((0, 4))},
        "forbidden_sectors_deg": {"sectors": np.zeros((0, 4))},
    }
    return {name: replace(scene, rules=replace(rules, **limit)) for name, limit in free.items()}


def _text(request: PlanRequest, field: str) -> str:
    return f"{field}={format_given(getattr(request, field))}"


def explain_nowhere(scene: Scene, request: PlanRequest) -> ImpossibleError:
    """Explain which limits leave no camera position."""
    step, nowhere = np.radians(request.step_deg), "plan: no camera may stand anywhere; binding:"
    # parameters that bind alone: without the limit of one of them there are positions
    eased = ease_limits(scene)
    eased["focal_lengths_mm"] = replace(scene, focals=(min(scene.focals) / 100,))
    if found := [field for field, one in eased.items() if len(candidate_positions(one, step))]:
        text = " or ".join(_text(request, field) for field in found)
        return ImpossibleError(f"{nowhere} {text} (any of these eased alone leaves places)")
    why = "several limits together, of which to ease one alone is not enough"
    return ImpossibleError(f"{nowhere} {why}")


def explain_no_layout(
    scene: Scene, grid: Array, count: int, request: PlanRequest
) -> ImpossibleError:
    """Explain why there is no layout: cameras too close, or a marker that fewer than two see."""
    seen = (place_information(scene, grid)[0] > 0).sum(axis=0)
    if seen.min() < 2:
        worst = int(np.argmin(seen))
        return ImpossibleError(
            f"plan: marker {worst + 1} of {len(seen)} is in view of {seen[worst]} of {len(grid)} "
            f"places, and two cameras must see it; binding: {_text(request, 'tilt_deg')}, "
            f"{_text(request, 'elevations_deg')}, {_text(request, 'azimuths_deg')}"
        )
    binding = " or ".join(_text(request, f) for f in ("separation_mm", "counts", "in_view"))
    no_layout = f"{count} cameras find no room, or cannot see every marker twice"
    return ImpossibleError(f"plan: {no_layout}; binding: {binding}")


def explain_unreached(best: Option, request: PlanRequest) -> ImpossibleError:
    """Explain a target out of reach: what it needs, and which limit on positions costs most."""
    target, n, scene = request.target_percent, len(best.layout), best.scene
    assert target is not None
    ratio = best.reached / target
    eased: dict[str, float] = {}
    start = _grid_cost(scene, n, request)  # infinite if only finer grids have room
    for field, free in ease_limits(scene).items() if np.isfinite(start) else ():
        if field != "in_view" and any(
            not np.array_equal(limit, getattr(scene.rules, name))
            for name, limit in vars(free.rules).items()
        ):
            eased[field] = best.reached * np.sqrt(_grid_cost(free, n, request) / start)
    most = min(eased, key=lambda field: eased[field], default="")
    simulated = " in its simulation" if best.reached > best.error else ""
    needs = (
        (best.resolution[0] * ratio, MAX_WIDTH_PX, "px across"),
        (np.ceil(n * ratio * ratio), MAX_CAMERAS, "cameras"),
    )
    ways = [f"about {needed:.0f} {unit}" for needed, bound, unit in needs if needed <= bound]
    beyond = f"more than {MAX_WIDTH_PX} px across or {MAX_CAMERAS} cameras, the most of any plan"
    text = (
        f"plan: target_percent: given {target:g} %, but the best of these plans ({n} cameras, "
        f"{best.resolution[0]}×{best.resolution[1]} px) reaches {best.reached:.3g} %{simulated}; "
        f"binding: resolutions_px and counts (it takes {' or '.join(ways) or beyond})"
    )
    if most and eased[most] < 0.99 * best.reached:
        text += f"; of the limits on places {_text(request, most)} costs most "
        text += f"(without it about {eased[most]:.3g} %)"
    return ImpossibleError(text)


def _grid_cost(scene: Scene, n: int, request: PlanRequest) -> float:
    """Return the cost of the best layout on a coarse grid; infinite if there is no room."""
    grid = candidate_positions(scene, np.radians(max(request.step_deg, 15.0)))
    if not len(grid):
        return np.inf
    known = place_information(scene, grid)
    chosen, _ = exchange_cameras(known, too_near(scene, grid, grid), [-1] * n, request.objective)
    return np.inf if -1 in chosen else errors.combined_cost(known[:, chosen], request.objective)


@dataclass(frozen=True)
class Option:
    """The best layout found for a number of cameras with one resolution."""

    #: Positions: azimuth and elevation in rad, distance in m, focal length over sensor width, shape
    #: (cameras, 4)
    layout: Array
    resolution: tuple[int, int]  #: Width and height in px
    kind: int  #: Index of the resolution in the request
    frame_rate: float  #: In Hz
    pixel_rate: float  #: Pixels per second of all cameras
    cost: float  #: Pixels per second of all cameras, or their price
    expected: float  #: Largest error of a mode in %, averaged over amplitudes
    #: Error of every marker by the law of rounding, at the requested amplitude, in %, shape
    #: (modes, markers)
    point: Array
    predicted: Array  #: Error in the request's goal and objective by mode, in %, shape (modes,)
    bound: float  #: Lower bound of `expected` for all layouts on the search grid
    scene: Scene  #: Scene that was optimised
    #: Simulation in %: rms over the trials (modes,), and 5 and 95 % quantiles (2, modes)
    simulated: Any = None
    band: Any = None
    #: Plan for the shape from which one for sound started, and its sound errors by mode in %
    shape_plan: Option | None = None
    shape_plan_error: Array | None = None

    @property
    def error(self) -> float:
        """Return the largest error of a mode in %."""
        return float(self.predicted.max())

    @property
    def reached(self) -> float:
        """Return the error in % that a target bounds: predicted or simulated, the larger."""
        return max(self.error, float(self.simulated.max()))


@dataclass(frozen=True)
class Plan:
    """Result of a planning request."""

    request: PlanRequest  #: Parameters
    body: Body  #: Measured body
    options: list[Option]  #: Every number of cameras with every resolution
    front: list[int]  #: Indices of the Pareto-optimal options in cost and error, by rising cost
    chosen: int  #: Index of the cheapest to reach the target, or without one of the most accurate
    candidates: int  #: Number of positions on the search grid


def plan(
    request: PlanRequest, body: Body | None = None, tell: Callable[[str], object] = lambda _: None
) -> Plan:
    """Find the best layouts for a request.

    Parameters
    ----------
    request : PlanRequest
        Validated parameters.
    body : Body, optional
        Measured body, if it is not the request's beam or plate.
    tell : callable
        Called with lines about the progress.

    Raises
    ------
    ImpossibleError
        If no position is allowed, markers are never seen, or the target is out of reach.
    ParameterError
        If the request does not fit the body.
    """
    body = body or request.measured
    try:
        request.check_with(body)
    except PydanticCustomError as error:
        raise ParameterError(f"plan: {error.message()}") from None
    options: list[Option] = []
    total = 0
    aspects: dict[Fraction, list[int]] = {}  # resolutions of one aspect ratio share layouts
    for kind, (width, height) in enumerate(request.resolutions_px):
        aspects.setdefault(Fraction(height, width), []).append(kind)
    for kinds in aspects.values():
        scene = request.scene(body, kinds[0])
        grid = candidate_positions(scene, np.radians(request.step_deg))
        if not len(grid):
            raise explain_nowhere(scene, request)
        total += len(grid)
        options += _options(scene, grid, kinds, request, tell)
    options.sort(key=lambda one: (one.kind, len(one.layout)))
    if request.goal != "shape":
        tell("moving cameras for the sound")
        options = optimise_for_sound(options, request)
    draws = max(request.trials, 1), request.seed, request.estimator
    for i, one in enumerate(options):
        wrong = errors.draw_errors(one.scene, one.layout, one.resolution[0], *draws)
        if request.goal == "shape":
            found = errors.simulate_errors(one.scene, wrong, request.objective, one.point)
        else:
            found = sound.simulate_sound_errors(request.sounds, wrong, request.goal)
        options[i] = replace(one, simulated=found[0], band=found[1])
    front = pareto([one.cost for one in options], [one.error for one in options])
    chosen, target = front[-1], request.target_percent
    if target is not None:
        reached = [i for i, one in enumerate(options) if one.reached <= target]
        if not reached:
            raise explain_unreached(min(options, key=lambda one: one.reached), request)
        chosen = min(reached, key=lambda i: (options[i].cost, options[i].error))
    return Plan(request, body, options, front, chosen, total)


def optimise_for_sound(options: Sequence[Option], request: PlanRequest) -> list[Option]:
    """Return the shape plans with cameras moved for the sound; their bounds are unknown: NaN."""
    sounds, goal = request.sounds, request.goal
    assert goal != "shape"
    found = []
    for one in options:
        width = one.resolution[0]
        layout = sound.move_cameras(sounds, one.scene, one.layout, width, goal)
        by_shape, own = (
            sound.predict_sound_errors(sounds, one.scene, each, width, goal)
            for each in (one.layout, layout)
        )
        averaged = sound.average_sound_error(sounds, one.scene, layout, width, goal)
        point, worst = errors.predict_errors(one.scene, layout, width), float(averaged.max())
        moved = replace(one, layout=layout, predicted=own, expected=worst, point=point)
        found.append(replace(moved, bound=np.nan, shape_plan=one, shape_plan_error=by_shape))
    return found


def pareto(costs: Sequence[float], errors_: Sequence[float]) -> list[int]:
    """Return the indices of the Pareto-optimal pairs of cost and error, by rising cost.

    Errors count as equal if they differ by round-off alone.

    Examples
    --------
    >>> pareto([1, 2, 2, 3], [5.0, 4.0, 6.0, 4.0])
    [0, 1]
    """
    front: list[int] = []
    least = np.inf
    for i in sorted(range(len(costs)), key=lambda i: (costs[i], errors_[i], i)):
        if errors_[i] < least * (1 - positions.MAX_TIE_RATIO):
            front.append(i)
            least = errors_[i]
    return front


def _options(
    scene: Scene,
    grid: Array,
    kinds: Sequence[int],
    request: PlanRequest,
    tell: Callable[[str], object],
) -> list[Option]:
    counts, start, rate = sorted(request.counts), time.monotonic(), request.frame_rate(scene.body)
    tell(f"{len(grid)} places to choose from; looking for the best of {counts} cameras")

    asked, made = (request.objective, request.starts, request.seed), []
    for n, layout in search.best_layouts(scene, grid, counts, *asked):
        made.append(layout)
        tell(f"{n} cameras placed, {time.monotonic() - start:.0f} s")
    if not made:
        raise explain_no_layout(scene, grid, counts[0], request)
    if missing := set(counts) - set(map(len, made)):
        tell(f"left out: {join_words(sorted(missing))} cameras, for which no layout was found")
    known = place_information(scene, grid)
    factor = errors.average_error(scene)
    options = []
    for layout in made:
        value = layout_cost(scene, layout, request.objective)
        # the bound weights markers equally, or those with the largest errors most
        variance = errors.normal_variances(place_information(scene, layout).sum(axis=1))
        power = (variance / variance.max()) ** (40 if request.objective == "worst" else 0)
        bound = errors.lower_bound(known, len(layout), power / power.sum())
        for kind in kinds:
            width, height = request.resolutions_px[kind]
            point = errors.predict_errors(scene, layout, width)
            pixels = len(layout) * width * height * rate
            price = len(layout) * request.prices[kind] if request.prices else pixels
            expected, least = (factor * np.sqrt(each) / width for each in (value, bound))
            own = errors.objective_error(point, request.objective)
            found = kind, rate, pixels, price, expected, point, own, least, scene
            options.append(Option(layout, (width, height), *found))
    return options


CAMERA_COLUMNS = (
    "camera", "x_mm", "y_mm", "z_mm", "azimuth_deg", "elevation_deg", "distance_mm",
    "focal_length_mm", "width_px", "height_px", "frame_rate_hz",
)  # fmt: skip
SOUND_VARIABLES = read_variables(__file__, "sound")
VARIABLES = read_variables(__file__, "plan")
COORDINATES = read_variables(__file__, "coordinates")


def camera_table(cube: xr.Dataset, option: int) -> str:
    """Return the cameras of an option as CSV."""
    one = cube.isel(option=option)
    rows = []
    for i in range(int(one["n_cameras"])):
        camera = one.isel(camera=i)
        lengths = 1000 * camera["camera_position"].values
        angles = float(camera["camera_azimuth"]), float(camera["camera_elevation"])
        place = [f"{round(value, 3) + 0.0:.3f}" for value in (*lengths.tolist(), *angles)]
        distance, focal = (1000 * float(camera[f]) for f in ("camera_distance", "focal_length"))
        size = int(one["width_px"]), int(one["height_px"])
        rate = f"{float(one['frame_rate']):g}"
        rows.append([i + 1, *place, f"{distance:.3f}", f"{focal:g}", *size, rate])
    return pd.DataFrame(rows, columns=CAMERA_COLUMNS).to_csv(index=False, lineterminator="\n")


def as_cube(made: Plan) -> xr.Dataset:
    """Return the cube of a plan: every option, the proposed one marker by marker."""
    options, body = made.options, made.body
    best = options[made.chosen]
    rows = []  # azimuth and elevation in degrees, distance and focal length in m, position in m
    for one in options:
        azimuth, elevation, distance, focal = one.layout.T
        turned = np.mod(np.degrees(azimuth) + 180, 360) - 180
        focal = focal * made.request.sensor_width_mm / 1000
        centres = positions.camera_centres(one.scene, one.layout)
        columns = [turned, np.degrees(elevation), distance, focal, centres]
        rows.append(np.column_stack(columns))
    places = stack_padded(rows)
    values: dict[str, Any] = {
        "n_cameras": [len(one.layout) for one in options],
        "width_px": [one.resolution[0] for one in options],
        "height_px": [one.resolution[1] for one in options],
        "frame_rate": [one.frame_rate for one in options],
        "pixel_rate": [one.pixel_rate for one in options],
        "cost": [one.cost for one in options],
        "expected_error": [one.expected for one in options],
        "bound": [one.bound for one in options],
        "predicted_error": [one.predicted for one in options],
        "simulated_error": [one.simulated for one in options],
        "simulated_low": [one.band[0] for one in options],
        "simulated_high": [one.band[1] for one in options],
        "on_front": [int(i in made.front) for i in range(len(options))],
        "chosen": made.chosen,
        "camera_azimuth": places[:, :, 0],
        "camera_elevation": places[:, :, 1],
        "camera_distance": places[:, :, 2],
        "focal_length": places[:, :, 3],
        "camera_position": places[:, :, 4:],
        "point_error": errors.predict_errors(best.scene, best.layout, best.resolution[0]),
        "marker": body.points.T,
        "normal": body.normals.T,
        "reference_deflection": body.shapes * np.array(made.request.peaks_m)[:, None],
        "outline": _outline(made).T,
        "frequency": body.frequencies,
    }
    cube = xr.Dataset(
        coords=label_values({"mode": body.modes, "axis": list("xyz")}, COORDINATES),
        attrs={
            "structure": body.name,
            "candidates": np.int64(made.candidates),
            "cost_is": "price" if made.request.prices else "pixels per second",
            "objective": made.request.objective,
            "target_percent": json.dumps(made.request.target_percent),
        },
    )
    cube = cube.assign(label_values({name: values[name] for name in VARIABLES}, VARIABLES))
    if best.shape_plan:
        cube.attrs["goal"] = made.request.goal
        before = {"shape_plan_error": [one.shape_plan_error for one in options]}
        cube = cube.assign(label_values(before, SOUND_VARIABLES))
    return cube


def _outline(made: Plan) -> Array:
    """Return the structure's corners, or those of the box around its markers as a closed path."""
    if made.body.outline.size:
        return made.body.outline
    low, high = made.body.points.min(axis=1), made.body.points.max(axis=1)
    bottom = [(0, 0), (1, 0), (1, 1), (0, 1)]
    # around the bottom, up, and around the top, down and up again at each other corner
    walk = [(*corner, 0) for corner in (*bottom, bottom[0])] + [(0, 0, 1)]
    walk += [(*corner, up) for corner in bottom[1:] for up in (1, 0, 1)] + [(0, 0, 1)]
    return low[:, None] + np.array(walk).T * (high - low)[:, None]
