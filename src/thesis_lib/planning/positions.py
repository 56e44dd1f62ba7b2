"""Measured bodies, allowed camera positions, and the markers visible from them.

A *body* is a beam, a plate, or markers on any other bending structure: points in space, each of
which moves along its own normal. Everything is in metres, in the frame in which the body was given.

A camera position (`places` in the code) is a row (azimuth, elevation, distance, focal length over
sensor width): angles in rad about the body's centre, at which the camera looks, distance in m.
Sensors have a width of 1 here and a height of `aspect`: neither the allowed positions nor the best
layout depend on the number of pixels across.

Positions are rounded to a lattice: tenths of a degree, whole millimetres, or a given limit. The
last digit of costs and visibility differs between machines. Among positions so far apart the choice
does not depend on it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from thesis_lib.arrays import Array, Mask, NDArray
from thesis_lib.vibration.structure import Structure, deflection_shape
from thesis_lib.vision import pinhole

Limits = tuple[float, float]

PER_DEGREE = 10
PER_METRE = 1000
MAX_TIE_RATIO = 1e-7  # relative: costs that are closer count as equal
_STEP_DIGITS = 6  # decimals of a number of steps; further ones are round-off


@dataclass(frozen=True)
class Body:
    """Markers that vibrate along their normals."""

    name: str  #: Name
    points: Array  #: Markers at rest in m, shape (3, markers)
    #: Unit vectors along which they move, and towards which they face, shape (3, markers)
    normals: Array
    #: Deflections along the normals where the peak over the structure is 1, shape (modes, markers)
    shapes: Array
    frequencies: Array  #: In Hz, shape (modes,)
    modes: tuple[int, ...]  #: Numbers of the modes
    #: Corners to draw; empty if only the markers are known, shape (3, corners)
    outline: Array

    @cached_property
    def centre(self) -> Array:
        """Return the middle of the box around the markers, shape (3,): what all cameras look at."""
        return (self.points.max(axis=1) + self.points.min(axis=1)) / 2

    @property
    def reach(self) -> float:
        """Return the largest distance of a marker from the centre in m."""
        return float(np.max(np.linalg.norm(self.points - self.centre[:, None], axis=0)))

    def deflected(self, peaks: Sequence[float]) -> Array:
        """Return the markers at the peaks (m) of the modes, shape (3, modes, markers)."""
        moved = np.asarray(peaks)[:, None] * self.shapes
        return self.points[:, None] + self.normals[:, None] * moved

    def extremes(self, peaks: Sequence[float]) -> Array:
        """Return the markers at both ends of their largest motion, shape (3, 2, markers).

        A camera that sees both ends sees the whole motion of any of the modes, since images of
        straight lines are straight.
        """
        largest = np.max(np.abs(np.asarray(peaks)[:, None] * self.shapes), axis=0)
        return self.points[:, None] + self.normals[:, None] * np.stack([largest, -largest])


def build_body(structure: Structure, name: str, modes: Sequence[int]) -> Body:
    """Build the body of a beam or plate: its centre is the origin, its normals are +Z.

    Parameters
    ----------
    structure : Structure
        Beam or plate.
    name : str
        Name of the body.
    modes : sequence of int
        Numbers of the modes, from 1.
    """
    markers = structure.markers
    half = np.array(structure.extent) / 2
    flat = np.zeros((1, markers.shape[1]))
    corners = np.array([[-1, 1, 1, -1], [-1, -1, 1, 1]]) * half[:, None]
    shapes = [deflection_shape(structure, mode, markers, peak=1.0) for mode in modes]
    hertz = structure.angular_frequencies(max(modes)) / (2 * np.pi)
    return Body(
        name,
        np.concatenate([markers - half[:, None], flat]),
        np.concatenate([flat, flat, flat + 1]),
        np.array(shapes),
        hertz[np.array(modes) - 1],
        tuple(modes),
        np.concatenate([corners, np.zeros((1, 4))]),
    )


def angles(values: Array, limits: Limits) -> Array:
    """Return the angles in rad rounded to tenths of a degree, within limits."""
    return np.clip(_rounded(values), *limits)


def azimuths(values: Array, limits: Limits) -> Array:
    """Return the azimuths rounded as by :func:`angles`; for a full turn, -180° to below 180°."""
    if full_turn(limits):
        half = np.pi * (1 + 1e-12)  # -180° and 180° are the same
        return _rounded(np.mod(_rounded(values) + half, 2 * np.pi) - half)
    middle = (limits[0] + limits[1]) / 2
    return angles(middle + np.mod(values - middle + np.pi, 2 * np.pi) - np.pi, limits)


def _rounded(values: Array) -> Array:
    return np.radians(np.rint(np.round(np.degrees(values) * PER_DEGREE, _STEP_DIGITS)) / PER_DEGREE)


def full_turn(limits: Limits) -> bool:
    """Return whether the limits of azimuths span a full turn."""
    return limits[1] - limits[0] >= 2 * np.pi * (1 - 1e-9)


def lengths(values: Array, limits: Limits) -> Array:
    """Return the lengths in m rounded to millimetres, within limits."""
    return np.clip(np.rint(np.round(values * PER_METRE, _STEP_DIGITS)) / PER_METRE, *limits)


def length_at(index: NDArray[np.int_], limits: Limits) -> Array:
    """Return lengths in m by index: the least first, then whole millimetres, the largest last."""
    first = np.floor(np.round(limits[0] * PER_METRE, _STEP_DIGITS))
    return np.clip((first + index) / PER_METRE, *limits)


def first_least(costs: Array) -> int:
    """Return the index of the first cost that equals the least within `MAX_TIE_RATIO`."""
    return int(np.argmax(costs <= costs.min() * (1 + MAX_TIE_RATIO)))


def first_most(values: Array) -> NDArray[np.int_]:
    """Return the first index along the last axis that equals the largest within `MAX_TIE_RATIO`."""
    return np.argmax(values >= values.max(axis=-1, keepdims=True) * (1 - MAX_TIE_RATIO), axis=-1)


def sort_cameras(layout: Array) -> Array:
    """Return the layout with cameras sorted by azimuth, elevation, distance and focal length."""
    return layout[np.lexsort(whole_steps(layout).T[::-1])]


def whole_steps(layout: Array) -> NDArray[np.int_]:
    """Return positions in whole thousandths of a lattice step, free of round-off."""
    steps = layout * [1, 1, PER_METRE, PER_METRE]
    steps[:, :2] = np.degrees(layout[:, :2]) * PER_DEGREE
    return np.rint(1000 * steps).astype(int)


LIMIT_SLACK = 1e-9  # relative: positions on a limit are allowed
_TRIED_DISTANCES = 8  # distances tried, from the nearest that sees enough to the largest
_MAX_IMAGES = 2_000_000  # image points at a time, which bounds the memory


@dataclass(frozen=True)
class Rules:
    """Limits on positions. Angles in rad, lengths in m, regions in the body's frame."""

    #: Least and largest; azimuths may span more than a turn
    distances: tuple[float, float]
    azimuths: tuple[float, float]
    elevations: tuple[float, float]
    #: Largest angle between a marker's normal and the line of sight at which it is read
    tilt: float
    in_view: float  #: Share of the markers that each camera must see and read
    separation: float  #: Least distance between two cameras
    #: Forbidden boxes along the axes, least and largest coordinates, shape (boxes, 3, 2)
    boxes: Array
    spheres: Array  #: Forbidden spheres: centre and radius, shape (spheres, 4)
    #: Forbidden directions: least and largest azimuth, least and largest elevation, shape
    #: (sectors, 4)
    sectors: Array


