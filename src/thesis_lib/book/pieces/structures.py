"""Values of structures, the law of rounding, sound radiation, and a planned layout."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pandas as pd

from thesis_lib.acoustics import planes, radiation
from thesis_lib.book.pieces.opened import Cubes
from thesis_lib.facts import setups
from thesis_lib.figure_sets.parametric.figure_set import camera_study
from thesis_lib.figure_sets.registry import STUDIES
from thesis_lib.planning import errors, positions, report, request
from thesis_lib.studies import effort
from thesis_lib.templates import render
from thesis_lib.vibration import structure as structures
from thesis_lib.vision import cone_law, pinhole, rounding, triangulation

GRAVITY = 9.80665
EXAMPLE_MODES = (1, 2, 3)
MARKER_GRIDS = ((12, 8), (15, 10), (24, 16), (36, 24))
EXAMPLE_PLAN = request.PlanRequest(
    body="plate", plate_mm=(600, 400, 3), counts=[4], resolutions_px=[(1920, 1080)]
)
"""The request that the planner's page makes, step by step."""
SMALL_MM = 0.2  # the largest deflection of many real structures


def show_plan(_: Cubes) -> str:
    """Show a plan: command, output, camera positions; and its error for a small motion."""
    with TemporaryDirectory() as name:
        printed = report.write_plan(EXAMPLE_PLAN, Path(name) / "plan")
        cameras = pd.read_csv(Path(name) / "plan" / "plan.csv")
    scene = EXAMPLE_PLAN.scene()  # but with a motion far below a pixel
    scene = replace(scene, peaks=(SMALL_MM / 1000,) * len(scene.peaks))
    grid = np.radians(cameras[["azimuth_deg", "elevation_deg"]].to_numpy(float))
    distances_m = cameras["distance_mm"].to_numpy(float) / 1000
    layout = positions.combine_positions(grid, distances_m, scene.focals[0])
    point = errors.predict_errors(scene, layout, EXAMPLE_PLAN.resolutions_px[0][0])
    return render(
        __file__,
        "planner-example",
        sizes_mm=EXAMPLE_PLAN.plate_mm,
        amplitude_mm=EXAMPLE_PLAN.amplitude_mm,
        command=report.plan_command(EXAMPLE_PLAN),
        printed=printed,
        cameras=cameras[["camera", "azimuth_deg", "elevation_deg", "distance_mm"]],
        small_mm=SMALL_MM,
        small_error_percent=errors.objective_error(point, "mean").max(),
    )


def tabulate_modes(structure: structures.Structure, unit: str, scale: float) -> str:
    """Tabulate the model of a structure in sections 3.1 and 4.1, mode by mode."""
    rows = []
    for mode in EXAMPLE_MODES:
        hertz = structure.angular_frequencies(mode)[-1] / (2 * np.pi)
        peak = structures.peak_deflection(structure, mode) * scale
        omega = structures.resonance_frequency(structure, mode)
        overlap = structures.modal_overlap(structure, omega)
        rows.append((mode, hertz, peak, overlap, structures.single_mode_distance(structure, mode)))
    return render(__file__, "structure-model", rows=rows, unit=unit)


def describe_beam_cameras(_: Cubes) -> str:
    """Describe lens, sensor and amplitude of the beam's cameras, unless a study varies them."""
    width, height = camera_study("beam-distance").settings()[0].resolution_px
    return render(
        __file__, "beam-cameras", lens=setups.assumed_values("beam"), width=width, height=height
    )


def tabulate_motion(_: Cubes) -> str:
    """Tabulate the image motion in px that is needed, by number of cameras and error."""
    of_one_px = [  # of a motion of 1 px
        (count, float(cone_law.cone_deflection_error(1, 1, count, np.pi / 2)))
        for count in (2, 3, 4, 8, 12)
    ]
    return render(__file__, "motion-needed", errors=of_one_px, shares=(20, 10, 5, 2, 1))


