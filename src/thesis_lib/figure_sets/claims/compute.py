"""The cube of the ledger: evidence on trends, alternative interpretations, statistical power.

*Evidence on trends.* A *source* is one or more studies whose errors become
:class:`thesis_lib.ledger.verdicts.Series`. Besides the figure sets there are, for beam and plate:
pairs added in the other order, arcs tilted to the side, cameras added one by one, the aperture at
other distances and elevations; for the beam, layouts that are near or far, low or high, wide or
narrow, of few or many cameras; for the plate, modes whose sum has no symmetry.

*Interpretations.* The thesis leaves some parameters open (``data/thesis/assumptions.toml``). A
*reading* changes one or a few of them in all studies of chapters 3, 4 and 6 that have them;
everything else, including the rule for the verdicts, stays the same.

*Power.* The share of claimed values that are met is compared with two others. *Expected*: if the
thesis were one run of this model, printed with its digits, how many of its values would meet the
same rule? If fewer do, the model is wrong somewhere. *Scaled*: if all errors of the model were
larger or smaller by some factor, how many of the thesis's values would be met? A chapter in which
the factor makes little difference is a weak test.
"""

import hashlib
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, lru_cache, partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from thesis_lib.acoustics.planes import PlateSound
from thesis_lib.acoustics.radiation import Medium
from thesis_lib.arrays import Array, stack_padded
from thesis_lib.facts import claims, setups
from thesis_lib.facts.setups import ADOPTED_READING, READINGS
from thesis_lib.figure_sets.claims.figure_set import Claims
from thesis_lib.figure_sets.cube_file import code_digest, cube_of, read_built
from thesis_lib.figure_sets.parametric import compute as studies
from thesis_lib.figure_sets.parametric.camera_study import CameraStudy
from thesis_lib.figure_sets.parametric.figure_set import CAMERA_STUDIES, camera_study
from thesis_lib.figure_sets.registry import FIGURE_SETS, STUDIES
from thesis_lib.files import cache_folder
from thesis_lib.ledger import verdicts
from thesis_lib.ledger.entries import Entry, Opener, as_cube, explain_differences, list_entries
from thesis_lib.studies import cubes, request, storage
from thesis_lib.studies.schema import label_values, read_variables
from thesis_lib.vibration import structure as structures
from thesis_lib.vision.pinhole import hemisphere_directions

TILTS_DEG = (0, 15, 30, 45)
WIDE_DEG, NARROW_DEG = (30, 40, 50, 60, 70, 80), (3, 5, 7, 9, 11, 13)  # half apertures, of pairs
LOW_DEG, HIGH_DEG, FAR_RATIO = 10, 60, 2
ASKEW_PLATE = "plate-askew"
ASKEW_MODES = (1, 2, 3)  # plate modes whose sum has no plane of symmetry

OWN_VARIABLES = read_variables(__file__, "own_runs")
OWN_COORDINATES = ("source", "quantity", "case", "mode")  # of a series


@dataclass(frozen=True)
class Source:
    """Studies to run, and the mapping of their errors to series."""

    requests: tuple[request.Study, ...]  #: Studies to run
    #: Maps number of the request, case and varied value to case and value of a series
    place: Callable[[int, str, float], tuple[str, float]]

    @property
    def commands(self) -> list[str]:
        """Commands that build the same cubes."""
        return [request.study_command(study) for study in self.requests]

    def read(self, made: Iterable[xr.Dataset]) -> list[verdicts.Series]:
        """Return the series in the cubes of the requests, given in their order."""
        by: dict[verdicts.Key, list[tuple[float, Array]]] = {}
        for number, cube in enumerate(made):
            for one in verdicts.series_of(cube):
                for value, errors in zip(one.values, one.errors, strict=True):
                    case, at = self.place(number, one.case, value)
                    by.setdefault((one.quantity, case, one.mode), []).append((at, errors))
        return [
            verdicts.Series(*key, *(np.array(part, float) for part in zip(*rows, strict=True)))
            for key, rows in by.items()
        ]


def tilt_directions(
    directions_deg: Iterable[tuple[float, float]], tilt_deg: float
) -> list[list[float]]:
    """Turn the directions of an arc about the X axis, as [azimuth, elevation] in degrees.

    Examples
    --------
    >>> tilt_directions([(90.0, 60.0)], 30.0)  # cos 60°, sin 60° sin 30°, sin 60° cos 30°
    [[49.106605, 48.590378]]
    """
    turn = np.radians(tilt_deg)
    x, y, z = hemisphere_directions(*np.radians(list(directions_deg)).T).T
    y, z = y * np.cos(turn) + z * np.sin(turn), z * np.cos(turn) - y * np.sin(turn)
    angles = np.degrees([np.arctan2(x, y), np.arcsin(np.minimum(z, 1.0))])
    return angles.T.round(6).tolist()


