"""Detection of marker centres in frames (thesis 5.1.2, Appendix F).

The four corners of the beam determine the homography to its plane. The frame is resampled on that
plane, without lens distortion and cropped to the beam, and matched with a disc. The matches are
assigned to the grid predicted from earlier frames; it includes the hole, which is therefore not
taken for a marker. Each match is refined in the original frame, without resampling, by a
least-squares fit of a blurred ellipse whose shape follows from the homography. Markers that are
hidden, cut off or doubtful are NaN.
"""

import contextlib
from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import scipy

from thesis_lib.arrays import Array, Image, IntArray, Mask
from thesis_lib.measure.recordings.board import Markers
from thesis_lib.measure.tracking.homography import TrackingError, View, fit_homography
from thesis_lib.vision.pinhole import HALF_PIXEL, undistort_pixels

PIXELS_PER_MARKER = 10  # pixels of the resampled beam in a marker's diameter
# Search margin around the beam in marker diameters: more than a row moves on the beam's plane
SEARCH_DIAMETERS = 5
# Resulting scale and margin for the thesis's markers
THESIS_SCALE_PX_PER_M, THESIS_REACH_M = 2000.0, 0.025
MAX_RESAMPLED_PIXELS = 2e7
MAX_GRID_RMS_PX = 1.5  # rms distance from the grid above which the detected markers are wrong
BLUR_RANGE_PX = (0.15, 1.5)
MIN_SCORE = 0.45  # least correlation coefficient of a match with a disc
# Rms residual over contrast from which a fit is doubtful. Printed dots in a real camera have up to
# 0.16; an unsharp mask of amount 2 lifts up to a tenth of them above 0.15, one of amount 4 a third.
# A limit of 0.25 accepted those, but also discs tilted out of their plane and 0.13 px off.
MAX_RESIDUAL_RATIO = 0.15
EDGE_STD_PX = 0.05  # prior standard deviation of the beam's edge from its expected position
NOISE_GREY = 3.0  # image noise, grey levels, that weighs this prior against the pixels
GAUSS_NEWTON_STEPS = 4
cached_rule = cache(np.polynomial.legendre.leggauss)


def sharpen_view(image: Image, view: View, corrections: int = 0) -> View:
    """Fit the homography of a view to all markers at rest, and its blur.

    A :class:`TrackingError` is raised if fewer than half are found, or do not fit their grid. Few
    are found where the view misplaces edges; so many `corrections` then use matches in their place.
    """
    grid, name, first = view.markers.positions, view.camera.name, view
    fits = 0
    while fits < 2:
        found = assign_places(grid, Tracker(view).matches(image), assignment_gate(view.markers))
        view = replace(view, blur=_fit_blur(image, view, found))
        centres, _ = refine_centres(image, view, found)
        count, matched = (np.count_nonzero(np.isfinite(part[0])) for part in (centres, found))
        if count >= max(4, grid.shape[1] / 2):
            fits += 1
        elif corrections and matched >= 4:
            corrections, centres = corrections - 1, view.to_image(found)
        else:
            raise TrackingError(
                f"camera {name}: only {count} of {grid.shape[1]} markers are found in the first "
                "frame"
            )
        H = fit_homography(grid, undistort_pixels(view.camera, centres))
        view = replace(view, H_image_plane=H)
    rows = [centres[0, row] for row in view.markers.rows]
    corners = view.markers.corners
    off, moved = (
        float(np.sqrt(np.nanmean(np.sum(apart**2, axis=0))))
        for apart in (
            centres - view.to_image(grid),
            view.to_image(corners) - first.to_image(corners),
        )
    )
    finest = np.linalg.svd(np.moveaxis(view.stretch(grid), 2, 0))[1][:, 1]  # px/m, foreshortened
    between = float(np.median(view.markers.nearest * finest))
    wrong = ""
    if any(len(row) > 2 and np.isnan(row).all() for row in rows):
        wrong = "no marker is found in one of the rows"
    elif off > max(MAX_GRID_RMS_PX, 0.1 * between):
        wrong = f"the markers found are {off:.1f} px off their grid"
    elif moved > max(2 * MAX_GRID_RMS_PX, 0.4 * between):
        wrong = f"the markers found put the beam's corners {moved:.1f} px from where they are"
    if wrong:
        raise TrackingError(
            f"camera {name}: {wrong}; do rows, columns and spacing agree with the manifest?"
        )
    return view


