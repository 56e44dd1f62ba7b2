"""From frames to marker centres (thesis 5.1.2, Appendix F).

The four corners of the beam give a homography to its plane. The frame is resampled on that plane,
without lens distortion and cropped to the beam; a disc is matched to it; the matches are assigned
to the grid that the frames before predict, the hole included, which keeps it from being taken for
a marker. Each match is then refined in the frame itself, where no resampling has touched it, by a
least-squares fit of a blurred ellipse whose shape the homography tells. What is hidden, cut off
or doubtful comes back as NaN.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import linear_sum_assignment, minimize_scalar
from scipy.special import ndtr

from thesis_lib.experiment.lens import HALF, Camera, distort, from_pixels, to_pixels, undistorted
from thesis_lib.experiment.scene import Markers

Array = NDArray[np.float64]
Image = NDArray[np.uint8]

SCALE = 2000.0  # pixels per metre of the resampled beam
REACH = 0.025  # how far beyond the beam it is searched, m: more than a row moves on its plane
BLURS = (0.15, 1.5)  # px
POOR = 0.15  # rms residual over contrast from which a fit is doubtful
EDGE = 0.05  # px by which the beam's edge may be off its place
NOISE = 3.0  # grey levels against which that is weighed
LEAST_SCORE = 0.45  # of the correlation with a disc, for a match to be considered


class TrackingError(ValueError):
    """A beam that is not found; the message says what to do."""


@dataclass(frozen=True)
class View:
    """How a camera sees the beam's plane.

    Parameters
    ----------
    camera : Camera
        Intrinsics and distortion; the pose is not used.
    markers : Markers
        What is printed on the beam.
    H_image_plane : ndarray, shape (3, 3)
        Homography from the beam's plane in m to undistorted pixels.
    blur : float
        Standard deviation in px of the edges in the picture.
    """

    camera: Camera
    markers: Markers
    H_image_plane: Array
    blur: float = 0.6

    def to_image(self, plane: ArrayLike) -> Array:
        """Pixels (2, ...), distortion included, of points (2, ...) of the plane in m."""
        ideal = apply(self.H_image_plane, plane)
        camera = self.camera
        return to_pixels(camera.K, distort(from_pixels(camera.K, ideal), camera.distortion))

    def to_plane(self, uv: ArrayLike) -> Array:
        """Points (2, ...) of the plane in m of pixels (2, ...)."""
        return apply(np.linalg.inv(self.H_image_plane), undistorted(self.camera, uv))

    def stretch(self, plane: ArrayLike) -> Array:
        """Derivative of :meth:`to_image`, shape (2, 2, n), in px/m, for points (2, n)."""
        step, (x, y) = 1e-4, np.asarray(plane, float)
        along = self.to_image([x + step, y]) - self.to_image([x - step, y])
        across = self.to_image([x, y + step]) - self.to_image([x, y - step])
        return np.stack([along, across], axis=1) / (2 * step)


def apply(H: ArrayLike, points: ArrayLike) -> Array:
    """A homography (3, 3) applied to points (2, ...)."""
    H, p = np.asarray(H, float), np.asarray(points, float)
    x, y, w = np.tensordot(H[:, :2], p, axes=1) + H[:, 2].reshape((3,) + (1,) * (p.ndim - 1))
    return np.stack([x / w, y / w])


def homography(source: ArrayLike, target: ArrayLike) -> Array:
    """Homography that takes points (2, n) to points (2, n) best in the target; NaN is left out."""
    source, target = np.asarray(source, float), np.asarray(target, float)
    known = np.isfinite(source[0] + target[0])
    H, _ = cv2.findHomography(source.T[known], target.T[known])
    return np.asarray(H, float)


# Finding the beam.


def find_view(image: Image, camera: Camera, markers: Markers) -> View:
    """Find the beam, a bright quadrilateral on a dark ground, and which end is clamped.

    The hole tells the two ends apart. Corners that are given instead go to :func:`view_of`.

    Raises
    ------
    TrackingError
        If no such quadrilateral is seen, or the hole does not tell the ends apart.
    """
    corners = undistorted(camera, _bright_quadrilateral(image))
    if markers.hole is None:
        raise TrackingError(
            f"camera {camera.name}: the beam has no hole to tell its ends apart, give the four "
            "corners (corners_px)"
        )
    views = [view_of(camera, markers, np.roll(corners, turn, axis=1)) for turn in (0, 2)]
    scores = [_hole_score(image, view) for view in views]
    if abs(scores[0] - scores[1]) < 0.2:
        raise TrackingError(
            f"camera {camera.name}: the hole is not seen, so the clamped end is not known; give "
            "the four corners (corners_px)"
        )
    return views[int(np.argmax(scores))]


def view_of(camera: Camera, markers: Markers, corners: ArrayLike) -> View:
    """The view for the four corners in undistorted px, shape (2, 4).

    In the order of the beam's frame: (0, 0), (L, 0), (L, W), (0, W).
    """
    length, width = markers.beam.extent
    plane = np.array([[0, length, length, 0], [0, 0, width, width]])
    return View(camera, markers, homography(plane, corners))


def _bright_quadrilateral(image: Image) -> Array:
    """Corners (2, 4) in px of the largest bright region, the longer sides first and third."""
    _, bright = cv2.threshold(image, 0, 255, cv2.THRESH_BINARY | cv2.THRESH_OTSU)
    outlines, _ = cv2.findContours(bright, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    if not outlines:
        raise TrackingError("no bright region in the frame, so no beam")
    outline = max(outlines, key=cv2.contourArea)
    box = cv2.boxPoints(cv2.minAreaRect(outline)).astype(float)
    points = outline[:, 0].astype(float)
    if np.linalg.norm(box[1] - box[0]) < np.linalg.norm(box[2] - box[1]):
        box = np.roll(box, -1, axis=0)
    if cv2.contourArea(outline) < 50 or np.linalg.norm(box[2] - box[1]) < 2:
        raise TrackingError("the largest bright region is too small to be the beam")
    for _ in range(3):  # points go to the nearest side, sides to their points
        nearest = np.argmin([_distance(points, a, b) for a, b in _sides(box)], axis=0)
        lines = []
        for side, (a, b) in enumerate(_sides(box)):
            own = points[nearest == side]
            along = (own - a) @ (b - a) / np.sum((b - a) ** 2)
            own = own[(along > 0.03) & (along < 0.97)]  # corners are round
            if len(own) < 2:
                own = np.stack([a, b])
            vx, vy, x0, y0 = cv2.fitLine(own.astype(np.float32), cv2.DIST_HUBER, 0, 0.01, 0.01)
            lines.append(np.array([vy, -vx, vx * y0 - vy * x0]).ravel())
        cross = [np.cross(lines[k - 1], lines[k]) for k in range(4)]
        box = np.array([c[:2] / c[2] for c in cross])
    # Contours run through the centres of the outermost bright pixels, half a pixel inside.
    middle = box.mean(axis=0)
    box = box + HALF * np.sign(box - middle) * [0, 1] + HALF
    (x, y), (x_next, y_next) = box.T, np.roll(box, -1, axis=0).T
    if np.sum(x * y_next - y * x_next) > 0:  # seen from above it runs this way
        box = box[[1, 0, 3, 2]]
    return np.asarray(box.T)


def _sides(box: Array) -> list[tuple[Array, Array]]:
    return [(box[k], box[(k + 1) % 4]) for k in range(4)]


def _distance(points: Array, a: Array, b: Array) -> Array:
    """Distance of points (n, 2) from the segment from a to b."""
    t = np.clip((points - a) @ (b - a) / np.sum((b - a) ** 2), 0, 1)
    return np.asarray(np.linalg.norm(points - a - t[:, None] * (b - a), axis=1))


def _hole_score(image: Image, view: View) -> float:
    """Contrast of the place where the hole should be, from 0 to about 1."""
    assert view.markers.hole is not None
    turn = np.linspace(0, 2 * np.pi, 16, endpoint=False)
    ring = view.markers.diameter * 0.85 * np.stack([np.cos(turn), np.sin(turn)])
    hole = np.array(view.markers.hole)[:, None]
    inside, around = (view.to_image(hole + part) for part in (0.2 * ring, ring))
    grey = [_sample(image, uv) for uv in (inside, around)]
    white = np.percentile(grey[1], 75)
    return float((white - np.mean(grey[0])) / max(white, 1.0))


def _sample(image: Image, uv: Array) -> Array:
    u, v = (uv - HALF).astype(np.float32)
    return np.asarray(cv2.remap(image, u[None], v[None], cv2.INTER_LINEAR)[0], np.float64)


def sharpen(image: Image, view: View) -> View:
    """The view with the homography of all markers at rest, and the blur that fits them best.

    Raises
    ------
    TrackingError
        If fewer than half of the markers are found.
    """
    grid = view.markers.positions
    for _ in range(2):
        found, _ = assign(grid, Tracker(view).matches(image), _gate(view.markers))
        view = replace(view, blur=_best_blur(image, view, found))
        centres, _ = refine(image, view, found)
        count = np.count_nonzero(np.isfinite(centres[0]))
        if count < grid.shape[1] / 2:
            raise TrackingError(
                f"camera {view.camera.name}: only {count} of {grid.shape[1]} markers are found in "
                "the first frame"
            )
        view = replace(view, H_image_plane=homography(grid, undistorted(view.camera, centres)))
    return view


def _best_blur(image: Image, view: View, found: Array) -> float:
    """The blur in px that fits best; the one the view has if nothing fits."""

    def misfit(blur: float) -> float:
        value = refine(image, replace(view, blur=blur), found)[1]
        return value if np.isfinite(value) else 1e3

    if misfit(view.blur) == 1e3:
        return view.blur
    return float(minimize_scalar(misfit, bounds=BLURS, method="bounded",
                                 options={"xatol": 0.01}).x)  # fmt: skip


def _gate(markers: Markers) -> float:
    """How far a match may be from where a marker is expected, m."""
    return 0.45 * min(markers.row_spacing, markers.beam.marker_spacing)


# Tracking it.


class Tracker:
    """Tracks the markers of one camera, frame after frame."""

    def __init__(self, view: View) -> None:
        self.view = view
        markers = view.markers
        length, width = markers.beam.extent
        self.origin = np.array([-REACH, -REACH]) + 0.5 / SCALE
        nx, ny = (int(SCALE * (size + 2 * REACH)) for size in (length, width))
        grid = np.stack(np.meshgrid(np.arange(nx), np.arange(ny))) / SCALE
        u, v = view.to_image(grid + self.origin[:, None, None]).astype(np.float32)
        self.maps = u - np.float32(HALF), v - np.float32(HALF)
        self.template = _disc(markers.diameter * SCALE)
        self.grid = markers.positions
        self.gate = _gate(markers)
        self.moved = np.zeros_like(self.grid)
        self.before = np.zeros_like(self.grid)

    def centres(self, image: Image) -> Array:
        """Centres of the markers in px, shape (2, markers), NaN where missing; the hole is dropped.

        Frames are to be given in their order: what moved before tells where to look.
        """
        predicted = self.grid + np.clip(2 * self.moved - self.before, -REACH, REACH)
        found, _ = assign(predicted, self.matches(image), self.gate)
        uv, _ = refine(image, self.view, found)
        seen = self.view.to_plane(uv) - self.grid
        self.before = self.moved
        self.moved = _filled(seen, self.grid[0], self.moved)
        return uv[:, : self.view.markers.count]

    def resampled(self, image: Image) -> Image:
        """The frame on the beam's plane, cropped (figure F.4)."""
        return np.asarray(cv2.remap(image, *self.maps, cv2.INTER_LINEAR), np.uint8)

    def matches(self, image: Image) -> Array:
        """Places (2, n) of the plane in m where a disc matches best (figure F.6)."""
        score = cv2.matchTemplate(self.resampled(image), self.template, cv2.TM_CCOEFF_NORMED)
        highest = cv2.dilate(score, np.ones((7, 7), np.uint8))
        rows, columns = np.nonzero((score == highest) & (score > LEAST_SCORE))
        half = (len(self.template) - 1) / 2
        return np.stack([columns + half, rows + half]) / SCALE + self.origin[:, None]


