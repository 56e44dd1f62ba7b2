"""What is measured of the plate: deflections at their maximum, the missing ones filled in."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import RBFInterpolator

from thesis_lib.arrays import Array, ComplexArray, Mask
from thesis_lib.vibration.plate import Plate
from thesis_lib.vibration.structure import deflection_shape


def at_maximum(plate: Plate, mode: int, motion: ComplexArray) -> Array:
    """Deflections at their maximum, from complex amplitudes (..., markers), m.

    The common phase is that of their product with the shape of the mode.
    """
    shape = deflection_shape(plate, mode, plate.markers, 1.0)
    phase = np.angle(np.nansum(motion * shape, axis=-1, keepdims=True))
    return np.asarray(np.real(motion * np.exp(-1j * phase)))


def filling(points: Array, missing: Mask) -> Array:
    """Matrix (markers, markers) that puts a smooth surface through the others where one is missing.

    To be applied to deflections in which what is missing is 0 or NaN-free.
    """
    known = np.flatnonzero(~missing)
    surface = RBFInterpolator(points[:, known].T, np.eye(len(known)), neighbors=min(24, len(known)))
    matrix = np.zeros((len(missing),) * 2)
    matrix[np.ix_(known, known)] = np.eye(len(known))
    matrix[np.ix_(np.flatnonzero(missing), known)] = surface(points[:, missing].T)
    return matrix


def filled(points: Array, measured: Array) -> Array:
    """Deflections (trials, markers), the missing ones of each from a surface through its known."""
    missing = np.isnan(measured)
    complete = np.nan_to_num(measured)
    for pattern in np.unique(missing, axis=0):
        same = (missing == pattern).all(axis=1)
        complete[same] = complete[same] @ filling(points, pattern).T
    return complete


def neighbours(errors: Array, grid: tuple[int, int]) -> float:
    """Correlation of errors (n, markers) of mean 0 with those of the next markers, over all."""
    e = errors.reshape(len(errors), grid[1], grid[0])
    products = np.sum(e[:, :, 1:] * e[:, :, :-1]) + np.sum(e[:, 1:] * e[:, :-1])
    pairs = grid[1] * (grid[0] - 1) + (grid[1] - 1) * grid[0]
    return float(products / pairs / (np.sum(e**2) / (grid[0] * grid[1])))
