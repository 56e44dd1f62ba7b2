"""What the cubes of ``lab-elevation`` and ``lab-layout`` come to: errors, optima, best sets."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike
from scipy.interpolate import Akima1DInterpolator

from thesis_lib.arrays import Array, Mask
from thesis_lib.plotting.style import iterate_slices
from thesis_lib.studies.cubes import trials_are

MAX_NEAR_OPTIMUM = 1.1  # times the least error that still count as near it
MIN_LOST = 0.0005  # share of a setting's markers from which on it is named
CURVE_POINTS = 400  # points at which a curve is looked up


def list_cases(cube: xr.Dataset) -> list[str]:
    """Return the cases of a cube in their order."""
    return list(dict.fromkeys(cube["case"].values.tolist()))


def part_of(cube: xr.Dataset, case: str) -> xr.Dataset:
    """Select the settings of one case and the one mode."""
    return cube.isel(setting=np.flatnonzero(cube["case"].values == case), mode=0)


def predict_errors(part: xr.Dataset) -> Array:
    """Return the rms over the trials of the rms error, (settings,), %; of trial 0 if alone."""
    error = part["mean_error"].transpose("setting", "trial").values
    drawn = error[:, 1:] if error.shape[1] > 1 else error
    return np.asarray(np.sqrt(np.mean(drawn**2, axis=1)))


def law_ratios(part: xr.Dataset) -> Array:
    """Return error over the trials divided by the law's prediction, (settings,)."""
    return np.asarray(predict_errors(part) / part["predicted_error"].values, float)


def one_sided(part: xr.Dataset) -> Mask:
    """Tell whether all cameras of a set look from one side of the beam's axis, (settings,)."""
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
    #: Elevations between which the error is at most :data:`MAX_NEAR_OPTIMUM` times the least, °
    low: float
    high: float


def find_optimum(values: ArrayLike, errors: ArrayLike) -> Optimum | None:
    """Find the least of a curve through errors (n,) at values (n,), NaN left out.

    An Akima spline between the logarithms of both; nothing is said beyond the outermost of the
    settings that have an error, nor if there are fewer than three.

    Examples
    --------
    >>> best = find_optimum([5, 10, 20, 40], [2, 1, 1, 2])
    >>> round(best.at, 1), round(best.error, 2)
    (14.1, 0.92)
    """
    x, y = np.asarray(values, float), np.asarray(errors, float)
    order = np.argsort(x)
    order = order[np.isfinite(y[order])]
    if len(order) < 3:
        return None
    x, y = np.log(x[order]), np.log(y[order])
    fine = np.linspace(x[0], x[-1], CURVE_POINTS)
    curve = Akima1DInterpolator(x, y)(fine)
    least = int(np.argmin(curve))
    far = np.flatnonzero(curve > curve[least] + np.log(MAX_NEAR_OPTIMUM))
    first = int(np.max(far[far < least], initial=-1)) + 1
    last = int(np.min(far[far > least], initial=CURVE_POINTS)) - 1
    at, low, high = (float(np.exp(fine[index])) for index in (least, first, last))
    return Optimum(at, float(np.exp(curve[least])), low, high)


def select_complete(part: xr.Dataset) -> xr.Dataset:
    """Select the settings in which every marker is measured: errors of fewer do not compare."""
    return part.isel(setting=np.flatnonzero(part["missing"].values[:, 0] == 0))


def trial_optima(part: xr.Dataset) -> Array:
    """Return elevation of the least error of each trial by itself, degrees."""
    error = part["mean_error"].transpose("trial", "setting").values[1:]
    best = [find_optimum(part["value"].values, own) for own in error]
    return np.array([own.at for own in best if own is not None])


def select_viewable(cube: xr.Dataset) -> xr.Dataset:
    """Select the best and worst sets of each number: no more than a viewer has room for."""
    kept = []
    for case in list_cases(cube):
        rows = np.flatnonzero(cube["case"].values == case)
        if case == "subsets":
            part = cube.isel(setting=rows, mode=0)
            error, count = (
                np.nan_to_num(predict_errors(part), nan=np.inf),
                part["n_cameras"].values,
            )
            groups = [np.flatnonzero(count == n) for n in np.unique(count)]
            ends = [own[[np.argmin(error[own]), np.argmax(error[own])]] for own in groups]
            rows = rows[list(dict.fromkeys(np.concatenate(ends).tolist()))]
        kept += rows.tolist()
    return cube.isel(setting=kept)


# What tables need besides the cube.


def tabulate_settings(cube: xr.Dataset) -> dict[str, Any]:
    """Return the settings that are recordings of their own, with rms and band of their trials.

    Of sets of cameras that is the one of all cameras.
    """
    settings = []
    for case in list_cases(cube):
        part = part_of(cube, case)
        for one in list(iterate_slices(part, "setting"))[-1 if case == "subsets" else 0 :]:
            drawn = one["mean_error"].values[1:]
            trials = None
            if len(drawn) and np.isfinite(drawn).all():
                trials = np.sqrt(np.mean(drawn**2)), *np.quantile(drawn, [0.05, 0.95])
            settings.append((one, trials))
    return {"settings": settings}


