"""Homography from the beam's plane to the image, from the beam's four corners.

The corners are given, or detected as those of the largest bright region; a hole marks the clamped
end (thesis 5.1.2, figures F.3 and F.4). Under uneven or flickering light :func:`even_light` makes
the structure detectable by one threshold.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np

from thesis_lib.arrays import Array, ArrayLike, Image
from thesis_lib.measure.recordings.board import Markers
from thesis_lib.vision.pinhole import HALF_PIXEL, Camera, distort_pixels, undistort_pixels


def darken_markers(image: Image, markers: Markers) -> Image:
    """Return the image in which markers are dark: itself, or its negative."""
    return 255 - image if markers.bright else image


class TrackingError(ValueError):
    """A beam or markers that are not found; the message gives the reason and often a remedy."""


@dataclass(frozen=True)
class View:
    """Projection of the beam's plane into a camera."""

    camera: Camera  #: Intrinsics and distortion; the pose is not used
    markers: Markers  #: Markers and hole on the beam
    #: Homography from the beam's plane in m to undistorted pixels, shape (3, 3)
    H_image_plane: Array
    blur: float = 0.6  #: Standard deviation of the blur of edges in the image, px

    def to_image(self, plane: ArrayLike) -> Array:
        """Project points (2, ...) of the plane in m to pixels (2, ...), with distortion."""
        return distort_pixels(self.camera, apply_homography(self.H_image_plane, plane))

    def to_plane(self, uv: ArrayLike) -> Array:
        """Back-project pixels (2, ...), with distortion, to points (2, ...) of the plane in m."""
        return apply_homography(
            np.linalg.inv(self.H_image_plane), undistort_pixels(self.camera, uv)
        )

    def stretch(self, plane: ArrayLike) -> Array:
        """Return the derivative of :meth:`to_image` at points (2, n), shape (2, 2, n), px/m."""
        step, (x, y) = 1e-4, np.asarray(plane, float)
        along = self.to_image([x + step, y]) - self.to_image([x - step, y])
        across = self.to_image([x, y + step]) - self.to_image([x, y - step])
        return np.stack([along, across], axis=1) / (2 * step)


def apply_homography(H: ArrayLike, points: ArrayLike) -> Array:
    """Apply a homography (3, 3) to points (2, ...)."""
    H, p = np.asarray(H, float), np.asarray(points, float)
    x, y, w = np.tensordot(H[:, :2], p, axes=1) + H[:, 2].reshape((3,) + (1,) * (p.ndim - 1))
    return np.stack([x / w, y / w])


def fit_homography(source: ArrayLike, target: ArrayLike) -> Array:
    """Fit the homography between points (2, n), by least squares in the target; skip NaN.

    A :class:`TrackingError` is raised if fewer than four points remain, or if they are collinear.
    """
    source, target = np.asarray(source, float), np.asarray(target, float)
    known = np.isfinite(source + target).all(axis=0)
    count = np.count_nonzero(known)
    if count < 4:
        raise TrackingError(f"only {count} of {len(known)} points are known, and four are needed")
    H, _ = cv2.findHomography(source.T[known], target.T[known])
    if H is None or not np.isfinite(H).all() or np.linalg.cond(H) > 1e15:
        raise TrackingError(f"the {count} points known are on a line")
    return np.asarray(H, float)


def find_view(image: Image, camera: Camera, markers: Markers) -> View:
    """Detect the beam, a bright quadrilateral on a dark ground, and its clamped end.

    The hole distinguishes the two ends. For given corners use :func:`corner_view` instead.

    Parameters
    ----------
    image : ndarray of uint8, shape (h, w)
        Grey levels.
    camera : Camera
        Intrinsics and distortion; the pose is not used.
    markers : Markers
        Size of the beam, and positions of its markers and its hole.

    Raises
    ------
    TrackingError
        If no such quadrilateral is found, or if no hole distinguishes the ends.
    """
    corners = _find_quadrilateral(image, camera)
    if markers.hole is None:
        raise TrackingError(
            f"camera {camera.name}: the beam has no hole to distinguish its ends, give the four "
            "corners (corners_px)"
        )
    views = [corner_view(camera, markers, np.roll(corners, turn, axis=1)) for turn in (0, 2)]
    scores = [_hole_darkness(image, view) for view in views]
    if abs(scores[0] - scores[1]) < MIN_HOLE_DARKNESS:
        raise TrackingError(
            f"camera {camera.name}: the hole is not seen, so the clamped end is not known; give "
            "the four corners (corners_px)"
        )
    return views[int(np.argmax(scores))]


