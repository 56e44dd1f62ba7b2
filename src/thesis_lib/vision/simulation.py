"""Deflections measured with whole pixels, and how wrong they are."""

from __future__ import annotations

import numpy as np

from thesis_lib.arrays import Array
from thesis_lib.vision.estimators import ESTIMATOR_RULES
from thesis_lib.vision.pinhole import CameraArray, pixelate, project

LEAST_SQUARES = "least-squares"


def assurance_criterion(measured: Array, reference: Array) -> Array:
    """Return modal assurance criterion of shapes (..., markers) over the markers that are known.

    (Σ w φ)² / (Σ w² Σ φ²): 1 for shapes that differ in size alone; NaN without known markers.
    """
    known = np.isfinite(measured)
    m, r = np.where(known, measured, 0), np.where(known, reference, 0)
    with np.errstate(invalid="ignore"):
        return np.asarray(np.sum(m * r, -1) ** 2 / (np.sum(m * m, -1) * np.sum(r * r, -1)))


def point_heights(
    P: Array, uv: Array, estimator: str, normals: Array | None = None, noise_px: float = 0.0
) -> Array:
    """Estimate points' heights in m from rounded images (cameras, 2, ...).

    They are Z, or what points (3, ..., markers) have along the markers' normals (3, markers).
    """
    points = ESTIMATOR_RULES[estimator](P, uv, noise_px)
    return points[2] if normals is None else np.einsum("k...m,km->...m", points, normals)


def measure_deflections(
    cameras: CameraArray,
    points: Array,
    shifts: Array,
    rest_is_known: bool = False,
    estimator: str = LEAST_SQUARES,
    normals: Array | None = None,
    noise: Array | None = None,
    noise_px: float = 0.0,
) -> Array:
    """Return the deflections that cameras with whole pixels measure.

    Parameters
    ----------
    cameras : CameraArray
        The cameras.
    points : ndarray, shape (3, 1 + modes, markers)
        Marker positions in m: at rest, then deflected.
    shifts : ndarray, shape (trials, cameras, 2)
        Shift of each camera's pixel grid in px.
    rest_is_known : bool
        Subtract the true rest position instead of the rebuilt one.
    estimator : str
        One of ``RULES`` of :mod:`thesis_lib.vision.estimators`. The slabs that rounded images
        leave move along with a shifted grid.
    normals : ndarray, shape (3, markers), optional
        Unit vectors along which deflections are measured, in place of Z.
    noise : ndarray, shape (trials, cameras, 2, 1 + modes, markers), optional
        Noise of the images before they are rounded, in px.
    noise_px : float
        Its standard deviation, which the estimator is told.

    Returns
    -------
    ndarray, shape (modes, trials, markers)
        Measured deflections in m.
    """
    P = cameras.P
    shift = np.moveaxis(shifts, 0, 2)[:, :, None, :, None]
    seen = slice(1, None) if rest_is_known else slice(None)
    images = project(P, points[:, seen])[:, :, :, None] + shift
    if noise is not None:
        images += np.moveaxis(noise[:, :, :, seen], 0, 3)
    height = point_heights(P, pixelate(images) - shift, estimator, normals, noise_px)
    if rest_is_known:
        return height - (
            points[2, 0] if normals is None else np.sum(points[:, 0] * normals, axis=0)
        )
    return height[1:] - height[0]


def percent_errors(measured: Array, reference: Array) -> tuple[Array, Array, Array]:
    """Return the point, mean (rms) and largest error in % of the largest reference deflection.

    Equations 3.22 and 3.23; `measured` is (modes, trials, markers), `reference` (modes, markers).
    """
    scale = 100 / np.max(np.abs(reference), axis=-1)
    point = np.abs(measured - reference[:, None]) * scale[:, None, None]
    return point, np.sqrt(np.mean(point**2, axis=-1)), np.max(point, axis=-1)


def modal_assurance(measured: Array, reference: Array) -> Array:
    """Return modal assurance criterion |mᵀr|² / (mᵀm · rᵀr), from 0 to 1; NaN if nothing moves."""
    cross = np.einsum("mtp,mp->mt", measured, reference)
    norms = np.einsum("mtp,mtp->mt", measured, measured)
    with np.errstate(invalid="ignore"):
        result: Array = cross**2 / (norms * np.sum(reference**2, axis=-1)[:, None])
    return result
