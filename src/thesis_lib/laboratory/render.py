"""Rendering of polygons: exact pixel coverage, point spread, noise, eight bits.

A scene is a set of flat colours bounded by closed polygons in space. Their vertices are projected
exactly, lens distortion included; the share of each pixel that a polygon covers is then the exact
area of the projected polygon in the pixel, summed edge by edge (the signed-area method of font
rasterisers). The approximations are the number of vertices, and that the point spread is computed
on half pixels.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from thesis_lib.arrays import Array, ArrayLike, Image, IntArray, NDArray
from thesis_lib.measure.recordings.board import Board, Markers, on_surface
from thesis_lib.vibration.motion import Motion
from thesis_lib.vibration.polygons import Point, divide_hole
from thesis_lib.vision import pinhole

# The point spread acts on finer pixels: light spreads before pixels collect it
SUBPIXELS_PER_PIXEL = 2
OUTLINE_STEP_M = 0.004  # between vertices of a drawn outline


@dataclass(frozen=True)
class Sensor:
    """Exposure, point spread, noise and grey levels of a camera sensor."""

    exposure: float = 1 / 250  #: Exposure time in s; a frame's time is the middle of it
    samples: int = 8  #: Positions within the exposure that are averaged; 1 freezes the motion
    #: Standard deviation of the Gaussian point spread in px, in addition to the pixel's own area
    spread: float = 0.6
    #: The variance of the noise is shot · I + read² for a grey level I
    shot: float = 0.05
    read: float = 1.0
    #: Grey levels of the beam and the board, of the print, and of the background
    white: float = 200.0
    dark: float = 30.0
    background: float = 60.0


@dataclass(frozen=True)
class Polygons:
    """Closed polygons in one sequence of vertices."""

    first: IntArray  #: Index of each polygon's first vertex, shape (polygons,)
    #: Grey level that each polygon adds to those below it, shape (polygons,)
    contrast: Array


def _join_print(shapes: Sequence[Array], sensor: Sensor) -> tuple[Array, Polygons]:
    """Join the vertices (2, n) of a bright outline and of each dark polygon printed on it."""
    contrast = np.full(len(shapes), sensor.dark - sensor.white)
    contrast[0] = sensor.white - sensor.background
    first = np.cumsum([0, *(shape.shape[1] for shape in shapes[:-1])])
    return np.concatenate(shapes, axis=1), Polygons(first, contrast)


def rasterise_polygons(uv: Array, polygons: Polygons, width: int, height: int) -> Array:
    """Return the sum of the polygons' contrasts, weighted by the share of each pixel they cover.

    `uv` are vertices in px, (2, vertices) or (2, frames, vertices); over several frames the mean is
    taken. The sum has the shape (height, width); polygons may have either orientation.
    """
    start = uv.reshape(2, -1, uv.shape[-1])
    frames, n = start.shape[1:]
    following = np.arange(1, n + 1)  # next vertex of each
    following[np.append(polygons.first[1:], n) - 1] = polygons.first
    stop = start[:, :, following]
    cross = start[0] * stop[1] - start[1] * stop[0]
    twice_area = np.add.reduceat(cross, polygons.first, axis=1)  # signed by orientation
    sizes = np.diff(np.append(polygons.first, n))
    weight = np.repeat(np.sign(twice_area) * polygons.contrast / frames, sizes, axis=1)
    edge, t0, t1 = _cut_edges(start.reshape(2, -1), stop.reshape(2, -1))
    (x, y), (dx, dy) = start.reshape(2, -1)[:, edge], (stop - start).reshape(2, -1)[:, edge]
    middle = (t0 + t1) / 2
    x, y, rise = x + middle * dx, y + middle * dy, (t1 - t0) * dy
    inside = (y >= 0) & (y < height) & (rise != 0)
    x, y = np.clip(x[inside], 0, width), y[inside]
    amount = -(rise * weight.ravel()[edge])[inside]
    column = np.minimum(x.astype(np.int64), width)
    index = y.astype(np.int64) * (width + 2) + column
    share = x - column
    sums = np.bincount(index, amount * (1 - share), height * (width + 2))
    sums += np.bincount(index + 1, amount * share, height * (width + 2))
    return np.asarray(np.cumsum(sums.reshape(height, width + 2), axis=1)[:, :width], float)


def _cut_edges(start: Array, stop: Array) -> tuple[IntArray, Array, Array]:
    """Cut edges (2, n) at pixel borders; return each part's edge, start and end (in 0…1)."""
    edges = np.arange(start.shape[1])
    ids, cuts = [edges], [np.zeros(len(edges))]
    for from_, to in zip(start, stop, strict=True):
        low = np.ceil(np.minimum(from_, to)).astype(np.int64)
        count = np.maximum(np.floor(np.maximum(from_, to)).astype(np.int64) - low + 1, 0)
        which = np.repeat(edges, count)
        step = np.arange(len(which)) - np.repeat(np.cumsum(count) - count, count)
        with np.errstate(divide="ignore", invalid="ignore"):
            at = (low[which] + step - from_[which]) / (to - from_)[which]
        keep = (at > 0) & (at < 1)
        ids.append(which[keep])
        cuts.append(at[keep])
    edge, t = np.concatenate(ids), np.concatenate(cuts)
    order = np.argsort(2 * edge + t)
    edge, t = edge[order], t[order]
    end = np.append(t[1:], 1.0)
    end[np.append(edge[1:] != edge[:-1], True)] = 1.0
    return edge, t, end


