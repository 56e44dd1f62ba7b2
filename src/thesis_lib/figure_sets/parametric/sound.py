"""The sound of measured deflections: from a plate's cube to a cube of plane errors (thesis 6.2).

The pressure on a plane is linear in the deflection errors e, so its rms error is ω ‖F e‖ with a
small triangular factor F of the plane and the frequency: no trial needs its field.

Two opposed cameras that are aligned with the plate's sides image whole rows of markers on one line
of pixels, and round them alike; turned about the plate's normal by a few degrees, they do not. For
``sound-aperture`` the pairs of case 2d are turned, and their sound is computed as that of
user-defined layouts of ``sound-arrays``.
"""

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
import xarray as xr

from thesis_lib.acoustics import radiation
from thesis_lib.acoustics.planes import Plane, PlateSound, plate_pistons
from thesis_lib.acoustics.radiation import Medium, enough_nodes, integrate_pressure
from thesis_lib.arrays import Array, ComplexArray
from thesis_lib.facts.setups import OPPOSITE_DEG
from thesis_lib.figure_sets.cube_file import cube_of
from thesis_lib.figure_sets.parametric.camera_study import CameraStudy
from thesis_lib.figure_sets.parametric.figure_set import camera_study
from thesis_lib.studies import schema, workers
from thesis_lib.templates import render
from thesis_lib.vibration import structure
from thesis_lib.vision import rounding

VARIABLES = schema.read_variables(__file__, "sound")
COORDINATES = schema.read_variables(__file__, "sound_coordinates")
LISTED_RADIATION_MODES = 5  # at most, of each plane
LEVEL_VARIABLES = schema.read_variables(__file__, "sound_levels")


def deflection_checksum(plate_cube: xr.Dataset) -> str:
    """Return the SHA-256 of the measured deflections that a plate's cube holds."""
    return hashlib.sha256(plate_cube["measured_deflection"].values.tobytes()).hexdigest()


def block_errors(
    block: workers.Block,
    asked: Mapping[str, Any],
    omegas: list[float],
    points: Array,
    factors: Sequence[Sequence[Array]],
    modes: list[list[Array]],
) -> dict[str, Array]:
    """Return rms errors (modes, trials, planes) in Pa of some trials of a setting.

    The block of the first trials adds predictions by the law of rounding, (modes, planes, ...).
    `asked` are the plain values of the study's request. Each mode has ω, points (3, 2, markers) at
    rest and deflected, factors of the planes, and the loudest radiation modes of each plane.
    """
    setting, measured = block.load
    error = measured.astype(float) - points[:, 2, 1][:, None]
    rms = [
        omega * np.stack([np.linalg.norm(e @ F.T, axis=-1) for F in of_planes], axis=-1)
        for omega, e, of_planes in zip(omegas, error, factors, strict=True)
    ]
    results = {"rms": np.stack(rms)}
    if block.trials.start > 0:
        return results
    P = setting.cameras(asked["focal_length_mm"], asked["sensor_width_mm"]).P
    known, noise_px = asked["rest"] == "known", asked["noise_px"]
    rows: dict[str, list[Any]] = {"predicted": [], "coherence": [], "radiated_share": []}
    of_modes = zip(omegas, points.swapaxes(1, 2), factors, modes, strict=True)
    for omega, (rest, bent), of_planes, loudest in of_modes:
        C = rounding.deflection_covariance(P, rest, bent, known, noise_px)
        squares = [np.sum((F @ C) * F) for F in of_planes]
        both = zip(loudest, squares, strict=True)
        rows["predicted"].append([omega * np.sqrt(square) for square in squares])
        rows["coherence"].append([radiation.coherence_ratio(F, C) for F in of_planes])
        rows["radiated_share"].append([radiation.mean_squares(ways, C) / s for ways, s in both])
    return results | {name: np.array(row) for name, row in rows.items()}


