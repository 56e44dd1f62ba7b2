"""Sub-pixel centres: blurred discs on a white beam, fitted to the grey levels of a frame.

All markers of a frame are fitted at once. What is blurred and seen by a pixel is read from tables
(:mod:`~thesis_lib.measure.tracking.profiles`), pixels are single precision, and what they sum to
is solved in double.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from thesis_lib.arrays import Array, Image, IntArray, Mask
from thesis_lib.measure.tracking.homography import View
from thesis_lib.measure.tracking.profiles import Pixels, Profiles, profiles
from thesis_lib.vision.lens import HALF

POOR = 0.15  # rms residual over contrast from which a fit is doubtful
EDGE = 0.05  # px by which the beam's edge may be off its place
NOISE = 3.0  # grey levels against which that is weighed
DONE = 1e-3  # px: a step that is shorter is the last, as each is some 50 times as long as the next
DU, DV, DISC, WHITE, OUTWARD, LEFT = range(6)  # what a pixel sees, and the grey level left over


def refine(
    image: Image, view: View, plane: Array, steps: int = 4, done: float = DONE
) -> tuple[Array, float]:
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
        Gauss–Newton steps at most.
    done : float
        Centres that move by less than this, in px, are the last step's.

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
    start = view.to_image(plane[:, known])
    ellipses = view.markers.diameter / 2 * np.moveaxis(view.stretch(plane[:, known]), 2, 0)
    reach = np.linalg.norm(ellipses, axis=2).max(axis=0)
    half_u, half_v = np.ceil(reach + 3 * view.blur + 1).astype(int)
    (u0, v0), (width, height) = np.floor(start).astype(int), view.camera.size
    inside = (u0 >= half_u) & (u0 < width - half_u) & (v0 >= half_v) & (v0 < height - half_v)
    if not np.any(inside):
        return uv, np.nan
    known, start, ellipses = known[inside], start[:, inside], ellipses[inside]
    corner = np.stack([u0[inside] - half_u, v0[inside] - half_v])
    size = 2 * half_v + 1, 2 * half_u + 1
    grey = sliding_window_view(image, size)[corner[1], corner[0]]
    first = corner + HALF - start  # of a window's pixels, seen from the marker
    patch = _Patch(view, known, plane[:, known], ellipses)
    patch.look(grey, first)

    tables = profiles(view.blur, size)
    disc = _Discs(tables, ellipses)
    n, usable = len(known), patch.usable
    seen = np.empty((n, 6, *size), np.float32)
    rows = seen.reshape(n, 6, -1)
    above = (grey - np.float32(patch.background)) * usable  # what the model explains
    bright, darkest = _levels(grey, usable)
    moved, outer = np.zeros((2, n)), np.zeros(n)
    white, contrast = bright - patch.background, bright - darkest
    for _ in range(steps):
        disc.see(moved - first, seen)
        patch.see(tables, outer, seen)
        seen[:, :LEFT] *= usable[:, None]
        b, c = (x.astype(np.float32)[:, None, None] for x in (white, contrast))
        np.subtract(above + c * seen[:, DISC], b * seen[:, WHITE], out=seen[:, LEFT])
        sums = (rows[:, :LEFT] @ rows.transpose(0, 2, 1)).astype(float)
        change = _solved(sums, white, contrast, outer)
        moved += np.clip(change[:2], -0.5, 0.5)
        white, contrast = white + change[3], np.maximum(contrast + change[2], 1.0)
        outer = outer + np.clip(change[4], -3 * EDGE, 3 * EDGE)
        if np.abs(change[:2]).max() < done:
            break
    count = np.maximum(np.count_nonzero(usable, axis=(1, 2)) - 4, 1)
    rms = np.sqrt(np.sum(rows[:, LEFT] ** 2, axis=1, dtype=float) / count)
    strayed = np.linalg.solve(ellipses, moved.T[:, :, None])[:, :, 0]
    good = (
        (contrast > 0.4 * np.median(contrast))
        & (rms < POOR * contrast)
        & (np.abs(change[:2]).max(axis=0) < 0.05)
        & (np.linalg.norm(strayed, axis=1) < 1)
    )
    uv[:, known[good]] = (start + moved)[:, good]
    return uv, float(np.median(rms / contrast))


def _levels(grey: Image, usable: Mask) -> tuple[Array, Array]:
    """A grey level of each window (n, ...) that one pixel in ten exceeds, and its darkest one."""
    light = np.where(usable, grey, 0).reshape(len(grey), -1)
    place = 0.9 * (light.shape[1] - 1)
    below = int(place)
    low, high = np.partition(light, (below, below + 1))[:, below : below + 2].T.astype(float)
    darkest = np.where(usable, grey, 255).min(axis=(1, 2)).astype(float)
    return low + (place - below) * (high - low), darkest


def _solved(sums: Array, white: Array, contrast: Array, outer: Array) -> Array:
    """A Gauss–Newton step (5, n): of the centre, the contrast, the beam's white, and its edge."""
    one = np.ones_like(white)
    scale = np.stack([-contrast, -contrast, -one, one, white], axis=1)
    matrix = sums[:, :5, :5] * scale[:, :, None] * scale[:, None]
    right = sums[:, :5, LEFT] * scale
    trace = np.trace(matrix, axis1=1, axis2=2)[:, None, None]
    matrix += (1e-6 * trace + 1e-9) * np.eye(5)
    matrix[:, 4, 4] += NOISE**2 / EDGE**2
    right[:, 4] -= NOISE**2 / EDGE**2 * outer
    return np.asarray(np.linalg.solve(matrix, right[:, :, None])[:, :, 0].T)