class BeamView:
    """One camera's view of a marked, moving structure, with data common to all frames."""

    VERTICES = 64  # of a marker; 0.007 px from its circle

    def __init__(
        self,
        camera: pinhole.Camera,
        markers: Markers,
        motion: Motion,
        sensor: Sensor,
        corners: Sequence[Point] | None = None,  # of the outline, m; of the markers' box if None
    ) -> None:
        self.camera, self.markers, self.motion, self.sensor = camera, markers, motion, sensor
        turn = 2 * np.pi * np.arange(self.VERTICES) / self.VERTICES
        radius = markers.diameter / 2 * np.sqrt(turn[1] / np.sin(turn[1]))  # of the same area
        circle = radius * np.stack([np.cos(turn), np.sin(turn)])
        discs = markers.positions[:, :, None] + circle[:, None]
        if corners is None:
            outline = _divide_sides(markers.corners.T, OUTLINE_STEP_M)
        else:
            outline = divide_hole(tuple(corners), OUTLINE_STEP_M).T
        self.points, self.polygons = _join_print([outline, *discs.swapaxes(0, 1)], sensor)
        self.shapes = motion.shapes(self.points)

    def frame(self, time: float, rng: np.random.Generator | None = None) -> Image:
        """Render the frame at a time in s of the motion; without a generator it has no noise."""
        return self.collect_light(time).recorded(self.sensor, rng)

    def collect_light(self, time: float) -> Light:
        """Collect the light of an exposure centred at a time in s of the motion."""
        samples = self.sensor.samples
        within = ((np.arange(samples) + 0.5) / samples - 0.5) * self.sensor.exposure
        deflection = self.motion.coordinates(time + within).T @ self.shapes
        if np.ptp(deflection, axis=0).max() < 1e-9:  # at rest
            deflection = deflection[:1]
        world = on_surface(self.markers.extent, self.points[:, None], deflection)
        uv = pinhole.project_points(self.camera, world)
        return collect_light(uv, self.polygons, self.camera.size, self.sensor)


def render_board(
    camera: pinhole.Camera,
    board: Board,
    rotation: ArrayLike,
    translation: ArrayLike,
    sensor: Sensor,
    rng: np.random.Generator | None = None,
) -> Image:
    """Render an image of a board that is printed on both sides.

    World coordinates are ``rotation @ board + translation``, in m. Without `rng` there is no noise.
    """
    shapes = [_divide_sides(vertices, 0.01) for vertices in (board.outline, *board.dark_tiles)]
    flat, polygons = _join_print(shapes, sensor)
    points = np.concatenate([flat, np.zeros_like(flat[:1])])
    world = np.asarray(rotation, float) @ points + np.asarray(translation, float)[:, None]
    uv = pinhole.project_points(camera, world)
    return collect_light(uv, polygons, camera.size, sensor).recorded(sensor, rng)


