"""The best layout: exchange on a grid of places, then all cameras moved together.

Independent errors σ of all image coordinates leave a marker with the covariance σ² M⁻¹, where the
information M = Σ JᵀJ is a sum over the cameras that see it. Whole pixels have σ² = 1/6 px² for a
motion, averaged over amplitudes, and 1/12 if the rest position is known. What matters is the
variance along the marker's normal, σ² nᵀ M⁻¹ n. With JᵀJ of every candidate known, a layout costs
a sum. M grows with the square of the pixels across, so the best layout does not depend on them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.spatial.distance import cdist

from thesis_lib.planning.places import (
    SLACK,
    Scene,
    apart,
    cameras,
    centres,
    clearances,
    free,
    margins,
    sees_enough,
    visible,
)
from thesis_lib.triangulation import UPPER, jacobian

Array = NDArray[np.float64]

OBJECTIVES = ("mean", "worst")
_POWER = 16  # of the mean that stands for the largest variance where derivatives are needed
_RIDGE = 1e-6  # of the mean information: what a marker has that no camera sees
_STEP = 1e-6  # of central differences, rad and logarithm of distance
_PASSES = 50  # exchanges end long before
_ROUNDS = 60  # of the weights of the lower bound


def frames(normals: Array) -> Array:
    """Right-handed axes (markers, 3, 3) whose third is each marker's normal (3, markers)."""
    n = normals.T
    aside = np.eye(3)[np.argmin(np.abs(n), axis=1)]
    x = np.cross(aside, n)
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    return np.stack([x, np.cross(n, x), n], axis=1)


def information(scene: Scene, places: Array) -> Array:
    """JᵀJ of every place and marker in the marker's own axes, per squared width of the sensor.

    Returns
    -------
    ndarray, shape (6, places, markers)
        Entries xx, xy, xz, yy, yz, zz in 1/m², z along the normal; 0 where it is not seen.
    """
    seen = visible(scene, places)
    J = jacobian(cameras(scene, places).P, scene.body.points)
    own = np.einsum("nikm,mak->niam", J, frames(scene.body.normals))
    first, second = own[:, :, UPPER[0]], own[:, :, UPPER[1]]
    return np.moveaxis(np.sum(first * second, axis=1), 1, 0) * seen


def variances(total: Array) -> Array:
    """Variance along the normal, (M⁻¹)_zz, from information (6, ...); infinite if M is singular."""
    xx, xy, xz, yy, yz, zz = total
    minor = xx * yy - xy**2
    determinant = zz * minor - (yy * xz**2 - 2 * xy * xz * yz + xx * yz**2)
    with np.errstate(divide="ignore", invalid="ignore"):
        found = minor / determinant
    scale = np.maximum(xx + yy + zz, np.finfo(float).tiny)
    return np.where(determinant > 1e-12 * scale**3, found, np.inf)


def cost(variance: Array, objective: str) -> Array:
    """Mean or largest variance over the markers, which are the last axis."""
    return variance.mean(axis=-1) if objective == "mean" else variance.max(axis=-1)


def layout_cost(scene: Scene, places: Array, objective: str) -> float:
    """Cost of a layout; infinite unless every marker is seen well enough by two cameras."""
    return float(cost(variances(information(scene, places).sum(axis=1)), objective))


def allowed(scene: Scene, places: Array) -> bool:
    """Whether a layout keeps all rules."""
    alone = bool(np.all(free(scene, places)) and np.all(sees_enough(scene, places)))
    where = centres(scene, places)
    gap = np.linalg.norm(where[:, None] - where, axis=2)[np.triu_indices(len(where), 1)]
    return alone and bool(np.all(gap >= scene.rules.separation * (1 - SLACK)))


def too_near(scene: Scene, grid: Array) -> NDArray[np.bool_]:
    """Which candidates may not stand in one layout; each of them with itself."""
    where = centres(scene, grid)
    return np.asarray(cdist(where, where) < max(scene.rules.separation * (1 - SLACK), 1e-9))