def _filled(seen: Array, x: Array, last: Array) -> Array:
    """Displacements on the plane, with a smooth curve along the beam where a marker is missing."""
    known = np.isfinite(seen[0])
    if np.count_nonzero(known) < 8:
        return last
    curves = [np.polynomial.Polynomial.fit(x[known], part[known], 4)(x) for part in seen]
    return np.where(known, seen, np.stack(curves))


def _disc(diameter: float) -> Image:
    """A dark disc on white, for matching."""
    half = int(np.ceil(diameter / 2)) + 2
    x = np.arange(-half, half + 1)
    covered = np.clip(diameter / 2 - np.hypot(x, x[:, None]) + 0.5, 0, 1)
    return np.asarray(np.rint(200 - 170 * covered), np.uint8)


def assign(predicted: Array, found: Array, gate: float) -> tuple[Array, int]:
    """Give each predicted place (2, n) at most one of the found ones, nearest in the sum.

    The Hungarian method on squared distances; pairs farther apart than `gate` are not made, so a
    hidden marker takes no neighbour's place.

    Returns
    -------
    places : ndarray, shape (2, n)
        NaN where nothing was found.
    spare : int
        Found places that are no marker's.
    """
    places = np.full_like(predicted, np.nan)
    if found.shape[1] == 0:
        return places, 0
    squared = np.sum((predicted[:, :, None] - found[:, None]) ** 2, axis=0)
    squared = np.minimum(squared, gate**2)  # all that is too far costs the same
    rows, columns = linear_sum_assignment(squared)
    near = squared[rows, columns] < gate**2
    places[:, rows[near]] = found[:, columns[near]]
    return places, found.shape[1] - int(np.count_nonzero(near))


