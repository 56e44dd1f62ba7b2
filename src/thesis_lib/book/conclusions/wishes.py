"""What came of the wishes with which the thesis ends."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import xarray as xr

from thesis_lib.book.conclusions.knobs import MEAN, PLANES
from thesis_lib.book.conclusions.strengths import (
    Cubes,
)
from thesis_lib.ledger.entries import from_cube
from thesis_lib.plotting.selection import error_bars, select
from thesis_lib.studies.cubes import percent_text
from thesis_lib.web.markdown import table


def _median(cube: xr.Dataset, case: str, mode: int, quantity: str = "mean_error") -> list[str]:
    """Median error of each setting of a case, as text."""
    band = error_bars(cube, case, mode, quantity).band[1]
    return [f"{percent_text(value)} %" for value in band]


def fulfilled(opened: Cubes) -> str:
    """What came of the wishes of sections 5.3 and 7.1, in a number each."""
    rows = []
    stand, motions = "[Where the cameras stand](layouts.md)", "[Faster vibrations](motions.md)"
    plate = "[The plate](motions.md#the-plate)"
    sets = "[The experiment, cameras](executed/experiment-cameras.ipynb)"
    shapes = "[Shapes without symmetry](shapes.md)"
    equal = "[Many coarse cameras, rendered](equal-pixels.md)"
    own = "[The ledger](executed/claims.ipynb), [own recordings](recordings.md)"
    wishes: tuple[tuple[str, str, str, Callable[[xr.Dataset], str]], ...] = (
        ("other distances (5.3)", "lab-layout", stand, partial(_ends_of, case="distance")),
        ("other apertures (5.3)", "lab-layout", stand, partial(_ends_of, case="aperture")),
        ("how low is too low (3.4)", "lab-elevation", stand, _lowest),
        ("other sets of the four cameras (5.3)", "experiment-cameras", sets, _sets),
        ("more than four cameras (5.3)", "lab-layout", stand, _many),
        (
            "many coarse cameras for two sharp ones (1.2)",
            "lab-equal-pixels",
            equal,
            _coarse,
        ),
        ("more than one deflection shape (7.1)", "lab-modes", motions, _higher),
        ("three rows of markers, and torsion (5.3, 7.1)", "lab-modes", motions, _torsion),
        ("the plate, by experiment (7.1)", "lab-plate", plate, partial(_all, quantities=MEAN)),
        ("its sound, by experiment (7.1)", "lab-plate", plate, partial(_all, quantities=PLANES)),
        ("structures without a plane of symmetry (7.1)", "claims", own, _askew),
        (
            "the same, an L: cameras added pair by pair (7.1)",
            "shape-l",
            shapes,
            partial(_ends_of, case="4e"),
        ),
    )
    for wish, name, page, text in wishes:
        try:
            cube = opened[name]
        except KeyError:
            continue
        rows.append([wish, page, text(cube)])
    return table(["wish", "page", "what came of it"], rows)


def _ends_of(cube: xr.Dataset, case: str) -> str:
    labels = select(cube, case, 1)["label"].values
    errors = _median(cube, case, 1)
    return f"{labels[0]}: {errors[0]}; {labels[-1]}: {errors[-1]}"


def _lowest(cube: xr.Dataset) -> str:
    part = select(cube, "three-rows", 1)
    error = error_bars(cube, "three-rows", 1).band[1]
    best = int(np.nanargmin(error))
    lost = [f"{v:g}°" for v, e in zip(part["value"].values, error, strict=True) if np.isnan(e)]
    none = f"no result at {' and '.join(lost)}" if lost else "a result at every elevation"
    return f"least at {part['value'].values[best]:g}°: {percent_text(error[best])} %; {none}"


def _sets(cube: xr.Dataset) -> str:
    part = select(cube, "literal-all", 1)
    error = error_bars(cube, "literal-all", 1).band[1]
    pairs = np.flatnonzero(part["n_cameras"].values == 2)
    best, worst = (pairs[pick(error[pairs])] for pick in (np.argmin, np.argmax))
    labels = part["label"].values
    return (
        f"{len(error)} sets; pairs from {percent_text(error[best])} % ({labels[best]}) to "
        f"{percent_text(error[worst])} % ({labels[worst]}), all four "
        f"{percent_text(error[np.argmax(part['n_cameras'].values)])} %"
    )


def _many(cube: xr.Dataset) -> str:
    part = select(cube, "subsets", 1)
    error = error_bars(cube, "subsets", 1).band[1]
    numbers = part["n_cameras"].values
    few, many = (np.nanmedian(error[numbers == n]) for n in (2, numbers.max()))
    return (
        f"{len(error)} sets of 2 to {numbers.max()} cameras: {percent_text(few)} % in the median "
        f"of the pairs, {percent_text(many)} % with all"
    )


def _coarse(cube: xr.Dataset) -> str:
    texts = []
    for case in dict.fromkeys(cube["case"].values.tolist()):
        last = select(cube, case, 1).isel(setting=-1)
        low, high = last["ratio_band"].values
        texts.append(f"{case} ×{float(last['ratio']):.2f} ({low:.2f}–{high:.2f})")
    return f"{last['n_cameras'].item()} cameras over two at equal pixels: {', '.join(texts)}"


def _higher(cube: xr.Dataset) -> str:
    texts = []
    for mode in cube["mode"].values.tolist():
        texts.append(f"mode {mode}: {_median(cube, 'known', mode)[0]}")
    return f"{', '.join(texts)}, with {select(cube, 'known', mode)['label'].values[0]}"


def _torsion(cube: xr.Dataset) -> str:
    mode = int(cube["mode"].values[-1])
    part = select(cube, "known", mode)
    error = 1e6 * float(part["torsion_standard_error"].values[0])
    size = 1e6 * float(cube["torsion_reference"])
    return f"torsion of {size:.1f} µm at the edges, known to ± {error:.2f} µm in mode {mode}"


def _all(cube: xr.Dataset, quantities: tuple[str, ...]) -> str:
    texts = []
    for case in dict.fromkeys(cube["case"].values.tolist()):
        factors = []
        for mode in cube["mode"].values.tolist():
            for quantity in quantities:
                band = error_bars(cube, case, mode, quantity).band[1]
                if np.isfinite(band).all():
                    factors.append(band[-1] / band[0])
        texts.append(f"{case} ×{np.median(factors):.2f}")
    return "error of the last over that of the first: " + ", ".join(texts)


def _askew(cube: xr.Dataset) -> str:
    (entry,) = [e for e in from_cube(cube) if e.id == "ch3-concluding-t8"]
    return (
        f"that more cameras matter more for them: confidence {entry.confidence:.0%}, "
        f"{entry.verdict}"
    )
