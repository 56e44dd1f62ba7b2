"""The planner: best layouts, what they cost, and the cheapest that reaches the target."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np
from pydantic_core import PydanticCustomError

from thesis_lib.arrays import Array
from thesis_lib.planning import errors, sound
from thesis_lib.planning.bodies import Body
from thesis_lib.planning.lattice import first_most
from thesis_lib.planning.limits import no_room, nowhere, unreached
from thesis_lib.planning.optimum import information, layout_cost, lower_bound, variances
from thesis_lib.planning.places import Scene, candidates
from thesis_lib.planning.request import PlanRequest
from thesis_lib.planning.search import Surroundings, best_layouts
from thesis_lib.studies.request import ParameterError

_SHARP = 40  # power of the variances that weigh markers in the bound of the largest


@dataclass(frozen=True)
class Option:
    """A number of cameras of one kind, best placed."""

    #: Places: azimuth and elevation in rad, distance in m, focal length over sensor width, shape
    #: (cameras, 4)
    layout: Array
    resolution: tuple[int, int]  #: Width and height in px
    kind: int  #: Which of the resolutions that is
    frame_rate: float  #: In Hz
    cost: float  #: Pixels per second of all cameras, or their price
    expected: float  #: Largest error of a mode in %, averaged over amplitudes
    #: Error of every marker by the law of rounding, at the amplitude asked for, in %, shape
    #: (modes, markers)
    point: Array
    predicted: Array  #: The error that counts, of each mode, shape (modes,)
    bound: float  #: What `expected` of no layout on the grid of the search can be below
    scene: Scene  #: What was optimised
    instead: Instead | None = None  #: What this was planned for sound in place of

    @property
    def error(self) -> float:
        """Largest error of a mode in %."""
        return float(self.predicted.max())

    @property
    def pixel_rate(self) -> float:
        """Pixels per second of all cameras."""
        return len(self.layout) * self.resolution[0] * self.resolution[1] * self.frame_rate


@dataclass(frozen=True)
class Instead:
    """The plan for the shape, which one for sound began with, and its sound's errors by mode, %."""

    plan: Option
    field: Array


@dataclass(frozen=True)
class Verified:
    """Simulation of an option, by mode in %: rms over the trials, and 5 and 95 % quantiles."""

    simulated: Array
    band: Array


@dataclass(frozen=True)
class Plan:
    """What was found."""

    request: PlanRequest  #: What was asked
    body: Body  #: What is measured
    options: list[Option]  #: Every number of cameras with every resolution
    verified: list[Verified]  #: Their simulations
    front: list[int]  #: Options that no other beats in cost without being less accurate, by cost
    chosen: int  #: The cheapest that reaches the target, or without a target the most accurate
    candidates: int  #: Places on the grid of the search


def plan(
    request: PlanRequest, body: Body | None = None, tell: Callable[[str], object] = lambda _: None
) -> Plan:
    """Find the best layouts for a request.

    Parameters
    ----------
    request : PlanRequest
        Validated parameters.
    body : Body, optional
        What is measured, if it is not the request's beam or plate.
    tell : callable
        Is told, line by line, how far it is.

    Raises
    ------
    ImpossibleError
        If no camera may stand anywhere, markers are never seen, or the target is out of reach.
    ParameterError
        If the request does not go with the body.
    """
    body = body or request.measured
    try:
        request.check_with(body)
    except PydanticCustomError as error:
        raise ParameterError(f"plan: {error.message()}") from None
    rate = request.frame_rate(body)
    options: list[Option] = []
    total = 0
    for kinds in _aspects(request).values():
        scene = request.scene(body, kinds[0])
        grid = candidates(scene, np.radians(request.step_deg))
        if not len(grid):
            raise nowhere(scene, request)
        total += len(grid)
        options += _options(scene, grid, kinds, request, rate, tell)
    options.sort(key=lambda one: (one.kind, len(one.layout)))
    if request.goal != "shape":
        tell("moving cameras for the sound")
        options = for_sound(options, request)
    front = pareto([one.cost for one in options], [one.error for one in options])
    verified = [_verified(one, request) for one in options]
    chosen = _cheapest(options, verified, front, request)
    return Plan(request, body, options, verified, front, chosen, total)