@dataclass(frozen=True)
class Scene:
    """A body, how far its markers move, the rules, and the shape of the sensors."""

    body: Body  #: Measured body
    peaks: tuple[float, ...]  #: Peak deflection of each mode in m
    rules: Rules  #: Where cameras may stand
    focals: tuple[float, ...]  #: Focal lengths to choose from, over the sensor's width
    aspect: float  #: Height over width of the sensors


def camera_centres(scene: Scene, places: Array) -> Array:
    """Return the camera centres in m in the body's frame, shape (places, 3)."""
    out = pinhole.hemisphere_directions(places[:, 0], places[:, 1]) * places[:, 2:3]
    return out + scene.body.centre


def place_cameras(scene: Scene, places: Array, width: float = 1.0) -> pinhole.CameraArray:
    """Return the cameras at positions, each with its focal length and `width` pixels across."""
    size = (width, scene.aspect * width)
    if width != 1:
        size = (round(size[0]), round(size[1]))
    rig = pinhole.hemisphere_cameras(places[:, 2], places[:, 0], places[:, 1], width, size)  # type: ignore[arg-type]
    K = rig.K.copy()
    K[:, [0, 1], [0, 1]] *= places[:, 3:4]
    return replace(rig, K=K, centres=camera_centres(scene, places))