def _fit_blur(image: Image, view: View, found: Array) -> float:
    """Fit the blur in px; return that of the view if no marker can be fitted."""

    def misfit(blur: float) -> float:
        value = refine_centres(image, replace(view, blur=blur), found)[1]
        return value if np.isfinite(value) else 1e3

    if misfit(view.blur) == 1e3:
        return view.blur
    best = scipy.optimize.minimize_scalar(misfit, bounds=BLUR_RANGE_PX, options={"xatol": 0.01})
    return float(best.x)


def assignment_gate(markers: Markers) -> float:
    """Return the largest distance of a match from a marker's expected place, m."""
    return 0.45 * float(markers.nearest.min())


class Tracker:
    """Tracks the markers of one camera, frame by frame.

    Parameters
    ----------
    view : View
        Projection of the beam's plane into the camera.
    turn : float
        Phase advance ωΔt of the vibration per frame in rad; 0 if unknown.

    Attributes
    ----------
    matched : ndarray, shape (2, markers)
        Centres in px by template matching alone, to whole pixels of the resampled frame, in the
        last frame given to :meth:`centres`; NaN where missing.

    Raises
    ------
    TrackingError
        If the resampled beam would be too large.
    """

    def __init__(self, view: View, turn: float = 0.0) -> None:
        self.view, self.turn = view, turn
        markers = view.markers
        self.scale = PIXELS_PER_MARKER / markers.diameter  # px/m of the resampled beam
        self.reach = SEARCH_DIAMETERS * markers.diameter  # search margin around the beam, m
        self.origin = np.full(2, -self.reach) + 0.5 / self.scale
        nx, ny = (int(self.scale * (size + 2 * self.reach)) for size in markers.extent)
        if nx * ny > MAX_RESAMPLED_PIXELS:
            raise TrackingError(
                f"camera {view.camera.name}: the beam is {nx} x {ny} pixels at {PIXELS_PER_MARKER} "
                f"to a marker's diameter, at most {MAX_RESAMPLED_PIXELS:.0e} are handled; are the "
                "diameter and the beam's size right?"
            )
        grid = np.stack(np.meshgrid(np.arange(nx), np.arange(ny))) / self.scale
        u, v = view.to_image(grid + self.origin[:, None, None]).astype(np.float32)
        self.maps = u - np.float32(HALF_PIXEL), v - np.float32(HALF_PIXEL)
        half = int(np.ceil(PIXELS_PER_MARKER / 2)) + 2
        x = np.arange(-half, half + 1)
        covered = np.clip(PIXELS_PER_MARKER / 2 - np.hypot(x, x[:, None]) + 0.5, 0, 1)
        self.template = np.rint(200 - 170 * covered).astype(np.uint8)  # a dark disc on white
        self.grid = markers.positions
        self.gate = assignment_gate(markers)
        self.moved = np.zeros_like(self.grid)
        self.before = np.zeros_like(self.grid)
        self.matched = np.full((2, markers.count), np.nan)

    def centres(self, image: Image) -> Array:
        """Return the markers' centres in px, (2, markers), without the hole; NaN where missing.

        Frames must be given in order: earlier displacements predict the positions.
        """
        found = self._assign_matches(self.matches(image))
        self.matched = self.view.to_image(found[:, : self.view.markers.count])
        uv, _ = refine_centres(image, self.view, found)
        seen = self.view.to_plane(uv) - self.grid
        self.before = self.moved
        self.moved = fill_missing(seen, self.grid, self.moved)
        return uv[:, : self.view.markers.count]

    def _assign_matches(self, matches: Array) -> Array:
        """Assign a match to each marker, using the prediction with the fewest missing markers."""
        # Harmonic motion has x(t + Δt) = 2 cos(ωΔt) x(t) − x(t − Δt); turn 0 is uniform motion.
        ahead = [2 * np.cos(self.turn) * self.moved - self.before]
        if self.turn == 0:  # unknown motion: recover markers that were confused with a neighbour
            ahead += [np.zeros_like(self.moved), self.moved]
        found: list[Array] = []
        for one in ahead:
            predicted = self.grid + np.clip(one, -self.reach, self.reach)
            found.append(assign_places(predicted, matches, self.gate))
            if np.isfinite(found[-1]).all():
                break
        return min(found, key=lambda places: np.count_nonzero(np.isnan(places)))

    def resampled(self, image: Image) -> Image:
        """Resample the frame on the beam's plane, cropped to beam and margin (figure F.4)."""
        return np.asarray(cv2.remap(image, *self.maps, cv2.INTER_LINEAR), np.uint8)

    def matches(self, image: Image) -> Array:
        """Return the places (2, n), m, on the plane that match a disc best locally (figure F.6)."""
        score = cv2.matchTemplate(self.resampled(image), self.template, cv2.TM_CCOEFF_NORMED)
        highest = cv2.dilate(score, np.ones((7, 7), np.uint8))
        rows, columns = np.nonzero((score == highest) & (score > MIN_SCORE))
        half = (len(self.template) - 1) / 2
        return np.stack([columns + half, rows + half]) / self.scale + self.origin[:, None]