def for_sound(options: Sequence[Option], request: PlanRequest) -> list[Option]:
    """Plans for the shape, each moved for the sound; no bound of theirs is known."""
    sounds, goal = request.sounds, request.goal
    assert goal != "shape"
    about: dict[float, Surroundings] = {}
    found = []
    for one in options:
        around = about.setdefault(one.scene.aspect, Surroundings(one.scene))
        width = one.resolution[0]
        layout = sound.moved(sounds, around, one.layout, width, goal)
        field, own = (
            sound.predicted(sounds, one.scene, each, width, goal) for each in (one.layout, layout)
        )
        found.append(
            replace(
                one,
                layout=layout,
                predicted=own,
                bound=np.nan,
                instead=Instead(one, field),
                expected=float(sound.averaged(sounds, one.scene, layout, width, goal).max()),
                point=errors.predicted(one.scene, layout, width),
            )
        )
    return found


def _verified(one: Option, request: PlanRequest) -> Verified:
    drawn = max(request.trials, 1), request.seed, request.estimator
    asked = one.scene, one.layout, one.resolution[0], *drawn
    if request.goal != "shape":
        return Verified(*sound.simulated(request.sounds, errors.drawn(*asked), request.goal))
    found, at = errors.simulated(*asked), first_most(one.point)
    return Verified(found.error(request.objective, at), found.band(request.objective))


def pareto(costs: Sequence[float], errors_: Sequence[float]) -> list[int]:
    """Indices of what nothing else beats in one without losing in the other, by rising cost.

    Examples
    --------
    >>> pareto([1, 2, 2, 3], [5.0, 4.0, 6.0, 4.0])
    [0, 1]
    """
    front: list[int] = []
    least = np.inf
    for i in sorted(range(len(costs)), key=lambda i: (costs[i], errors_[i], i)):
        if errors_[i] < least:
            front.append(i)
            least = errors_[i]
    return front


def _aspects(request: PlanRequest) -> dict[Fraction, list[int]]:
    """Resolutions by height over width: those of one shape share their layouts."""
    groups: dict[Fraction, list[int]] = {}
    for kind, (width, height) in enumerate(request.resolutions_px):
        groups.setdefault(Fraction(height, width), []).append(kind)
    return groups


def _options(
    scene: Scene,
    grid: Array,
    kinds: Sequence[int],
    request: PlanRequest,
    rate: float,
    tell: Callable[[str], object],
) -> list[Option]:
    counts, start = sorted(request.counts), time.monotonic()
    tell(f"{len(grid)} places to choose from; looking for the best of {counts} cameras")

    def placed(n: int) -> None:
        tell(f"{n} cameras placed, {time.monotonic() - start:.0f} s")

    asked = request.objective, request.starts, request.seed
    made = best_layouts(scene, grid, counts, *asked, placed)
    if all(layout is None for layout in made):
        raise no_room(scene, grid, counts[0], request)
    known = information(scene, grid)
    factor = errors.averaged(scene)
    options = []
    for layout in made:
        if layout is None:
            continue
        value = layout_cost(scene, layout, request.objective)
        bound = lower_bound(known, len(layout), _weights(scene, layout, request.objective))
        for kind in kinds:
            width, height = request.resolutions_px[kind]
            point = errors.predicted(scene, layout, width)
            pixels = len(layout) * width * height * rate
            price = len(layout) * request.prices[kind] if request.prices else pixels
            options.append(
                Option(
                    layout,
                    (width, height),
                    kind,
                    rate,
                    price,
                    factor * np.sqrt(value) / width,
                    point,
                    errors.counted(point, request.objective),
                    factor * np.sqrt(bound) / width,
                    scene,
                )
            )
    return options


def _weights(scene: Scene, layout: Array, objective: str) -> Array:
    """Weights of the markers for :func:`lower_bound`: alike, or where the errors are largest."""
    variance = variances(information(scene, layout).sum(axis=1))
    power = (variance / variance.max()) ** (_SHARP if objective == "worst" else 0)
    return np.asarray(power / power.sum())


def _cheapest(
    options: list[Option], verified: list[Verified], front: list[int], request: PlanRequest
) -> int:
    target = request.target_percent
    if target is None:
        return front[-1]
    order = sorted(range(len(options)), key=lambda i: (options[i].cost, options[i].error))
    for i in order:
        if max(options[i].error, float(verified[i].simulated.max())) <= target:
            return i
    raise unreached(options[front[-1]], request)