def run(
    study: CameraStudy, plate_cube: xr.Dataset | None = None, scheduler: str = ""
) -> xr.Dataset:
    """Compute the cube of a sound study from the plate's cube of the same settings and trials.

    It has errors on the planes XZ and YZ in % of each plane's largest reference pressure (eq. 6.8,
    with the modulus of the complex difference), NaN where a plane is nodal, and of the larger of
    the two, NaN where both are; predicted errors; reference fields and those of the best and worst
    settings. Without `plate_cube` that of the cache is used, and the study of the aperture also has
    the effect of turning its pairs.
    """
    turned = None
    if plate_cube is None:
        own: dict[str, Any] = study.plate_request  # type: ignore[attr-defined]
        plate_cube = cube_of(camera_study(f"plate-{study.study}", own), scheduler)
        if study.study == "aperture":
            turned = cube_of(turn_pairs(study), scheduler)
    plate = study.structure
    assert isinstance(plate, structure.Plate)
    planes: tuple[Plane, ...] = study.planes  # type: ignore[attr-defined]
    medium: Medium = study.medium  # type: ignore[attr-defined]
    reference = plate_cube["reference_deflection"].values
    deflections = plate_cube["measured_deflection"]
    settings, chosen = study.settings(), schema.extreme_settings(plate_cube)
    ends = np.array(list(chosen.values()))  # case, mode, and the best or worst setting
    omegas = [structure.resonance_frequency(plate, mode) for mode in study.modes]
    sounds = [
        PlateSound.from_shape(plate, planes, medium, omega, shape)
        for omega, shape in zip(omegas, reference, strict=True)
    ]
    factors = [one.factors for one in sounds]
    told = min(LISTED_RADIATION_MODES, *(len(F) for of_mode in factors for F in of_mode))
    modes = [[radiation.radiation_modes(F)[:told] for F in of_mode] for of_mode in factors]
    parts = plate_pistons(plate)
    velocities = 1j * np.array(omegas)[:, None] * reference
    moving = [(parts, v, omega, medium) for v, omega in zip(velocities, omegas, strict=True)]
    fields = np.array([one.fields(one.reference) for one in sounds])
    measured = np.empty((*ends.shape, *fields.shape[1:]), "complex64")
    for at in np.ndindex(ends.shape):
        measured[at] = sounds[at[1]].fields(deflections[ends[at], at[1], 0].values)
    largest = np.abs(fields).max(axis=(2, 3))
    norms = np.array([[np.linalg.norm(F) for F in of_mode] for of_mode in factors])
    independent = np.array(omegas)[:, None] * norms
    amplitude = np.max(np.abs(reference), axis=1)[:, None]
    usable = np.array([one.largest for one in sounds])
    greater = np.fmax.reduce(usable, axis=1, keepdims=True)  # NaN if both planes are nodal

    shapes = np.stack([np.zeros_like(reference), reference], axis=1)  # at rest and deflected
    points = np.stack([structure.world_points(plate, both) for both in shapes])
    shared: dict[str, Any] = {"omegas": omegas, "points": points, "factors": factors}
    work = partial(block_errors, asked=study.request, modes=modes, **shared)
    blocks = (
        workers.Block(index, trials, (setting, deflections[index, :, trials].values))
        for index, setting in enumerate(settings)
        for trials in workers.runs_of_trials(study.trials, 8 * reference.size)
    )
    each = len(settings), *usable.shape  # setting, mode, plane
    found = {name: np.empty(each) for name in ("predicted", "coherence")}
    found |= {"rms": np.empty((*each[:2], study.trials + 1, each[2]))}
    found |= {"radiated_share": np.empty((*each, told))}
    for block, results in workers.compute_blocks(work, blocks, scheduler):
        for name, result in results.items():
            found[name][block.place if name == "rms" else block.setting] = result
    values = {
        "plane_error": 100 * found["rms"] / usable[:, None],
        "plane_error_of_larger": 100 * found["rms"] / greater[:, None],
        "predicted_error": 100 * found["predicted"] / usable,
        "coherence": found["coherence"],
        "radiated_share": found["radiated_share"],
        "deflection_error": plate_cube["mean_error"].values,
        "independent_ratio": independent * amplitude / usable,
        "independent_share": np.sum(np.square(modes), axis=-1) / norms[..., None] ** 2,
        "largest_pressure": largest,
        **sum_errors(study, fields, usable),
        "best_and_worst": ends,
        "piston_size": np.array(omegas) / medium.speed_of_sound * max(parts.size),
        "radiation_efficiency": [radiation.radiation_efficiency(*one) for one in moving],
        **schema.split_complex("pressure_reference", fields.astype("complex64")),
        **schema.split_complex("pressure_measured", measured),
    }
    values = {name: values[name] for name in VARIABLES}  # in the order of the table
    lines = ("setting",), ("mode",), ("trial",)
    kept = {str(name): one for name, one in plate_cube.coords.items() if one.dims in lines}
    told_modes = schema.label_values({"radiation_mode": range(1, told + 1)}, COORDINATES)
    coords = {**kept, **schema.field_coordinates(planes, list(chosen)), **told_modes}
    cube = xr.Dataset(schema.label_values(values, VARIABLES), coords)
    cube["predicted_error"].attrs["long_name"] = study.law
    for name in ("in_view", "camera_distance", "camera_azimuth", "camera_elevation"):
        cube[name] = plate_cube[name]
    if study.amplitude_mm == "force":  # only then is the force known, 1 N
        power = np.array([radiation.sound_power(*one) for one in moving])
        levels = {
            "sound_power": power,
            "sound_power_level": radiation.power_level(power),
            "largest_pressure_level": radiation.pressure_level(largest),
        }
        cube = cube.assign(schema.label_values(levels, LEVEL_VARIABLES))
    cube = cube.assign_attrs(deflections_sha256=deflection_checksum(plate_cube))
    return cube if turned is None else cube.assign(compare_turns(study, sounds, turned))