def tabulate_optima(cube: xr.Dataset) -> dict[str, Any]:
    """Return the optimum of every case, and the settings in which tracking fails."""
    optima = []
    for case in list_cases(cube):
        part = select_complete(part_of(cube, case))
        best, drawn = find_optimum(part["value"].values, predict_errors(part)), trial_optima(part)
        height, spread = 0.0, np.quantile(drawn, [0.05, 0.95]) if len(drawn) else None
        if best is not None:
            height = np.interp(
                np.sin(np.radians(best.at)),
                np.sin(np.radians(part["value"].values)),
                part["image_height"].values,
            )
        optima.append((case, part, best, spread, height))
    every = list(iterate_slices(cube, "setting"))
    return {
        "optima": optima,
        "unfound": [one for one in every if one["lost"] == 1],
        "lost": [one for one in every if MIN_LOST <= one["lost"] < 1],
        "wrong": [one for one in every if one["wrong"] >= MIN_LOST],
    }


def fit_powers(cube: xr.Dataset) -> dict[str, Any]:
    """Fit powers of the distance to error, law and scatter."""
    if "distance" not in list_cases(cube):
        return {"powers": None}
    part = part_of(cube, "distance")
    error = predict_errors(part)
    known = np.isfinite(error)
    if np.count_nonzero(known) < 2:
        return {"powers": []}
    x, labels = np.log(part["value"].values[known]), part["label"].values[known]
    values = {
        f"error, rms over the {trials_are(cube)}, %": error,
        "law, one noise for all, %": part["predicted_error"].values,
        "scatter of the centres along u, px": part["centre_scatter"].values[:, 0],
        "scatter of the centres along v, px": part["centre_scatter"].values[:, 1],
    }
    powers = [
        (name, own[known], np.polyfit(x, np.log(own[known]), 1)[0]) for name, own in values.items()
    ]
    return {"powers": powers, "first": labels[0], "last": labels[-1]}


def compare_numbers(cube: xr.Dataset) -> dict[str, Any]:
    """Find the best and worst sets by their number of cameras, and compare with the best pair."""
    if "subsets" not in list_cases(cube):
        return {"numbers": None}
    part = part_of(cube, "subsets")
    count, law, error = (
        part["n_cameras"].values,
        part["predicted_error"].values,
        predict_errors(part),
    )
    known = np.isfinite(error)
    best_pair = np.nanmin(error[count == 2], initial=np.inf)

    def name_optimum(one: Any) -> tuple[str, float]:
        return part["label"].values[one], error[one]

    def worse_than_pair(chosen: Mask) -> list[dict[str, int]]:
        """Count sets that are worse than the best pair, by their number of cameras above two."""
        sets = [(n, error[chosen & (count == n)]) for n in np.unique(count) if n > 2]
        return [
            {"worse": int(np.sum(own > best_pair)), "count": len(own), "cameras": n}
            for n, own in sets
            if len(own)
        ]

    numbers = []
    for n in np.unique(count[known]):
        own = np.flatnonzero((count == n) & known)
        order = own[np.argsort(error[own], kind="stable")]
        ends = name_optimum(order[0]), name_optimum(own[np.argmin(law[own])]), np.median(error[own])
        numbers.append((n, len(own), *ends, name_optimum(order[-1])))
    rendered = part["mean_error"].isel(trial=0).values / law
    ratio = law_ratios(part)[known]
    return {
        "numbers": numbers,
        "beaten": [sets for sets in worse_than_pair(known) if sets["worse"]],
        "from_one_side": worse_than_pair(one_sided(part) & known),
        "ratio": ratio,
        "median_ratio": np.median(ratio) if ratio.size else np.nan,
        "rendered": rendered[np.isfinite(rendered)],
    }


def compare_cameras(cube: xr.Dataset) -> dict[str, Any]:
    """Divide the error of each set with a camera by that of the set without it."""
    if "subsets" not in list_cases(cube):
        return {"shares": None}
    part = part_of(cube, "subsets")
    names_of = [frozenset(label.split("–")) for label in part["label"].values]
    error = dict(zip(names_of, predict_errors(part).tolist(), strict=True))
    every, whole = max(error, key=len), part.isel(setting=-1)
    shares = []
    for number, name in enumerate(sorted(every)):
        factors = [
            error[names | {name}] / without for names, without in error.items() if name not in names
        ]
        place = whole["camera_azimuth"][number], whole["camera_elevation"][number]
        if factors:
            shares.append((name, *place, factors, np.exp(np.mean(np.log(factors)))))
    return {"shares": shares}


TEXTS: dict[str, Callable[[xr.Dataset], dict[str, Any]]] = {
    "errors": tabulate_settings,
    "localisation": tabulate_settings,
    "optima": tabulate_optima,
    "slopes": fit_powers,
    "numbers": compare_numbers,
    "shares": compare_cameras,
    "results": lambda cube: fit_powers(cube) | compare_numbers(cube) | compare_cameras(cube),
}
