"""What the cubes of ``lab-elevation`` and ``lab-layout`` come to: errors, optima, best sets."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike
from scipy.interpolate import Akima1DInterpolator

from thesis_lib.arrays import Array, Mask

NEAR = 1.1  # times the least error that still count as near it
FINE = 400  # points at which a curve is looked up


def cases(cube: xr.Dataset) -> list[str]:
    """The cases of a cube in their order."""
    return list(dict.fromkeys(cube["case"].values.tolist()))


def part_of(cube: xr.Dataset, case: str) -> xr.Dataset:
    """The settings of one case and the one mode."""
    return cube.isel(setting=np.flatnonzero(cube["case"].values == case), mode=0)


def expected(part: xr.Dataset) -> Array:
    """Rms over the trials of the rms error, (settings,), %; of trial 0 if there are no others."""
    error = part["mean_error"].transpose("setting", "trial").values
    drawn = error[:, 1:] if error.shape[1] > 1 else error
    return np.asarray(np.sqrt(np.mean(drawn**2, axis=1)))


def ratios(part: xr.Dataset) -> Array:
    """Error over the trials divided by the law's prediction, (settings,)."""
    return np.asarray(expected(part) / part["predicted_error"].values, float)


def one_sided(part: xr.Dataset) -> Mask:
    """Whether all cameras of a set look from one side of the beam's axis, (settings,)."""
    across = np.cos(np.radians(part["camera_azimuth"].transpose("setting", "camera").values))
    known = np.isfinite(across)
    return np.asarray(
        np.all(~known | (across > 1e-9), axis=1) | np.all(~known | (across < -1e-9), axis=1)
    )


@dataclass(frozen=True)
class Optimum:
    """Where an error is least, on a curve through the settings."""

    #: Elevation in degrees and error in % of the least
    at: float
    error: float
    #: Elevations between which the error is at most :data:`NEAR` times the least, degrees
    low: float
    high: float


def optimum(values: ArrayLike, errors: ArrayLike) -> Optimum | None:
    """The least of a curve through errors (n,) at values (n,), NaN left out.

    An Akima spline between the logarithms of both; nothing is said beyond the outermost of the
    settings that have an error, nor if there are fewer than three.

    Examples
    --------
    >>> best = optimum([5, 10, 20, 40], [2, 1, 1, 2])
    >>> round(best.at, 1), round(best.error, 2)
    (14.1, 0.92)
    """
    x, y = np.asarray(values, float), np.asarray(errors, float)
    order = np.argsort(x)
    order = order[np.isfinite(y[order])]
    if len(order) < 3:
        return None
    x, y = np.log(x[order]), np.log(y[order])
    fine = np.linspace(x[0], x[-1], FINE)
    curve = Akima1DInterpolator(x, y)(fine)
    least = int(np.argmin(curve))
    far = np.flatnonzero(curve > curve[least] + np.log(NEAR))
    first = int(np.max(far[far < least], initial=-1)) + 1
    last = int(np.min(far[far > least], initial=FINE)) - 1
    at, low, high = (float(np.exp(fine[index])) for index in (least, first, last))
    return Optimum(at, float(np.exp(curve[least])), low, high)


def complete(part: xr.Dataset) -> xr.Dataset:
    """The settings in which every marker is measured: errors of fewer are not comparable."""
    return part.isel(setting=np.flatnonzero(part["missing"].values[:, 0] == 0))


def trial_optima(part: xr.Dataset) -> Array:
    """Elevation of the least error of each trial by itself, degrees."""
    error = part["mean_error"].transpose("trial", "setting").values[1:]
    best = [optimum(part["value"].values, own) for own in error]
    return np.array([own.at for own in best if own is not None])


def viewable(cube: xr.Dataset) -> xr.Dataset:
    """The cube with no more sets than a viewer has room for: of each number the best and worst."""
    kept = []
    for case in cases(cube):
        rows = np.flatnonzero(cube["case"].values == case)
        if case == "subsets":
            part = cube.isel(setting=rows, mode=0)
            error, count = np.nan_to_num(expected(part), nan=np.inf), part["n_cameras"].values
            groups = [np.flatnonzero(count == n) for n in np.unique(count)]
            ends = [own[[np.argmin(error[own]), np.argmax(error[own])]] for own in groups]
            rows = rows[list(dict.fromkeys(np.concatenate(ends).tolist()))]
        kept += rows.tolist()
    return cube.isel(setting=kept)
