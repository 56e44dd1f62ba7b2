"""From frames to marker centres (thesis 5.1.2, Appendix F).

The four corners of the beam give a homography to its plane. The frame is resampled on that plane,
without lens distortion and cropped to the beam; a disc is matched to it; the matches are assigned
to the grid that the frames before predict, the hole included, which keeps it from being taken for
a marker. Each match is then refined in the frame itself, where no resampling has touched it, by a
least-squares fit of a blurred ellipse whose shape the homography tells. What is hidden, cut off
or doubtful comes back as NaN.
"""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
from scipy.interpolate import RBFInterpolator
from scipy.optimize import linear_sum_assignment, minimize_scalar

from thesis_lib.arrays import Array, Image
from thesis_lib.measure.recordings.board import Markers
from thesis_lib.measure.tracking.centres import refine_centres
from thesis_lib.measure.tracking.homography import TrackingError, View, fit_homography
from thesis_lib.vision.lens import HALF_PIXEL, undistort_pixels

PIXELS_PER_MARKER = 10  # of the resampled beam in a marker's diameter
# Diameters that it is searched beyond the beam: more than a row moves on its plane
SEARCH_DIAMETERS = 5
# What that gives for the thesis's markers
THESIS_SCALE_PX_PER_M, THESIS_REACH_M = 2000.0, 0.025
MAX_RESAMPLED_PIXELS = 2e7  # pixels of the resampled beam
MAX_GRID_RMS_PX = 1.5  # px from the grid, rms, from which the markers are taken for others
BLUR_RANGE_PX = (0.15, 1.5)  # px
LEAST_SCORE = 0.45  # of the correlation with a disc, for a match to be considered


def sharpen_view(image: Image, view: View) -> View:
    """Return the view with the homography of all markers at rest, and the blur that fits them best.

    Raises
    ------
    TrackingError
        If fewer than half of the markers are found, or they do not fit their grid.
    """
    grid, name, first = view.markers.positions, view.camera.name, view
    for _ in range(2):
        found, _ = assign_places(grid, Tracker(view).matches(image), gate_of(view.markers))
        view = replace(view, blur=_fit_blur(image, view, found))
        centres, _ = refine_centres(image, view, found)
        count = np.count_nonzero(np.isfinite(centres[0]))
        if count < max(4, grid.shape[1] / 2):
            raise TrackingError(
                f"camera {name}: only {count} of {grid.shape[1]} markers are found in the first "
                "frame"
            )
        try:
            H = fit_homography(grid, undistort_pixels(view.camera, centres))
        except TrackingError as error:
            raise TrackingError(f"camera {name}: the markers found: {error}") from None
        view = replace(view, H_image_plane=H)
    rows = [centres[0, row] for row in view.markers.rows]
    off = _rms_length(centres - view.to_image(grid))
    corners = view.markers.corners
    moved = _rms_length(view.to_image(corners) - first.to_image(corners))
    between = float(np.median(view.markers.nearest * view.finest(grid)))
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


def _rms_length(off: Array) -> float:
    """Return the root mean square length of vectors (2, n), NaN left out."""
    return float(np.sqrt(np.nanmean(np.sum(off**2, axis=0))))


def _fit_blur(image: Image, view: View, found: Array) -> float:
    """Return the blur in px that fits best; the one the view has if nothing fits."""

    def misfit(blur: float) -> float:
        value = refine_centres(image, replace(view, blur=blur), found)[1]
        return value if np.isfinite(value) else 1e3

    if misfit(view.blur) == 1e3:
        return view.blur
    return float(
        minimize_scalar(misfit, bounds=BLUR_RANGE_PX, method="bounded", options={"xatol": 0.01}).x
    )


def gate_of(markers: Markers) -> float:
    """Return the largest distance of a match from where a marker is expected, m."""
    return 0.45 * float(markers.nearest.min())


