"""Tables of structures, of what they radiate, and of requests."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pandas as pd

from thesis_lib.acoustics import planes, radiation
from thesis_lib.acoustics.planes import full_factor
from thesis_lib.book.conclusions.strengths import Cubes
from thesis_lib.facts import setups
from thesis_lib.facts.readings import reading
from thesis_lib.figure_sets.parametric.parameters import camera_study
from thesis_lib.figure_sets.registry import CHAPTERS, STUDIES
from thesis_lib.planning import errors
from thesis_lib.planning.places import at
from thesis_lib.planning.report import command, write_plan
from thesis_lib.planning.request import PlanRequest
from thesis_lib.studies import effort
from thesis_lib.studies.request import Study, describe
from thesis_lib.vibration.structure import (
    Structure,
    modal_overlap,
    peak_deflection,
    resonance,
    single_mode_distance,
)
from thesis_lib.vision import cone_law
from thesis_lib.web.markdown import columns, table

GRAVITY = 9.80665
EXAMPLE = PlanRequest(
    body="plate", plate_mm=(600, 400, 3), counts=[4], resolutions_px=[(1920, 1080)]
)
"""What the planner's page asks for, step by step."""
SMALL_MM = 0.2  # what many a reader's structure moves by


def planned(_: object) -> str:
    """A plan: what is asked, what the command prints, where cameras stand; and a small motion."""
    with TemporaryDirectory() as name:
        said = write_plan(EXAMPLE, Path(name) / "plan")
        cameras = pd.read_csv(Path(name) / "plan" / "plan.csv")
    shown = cameras[["camera", "azimuth_deg", "elevation_deg", "distance_mm"]]
    printed = "\n".join([f"$ {command(EXAMPLE)}", *said])
    rows = [[f"{value:g}".replace("-", "−") for value in row] for row in shown.to_numpy().tolist()]
    size = " by ".join(f"{one:g}" for one in EXAMPLE.plate_mm or ())
    return (
        f"How well can four full-HD cameras measure a plate of {size} mm, of the thesis's "
        f"material, whose largest deflection is {EXAMPLE.amplitude_mm:g} mm (`amplitude_mm`, if "
        "nothing else is asked)? This command was run as this page was made:\n\n"
        f"```console\n{printed}\n```\n\n{table(list(shown), rows)}\n{_of_small_motion(cameras)}"
    )


def _of_small_motion(cameras: pd.DataFrame) -> str:
    """Return what the cameras planned for the example make of a motion far below a pixel."""
    scene = EXAMPLE.scene()
    scene = replace(scene, peaks=(SMALL_MM / 1000,) * len(scene.peaks))
    grid = np.radians(cameras[["azimuth_deg", "elevation_deg"]].to_numpy(float))
    layout = at(grid, cameras["distance_mm"].to_numpy(float) / 1000, scene.focals[0])
    point = errors.predicted(scene, layout, EXAMPLE.resolutions_px[0][0])
    most = float(errors.counted(point, "mean").max())
    return (
        f"Percent are of the largest deflection. Of {SMALL_MM:g} mm whole pixels leave the same "
        f"cameras errors of up to {most:.0f} %. So give your own `amplitude_mm`. Fitted centres "
        "err far less: [this plate and four phones](recordings.md#will-it-do).\n"
    )


def structure_model(structure: Structure, unit: str, scale: float) -> str:
    """What sections 3.1 and 4.1 assume of a structure, mode by mode."""
    rows = []
    for mode in (1, 2, 3):
        omega, hertz = resonance(structure, mode), structure.angular_frequencies(mode) / (2 * np.pi)
        rows.append(
            {
                "mode": str(mode),
                "natural frequency, Hz": f"{hertz[-1]:.4g}",
                f"peak for 1 N, {unit}": f"{scale * peak_deflection(structure, mode):.3g}",
                "modal overlap": f"{float(modal_overlap(structure, omega)):.3f}",
                "one mode against all, %": f"{100 * single_mode_distance(structure, mode):.2g}",
            }
        )
    return columns(rows)


def beam_cameras(_: object) -> str:
    """Lens, sensor and amplitude that the beam's cameras have, unless a study varies them."""
    lens = reading("beam")
    width, height = camera_study("beam-distance").settings()[0].resolution_px
    return (
        f"All cameras have a {lens['focal_length_mm']:g} mm lens on a sensor "
        f"{lens['sensor_width_mm']:g} mm wide, of {width}×{height} pixels unless these are varied, "
        f"and the beam's largest deflection is {lens['amplitude_mm']:g} mm in each mode. The "
        "thesis gives neither lens nor amplitude ([assumptions](assumptions.md)).\n"
    )