def exchange(
    known: Array, near: NDArray[np.bool_], start: Sequence[int], objective: str
) -> tuple[list[int], float]:
    """Exchange one camera after the other for the best candidate, until none helps (Fedorov).

    Parameters
    ----------
    known : ndarray, shape (6, candidates, markers)
        Information of the candidates.
    near : ndarray of bool, shape (candidates, candidates)
        Which of them are :func:`too_near` each other.
    start : sequence of int
        Layout to begin with; -1 for a camera that is still to be placed.
    objective : str
        ``mean`` or ``worst``.

    Returns
    -------
    tuple
        The layout, and its cost. A slot for which no candidate is left keeps -1.
    """
    chosen = list(start)
    ridge = _RIDGE * np.mean(known[[0, 3, 5]]) * np.array([1.0, 0, 0, 1, 0, 1])[:, None]
    best = np.inf
    for _ in range(_PASSES):
        before = best
        for slot in range(len(chosen)):
            others = [c for i, c in enumerate(chosen) if i != slot and c >= 0]
            open_ = np.flatnonzero(~np.any(near[others], axis=0))
            if not len(open_):
                continue
            rest = known[:, others].sum(axis=1) + ridge
            costs = cost(variances(rest[:, None] + known[:, open_]), objective)
            at = int(np.argmin(costs))
            if chosen[slot] < 0 or costs[at] < best * (1 - 1e-9):
                chosen[slot], best = int(open_[at]), float(costs[at])
        if best >= before * (1 - 1e-9):
            break
    return chosen, best


def lower_bound(known: Array, n_cameras: int, weights: Array) -> float:
    """What Σ wₘ vₘ of no layout of so many candidates can be below, even if places are shared.

    The cost φ of information M is convex and of degree −1, and its derivative towards a candidate
    is −g. So no layout of n has less than φ² / (n max g), whatever M; the bound is tightened by
    moving the share of every candidate in M with √g.

    Parameters
    ----------
    known : ndarray, shape (6, candidates, markers)
        Information of the candidates.
    n_cameras : int
        Number n of cameras.
    weights : ndarray, shape (markers,)
        Weights wₘ, not negative, sum 1: all alike for the mean. The largest variance is never
        below a weighted mean.
    """
    share = np.full(known.shape[1], n_cameras / known.shape[1])
    bound = 0.0
    for _ in range(_ROUNDS):
        total = np.einsum("kcm,c->km", known, share)
        xx, xy, xz, yy, yz, _ = total
        variance = variances(total)
        if not np.all(np.isfinite(variance)):
            break
        minor = xx * yy - xy**2
        # M⁻¹n = v (a, b, 1): what the normal takes with it across
        a = (xy * yz - yy * xz) / minor
        b = (xy * xz - xx * yz) / minor
        direction = np.stack([a * a, 2 * a * b, 2 * a, b * b, 2 * b, np.ones_like(a)])
        gain = np.einsum("kcm,km->c", known, direction * (weights * variance**2))
        value = float(weights @ variance)
        bound = max(bound, value**2 / (n_cameras * float(gain.max())))
        share = share * np.sqrt(gain)
        share *= n_cameras / share.sum()
    return bound


