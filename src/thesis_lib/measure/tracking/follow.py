"""Tracking of a video's markers from its first frame on, at full size or at several widths.

The fit of :func:`~.tracker.refine_centres` is linearised. For each marker and for 8 × 8 positions
of its centre within a pixel, the model of the grey levels around it is a sum of columns: ground,
structure, dark disc, the disc's two derivatives, and the structure's edge moved outward. The centre
in a frame is the product of its grey levels with a precomputed table; the product is repeated if
the centre lies in another cell. If a marker that fitted in the frame before no longer fits, the
tracker searches the frame for all markers.
"""

import contextlib
from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
import scipy

from thesis_lib.arrays import Array, Image, Mask
from thesis_lib.measure.recordings.board import Markers
from thesis_lib.measure.tracking import homography, tracker as discs
from thesis_lib.vision.pinhole import HALF_PIXEL, Camera, resize_camera, undistort_pixels

CELLS_PER_PIXEL = 8  # in each direction; 16 would change centres by 0.0005 px
MAX_FIT_ROUNDS = 6
MAX_CORRECTIONS = 2  # of given corners by matches: enough for 3 px in a strip 28 px high
MIDDLE_GREY = 128  # subtracted from all grey levels, for accuracy in single precision
# Assumed contrast between structure and ground, grey levels, for the prior of the edge's position
CONTRAST_GREY = 100.0
GROUND_STD_GREY = 10.0  # prior standard deviation of the ground's grey level from the first frame's
# Fraction of missing markers above which a frame does not determine displacements
MAX_MISSING_SHARE = 0.5
MAX_TABLE_BYTES = 4e8
PRIOR_STD = np.array([GROUND_STD_GREY, *[np.inf] * 4, discs.EDGE_STD_PX * CONTRAST_GREY])
PRIOR_WEIGHTS = (discs.NOISE_GREY / PRIOR_STD) ** 2


