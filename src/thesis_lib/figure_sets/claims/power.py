"""What the stated values could have told: the power of the ledger, chapter by chapter.

A share of figures met says little without two others. *Expected*: were the thesis itself one run of
this model, printed with its digits, how many of its figures would the same rule call met? Fewer
than that met means that the model is wrong somewhere. *Scaled*: were all errors of the model some
factor larger or smaller than they are, how many of the thesis's figures would be met? A chapter in
which that makes little difference tests little.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import xarray as xr

from thesis_lib.arrays import Array
from thesis_lib.facts.claims import Claim
from thesis_lib.ledger import verdicts
from thesis_lib.ledger.verdicts import drawn, meets
from thesis_lib.studies import cubes
from thesis_lib.studies.variables import declared, labelled
from thesis_lib.web.markdown import table

CHAPTERS = (3, 4, 6)  # simulated
FACTORS = (0.5, 0.7, 1.0, 1.5, 2.0, 3.0)
DRAWS = 50  # trials that stand for the thesis

VARIABLES = declared("""
    power_claims(chapter) [1] stated values
    power_expected(chapter) [1] stated values met if the thesis were a draw of the model
    power_scaled(chapter, factor) [1] stated values met by errors times a factor
    factor(factor) [1] factor of all errors of the model
""")


def met(claim: Claim, band: Array, factor: float = 1.0) -> bool:
    """Whether bands (2, settings) in %, each times a factor, all meet the claim."""
    return all(meets(claim, *(factor * ends)) for ends in band.T)


def power(cube_of: Callable[[str], xr.Dataset | str], stated: Sequence[Claim]) -> xr.Dataset:
    """Numbers of stated values met, expected to be met, and met by errors of other sizes.

    `cube_of` gives the cube of a figure set, or why there is none. Claims of other chapters, and
    what cannot be judged, are left out.
    """
    total, expected = np.zeros(len(CHAPTERS), int), np.zeros(len(CHAPTERS))
    scaled = np.zeros((len(CHAPTERS), len(FACTORS)), int)
    for claim in stated:
        cube = cube_of(claim.figure_set) if claim.chapter in CHAPTERS else ""
        if isinstance(cube, str) or isinstance(verdicts.judge(cube, claim), str):
            continue
        at = CHAPTERS.index(claim.chapter)
        errors = verdicts.errors(cube, claim)
        band = cubes.band(errors)[::2]
        trials = errors.transpose("setting", "trial").values[:, 1 : 1 + DRAWS]
        total[at] += 1
        expected[at] += np.mean([met(drawn(claim, one), band) for one in trials.T])
        scaled[at] += [met(claim, band, factor) for factor in FACTORS]
    values = {"power_claims": total, "power_expected": expected, "power_scaled": scaled}
    factor = labelled({"factor": list(FACTORS)}, VARIABLES)
    coords = {"chapter": ("chapter", list(CHAPTERS)), **factor}
    return xr.Dataset(labelled(values, VARIABLES), coords)


def powers(cube: xr.Dataset) -> str:
    """The ledger's power as a table, and in a sentence."""
    total, expected = cube["power_claims"].values, cube["power_expected"].values
    scaled = cube["power_scaled"].transpose("chapter", "factor").values
    own = int(np.flatnonzero(cube["factor"].values == 1)[0])
    rows = [
        [
            f"chapter {chapter}",
            str(n),
            f"{real[own] / n:.0%}",
            f"{draw / n:.1%}",
            f"{n - real[own]} ({n - draw:.0f})",
            *(f"{k / n:.0%}" for k in real),
        ]
        for chapter, n, draw, real in zip(
            cube["chapter"].values, total, expected, scaled, strict=True
        )
        if n
    ]
    header = [
        "",
        "values",
        "met",
        "expected",
        "misses (expected)",
        *(f"errors ×{factor:g}" for factor in cube["factor"].values),
    ]
    n, every = int(total.sum()), float(expected.sum())
    return table(header, rows) + (
        f"\nIn all {scaled[:, own].sum()} of {n} are met, and {every / n:.1%} would be if the "
        "thesis were one run of this model, printed with its digits.\n"
    )
