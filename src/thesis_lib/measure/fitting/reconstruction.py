"""Compute deflections from tracks: triangulation, the structure's frame, single instants.

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

MAX_GRID_MISFIT = 0.1  # largest rms misfit at rest over the spacing
MAX_GRID_SCALE_ERROR = 0.01  # at rest


def triangulate_seen(P: ArrayLike, uv: ArrayLike) -> tuple[Array, IntArray]:
    """Triangulate points from the cameras that see them.

    Parameters
    ----------
    P : array_like, shape (cameras, 3, 4)
        Projection matrices.
    uv : array_like, shape (cameras, 2, ...)
        Image coordinates in px, NaN where a camera does not see a point.

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
    """Yield each set of two or more cameras, and a mask of the points that exactly these see."""
    for pattern in np.unique(visible, axis=1).T:
        if np.count_nonzero(pattern) >= 2:
            yield pattern, (visible == pattern[:, None]).all(axis=0)


@dataclass(frozen=True)
class Frame:
    """The structure's frame in the calibration's frame, from the markers at rest."""

    R: Array  #: Rotation: ``beam = R @ (calibration − origin)``, shape (3, 3)
    origin: Array  #: The structure's centre in the calibration's frame, m, shape (3,)
    rms: float  #: Rms distance of the markers from the nominal grid, m
    scale: float  #: Size of the measured grid over the nominal one; 1 if the calibration is right
    tilt: float  #: Angle between the best-fit plane of the markers and that of the frame, rad

    def to_beam(self, points: ArrayLike) -> Array:
        """Convert points (3, ...) from the calibration's frame to the structure's, m."""
        p = np.asarray(points, float)
        shifted = p - self.origin.reshape((3,) + (1,) * (p.ndim - 1))
        return np.asarray(np.tensordot(self.R, shifted, axes=1), float)


