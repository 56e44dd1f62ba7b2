"""Which limit it is that binds, where a plan cannot be."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from thesis_lib.arrays import Array
from thesis_lib.planning.optimum import (
    cost,
    exchange,
    information,
    layout_cost,
    too_near,
    variances,
)
from thesis_lib.planning.places import Rules, Scene, candidates, sees_enough
from thesis_lib.planning.request import PlanRequest
from thesis_lib.studies.request import ParameterError

if TYPE_CHECKING:
    from thesis_lib.planning.planner import Option

FIELDS = (
    "tilt_deg",
    "in_view",
    "elevations_deg",
    "azimuths_deg",
    "distances_mm",
    "forbidden_boxes_mm",
    "forbidden_spheres_mm",
    "forbidden_sectors_deg",
)


class ImpossibleError(ParameterError):
    """A plan that cannot be; the message is one line and names the binding limit."""


def without(rules: Rules, field: str, reach: float) -> Rules:
    """The rules without the limit that a parameter sets; distances keep clear of the body."""
    full: dict[str, dict[str, object]] = {
        "tilt_deg": {"tilt": np.pi / 2},
        "in_view": {"in_view": 1e-6},  # one marker
        "elevations_deg": {"elevations": (-np.pi / 2, np.pi / 2)},
        "azimuths_deg": {"azimuths": (-np.pi, np.pi)},
        "distances_mm": {"distances": (1.05 * reach, 100 * max(reach, rules.distances[1]))},
        "forbidden_boxes_mm": {"boxes": np.zeros((0, 3, 2))},
        "forbidden_spheres_mm": {"spheres": np.zeros((0, 4))},
        "forbidden_sectors_deg": {"sectors": np.zeros((0, 4))},
        "separation_mm": {"separation": 0.0},
    }
    return replace(rules, **full[field])  # type: ignore[arg-type]


def binding(scene: Scene, step: float) -> list[str]:
    """Parameters each of which alone leaves no place: without its limit there are some."""
    reach = scene.body.reach + max(scene.peaks)
    eased = {f: replace(scene, rules=without(scene.rules, f, reach)) for f in FIELDS}
    eased["focal_lengths_mm"] = replace(scene, focals=(min(scene.focals) / 100,))
    return [field for field, one in eased.items() if len(candidates(one, step))]


def _text(request: PlanRequest, field: str) -> str:
    value = getattr(request, field)
    return f"{field}={list(value) if isinstance(value, tuple) else value}"


def nowhere(scene: Scene, request: PlanRequest) -> ImpossibleError:
    """No place is allowed: because of which limits."""
    step = np.radians(request.step_deg)
    found = binding(scene, step)
    if found:
        text = " or ".join(_text(request, field) for field in found)
        why = f"binding: {text} (any of these eased alone leaves places)"
        return ImpossibleError(f"plan: no camera may stand anywhere; {why}")
    bare = scene
    for field in FIELDS:
        if field not in ("tilt_deg", "in_view"):
            reach = scene.body.reach + max(scene.peaks)
            bare = replace(bare, rules=without(bare.rules, field, reach))
    if not np.any(sees_enough(bare, candidates(bare, step))):
        return ImpossibleError(
            f"plan: markers are never in view; binding: {_text(request, 'tilt_deg')} and "
            f"{_text(request, 'in_view')}"
        )
    return ImpossibleError(
        "plan: no camera may stand anywhere; binding: several limits together, of which to ease "
        "one alone is not enough"
    )


def no_room(scene: Scene, grid: Array, count: int, request: PlanRequest) -> ImpossibleError:
    """Places there are, but no layout: cameras too close, or a marker that two do not see."""
    seen = (information(scene, grid)[0] > 0).sum(axis=0)
    if seen.min() < 2:
        worst = int(np.argmin(seen))
        return ImpossibleError(
            f"plan: marker {worst + 1} of {len(seen)} is in view of {seen[worst]} of {len(grid)} "
            f"places, and two cameras must see it; binding: {_text(request, 'tilt_deg')}, "
            f"{_text(request, 'elevations_deg')}, {_text(request, 'azimuths_deg')}"
        )
    open_ = replace(scene, rules=without(scene.rules, "separation_mm", 0))
    layout, _ = exchange(
        information(open_, grid), too_near(open_, grid), [-1] * count, request.objective
    )
    if -1 not in layout and np.isfinite(layout_cost(open_, grid[layout], request.objective)):
        return ImpossibleError(
            f"plan: {count} cameras find no room; binding: {_text(request, 'separation_mm')}"
        )
    return ImpossibleError(
        f"plan: {count} cameras cannot see every marker twice; binding: {_text(request, 'counts')} "
        f"and {_text(request, 'in_view')}"
    )


def unreached(best: Option, request: PlanRequest) -> ImpossibleError:
    """The target is out of reach: what would be needed, and which limit on places costs most."""
    target, n, scene = request.target_percent, len(best.layout), best.scene
    assert target is not None
    ratio = best.error / target
    eased: dict[str, float] = {}
    start = _grid_cost(scene, n, request)
    for field in ("separation_mm", *FIELDS):
        reach = scene.body.reach + max(scene.peaks)
        free = replace(scene, rules=without(scene.rules, field, reach))
        if field == "in_view" or _same(free, scene):
            continue
        eased[field] = best.error * np.sqrt(_grid_cost(free, n, request) / start)
    most = min(eased, key=lambda field: eased[field], default="")
    text = (
        f"plan: target_percent: given {target:g}, but the best of these plans ({n} cameras, "
        f"{best.resolution[0]}×{best.resolution[1]} px) reaches {best.error:.3g}; binding: "
        f"resolutions_px and counts (it takes about {best.resolution[0] * ratio:.0f} px across, or "
        f"{int(np.ceil(n * ratio**2))} cameras)"
    )
    if most and eased[most] < 0.99 * best.error:
        least = f"(without it about {eased[most]:.3g})"
        text += f"; of the limits on places {_text(request, most)} costs most {least}"
    return ImpossibleError(text)


def _same(one: Scene, other: Scene) -> bool:
    return all(
        np.array_equal(getattr(one.rules, name), getattr(other.rules, name))
        for name in one.rules.__dataclass_fields__
    )


def _grid_cost(scene: Scene, n: int, request: PlanRequest) -> float:
    """Cost of the best layout on a coarse grid; infinite if there is no room."""
    grid = candidates(scene, np.radians(max(request.step_deg, 15.0)))
    if not len(grid):
        return np.inf
    known = information(scene, grid)
    chosen, _ = exchange(known, too_near(scene, grid), [-1] * n, request.objective)
    if -1 in chosen:
        return np.inf
    return float(cost(variances(known[:, chosen].sum(axis=1)), request.objective))