def _layouts(structure: str, layouts: dict[str, Any], **more: Any) -> CameraStudy:
    return camera_study(f"{structure}-arrays", {"cases": [], "layouts": layouts, **more})


def _structure_sources(structure: str) -> dict[str, Source]:
    """Return the ledger's own runs for beam or plate."""
    order = camera_study(
        f"{structure}-arrays",
        {"cases": ["4b", "4d"], "pair_order": {"4b": "reversed", "4d": "printed"}},
    )
    pairs = setups.camera_pairs()
    arc = [camera for pair in pairs["4b"] for camera in pair]
    tilts = {f"tilt {tilt}": [tilt_directions(arc, tilt)] for tilt in TILTS_DEG}
    grown = [list(camera) for pair in pairs["4a"] for camera in pair]
    singly = {"4a-singly": [grown[:n] for n in range(2, len(grown) + 1)]}
    distances = setups.setup_table(structure, "distance")["distances_mm"]
    aperture = partial(camera_study, f"{structure}-aperture")
    elevations = setups.setup_table(structure, "aperture")["elevations_deg"]
    other = {"4b": "4b-reversed", "4d": "4d-printed"}
    return {
        f"{structure}-other-order": Source((order,), lambda _, case, n: (other[case], n)),
        f"{structure}-tilted": Source(
            (_layouts(structure, tilts),),
            lambda _, case, n: ("layouts", float(case.removeprefix("tilt "))),
        ),
        f"{structure}-singly": Source((_layouts(structure, singly),), lambda _, case, n: (case, n)),
        f"{structure}-apart": Source(
            tuple(aperture({"distance_mm": d}) for d in distances),
            lambda i, case, alpha: (f"{case} at {distances[i]:g}", alpha),
        ),
        f"{structure}-elevation": Source(
            tuple(aperture({"cases": ["2a", "2c"], "elevation_deg": phi}) for phi in elevations),
            lambda i, case, alpha: (f"{case} {alpha:g}", elevations[i]),
        ),
    }


def _askew(draws: Mapping[str, Any]) -> list[verdicts.Series]:
    """Measure a plate's first mode, and a sum of modes without symmetry, by cameras of case 4a."""
    names = {1: "plain", 2: "askew"}  # in place of modes 1 and 2 of the study
    study = camera_study("plate-arrays", {"cases": ["4a"], "modes": list(names), **draws})
    plate, peak = study.structure, study.peaks_m[0]
    every = [structures.deflection_shape(plate, mode, plate.markers, peak) for mode in ASKEW_MODES]
    plain, askew = every[0], np.sum(every, axis=0)
    shapes = [plain, askew * (np.abs(plain).max() / np.abs(askew).max())]
    cube = studies.run(study, shapes=shapes).assign_attrs(figure_set=ASKEW_PLATE)
    return [replace(one, case=names[one.mode], mode=1) for one in verdicts.series_of(cube)]


def own_sources() -> dict[str, Source]:
    """Return the ledger's own runs, by name, without ``ASKEW_PLATE``."""
    near = setups.setup_table("beam", "arrays")["distance_mm"]
    layouts: dict[str, Any] = {}  # sixteen: few or many, low or high, wide or narrow, near or far
    for n, phi, half in product(("few", "many"), ("low", "high"), ("wide", "narrow")):
        halves = WIDE_DEG if half == "wide" else NARROW_DEG
        pairs = halves if n == "many" else [(halves[2] + halves[3]) / 2]
        elevation = LOW_DEG if phi == "low" else HIGH_DEG
        cameras = [[side * azimuth, elevation] for azimuth in pairs for side in (1, -1)]
        layouts[f"{n} {phi} {half}"] = [cameras]
    corners = tuple(_layouts("beam", layouts, distance_mm=d) for d in (near, FAR_RATIO * near))
    return {
        **_structure_sources("beam"),
        **_structure_sources("plate"),
        "beam-corners": Source(corners, lambda i, case, n: (f"{case} {('near', 'far')[i]}", n)),
    }


def run_layouts(study: Claims) -> xr.Dataset:
    """Compute all own runs as one dataset: ``errors(series, setting, trial)``, padded with NaN."""
    draws = {"trials": study.trials, "seed": study.seed}
    found: list[tuple[str, verdicts.Series]] = []
    for name, source in own_sources().items():
        requests = [camera_study(one.name, {**one.request, **draws}) for one in source.requests]
        runs = [studies.run(one).assign_attrs(figure_set=one.name) for one in requests]
        found += [(name, series) for series in source.read(runs)]
    found += [(ASKEW_PLATE, series) for series in _askew(draws)]
    values = stack_padded(series.values for _, series in found)
    errors = stack_padded(series.errors.astype("float32") for _, series in found)
    rows = ((name, series.quantity, series.case, series.mode) for name, series in found)
    coords = dict(zip(OWN_COORDINATES, zip(*rows, strict=True), strict=True))
    made = {"errors": errors, "values": values}
    return xr.Dataset(label_values(made, OWN_VARIABLES), label_values(coords, OWN_VARIABLES))