MAX_INTEGRATION_NODES = 40_000  # of an integral; nearer planes, which need more, are left out
# Steps between compared points along each side of a plane, or up to twice as many
COMPARED_STEPS = 74


def sum_errors(study: Any, fields: ComplexArray, largest: Array) -> dict[str, Array]:
    """Compute the rms and largest error of the sum over pistons, in % of the largest pressure.

    `fields` (modes, planes, u, z) are the sums in Pa; `largest` (modes, planes) the largest
    pressures in Pa, NaN where a plane is nodal. The errors (modes, planes) are NaN there, too, and
    where a plane is too near to the plate.
    """
    plate, found = study.structure, np.full((2, *largest.shape), np.nan)
    step = tuple(slice(None, None, max(1, (n - 1) // COMPARED_STEPS)) for n in fields.shape[2:])
    near = np.prod(enough_nodes(plate, study.planes[0].bottom)) > MAX_INTEGRATION_NODES
    for m, (mode, peak) in enumerate(zip(study.modes, study.peaks_m, strict=True)):
        omega = structure.resonance_frequency(plate, mode)
        shape = partial(structure.deflection_shape, plate, mode, peak=peak)
        for p, plane in enumerate(study.planes):
            if near or np.isnan(largest[m, p]):
                continue
            points = plane.points[:, *step]
            whole = 1j * omega * integrate_pressure(plate, shape, points, omega, study.medium)
            off = 100 * np.abs(fields[m, p][step] - whole) / largest[m, p]
            found[:, m, p] = np.sqrt(np.mean(off**2)), np.max(off)
    return {"sum_error": found[0], "sum_error_largest": found[1]}


def audible_planes(cube: xr.Dataset) -> list[tuple[int, str]]:
    """Return the modes and planes of a sound study that have a reference pressure."""
    there = cube["independent_ratio"].notnull().transpose("mode", "plane").values
    modes, planes = cube["mode"].values.tolist(), cube["plane"].values.tolist()
    return [(modes[m], planes[p]) for m, p in np.argwhere(there)]


def compare_sums(opened: Mapping[str, xr.Dataset]) -> str:
    """Compare the sum's error with those of the sharpest and of all cameras."""
    fine, rows = opened["sound-resolution"], []
    sharpest = fine["width_px"].values.argmax()
    for mode, plane in audible_planes(fine):
        one = fine.sel(mode=mode, plane=plane)
        every = [
            opened[f"sound-{study}"]["predicted_error"].sel(mode=mode, plane=plane).values
            for study in ("distance", "aperture", "resolution", "arrays")
        ]
        fields = {"sharpest": one["predicted_error"][sharpest], "errors": np.concatenate(every)}
        rows.append({"one": one, **fields})
    return render(__file__, "sums", rows=rows, width=fine["width_px"].max())


TURNS_DEG = (0.0, 0.5, 1.0, 2.0, 3.0, 5.0)  # simulated
LAW_TURNS_DEG = np.round(np.linspace(0, 5, 101), 2)  # fine: it has dips where rows cross pixels
BEST_DEG = (2.0, 3.0)  # turns that the text recommends: steep cameras err more from 4° on
MAX_TRIALS = 1000  # trials, which give an rms to some percent
TURN_VARIABLES = schema.read_variables(__file__, "sound_turn")


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


def compare_turns(study: Any, sounds: Sequence[PlateSound], turned: xr.Dataset) -> dict[str, Any]:
    """Compute the variables that only ``sound-aperture`` has, from the cube of the turned pairs."""
    plate, elevations, known = study.structure, study.elevations_deg, study.rest == "known"
    settings = turn_pairs(study, LAW_TURNS_DEG.tolist()).settings()
    law_errors = []  # of the field in %, by the law of rounding
    for heard in sounds:
        bent = np.stack([0 * heard.reference, heard.reference])
        rest, bent = np.moveaxis(structure.world_points(plate, bent), 1, 0)
        for setting in settings:
            P = setting.cameras(study.focal_length_mm, study.sensor_width_mm).P
            C = rounding.deflection_covariance(P, rest, bent, known, study.noise_px)
            law_errors.append(heard.expected_plane_errors(C))
    sizes = len(sounds), len(LAW_TURNS_DEG), len(elevations), len(study.planes)

    def by_turn(values: xr.DataArray) -> Any:
        return values.values.reshape(len(TURNS_DEG), len(elevations), *values.shape[1:])

    def rms_of_trials(name: str) -> Any:
        of_trials = turned[name].isel(trial=slice(1, None))
        return by_turn((of_trials**2).mean("trial") ** 0.5)

    values = {
        "turn": TURNS_DEG,
        "elevation": elevations,
        "law_turn": LAW_TURNS_DEG,
        "turned_law_error": np.moveaxis(np.reshape(law_errors, sizes), 0, 2),
        "turned_error": by_turn(turned["predicted_error"]),
        "turned_simulated": rms_of_trials("plane_error"),
        "turned_deflection": rms_of_trials("deflection_error"),
        "turned_coherence": by_turn(turned["coherence"]),
        "turned_share": by_turn(turned["radiated_share"].isel(radiation_mode=0)),
    }
    return schema.label_values(values, TURN_VARIABLES)


def turn_summary(cube: xr.Dataset) -> dict[str, Any]:
    """Return errors of the field over all elevations by turn, and its effect on the shape."""
    rows = []
    for mode, plane in audible_planes(cube):
        one = cube.sel(mode=mode, plane=plane)
        errors = one["turned_error"], one["turned_error"] / one["turned_coherence"]
        error, independent = (np.sqrt((each**2).mean("elevation")) for each in errors)
        row = {"mode": mode, "plane": plane, "error": error, "coherence": error / independent}
        rows.append(row)
    mode, plane = audible_planes(cube)[0]
    part = cube[["turned_error", "turned_share"]].sel(mode=mode, plane=plane)
    before, after = (part.sel(turn=turn) for turn in (0, BEST_DEG[0]))
    at = {"elevation": int((before["turned_error"] - after["turned_error"]).values.argmax())}
    shape = cube["turned_deflection"] / cube["turned_deflection"].sel(turn=0) - 1
    return {
        "rows": rows,
        "before": before.isel(at),
        "after": after.isel(at),
        "shape": 100 * np.abs(shape).max(),
        "elevations": [f"{value:g}°" for value in cube["elevation"].values],
        "advice": turn_advice(cube),
    }


def turn_advice(cube: xr.Dataset) -> str:
    """Return a text on the turns to choose, and on the effect of larger ones on steep cameras."""
    mode, plane = audible_planes(cube)[0]
    at = {"mode": mode, "plane": plane}
    steep = cube["turned_law_error"].sel(at | {"elevation": float(cube["elevation"].max())})
    largest = LAW_TURNS_DEG[-1]
    text = render(__file__, "turn-advice", turns=BEST_DEG, steep=steep, largest=largest, **at)
    return " ".join(text.split())
