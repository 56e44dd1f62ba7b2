"""Tables of ``design-law``, from its cube: whole beside the figures, short in the text."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np
import xarray as xr
from IPython.display import Markdown

from thesis_lib.facts.readings import reading
from thesis_lib.figure_sets.design_law import dither as design_dither
from thesis_lib.figure_sets.design_law.pairs import paired
from thesis_lib.figure_sets.design_law.share_tables import (
    asked,
    few_noisy,
    few_shares,
    mistakes,
    noisy,
    sampling,
    shares,
)
from thesis_lib.figure_sets.design_law.sweeps import AMPLITUDES, CONE_MOTION_PX
from thesis_lib.studies.cubes import percent_text
from thesis_lib.vision import dither
from thesis_lib.vision.cone_law import MAX_MOTION_FRACTION
from thesis_lib.vision.estimators import exponent
from thesis_lib.web.markdown import columns, table

REFINED = ("linear", "least-squares")


def show(cube: xr.Dataset, name: str) -> Markdown:
    """One of :data:`TABLES`, for a notebook."""
    return Markdown(TABLES[name](cube))


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
        off = naive / law
        rows.append(
            {
                "": one,
                "settings × modes": str(law.size),
                "law over simulated, median": f"{np.median(law / drawn):.3f}",
                "least and largest": f"{(law / drawn).min():.3f}–{(law / drawn).max():.3f}",
                "independent roundings over law": f"{off.min():.2f}–{off.max():.2f}",
            }
        )
    where = np.unravel_index(
        np.argmax((cube["naive_error"] / cube["law_error"]).values), cube["law_error"].shape
    )
    at = cube.isel(setting=int(where[0]), shape=int(where[1]))
    return columns(rows) + (
        f"\nSimulated with {asked(cube, 'trials')} trials. Independent roundings are farthest "
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
    header = ["motion, px", "error by the law, px", "drawn, px", "in % of the motion"]
    return f"{table(header, rows)}\n{sampling(cube, 'drawn_motion_error')}\n"


def cone(cube: xr.Dataset) -> str:
    """Errors at the centre of a cone."""
    rows = []
    for angle in (15, 30, 45, 55, 65, 80):
        at = cube.sel(angle=angle)
        closed, drawn = (1000 * at[f"cone{k}_error"].values for k in ("", "_drawn"))
        cells = [f"{c:.2f} / {d:.2f}" for c, d in zip(closed, drawn, strict=True)]
        rows.append([f"{angle:g}", *cells])
    agree = "less than 1e-12" if float(cube["cone_difference"]) < 1e-12 else "more than 1e-12"
    width, focal = asked(cube, "resolution_px")[0], asked(cube, "focal_length_mm")
    largest = CONE_MOTION_PX * asked(cube, "sensor_width_mm") / (focal * width)
    return table(["θ, °", "σ_x, mm", "σ_y, mm", "σ_z, mm"], rows) + (
        f"\nClosed form / drawn, of {asked(cube, 'cone_cameras')} cameras with "
        f"{asked(cube, 'resolution_px')[0]} px across at {asked(cube, 'cone_distance_mm'):g} mm. "
        f"Closed form and Jacobian differ by {agree}, relative to the errors. Motions are drawn up "
        f"to {percent_text(100 * largest)} % of the distance; closed forms hold up to "
        f"{100 * MAX_MOTION_FRACTION:g} %. {sampling(cube, 'cone_drawn_error')}\n"
    )


def _both(values: Iterable[float], digits: int = 2) -> str:
    return " / ".join(f"{value:.{digits}f}".replace("-", "−") for value in values)


def _range(values: xr.DataArray) -> str:
    return " to ".join(f"{end:.2f}".replace("-", "−") for end in (values.max(), values.min()))


def exponents(cube: xr.Dataset) -> str:
    """Exponents of the findings at the centre, over all markers, and far below a pixel."""
    rows = [
        [
            finding,
            *(
                _both(cube[f"{kind}_exponent"].sel(finding=finding).values)
                for kind in ("centre", "expected", "small")
            ),
        ]
        for finding in cube["finding"].values
        if np.isfinite(cube["centre_exponent"].sel(finding=finding)).all()
    ]
    header = ["", "at the centre", "over all markers", "far below a pixel"]
    nearest = cube["swept"].sel(finding="distance").min("step")
    motions = [
        AMPLITUDES[1] * float(reading(one)["amplitude_mm"]) / float(nearest.sel(structure=one))
        for one in _structures(cube)
    ]
    text = (
        f"\nExponents for {' / '.join(_structures(cube))}, that of elevation of cos φ. Closed "
        f"forms at the centre hold for motions up to {100 * MAX_MOTION_FRACTION:g} % of the "
        f"distance; those averaged here reach {_both((100 * one for one in motions), 1)} %.\n"
    )
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
        "distance": (
            "nearer cameras measure better",
            "$d^{1}$",
            f"motions far below a pixel: {small['distance']}",
        ),
        "resolution": (
            "more pixels measure better",
            "$W^{-1}$",
            f"motions far below a pixel: {small['resolution']}",
        ),
        "number": (
            "more cameras measure better",
            "$N^{-1/2}$",
            f"growing arrays of the thesis: {spread}, as added pairs are better or worse",
        ),
        "elevation": (
            "lower cameras measure better",
            "$(\\cos\\varphi)^{-1}$",
            f"from 20° down to {lowest:g}° there is {below} left to gain",
        ),
        "aperture": (
            "wider apertures measure better",
            "no effect: $u$ does not move",
            f"least error at {best[0]}°; from 60° on there is {late[0]} % left to gain "
            f"(amplitudes averaged: {best[1]}°, {late[1]} %)",
        ),
    }
    rows = []
    for finding, (words, law, end) in said.items():
        measured = cube["expected_exponent"].sel(finding=finding).values
        found = "no power" if np.isnan(measured).all() else _both(measured)
        rows.append([finding, words, law, found, end])
    header = [
        "",
        "the thesis says",
        "the law, at the centre",
        "exponent over all markers",
        "where it ends",
    ]
    return table(header, rows) + (
        f"\n{' / '.join(_structures(cube)).capitalize()}. Exponents are fitted over the ranges of "
        "the thesis, of the base that the law has, to errors averaged over amplitudes; the number "
        "is that of cameras on a cone. The conclusions have others: those of the thesis's own "
        "cases, at its one amplitude.\n"
    )


def estimated(cube: xr.Dataset) -> str:
    """Errors of the estimators by number of cameras, and their exponents."""
    names = [str(one) for one in cube["rule"].values]
    rows = [
        [
            str(int(n)),
            *(f"{1e6 * float(e):.0f}" for e in cube["crowd_error"].sel(crowd=n)),
            f"{float(cube['tolerated_noise'].sel(crowd=n)):.2f}",
        ]
        for n in cube["crowd"].values
    ]
    powers = [exponent(cube["crowd"], cube["crowd_error"].sel(rule=name)) for name in names]
    rows.append(["exponent", *(f"{float(p):.2f}".replace("-", "−") for p in powers), ""])
    return table(["cameras", *names, "noise that halves the gain, px"], rows) + (
        f"\nRms errors of deflections in µm, {design_dither.DISTANCE:g} m away, 320×180 px, in "
        "directions drawn evenly over the hemisphere. *Noise that halves the gain*: in the images "
        "before they are rounded, where the analytic centre has half its gain over least squares. "
        f"{sampling(cube, 'crowd_error')}\n"
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
    picks = {
        "swing": ("amplitude", (0.25, 0.5, 1, 2, 5)),
        "shake": ("shake", (0.1, 0.2, 0.3, 0.5)),
        "disc": ("diameter", (3, 5, 10)),
    }
    rows = []
    for name, (words, values) in picks.items():
        for value in values:
            at = cube.sel({name: value}, method="nearest")
            left, drawn = float(at[f"{name}_error"]), float(at[f"drawn_{name}_error"])
            rows.append(
                [
                    f"{words} {float(at[name]):.2g} px",
                    f"{left:.3f}",
                    f"{drawn:.3f}",
                    f"{whole / left:.1f}",
                ]
            )
    return table(["", "error, px", "drawn, px", "times better"], rows) + (
        f"\n*Amplitude*: fitted to endless frames. *Shake*: mean of {design_dither.FRAMES} frames. "
        f"*Diameter*: centroid of black pixels. One coordinate in one frame is off by {whole:.3f} "
        f"px. {sampling(cube, *(f'drawn_{name}_error' for name in picks))}\n"
    )


TABLES: dict[str, Callable[[xr.Dataset], str]] = {
    "motion": motion,
    "settings": settings,
    "cone": cone,
    "exponents": exponents,
    "pairs": paired,
    "shares": shares,
    "estimators": estimated,
    "noisy": noisy,
    "mistakes": mistakes,
    "refined": refined,
    "dither": dithered,
}
PIECES: dict[str, Callable[[xr.Dataset], str]] = {
    "settings": settings,
    "findings": findings,
    "pairs": paired,
    "shares": few_shares,
    "estimators": estimated,
    "noisy": few_noisy,
    "mistakes": mistakes,
    "refined": refined,
    "dither": dithered,
}
