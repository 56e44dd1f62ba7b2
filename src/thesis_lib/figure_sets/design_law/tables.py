"""Tables of ``design-law``, from its cube: whole next to the figures, short in the text."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import xarray as xr
from IPython.display import Markdown

from thesis_lib.arrays import IntArray
from thesis_lib.facts.readings import assumed_values
from thesis_lib.figure_sets.design_law import dither as design_dither
from thesis_lib.figure_sets.design_law.shares import (
    ASSUMED_MISTAKES,
    FOLLOWED_PX,
    MARKER_DIAMETER_M,
    OUTLIER_PX,
)
from thesis_lib.figure_sets.design_law.sweeps import AMPLITUDE_RANGE, CONE_MOTION_PX
from thesis_lib.templates import render
from thesis_lib.vision import dither
from thesis_lib.vision.cone_law import MAX_MOTION_FRACTION
from thesis_lib.vision.simulation import fit_exponent

SHOWN_NOISES_PX = (0.0, 0.05, 0.1, 0.3)


def show_table(cube: xr.Dataset, name: str) -> Markdown:
    """Show one of :data:`TABLES` in a notebook."""
    return Markdown(TABLES[name](cube))


def table_parameter(cube: xr.Dataset, name: str) -> Any:
    """Return a parameter of the run."""
    return json.loads(cube.attrs["parameters"])[name]


def largest_std(cube: xr.Dataset, *names: str) -> float:
    """Return the largest standard error of drawn variables relative to them, NaN of one draw."""
    stds = [(cube[f"{name}_std"] / cube[name].where(cube[name] > 0)).values for name in names]
    largest = float(np.fmax.reduce(np.concatenate([np.ravel(one) for one in stds])))
    return largest if np.isfinite(largest) else np.nan


def _fill(name: str, cube: xr.Dataset, drawn: tuple[str, ...] = (), **values: Any) -> str:
    """Fill in a template; `drawn` are variables whose largest standard error it states."""
    if drawn:
        values["std"] = largest_std(cube, *drawn)
    parameters = json.loads(cube.attrs["parameters"])
    return render(__file__, name, cube=cube, asked=parameters, **values)


def _structures(cube: xr.Dataset) -> list[str]:
    return [str(one) for one in cube["structure"].values]


def list_settings(cube: xr.Dataset) -> str:
    """Compare the law and independent roundings with the simulation."""
    rows = []
    for one in _structures(cube):
        part = cube.isel(setting=np.flatnonzero(cube["of_structure"].values == one))
        law = (part["law_error"] / part["simulated_error"]).values
        naive = (part["naive_error"] / part["law_error"]).values
        rows.append({"structure": one, "law": law, "median": np.median(law), "naive": naive})
    worst = (cube["naive_error"] / cube["law_error"]).argmax(...)
    return _fill("settings", cube, rows=rows, worst=cube.isel(worst))


def list_cone_errors(cube: xr.Dataset) -> str:
    """List the errors at the centre of a cone."""
    width, focal = (
        table_parameter(cube, "resolution_px")[0],
        table_parameter(cube, "focal_length_mm"),
    )
    largest = CONE_MOTION_PX * table_parameter(cube, "sensor_width_mm") / (focal * width)
    return _fill(
        "cone", cube, ("cone_drawn_error",), largest_motion=largest, max_motion=MAX_MOTION_FRACTION
    )


def list_exponents(cube: xr.Dataset) -> str:
    """List exponents of the findings at the centre, over all markers, and far below a pixel."""
    known = cube["centre_exponent"].notnull().all("structure").values
    nearest = cube["swept"].sel(finding="distance").min("step")
    motions = [
        100
        * (
            AMPLITUDE_RANGE[1]
            * assumed_values(one)["amplitude_mm"]
            / float(nearest.sel(structure=one))
        )
        for one in _structures(cube)
    ]
    return _fill(
        "exponents",
        cube,
        findings=[cube.isel(finding=i) for i in np.flatnonzero(known)],
        amplitudes=[cube.sel(amplitudes=kind) for kind in cube["amplitudes"].values],
        structures=_structures(cube),
        motions=motions,
        max_motion=MAX_MOTION_FRACTION,
    )


def list_findings(cube: xr.Dataset) -> str:
    """List the thesis's five findings: claim, law, measured exponent, and its limits."""
    low = cube.sel(finding="elevation")
    gains = []
    for one in _structures(cube):
        part = low.sel(structure=one)
        at_20 = np.interp(20, part["swept"], part["expected_error"])
        gains.append(at_20 / float(part["expected_error"][0]))
    best, late = (
        [" / ".join(f"{scale * (value - less):.0f}" for value in row) for row in cube[name].values]
        for name, scale, less in (("best_aperture", 1, 0), ("wide_gain", 100, 1))
    )
    return _fill(
        "findings",
        cube,
        structures=_structures(cube),
        measured=cube["expected_exponent"],
        arrays=cube["array_exponent"],
        lowest=low["swept"][0, 0],
        gains=gains,
        best=best,
        late=late,
    )


