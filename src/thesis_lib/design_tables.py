"""Tables of ``design-law``, from its cube: whole beside the figures, short in the text."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
import xarray as xr
from IPython.display import SVG, Markdown

from thesis_lib import design_dither, design_figures, dither
from thesis_lib.cubes import percent_text
from thesis_lib.design_pairs import paired
from thesis_lib.estimators import exponent
from thesis_lib.markdown import table
from thesis_lib.style import svg

REFINED = ("linear", "least-squares")


def show(cube: xr.Dataset, name: str) -> Markdown:
    """One of :data:`TABLES`, for a notebook."""
    return Markdown(TABLES[name](cube))


def picture(cube: xr.Dataset, name: str) -> SVG:
    """One of the figures, for a notebook."""
    return SVG(svg(design_figures.figure(cube, name)))


def _asked(cube: xr.Dataset, name: str) -> Any:
    """A parameter of the run."""
    return json.loads(cube.attrs["parameters"])[name]


def _duration(cube: xr.Dataset) -> str:
    seconds = _asked(cube, "duration_s")
    return "one second" if seconds == 1 else f"{seconds:g} seconds"


def _structures(cube: xr.Dataset) -> list[str]:
    return [str(one) for one in cube["structure"].values]


def settings(cube: xr.Dataset) -> str:
    """How near law and independent roundings come to the simulation."""
    rows = []
    for one in _structures(cube):
        at = cube["of_structure"].values == one
        law, naive, drawn = (
            cube[f"{kind}_error"].values[at] for kind in ("law", "naive", "simulated")
        )
        rows.append(
            [one, str(law.size), f"{np.median(law / drawn):.3f}",
             f"{(law / drawn).min():.3f}–{(law / drawn).max():.3f}",
             f"{(naive / law).min():.2f}–{(naive / law).max():.2f}"]
        )  # fmt: skip
    header = ["", "settings × modes", "law over simulated, median", "least and largest",
              "independent roundings over law"]  # fmt: skip
    where = np.unravel_index(np.argmax((cube["naive_error"] / cube["law_error"]).values),
                             cube["law_error"].shape)  # fmt: skip
    at = cube.isel(setting=int(where[0]), shape=int(where[1]))
    return table(header, rows) + (
        f"\nSimulated with {_asked(cube, 'trials')} trials. Independent roundings are farthest "
        f"off, {float(at['naive_error'] / at['law_error']):.2f} times the law, in case "
        f"{at['of_layout'].item()} of the {at['of_structure'].item()}, {at['label'].item()}, mode "
        f"{int(at['shape'])}.\n"
    )


def motion(cube: xr.Dataset) -> str:
    """The law of one coordinate at a few motions."""
    rows = []
    for delta in (0.01, 0.1, 0.5, 1.0, 1.5, 2.0, 3.5):
        at = cube.sel(motion=delta, method="nearest")
        law, drawn, moved = (float(at[k]) for k in ("motion_error", "drawn_motion_error", "motion"))
        rows.append([f"{moved:g}", f"{law:.3f}", f"{drawn:.3f}", f"{100 * law / moved:.0f}"])
    return table(["motion, px", "error by the law, px", "drawn, px", "in % of the motion"], rows)


def cone(cube: xr.Dataset) -> str:
    """Errors at the centre of a cone."""
    rows = []
    for angle in (15, 30, 45, 55, 65, 80):
        at = cube.sel(angle=angle)
        closed, drawn = (1000 * at[f"cone{k}_error"].values for k in ("", "_drawn"))
        cells = [f"{c:.2f} / {d:.2f}" for c, d in zip(closed, drawn, strict=True)]
        rows.append([f"{angle:g}", *cells])
    agree = "less than 1e-12" if float(cube["cone_difference"]) < 1e-12 else "more than 1e-12"
    return table(["θ, °", "σ_x, mm", "σ_y, mm", "σ_z, mm"], rows) + (
        f"\nClosed form / drawn, of {_asked(cube, 'cone_cameras')} cameras with "
        f"{_asked(cube, 'resolution_px')[0]} px across at {_asked(cube, 'cone_distance_mm'):g} mm. "
        f"Closed form and Jacobian differ by {agree}, relative to the errors.\n"
    )


def _both(values: Iterable[float], digits: int = 2) -> str:
    return " / ".join(f"{value:.{digits}f}".replace("-", "−") for value in values)


def _range(values: xr.DataArray) -> str:
    return " to ".join(f"{end:.2f}".replace("-", "−") for end in (values.max(), values.min()))


def exponents(cube: xr.Dataset) -> str:
    """Exponents of the findings at the centre, over all markers, and far below a pixel."""
    rows = [
        [finding, *(_both(cube[f"{kind}_exponent"].sel(finding=finding).values)
                    for kind in ("centre", "expected", "small"))]
        for finding in cube["finding"].values
        if np.isfinite(cube["centre_exponent"].sel(finding=finding)).all()
    ]  # fmt: skip
    header = ["", "at the centre", "over all markers", "far below a pixel"]
    text = f"\nExponents for {' / '.join(_structures(cube))}, that of elevation of cos φ.\n"
    for kind in cube["amplitudes"].values:
        at = cube.sel(amplitudes=kind)
        text += (
            f"With amplitudes {kind} the least error has an aperture of "
            f"{_both(at['best_aperture'].values, 0)}°; at 60° it is "
            f"{_both(at['wide_gain'].values, 3)} times as large.\n"
        )
    return table(header, rows) + text


def findings(cube: xr.Dataset) -> str:
    """The thesis's five findings: what it says, the law, what is measured, where it ends."""
    spread = _range(cube["array_exponent"].transpose("array", "structure"))
    best, late = (
        [_both(scale * (row - less), 0) for row in cube[name].values]
        for name, scale, less in (("best_aperture", 1, 0), ("wide_gain", 100, 1))
    )
    low = cube.sel(finding="elevation")["expected_error"]
    values = cube.sel(finding="elevation")["swept"]
    gains = [
        np.interp(20, values.sel(structure=one), low.sel(structure=one))
        / float(low.sel(structure=one)[0])
        for one in _structures(cube)
    ]
    below = " / ".join(f"{100 * (gain - 1):.0f} %" for gain in gains)
    lowest = float(values[0, 0])
    small = {f: _both(cube["small_exponent"].sel(finding=f).values) for f in cube["finding"].values}
    said: dict[str, tuple[str, str, str]] = {
        "distance": ("nearer cameras measure better", "$d^{1}$",
                     f"motions far below a pixel: {small['distance']}"),
        "resolution": ("more pixels measure better", "$W^{-1}$",
                       f"motions far below a pixel: {small['resolution']}"),
        "number": ("more cameras measure better", "$N^{-1/2}$",
                   f"growing arrays of the thesis: {spread}, as added pairs are better or worse"),
        "elevation": ("lower cameras measure better", "$(\\cos\\varphi)^{-1}$",
                      f"from 20° down to {lowest:g}° there is {below} left to gain"),
        "aperture": ("wider apertures measure better",
                     "no effect: $u$ does not move",
                     f"least error at {best[0]}°; from 60° on there is {late[0]} % left to gain "
                     f"(amplitudes averaged: {best[1]}°, {late[1]} %)"),
    }  # fmt: skip
    rows = []
    for finding, (words, law, end) in said.items():
        measured = cube["expected_exponent"].sel(finding=finding).values
        found = "no power" if np.isnan(measured).all() else _both(measured)
        rows.append([finding, words, law, found, end])
    header = ["", "the thesis says", "the law, at the centre", "exponent over all markers",
              "where it ends"]  # fmt: skip
    return table(header, rows) + (
        f"\n{' / '.join(_structures(cube)).capitalize()}. Exponents are fitted over the ranges of "
        "the thesis, of the base that the law has; the number is that of cameras on a cone.\n"
    )