def fill_missing(seen: Array, grid: Array, last: Array) -> Array:
    """Fill in displacements of missing markers from a smooth surface through the others.

    The surface is a thin-plate spline through the nearest markers. If few markers are visible, or
    if they are collinear, missing markers keep their displacement `last`.
    """
    known = np.isfinite(seen[0])
    filled = np.where(known, seen, last)
    if known.all() or np.count_nonzero(known) < 8:
        return filled
    with contextlib.suppress(np.linalg.LinAlgError):
        smooth = scipy.interpolate.RBFInterpolator(
            grid[:, known].T, seen[:, known].T, neighbors=12, smoothing=1e-9
        )
        filled[:, ~known] = smooth(grid[:, ~known].T).T
    return filled


def assign_places(predicted: Array, found: Array, gate: float) -> Array:
    """Assign found places to predicted places (2, n), with the least sum of squared distances.

    The Hungarian method makes no pairs farther apart than `gate`, so a hidden marker does not get
    its neighbour's place. Places (2, n) are NaN where nothing was found.
    """
    places = np.full_like(predicted, np.nan)
    squared = np.sum((predicted[:, :, None] - found[:, None]) ** 2, axis=0)
    squared = np.minimum(squared, gate**2)  # equal cost for all pairs that are too far apart
    rows, columns = scipy.optimize.linear_sum_assignment(squared)
    near = squared[rows, columns] < gate**2
    places[:, rows[near]] = found[:, columns[near]]
    return places


