"""Which errors of a plate's deflection radiate: the ways of moving that are heard, one by one.

The mean square pressure on a plane is vᵀQv for real velocities v of the pistons, with the quadratic
form Q = FᵀF of a factor F (:func:`.full_factor`). Its eigenvectors are *radiation modes*: they
radiate one beside the other, without interference. Errors with the covariance C make tr(QC) on
average, to which the mode qₖ with eigenvalue λₖ adds λₖ qₖᵀCqₖ. Only a few modes are heard, those
in which markers far apart move alike. So errors that markers have in common radiate, and those
that each has by itself hardly do.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from thesis_lib.arrays import Array


def radiation_modes(factor: ArrayLike) -> Array:
    """Return the rows √λₖ qₖ, the loudest first: the factor of the same form with orthogonal rows.

    Parameters
    ----------
    factor : array_like, shape (rows, pistons)
        ‖F v‖ is the rms pressure of real velocities v.

    Returns
    -------
    ndarray, shape (modes, pistons)
        As many as there are rows or pistons, whichever is less.
    """
    _, strength, ways = np.linalg.svd(np.asarray(factor, float), full_matrices=False)
    return np.asarray(strength[:, None] * ways)


def mean_squares(modes: ArrayLike, covariance: ArrayLike) -> Array:
    """Return the mean square pressure of errors with a covariance, by radiation mode.

    Parameters
    ----------
    modes : array_like, shape (modes, pistons)
        Of :func:`radiation_modes`, or any rows: their sum is the mean of ‖F v‖².
    covariance : array_like, shape (pistons, pistons)
        Of the velocities; of deflections where a factor ω² is left out.

    Returns
    -------
    ndarray, shape (modes,)
    """
    F = np.asarray(modes, float)
    return np.asarray(np.sum((F @ np.asarray(covariance, float)) * F, axis=1))


def coherence_ratio(factor: ArrayLike, covariance: ArrayLike) -> float:
    """Return the rms pressure over that of errors as large on average that no two pistons share.

    √(tr QC / (tr Q · mean of C's diagonal)): 1 if errors are independent and of equal size, up to
    the square root of the number of pistons if all have the one error that radiates most.
    """
    F, C = np.asarray(factor, float), np.asarray(covariance, float)
    alone = np.sum(F**2) * np.trace(C) / len(C)
    return float(np.sqrt(np.sum(mean_squares(F, C)) / alone))