@dataclass(frozen=True)
class Light:
    """Light that a sensor collects in an exposure."""

    picture: NDArray[np.float32]  #: Grey levels without noise, shape (height, width)
    #: Rows and columns with more than background; None if nothing is in view
    box: tuple[slice, slice] | None

    def recorded(self, sensor: Sensor, rng: np.random.Generator | None = None) -> Image:
        """Add noise, if there is a generator, and round to eight bits."""
        picture = self.picture.copy()
        if rng is not None and (sensor.shot > 0 or sensor.read > 0):
            base = sensor.shot * sensor.background + sensor.read**2
            noise = rng.standard_normal(picture.shape, dtype=np.float32)
            noise *= np.float32(np.sqrt(base))
            if self.box is not None:
                variance = sensor.shot * picture[self.box] + sensor.read**2
                noise[self.box] *= np.sqrt(variance / base)
            picture += noise
        return np.asarray(cv2.convertScaleAbs(np.maximum(picture, 0, out=picture)), np.uint8)


def collect_light(uv: Array, polygons: Polygons, size: tuple[int, int], sensor: Sensor) -> Light:
    """Collect the light of polygons in front of the background, averaged over frames.

    `uv` are the vertices in px as :func:`rasterise_polygons` takes them.
    """
    width, height = size
    margin = int(np.ceil(5 * sensor.spread)) + 1
    points = uv.reshape(2, -1)
    low = np.maximum(np.floor(np.nanmin(points, axis=1)).astype(int) - margin, 0)
    high = np.minimum(np.ceil(np.nanmax(points, axis=1)).astype(int) + margin, size)
    picture = np.full((height, width), sensor.background, np.float32)
    box = None
    if np.all(high > low):  # else nothing is in view
        (left, top), (right, bottom) = low, high
        fine = SUBPIXELS_PER_PIXEL * (uv - low.reshape((2,) + (1,) * (uv.ndim - 1)))
        part = rasterise_polygons(fine, polygons, *(SUBPIXELS_PER_PIXEL * (high - low)))
        grey: Any = (part + sensor.background).astype(np.float32)  # OpenCV's types are wide
        if sensor.spread > 0:
            taps = 2 * SUBPIXELS_PER_PIXEL * margin - 1
            blur, border = SUBPIXELS_PER_PIXEL * sensor.spread, cv2.BORDER_REPLICATE
            grey = cv2.GaussianBlur(grey, (taps, taps), blur, borderType=border)
        grey = cv2.resize(grey, (high - low).tolist(), interpolation=cv2.INTER_AREA)
        box = slice(int(top), int(bottom)), slice(int(left), int(right))
        picture[box] = grey
    return Light(picture, box)


def _divide_sides(vertices: ArrayLike, step: float) -> Array:
    """Divide the sides of a polygon (n, 2) into parts of at most `step`, shape (2, m)."""
    corners = np.asarray(vertices, float)
    sides = []
    for here, there in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        n = int(np.ceil(np.linalg.norm(there - here) / step))
        sides.append(here[:, None] + (there - here)[:, None] * np.arange(n) / n)
    return np.concatenate(sides, axis=1)


EDGE_NODES = 256  # of the integral around the edge


def edge_scatter(width: float, height: float, sensor: Sensor) -> Array:
    """Return the least standard deviation of a disc's centre along u and v, shape (2,), px.

    An edge of contrast c and blur s, in pixels with noise σ, has the Fisher information
    c² / (2√π s σ²) per length about a shift along its normal n. Around the whole edge

        σ_u² = 2√π s σ² / (c² ∮ n_u² dl),  σ_v² = 2√π s σ² / (c² ∮ n_v² dl).

    A flat image has long edges above and below and short ones at its ends: σ_v stays, σ_u grows.
    The formula holds while opposite edges are farther apart than their blur.

    The image's axes along u and v are `width` and `height` in px. s includes the pixel's own area,
    and σ is that of the level between dark and white, rounding included.

    Examples
    --------
    >>> edge_scatter(11.2, 4.2, Sensor()).round(4)
    array([0.0109, 0.0052])
    """
    blur = np.sqrt(sensor.spread**2 + 1 / 12)
    noise = sensor.shot * (sensor.white + sensor.dark) / 2 + sensor.read**2 + 1 / 12
    turn = (np.arange(EDGE_NODES) + 0.5) * 2 * np.pi / EDGE_NODES
    # With (a cos t, b sin t) an edge has n dl = (b cos t, a sin t) dt.
    normal = np.stack([height / 2 * np.cos(turn), width / 2 * np.sin(turn)])
    around = 2 * np.pi * np.mean(normal**2 / np.hypot(*normal), axis=1)
    contrast = sensor.white - sensor.dark
    return np.asarray(np.sqrt(2 * np.sqrt(np.pi) * blur * noise / (contrast**2 * around)), float)