def _share(cube: xr.Dataset, counts: Iterable[int]) -> str:
    names = [str(name) for name in cube["estimator"].values]
    rows = []
    for rate in cube["rate"].values:
        for count in counts:
            at = cube.sel(rate=rate, count=count)
            drawn, fitted = (
                [percent_text(float(v)) for v in at[name].values]
                for name in ("drawn_frame_error", "drawn_fit_error")
            )
            rows.append(
                [f"{rate:g}", str(count), f"{int(at['width_px'])}×{int(at['height_px'])}",
                 f"{float(at['motion_px']):.1f}", percent_text(float(at["frame_error"])), *drawn,
                 percent_text(float(at["fit_error"])), *fitted,
                 f"{float(at['useful_frames']):.0f}"]
            )  # fmt: skip
    header = ["Hz", "cameras", "pixels", "motion, px", "frame: law",
              *(f"frame: {name}" for name in names), "film: law",
              *(f"film: {name}" for name in names), "frames that tell"]  # fmt: skip
    return table(header, rows)


def shares(cube: xr.Dataset) -> str:
    """Equal pixels per second, all numbers of cameras."""
    peak = _asked(cube, "amplitude_mm")
    return _share(cube, cube["count"].values) + (
        f"\nAll have {_asked(cube, 'pixels_per_second') / 1e6:.0f} million pixels per second "
        f"together, at {_asked(cube, 'cone_distance_mm'):g} mm, {_asked(cube, 'cone_deg'):g}° "
        "from the normal. *Frame*: rms error of the beam's markers in modes 1 to 3, in % of "
        f"the peak of {peak:g} mm. *Film*: rms error of an amplitude fitted to "
        f"{_duration(cube)} of a vibration with "
        f"{_asked(cube, 'frequency_hz'):g} Hz at the centre. *Frames that tell*: about how many "
        "frames are worth fitting.\n"
    )


