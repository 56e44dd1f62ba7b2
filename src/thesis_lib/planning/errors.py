"""Errors of a layout: predicted, simulated, and a lower bound for all layouts.

A camera contributes to the markers that it sees. Markers seen by the same cameras form a group,
predicted and simulated as in :mod:`thesis_lib.figure_sets.parametric.compute`.

Independent errors σ of all image coordinates give a marker the covariance σ² M⁻¹, where the
information M = Σ JᵀJ is a sum over the cameras that see it. Whole pixels have σ² = 1/6 px² for a
motion, averaged over amplitudes, and 1/12 if the rest position is known. The objective is the
variance along the marker's normal, σ² nᵀ M⁻¹ n. With JᵀJ of every candidate known, a layout takes
only a sum. M grows with the square of the pixels across: the best layout does not depend on them.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from thesis_lib.arrays import Array, Mask, NDArray
from thesis_lib.planning import positions
from thesis_lib.planning.positions import Scene
from thesis_lib.vision import pinhole, rounding, simulation, triangulation

ROUNDING_VARIANCE_PX2 = 1 / 6  # px²: variance of a rounded motion, averaged over amplitudes
AMPLITUDE_RANGE = (0.5, 1.5)  # averaged amplitudes, as multiples of the requested deflection


def percent_factor(scene: Scene) -> Array:
    """Return factor (modes, 1) from m to % of the largest deflection of a marker in each mode."""
    largest = np.max(np.abs(scene.body.shapes), axis=1) * np.array(scene.peaks)
    return np.asarray(100 / largest[:, None])


def average_error(scene: Scene) -> float:
    """Return a mode's largest error in %, averaged over amplitudes, × width in px / √cost."""
    return float(np.max(percent_factor(scene)) * np.sqrt(ROUNDING_VARIANCE_PX2))


def objective_error(point: Array, objective: str) -> Array:
    """Reduce errors (modes, markers) over the markers by the objective: rms or largest."""
    return np.sqrt(np.mean(point**2, axis=-1)) if objective == "mean" else point.max(axis=-1)


def _groups(
    scene: Scene, layout: Array, width: int
) -> Iterator[tuple[NDArray[np.int_], NDArray[np.int_], pinhole.CameraArray]]:
    """Yield groups of markers seen by the same cameras: both indices, and these cameras."""
    rig = positions.place_cameras(scene, layout, width)
    seen = positions.visible_markers(scene, layout)
    patterns, which = np.unique(seen, axis=1, return_inverse=True)
    for number, pattern in enumerate(patterns.T):
        some = np.flatnonzero(pattern)
        turned, centres = rig.R_camera_world[some], rig.centres[some]
        part = replace(rig, K=rig.K[some], R_camera_world=turned, centres=centres)
        yield some, np.flatnonzero(which.ravel() == number), part


def predict_errors(
    scene: Scene,
    layout: Array,
    width: int,
    variance: Callable[..., Array] = rounding.deflection_variance,
) -> Array:
    """Return the rms error of every marker by the law of rounding, shape (modes, markers), in %."""
    body, point = scene.body, np.empty(scene.body.shapes.shape)
    deflected = body.deflected(scene.peaks)
    for _, markers, part in _groups(scene, layout, width):
        rest, normals = body.points[:, None, markers], body.normals[:, None, markers]
        found = variance(part.P, rest, deflected[:, :, markers], normals=normals)
        point[:, markers] = np.sqrt(found)
    return point * percent_factor(scene)


def average_predicted(scene: Scene, layout: Array, width: int) -> float:
    """Return the error of the worst mode by the law of rounding, averaged over amplitudes, in %.

    Amplitudes are uniform over `AMPLITUDE_RANGE` times the requested deflection. A coordinate that
    hardly moves has hardly an error here; :func:`average_error` gives every coordinate 1/6 px².
    """

    def average(P: Array, rest: Array, deflected: Array, normals: Array) -> Array:
        g = np.sum(triangulation.triangulation_gain(P, rest) * normals[:, None, None], axis=0)
        moved = pinhole.project(P, deflected) - pinhole.project(P, rest)
        variance = rounding.mean_difference_variance(moved, *AMPLITUDE_RANGE)
        return np.asarray(np.sum(g**2 * variance, axis=(0, 1)))

    point = predict_errors(scene, layout, width, average)
    return float(objective_error(point, "mean").max())


