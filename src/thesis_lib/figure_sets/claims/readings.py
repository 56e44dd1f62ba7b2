"""Effect of the interpretation: the claims of chapters 3, 4 and 6 under other interpretations.

What the thesis leaves open (``data/thesis/assumptions.toml``) can be taken otherwise. A *reading*
changes one such parameter, or a few, in all studies that have it; everything else, the rule for the
verdicts included, stays.
"""

from __future__ import annotations

import warnings
from collections import Counter
from collections.abc import Sequence
from functools import lru_cache, partial
from typing import Any

import numpy as np
import xarray as xr

from thesis_lib.acoustics.planes import PlateSound
from thesis_lib.acoustics.radiation import Medium
from thesis_lib.facts.claims import claims_of, read_claims
from thesis_lib.facts.setups import ADOPTED_READING, READINGS, Reading
from thesis_lib.figure_sets.claims.figure_set import OtherReadings
from thesis_lib.figure_sets.parametric import compute as studies
from thesis_lib.figure_sets.parametric.camera_study import CameraStudy
from thesis_lib.figure_sets.parametric.figure_set import CAMERA_STUDIES, camera_study
from thesis_lib.ledger import verdicts
from thesis_lib.ledger.verdicts import UNCHANGED, VERDICTS, Check
from thesis_lib.studies.request import study_command
from thesis_lib.studies.schema import label_values, read_variables
from thesis_lib.studies.workers import map_in_pairs
from thesis_lib.vibration.structure import Plate, deflection_shape, resonance_frequency

CHAPTER_OF_GROUP = {"beam": 3, "plate": 4, "sound": 6}
VALUE_OUTCOMES = tuple(one for one in VERDICTS if one != UNCHANGED)  # of stated values

VARIABLES = read_variables(__file__, "readings")


def reading_parameters(reading: Reading, figure_set: str) -> dict[str, Any]:
    """Return the parameters that a figure set takes of an interpretation."""
    fields = CAMERA_STUDIES[figure_set].model_fields
    return {key: value for key, value in reading.values.items() if key in fields}


def format_command(reading: Reading) -> str:
    """Return the command that runs chapter 3 under an interpretation."""
    study = camera_study("beam-arrays", reading_parameters(reading, "beam-arrays"))
    return study_command(study).replace("beam-arrays", "ch3", 1)


def measure_claimed(study: CameraStudy) -> xr.Dataset:
    """Return the cube of beam or plate, only of settings that claims on it or its sound name."""
    names = {study.name, study.name.replace("plate", "sound")}
    spoken = [claim for name in names for claim in claims_of(name)]
    only = [
        setting
        for setting in study.settings()
        if any(c.speaks_of(setting.case, setting.value, setting.pair_order) for c in spoken)
    ]
    return studies.run(study, only=only)


def select_plane_errors(study: Any, plate_cube: xr.Dataset) -> xr.Dataset:
    """Return only the errors on the planes, as in the cube of a plate's sound."""
    deflections = plate_cube["measured_deflection"]
    errors = []
    for mode, peak in zip(study.modes, study.peaks_m, strict=True):
        sound = _sound(study.structure, study.planes, study.medium, mode, peak)
        errors.append([sound.plane_errors(one) for one in deflections.sel(mode=mode).values])
    cube = plate_cube[["mean_error"]].drop_vars("mean_error")
    dims = ("mode", "setting", "trial", "plane")
    return cube.assign(plane_error=(dims, errors), plane=[plane.name for plane in study.planes])


@lru_cache(maxsize=12)
def _sound(plate: Plate, planes: Any, medium: Medium, mode: int, peak: float) -> PlateSound:
    """Return the sound of a mode, which many interpretations share."""
    shape = deflection_shape(plate, mode, plate.markers, peak)
    return PlateSound.from_shape(plate, planes, medium, resonance_frequency(plate, mode), shape)


