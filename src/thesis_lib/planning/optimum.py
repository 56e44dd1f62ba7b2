"""What a layout costs, the exchange of its cameras, and what no layout can be below.

Independent errors σ of all image coordinates leave a marker with the covariance σ² M⁻¹, where the
information M = Σ JᵀJ is a sum over the cameras that see it. Whole pixels have σ² = 1/6 px² for a
motion, averaged over amplitudes, and 1/12 if the rest position is known. What matters is the
variance along the marker's normal, σ² nᵀ M⁻¹ n. With JᵀJ of every candidate known, a layout costs
a sum. M grows with the square of the pixels across, so the best layout does not depend on them.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy  # its parts are imported when they are used

from thesis_lib.arrays import Array, Mask
from thesis_lib.planning.lattice import TIE, first_least
from thesis_lib.planning.places import SLACK, Scene, cameras, centres, permitted, visible
from thesis_lib.vision.triangulation import UPPER, jacobian

OBJECTIVES = ("mean", "worst")
_RIDGE = 1e-6  # of the mean information: what a marker has that no camera sees
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
    x, y, z = np.moveaxis(frames(scene.body.normals), 2, 0).swapaxes(1, 2).copy()
    # term by term: einsum takes seven times as long
    own = J[:, :, None, 0] * x + J[:, :, None, 1] * y + J[:, :, None, 2] * z
    u, v = own[:, 0], own[:, 1]
    products = [u[:, i] * u[:, j] + v[:, i] * v[:, j] for i, j in zip(*UPPER, strict=True)]
    return np.stack(products) * seen


def variances(total: Array) -> Array:
    """Variance along the normal, (M⁻¹)_zz, from information (6, ...); infinite if M is singular."""
    xx, xy, xz, yy, yz, zz = total
    minor = xx * yy - xy**2
    determinant = zz * minor - (yy * xz**2 - 2 * xy * xz * yz + xx * yz**2)
    scale = np.maximum(xx + yy + zz, np.finfo(float).tiny)
    regular = determinant > 1e-12 * (scale * scale * scale)  # a power takes longer than all this
    return np.divide(minor, determinant, out=np.full(minor.shape, np.inf), where=regular)


def cost(variance: Array, objective: str) -> Array:
    """Mean or largest variance over the markers, which are the last axis."""
    return variance.mean(axis=-1) if objective == "mean" else variance.max(axis=-1)


def layout_cost(scene: Scene, places: Array, objective: str) -> float:
    """Cost of a layout; infinite unless every marker is seen well enough by two cameras."""
    return together(information(scene, places), objective)


def together(known: Array, objective: str) -> float:
    """Cost of cameras from the information of each, shape (6, cameras, markers)."""
    return float(cost(variances(known.sum(axis=1)), objective))


def allowed(scene: Scene, places: Array) -> bool:
    """Whether a layout keeps all rules."""
    return bool(np.all(permitted(scene, places))) and spaced(scene, places)


def spaced(scene: Scene, places: Array) -> bool:
    """Whether the cameras of a layout are far enough from each other."""
    where = centres(scene, places)
    gap = np.linalg.norm(where[:, None] - where, axis=2)[np.triu_indices(len(where), 1)]
    return bool(np.all(gap >= scene.rules.separation * (1 - SLACK)))


def too_near(scene: Scene, grid: Array) -> Mask:
    """Which candidates may not stand in one layout; each of them with itself."""
    where = centres(scene, grid)
    return np.asarray(
        scipy.spatial.distance.cdist(where, where) < max(scene.rules.separation * (1 - SLACK), 1e-9)
    )


def exchange(
    known: Array,
    near: Mask,
    start: Sequence[int],
    objective: str,
    whose: Mask | None = None,
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
    whose : ndarray of bool, shape (cameras, candidates), optional
        Which candidates a camera may take; without it, all.

    Returns
    -------
    tuple
        The layout, and its cost. A slot for which no candidate is left keeps -1.
    """
    chosen = list(start)
    ridge = _RIDGE * np.mean(known[[0, 3, 5]]) * np.array([1.0, 0, 0, 1, 0, 1])[:, None]
    best = np.inf
    if -1 not in chosen:
        best = float(cost(variances(known[:, chosen].sum(axis=1) + ridge), objective))
    each = np.moveaxis(known, 1, 0).copy()  # sums of what lies together take a fraction of the time
    if whose is None:
        own = [(np.arange(len(near)), known, near)] * len(chosen)
    else:
        own = [(some, known[:, some], near[:, some]) for some in map(np.flatnonzero, whose)]
    still = 0  # slots since the last change: each would find again what it has
    for slot in _PASSES * list(range(len(chosen))):
        if still == len(chosen):
            break
        still += 1
        others = [c for i, c in enumerate(chosen) if i != slot and c >= 0]
        mine, part, crowd = own[slot]
        open_ = ~crowd[others].any(axis=0)
        if not open_.all():
            mine, part = mine[open_], part[:, open_]
        if not len(mine):
            continue
        rest = each[others].sum(axis=0) + ridge
        costs = cost(variances(rest[:, None] + part), objective)
        at = first_least(costs)
        if chosen[slot] < 0 or costs[at] < best * (1 - TIE):
            chosen[slot], best, still = int(mine[at]), float(costs[at]), 1
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