def simulate_errors(
    scene: Scene, drawn: Array, objective: str, predicted: Array
) -> tuple[Array, Array]:
    """Return the objective's errors in % of drawn deflection errors (modes, trials, markers) in m.

    They are the rms over the trials, (modes,), and the 5 and 95 % quantiles, (2, modes), of the
    mean over the markers; or, without quantiles, of the marker whose `predicted` error
    (modes, markers) is largest, as the largest of many random errors would be too high.
    """
    wrong = drawn * percent_factor(scene)[:, None]
    if objective == "mean":
        mean = np.sqrt(np.mean(wrong**2, axis=2))
        return np.sqrt(np.mean(mean**2, axis=1)), np.quantile(mean, [0.05, 0.95], axis=1)
    point, at = np.sqrt(np.mean(wrong**2, axis=1)), positions.first_most(predicted)
    return point[np.arange(len(at)), at], np.full((2, len(at)), np.nan)


def draw_errors(
    scene: Scene, layout: Array, width: int, trials: int, seed: int, estimator: str
) -> Array:
    """Simulate deflection errors as studies do, in whole pixels of randomly shifted grids.

    The shape is (modes, trials, markers), in m.
    """
    body = scene.body
    points = np.concatenate([body.points[:, None], body.deflected(scene.peaks)], axis=1)
    shifts = rounding.grid_shifts(seed, trials, len(layout))[1:]
    true = body.shapes * np.array(scene.peaks)[:, None]
    wrong = np.empty((len(true), trials, true.shape[1]))
    for some, markers, part in _groups(scene, layout, width):
        rest, normals = points[:, :, markers], body.normals[:, markers]
        found = simulation.measure_deflections(
            part, rest, shifts[:, some], estimator=estimator, normals=normals
        )
        wrong[:, :, markers] = found - true[:, None, markers]
    return wrong


_RIDGE_RATIO = 1e-6  # over the mean information: the information of a marker that no camera sees
_MAX_PASSES = 50  # exchanges converge long before
_BOUND_ROUNDS = 60  # updates of the shares for the lower bound


def marker_axes(normals: Array) -> Array:
    """Return right-handed axes (markers, 3, 3) whose third is each marker's normal (3, markers)."""
    n = normals.T
    aside = np.eye(3)[np.argmin(np.abs(n), axis=1)]
    x = np.cross(aside, n)
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    return np.stack([x, np.cross(n, x), n], axis=1)


def place_information(scene: Scene, places: Array) -> Array:
    """Return JᵀJ of positions and markers in the marker's axes, per squared image width.

    Returns
    -------
    ndarray, shape (6, places, markers)
        Entries xx, xy, xz, yy, yz, zz in 1/m², z along the normal; 0 for markers not seen.
    """
    seen = positions.visible_markers(scene, places)
    J = triangulation.image_jacobian(positions.place_cameras(scene, places).P, scene.body.points)
    x, y, z = np.moveaxis(marker_axes(scene.body.normals), 2, 0).swapaxes(1, 2).copy()
    # term by term: einsum takes seven times as long
    own = J[:, :, None, 0] * x + J[:, :, None, 1] * y + J[:, :, None, 2] * z
    u, v = own[:, 0], own[:, 1]
    products = [
        u[:, i] * u[:, j] + v[:, i] * v[:, j]
        for i, j in zip(*triangulation.UPPER_INDICES, strict=True)
    ]
    return np.stack(products) * seen


def normal_variances(total: Array) -> Array:
    """Return (M⁻¹)_zz from information (6, ...); infinite if M is singular."""
    minor, determinant, regular = triangulation.expand_determinant(total)
    return np.divide(minor, determinant, out=np.full(minor.shape, np.inf), where=regular)


