"""Search for the best layouts: exchange on a grid, then local search with decreasing steps.

All decisions are between positions of :mod:`~thesis_lib.planning.positions` whose costs differ by
more than round-off, so they are the same on every machine. A fixed rule decides between layouts
that are equally good, such as mirror images.
"""

import itertools
from collections.abc import Iterator, Sequence

import numpy as np

from thesis_lib.arrays import Array, Mask
from thesis_lib.planning import errors, positions
from thesis_lib.planning.errors import exchange_cameras, layout_cost, place_information
from thesis_lib.planning.positions import Scene, too_near
from thesis_lib.vision.pinhole import hemisphere_directions

SEARCH_STEPS_RAD = np.radians([4, 2, 1, 0.5, 0.2, 0.1])
_MAX_ROUNDS = 50  # with one step; they converge long before
MAX_REFINED_LAYOUTS = 3  # best layouts for a number of cameras that are refined, and all that tie
_SHORT_STEPS, _LONG_STEPS = (-1, 0, 1), (-10, 10)
_STEP_PAIRS = (_SHORT_STEPS, _SHORT_STEPS), (_LONG_STEPS, (-1, 1)), ((-1, 1), _LONG_STEPS)
_SEARCH_DIRECTIONS = np.array([way for steps in _STEP_PAIRS for way in itertools.product(*steps)])
"""Steps in azimuth and elevation, along slanted limits, too."""


def find_neighbours(scene: Scene, layout: Array, step: float) -> tuple[Array, Mask]:
    """Find allowed positions about a `step` (rad) from a layout, and which camera may take which.

    They differ by a few steps in azimuth and elevation or none, and are at the camera's distance, a
    step nearer or farther, or at the nearest distance that sees enough markers.

    Returns
    -------
    tuple of ndarray
        Positions (places, 4), those of the layout first; and for every camera (cameras, places)
        whether it may take a position.
    """
    rules, n = scene.rules, len(layout)
    aside, up = np.tile(_SEARCH_DIRECTIONS, (n, 1)).T
    azimuth, elevation, distance, focal = np.repeat(layout, len(_SEARCH_DIRECTIONS), axis=0).T
    turn = step / np.maximum(np.cos(elevation), step)  # an azimuth is shorter near the pole
    across = positions.azimuths(azimuth + turn * aside, rules.azimuths)
    grid = np.column_stack([across, positions.angles(elevation + step * up, rules.elevations)])
    by = np.maximum(step * distance, 1 / positions.PER_METRE)
    far = [distance]
    if rules.distances[0] < rules.distances[1]:
        near = positions.nearest_distances(scene, grid, focal)
        far = [near, distance - by, distance, distance + by]
    rounded = [positions.lengths(d, rules.distances) for d in far]
    every = np.concatenate([positions.combine_positions(grid, d, focal) for d in rounded])
    camera = np.tile(np.repeat(np.arange(n), len(_SEARCH_DIRECTIONS)), len(far))
    _, first = np.unique(np.column_stack([camera, every]), axis=0, return_index=True)
    first = first[positions.are_permitted(scene, every[first])]
    whose = np.concatenate([np.arange(n), camera[first]]) == np.arange(n)[:, None]
    whose[:, :n] &= positions.are_permitted(scene, layout)
    return np.concatenate([layout, every[first]]), whose


def turn_layout(scene: Scene, layout: Array, angle: float) -> Array:
    """Return a layout turned by an angle (rad) about the mean of the markers' normals."""
    mean = scene.body.normals.mean(axis=1)
    axis = mean / max(np.linalg.norm(mean), positions.MAX_TIE_RATIO)
    sight = hemisphere_directions(layout[:, 0], layout[:, 1])
    sight = (
        sight * np.cos(angle)
        + np.cross(axis, sight) * np.sin(angle)
        + np.outer(sight @ axis, axis) * (1 - np.cos(angle))
    )
    out = layout.copy()
    out[:, 0] = positions.azimuths(np.arctan2(sight[:, 0], sight[:, 1]), scene.rules.azimuths)
    out[:, 1] = positions.angles(np.arcsin(np.clip(sight[:, 2], -1, 1)), scene.rules.elevations)
    return out


def refine_layout(scene: Scene, layout: Array, objective: str) -> Array:
    """Refine a layout in decreasing steps, by single cameras and as a whole, while costs fall."""
    best = layout_cost(scene, layout, objective)
    for step in SEARCH_STEPS_RAD:
        # moves of single cameras cannot leave a layout that improves only if all are turned
        least = SEARCH_STEPS_RAD[-1]
        for turn, reach in ((0.0, step), (step, least), (-step, least)):
            for _ in range(_MAX_ROUNDS):
                turned = turn_layout(scene, layout, turn) if turn else layout
                around, whose = find_neighbours(scene, turned, reach)
                start = [i if whose[i, i] else -1 for i in range(len(layout))]  # where allowed
                near, known = too_near(scene, around, around), place_information(scene, around)
                chosen, _ = exchange_cameras(known, near, start, objective, whose)
                if -1 in chosen or not positions.is_spaced(scene, around[chosen]):
                    break  # there is no room
                value = errors.combined_cost(known[:, chosen], objective)
                if not value < best * (1 - positions.MAX_TIE_RATIO):
                    break
                layout, best = around[chosen], value
    return layout