# Sub-pixel centres.


def refine(image: Image, view: View, plane: Array, steps: int = 4) -> tuple[Array, float]:
    """Centres in px by a least-squares fit of blurred discs on a white beam to the frame.

    The model of the grey levels around a marker is g + (b − g) W − c D: W is 1 on the beam and D
    on the marker, both blurred by a Gaussian and by the pixel's own area. Fitted are the centre, b,
    c and, where the beam's edge is near, its place to within what a moving beam's nearness does to
    it; the background's g is measured.

    Parameters
    ----------
    image : ndarray of uint8, shape (height, width)
        The frame.
    view : View
        How the camera sees the beam's plane.
    plane : ndarray, shape (2, n)
        First guess on the plane in m, of all markers in their order; NaN is left out.
    steps : int
        Gauss–Newton steps.

    Returns
    -------
    centres : ndarray, shape (2, n)
        In px; NaN where the guess was NaN, a marker is cut off by the frame's border, or the fit
        is poor.
    misfit : float
        Median over the markers of the rms residual over the contrast; NaN without markers.
    """
    uv = np.full_like(plane, np.nan)
    known = np.flatnonzero(np.isfinite(plane[0]))
    if len(known) == 0:
        return uv, np.nan
    markers, blur = view.markers, view.blur
    start = view.to_image(plane[:, known])
    ellipses = markers.diameter / 2 * np.moveaxis(view.stretch(plane[:, known]), 2, 0)
    reach = np.linalg.norm(ellipses, axis=2).max(axis=0)
    half_u, half_v = np.ceil(reach + 3 * blur + 1).astype(int)
    (u0, v0), (width, height) = np.floor(start).astype(int), view.camera.size
    inside = (u0 >= half_u) & (u0 < width - half_u) & (v0 >= half_v) & (v0 < height - half_v)
    if not np.any(inside):
        return uv, np.nan
    known, start, ellipses = known[inside], start[:, inside], ellipses[inside]
    u = u0[inside, None] + np.arange(-half_u, half_u + 1)
    v = v0[inside, None] + np.arange(-half_v, half_v + 1)
    grey = image[v[:, :, None], u[:, None, :]].astype(float)
    u, v = u + HALF, v + HALF

    patch = _Patch(view, known, plane[:, known], ellipses)
    usable = patch.usable(u - start[0, :, None], v - start[1, :, None])
    background = patch.background(grey, u - start[0, :, None], v - start[1, :, None])
    centre, outer = start.copy(), np.zeros(len(known))
    bright = np.quantile(np.where(usable, grey, 0), 0.9, axis=(1, 2))
    contrast = bright - np.min(np.where(usable, grey, 255), axis=(1, 2))
    for _ in range(steps):
        du, dv = u - centre[0, :, None], v - centre[1, :, None]
        dark, *dark_by = _blurred_ellipses(du, dv, ellipses, blur)
        white, outward = patch.beam(u - start[0, :, None], v - start[1, :, None], outer)
        b, c = bright[:, None, None], contrast[:, None, None]
        residual = (grey - background - (b - background) * white + c * dark) * usable
        columns = [-c * part for part in dark_by] + [white, -dark, (b - background) * outward]
        J = (np.stack(columns) * usable).reshape(5, len(known), -1).transpose(1, 0, 2)
        matrix = J @ J.transpose(0, 2, 1)
        matrix += 1e-6 * np.trace(matrix, axis1=1, axis2=2)[:, None, None] * np.eye(5) + 1e-9
        matrix[:, 4, 4] += NOISE**2 / EDGE**2
        right = J @ residual.reshape(len(known), -1, 1)
        right[:, 4, 0] -= NOISE**2 / EDGE**2 * outer
        change = np.linalg.solve(matrix, right)[:, :, 0].T
        centre += np.clip(change[:2], -0.5, 0.5)
        bright, contrast = bright + change[2], np.maximum(contrast + change[3], 1.0)
        outer = outer + np.clip(change[4], -3 * EDGE, 3 * EDGE)
    count = np.maximum(np.count_nonzero(usable, axis=(1, 2)) - 4, 1)
    rms = np.sqrt(np.sum(residual**2, axis=(1, 2)) / count)
    strayed = np.linalg.solve(ellipses, (centre - start).T[:, :, None])[:, :, 0]
    good = (
        (contrast > 0.4 * np.median(contrast))
        & (rms < POOR * contrast)
        & (np.abs(change[:2]).max(axis=0) < 0.05)
        & (np.linalg.norm(strayed, axis=1) < 1)
    )
    uv[:, known[good]] = centre[:, good]
    return uv, float(np.median(rms / contrast))