def refine_centres(image: Image, view: View, plane: Array) -> tuple[Array, float]:
    """Fit blurred discs on a white beam to the frame by least squares; return centres, misfit.

    The model of the grey levels around a marker is g + (b − g) W − c D: W is 1 on the beam and D
    on the marker, both blurred by a Gaussian and by the pixel's own area. The unknowns are the
    centre, b, c and the position of a nearby edge of the beam, with a prior for its change as the
    moving beam's distance varies; g is the measured background.

    `plane` (2, n) is the initial guess on the plane in m for all markers in order. Centres (2, n)
    in px are NaN where the guess is NaN, where the frame's border cuts a marker off, and where the
    fit is poor. The misfit is the median over the markers of the rms residual over the contrast;
    NaN without markers.
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
    u, v = u + HALF_PIXEL, v + HALF_PIXEL

    patch = Patch(view, known, plane[:, known], ellipses)
    from_start = u - start[0, :, None], v - start[1, :, None]
    usable = patch.usable(*from_start)
    background = patch.background(grey, *from_start)
    centre, outer = start.copy(), np.zeros(len(known))
    bright = np.quantile(np.where(usable, grey, 0), 0.9, axis=(1, 2))
    contrast = bright - np.min(np.where(usable, grey, 255), axis=(1, 2))
    for _ in range(GAUSS_NEWTON_STEPS):
        du, dv = u - centre[0, :, None], v - centre[1, :, None]
        dark, *dark_by = blur_ellipses(du, dv, ellipses, blur)
        white, outward = patch.beam(*from_start, outer)
        b, c = bright[:, None, None], contrast[:, None, None]
        residual = (grey - background - (b - background) * white + c * dark) * usable
        columns = [-c * part for part in dark_by] + [white, -dark, (b - background) * outward]
        J = (np.stack(columns) * usable).reshape(5, len(known), -1).transpose(1, 0, 2)
        matrix = J @ J.transpose(0, 2, 1)
        trace = np.trace(matrix, axis1=1, axis2=2)[:, None, None]
        matrix += (1e-6 * trace + 1e-9) * np.eye(5)
        matrix[:, 4, 4] += NOISE_GREY**2 / EDGE_STD_PX**2
        right = J @ residual.reshape(len(known), -1, 1)
        right[:, 4, 0] -= NOISE_GREY**2 / EDGE_STD_PX**2 * outer
        change = np.linalg.solve(matrix, right)[:, :, 0].T
        centre += np.clip(change[:2], -0.5, 0.5)
        bright, contrast = bright + change[2], np.maximum(contrast + change[3], 1.0)
        outer = outer + np.clip(change[4], -3 * EDGE_STD_PX, 3 * EDGE_STD_PX)
    count = np.maximum(np.count_nonzero(usable, axis=(1, 2)) - 4, 1)
    rms = np.sqrt(np.sum(residual**2, axis=(1, 2)) / count)
    strayed = np.linalg.solve(ellipses, (centre - start).T[:, :, None])[:, :, 0]
    good = (
        (contrast > 0.4 * np.median(contrast))
        & (rms < MAX_RESIDUAL_RATIO * contrast)
        & (np.abs(change[:2]).max(axis=0) < 0.05)
        & (np.linalg.norm(strayed, axis=1) < 1)
    )
    uv[:, known[good]] = centre[:, good]
    return uv, float(np.median(rms / contrast))


class Patch:
    """The beam around some markers, with straight long edges; its ends are not modelled."""

    def __init__(self, view: View, which: IntArray, plane: Array, ellipses: Array) -> None:
        markers, self.blur = view.markers, view.blur
        x, y = markers.positions[:, which]
        length, width = markers.extent
        radius = markers.diameter / 2
        gradient = radius * np.linalg.inv(ellipses)  # of the plane's x and y in the image, m per px
        steep = np.linalg.norm(gradient, axis=2).T
        self.normals = (gradient / steep.T[:, :, None]).transpose(1, 2, 0)[..., None, None]
        here, across = view.to_image(plane), self.normals[1, ..., 0, 0]
        # Distance in px from the marker to the edges y = 0 and y = W, exact in the middle.
        self.edges = [
            np.abs(np.sum(across * (view.to_image(plane + [0 * y, edge - y]) - here), axis=0))
            for edge in (0, width)
        ]
        self.ends = [x / steep[0], (length - x) / steep[0]]
        # Distance in px, along and across, up to which a pixel shows no other marker.
        other, own = markers.clear[:, which] / steep, radius / steep
        self.free = np.maximum(other - own - 2 * self.blur - 0.5, 0.5 * other)[..., None, None]

    def _offset(self, axis: int, du: Array, dv: Array) -> Array:
        """Return the distance from the marker along x (0) or y (1), px, (n, rows, columns)."""
        nu, nv = self.normals[axis]
        return np.asarray(nu * du[:, None, :] + nv * dv[:, :, None])

    def usable(self, du: Array, dv: Array) -> Mask:
        """Return the mask of pixels that show no other marker and little beyond the structure."""
        along, across = (self._offset(axis, du, dv) for axis in (0, 1))
        left, right, low, high = (part[:, None, None] for part in (*self.ends, *self.edges))
        spare, clear = 1 + self.blur, 1 + 2.5 * self.blur
        inside: Mask = (
            (along > clear - left)
            & (along < right - clear)
            & (across > -low - spare)
            & (across < high + spare)
            & (np.abs(along) < self.free[0])
            & (np.abs(across) < self.free[1])
        )
        return inside

    def background(self, grey: Array, du: Array, dv: Array) -> float:
        """Return the grey level next to the beam: the median of the pixels entirely outside it."""
        across, clear = self._offset(1, du, dv), 1 + 2.5 * self.blur
        low, high = (part[:, None, None] for part in self.edges)
        beside = grey[(across < -low - clear) | (across > high + clear)]
        return float(np.median(beside)) if beside.size >= 20 else float(np.min(grey))

    def beam(self, du: Array, dv: Array, outer: Array) -> tuple[Array, Array]:
        """Return the beam's share of each pixel, edges moved `outer` px outward, and its slope."""
        n, rows, columns = len(du), dv.shape[1], du.shape[1]
        share, slope = np.ones((n, rows, columns)), np.zeros((n, rows, columns))
        across, half = self._offset(1, du, dv), HALF_PIXEL / self.blur
        for edge, sign in zip(self.edges, (1, -1), strict=True):
            near = edge < np.abs(across).max(axis=(1, 2)) + 1 + 3 * self.blur
            z = ((edge + outer)[near, None, None] + sign * across[near]) / self.blur
            ramp, rise = _ramp_and_normal(z + half) - _ramp_and_normal(z - half)
            seen = self.blur * ramp
            slope[near] = slope[near] * seen + share[near] * rise  # of a strip, both edges count
            share[near] *= seen
        return share, slope


