"""What the tables of ``design-law`` need besides its cube."""

from __future__ import annotations

import json
from functools import partial
from typing import Any

import numpy as np
import xarray as xr

from thesis_lib.arrays import IntArray
from thesis_lib.facts.setups import assumed_values
from thesis_lib.figure_sets.design_law import shares as design_shares
from thesis_lib.figure_sets.design_law.sweeps import AMPLITUDE_RANGE, CONE_MOTION_PX
from thesis_lib.studies.cubes import iterate_slices
from thesis_lib.vision import dither
from thesis_lib.vision.cone_law import MAX_MOTION_FRACTION
from thesis_lib.vision.simulation import fit_exponent

SHOWN_NOISES_PX = (0.0, 0.05, 0.1, 0.3)
DITHERED = {  # what keeps pixels from rounding alike: its name in words, and values to list in px
    "fitted_amplitude": ("amplitude", (0.25, 0.5, 1, 2, 5)),
    "shake": ("shake", (0.1, 0.2, 0.3, 0.5)),
    "disc": ("diameter", (3, 5, 10)),
}
_OF_MARKERS = {"marker": design_shares.MARKER_DIAMETER_M, "followed_px": design_shares.FOLLOWED_PX}


def largest_std(cube: xr.Dataset, *names: str) -> float:
    """Return the largest standard error of drawn variables relative to them, NaN of one draw."""
    stds = [(cube[f"{name}_std"] / cube[name].where(cube[name] > 0)).values for name in names]
    largest = float(np.fmax.reduce(np.concatenate([np.ravel(one) for one in stds])))
    return largest if np.isfinite(largest) else np.nan


def sampling_std(*names: str) -> Any:
    """Return a function that gives a template the largest standard error of drawn variables."""
    return lambda cube: {"std": largest_std(cube, *names)}


def compare_settings(cube: xr.Dataset) -> dict[str, Any]:
    """Compare the law and independent roundings with the simulation."""
    rows = []
    for one in cube["structure"].values:
        part = cube.isel(setting=np.flatnonzero(cube["of_structure"].values == one))
        law = (part["law_error"] / part["simulated_error"]).values
        naive = (part["naive_error"] / part["law_error"]).values
        rows.append({"structure": one, "law": law, "median": np.median(law), "naive": naive})
    worst = (cube["naive_error"] / cube["law_error"]).argmax(...)
    return {"rows": rows, "worst": cube.isel(worst)}


def describe_cone(cube: xr.Dataset) -> dict[str, Any]:
    """Return the largest motions that are drawn, and those up to which closed forms hold."""
    asked = json.loads(cube.attrs["parameters"])
    pixel = asked["sensor_width_mm"] / (asked["focal_length_mm"] * asked["resolution_px"][0])
    std = largest_std(cube, "cone_drawn_error")
    return {"largest_motion": CONE_MOTION_PX * pixel, "max_motion": MAX_MOTION_FRACTION, "std": std}


def compare_exponents(cube: xr.Dataset) -> dict[str, Any]:
    """Return exponents of the findings at the centre, over all markers, and far below a pixel."""
    known = cube["centre_exponent"].notnull().all("structure").values
    nearest = cube["swept"].sel(finding="distance").min("step")
    motions = [
        100 * (AMPLITUDE_RANGE[1] * assumed_values(str(one))["amplitude_mm"] / float(distance))
        for one, distance in zip(cube["structure"].values, nearest, strict=True)
    ]
    return {
        "findings": [cube.isel(finding=i) for i in np.flatnonzero(known)],
        "amplitudes": list(iterate_slices(cube, "amplitudes")),
        "structures": cube["structure"].values,
        "motions": motions,
        "max_motion": MAX_MOTION_FRACTION,
    }


def summarise_findings(cube: xr.Dataset) -> dict[str, Any]:
    """Return the thesis's five findings: measured exponents, and their limits."""
    low = cube.sel(finding="elevation")
    gains = [
        np.interp(20, part["swept"], part["expected_error"]) / float(part["expected_error"][0])
        for part in iterate_slices(low, "structure")
    ]
    best, late = (
        [" / ".join(f"{scale * (value - less):.0f}" for value in row) for row in cube[name].values]
        for name, scale, less in (("best_aperture", 1, 0), ("wide_gain", 100, 1))
    )
    return {
        "structures": cube["structure"].values,
        "measured": cube["expected_exponent"],
        "arrays": cube["array_exponent"],
        "lowest": low["swept"][0, 0],
        "gains": gains,
        "best": best,
        "late": late,
    }


def compare_estimators(cube: xr.Dataset) -> dict[str, Any]:
    """Return the exponents of the estimators in the number of cameras."""
    errors = cube["equidistant_rig_error"].transpose("rule", ...)
    return {
        "exponents": [fit_exponent(cube["equidistant_rig"], one) for one in errors],
        "distance": design_shares.CROWD_DISTANCE_M,
        "std": largest_std(cube, "equidistant_rig_error"),
    }


def list_dither(cube: xr.Dataset) -> dict[str, Any]:
    """List the remaining error of one rounded coordinate at a few motions, shakes and sizes."""
    rows = []
    for name, (kind, values) in DITHERED.items():
        for value in values:
            at = cube.sel({name: value}, method="nearest")
            error, simulated = at[f"{name}_error"], at[f"drawn_{name}_error"]
            rows.append({"kind": kind, "value": at[name], "error": error, "drawn": simulated})
    std = largest_std(cube, *(f"drawn_{name}_error" for name in DITHERED))
    whole, frames = dither.ONE_FRAME**0.5, design_shares.SHAKE_FRAMES
    return {"rows": rows, "whole": whole, "frames": frames, "std": std}