Visibility = tuple[Array, Array, Array]
"""Visibility of markers from directions, at any distance, as arrays (directions, markers).

The distance in m from which on a marker's whole motion is in the image; the marker's coordinate in
m from the centre along the direction; and the cosine between its normal and the direction.
"""


def compute_visibility(scene: Scene, grid: Array, focal: Array) -> Visibility:
    """Compute the visibility from directions (directions, 2) with focal lengths (directions,)."""
    body, R = scene.body, pinhole.hemisphere_rotations(grid[:, 0], grid[:, 1])
    ends = body.extremes(scene.peaks) - body.centre[:, None, None]
    across, down, beyond = np.moveaxis(np.tensordot(R, ends, 1), 1, 0)
    # a point is imaged focal × across / (distance + beyond) from the middle of the image
    aside = np.maximum(
        np.abs(across) / (1 / 2 + LIMIT_SLACK), np.abs(down) / (scene.aspect / 2 + LIMIT_SLACK)
    )
    inside = np.max(focal[:, None, None] * aside - beyond, axis=1)
    towards = -R[:, 2] @ (body.points - body.centre[:, None])
    return inside, towards, -R[:, 2] @ body.normals


def can_read(scene: Scene, seen: Visibility, distance: Array) -> Mask:
    """Return which markers stay in the image and are not too tilted to be read, (places, markers).

    Cameras are at a `distance` (places,) in m.
    """
    inside, towards, facing = seen
    rest = scene.body.points - scene.body.centre[:, None]
    d = distance[:, None]
    away = np.sqrt(d * (d - 2 * towards) + np.sum(rest**2, axis=0))
    cosine = (d * facing - np.sum(rest * scene.body.normals, axis=0)) / away
    return np.asarray((d >= inside) & (cosine - np.cos(scene.rules.tilt) + LIMIT_SLACK >= 0))


def region_clearances(scene: Scene, places: Array) -> Array:
    """Return each position's distance outside every forbidden region, shape (regions, places).

    In m for boxes and spheres, in rad for sectors: below 0 inside.
    """
    rules, where = scene.rules, camera_centres(scene, places)
    rows = [np.linalg.norm(where - s[:3], axis=1) - s[3] for s in rules.spheres]
    rows += [np.max(np.maximum(b[:, 0] - where, where - b[:, 1]), axis=1) for b in rules.boxes]
    for low, high, bottom, top in rules.sectors:
        middle, half = (low + high) / 2, (high - low) / 2
        aside = np.abs(np.mod(places[:, 0] - middle + np.pi, 2 * np.pi) - np.pi)
        # a full turn cannot be left sideways, nor a sector with a pole beyond that pole
        half = half if half < np.pi - LIMIT_SLACK else np.inf
        bottom = bottom if bottom > LIMIT_SLACK - np.pi / 2 else -np.inf
        top = top if top < np.pi / 2 - LIMIT_SLACK else np.inf
        rows.append(np.max([aside - half, bottom - places[:, 1], places[:, 1] - top], axis=0))
    return np.array(rows).reshape(-1, len(places))


def visible_markers(scene: Scene, places: Array) -> Mask:
    """Return which markers each position sees and can read, shape (places, markers)."""
    seen = np.zeros((len(places), scene.body.points.shape[1]), bool)
    for part in _parts(scene, len(places)):
        grid, distance, focal = np.split(places[part], [2, 3], axis=1)
        seen[part] = can_read(scene, compute_visibility(scene, grid, focal[:, 0]), distance[:, 0])
    return seen