def choose_layout(scene: Scene, layouts: Sequence[Array], objective: str) -> Array | None:
    """Choose the best layout; of ties and their symmetric images, the first in sorted order.

    Images are rotated by quarter turns, and mirrored at the planes through the centre.
    """
    costs = [layout_cost(scene, one, objective) for one in layouts]
    most = min(costs, default=0.0) * (1 + positions.MAX_TIE_RATIO)
    best = [one for one, value in zip(layouts, costs, strict=True) if value <= most]
    alike = list(best)
    for layout, quarter, aside, up in itertools.product(best, range(4), (1, -1), (1, -1)):
        image = layout * [aside, up, 1, 1] + [quarter * np.pi / 2, 0, 0, 0]
        image[:, 0] = positions.azimuths(image[:, 0], scene.rules.azimuths)
        image[:, 1] = positions.angles(image[:, 1], scene.rules.elevations)
        if positions.is_allowed(scene, image) and layout_cost(scene, image, objective) <= most:
            alike.append(image)
    ordered = map(positions.sort_cameras, alike)
    return min(ordered, key=lambda one: positions.whole_steps(one).ravel().tolist(), default=None)


def best_layouts(
    scene: Scene, grid: Array, counts: Sequence[int], objective: str, starts: int, seed: int
) -> Iterator[tuple[int, Array]]:
    """Yield the best layout (cameras, 4) of each number of cameras from a grid of candidates.

    For each number the search starts from the best smaller layout and from random layouts of half
    of the candidates, each improved by exchange; the best three are refined.

    Parameters
    ----------
    grid : ndarray, shape (candidates, 4)
        Candidate positions.
    counts : sequence of int
        Numbers of cameras, ascending.
    starts, seed : int
        Number of random layouts, and their seed.

    Yields
    ------
    tuple
        A number, and its layout; left out if so many find no room, or leave a marker unseen.
    """
    known = place_information(scene, grid)
    near = too_near(scene, grid, grid)
    rng = np.random.default_rng(seed)
    before: Array | None = None
    smaller: list[int] = []
    for count in counts:
        tried = [exchange_cameras(known, near, smaller + [-1] * (count - len(smaller)), objective)]
        for _ in range(starts):
            # half of the candidates lead to other layouts, which refinement may improve more
            half = np.sort(rng.permutation(len(grid))[: max(len(grid) // 2, count)])
            part = near[np.ix_(half, half)]
            drawn = _random(rng, part, count)
            chosen, least = exchange_cameras(known[:, half], part, drawn, objective)
            tried.append(([int(half[i]) if i >= 0 else -1 for i in chosen], least))
            tried.append(exchange_cameras(known, near, tried[-1][0], objective))
        whole = {tuple(sorted(one)): least for one, least in tried if -1 not in one}
        layouts = [grid[list(one)] for one in whole]
        if whole:
            least = min(whole.values()) * (1 + positions.MAX_TIE_RATIO)
            smaller = list(min(one for one, value in whole.items() if value <= least))
        if before is not None:  # the refined smaller layout and the best additions
            added = before
            while len(added) < count:
                rest = np.flatnonzero(~too_near(scene, grid, added).any(axis=1))
                if not len(rest):
                    break
                total = place_information(scene, added).sum(axis=1)
                costs = errors.information_cost(total[:, None] + known[:, rest], objective)
                added = np.concatenate([added, grid[rest[[positions.first_least(costs)]]]])
            if len(added) == count:
                layouts.append(added)
        found = [layout_cost(scene, one, objective) for one in layouts]
        most = max(sorted(found)[:MAX_REFINED_LAYOUTS], default=0.0) * (1 + positions.MAX_TIE_RATIO)
        settled = [
            refine_layout(scene, one, objective)
            for one, cost in zip(layouts, found, strict=True)
            if np.isfinite(cost) and cost <= most
        ]
        best = choose_layout(scene, settled, objective)
        if best is not None:
            before = best
            yield count, best


def _random(rng: np.random.Generator, near: Mask, count: int) -> list[int]:
    """Draw candidates one after the other where there is room; -1 where there is none."""
    chosen: list[int] = []
    for _ in range(count):
        open_ = np.flatnonzero(~np.any(near[chosen], axis=0))
        if not len(open_):
            break
        chosen.append(int(rng.choice(open_)))
    return chosen + [-1] * (count - len(chosen))
