"""From tracks to deflections: triangulation, the structure's frame, one instant.

Tracks are marker centres without lens distortion, shape ``(cameras, 2, frames, markers)`` in px,
NaN where a marker is missing; every camera has its own times, shape ``(cameras, frames)`` in s.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from thesis_lib.arrays import Array, ArrayLike, IntArray, Mask
from thesis_lib.measure.recordings.board import Markers
from thesis_lib.measure.recordings.validation import ChainError, on_one_line
from thesis_lib.vision.pinhole import Camera, project, projection_matrices
from thesis_lib.vision.triangulation import triangulate, triangulation_gain

GRID_SHARE, GRID_SCALE = 0.1, 0.01  # most distance over spacing, and error of size, at rest


def triangulate_seen(P: ArrayLike, uv: ArrayLike) -> tuple[Array, IntArray]:
    """Triangulate points from the cameras that see them.

    Parameters
    ----------
    P : array_like, shape (cameras, 3, 4)
        Projection matrices.
    uv : array_like, shape (cameras, 2, ...)
        Images in px, NaN where a camera does not see a point.

    Returns
    -------
    points : ndarray, shape (3, ...)
        In m; NaN where fewer than two cameras see the point.
    counts : ndarray of int, shape (...)
        Number of cameras that see each point.
    """
    P, uv = np.asarray(P, float), np.asarray(uv, float)
    flat = uv.reshape(len(P), 2, -1)
    visible = np.isfinite(flat).all(axis=1)
    points = np.full((3, flat.shape[2]), np.nan)
    for pattern, where in group_visible(visible):
        points[:, where] = triangulate(P[pattern], flat[pattern][:, :, where])
    return points.reshape((3,) + uv.shape[2:]), visible.sum(axis=0).reshape(uv.shape[2:])


def group_visible(visible: Mask) -> Iterator[tuple[Mask, Mask]]:
    """Yield sets of two cameras or more, and the points (cameras, n) that just these see."""
    for pattern in np.unique(visible, axis=1).T:
        if np.count_nonzero(pattern) >= 2:
            yield pattern, (visible == pattern[:, None]).all(axis=0)


@dataclass(frozen=True)
class Frame:
    """The beam's frame in the frame of the calibration, from its markers at rest."""

    R: Array  #: Rotation: ``beam = R @ (calibration − origin)``, shape (3, 3)
    origin: Array  #: The beam's centre in the calibration's frame, m, shape (3,)
    rms: float  #: Rms distance of the markers from the nominal grid, m
    scale: float  #: Size of the measured grid over the nominal one; 1 if the calibration is right
    tilt: float  #: Angle between the plane of the markers alone and the fitted one, rad

    def to_beam(self, points: ArrayLike) -> Array:
        """Return the points (3, ...) of the calibration's frame in the beam's, m."""
        p = np.asarray(points, float)
        shifted = p - self.origin.reshape((3,) + (1,) * (p.ndim - 1))
        return np.asarray(np.tensordot(self.R, shifted, axes=1), float)


def fit_grid(points: ArrayLike, nominal: ArrayLike) -> Frame:
    """Return rigid fit of measured markers (3, n) to their nominal grid (3, n), by Kabsch's method.

    Raises
    ------
    ChainError
        If fewer than three markers are known.
    """
    points, nominal = np.asarray(points, float), np.asarray(nominal, float)
    known = np.isfinite(points).all(axis=0)
    if np.count_nonzero(known) < 3:
        raise ChainError("fewer than three markers at rest are seen by two cameras")
    measured, grid = points[:, known], nominal[:, known]
    a, b = measured.mean(axis=1), grid.mean(axis=1)
    m, g = measured - a[:, None], grid - b[:, None]
    U, _, Vt = np.linalg.svd(g @ m.T)
    R = U @ np.diag([1, 1, np.linalg.det(U @ Vt)]) @ Vt
    rms = float(np.sqrt(np.mean(np.sum((R @ m - g) ** 2, axis=0))))
    scale = float(np.sqrt(np.sum(m**2) / np.sum(g**2)))
    normal = np.linalg.svd(R @ m)[0][:, 2]
    tilt = float(np.arccos(min(abs(normal[2]), 1.0)))
    return Frame(R, a - R.T @ b, rms, scale, tilt)


@dataclass(frozen=True)
class Rest:
    """The markers at rest."""

    images: Array  #: Centres without distortion, px, shape (cameras, 2, markers)
    frame: Frame  #: The structure's
    points: Array  #: In the calibration's frame, m, shape (3, markers)
    places: Array  #: On the structure, m, shape (2, markers)
    thickness: float = 0.0  #: Of the structure, m