def _parts(scene: Scene, count: int) -> list[slice]:
    """Return slices of `count` positions that fit into memory."""
    step = max(1, _MAX_IMAGES // (2 * scene.body.points.shape[1]))
    return [slice(i, i + step) for i in range(0, count, step)]


def shows_enough(scene: Scene, seen: Mask) -> Mask:
    """Return which positions' views (places, markers) hold the required share, shape (places,)."""
    return seen.mean(axis=1) >= scene.rules.in_view - LIMIT_SLACK


def too_near(scene: Scene, places: Array, others: Array) -> Mask:
    """Return which positions are too near which others, shape (places, others)."""
    from scipy.spatial.distance import cdist  # late: listing figure sets needs no SciPy

    gap = cdist(camera_centres(scene, places), camera_centres(scene, others))
    return np.asarray(gap < max(scene.rules.separation * (1 - LIMIT_SLACK), 1e-9))


def is_allowed(scene: Scene, layout: Array) -> bool:
    """Return whether a layout satisfies all rules."""
    return bool(np.all(are_permitted(scene, layout))) and is_spaced(scene, layout)


def is_spaced(scene: Scene, layout: Array) -> bool:
    """Return whether the cameras of a layout are far enough from each other."""
    return bool(too_near(scene, layout, layout).sum() == len(layout))  # each is near itself


def candidate_positions(scene: Scene, step: float) -> Array:
    """Return the allowed candidate positions, shape (candidates, 4).

    For every direction of a grid, about `step` (rad) apart, and every focal length, they are at the
    two nearest allowed ones of distances that grow from the nearest one that sees enough markers.
    """
    (low, high), (bottom, top) = scene.rules.azimuths, scene.rules.elevations
    turn = full_turn(scene.rules.azimuths)
    count = int(np.ceil((2 * np.pi if turn else high - low) / step - 1e-6))
    azimuth = np.linspace(low, low + 2 * np.pi if turn else high, count + 1)[: -1 if turn else None]
    elevation = np.linspace(bottom, top, int(np.ceil((top - bottom) / step - 1e-6)) + 1)
    axes = azimuths(azimuth, (low, high)), angles(elevation, (bottom, top))
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    limits = scene.rules.distances
    found = []
    for focal in scene.focals:
        near = nearest_distances(scene, grid, focal)
        steps = np.linspace(0, 1, _TRIED_DISTANCES)
        ladder = [lengths(near * (limits[1] / near) ** t, limits) for t in steps]
        # Of shape (ladder, directions, 4)
        every = np.stack([combine_positions(grid, d, focal) for d in ladder])
        allowed = are_permitted(scene, every.reshape(-1, 4)).reshape(len(ladder), -1)
        if limits[0] == limits[1]:
            allowed[1:] = False
        found.append(every[allowed & (np.cumsum(allowed, axis=0) <= 2)])
    return np.concatenate(found)


def are_permitted(scene: Scene, places: Array) -> Mask:
    """Return which positions satisfy all rules that concern single cameras, shape (places,)."""
    azimuth, elevation, distance = places[:, 0], places[:, 1], places[:, 2]
    low, high = scene.rules.azimuths
    turned = np.mod(azimuth - low + LIMIT_SLACK, 2 * np.pi) <= high - low + 2 * LIMIT_SLACK
    inside = (high - low >= 2 * np.pi - LIMIT_SLACK) | turned
    limits = (elevation, scene.rules.elevations), (distance, scene.rules.distances)
    for values, (least, most) in limits:
        inside = inside & (values >= least * (1 - LIMIT_SLACK) - LIMIT_SLACK)
        inside = inside & (values <= most * (1 + LIMIT_SLACK) + LIMIT_SLACK)
    allowed = np.asarray(inside & np.all(region_clearances(scene, places) >= -LIMIT_SLACK, axis=0))
    allowed[allowed] = shows_enough(scene, visible_markers(scene, places[allowed]))
    return allowed


def combine_positions(grid: Array, distance: Array | float, focal: Array | float) -> Array:
    """Return positions from directions (places, 2), distances and focal lengths."""
    return np.column_stack([grid, *(np.broadcast_to(one, len(grid)) for one in (distance, focal))])


def nearest_distances(scene: Scene, grid: Array, focal: Array | float) -> Array:
    """Find each direction's least distance that sees enough by bisection; else the largest."""
    limits, focal = scene.rules.distances, np.broadcast_to(focal, len(grid))
    low_mm, high_mm = np.round(np.array(limits) * PER_METRE, _STEP_DIGITS)
    last = int(np.ceil(high_mm) - np.floor(low_mm))  # the index of the largest length
    found = np.full(len(grid), last)
    for part in _parts(scene, len(grid)) if last else []:
        seen, high = compute_visibility(scene, grid[part], focal[part]), found[part]
        low = np.full(len(high), -1)
        for _ in range(last.bit_length()):
            middle = np.maximum((low + high) // 2, 0)
            good = shows_enough(scene, can_read(scene, seen, length_at(middle, limits)))
            high, low = np.where(good, np.minimum(middle, high), high), np.where(good, low, middle)
        found[part] = high
    return length_at(found, limits)