def list_estimators(cube: xr.Dataset) -> str:
    """List errors of the estimators by number of cameras, and their exponents."""
    powers = [
        fit_exponent(cube["equidistant_rig"], cube["equidistant_rig_error"].sel(rule=n))
        for n in cube["rule"].values
    ]
    distance = design_dither.CROWD_DISTANCE_M
    return _fill(
        "estimators", cube, ("equidistant_rig_error",), exponents=powers, distance=distance
    )


def list_dither(cube: xr.Dataset) -> str:
    """List the remaining error of one rounded coordinate at a few motions, shakes and sizes."""
    picks = {
        "fitted_amplitude": ("amplitude", (0.25, 0.5, 1, 2, 5)),
        "shake": ("shake", (0.1, 0.2, 0.3, 0.5)),
        "disc": ("diameter", (3, 5, 10)),
    }
    rows = []
    for name, (kind, values) in picks.items():
        for value in values:
            at = cube.sel({name: value}, method="nearest")
            error, simulated = at[f"{name}_error"], at[f"drawn_{name}_error"]
            rows.append({"kind": kind, "value": at[name], "error": error, "drawn": simulated})
    drawn = tuple(f"drawn_{name}_error" for name in picks)
    whole, frames = dither.ONE_FRAME**0.5, design_dither.SHAKE_FRAMES
    return _fill("dither", cube, drawn, rows=rows, whole=whole, frames=frames)


