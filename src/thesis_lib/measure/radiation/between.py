"""What a structure does between its markers, as a linear function of what they do.

Where there is a model of it, its first modes are fitted to the markers, as many as these tell
apart. A camera fits the edge of a marker, so a marker shows the mean of the motion around its edge,
and that is what is fitted. Else the thinnest plate that goes through all markers is bent: the thin
plate spline (J. Duchon, 1977), which on supported edges is held at rest.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.interpolate import RBFInterpolator

from thesis_lib.acoustics.estimates import Amplitudes
from thesis_lib.arrays import Array, ComplexArray
from thesis_lib.vibration.beam import Beam
from thesis_lib.vibration.panel import Panel
from thesis_lib.vibration.plate import Plate

Model = Beam | Plate | Panel
MARKERS_PER_WAVE = 3  # to the length of the shortest mode that is fitted
TELL_APART = 30.0  # largest condition number of a fit
EDGE_POINTS = 12  # places on a marker's edge
MAX_TRIED_MODES = 60  # modes that are tried


@dataclass(frozen=True)
class Between:
    """How the surface moves by its markers."""

    kind: Literal["model", "spline"]
    #: Displacement of places by that of the markers, shape (..., markers) for places (2, ...)
    moving: Array
    #: The markers' own by all of them, as fitted, (markers, markers); by a spline, each as the
    #: others have it
    fitted: Array
    modes: int = 0  #: That are fitted, of a model

    def residual(self, amplitudes: ComplexArray) -> ComplexArray:
        """Return the residual of amplitudes (markers,), or of a marker against the others."""
        return np.asarray(amplitudes - self.fitted @ amplitudes, complex)

    def left(self, of: Amplitudes) -> tuple[float, float]:
        """Return the norm of the residuals, and what errors alone would make of it (rms), in m."""
        D = np.kron(np.eye(2), np.eye(len(self.fitted)) - self.fitted)
        noise = np.sqrt(np.sum((D @ of.covariance) * D))
        return float(np.linalg.norm(self.residual(of.value))), float(noise)


def largest_gap(markers: Array) -> float:
    """Return the distance in m to the next marker where that is largest, of markers (2, n).

    Along the structure and across it by themselves: close rows of markers that are far apart tell
    no shorter waves along the rows.
    """
    x, y = np.abs(markers[:, :, None] - markers[:, None])
    distance = np.hypot(x, y)
    np.fill_diagonal(distance, np.inf)
    sides = [np.where(side, distance, np.inf).min(axis=1) for side in (x >= y, x < y)]
    return float(max(np.max(side, initial=0, where=np.isfinite(side)) for side in sides))


def by_model(model: Model, markers: Array, radius: float, places: Array) -> Between:
    """Interpolate by a model's first modes, from markers (2, n) to places (2, ...)."""
    waves = 2 * np.pi / (MARKERS_PER_WAVE * largest_gap(markers))
    turn = 2 * np.pi * (np.arange(EDGE_POINTS) + 0.5) / EDGE_POINTS
    circle = radius * np.stack([np.cos(turn), np.sin(turn)])
    edge = _inside(model, markers[:, :, None] + circle[:, None], markers)
    shown = _shapes(model, edge.reshape(2, -1), waves).reshape(-1, markers.shape[1], EDGE_POINTS)
    A = np.mean(shown, axis=2).T
    count = max(1, min(A.shape[1], len(A) // 2))  # else noise would be fitted, too
    while count > 1 and np.linalg.cond(A[:, :count]) > TELL_APART:
        count -= 1
    fit = np.linalg.pinv(A[:, :count])
    flat = places.reshape(2, -1)
    at = _shapes(model, _inside(model, flat, flat), waves)[:count].T
    return Between("model", (at @ fit).reshape(*places.shape[1:], -1), A[:, :count] @ fit, count)


def _inside(model: Model, points: Array, instead: Array) -> Array:
    """Return points (2, ...) of the model, others where a panel has none."""
    if not isinstance(model, Panel):
        return points
    on = model.covers(points.reshape(2, -1)).reshape(points.shape[1:])
    other = instead.reshape(2, -1, *[1] * (points.ndim - instead.ndim))
    return np.where(on, points, np.broadcast_to(other, points.shape))


def _shapes(model: Model, points: Array, waves: float) -> Array:
    """Return shapes of modes up to a wavenumber in rad/m at points (2, n), longest first."""
    numbers = np.arange(1, MAX_TRIED_MODES + 1)
    if isinstance(model, Beam):
        stiffness = model.bending_stiffness / (model.mass / model.length)
    else:
        stiffness = model.bending_stiffness / model.mass_per_area
    k = np.sqrt(model.angular_frequencies(MAX_TRIED_MODES)) / stiffness**0.25
    chosen = numbers[k <= max(waves, k[0])].tolist()
    shapes, k = model.mode_shapes(chosen, points), k[: len(chosen)]
    if isinstance(model, Beam):
        x, y = points
        turns = (2 * numbers - 1) * np.pi / (2 * model.length)
        turns = turns[turns <= waves]
        twist = np.sin(turns[:, None] * x) * (2 * y / model.width - 1)
        shapes, k = np.concatenate([shapes, twist]), np.concatenate([k, turns])
    return np.asarray(shapes[np.argsort(k, kind="stable")])


def by_spline(markers: Array, held: Array, places: Array) -> Between:
    """Interpolate by a thin plate spline through markers (2, n), at rest at held (2, k)."""
    n = markers.shape[1]
    every = np.concatenate([markers, held], axis=1).T
    unit = np.eye(len(every))[:, :n]
    surface = RBFInterpolator(every, unit, kernel="thin_plate_spline", degree=1)
    others = np.zeros((n, n))
    for i in range(n):
        left = np.delete(np.arange(len(every)), i)
        without = RBFInterpolator(every[left], unit[left], kernel="thin_plate_spline", degree=1)
        others[i] = without(every[[i]])[0]
    moving = surface(places.reshape(2, -1).T).reshape(*places.shape[1:], -1)
    return Between("spline", moving, others)


def edge_places(corners: Array, edges: list[int], step: float) -> Array:
    """Return places (2, n) on some edges of a polygon, at most a step in m apart."""
    found = [np.empty((2, 0))]
    for edge in edges:
        a, b = corners[edge], corners[(edge + 1) % len(corners)]
        count = max(2, int(np.ceil(np.hypot(*(b - a)) / step)) + 1)
        found.append(a[:, None] + (b - a)[:, None] * np.linspace(0, 1, count))
    return np.unique(np.round(np.concatenate(found, axis=1), 9), axis=1)
