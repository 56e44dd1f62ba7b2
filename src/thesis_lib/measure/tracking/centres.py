"""Sub-pixel centres: blurred discs on a white beam, fitted to the grey levels of a frame."""

from __future__ import annotations

from functools import cache

import numpy as np
from scipy.special import ndtr

from thesis_lib.arrays import Array, Image, IntArray, Mask
from thesis_lib.measure.tracking.homography import View
from thesis_lib.vision.lens import HALF_PIXEL

# Rms residual over contrast from which a fit is doubtful. Printed dots before a real camera leave
# up to 0.16; an unsharp mask of amount 2 puts up to a tenth of them above 0.15, one of amount 4 a
# third. With 0.25 those were kept, but so were discs turned out of their plane and 0.13 px off.
MAX_POOR_SHARE = 0.15
EDGE_STD_PX = 0.05  # px by which the beam's edge may be off its place
NOISE_GREY = 3.0  # grey levels against which that is weighed


def refine_centres(image: Image, view: View, plane: Array, steps: int = 4) -> tuple[Array, float]:
    """Return centres in px by a least-squares fit of blurred discs on a white beam to the frame.

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
    u, v = u + HALF_PIXEL, v + HALF_PIXEL

    patch = Patch(view, known, plane[:, known], ellipses)
    usable = patch.usable(u - start[0, :, None], v - start[1, :, None])
    background = patch.background(grey, u - start[0, :, None], v - start[1, :, None])
    centre, outer = start.copy(), np.zeros(len(known))
    bright = np.quantile(np.where(usable, grey, 0), 0.9, axis=(1, 2))
    contrast = bright - np.min(np.where(usable, grey, 255), axis=(1, 2))
    for _ in range(steps):
        du, dv = u - centre[0, :, None], v - centre[1, :, None]
        dark, *dark_by = blur_ellipses(du, dv, ellipses, blur)
        white, outward = patch.beam(u - start[0, :, None], v - start[1, :, None], outer)
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
        & (rms < MAX_POOR_SHARE * contrast)
        & (np.abs(change[:2]).max(axis=0) < 0.05)
        & (np.linalg.norm(strayed, axis=1) < 1)
    )
    uv[:, known[good]] = centre[:, good]
    return uv, float(np.median(rms / contrast))


class Patch:
    """The beam around some markers, with straight edges along it; its ends are left out."""

    def __init__(self, view: View, which: IntArray, plane: Array, ellipses: Array) -> None:
        markers, self.blur = view.markers, view.blur
        x, y = markers.positions[:, which]
        length, width = markers.extent
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
        # Up to where, in px, a pixel along or across sees no other marker.
        other, own = markers.clear[:, which] / steep, radius / steep
        self.free = np.maximum(other - own - 2 * self.blur - 0.5, 0.5 * other)[..., None, None]

    def _offset(self, axis: int, du: Array, dv: Array) -> Array:
        """Return the distance in px from the marker across rows or columns, (n, rows, columns)."""
        nu, nv = self.normals[axis]
        return np.asarray(nu * du[:, None, :] + nv * dv[:, :, None])

    def usable(self, du: Array, dv: Array) -> Mask:
        """Return the pixels that see no other marker, nor much of what is beyond the structure."""
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
        """Return grey level beside the beam: the median of the pixels that see nothing of it."""
        across, clear = self._offset(1, du, dv), 1 + 2.5 * self.blur
        low, high = (part[:, None, None] for part in self.edges)
        beside = grey[(across < -low - clear) | (across > high + clear)]
        return float(np.median(beside)) if beside.size >= 20 else float(np.min(grey))

    def beam(self, du: Array, dv: Array, outer: Array) -> tuple[Array, Array]:
        """Return the beam's share of each pixel, edges moved outward, and its derivative."""
        n, rows, columns = len(du), dv.shape[1], du.shape[1]
        share, slope = np.ones((n, rows, columns)), np.zeros((n, rows, columns))
        across, half = self._offset(1, du, dv), HALF_PIXEL / self.blur
        for edge, sign in zip(self.edges, (1, -1), strict=True):
            near = edge < np.abs(across).max(axis=(1, 2)) + 1 + 3 * self.blur
            z = ((edge + outer)[near, None, None] + sign * across[near]) / self.blur
            seen, slope[near] = _ramp_and_normal(z + half) - _ramp_and_normal(z - half)
            share[near] = self.blur * seen
        return share, slope


def blur_ellipses(u: Array, v: Array, ellipses: Array, blur: float) -> Array:
    """Return blurred indicators of ellipses and their derivatives in the centre.

    An ellipse is cut into chords along u. Blurred along u a chord is a difference of two normal
    distributions, and its spread along v a normal density. Both are integrated over the pixel;
    what it sees is their product, summed over the chords by Gauss–Legendre's rule.

    Pixel centres u (n, columns) and v (n, rows) count from the ellipses' centres, in px as `blur`,
    the standard deviation; each of the `ellipses` (n, 2, 2) is what its matrix makes of the unit
    disc. The result (3, n, rows, columns) is the indicator, and its derivatives in u and v in 1/px.
    """
    tall = np.linalg.norm(ellipses[:, 1], axis=1)
    nodes, weights = _gauss_legendre(int(3 * tall.max() / blur) + 6)
    sine, cosine = np.sin(nodes * np.pi / 2), np.cos(nodes * np.pi / 2)
    across = ellipses[:, 1] / tall[:, None]
    lean = np.sum(ellipses[:, 0] * across, axis=1)[:, None] * sine
    wide = np.abs(np.linalg.det(ellipses) / tall)[:, None] * cosine
    # A pixel ends where the next begins, so what is wanted is taken at the borders.
    ends = (
        (_pixel_borders(u)[:, None, :] - (lean + side * wide)[:, :, None]) / blur
        for side in (-1, 1)
    )  # (n, chords, columns + 1)
    left, right = (_ramp_and_normal(x) for x in ends)
    along, d_along = np.diff(left - right)
    offset = (
        _pixel_borders(v)[:, :, None] - tall[:, None, None] * sine
    ) / blur  # (n, rows + 1, chords)
    spread, d_spread = (
        np.diff(ndtr(offset), axis=1),
        -np.diff(_normal_density(offset), axis=1) / blur,
    )
    chord = tall[:, None, None] * weights * cosine * np.pi / 2
    along, spread, d_spread = blur * along, chord * spread, chord * d_spread
    return np.stack([spread @ along, -spread @ d_along, d_spread @ along])


def _pixel_borders(x: Array) -> Array:
    """Return borders (n, m + 1) of pixels with centres x (n, m), one px apart."""
    return np.concatenate([x - HALF_PIXEL, x[:, -1:] + HALF_PIXEL], axis=1)


@cache
def _gauss_legendre(n: int) -> tuple[Array, Array]:
    """Return the nodes and weights of a rule on −1…1."""
    return np.polynomial.legendre.leggauss(n)


def _normal_density(x: Array) -> Array:
    """Return the normal density."""
    return np.exp(-0.5 * x**2) / np.sqrt(2 * np.pi)


def _ramp_and_normal(x: Array) -> Array:
    """Return the integral of the normal distribution, and itself, shape (2, ...)."""
    normal = ndtr(x)
    return np.stack([x * normal + _normal_density(x), normal])