def tabulate_marker_grids(_: Cubes) -> str:
    """Tabulate κ of independent errors, relative to the antinode's peak, by number of markers."""
    plane = camera_study("sound-distance").planes[0]  # type: ignore[attr-defined]
    rows = []
    for grid in MARKER_GRIDS:
        plate = setups.thesis_plate(grid)
        operator = planes.plane_operator(plate, plane, structures.resonance_frequency(plate, 1))
        shape = plate.mode_shapes([1], plate.markers)[0]
        largest = np.max(np.abs(operator.field(shape)))
        ratio = float(np.linalg.norm(planes.full_factor(operator)) * plate.shape_peak(1) / largest)
        rows.append((grid, plate.markers.shape[1], ratio))
    counts, ratios = np.array([row[1:] for row in rows]).T
    exponent = np.polyfit(np.log(counts), np.log(ratios), 1)[0]
    return render(__file__, "sound-markers", rows=rows, exponent=exponent)


def tabulate_levels(_: Cubes) -> str:
    """Tabulate sound levels of a force of 1 N, and level and acceleration at the study's 10 mm."""
    request, plate = camera_study("sound-distance"), setups.thesis_plate()
    parts = planes.plate_pistons(plate)
    rows = []
    for mode in EXAMPLE_MODES:
        omega = structures.resonance_frequency(plate, mode)
        peak = structures.peak_deflection(plate, mode)
        velocity = omega * peak * plate.mode_shapes([mode], plate.markers)[0]
        velocity = velocity / plate.shape_peak(mode)
        largest = max(
            np.max(np.abs(planes.plane_operator(plate, plane, omega).field(velocity)))
            for plane in request.planes  # type: ignore[attr-defined]
        )
        of_study, level = request.peaks_m[mode - 1], float(radiation.pressure_level(largest))
        efficiency = radiation.radiation_efficiency(parts, velocity, omega)
        power_db = radiation.power_level(radiation.sound_power(parts, velocity, omega))
        study_db = level + 20 * np.log10(of_study / peak)
        acceleration_g = omega**2 * of_study / GRAVITY
        rows.append((mode, efficiency, power_db, level, study_db, acceleration_g))
    return render(__file__, "sound-levels", rows=rows, peak_mm=1000 * request.peaks_m[0])


def tabulate_costs(_: Cubes) -> str:
    """Tabulate time and memory of each figure set in the published run."""
    known = effort.read_efforts()
    costs = [(name, known[name]) for name in STUDIES if name in known]
    return render(__file__, "effort", costs=costs)


ROUNDING_SET = "beam-distance"


def describe_example(opened: Cubes) -> str:
    """Evaluate the law for the last marker, the first mode and setting of ``beam-distance``."""
    cube, study = opened[ROUNDING_SET].isel(setting=0, mode=0, point=-1), camera_study(ROUNDING_SET)
    setting, structure = study.settings()[0], study.structure
    cameras = setting.cameras(study.focal_length_mm, study.sensor_width_mm)
    shape = structures.deflection_shape(structure, 1, structure.markers, study.peaks_m[0])
    rest, deflected = (structures.world_points(structure, w)[:, -1] for w in (0 * shape, shape))
    moved = pinhole.project(cameras.P, deflected) - pinhole.project(cameras.P, rest)
    variance = rounding.difference_variance(moved)
    g = 1e3 * triangulation.triangulation_gain(cameras.P, deflected)[2]
    rows = [
        dict(camera=i + 1, axis=axis, moved=moved[i, j], variance=variance[i, j], gain=g[i, j])
        for i in range(len(moved))
        for j, axis in enumerate("uv")
    ]
    errors = 1e3 * (cube["measured_deflection"] - cube["reference_deflection"]).values[1:]
    return render(
        __file__,
        "rounding-example",
        marker=len(shape),
        moves_mm=1e3 * shape[-1],
        distance_mm=setting.distance_mm,
        figure_set=ROUNDING_SET,
        rows=rows,
        total=np.sum(g**2 * variance),
        law_mm=1e3 * np.sqrt(rounding.deflection_variance(cameras.P, rest, deflected)),
        trials=len(errors),
        rms_mm=np.sqrt(np.mean(errors**2)),
    )


PIECES: dict[str, Callable[[Cubes], str]] = {
    "planner-example": show_plan,
    "beam-model": lambda _: tabulate_modes(setups.thesis_beam(), "mm", 1e3),
    "beam-cameras": describe_beam_cameras,
    "plate-model": lambda _: tabulate_modes(setups.thesis_plate(), "nm", 1e9),
    "sound-markers": tabulate_marker_grids,
    "motion-needed": tabulate_motion,
    "sound-levels": tabulate_levels,
    "effort": tabulate_costs,
    "rounding-example": describe_example,
}
