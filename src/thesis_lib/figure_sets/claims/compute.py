"""The cube of the ledger, and its power: how much the claimed values can tell, by chapter.

A share of claimed values that are met means little without two others. *Expected*: if the thesis
were one run of this model, printed with its digits, how many of its values would meet the same
rule? If fewer do, the model is wrong somewhere. *Scaled*: if all errors of the model were larger or
smaller by some factor, how many of the thesis's values would be met? A chapter in which that makes
little difference tests little.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
import xarray as xr

from thesis_lib.arrays import Array
from thesis_lib.facts import claims
from thesis_lib.facts.claims import Claim
from thesis_lib.figure_sets.claims import own_runs
from thesis_lib.figure_sets.claims.figure_set import Claims
from thesis_lib.figure_sets.cube_file import cube_of, read_built
from thesis_lib.figure_sets.registry import STUDIES
from thesis_lib.ledger import verdicts
from thesis_lib.ledger.entries import Entry, Opener, as_cube, explain_differences, list_entries
from thesis_lib.ledger.verdicts import Series, claim_from_errors, meets_claim
from thesis_lib.studies import cubes
from thesis_lib.studies.request import Study
from thesis_lib.studies.schema import label_values, read_variables

SIMULATED_CHAPTERS = (3, 4, 6)  # simulated
FACTOR_LEVELS = (0.5, 0.7, 1.0, 1.5, 2.0, 3.0)
THESIS_DRAWS = 50  # trials that stand for the thesis

VARIABLES = read_variables(__file__, "power")


def judge_claims(open_cube: Opener, own: Mapping[str, Sequence[Series]]) -> list[Entry]:
    """Return the ledger's entries, from the cubes of figure sets and the series of its own runs."""
    commands = {name: source.commands for name, source in own_runs.own_sources().items()}
    return list_entries(open_cube, own, STUDIES, commands)


def run(request: Claims, own: xr.Dataset, other: xr.Dataset) -> xr.Dataset:
    """Return the ledger's cube; a figure set's cube that is missing or outdated is computed."""
    opened: dict[str, xr.Dataset] = {}

    def open_cube(study: Study) -> xr.Dataset:
        if study.name not in opened:
            made = read_built(study)
            cube = cube_of(study) if isinstance(made, str) else made
            opened[study.name] = cube.reset_coords()  # each coordinate costs as much as judging
        return opened[study.name]

    found = explain_differences(judge_claims(open_cube, own_runs.read_own(own)), other)
    tested = compute_power(lambda name: open_cube(STUDIES[name]()), claims.read_claims())
    return as_cube(found, other.merge(tested))


def meet_all(claim: Claim, band: Array, factor: float = 1.0) -> bool:
    """Return whether bands (2, settings) in %, each times a factor, all meet the claim."""
    return all(meets_claim(claim, *(factor * ends)) for ends in band.T)


def compute_power(
    cube_of: Callable[[str], xr.Dataset | str], stated: Sequence[Claim]
) -> xr.Dataset:
    """Count claimed values met, expected to be met, and met by errors of other sizes.

    `cube_of` returns the cube of a figure set, or why there is none. Claims of other chapters, and
    those that cannot be judged, are left out.
    """
    total, expected = np.zeros(len(SIMULATED_CHAPTERS), int), np.zeros(len(SIMULATED_CHAPTERS))
    scaled = np.zeros((len(SIMULATED_CHAPTERS), len(FACTOR_LEVELS)), int)
    for claim in stated:
        cube = cube_of(claim.figure_set) if claim.chapter in SIMULATED_CHAPTERS else ""
        if isinstance(cube, str) or isinstance(verdicts.judge_claim(cube, claim), str):
            continue
        at = SIMULATED_CHAPTERS.index(claim.chapter)
        errors = verdicts.claim_errors(cube, claim)
        band = cubes.trial_band(errors)[::2]
        trials = errors.transpose("setting", "trial").values[:, 1 : 1 + THESIS_DRAWS]
        total[at] += 1
        expected[at] += np.mean([meet_all(claim_from_errors(claim, one), band) for one in trials.T])
        scaled[at] += [meet_all(claim, band, factor) for factor in FACTOR_LEVELS]
    values = {"power_claims": total, "power_expected": expected, "power_scaled": scaled}
    factor = label_values({"factor": list(FACTOR_LEVELS)}, VARIABLES)
    coords = {"chapter": ("chapter", list(SIMULATED_CHAPTERS)), **factor}
    return xr.Dataset(label_values(values, VARIABLES), coords)