class Tracker:
    """Tracks the markers of one camera, frame after frame.

    Parameters
    ----------
    view : View
        How the camera sees the beam's plane.
    turn : float
        Angle ωΔt of the vibration from frame to frame in rad; 0 if it is not known.

    Attributes
    ----------
    scale : float
        Pixels per metre of the resampled beam.
    reach : float
        How far beyond the beam it is resampled, m.
    matched : ndarray, shape (2, markers)
        Centres in px by template matching alone, to whole pixels of the resampled frame, for the
        last frame given to :meth:`centres`; NaN where missing.

    Raises
    ------
    TrackingError
        If the resampled beam would be too large.
    """

    def __init__(self, view: View, turn: float = 0.0) -> None:
        self.view, self.turn = view, turn
        markers = view.markers
        self.scale, self.reach = (
            PIXELS_PER_MARKER / markers.diameter,
            SEARCH_DIAMETERS * markers.diameter,
        )
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
        self.template = _draw_disc(PIXELS_PER_MARKER)
        self.grid = markers.positions
        self.gate = gate_of(markers)
        self.moved = np.zeros_like(self.grid)
        self.before = np.zeros_like(self.grid)
        self.matched = np.full((2, markers.count), np.nan)

    def centres(self, image: Image) -> Array:
        """Return the markers' centres in px, (2, markers), without the hole; NaN where missing.

        Frames are to be given in their order: what moved before tells where to look.
        """
        found = self._assign_matches(self.matches(image))
        self.matched = self.view.to_image(found[:, : self.view.markers.count])
        uv, _ = refine_centres(image, self.view, found)
        seen = self.view.to_plane(uv) - self.grid
        self.before = self.moved
        self.moved = fill_missing(seen, self.grid, self.moved)
        return uv[:, : self.view.markers.count]

    def _assign_matches(self, matches: Array) -> Array:
        """Assign a match to each marker, by the predictions that miss fewest."""
        # Harmonic motion has x(t + Δt) = 2 cos(ωΔt) x(t) − x(t − Δt); turn 0 goes straight on.
        ahead = [2 * np.cos(self.turn) * self.moved - self.before]
        if self.turn == 0:  # it may be anything: what was taken for its neighbour must not stay so
            ahead += [np.zeros_like(self.moved), self.moved]
        found: list[Array] = []
        for one in ahead:
            predicted = self.grid + np.clip(one, -self.reach, self.reach)
            found.append(assign_places(predicted, matches, self.gate)[0])
            if np.isfinite(found[-1]).all():
                break
        return min(found, key=lambda places: np.count_nonzero(np.isnan(places)))

    def resampled(self, image: Image) -> Image:
        """Return the frame on the beam's plane, cropped (figure F.4)."""
        return np.asarray(cv2.remap(image, *self.maps, cv2.INTER_LINEAR), np.uint8)

    def matches(self, image: Image) -> Array:
        """Return places (2, n) of the plane in m where a disc matches best (figure F.6)."""
        score = cv2.matchTemplate(self.resampled(image), self.template, cv2.TM_CCOEFF_NORMED)
        highest = cv2.dilate(score, np.ones((7, 7), np.uint8))
        rows, columns = np.nonzero((score == highest) & (score > LEAST_SCORE))
        half = (len(self.template) - 1) / 2
        return np.stack([columns + half, rows + half]) / self.scale + self.origin[:, None]


def fill_missing(seen: Array, grid: Array, last: Array) -> Array:
    """Fill in displacements of missing markers from a smooth surface through the others.

    Thin-plate splines through the nearest markers; as they were in the frame before, if few are
    seen or those on a line.
    """
    known = np.isfinite(seen[0])
    if known.all():
        return seen
    if np.count_nonzero(known) < 8:
        return last
    try:
        smooth = RBFInterpolator(grid[:, known].T, seen[:, known].T, neighbors=12, smoothing=1e-9)
        surface = smooth(grid[:, ~known].T).T
    except np.linalg.LinAlgError:
        return last
    filled = seen.copy()
    filled[:, ~known] = surface
    return filled


def _draw_disc(diameter: float) -> Image:
    """Draw a dark disc on white, for matching."""
    half = int(np.ceil(diameter / 2)) + 2
    x = np.arange(-half, half + 1)
    covered = np.clip(diameter / 2 - np.hypot(x, x[:, None]) + 0.5, 0, 1)
    return np.asarray(np.rint(200 - 170 * covered), np.uint8)


def assign_places(predicted: Array, found: Array, gate: float) -> tuple[Array, int]:
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