class _Discs:
    """Blurred ellipses and their derivatives in the centre, as pixels see them.

    An ellipse is cut into chords along u. What a pixel sees of a chord is the product of how much
    of it lies between the pixel's sides, blurred, and of how far it spreads along v; that is summed
    over the chords by Gauss–Legendre's rule. Each of the `ellipses` (n, 2, 2) is what its matrix
    makes of the unit disc, in px.
    """

    def __init__(self, tables: Profiles, ellipses: Array) -> None:
        tall = np.linalg.norm(ellipses[:, 1], axis=1)
        nodes, weights = _gauss_legendre(int(3 * tall.max() / tables.blur) + 6)
        sine, cosine = np.sin(nodes * np.pi / 2), np.cos(nodes * np.pi / 2)
        across = ellipses[:, 1] / tall[:, None]
        lean = np.sum(ellipses[:, 0] * across, axis=1)[:, None] * sine
        wide = np.abs(np.linalg.det(ellipses) / tall)[:, None] * cosine
        self.tables = tables
        self.ends = np.stack([lean - wide, lean + wide], axis=2)  # (n, chords, 2)
        self.height = tall[:, None] * sine
        self.weight = (tall[:, None] * weights * cosine * np.pi / 2).astype(np.float32)[..., None]

    def see(self, centre: Array, seen: Pixels) -> None:
        """Put what each pixel sees into the first of `seen`, if the centres (2, n) are there.

        In px from the first pixel of each window.
        """
        columns = seen.shape[3]
        rows = seen.shape[2]
        along = self.tables.along(centre[0, :, None, None] + self.ends)
        along = along[:, :, 0] - along[:, :, 1]
        spread = self.weight * self.tables.across(centre[1, :, None] + self.height)
        product = spread.transpose(0, 2, 1) @ along
        seen[:, DISC] = product[:, :rows, :columns]
        seen[:, DU] = product[:, :rows, columns:]
        seen[:, DV] = product[:, rows:, :columns]


class _Patch:
    """The beam around some markers, with straight edges along it; its ends are left out."""

    def __init__(self, view: View, which: IntArray, plane: Array, ellipses: Array) -> None:
        markers, self.blur = view.markers, view.blur
        x, y = markers.positions[:, which]
        length, width = markers.extent
        radius = markers.diameter / 2
        gradient = radius * np.linalg.inv(ellipses)  # of the plane's x and y, m per px
        steep = np.linalg.norm(gradient, axis=2).T
        self.normals = (gradient / steep.T[:, :, None]).transpose(1, 2, 0)
        # Distance in px from the marker to the edges y = 0 and y = W, exact in the middle.
        there = view.to_image(
            np.stack([plane, plane + [0 * y, 0 - y], plane + [0 * y, width - y]], 1)
        )
        self.edges = [
            np.abs(np.sum(self.normals[1] * (there[:, k] - there[:, 0]), axis=0)) for k in (1, 2)
        ]
        self.ends = [x / steep[0], (length - x) / steep[0]]
        # Up to where, in px, a pixel along or across sees no other marker.
        other, own = markers.clear[:, which] / steep, radius / steep
        self.free = np.maximum(other - own - 2 * self.blur - 0.5, 0.5 * other)

    def look(self, grey: Image, first: Array) -> None:
        """What the windows (n, rows, columns) show, if their first pixels (2, n) are seen there.

        In px from the markers: which pixels see no other marker, nor much of what is beyond the
        structure; the grey level beside the beam, the median of the pixels that see nothing of it;
        and how far pixels are from edges that are near.
        """
        du, dv = (x[:, None] + np.arange(m) for x, m in zip(first, grey.shape[:0:-1], strict=True))
        along, across = (
            nu[:, None, None] * du[:, None, :] + nv[:, None, None] * dv[:, :, None]
            for nu, nv in self.normals
        )
        left, right, low, high = (part[:, None, None] for part in (*self.ends, *self.edges))
        free, spare, clear = self.free[..., None, None], 1 + self.blur, 1 + 2.5 * self.blur
        self.usable: Mask = (
            (along > np.maximum(clear - left, -free[0]))
            & (along < np.minimum(right - clear, free[0]))
            & (across > np.maximum(-low - spare, -free[1]))
            & (across < np.minimum(high + spare, free[1]))
        )
        self.near, beside = [], []
        farthest = np.abs(across).max(axis=(1, 2))
        for edge, sign in zip(self.edges, (1, -1), strict=True):
            which = np.flatnonzero(edge < farthest + 1 + 3 * self.blur)
            inward = edge[which, None, None] + sign * across[which]
            beside.append(grey[which][inward < -clear])
            self.near.append((which, inward.astype(np.float32)))
        outside = np.concatenate(beside)
        self.background = float(np.median(outside)) if outside.size >= 20 else float(np.min(grey))

    def see(self, tables: Profiles, outer: Array, seen: Pixels) -> None:
        """Put the share of the beam in each pixel, and its derivative in `outer`, into `seen`.

        Edges are that much, in px, farther out than they are thought to be.
        """
        seen[:, WHITE], seen[:, OUTWARD] = 1, 0
        for which, inward in self.near:
            share, slope = tables.step(inward + outer[which, None, None].astype(np.float32))
            seen[which, WHITE] += share - 1
            seen[which, OUTWARD] += slope


@cache
def _gauss_legendre(n: int) -> tuple[Array, Array]:
    """Nodes and weights of a rule on −1…1."""
    return np.polynomial.legendre.leggauss(n)