def motion_needed(_: Cubes) -> str:
    """How many pixels the largest deflection must move an image, by cameras and wanted error."""
    rows = []
    for count in (2, 3, 4, 8, 12):
        error = float(cone_law.cone_deflection_error(1, 1, count, np.pi / 2))  # of 1 px of motion
        needed = {f"{share:g} %": f"{100 * error / share:.2g} px" for share in (20, 10, 5, 2, 1)}
        rows.append({"cameras": str(count)} | needed)
    return columns(rows)


def markers(opened: Cubes) -> str:
    """κ of independent errors, relative to the antinode's peak, against the number of markers."""
    request = camera_study("sound-distance")
    plane = request.planes[0]  # type: ignore[attr-defined]
    rows, counts, ratios = [], [], []
    for grid in ((12, 8), (15, 10), (24, 16), (36, 24)):
        plate = setups.plate(grid)
        omega = resonance(plate, 1)
        op = planes.operator(plate, plane, omega)
        shape = plate.mode_shapes([1], plate.markers)[0]
        largest = np.max(np.abs(op.field(shape)))
        ratio = np.linalg.norm(full_factor(op)) * plate.shape_peak(1) / largest
        counts.append(plate.markers.shape[1])
        ratios.append(float(ratio))
        rows.append(
            {
                "grid": f"{grid[0]}×{grid[1]}",
                "markers M": str(counts[-1]),
                "κ (mode 1, XZ)": f"{ratio:.4f}",
                "κ √M": f"{ratio * np.sqrt(counts[-1]):.2f}",
            }
        )
    slope = np.polyfit(np.log(counts), np.log(ratios), 1)[0]
    exponent = f"{slope:.3f}".replace("-", "−")
    return columns(rows) + f"\nThe fitted exponent of M is {exponent}.\n"


def levels(opened: Cubes) -> str:
    """Absolute levels: of a force of 1 N, and what the 10 mm of the study would mean."""
    request = camera_study("sound-distance")
    plate = setups.plate()
    parts = planes.pistons(plate)
    peak = f"{1000 * request.peaks_m[0]:g} mm"
    rows = []
    for mode in (1, 2, 3):
        omega = resonance(plate, mode)
        shape = plate.mode_shapes([mode], plate.markers)[0] / plate.shape_peak(mode)
        velocity = omega * peak_deflection(plate, mode) * shape
        power = radiation.sound_power(parts, velocity, omega)
        efficiency = radiation.radiation_efficiency(parts, velocity, omega)
        largest = max(
            np.max(np.abs(planes.operator(plate, plane, omega).field(velocity)))
            for plane in request.planes  # type: ignore[attr-defined]
        )
        meant = request.peaks_m[mode - 1]
        scale = meant / peak_deflection(plate, mode)
        level = float(radiation.pressure_level(largest))
        rows.append(
            {
                "mode": str(mode),
                "radiation efficiency": f"{efficiency:.3f}",
                "sound power in a wall for 1 N, dB": f"{float(radiation.power_level(power)):.0f}",
                "largest pressure level in a wall for 1 N, dB": f"{level:.0f}",
                f"level in a wall for {peak}, dB": f"{level + 20 * np.log10(scale):.0f}",
                f"acceleration for {peak}": f"{omega**2 * meant / GRAVITY:.0f} g",
            }
        )
    return columns(rows)


def effort_table(_: Cubes) -> str:
    """What each figure set costs, as measured in the published run."""
    known = effort.read()
    rows = [
        [f"`{name}`", one.kind, one.time, one.memory, f"{one.cube_mb:.1f} MB"]
        for name in STUDIES
        for one in [known.get(name)]
        if one is not None
    ]
    if not rows:
        return "Nothing was measured yet; `thesis book --publish` does.\n"
    return table(["figure set", "takes", "time", "memory", "cube"], rows)


def parameters(opened: Cubes) -> str:
    """The parameters of every figure set, to be folded out."""
    parts = []
    for name in [name for chapter in CHAPTERS.values() for name in chapter]:
        parts.append(f":::{{dropdown}} `{name}`\n{parameter_table(STUDIES[name])}:::\n")
    return "\n".join(parts)


def parameter_table(model: type[Study], without: Sequence[str] = ()) -> str:
    """Every parameter of a request with its default, unit, meaning and bounds."""
    rows = [
        [f"`{row['name']}`", f"`{row['default']}`", row["unit"], row["meaning"], row["allowed"]]
        for row in describe(model)
        if row["name"] not in without
    ]
    return table(["parameter", "default", "unit", "meaning", "allowed"], rows)