def read_own(made: xr.Dataset) -> dict[str, list[verdicts.Series]]:
    """Read the series back from a dataset of :func:`run_layouts`, by the name of the run."""
    by: dict[str, list[verdicts.Series]] = {}
    columns = (made[name].values.tolist() for name in OWN_COORDINATES)
    for row, (source, quantity, case, mode) in enumerate(zip(*columns, strict=True)):
        values, errors = made["values"].values[row], made["errors"].values[row]
        kept = np.isfinite(values)
        series = verdicts.Series(quantity, case, mode, values[kept], errors[kept].astype(float))
        by.setdefault(source, []).append(series)
    return by


SIMULATED_CHAPTERS = (3, 4, 6)
VALUE_OUTCOMES = [one for one in verdicts.VERDICTS if one != verdicts.UNCHANGED]  # claimed values

READING_VARIABLES = read_variables(__file__, "readings")


def reading_parameters(reading: Mapping[str, Any], figure_set: str) -> dict[str, Any]:
    """Return the parameters of an interpretation that a figure set has."""
    fields = CAMERA_STUDIES[figure_set].model_fields
    return {key: value for key, value in reading.items() if key in fields}


def format_command(reading: Mapping[str, Any]) -> str:
    """Return the command that runs chapter 3 under an interpretation."""
    study = camera_study("beam-arrays", reading_parameters(reading, "beam-arrays"))
    return request.study_command(study).replace("beam-arrays", "ch3", 1)


def measure_claimed(study: CameraStudy) -> xr.Dataset:
    """Compute the cube of beam or plate, only for settings with claims on it or its sound."""
    names = {study.name, study.name.replace("plate", "sound")}
    spoken = [claim for name in names for claim in claims.claims_of(name)]
    only = [
        setting
        for setting in study.settings()
        if any(c.applies_to(setting.case, setting.value, setting.pair_order) for c in spoken)
    ]
    return studies.run(study, only=only)


def select_plane_errors(study: Any, plate_cube: xr.Dataset) -> xr.Dataset:
    """Compute the errors on the planes from a plate's cube, as in the cube of its sound."""
    deflections = plate_cube["measured_deflection"]
    errors = []
    for mode, peak in zip(study.modes, study.peaks_m, strict=True):
        sound = _sound(study.structure, study.planes, study.medium, mode, peak)
        errors.append([sound.plane_errors(one) for one in deflections.sel(mode=mode).values])
    cube = plate_cube[["mean_error"]].drop_vars("mean_error")
    dims = ("mode", "setting", "trial", "plane")
    return cube.assign(plane_error=(dims, errors), plane=[plane.name for plane in study.planes])


@lru_cache(maxsize=12)
def _sound(plate: Any, planes: Any, medium: Medium, mode: int, peak: float) -> PlateSound:
    """Return the sound of a mode, cached since many interpretations share it."""
    shape = structures.deflection_shape(plate, mode, plate.markers, peak)
    omega = structures.resonance_frequency(plate, mode)
    return PlateSound.from_shape(plate, planes, medium, omega, shape)


def judge_interpretation(
    reading: Mapping[str, Any], seed: int, trials: int, same: dict[str, Any]
) -> list[verdicts.Check]:
    """Judge all claims of the simulated chapters under one interpretation.

    `same` caches the checks of earlier requests by digest; new ones are added.
    """
    found: list[verdicts.Check] = []
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
            same[study.digest] = verdicts.check_claims(cube, claims.claims_of(name))
        found += same[study.digest]
    return found


