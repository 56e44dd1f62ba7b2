"""Errors of a layout: by the law of rounding, and by the simulation of the studies.

A camera counts for the markers that it sees. Markers seen by the same cameras are one group, which
is predicted and simulated as in :mod:`thesis_lib.figure_sets.parametric.compute`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from thesis_lib.arrays import Array
from thesis_lib.planning.places import Scene, cameras, visible
from thesis_lib.vision import rounding
from thesis_lib.vision.pinhole import CameraArray, project
from thesis_lib.vision.simulation import measure
from thesis_lib.vision.triangulation import gain

MOTION = 1 / 6  # px²: variance of a rounded motion, averaged over amplitudes
AMPLITUDES = (0.5, 1.5)  # from and to how many times the deflection asked for is averaged


@dataclass(frozen=True)
class Simulated:
    """What a simulation found of a layout, in % of each mode's largest deflection of a marker."""

    mean: Array  #: Rms errors over the markers, shape (modes, trials)
    point: Array  #: Rms errors over the trials, shape (modes, markers)

    def error(self, objective: str, at: NDArray[np.int_]) -> Array:
        """Rms over the trials of the error that counts, by mode.

        Of the mean over the markers, or of the marker `at` (modes,) which is predicted worst: the
        largest of many scattered errors would be too high.
        """
        if objective == "mean":
            return np.asarray(np.sqrt(np.mean(self.mean**2, axis=1)))
        return self.point[np.arange(len(at)), at]

    def band(self, objective: str) -> Array:
        """Quantiles 5 and 95 % over the trials of the mean error, (2, modes); NaN for the worst."""
        if objective == "mean":
            return np.asarray(np.quantile(self.mean, [0.05, 0.95], axis=1))
        return np.full((2, len(self.mean)), np.nan)


def percent(scene: Scene) -> Array:
    """Factor (modes, 1) from m to % of the largest deflection of a marker in each mode."""
    largest = np.max(np.abs(scene.body.shapes), axis=1) * np.array(scene.peaks)
    return np.asarray(100 / largest[:, None])


def averaged(scene: Scene) -> float:
    """Largest error of a mode in %, averaged over amplitudes, over √cost and times width in px."""
    return float(np.max(percent(scene)) * np.sqrt(MOTION))


def counted(point: Array, objective: str) -> Array:
    """The error that counts, of errors (modes, markers): rms or largest."""
    return np.sqrt(np.mean(point**2, axis=-1)) if objective == "mean" else point.max(axis=-1)


def _groups(
    scene: Scene, layout: Array, width: int
) -> Iterator[tuple[NDArray[np.int_], NDArray[np.int_], CameraArray]]:
    """Cameras and markers that go together, and these cameras."""
    rig, seen = cameras(scene, layout, width), visible(scene, layout)
    patterns, which = np.unique(seen, axis=1, return_inverse=True)
    for number, pattern in enumerate(patterns.T):
        some = np.flatnonzero(pattern)
        turned, centres = rig.R_camera_world[some], rig.centres[some]
        part = replace(rig, K=rig.K[some], R_camera_world=turned, centres=centres)
        yield some, np.flatnonzero(which.ravel() == number), part


def predicted(scene: Scene, layout: Array, width: int) -> Array:
    """Rms error of every marker by the law of rounding, shape (modes, markers), in %."""
    body, point = scene.body, np.empty(scene.body.shapes.shape)
    deflected = body.deflected(scene.peaks)
    for _, markers, part in _groups(scene, layout, width):
        rest, normals = body.points[:, None, markers], body.normals[:, None, markers]
        variance = rounding.deflection_variance(
            part.P, rest, deflected[:, :, markers], normals=normals
        )
        point[:, markers] = np.sqrt(variance)
    return point * percent(scene)


def averaged_by_law(scene: Scene, layout: Array, width: int) -> float:
    """Return the error of the worst mode by the law of rounding, averaged over amplitudes, in %.

    Over `AMPLITUDES` times the deflection that is asked for, evenly. A coordinate that hardly moves
    has hardly an error then, where :func:`averaged` gives every coordinate 1/6 px².
    """
    body, point = scene.body, np.empty(scene.body.shapes.shape)
    deflected = body.deflected(scene.peaks)
    for _, markers, part in _groups(scene, layout, width):
        rest, normals = body.points[:, None, markers], body.normals[:, None, markers]
        g = np.sum(gain(part.P, rest) * normals[:, None, None], axis=0)
        moved = project(part.P, deflected[:, :, markers]) - project(part.P, rest)
        variance = rounding.mean_difference_variance(moved, *AMPLITUDES)
        point[:, markers] = np.sqrt(np.sum(g**2 * variance, axis=(0, 1)))
    return float(counted(point * percent(scene), "mean").max())


def simulated(
    scene: Scene, layout: Array, width: int, trials: int, seed: int, estimator: str
) -> Simulated:
    """The studies' simulation of a layout: whole pixels on randomly shifted grids."""
    wrong = drawn(scene, layout, width, trials, seed, estimator) * percent(scene)[:, None]
    return Simulated(np.sqrt(np.mean(wrong**2, axis=2)), np.sqrt(np.mean(wrong**2, axis=1)))


def drawn(scene: Scene, layout: Array, width: int, trials: int, seed: int, estimator: str) -> Array:
    """Errors of the deflections in that simulation, shape (modes, trials, markers), in m."""
    body = scene.body
    points = np.concatenate([body.points[:, None], body.deflected(scene.peaks)], axis=1)
    shifts = rounding.grid_shifts(seed, trials, len(layout))[1:]
    true = body.shapes * np.array(scene.peaks)[:, None]
    wrong = np.empty((len(true), trials, true.shape[1]))
    for some, markers, part in _groups(scene, layout, width):
        rest, normals = points[:, :, markers], body.normals[:, markers]
        found = measure(part, rest, shifts[:, some], estimator=estimator, normals=normals)
        wrong[:, :, markers] = found - true[:, None, markers]
    return wrong
