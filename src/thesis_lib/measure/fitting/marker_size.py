"""Correct deflections for the size of the markers, whose edges bend with the surface.

The image of a marker moves by the mean of 2 n (n·d) w around its edge, with the edge's normal n,
the deflection w, and the displacement d along the surface that looks like a unit deflection to
the camera. On average over directions of view that is the mean of w around the edge: J₀(kr) of a
deflection of wavenumber k, for a radius r. Waves across the view lose half as much, along it half
as much again, so every camera's images are corrected for its own direction.
"""

from dataclasses import dataclass, replace

import numpy as np
import scipy

from thesis_lib.arrays import Array, ArrayLike, ComplexArray
from thesis_lib.measure.fitting.harmonics import Fitted, amplitude_std, deflection_amplitude
from thesis_lib.measure.fitting.reconstruction import Frame, Rest, normal_gain
from thesis_lib.vision.triangulation import image_jacobian

EDGE_POINTS = 12  # points on a marker's edge
#: Standard error of a correction over its change with the next lower order of interpolation, as in
#: modes of plates with three markers per wavelength or more
ORDER_ERROR_RATIO = 0.5
MIN_CORRECTION_RATIO = 2.0  # smallest rms of a fit's corrections over their noise
MIN_RANK_RATIO = 0.1  # smallest singular value of a polynomial's fit over that of a constant


@dataclass(frozen=True)
class EdgeCorrection:
    """Linear operators on the deflections of n markers, zero for markers that are not known."""

    change: Array  #: From measured deflections to their correction, shape (n, n)
    error: Array  #: From deflections to the standard error of their correction, shape (n, n)
    #: From measured deflections to the mean of 2 n nᵀ w less w, shape (2, 2, n, n)
    shift: Array

    def correct_deflections(self, w: Array) -> Array:
        """Correct deflections (times, n), filling gaps of a marker for the others."""
        filled = w.copy()
        for own in filled.T:
            known = np.isfinite(own)
            if known.any():
                own[~known] = np.interp(np.flatnonzero(~known), np.flatnonzero(known), own[known])
        return np.asarray(w + np.nan_to_num(filled) @ self.change.T)

    def propagate_std(self, std: Array) -> Array:
        """Return the standard errors of corrected deflections from independent ones (n,)."""
        weights = np.eye(len(std)) + self.change
        return np.asarray(np.sqrt(weights**2 @ np.nan_to_num(std) ** 2) + 0 * std)

    def estimate_error(self, w: Array | ComplexArray) -> Array:
        """Estimate the standard error of the correction of deflections (..., n)."""
        return np.asarray(np.abs(np.nan_to_num(w) @ self.error.T))


def fit_correction(P: Array, rest: Rest, w: Array | ComplexArray) -> EdgeCorrection:
    """Fit the correction for projection matrices P to deflections (..., n), NaN where unknown.

    A polyharmonic spline interpolates between the markers: r⁵ if they determine all curvatures,
    else r³, as between two rows. Motion as a plane stays as it is, and so does any with radius 0.
    """
    n, radius = rest.places.shape[1], rest.radius
    own = EdgeCorrection(np.zeros((n, n)), np.zeros((n, n)), np.zeros((2, 2, n, n)))
    known, seen = np.isfinite(w).reshape(-1, n).any(axis=0), np.isfinite(rest.images)
    p = rest.places[:, known] - rest.places[:, known].mean(axis=1, keepdims=True)
    unit, limit = np.eye(p.shape[1]), MIN_RANK_RATIO * np.sqrt(p.shape[1])
    x, y = p / np.maximum(p.std(axis=1, keepdims=True), radius)
    plane = np.stack([np.ones_like(x), x, y], axis=1)
    if not radius or np.linalg.matrix_rank(plane, limit) < 3:
        return own
    along, towards = view_plane(P, rest.frame, rest.points)
    gain = normal_gain(P, rest.frame, rest.points, np.logical_and(seen[:, 0], seen[:, 1]))
    share = np.einsum("cun,cnua,cnb->nab", gain, along, towards)[known]  # trace 1
    share = np.where(np.isfinite(share), share, 0.5 * np.eye(2))
    quadratic = np.column_stack([plane, x * x, x * y, y * y])
    whole = np.linalg.matrix_rank(quadratic, limit) == 6
    angle = 2 * np.pi * (np.arange(EDGE_POINTS) + 0.5) / EDGE_POINTS
    normal = np.stack([np.cos(angle), np.sin(angle)])
    edge = (p[:, :, None] + radius * normal[:, None]).reshape(2, -1).T
    curved = unit - plane @ np.linalg.pinv(plane)
    shifts, changes = [], []
    for kernel in ("quintic", "cubic") if whole else ("cubic", "thin_plate_spline"):
        surface = scipy.interpolate.RBFInterpolator(p.T, unit, kernel=kernel)
        around = surface(edge).reshape(len(x), EDGE_POINTS, -1)
        mean = 2 / EDGE_POINTS * np.einsum("ae,be,kej->abkj", normal, normal, around)
        shifts.append((mean - np.eye(2)[:, :, None, None] * unit) @ curved)
        loss = np.einsum("kab,abkj->kj", share, shifts[-1])
        changes.append(-np.linalg.solve(unit + loss, loss))
    rows, columns = np.ix_(known, known)
    own.change[rows, columns] = changes[0]
    own.error[rows, columns] = ORDER_ERROR_RATIO * (changes[0] - changes[1])
    own.shift[:, :, rows, columns] = shifts[0] @ (unit + changes[0])
    return own


def view_plane(P: Array, frame: Frame, points: Array) -> tuple[Array, Array]:
    """Return image motions along a structure's x and y, and the displacement like a deflection.

    The first, in px/m, are (cameras, n, 2, 2) for points (3, n); the second is (cameras, n, 2).
    """
    J = np.einsum("cuxn,ax->cnua", image_jacobian(P, points), frame.R)
    return J[..., :2], np.linalg.solve(J[..., :2], J[..., 2:])[..., 0]


def correct_fit(
    fit: Fitted, omega: float, exposures: ArrayLike, rest: Rest
) -> tuple[Fitted, EdgeCorrection]:
    """Correct the image amplitudes of a fit at ω in rad/s, not yet corrected for exposures in s.

    Also return the operators on its deflections. A correction that noise explains is left out.
    """
    w = deflection_amplitude(fit, omega, exposures)
    edges = fit_correction(fit.P, rest, w)
    variance = edges.change**2 @ np.nan_to_num(amplitude_std(fit, omega, exposures)) ** 2
    size = np.abs(edges.change @ np.nan_to_num(w))
    with np.errstate(invalid="ignore", divide="ignore"):  # of markers that are not known
        squares = size**2 / (2 * variance)  # of real and imaginary part
    if not np.nansum(squares) > MIN_CORRECTION_RATIO**2 * np.count_nonzero(variance):
        return fit, fit_correction(fit.P, replace(rest, radius=0.0), w)
    along, towards = view_plane(fit.P, fit.frame, fit.points)
    bent = edges.shift @ np.nan_to_num(w)
    moved = np.nan_to_num(np.einsum("cnua,abn,cnb->cun", along, bent, towards))
    blurs = np.sinc(omega * np.asarray(exposures) / (2 * np.pi))
    found = []
    for own, image, blur in zip(fit.harmonics, moved, blurs, strict=True):
        coefficients = own.coefficients.copy()
        coefficients[1:3] -= blur * np.array([image.real, -image.imag])
        found.append(replace(own, coefficients=coefficients))
    return replace(fit, harmonics=found), edges