class _Patch:
    """The beam around some markers, with straight edges along it; its ends are left out."""

    def __init__(self, view: View, which: NDArray[np.int64], plane: Array, ellipses: Array) -> None:
        markers, self.blur = view.markers, view.blur
        x, y = markers.positions[:, which]
        length, width = markers.beam.extent
        radius = markers.diameter / 2
        gradient = radius * np.linalg.inv(ellipses)  # of the plane's x and y, m per px
        steep = np.linalg.norm(gradient, axis=2).T
        self.normals = (gradient / steep.T[:, :, None]).transpose(1, 2, 0)[..., None, None]
        here, across = view.to_image(plane), self.normals[1, ..., 0, 0]
        # Distance in px from the marker to the edges y = 0 and y = W, exact in the middle.
        self.edges = [
            np.abs(np.sum(across * (view.to_image(plane + [0 * y, edge - y]) - here), axis=0))
            for edge in (0, width)
        ]
        self.ends = [x / steep[0], (length - x) / steep[0]]
        self.row, self.radius = markers.row_spacing / steep[1], radius / steep[1]

    def _offset(self, axis: int, du: Array, dv: Array) -> Array:
        """Distance in px from the marker across the rows or the columns, (n, rows, columns)."""
        nu, nv = self.normals[axis]
        return np.asarray(nu * du[:, None, :] + nv * dv[:, :, None])

    def usable(self, du: Array, dv: Array) -> NDArray[np.bool_]:
        """Pixels that see no other row of markers, nor much of what is beyond the beam."""
        along, across = (self._offset(axis, du, dv) for axis in (0, 1))
        left, right, low, high = (part[:, None, None] for part in (*self.ends, *self.edges))
        spare, clear = 1 + self.blur, 1 + 2.5 * self.blur
        free = np.maximum(self.row - self.radius - 2 * self.blur - 0.5, 0.5 * self.row)
        inside: NDArray[np.bool_] = (
            (along > clear - left) & (along < right - clear)
            & (across > -low - spare) & (across < high + spare)
            & (np.abs(across) < free[:, None, None])
        )  # fmt: skip
        return inside

    def background(self, grey: Array, du: Array, dv: Array) -> float:
        """Grey level beside the beam: the median of the pixels that see nothing of it."""
        across, clear = self._offset(1, du, dv), 1 + 2.5 * self.blur
        low, high = (part[:, None, None] for part in self.edges)
        beside = grey[(across < -low - clear) | (across > high + clear)]
        return float(np.median(beside)) if beside.size >= 20 else float(np.min(grey))

    def beam(self, du: Array, dv: Array, outer: Array) -> tuple[Array, Array]:
        """Share of the beam in each pixel, with edges moved outward, and its derivative in that."""
        n, rows, columns = len(du), dv.shape[1], du.shape[1]
        share, slope = np.ones((n, rows, columns)), np.zeros((n, rows, columns))
        across, half = self._offset(1, du, dv), HALF / self.blur
        for edge, sign in zip(self.edges, (1, -1), strict=True):
            near = edge < np.abs(across).max(axis=(1, 2)) + 1 + 3 * self.blur
            z = ((edge + outer)[near, None, None] + sign * across[near]) / self.blur
            share[near] = self.blur * (_ramp(z + half) - _ramp(z - half))
            slope[near] = ndtr(z + half) - ndtr(z - half)
        return share, slope


