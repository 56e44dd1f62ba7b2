"""What errors of the calibration do to a deflection shape: they move all markers together.

An error of a focal length or of a camera's place turns and stretches what the cameras measure, for
all markers alike. Noise of the centres averages out where many markers are summed, as in sound;
this does not. The amplitudes are triangulated again by cameras that are off by a standard deviation
in each of the independent directions of the calibration's covariance. Where the world lies is free
in it, and does not matter: the structure's frame comes from its markers at rest.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import xarray as xr

from thesis_lib.arrays import Array, ComplexArray
from thesis_lib.measure.calibration.bundle_adjustment import Network, step_network
from thesis_lib.measure.fitting.harmonics import (
    Fitted,
    Harmonics,
    combine_fit,
    deflection_amplitude,
)
from thesis_lib.measure.recordings.board import Markers
from thesis_lib.studies.schema import label_values, read_variables
from thesis_lib.vision import lens
from thesis_lib.vision.lens import Camera

MAX_DIRECTIONS = 16  # of the covariance that are kept, the largest ones
SHARED_VARIABLES = read_variables(__file__, "shared_errors")


def common_errors(
    fits: Sequence[Fitted],
    markers: Markers,
    omegas: Sequence[float],
    exposures: Array,
    covariance: Array,
) -> ComplexArray:
    """Return the calibration's errors of amplitudes in m, independent rows of one std each.

    Parameters
    ----------
    fits, omegas
        One vibration or several by the cameras as calibrated, and their angular frequencies, rad/s.
    markers : Markers
        What is on the structure.
    exposures : ndarray
        Exposure times in s.
    covariance : ndarray, shape (14 n, 14 n)
        Of the cameras, see :func:`~thesis_lib.measure.calibration.uncertainty.jackknife_cameras`.

    Returns
    -------
    ndarray, shape (rows, fits, markers)
        As many rows as the covariance has directions that matter, at most :data:`MAX_DIRECTIONS`.
    """
    scale = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    values, ways = np.linalg.eigh(covariance / scale[:, None] / scale)
    steps = [
        scale * way * np.sqrt(value)
        for value, way in zip(values, ways.T, strict=True)
        if value > 1e-9 * values[-1]
    ]

    def perturb_amplitudes(step: Array) -> ComplexArray:
        every = zip(fits, omegas, strict=True)
        moved = [
            deflection_amplitude(_refit_images(fit, markers, step), omega, exposures)
            for fit, omega in every
        ]
        return np.concatenate(moved)

    rows = [perturb_amplitudes(step / 2) - perturb_amplitudes(-step / 2) for step in steps]
    fewer = _keep_largest(np.nan_to_num(np.array(rows)))
    return fewer.reshape(len(fewer), len(fits), -1)


def with_common_errors(data: xr.Dataset, rows: ComplexArray, turns: ComplexArray) -> xr.Dataset:
    """Return a result with :data:`SHARED_VARIABLES`; its standard errors hold them.

    `rows` are of :func:`common_errors`, of all fits or of one; `turns` multiply complex amplitudes
    to those at the maximum of the vibration.
    """
    own = data["standard_error"]
    shared = np.sqrt(np.sum(np.real(rows * turns) ** 2, axis=0))
    own.values[:] = np.hypot(own.values, shared)
    values = {"shared_real": rows.real, "shared_imag": rows.imag}
    return data.assign(label_values(values, SHARED_VARIABLES, ("row", *map(str, own.dims[:-1]))))


def _keep_largest(rows: ComplexArray) -> ComplexArray:
    """Return at most :data:`MAX_DIRECTIONS` rows with the covariance of the largest directions.

    Rows are mixed by real numbers: a complex one would turn an error of size into one of phase.
    """
    parts = np.concatenate([rows.real, rows.imag], axis=1)
    _, size, mixed = np.linalg.svd(parts, full_matrices=False)
    kept = size[:MAX_DIRECTIONS, None] * mixed[:MAX_DIRECTIONS]
    real, imag = np.split(kept, 2, axis=1)
    return np.asarray(real + 1j * imag)


def _refit_images(fit: Fitted, markers: Markers, step: Array) -> Fitted:
    """Fit the same images with cameras that are off by a step."""
    network = Network(tuple(fit.cameras), np.zeros((0, 3, 3)), np.zeros((0, 3)))
    cameras = step_network(network, step).cameras
    pairs = list(zip(fit.cameras, cameras, strict=True))
    harmonics = [
        _undistort_again(old, new, own)
        for (old, new), own in zip(pairs, fit.harmonics, strict=True)
    ]
    rest = np.array(
        [_undistort_anew(old, new, uv) for (old, new), uv in zip(pairs, fit.rest, strict=True)]
    )
    return combine_fit(list(cameras), harmonics, rest, markers)


def _undistort_anew(old: Camera, new: Camera, uv: Array) -> Array:
    """Return places without distortion by one camera, as another one has them, (2, ...)."""
    return lens.undistort_pixels(new, lens.distort_pixels(old, uv))


def _undistort_again(old: Camera, new: Camera, own: Harmonics) -> Harmonics:
    """Undistort harmonics by another camera, to first order about their mean."""
    mean = own.coefficients[0]
    moved = _undistort_anew(old, new, mean)
    reach = 0.5  # px
    slopes = [
        (
            _undistort_anew(old, new, mean + shift[:, None])
            - _undistort_anew(old, new, mean - shift[:, None])
        )
        / (2 * reach)
        for shift in reach * np.eye(2)
    ]
    rest = np.einsum("inm,kim->knm", np.array(slopes), own.coefficients[1:])
    return replace(own, coefficients=np.concatenate([moved[None], rest]))