def polish(scene: Scene, places: Array, objective: str) -> Array:
    """Move all cameras of a layout together to where its cost is least, inside the rules (SLSQP).

    Which camera sees which marker stays. The layout comes back as it was if nothing is gained.
    """
    n, (least, most) = len(places), scene.rules.distances
    seen = visible(scene, places)
    scale = layout_cost(scene, places, objective)
    pairs = np.triu_indices(n, 1)
    full = scene.rules.azimuths[1] - scene.rules.azimuths[0] >= 2 * np.pi - SLACK
    shift = places[:, 0] if full else np.zeros(n)  # a full turn has no bounds
    bounds = [(None, None) if full else scene.rules.azimuths, scene.rules.elevations,
              (np.log(least), np.log(most))] * n  # fmt: skip

    def moved(x: Array) -> Array:
        rows = x.reshape(-1, 3)
        return np.column_stack(
            [rows[:, 0] + np.resize(shift, len(rows)), rows[:, 1], np.exp(rows[:, 2])]
        )

    def around(x: Array) -> Array:
        """The places, and each with each of its coordinates a step up and down: (7 n, 4)."""
        steps = np.zeros((7, 3))
        steps[1:4], steps[4:] = _STEP * np.eye(3), -_STEP * np.eye(3)
        rows = (x.reshape(1, n, 3) + steps[:, None]).reshape(-1, 3)
        return np.column_stack([moved(rows), np.tile(places[:, 3], 7)])

    def fields(x: Array) -> tuple[Array, Array]:
        """Information (6, 7, n, m), and limits (limits, 7, n) that are not below 0."""
        every = around(x)
        J = jacobian(cameras(scene, every).P, scene.body.points)
        own = np.einsum("nikm,mak->niam", J, axes)
        known = np.moveaxis(np.sum(own[:, :, UPPER[0]] * own[:, :, UPPER[1]], axis=1), 1, 0)
        inside = margins(scene, every).reshape(5, 7, n, -1)
        edges = np.where(seen, inside, np.inf).min(axis=3)
        clear = clearances(scene, every).reshape(-1, 7, n)
        known = known.reshape(6, 7, n, -1) * seen
        return known, np.concatenate([edges, clear]) - SLACK

    axes = frames(scene.body.normals)
    memory: dict[bytes, tuple[Array, Array]] = {}

    def kept(x: Array) -> tuple[Array, Array]:
        key = x.tobytes()
        if key not in memory:
            memory.clear()
            memory[key] = fields(x)
        return memory[key]

    def smooth(variance: Array) -> Array:
        if objective == "mean":
            return np.asarray(np.log(variance.mean(axis=-1)))
        return np.asarray(np.log(np.mean((variance / scale) ** _POWER, axis=-1)) / _POWER)

    def value_and_slope(x: Array) -> tuple[float, Array]:
        known, _ = kept(x)
        total = known[:, 0].sum(axis=1)
        changed = total[:, None, None] + known[:, 1:] - known[:, :1]  # 6, steps, n, m
        values = smooth(variances(changed))
        slope = (values[:3] - values[3:]) / (2 * _STEP)
        return float(smooth(variances(total))), np.nan_to_num(slope.T.ravel())

    def limits(x: Array) -> Array:
        _, inside = kept(x)
        where = centres(scene, around(x)[:n])
        gap = np.linalg.norm(where[pairs[0]] - where[pairs[1]], axis=1)
        return np.concatenate([inside[:, 0].ravel(), gap - scene.rules.separation])

    def limit_slopes(x: Array) -> Array:
        _, inside = kept(x)
        slope = (inside[:, 1:4] - inside[:, 4:]) / (2 * _STEP)  # limits, coordinates, n
        block = np.einsum("lcn,nj->lnjc", slope, np.eye(n)).reshape(-1, 3 * n)
        where = centres(scene, around(x)).reshape(7, n, 3)
        moves = (where[1:4] - where[4:]) / (2 * _STEP)  # coordinates, n, 3
        between = where[0][pairs[0]] - where[0][pairs[1]]
        unit = between / np.maximum(np.linalg.norm(between, axis=1, keepdims=True), 1e-12)
        rows = np.zeros((len(unit), n, 3))
        at = np.arange(len(unit))
        rows[at, pairs[0]] = np.einsum("cpk,pk->pc", moves[:, pairs[0]], unit)
        rows[at, pairs[1]] = -np.einsum("cpk,pk->pc", moves[:, pairs[1]], unit)
        return np.concatenate([block, rows.reshape(-1, 3 * n)])

    start = np.column_stack([places[:, 0] - shift, places[:, 1], np.log(places[:, 2])]).ravel()
    with np.errstate(all="ignore"):
        found = minimize(
            value_and_slope, start, jac=True, method="SLSQP", bounds=bounds,
            constraints={"type": "ineq", "fun": limits, "jac": limit_slopes},
            options={"maxiter": 100, "ftol": 1e-9},
        )  # fmt: skip
    if not np.all(np.isfinite(found.x)):
        return places
    result = np.column_stack([moved(found.x), places[:, 3]])
    result[:, 1] = np.clip(result[:, 1], *scene.rules.elevations)
    result[:, 2] = np.clip(result[:, 2], least, most)
    better = layout_cost(scene, result, objective) < scale * (1 - 1e-9)
    return result if better and allowed(scene, result) else places