def _blurred_ellipses(u: Array, v: Array, ellipses: Array, blur: float) -> Array:
    """Blurred indicators of ellipses and their derivatives in the centre.

    An ellipse is cut into chords along u. Blurred along u a chord is a difference of two normal
    distributions, and its spread along v a normal density. Both are integrated over the pixel;
    what it sees is their product, summed over the chords by Gauss–Legendre's rule.

    Parameters
    ----------
    u, v : ndarray, shapes (n, columns) and (n, rows)
        Pixel centres from the ellipses' centres in px.
    ellipses : ndarray, shape (n, 2, 2)
        Each is what its matrix makes of the unit disc, in px.
    blur : float
        Standard deviation in px.

    Returns
    -------
    ndarray, shape (3, n, rows, columns)
        Indicator, and its derivatives in the centre's u and v in 1/px.
    """
    tall = np.linalg.norm(ellipses[:, 1], axis=1)
    nodes, weights = np.polynomial.legendre.leggauss(int(3 * tall.max() / blur) + 6)
    sine, cosine = np.sin(nodes * np.pi / 2), np.cos(nodes * np.pi / 2)
    across = ellipses[:, 1] / tall[:, None]
    lean = np.sum(ellipses[:, 0] * across, axis=1)[:, None] * sine
    wide = np.abs(np.linalg.det(ellipses) / tall)[:, None] * cosine
    left, right = (
        (u[:, None, :] - (lean + side * wide)[:, :, None]) / blur for side in (-1, 1)
    )  # (n, chords, columns)
    half = HALF / blur
    along = _ramp(left + half) - _ramp(left - half) - _ramp(right + half) + _ramp(right - half)
    d_along = ndtr(right + half) - ndtr(right - half) - ndtr(left + half) + ndtr(left - half)
    offset = (v[:, :, None] - tall[:, None, None] * sine) / blur  # (n, rows, chords)
    spread = ndtr(offset + half) - ndtr(offset - half)
    d_spread = (_bell(offset - half) - _bell(offset + half)) / blur
    chord = tall[:, None, None] * weights * cosine * np.pi / 2
    along, spread, d_spread = blur * along, chord * spread, chord * d_spread
    return np.stack([spread @ along, spread @ d_along, d_spread @ along])


def _bell(x: Array) -> Array:
    """The normal density."""
    return np.exp(-0.5 * x**2) / np.sqrt(2 * np.pi)


def _ramp(x: Array) -> Array:
    """The integral of the normal distribution."""
    return x * ndtr(x) + _bell(x)


def tracks(frames: Iterable[Image], tracker: Tracker) -> Iterator[Array]:
    """Centres (2, markers) of each frame, one after the other."""
    for image in frames:
        yield tracker.centres(image)