def blur_ellipses(u: Array, v: Array, ellipses: Array, blur: float) -> Array:
    """Return blurred indicator functions of ellipses and their derivatives w.r.t. the centre.

    An ellipse is cut into chords along u. A chord blurred along u is a difference of two normal
    distributions, and blurred along v a normal density. Both are integrated over the pixel; the
    sum of their products over the chords (Gauss–Legendre quadrature) is the pixel's value.

    Pixel centres u (n, columns) and v (n, rows) are relative to the ellipses' centres, in px like
    the standard deviation `blur`; each matrix of `ellipses` (n, 2, 2) maps the unit disc to one.
    The result (3, n, rows, columns) is the indicator and its derivatives w.r.t. u and v in 1/px.
    """
    tall = np.linalg.norm(ellipses[:, 1], axis=1)
    nodes, weights = cached_rule(int(3 * tall.max() / blur) + 6)
    sine, cosine = np.sin(nodes * np.pi / 2), np.cos(nodes * np.pi / 2)
    across = ellipses[:, 1] / tall[:, None]
    lean = np.sum(ellipses[:, 0] * across, axis=1)[:, None] * sine
    wide = np.abs(np.linalg.det(ellipses) / tall)[:, None] * cosine
    # Neighbouring pixels share a border, so the integrals are evaluated at borders one px apart.
    columns, rows = (np.hstack([x - HALF_PIXEL, x[:, -1:] + HALF_PIXEL]) for x in (u, v))
    ends = (
        (columns[:, None, :] - (lean + side * wide)[:, :, None]) / blur for side in (-1, 1)
    )  # (n, chords, columns + 1)
    left, right = (_ramp_and_normal(x) for x in ends)
    along, d_along = np.diff(left - right)
    # (n, rows + 1, chords)
    offset = (rows[:, :, None] - tall[:, None, None] * sine) / blur
    spread = np.diff(scipy.special.ndtr(offset), axis=1)
    d_spread = -np.diff(_normal_density(offset), axis=1) / blur
    chord = tall[:, None, None] * weights * cosine * np.pi / 2
    along, spread, d_spread = blur * along, chord * spread, chord * d_spread
    return np.stack([spread @ along, -spread @ d_along, d_spread @ along])


def _normal_density(x: Array) -> Array:
    return np.exp(-0.5 * x**2) / np.sqrt(2 * np.pi)


def _ramp_and_normal(x: Array) -> Array:
    """Return the integral of the normal distribution, and the distribution, shape (2, ...)."""
    normal = scipy.special.ndtr(x)
    return np.stack([x * normal + _normal_density(x), normal])