def judge_interpretation(
    reading: Reading, seed: int, trials: int, same: dict[str, Any]
) -> list[Check]:
    """Judge all claims of the simulated chapters under one interpretation.

    Parameters
    ----------
    reading : Reading
        What to change.
    seed, trials : int
        Of all studies.
    same : dict
        Checks of requests that have been made before, by digest; new ones are added.
    """
    found: list[Check] = []
    plates: dict[str, xr.Dataset] = {}
    for name in CAMERA_STUDIES:
        values = {**reading_parameters(reading, name), "seed": seed, "trials": trials}
        study = camera_study(name, values)
        if study.digest not in same:
            if study.subject == "sound":
                plate = name.replace("sound", "plate")
                if plate not in plates:
                    of_plate: dict[str, Any] = study.plate_request  # type: ignore[attr-defined]
                    plates[plate] = measure_claimed(camera_study(plate, of_plate))
                cube = select_plane_errors(study, plates[plate])
            else:
                cube = plates[name] = measure_claimed(study)
            same[study.digest] = verdicts.check_claims(cube, claims_of(name))
        found += same[study.digest]
    return found


def run(study: OtherReadings) -> xr.Dataset:
    """Return the agreement with the stated values under several readings, the adopted one first.

    Returns
    -------
    xarray.Dataset
        ``reading_claims(reading, chapter, outcome)``: number of claims; ``reading_inside(reading,
        chapter)``: how many of them the band of the trials meets; ``reading_meets(reading,
        value)``: which; ``gained(reading)`` and
        ``lost(reading)`` of them against the adopted reading; ``log_residual(reading, chapter)``:
        rms natural logarithm of median over stated, of claims with one value or an interval.
    """
    chosen = [READINGS[name] for name in dict.fromkeys([ADOPTED_READING, *study.readings])]
    seed, trials = study.seed, study.trials
    same: dict[str, Any] = {}
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "k times the size of a piston")  # the tables say so
        judge = partial(judge_interpretation, seed=seed, trials=trials, same=same)
        made = [judge(chosen[0])]  # first alone: the others share with it
        made += map_in_pairs(judge, chosen[1:])
    chapters = list(CHAPTER_OF_GROUP.values())
    shape = (len(chosen), len(chapters))
    counts = np.zeros((*shape, len(VALUE_OUTCOMES)), int)
    inside, residual = np.zeros(shape, int), np.full(shape, np.nan)
    gained, lost = np.zeros(len(chosen), int), np.zeros(len(chosen), int)
    simulated = [claim for claim in read_claims() if claim.chapter in chapters]
    stated = Counter(claim.chapter for claim in simulated)
    met = [{check.claim.id: check.inside for check in of_reading} for of_reading in made]
    for r, of_reading in enumerate(made):
        both = met[r].keys() & met[0].keys()
        gained[r] = sum(met[r][name] and not met[0][name] for name in both)
        lost[r] = sum(met[0][name] and not met[r][name] for name in both)
        for c, chapter in enumerate(chapters):
            part = [check for check in of_reading if check.claim.chapter == chapter]
            counts[r, c] = [sum(check.verdict == v for check in part) for v in VALUE_OUTCOMES]
            counts[r, c, -1] = stated[chapter] - len(part)  # undefined: that setting is not run
            inside[r, c] = sum(check.inside for check in part)
            residual[r, c] = log_residual(part)
    values = {
        "reading_claims": counts,
        "reading_inside": inside,
        "reading_meets": [[int(of.get(c.id, False)) for c in simulated] for of in met],
        "gained": gained,
        "lost": lost,
        "log_residual": residual,
    }
    coords = {
        "reading": [reading.name for reading in chosen],
        "chapter": chapters,
        "outcome": list(VALUE_OUTCOMES),
        "value": [claim.id for claim in simulated],
    }
    return xr.Dataset(label_values(values, VARIABLES), label_values(coords, VARIABLES))


def log_residual(made: Sequence[Check]) -> float:
    """Return the rms of log(median / stated) over claims that give a value or an interval."""
    ratios = [check.ratio for check in made if check.claim.relation in ("about", "range")]
    return float(np.sqrt(np.mean(np.log(ratios) ** 2))) if ratios else float("nan")