def information_cost(total: Array, objective: str) -> Array:
    """Return the mean or largest variance over the markers of information (6, ..., markers)."""
    variance = normal_variances(total)
    return variance.mean(axis=-1) if objective == "mean" else variance.max(axis=-1)


def layout_cost(scene: Scene, places: Array, objective: str) -> float:
    """Return cost of a layout; infinite unless every marker is seen well enough by two cameras."""
    return combined_cost(place_information(scene, places), objective)


def combined_cost(known: Array, objective: str) -> float:
    """Return the cost of cameras from the information of each, shape (6, cameras, markers)."""
    return float(information_cost(known.sum(axis=1), objective))


def exchange_cameras(
    known: Array, near: Mask, start: Sequence[int], objective: str, whose: Mask | None = None
) -> tuple[list[int], float]:
    """Exchange one camera after the other for the best candidate, while the cost falls (Fedorov).

    Parameters
    ----------
    known : ndarray, shape (6, candidates, markers)
        Information of the candidates.
    near : ndarray of bool, shape (candidates, candidates)
        Which of them are :func:`~thesis_lib.planning.positions.too_near` each other.
    start : sequence of int
        Initial layout; -1 for a camera that is still to be placed.
    whose : ndarray of bool, shape (cameras, candidates), optional
        Which candidates each camera may take; by default all.

    Returns
    -------
    tuple
        The layout, and its cost. A slot for which no candidate is left keeps -1.
    """
    chosen = list(start)
    ridge = _RIDGE_RATIO * np.mean(known[[0, 3, 5]]) * np.array([1.0, 0, 0, 1, 0, 1])[:, None]
    best = np.inf
    if -1 not in chosen:
        best = float(information_cost(known[:, chosen].sum(axis=1) + ridge, objective))
    each = np.moveaxis(known, 1, 0).copy()  # contiguous: sums take a fraction of the time
    if whose is None:
        own = [(np.arange(len(near)), known, near)] * len(chosen)
    else:
        own = [(some, known[:, some], near[:, some]) for some in map(np.flatnonzero, whose)]
    still = 0  # slots since the last change: after all of them nothing more can change
    for slot in _MAX_PASSES * list(range(len(chosen))):
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
        costs = information_cost(rest[:, None] + part, objective)
        at = positions.first_least(costs)
        if chosen[slot] < 0 or costs[at] < best * (1 - positions.MAX_TIE_RATIO):
            chosen[slot], best, still = int(mine[at]), float(costs[at]), 1
    return chosen, best


def lower_bound(known: Array, n_cameras: int, weights: Array) -> float:
    """Return a lower bound of Σ wₘ vₘ for all layouts of `n_cameras` candidates.

    It includes layouts with several cameras in one position.

    The cost φ of information M is convex and homogeneous of degree −1, and its derivative towards a
    candidate is −g. So, for any M, no layout of n costs less than φ² / (n max g). The bound is
    tightened by multiplying the share of every candidate in M by √g.

    Parameters
    ----------
    known : ndarray, shape (6, candidates, markers)
        Information of the candidates.
    n_cameras : int
        Number n of cameras.
    weights : ndarray, shape (markers,)
        Weights wₘ, not negative, sum 1: all equal for the mean. The largest variance is never
        below a weighted mean.
    """
    share = np.full(known.shape[1], n_cameras / known.shape[1])
    bound = 0.0
    for _ in range(_BOUND_ROUNDS):
        total = np.einsum("kcm,c->km", known, share)
        xx, xy, xz, yy, yz, _ = total
        variance = normal_variances(total)
        if not np.all(np.isfinite(variance)):
            break
        minor = xx * yy - xy**2
        # M⁻¹n = v (a, b, 1), with tangential components a and b
        a = (xy * yz - yy * xz) / minor
        b = (xy * xz - xx * yz) / minor
        direction = np.stack([a * a, 2 * a * b, 2 * a, b * b, 2 * b, np.ones_like(a)])
        gain = np.einsum("kcm,km->c", known, direction * (weights * variance**2))
        value = float(weights @ variance)
        bound = max(bound, value**2 / (n_cameras * float(gain.max())))
        share = share * np.sqrt(gain)
        share *= n_cameras / share.sum()
    return bound