class Table:
    """Linear models of the grey levels around markers and hole, from a frame at rest."""

    def __init__(self, view: homography.View, image: Image) -> None:
        markers, plane = view.markers, view.markers.positions
        n, start = plane.shape[1], view.to_image(plane)
        ellipses = markers.diameter / 2 * np.moveaxis(view.stretch(plane), 2, 0)
        self.radii = np.linalg.inv(ellipses)  # from px, shape (n, 2, 2)
        reach = np.linalg.norm(ellipses, axis=2).max(axis=0)
        half = np.ceil(reach + 3 * view.blur + 1).astype(int)
        along, down = (np.arange(-k, k + 1) for k in half)
        self.half = half[:, None]
        self.u, self.v = (part.ravel() for part in np.meshgrid(along, down))
        shape, size = (n, CELLS_PER_PIXEL, CELLS_PER_PIXEL), len(self.u)
        if not np.isfinite(start).all():
            raise ValueError("a marker is where the lens shows nothing")
        if 4 * np.prod(shape) * 6 * size > MAX_TABLE_BYTES:
            raise MemoryError(f"a table of {n} markers with {size} pixels each is too large")
        patch = discs.Patch(view, np.arange(n), plane, ellipses)
        # Ground, structure, disc, its derivatives in u and v, edge, for each marker and cell
        self.columns = np.empty((*shape, 6, size), np.float32)
        self.inverse = np.empty((*shape, 6, 6))
        for row, column in np.ndindex(CELLS_PER_PIXEL, CELLS_PER_PIXEL):
            du = np.tile(along + HALF_PIXEL - (column + 0.5) / CELLS_PER_PIXEL, (n, 1))
            dv = np.tile(down + HALF_PIXEL - (row + 0.5) / CELLS_PER_PIXEL, (n, 1))
            white, outward = patch.beam(du, dv, np.zeros(n))
            usable = patch.usable(du, dv)
            parts = [1 - white, white, *discs.blur_ellipses(du, dv, ellipses, view.blur), outward]
            model = (np.stack(parts, axis=1) * usable[:, None]).reshape(n, 6, size)
            gram = model @ model.swapaxes(1, 2) + np.diag(PRIOR_WEIGHTS + 1e-6)
            self.columns[:, row, column] = model
            self.inverse[:, row, column] = np.linalg.inv(gram)
        whole = np.floor(start).astype(int)
        u, v = (part[:, None] for part in whole)
        height, width = image.shape
        grey = image[np.clip(v + self.v, 0, height - 1), np.clip(u + self.u, 0, width - 1)]
        du = along + HALF_PIXEL + (whole - start)[0][:, None]
        dv = down + HALF_PIXEL + (whole - start)[1][:, None]
        self.ground = patch.background(grey.reshape(n, len(down), len(along)), du, dv) - MIDDLE_GREY
        self.contrast = 0.0  # until the fit below gives the median between structure and markers
        self.contrast = self.fit(image, start)[3]

    def fit(self, image: Image, start: Array) -> tuple[Array, Mask, Mask, float]:
        """Fit centres (2, n), px, near `start`; return them, masks (accepted, inside), contrast."""
        n, (height, width) = start.shape[1], image.shape
        centre, inside = start.copy(), np.isfinite(start[0])
        contrast, squares, used = np.zeros(n), np.full(n, np.inf), np.ones(n)
        offsets, pixels = self.v * width + self.u, image.reshape(-1)
        size = np.array([[width], [height]])
        told = PRIOR_WEIGHTS * [self.ground, 0, 0, 0, 0, 0]
        left = np.flatnonzero(inside)
        for _ in range(MAX_FIT_ROUNDS):
            whole = np.floor(centre[:, left])
            within = np.all((whole >= self.half) & (whole < size - self.half), axis=0)
            inside[left[~within]] = False
            left, whole = left[within], whole[:, within].astype(int)
            column, row = np.floor(CELLS_PER_PIXEL * (centre[:, left] - whole)).astype(int)
            corner, at = whole[1] * width + whole[0], (left, row, column)
            grey = pixels[corner[:, None] + offsets].astype(np.float32) - MIDDLE_GREY
            columns = self.columns[at]
            right = (columns @ grey[:, :, None])[:, :, 0].astype(float)
            x = (self.inverse[at] @ (right + told)[:, :, None])[:, :, 0]
            usable = columns[:, 0] + columns[:, 1]  # shares of ground and structure add up to 1
            fitted = np.sum(x * (right - told + PRIOR_WEIGHTS * x), axis=1)
            squares[left] = np.einsum("np,np,np->n", usable, grey, grey) - fitted
            contrast[left] = np.maximum(-x[:, 2], 1)
            step = -x[:, 3:5].T / contrast[left]
            middle = whole + (np.stack([column, row]) + 0.5) / CELLS_PER_PIXEL
            centre[:, left] = middle + np.clip(step, -1, 1)
            used[left] = usable.sum(axis=1)
            left = left[np.abs(step).max(axis=0) > 1 / CELLS_PER_PIXEL]
            if len(left) == 0:
                break
        rms = np.sqrt(np.maximum(squares, 0) / np.maximum(used - 4, 1))
        strayed = (self.radii @ (centre - start).T[:, :, None])[:, :, 0]
        fits = (rms < discs.MAX_RESIDUAL_RATIO * contrast) & (np.linalg.norm(strayed, axis=1) < 1)
        holds = inside & fits
        holds[left] = False
        median = float(np.median(contrast[inside])) if inside.any() else 0.0
        holds &= contrast > 0.4 * max(median, self.contrast)  # no fit is accepted without light
        return centre, holds, inside, median


class Follower:
    """Tracks the markers of one camera by a :class:`Table`, else by :class:`~.tracker.Tracker`."""

    def __init__(self, tracker: discs.Tracker, image: Image) -> None:
        self.tracker, self.view = tracker, tracker.view
        self.table: Table | None = None
        with contextlib.suppress(MemoryError, ValueError):  # without a table, search each frame
            self.table = Table(self.view, image)
        self.rest = self.view.to_image(tracker.grid)
        # If the frequency is unknown, a prediction from the two frames before is off by up to four
        # times the displacement (motion at half the frame rate). It must not reach a neighbour.
        radius = self.view.markers.diameter / 2 * self.view.stretch(tracker.grid)
        distance, _ = scipy.spatial.KDTree(self.rest.T).query(self.rest.T, k=2)
        self.safe = (distance[:, 1] - np.linalg.norm(radius, axis=(0, 1))) / 4
        # Displacements in px in the last frame, NaN where missing, and in the one before it
        self.moved, self.before = np.zeros((2, *self.rest.shape))

    def centres(self, image: Image) -> Array:
        """Return the markers' centres in px, (2, markers), without the hole; NaN where missing.

        Frames must be given in order: earlier displacements predict the positions.
        """
        tracker, view, count = self.tracker, self.view, self.view.markers.count
        lost = np.isnan(self.moved[0])
        moved = discs.fill_missing(self.moved, tracker.grid, self.before)
        ahead = 2 * np.cos(tracker.turn) * moved - self.before
        uv: Array | None = None
        far = np.maximum(np.hypot(*moved), np.hypot(*self.before))
        if self.table is not None and (tracker.turn or np.all(far < self.safe)):
            fitted, holds, inside, _ = self.table.fit(image, self.rest + ahead)
            if (
                not np.any((inside & ~holds & ~lost)[:count])
                and np.mean(~holds) <= MAX_MISSING_SHARE
            ):
                uv = np.where(holds, fitted, np.nan)
        if uv is None:  # a marker no longer fits, or most do not: search a wide area for all
            tracker.moved, tracker.before = (
                view.to_plane(self.rest + part) - tracker.grid for part in (moved, self.before)
            )
            centres = tracker.centres(image)
            hole = view.to_image(tracker.grid + tracker.moved)[:, count:]
            uv = np.concatenate([centres, hole], axis=1)
        self.before, self.moved = moved, uv - self.rest
        if (
            np.isnan(uv[0]).mean() > MAX_MISSING_SHARE
        ):  # no light: extrapolate if the frequency is known
            self.moved = ahead if tracker.turn else moved
        return uv[:, :count]


