"""Effect of a turn by a few degrees on the sound that two opposed cameras measure.

A pair that stands square to the plate images whole rows of markers on one line of pixels, and
rounds them alike; turned about the plate's normal, it does not. The pairs of case 2d are turned,
measured and radiated as in ``sound-arrays``, where they are a reader's own layouts.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
import xarray as xr

from thesis_lib.acoustics.planes import PlateSound
from thesis_lib.arrays import Array
from thesis_lib.facts.setups import OPPOSITE_DEG
from thesis_lib.figure_sets.parametric import sound
from thesis_lib.figure_sets.parametric.camera_study import CameraStudy
from thesis_lib.figure_sets.parametric.figure_set import camera_study
from thesis_lib.figure_sets.parametric.sound import audible_planes
from thesis_lib.studies.schema import label_values, read_variables
from thesis_lib.templates import render
from thesis_lib.vibration.structure import resonance_frequency, world_points
from thesis_lib.vision import rounding

TURNS_DEG = (0.0, 0.5, 1.0, 2.0, 3.0, 5.0)  # simulated
LAW_TURNS_DEG = np.round(np.linspace(0, 5, 101), 2)  # where rows cross pixels the law has its dips
BEST_DEG = (2.0, 3.0)  # turns that the text recommends: steep cameras err more from 4° on
MAX_TRIALS = 1000  # trials, which know an rms to some percent
VARIABLES = read_variables(__file__, "sound_turn")


def turn_pairs(asked: Any, turns: Iterable[float] = TURNS_DEG) -> CameraStudy:
    """Return the study whose layouts are the pairs of case 2d, each turned by every angle."""
    values = asked.model_dump()
    common = {name: values[name] for name in camera_study("sound-arrays").request if name in values}
    layouts = {
        f"{number}: {elevation:g}°, {turn:g}°": [
            [(azimuth + turn, elevation) for azimuth in OPPOSITE_DEG["2d"]]
        ]
        for turn in turns
        for number, elevation in enumerate(values["elevations_deg"])
    }
    own = {"cases": [], "layouts": layouts, "trials": min(values["trials"], MAX_TRIALS), "cube": ""}
    return camera_study("sound-arrays", common | own)


def law_errors(study: Any, reference: Array) -> Array:
    """Return field errors (turns, elevations, modes, planes) in % by the law of rounding.

    Parameters
    ----------
    study : Study
        The request of ``sound-aperture``.
    reference : ndarray, shape (modes, markers)
        True deflections in m.
    """
    plate, known = study.structure, study.rest == "known"
    settings = turn_pairs(study, LAW_TURNS_DEG.tolist()).settings()
    found = []
    for mode, shape in zip(study.modes, reference, strict=True):
        heard_ = PlateSound.from_shape(
            plate, study.planes, study.medium, resonance_frequency(plate, mode), shape
        )
        rest, bent = np.moveaxis(world_points(plate, np.stack([0 * shape, shape])), 1, 0)
        for setting in settings:
            P = setting.cameras(study.focal_length_mm, study.sensor_width_mm).P
            C = rounding.deflection_covariance(P, rest, bent, known, study.noise_px)
            found.append(heard_.expected_plane_errors(C))
    by_mode = np.reshape(found, (len(reference), len(LAW_TURNS_DEG), -1, len(study.planes)))
    return np.moveaxis(by_mode, 0, 2)


def run(
    study: CameraStudy, plate_cube: xr.Dataset, turned: xr.Dataset, scheduler: str = ""
) -> xr.Dataset:
    """Compute the cube of ``sound-aperture``: that of :func:`.sound.run`, with turned pairs."""
    plain = sound.run(study, plate_cube, scheduler)
    elevations = study.elevations_deg  # type: ignore[attr-defined]

    def by_turn(values: xr.DataArray) -> Any:
        return values.values.reshape(len(TURNS_DEG), len(elevations), *values.shape[1:])

    def rms_of_trials(name: str) -> Any:
        of_trials = turned[name].isel(trial=slice(1, None))
        return by_turn((of_trials**2).mean("trial") ** 0.5)

    values = {
        "turn": TURNS_DEG,
        "elevation": elevations,
        "law_turn": LAW_TURNS_DEG,
        "turned_law_error": law_errors(study, plate_cube["reference_deflection"].values),
        "turned_error": by_turn(turned["predicted_error"]),
        "turned_simulated": rms_of_trials("plane_error"),
        "turned_deflection": rms_of_trials("deflection_error"),
        "turned_coherence": by_turn(turned["coherence"]),
        "turned_share": by_turn(turned["radiated_share"].isel(radiation_mode=0)),
    }
    return plain.assign(label_values(values, VARIABLES))


def turn_summary(cube: xr.Dataset) -> dict[str, Any]:
    """Return errors of the field over all elevations by turn, and its effect on the shape."""
    rows = []
    for mode, plane in audible_planes(cube):
        one = cube[["turned_error", "turned_coherence"]].sel(mode=mode, plane=plane)
        rms = np.sqrt((one**2).mean("elevation"))
        error, coherence = rms["turned_error"], rms["turned_coherence"]
        rows.append({"mode": mode, "plane": plane, "error": error, "coherence": coherence})
    mode, plane = audible_planes(cube)[0]
    part = cube[["turned_error", "turned_share"]].sel(mode=mode, plane=plane)
    before, after = (part.sel(turn=turn) for turn in (0, BEST_DEG[0]))
    at = {"elevation": int((before["turned_error"] - after["turned_error"]).values.argmax())}
    shape = cube["turned_deflection"] / cube["turned_deflection"].sel(turn=0) - 1
    return {
        "rows": rows,
        "mode": mode,
        "plane": plane,
        "turn": BEST_DEG[0],
        "before": before.isel(at),
        "after": after.isel(at),
        "shape": 100 * np.abs(shape).max(),
        "elevations": [f"{value:g}°" for value in cube["elevation"].values],
        "advice": turn_advice(cube),
    }


def turn_advice(cube: xr.Dataset) -> str:
    """State the turns to choose, and the effect of larger ones on steep cameras."""
    mode, plane = audible_planes(cube)[0]
    steep = cube["turned_law_error"].sel(
        mode=mode, plane=plane, elevation=float(cube["elevation"].max())
    )
    text = render(
        __file__,
        "turn-advice",
        turns=BEST_DEG,
        steep=steep,
        largest=LAW_TURNS_DEG[-1],
        mode=mode,
        plane=plane,
    )
    return " ".join(text.split())