def interpolate_frames(times: ArrayLike, values: ArrayLike, at: float, points: int = 6) -> Array:
    """Return Lagrange interpolation of values (times, ...) at one time, through the nearest frames.

    Six frames err by less than (ωh)⁶ 5/1024 of the amplitude for a step h: 4·10⁻⁵ at 60 frames a
    second and 4.25 Hz. Where one of them is missing the value is NaN. One point is the nearest
    frame itself.
    """
    t, values = np.asarray(times, float), np.asarray(values, float)
    step = t[1] - t[0]
    if points == 1:
        return values[int(np.clip(np.rint((at - t[0]) / step), 0, len(t) - 1))]
    first = int(np.clip(np.floor((at - t[0]) / step) - points // 2 + 1, 0, len(t) - points))
    near = t[first : first + points]
    weights = [
        np.prod([(at - other) / (own - other) for other in near if other != own]) for own in near
    ]
    return np.asarray(np.tensordot(weights, values[first : first + points], axes=1), float)


def deflection_at(P: ArrayLike, frame: Frame, rest: ArrayLike, uv: ArrayLike) -> Array:
    """Return the deflection along the beam's normal (markers,), m, from rest and one instant.

    Both images have shape (cameras, 2, markers); a marker seen by other cameras at rest than at
    the instant counts in both with the cameras that it has in common.
    """
    rest, uv = np.asarray(rest, float), np.asarray(uv, float)
    both = np.isfinite(rest) & np.isfinite(uv)
    pair = np.stack([np.where(both, rest, np.nan), np.where(both, uv, np.nan)], axis=2)
    points, _ = triangulate_seen(P, pair)
    before, after = frame.to_beam(points)[2]
    return np.asarray(after - before, float)


def measure_instant(
    P: Array, frame: Frame, rest: ArrayLike, uv: ArrayLike, sigma: Array
) -> tuple[Array, Array]:
    """Measure the deflection at one instant, with its standard uncertainty, both (markers,), m.

    From rest and the instant as in :func:`deflection_at`; `sigma`, (cameras, 2, markers), is the
    standard deviation by noise of an image of the instant less that of rest, px. Both rest on the
    cameras that see a marker in both images; NaN if fewer than two do.
    """
    rest, uv = np.asarray(rest, float), np.asarray(uv, float)
    common = np.where(np.isfinite(rest) & np.isfinite(uv), sigma, np.nan)
    points, _ = triangulate_seen(P, rest)
    return deflection_at(P, frame, rest, uv), height_deviation(P, frame, points, common)


def normal_gain(P: Array, frame: Frame, points: Array, seen: Mask, axis: int = 2) -> Array:
    """Change of a point's height over the beam by each image coordinate, (cameras, 2, n), m/px.

    Or of its place along another `axis` of the beam. A camera that does not see a point, by `seen`
    (cameras, n), has no part in it; NaN where fewer than two do.
    """
    gains = np.zeros((len(P), 2, points.shape[1]))
    gains[:, :, seen.sum(axis=0) < 2] = np.nan
    for pattern, where in group_visible(seen):
        own = np.tensordot(frame.R[axis], triangulation_gain(P[pattern], points[:, where]), axes=1)
        gains[np.ix_(pattern, np.ones(2, bool), where)] = own
    return gains


def height_deviation(P: Array, frame: Frame, points: Array, sigma: Array, axis: int = 2) -> Array:
    """Return the standard deviation of heights (n,) in m for centre noise (cameras, 2, n) in px.

    Or of places along another `axis` of the beam. Where the noise is NaN a camera does not see it.
    """
    seen: Mask = np.all(np.isfinite(sigma), axis=1)
    each = normal_gain(P, frame, points, seen, axis) * np.where(seen[:, None], sigma, 0.0)
    return np.asarray(np.sqrt(np.sum(each**2, axis=(0, 1))), float)


def misfit_at_rest(cameras: Sequence[Camera], rest: Array) -> Array:
    """Return the rms residual in px of a coordinate of markers at rest (cameras, 2, markers)."""
    P = projection_matrices(cameras)
    points, _ = triangulate_seen(P, rest)
    return np.asarray(np.sqrt(np.nanmean((project(P, points) - rest) ** 2, axis=(1, 2))), float)


def check_frame(cameras: Sequence[Camera], rest: Array, markers: Markers) -> Frame:
    """Return the structure's frame from undistorted markers at rest, (cameras, 2, markers).

    Refuse those on one line, those that do not fit their places, with the camera that fits worst,
    and those that all cameras see from behind.
    """
    points, seen = triangulate_seen(projection_matrices(cameras), rest)
    frame = fit_grid(points, markers.world[:, : markers.count])
    places = 1000 * markers.centres[:, seen >= 2]
    if on_one_line(places, 1000 * markers.diameter):
        raise ChainError(
            f"the {places.shape[1]} of {len(seen)} markers that two cameras see at rest are on one "
            "line, which does not tell how the structure is turned about it: move a camera, or add "
            "markers beside the line"
        )
    most = GRID_SHARE * float(markers.nearest.min())
    if frame.rms <= most and abs(frame.scale - 1) <= GRID_SCALE:
        if np.any(frame.to_beam(np.array([c.centre for c in cameras]).T)[2] >= 0):
            return frame
        raise ChainError(
            "every camera would be below the structure: corners_px run the wrong way round in all "
            "of them, as in a mirror; allowed: (0, 0), (length, 0), (length, width), (0, width), "
            "with x and y as the markers' places have them"
        )
    off = misfit_at_rest(cameras, rest)
    worst = int(np.nanargmax(off))
    who = f"camera {cameras[worst].name} fits worst, by {off[worst]:.1f} px: "
    if len(cameras) == 2:  # which contradict each other
        who = f"camera {cameras[0].name} or {cameras[1].name}, by {off[worst]:.1f} px: "
    raise ChainError(
        f"the markers at rest are {1000 * frame.rms:.1f} mm off their grid, whose size comes out "
        f"as {frame.scale:.3f} of the nominal one (allowed: {1000 * most:.2g} mm, "
        f"{GRID_SCALE:.0%}); {who if off[worst] > 1 else ''}are "
        "videos and board images those of the same cameras, and tile and spacings as the "
        "manifest says?"
    )
