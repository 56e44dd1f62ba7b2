"""What of ``design-law`` is published and compared."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from thesis_lib.facts import setups
from thesis_lib.figure_sets.design_law.parameters import DesignLaw
from thesis_lib.figure_sets.design_law.shares import ESTIMATORS
from thesis_lib.figure_sets.design_law.sweeps import FINDINGS, STRUCTURES
from thesis_lib.vision import estimators


def summary(cube: xr.Dataset, study: DesignLaw) -> dict[str, ArrayLike]:
    """What is published and compared, one number and unit to a row."""
    rows: list[tuple[str, float, str]] = []

    def of(words: str, value: Any, unit: str = "1") -> None:
        rows.append((words, float(value), unit))

    law, naive, simulated = (cube[f"{kind}_error"].values for kind in ("law", "naive", "simulated"))
    for one in STRUCTURES:
        at = cube["of_structure"].values == one
        ratios = {"law over simulated": law / simulated, "naive over law": naive / law}
        for words, ratio in ratios.items():
            of(f"{words}, {one}, least", ratio[at].min())
            of(f"{words}, {one}, median", np.median(ratio[at]))
            of(f"{words}, {one}, largest", ratio[at].max())
    for axis in "XYZ":
        over = cube["cone_drawn_error"].sel(axis=axis) / cube["cone_error"].sel(axis=axis)
        of(f"cone, drawn over closed form, {axis}", np.sqrt(np.mean(over**2)))
    for words, kind in (("rounded", ""), ("independent noise", "_noise")):
        over = cube[f"drawn_pair{kind}_error"] / cube[f"pair{kind}_error"]
        of(f"pairs, drawn over closed form, {words}", np.sqrt(np.mean(over**2)))
    for one in STRUCTURES:
        part = cube.sel(structure=one)
        for finding in FINDINGS[:-1]:
            of(f"exponent of {finding}, {one}", part["expected_exponent"].sel(finding=finding))
            of(f"exponent of {finding} at the centre, {one}",
               part["centre_exponent"].sel(finding=finding))  # fmt: skip
            of(f"exponent of {finding} far below a pixel, {one}",
               part["small_exponent"].sel(finding=finding))  # fmt: skip
        for kind in cube["amplitudes"].values:
            taken, words = part.sel(amplitudes=kind), f"amplitudes {kind}, {one}"
            of(f"best aperture, {words}", taken["best_aperture"], "degree")
            of(f"error at 60 degrees over the least, {words}", taken["wide_gain"])
        for array in setups.pairs():
            of(f"exponent of number in {array}, {one}", part["array_exponent"].sel(array=array))
    for count in study.counts:
        for rate in study.frame_rates_hz:
            here, part = f"{count} cameras, {rate:g} Hz", cube.sel(count=count, rate=rate)
            of(f"width, {here}", part["width_px"], "px")
            of(f"error of one frame by the law, {here}", part["frame_error"], "percent")
            of(f"error of the fit by the law, {here}", part["fit_error"], "percent")
            for name in ESTIMATORS:
                drawn = part.sel(estimator=name)
                of(f"error of one frame, {name}, {here}", drawn["drawn_frame_error"], "percent")
                of(f"error of the fit, {name}, {here}", drawn["drawn_fit_error"], "percent")
    for name in estimators.ESTIMATORS:
        part = cube.sel(rule=name)
        power = estimators.exponent(cube["crowd"].values, part["crowd_error"].values)
        of(f"exponent of number, random layouts, {name}", power)
        for along, unit in (("crowd", "cameras"), ("noise", "px noise"), ("stand", "m")):
            for value, error in zip(cube[along].values, part[f"{along}_error"].values, strict=True):
                of(f"error, {name}, {value} {unit}", 1e6 * error, "um")
    for count, noise in zip(cube["crowd"].values, cube["tolerated_noise"].values, strict=True):
        of(f"noise that halves the gain, {count} cameras", noise, "px")
    for count in study.counts:
        part = cube.sel(count=count)
        for noise, error in zip(
            part["image_noise"].values, part["noisy_share_error"].sel(approach="interval").values,
            strict=True,
        ):  # fmt: skip
            of(f"error, interval, {count} cameras, {noise:g} px noise", 1e6 * error, "um")
        for name, noise in zip(
            part["approach"].values, part["share_tolerance"].values, strict=True
        ):
            if np.isfinite(noise):
                of(
                    f"noise that halves the gain at equal pixels, {name}, {count} cameras",
                    noise,
                    "px",
                )
    for along, unit in (("swing", "amplitude"), ("shake", "shake"), ("disc", "diameter")):
        ratio = cube[f"drawn_{along}_error"] / cube[f"{along}_error"]
        of(f"dither by {unit}, drawn over closed form", np.sqrt(np.mean(ratio**2)))
    names, numbers, units = (list(column) for column in zip(*rows, strict=True))
    return {"quantity": names, "value": numbers, "unit": units}