def list_shares(cube: xr.Dataset, short: bool = False) -> str:
    """List errors at equal pixels per second; `short` of some counts, with the claim in words."""
    counts: list[int] = cube["count"].values.tolist()
    slow, fast = float(cube["rate"].min()), float(cube["rate"].max())
    if short:  # few, middle and most cameras, and the most whose markers can be followed
        most = [most_followed(cube, float(rate)) for rate in cube["rate"].values]
        ordered = sorted(counts)
        some = {ordered[i] for i in (0, len(counts) // 2, -1)} | {n for n in most if n}
        counts = sorted(some)
    return _fill(
        "few-shares" if short else "shares",
        cube,
        ("drawn_frame_error", "drawn_fit_error"),
        counts=counts,
        few=int(cube["count"].min()),
        many=int(cube["count"].max()),
        slow=slow,
        fast=fast,
        most=most_followed(cube, slow),
        marker=MARKER_DIAMETER_M,
        followed_px=FOLLOWED_PX,
    )


def most_followed(cube: xr.Dataset, rate: float) -> int:
    """Return the largest number of cameras whose markers the tracker follows, or 0."""
    here = cube.sel(rate=rate)
    fits = here["count"].values[here["marker_height"].values >= FOLLOWED_PX]
    return int(fits.max(initial=0))


def list_noisy(cube: xr.Dataset) -> str:
    """List errors with noise, by each estimator, and the noise that leaves half of the gain."""
    return _noisy("noisy", cube, np.sort(cube["count"].values))


def _noisy(name: str, cube: xr.Dataset, counts: IntArray, **values: Any) -> str:
    return _fill(
        name,
        cube,
        counts=counts,
        slowest=cube.sel(rate=cube["rate"].min()),
        shown=SHOWN_NOISES_PX,
        marker=MARKER_DIAMETER_M,
        followed_px=FOLLOWED_PX,
        **values,
    )


def _double_counts(cube: xr.Dataset) -> IntArray:
    """Return the numbers of cameras that are the least times a power of two."""
    counts = np.sort(cube["count"].values)
    times = np.log2(counts / counts[0])
    return np.asarray(counts[times % 1 == 0])


def few_noisy(cube: xr.Dataset) -> str:
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
    return _noisy(
        "few-noisy",
        cube,
        _double_counts(cube),
        few=few,
        many=many,
        noise=SHOWN_NOISES_PX[1],
        loud=SHOWN_NOISES_PX[-1],
        interval=interval.sel(some),
        centre=centre.sel(some),
        squares=squares.sel(some),
        least=least.sel(some),
        sharp=interval.sel(some | {"count": few}),
        tolerated=tolerated,
        level=level.max() - 1,
        known=stds.isel(loud).max(),
        efficiency=((least / interval) ** 2).isel(loud).min(),
        below=max(0.0, float(below.max())),
        worse=max(0.0, worse),
    )


def list_mistakes(cube: xr.Dataset) -> str:
    """List the cost of wrong noise and outliers for *interval*, and state it in numbers."""
    names = [str(one) for one in cube["approach"].values]
    squares, centre, interval = (cube["mistaken_error"].sel(approach=name) for name in names)
    doubled, rows = _double_counts(cube), []
    for mistake, (noise, _, _) in ASSUMED_MISTAKES.items():
        for count in doubled[1::2] if len(doubled) > 1 else doubled:
            at = cube.sel(mistake=mistake, count=count)
            right = at["noisy_share_error"].sel(approach=names[-1], image_noise=noise)
            rows.append(
                {
                    "mistake": mistake,
                    "count": count,
                    "right": right,
                    "errors": at["mistaken_error"],
                    "stds": at["mistaken_error_std"],
                    "agreeing": at["feasible_fraction"],
                }
            )
    (low, (noise, less, _)), (high, (_, more, _)), (spoilt, _) = ASSUMED_MISTAKES.items()
    over = (interval / squares).sel(mistake=low)
    return _fill(
        "mistakes",
        cube,
        names=names,
        rows=rows,
        outlier_px=OUTLIER_PX,
        low={
            "told": less,
            "noise": noise,
            "worse": over.max() - 1,
            "count": int(over.idxmax("count")),
        },
        high={"told": more, "ratio": (interval / centre).sel(mistake=high).max()},
        many=max(doubled),
        spoilt=(interval / squares).sel(mistake=spoilt, count=max(doubled)),
    )


_PAIR_ERRORS = ("drawn_pair_error", "drawn_pair_noise_error")
Table = Callable[[xr.Dataset], str]
TABLES: dict[str, Table] = {
    "motion": partial(_fill, "motion", drawn=("drawn_motion_error",)),
    "settings": list_settings,
    "cone": list_cone_errors,
    "exponents": list_exponents,
    "pairs": partial(_fill, "pairs", drawn=_PAIR_ERRORS),
    "shares": list_shares,
    "estimators": list_estimators,
    "noisy": list_noisy,
    "mistakes": list_mistakes,
    "refined": partial(_fill, "refined"),
    "dither": list_dither,
}
PIECES: dict[str, Table] = {
    "settings": list_settings,
    "findings": list_findings,
    "shares": partial(list_shares, short=True),
    "noisy": few_noisy,
    **{name: TABLES[name] for name in ("pairs", "estimators", "mistakes", "refined", "dither")},
}