def corner_view(camera: Camera, markers: Markers, corners: ArrayLike) -> View:
    """Return the view from the beam's four corners in undistorted px, shape (2, 4).

    The corners are in the order (0, 0), (L, 0), (L, W), (0, W) of the beam's frame.
    """
    try:
        return View(camera, markers, fit_homography(markers.corners, corners))
    except TrackingError as error:
        raise TrackingError(f"camera {camera.name}: the beam's corners: {error}") from None


def _find_quadrilateral(image: Image, camera: Camera) -> Array:
    """Return the corners (2, 4) of the largest bright region, undistorted px, a long side first.

    The sides are straight only without lens distortion.
    """
    _, bright = cv2.threshold(image, 0, 255, cv2.THRESH_BINARY | cv2.THRESH_OTSU)
    # In small images a column of markers may cut the beam in two.
    closed = cv2.morphologyEx(bright, cv2.MORPH_CLOSE, np.ones((5, 5), np.uint8))
    regions, _ = cv2.findContours(closed, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    if not regions:
        raise TrackingError(f"camera {camera.name}: no bright region in the frame, so no beam")
    region = max(regions, key=cv2.contourArea)
    inside = cv2.drawContours(np.zeros_like(image), [region], 0, 255, cv2.FILLED)
    beam = cv2.bitwise_and(inside, bright)
    outlines, _ = cv2.findContours(beam, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    points = undistort_pixels(camera, np.concatenate(outlines)[:, 0].T + HALF_PIXEL).T
    points = points[np.isfinite(points[:, 0])]
    hull = cv2.convexHull(points.astype(np.float32))
    if cv2.contourArea(region) < 50 or len(hull) < 4 or min(cv2.minAreaRect(hull)[1]) < 2:
        raise TrackingError(
            f"camera {camera.name}: the largest bright region is too small to be the beam"
        )
    box = cv2.approxPolyN(hull, 4)[0].astype(float)
    for last in (False, False, True):  # assign points to the nearest side, then refit the sides
        sides = [*zip(box, np.roll(box, -1, axis=0), strict=True)]
        distances, lines = [], []
        for a, b in sides:
            t = np.clip((points - a) @ (b - a) / np.sum((b - a) ** 2), 0, 1)
            distances.append(np.linalg.norm(points - a - t[:, None] * (b - a), axis=1))
        nearest = np.argmin(distances, axis=0)
        for side, (a, b) in enumerate(sides):
            own = points[nearest == side]
            along = (own - a) @ (b - a) / np.sum((b - a) ** 2)
            own = own[(along > 0.03) & (along < 0.97)]  # corners are rounded
            if len(own) < 2:
                own = np.stack([a, b])
            vx, vy, x0, y0 = cv2.fitLine(own.astype(np.float32), cv2.DIST_HUBER, 0, 0.01, 0.01)
            normal = np.array([vy, -vx]).ravel()
            outward = np.sign(normal @ (np.ravel([x0, y0]) - box.mean(axis=0)))
            # Outlines run through the centres of the outermost pixels, half a pixel inside.
            gap = last * HALF_PIXEL * np.abs(normal).max() * outward
            lines.append(np.array([*normal, -normal @ np.ravel([x0, y0]) - gap]))
        cross = [np.cross(lines[k - 1], lines[k]) for k in range(4)]
        box = np.array([c[:2] / c[2] for c in cross])
    lengths = np.linalg.norm(np.roll(box, -1, axis=0) - box, axis=1)
    if lengths[0] + lengths[2] < lengths[1] + lengths[3]:
        box = np.roll(box, -1, axis=0)
    (x, y), (x_next, y_next) = box.T, np.roll(box, -1, axis=0).T
    if np.sum(x * y_next - y * x_next) > 0:  # order the corners as seen from above
        box = box[[1, 0, 3, 2]]
    return np.asarray(box.T)


def _hole_darkness(image: Image, view: View) -> float:
    """Return the darkness at the hole's expected place: 0 as the beam, 1 as the nearest marker."""
    markers = view.markers
    hole, grid = markers.positions[:, -1:], markers.positions[:, : markers.count]
    marker = grid[:, [np.argmin(np.hypot(*(grid - hole)))]]
    # The beam's grey level is sampled at the hole's offset from its nearest marker, but relative to
    # other markers, those of the same row first: the surroundings are alike there.
    steps = grid - marker
    inward = np.sign(np.array(markers.extent)[:, None] / 2 - hole)
    order = np.lexsort([np.abs(steps[0]), np.sum(steps * inward, axis=0) <= 0, np.abs(steps[1])])
    order = order[np.any(steps[:, order] != 0, axis=0)]
    places = hole + steps[:, order]
    free = np.min(np.hypot(*(places[:, :, None] - markers.positions[:, None])), axis=1)
    places = places[:, free > 2 * markers.diameter][:, :2]
    turn = np.linspace(0, 2 * np.pi, 16, endpoint=False)
    ring = markers.diameter * np.stack([np.cos(turn), np.sin(turn)])
    disc = np.column_stack([0.15 * ring, 0.35 * ring])
    beam = [disc + place[:, None] for place in places.T] or [marker + 1.5 * ring]
    greys = []
    for part in (hole + disc, marker + disc, np.hstack(beam)):
        u, v = (view.to_image(part) - HALF_PIXEL).astype(np.float32)
        grey = cv2.remap(image, u[None], v[None], cv2.INTER_LINEAR)[0]
        greys.append(float(np.mean(grey.astype(float))))
    dark, print_, white = greys
    return (white - dark) / max(white - print_, 10.0)


MIN_HOLE_DARKNESS = 0.4  # of the hole at one end over that at the other, relative to markers
GROUND_QUANTILE = 0.2  # the structure leaves at least this fraction of a row or column free
ROW_BLUR_PX = 2.0  # standard deviation of the smoothing over rows: light varies little over it
COARSE_STEP_PX = 8  # px of the frame per px of the reduced image in which ground is searched
# Fraction of the frame's width within which there is ground around every point of the structure
GROUND_REACH = 0.12
MIN_GROUND_LEVEL = 4.0  # least grey level of the ground from which the light can be estimated
WHITE_LEVEL = 250.0  # grey level of the 99 % quantile of an evened frame


def even_light(image: Image) -> Iterator[Image]:
    """Yield a frame as it is, then divided by three estimates of its illumination.

    Flickering light brightens rows of a rolling shutter unevenly, or columns in an upright frame; a
    lamp at the side brightens one part more. Each estimate is the brightness of the ground on which
    the structure lies: in each row, in each column, or around each pixel.
    """
    yield image
    grey = image.astype(float)
    for axis in (1, 0):
        along = np.quantile(grey, GROUND_QUANTILE, axis=axis)
        along = cv2.GaussianBlur(along[:, None], (1, 0), sigmaX=0.1, sigmaY=ROW_BLUR_PX)[:, 0]
        yield _divide_light(grey, along[:, None] if axis else along[None])
    height, width = image.shape
    size = max(1, width // COARSE_STEP_PX), max(1, height // COARSE_STEP_PX)
    coarse = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    side = 2 * max(1, round(GROUND_REACH * coarse.shape[1])) + 1
    ground = cv2.erode(coarse, np.ones((side, side), np.uint8))
    ground = cv2.GaussianBlur(ground.astype(np.float32), (0, 0), side / 4)
    yield _divide_light(grey, np.asarray(cv2.resize(ground, (width, height)), float))


def _divide_light(grey: Array, light: Array) -> Image:
    """Divide grey levels by those of the light; scale them so that the brightest are near white."""
    ratio = grey / np.maximum(light, MIN_GROUND_LEVEL)
    white = max(float(np.quantile(ratio, 0.99)), 1e-9)
    return np.asarray(np.clip(WHITE_LEVEL * ratio / white, 0, 255), np.uint8)