def run_readings(study: Claims) -> xr.Dataset:
    """Return the agreement with claimed values under interpretations, the adopted one first.

    ``variables.toml`` has the dimensions and meanings of the variables.
    """
    chosen = list(dict.fromkeys([ADOPTED_READING, *study.readings]))
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "k times the size of a piston")  # the tables show it
        known: dict[str, Any] = {}
        made = [
            judge_interpretation(READINGS[one], study.seed, study.trials, known) for one in chosen
        ]
    simulated = [claim for claim in claims.read_claims() if claim.chapter in SIMULATED_CHAPTERS]
    by_id = [{check.claim.id: check for check in of_reading} for of_reading in made]
    table = [[of.get(claim.id) for claim in simulated] for of in by_id]  # None: it is not run
    outcome = np.array([["undefined" if c is None else c.verdict for c in row] for row in table])
    met = np.array([[c is not None and c.inside for c in row] for row in table])
    both = (outcome != "undefined") & (outcome[0] != "undefined")
    of_chapter = np.equal.outer(SIMULATED_CHAPTERS, [claim.chapter for claim in simulated])
    residual = [
        [
            log_residual([c for c in of_reading if c.claim.chapter == chapter])
            for chapter in SIMULATED_CHAPTERS
        ]
        for of_reading in made
    ]
    values = {
        "reading_claims": np.stack(
            [(outcome == one).astype(int) @ of_chapter.T for one in VALUE_OUTCOMES], axis=-1
        ),
        "reading_inside": met.astype(int) @ of_chapter.T,
        "reading_meets": met.astype(int),
        "gained": np.sum(both & met & ~met[0], axis=1),
        "lost": np.sum(both & ~met & met[0], axis=1),
        "log_residual": residual,
    }
    coords = {
        "reading": chosen,
        "chapter": list(SIMULATED_CHAPTERS),
        "outcome": VALUE_OUTCOMES,
        "value": [claim.id for claim in simulated],
    }
    return xr.Dataset(
        label_values(values, READING_VARIABLES), label_values(coords, READING_VARIABLES)
    )


def log_residual(made: Sequence[verdicts.Check]) -> float:
    """Return the rms of log(median / claimed) over claims that give a value or an interval."""
    ratios = [check.ratio for check in made if check.claim.relation in ("about", "range")]
    return float(np.sqrt(np.mean(np.log(ratios) ** 2))) if ratios else float("nan")


FACTOR_LEVELS = (0.5, 0.7, 1.0, 1.5, 2.0, 3.0)
THESIS_DRAWS = 50  # trials that are judged as if they were the thesis

POWER_VARIABLES = read_variables(__file__, "power")


def judge_claims(open_cube: Opener, own: Mapping[str, Sequence[verdicts.Series]]) -> list[Entry]:
    """Return the ledger's entries, from the cubes of figure sets and the series of its own runs."""
    commands = {name: source.commands for name, source in own_sources().items()}
    return list_entries(open_cube, own, STUDIES, commands)


def input_files(study: Claims) -> list[Path]:
    """Return the files of the cache that hold the ledger's own runs and its interpretations."""
    determines = f"{study.digest} {code_digest(FIGURE_SETS[study.name])}"
    key = hashlib.sha256(determines.encode()).hexdigest()
    return [cache_folder() / f"claims-{part}-{key[:16]}.nc" for part in ("layouts", "readings")]


def load_inputs(study: Claims) -> list[xr.Dataset]:
    """Return the ledger's own runs and its interpretations, computed once and cached."""
    pairs = zip(input_files(study), (run_layouts, run_readings), strict=True)
    return [storage.load_or_compute(path, partial(make, study)) for path, make in pairs]


def run(study: Claims) -> xr.Dataset:
    """Return the ledger's cube; a figure set's cube that is missing or outdated is computed."""
    own, other = load_inputs(study)

    @cache
    def open_named(name: str) -> xr.Dataset:
        made = read_built(STUDIES[name]())
        cube = cube_of(STUDIES[name]()) if isinstance(made, str) else made
        return cube.reset_coords()  # each coordinate costs as much as judging

    judged = judge_claims(lambda one: open_named(one.name), read_own(own))
    tested = compute_power(open_named, claims.read_claims())
    return as_cube(explain_differences(judged, other), other.merge(tested))


def meet_all(claim: claims.Claim, band: Array) -> bool:
    """Return whether bands (2, settings) in % all meet the claim."""
    return all(verdicts.meets_claim(claim, *ends) for ends in band.T)


def compute_power(
    cube_of: Callable[[str], xr.Dataset | str], stated: Sequence[claims.Claim]
) -> xr.Dataset:
    """Count claimed values met, expected to be met, and met by errors of other sizes.

    `cube_of` returns the cube of a figure set, or the reason why there is none. Claims of other
    chapters, and those that cannot be judged, are left out.
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
        expected[at] += np.mean(
            [meet_all(verdicts.claim_from_errors(claim, one), band) for one in trials.T]
        )
        scaled[at] += [meet_all(claim, factor * band) for factor in FACTOR_LEVELS]
    values = {"power_claims": total, "power_expected": expected, "power_scaled": scaled}
    factor = label_values({"factor": list(FACTOR_LEVELS)}, POWER_VARIABLES)
    coords = {"chapter": ("chapter", list(SIMULATED_CHAPTERS)), **factor}
    return xr.Dataset(label_values(values, POWER_VARIABLES), coords)