def compare_shares(cube: xr.Dataset, short: bool = False) -> dict[str, Any]:
    """Return numbers of cameras at equal pixels per second; few, middle and most if `short`."""
    counts: list[int] = cube["count"].values.tolist()
    most = [most_followed(cube, float(rate)) for rate in cube["rate"].values]
    if short:  # besides the most whose markers can be followed
        ordered = sorted(counts)
        some = {ordered[i] for i in (0, len(counts) // 2, -1)} | {n for n in most if n}
        counts = sorted(some)
    return {
        "counts": counts,
        "few": int(cube["count"].min()),
        "many": int(cube["count"].max()),
        "slow": float(cube["rate"].min()),
        "fast": float(cube["rate"].max()),
        "most": most[int(np.argmin(cube["rate"].values))],
        "std": largest_std(cube, "drawn_frame_error", "drawn_fit_error"),
        **_OF_MARKERS,
    }


def most_followed(cube: xr.Dataset, rate: float) -> int:
    """Return the largest number of cameras whose markers the tracker follows, or 0."""
    here = cube.sel(rate=rate)
    fits = here["count"].values[here["marker_height"].values >= design_shares.FOLLOWED_PX]
    return int(fits.max(initial=0))


def list_noisy(cube: xr.Dataset) -> dict[str, Any]:
    """Return the cameras whose errors with noise are listed, by each estimator."""
    slowest = cube.sel(rate=cube["rate"].min())
    counts = np.sort(cube["count"].values)
    return {"counts": counts, "slowest": slowest, "shown": SHOWN_NOISES_PX, **_OF_MARKERS}


def _double_counts(cube: xr.Dataset) -> IntArray:
    """Return the numbers of cameras that are the least times a power of two."""
    counts = np.sort(cube["count"].values)
    return np.asarray(counts[np.log2(counts / counts[0]) % 1 == 0])


def summarise_noisy(cube: xr.Dataset) -> dict[str, Any]:
    """List that table for about half as many numbers of cameras, and state what noise leaves."""
    errors, least = 1e6 * cube["noisy_share_error"], 1e6 * cube["least_share_error"]
    squares, centre, interval = (errors.sel(approach=name) for name in errors["approach"].values)
    few, many = int(cube["count"].min()), int(cube["count"].max())
    some = {"count": many, "image_noise": SHOWN_NOISES_PX[1]}
    tolerated = cube["equal_pixels_tolerated_noise"].sel(approach="interval").dropna("count")
    loud = {"image_noise": cube["image_noise"].values >= SHOWN_NOISES_PX[-1]}
    level = (squares.max("count") / squares.min("count")).isel(loud)
    stds = cube["noisy_share_error_std"] / cube["noisy_share_error"]
    below = (least / interval - 1) / stds.sel(approach=interval["approach"].item())
    worse = float((interval / np.minimum(squares, centre)).max()) - 1
    return list_noisy(cube) | {
        "counts": _double_counts(cube),
        "few": few,
        "many": many,
        "noise": SHOWN_NOISES_PX[1],
        "loud": SHOWN_NOISES_PX[-1],
        "interval": interval.sel(some),
        "centre": centre.sel(some),
        "squares": squares.sel(some),
        "least": least.sel(some),
        "sharp": interval.sel(some | {"count": few}),
        "tolerated": tolerated,
        "level": level.max() - 1,
        "known": stds.isel(loud).max(),
        "efficiency": ((least / interval) ** 2).isel(loud).min(),
        "below": max(0.0, float(below.max())),
        "worse": max(0.0, worse),
    }


def list_mistakes(cube: xr.Dataset) -> dict[str, Any]:
    """List the cost of wrong noise and outliers for *interval*, and state it in numbers."""
    names = [str(one) for one in cube["approach"].values]
    squares, centre, interval = (cube["mistaken_error"].sel(approach=name) for name in names)
    doubled, rows = _double_counts(cube), []
    for mistake, (noise, _, _) in design_shares.ASSUMED_MISTAKES.items():
        for count in doubled[1::2] if len(doubled) > 1 else doubled:
            at = cube.sel(mistake=mistake, count=count)
            right = at["noisy_share_error"].sel(approach=names[-1], image_noise=noise)
            errors, stds = at["mistaken_error"], at["mistaken_error_std"]
            row = {"mistake": mistake, "count": count, "right": right, "errors": errors}
            rows.append(row | {"stds": stds, "agreeing": at["feasible_fraction"]})
    (low, (noise, less, _)), (high, (_, more, _)), (spoilt, _) = (
        design_shares.ASSUMED_MISTAKES.items()
    )
    over = (interval / squares).sel(mistake=low)
    worst = {"worse": over.max() - 1, "count": int(over.idxmax("count"))}
    return {
        "names": names,
        "rows": rows,
        "outlier_px": design_shares.OUTLIER_PX,
        "low": {"told": less, "noise": noise, **worst},
        "high": {"told": more, "ratio": (interval / centre).sel(mistake=high).max()},
        "many": max(doubled),
        "spoilt": (interval / squares).sel(mistake=spoilt, count=max(doubled)),
    }


TEXTS = {
    "motion": sampling_std("drawn_motion_error"),
    "settings": compare_settings,
    "cone": describe_cone,
    "exponents": compare_exponents,
    "findings": summarise_findings,
    "pairs": sampling_std("drawn_pair_error", "drawn_pair_noise_error"),
    "shares": compare_shares,
    "few-shares": partial(compare_shares, short=True),
    "estimators": compare_estimators,
    "noisy": list_noisy,
    "few-noisy": summarise_noisy,
    "mistakes": list_mistakes,
    "dither": list_dither,
}