def fit_grid(points: ArrayLike, nominal: ArrayLike) -> Frame:
    """Fit measured markers (3, n) rigidly to their nominal grid (3, n) by Kabsch's method.

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
    frame: Frame  #: The structure's frame
    points: Array  #: Positions in the calibration's frame, m, shape (3, markers)
    places: Array  #: Nominal positions on the structure, m, shape (2, markers)
    thickness: float  #: Thickness of the structure, m
    radius: float = 0.0  #: Radius of markers whose size is corrected, m; 0: as points


def interpolate_frames(times: ArrayLike, values: ArrayLike, at: float, points: int = 6) -> Array:
    """Interpolate values (times, ...) at one time by a Lagrange polynomial through near frames.

    The error of six frames is below (ωh)⁶ 5/1024 of the amplitude for a step h: 4·10⁻⁵ at 60 frames
    a second and 4.25 Hz. The value is NaN where one of them is missing.
    """
    t, values = np.asarray(times, float), np.asarray(values, float)
    step = t[1] - t[0]
    first = int(np.clip(np.floor((at - t[0]) / step) - points // 2 + 1, 0, len(t) - points))
    near = t[first : first + points]
    weights = [
        np.prod([(at - other) / (own - other) for other in near if other != own]) for own in near
    ]
    return np.asarray(np.tensordot(weights, values[first : first + points], axes=1), float)


def deflection_at(P: Array, frame: Frame, rest: Array, uv: Array) -> Array:
    """Compute the deflection along the normal (markers,), m, from images at rest and one instant.

    Both images have shape (cameras, 2, markers). A marker is triangulated at both times with the
    cameras that see it at both.
    """
    both = np.isfinite(rest) & np.isfinite(uv)
    pair = np.stack([np.where(both, rest, np.nan), np.where(both, uv, np.nan)], axis=2)
    points, _ = triangulate_seen(P, pair)
    before, after = frame.to_beam(points)[2]
    return np.asarray(after - before, float)


def measure_instant(
    P: Array, frame: Frame, rest: Array, uv: Array, sigma: Array
) -> tuple[Array, Array]:
    """Measure the deflection at one instant, with its standard uncertainty, both (markers,), m.

    `rest` and `uv` are as in :func:`deflection_at`; `sigma`, (cameras, 2, markers), is the noise
    standard deviation of the centres at the instant minus those at rest, px. Results are NaN where
    fewer than two cameras see a marker in both images.
    """
    common = np.where(np.isfinite(rest) & np.isfinite(uv), sigma, np.nan)
    points, _ = triangulate_seen(P, rest)
    return deflection_at(P, frame, rest, uv), height_deviation(P, frame, points, common)


def normal_gain(P: Array, frame: Frame, points: Array, seen: Mask, axis: int = 2) -> Array:
    """Return the derivative of a point's height by each image coordinate, (cameras, 2, n), m/px.

    Height is along the structure's normal, or another `axis`. The derivative is zero for a camera
    that does not see a point by `seen` (cameras, n), and NaN where fewer than two do.
    """
    gains = np.zeros((len(P), 2, points.shape[1]))
    gains[:, :, seen.sum(axis=0) < 2] = np.nan
    for pattern, where in group_visible(seen):
        own = np.tensordot(frame.R[axis], triangulation_gain(P[pattern], points[:, where]), axes=1)
        gains[np.ix_(pattern, np.ones(2, bool), where)] = own
    return gains


def height_deviation(P: Array, frame: Frame, points: Array, sigma: Array, axis: int = 2) -> Array:
    """Return the standard deviation of heights (n,) in m for centre noise (cameras, 2, n) in px.

    Height is along the structure's normal, or another `axis`. NaN noise marks unseen points.
    """
    seen: Mask = np.all(np.isfinite(sigma), axis=1)
    each = normal_gain(P, frame, points, seen, axis) * np.where(seen[:, None], sigma, 0.0)
    return np.asarray(np.sqrt(np.sum(each**2, axis=(0, 1))), float)


def misfit_at_rest(cameras: Sequence[Camera], rest: Array) -> Array:
    """Return each camera's rms residual per coordinate in px of `rest` (cameras, 2, markers)."""
    P = projection_matrices(cameras)
    points, _ = triangulate_seen(P, rest)
    return np.asarray(np.sqrt(np.nanmean((project(P, points) - rest) ** 2, axis=(1, 2))), float)


def check_rest(cameras: Sequence[Camera], rest: Array, markers: Markers, thickness: float) -> Rest:
    """Return the markers at rest from their undistorted images, (cameras, 2, markers).

    Raises a ``ChainError`` if the markers are on one line, if they do not fit their nominal
    positions (naming the camera that fits worst), or if all cameras see them from behind.
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
    most = MAX_GRID_MISFIT * float(markers.nearest.min())
    if frame.rms <= most and abs(frame.scale - 1) <= MAX_GRID_SCALE_ERROR:
        if np.any(frame.to_beam(np.array([c.centre for c in cameras]).T)[2] >= 0):
            return Rest(rest, frame, points, markers.centres, thickness)
        raise ChainError(
            "every camera would be below the structure: corners_px run the wrong way round in all "
            "of them, as in a mirror; allowed: (0, 0), (length, 0), (length, width), (0, width), "
            "with x and y as the markers' places have them"
        )
    off = misfit_at_rest(cameras, rest)
    worst = int(np.nanargmax(off))
    who = f"camera {cameras[worst].name} fits worst, by {off[worst]:.1f} px: "
    if len(cameras) == 2:  # either may be wrong
        who = f"camera {cameras[0].name} or {cameras[1].name}, by {off[worst]:.1f} px: "
    raise ChainError(
        f"the markers at rest are {1000 * frame.rms:.1f} mm off their grid, whose size comes out "
        f"as {frame.scale:.3f} of the nominal one (allowed: {1000 * most:.2g} mm, "
        f"{MAX_GRID_SCALE_ERROR:.0%}); {who if off[worst] > 1 else ''}are "
        "videos and board images those of the same cameras, and tile and spacings as the "
        "manifest says?"
    )