def few_shares(cube: xr.Dataset) -> str:
    """The same for the least, a middle and the largest number of cameras, and what it says."""
    counts = np.sort(cube["count"].values)
    chosen = dict.fromkeys(int(counts[i]) for i in (0, len(counts) // 2, -1))
    return f"{_share(cube, chosen)}\n{claim(cube)}"


def claim(cube: xr.Dataset) -> str:
    """The thesis's central claim in numbers: the law of least squares, then other estimators."""
    few, many = int(cube["count"].min()), int(cube["count"].max())
    slow, fast = float(cube["rate"].min()), float(cube["rate"].max())
    frames = cube["frame_error"].sel(rate=slow)

    def at(name: str, count: int, rate: float) -> float:
        return float(cube[name].sel(count=count, rate=rate))

    text = (
        f"At {slow:g} frames per second the error of one frame is {float(frames.min()):.1f} to "
        f"{float(frames.max()):.1f} % for {few} to {many} cameras, in no order. At {fast:g} the "
        f"same pixels give {at('frame_error', few, fast):.1f} % to {few} cameras and "
        f"{at('frame_error', many, fast):.1f} % to {many}, whose images move by "
        f"{at('motion_px', many, fast):.2f} px. An amplitude fitted to all frames of "
        f"{_duration(cube)} is wrong by {at('fit_error', few, slow):.2f} % "
        f"with {few} cameras at {slow:g} frames per second, by {at('fit_error', many, slow):.2f} "
        f"% with {many}, and by {at('fit_error', few, fast):.2f} % with {few} cameras at "
        f"{fast:g}, for all its frames. Were frames independent, it would be "
        f"{at('independent_fit_error', few, slow):.2f} % for every one of them."
    )
    for name in cube["estimator"].values[1:]:
        frame, film = (
            [percent_text(float(cube[kind].sel(estimator=name, count=count, rate=slow)))
             for count in (few, many)]
            for kind in ("drawn_frame_error", "drawn_fit_error")
        )  # fmt: skip
        text += (
            f" The *{name}* gives, at {slow:g} frames per second, {frame[0]} % to {few} cameras "
            f"and {frame[1]} % to {many} from one frame, {film[0]} and {film[1]} % from all."
        )
    return text + "\n"


def estimated(cube: xr.Dataset) -> str:
    """Errors of the estimators by number of cameras, and their exponents."""
    names = [str(one) for one in cube["rule"].values]
    rows = [
        [str(int(n)), *(f"{1e6 * float(e):.0f}" for e in cube["crowd_error"].sel(crowd=n))]
        for n in cube["crowd"].values
    ]
    powers = [exponent(cube["crowd"], cube["crowd_error"].sel(rule=name)) for name in names]
    rows.append(["exponent", *(f"{float(p):.2f}".replace("-", "−") for p in powers)])
    return table(["cameras", *names], rows) + (
        f"\nRms errors of deflections in µm, {design_dither.DISTANCE:g} m away, 320×180 px, in "
        "directions drawn evenly over the hemisphere.\n"
    )


def refined(cube: xr.Dataset) -> str:
    """Where refinement pays: equal and unequal distances."""
    linear, least = (1e6 * cube["stand_error"].sel(rule=name) for name in REFINED)
    rows = [
        [str(one), f"{float(a):.0f}", f"{float(b):.0f}", f"{float(a / b):.2f}"]
        for one, a, b in zip(cube["stand"].values, linear, least, strict=True)
    ]
    return table(["distances, m", "linear, µm", "refined, µm", "ratio"], rows)


def dithered(cube: xr.Dataset) -> str:
    """What is left of one rounded coordinate's error, at a few motions, shakes and sizes."""
    whole = dither.ONE_FRAME**0.5
    picks = {"swing": ("amplitude", (0.25, 0.5, 1, 2, 5)), "shake": ("shake", (0.1, 0.2, 0.3, 0.5)),
             "disc": ("diameter", (3, 5, 10))}  # fmt: skip
    rows = []
    for name, (words, values) in picks.items():
        for value in values:
            at = cube.sel({name: value}, method="nearest")
            left, drawn = float(at[f"{name}_error"]), float(at[f"drawn_{name}_error"])
            rows.append([f"{words} {float(at[name]):.2g} px", f"{left:.3f}", f"{drawn:.3f}",
                         f"{whole / left:.1f}"])  # fmt: skip
    return table(["", "error, px", "drawn, px", "times better"], rows) + (
        f"\n*Amplitude*: fitted to endless frames. *Shake*: mean of {design_dither.FRAMES} frames. "
        f"*Diameter*: centroid of black pixels. One coordinate in one frame is off by {whole:.3f} "
        "px.\n"
    )


TABLES: dict[str, Callable[[xr.Dataset], str]] = {
    "motion": motion, "settings": settings, "cone": cone, "exponents": exponents,
    "pairs": paired, "shares": shares,
    "estimators": estimated, "refined": refined, "dither": dithered,
}  # fmt: skip
PIECES: dict[str, Callable[[xr.Dataset], str]] = {
    "settings": settings, "findings": findings, "pairs": paired, "shares": few_shares,
    "estimators": estimated, "refined": refined, "dither": dithered,
}  # fmt: skip