def first_view(
    image: Image, camera: Camera, markers: Markers, corners_px: Sequence[tuple[float, float]] | None
) -> homography.View:
    """Estimate the camera's view of the structure in its first frame, from corners and markers.

    If no corners are given, they are detected in the frame as it is, then after evening its light.
    """
    if corners_px is not None:
        corners = undistort_pixels(camera, np.array(corners_px, float).T)
        view = homography.corner_view(camera, markers, corners)
        return discs.sharpen_view(image, view, MAX_CORRECTIONS)
    failures: list[homography.TrackingError] = []
    for even in homography.even_light(image):
        try:
            return discs.sharpen_view(image, homography.find_view(even, camera, markers))
        except homography.TrackingError as error:
            failures.append(error)
        if markers.hole is None:  # the ends cannot be distinguished in any light
            break
    raise failures[0]


def make_trackers(
    image: Image,
    camera: Camera,
    markers: Markers,
    corners_px: Sequence[tuple[float, float]] | None,
    turn: float,
    shares: Sequence[float] = (),
) -> tuple[Sequence[Follower | discs.Tracker], list[str]]:
    """Return trackers of a video's markers, from its first frame, in which markers are dark.

    The structure's corners in the image include the lens distortion, and are in the order of
    :func:`~.homography.corner_view`. `turn` is the vibration's phase advance per frame in rad; 0 if
    unknown. `shares` are fractions of the full width to which frames are reduced, with one tracker
    each: it detects the markers again, but uses the corners of the full frames. Without shares a
    :class:`Follower` tracks the full frames. The notes list widths at which the markers are not
    found correctly, with reasons.
    """
    view, notes = first_view(image, camera, markers, corners_px), []
    if not shares:
        return [Follower(discs.Tracker(view, turn), image)], []
    trackers: list[discs.Tracker] = []
    for picture in reduce_frames(image, shares):
        height, width = picture.shape
        scale = np.diag([width / camera.size[0], height / camera.size[1], 1.0])
        small = resize_camera(camera, (width, height))
        own = replace(view, camera=small, H_image_plane=scale @ view.H_image_plane)
        try:
            own = discs.sharpen_view(picture, own)
        except homography.TrackingError as error:
            notes.append(f"{width} px: {error}")
        trackers.append(discs.Tracker(own, turn))
    return trackers, notes


def reduce_frames(image: Image, shares: Sequence[float]) -> list[Image]:
    """Return the frame for each tracker: reduced to fractions of its width, or unchanged."""
    return [reduce_frame(image, round(share * image.shape[1])) for share in shares] or [image]


def reduce_frame(image: Image, width: int) -> Image:
    """Reduce a frame to a smaller width (section 5.2.1), by the mean over areas.

    For a fractional factor such as 3 : 2 that mean shifts every other pixel by 0.06 px; the frame
    is therefore enlarged to twice its size first, by linear interpolation.
    """
    height = round(width * image.shape[0] / image.shape[1])
    factor = image.shape[1] / width
    if factor <= 1:
        return image
    if factor != int(factor):
        image = np.asarray(cv2.resize(image, None, fx=2, fy=2, interpolation=cv2.INTER_LINEAR))
    return np.asarray(cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA))