def best_layouts(
    scene: Scene, grid: Array, counts: Sequence[int], objective: str, starts: int, seed: int,
    tell: Callable[[int], object] = lambda _: None,
) -> list[Array | None]:  # fmt: skip
    """The best layout of each number of cameras from a grid of candidates.

    Every number is begun from the best smaller one, and from random layouts of half of the
    candidates, each exchanged until nothing helps and polished.

    Parameters
    ----------
    scene : Scene
        What is measured, and the rules.
    grid : ndarray, shape (candidates, 4)
        Places to choose from.
    counts : sequence of int
        Numbers of cameras, ascending.
    objective : str
        ``mean`` or ``worst``.
    starts, seed : int
        How many random layouts, and the seed they are drawn with.
    tell : callable
        Is told every number of cameras that is placed.

    Returns
    -------
    list of ndarray, shape (cameras, 4), or None
        One for each number; None where so many cameras do not find room, or leave a marker unseen.
    """
    known = information(scene, grid)
    near = too_near(scene, grid)
    rng = np.random.default_rng(seed)
    found: list[Array | None] = []
    smaller: list[int] = []
    for count in counts:
        tried = [exchange(known, near, smaller + [-1] * (count - len(smaller)), objective)]
        for _ in range(starts):
            # half of the places lead to another layout than all of them, which polishing may favour
            half = np.sort(rng.permutation(len(grid))[: max(len(grid) // 2, count)])
            part = near[np.ix_(half, half)]
            chosen, least = exchange(known[:, half], part, _random(rng, part, count), objective)
            tried.append(([int(half[i]) if i >= 0 else -1 for i in chosen], least))
            tried.append(exchange(known, near, tried[-1][0], objective))
        whole = {tuple(sorted(one)): least for one, least in tried if -1 not in one}
        layouts = [grid[list(one)] for one in whole]
        if whole:
            smaller = list(min(whole.items(), key=lambda item: item[1])[0])
        before = next((f for f in reversed(found) if f is not None), None)
        if before is not None:  # the polished smaller one and what adds most to it
            added = before
            while len(added) < count:
                rest = np.flatnonzero(apart(scene, grid, added))
                if not len(rest):
                    break
                total = information(scene, added).sum(axis=1)
                costs = cost(variances(total[:, None] + known[:, rest]), objective)
                added = np.concatenate([added, grid[rest[[int(np.argmin(costs))]]]])
            if len(added) == count:
                layouts.append(added)
        polished = [polish(scene, one, objective) for one in layouts
                    if np.isfinite(layout_cost(scene, one, objective))]  # fmt: skip
        found.append(
            min(polished, key=lambda one: layout_cost(scene, one, objective), default=None)
        )
        tell(count)
    return found


def _random(rng: np.random.Generator, near: NDArray[np.bool_], count: int) -> list[int]:
    """Candidates drawn one after the other where there is room; -1 where there is none."""
    chosen: list[int] = []
    for _ in range(count):
        open_ = np.flatnonzero(~np.any(near[chosen], axis=0))
        chosen.append(int(rng.choice(open_)) if len(open_) else -1)
        if chosen[-1] < 0:
            return chosen + [-1] * (count - len(chosen))
    return chosen
