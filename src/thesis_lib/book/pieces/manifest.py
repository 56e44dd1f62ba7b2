"""Own recordings: manifests, warnings, numbers that help to film, and the example's report.

The report is no page of Sphinx: it loads nothing, and is the file that a user would get.
"""

import json
import shlex
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel

from thesis_lib.figure_sets import record
from thesis_lib.files import whole_text
from thesis_lib.laboratory.recording_files import example_manifest, example_rig
from thesis_lib.measure import messages
from thesis_lib.measure.feasibility import assess
from thesis_lib.measure.feasibility.prediction import draft_manifest
from thesis_lib.measure.fitting.result import known_rms
from thesis_lib.measure.recordings import manifest_parts
from thesis_lib.measure.recordings.board import BoardSpec, MarkersSpec
from thesis_lib.measure.recordings.manifest import CameraFiles, Manifest
from thesis_lib.measure.report import build, figures, warnings
from thesis_lib.plotting.style import figure_svg
from thesis_lib.studies.fields import describe_allowed, unit_of_field
from thesis_lib.templates import render
from thesis_lib.vibration.motion import fold_frequency
from thesis_lib.vision import cone_law
from thesis_lib.vision.optics import depth_of_field

SAMPLE_PAGE = "sample-report.html"
SHAPE_FIGURE = "guide-shape.svg"
SAMPLE_FILES = (SAMPLE_PAGE, SHAPE_FIGURE)


def write_sample(folder: Path) -> None:
    """Write the report on the shipped example into a folder, and a figure of it for the guide."""
    data = record.read_sample()
    manifest = record.manifest_of(data)
    frames, assessed = record.first_frames(), assess.assess_manifest(manifest)
    whole_text(folder / SAMPLE_PAGE, build.build_shape(data, data, manifest, assessed, frames).page)
    whole_text(folder / SHAPE_FIGURE, figure_svg(figures.draw_shape(data, manifest)))


def format_sample_summary() -> str:
    """Format the last lines that the measurement of the example prints, as a block of text."""
    data = record.read_sample()
    notes = [f"note: {note.text} [{note.code}]" for note in warnings.check_shape(data)]
    return "\n".join(["```text", *build.summarise_shape(data), *notes, "```", ""])


def compare_smallest_deflection() -> str:
    """Compare the predicted smallest deflection of the example with the measured one."""
    data = record.read_sample()
    predicted_mm = assess.assess_manifest(record.manifest_of(data)).rig.smallest_mm
    measured_mm = 3 * known_rms(1000 * data["standard_error"].values)
    return render(__file__, "guide-counted", predicted_mm=predicted_mm, measured_mm=measured_mm)


MANIFEST_PARTS: dict[str, type[BaseModel]] = {
    "manifest": Manifest,
    "structure": manifest_parts.StructureSpec,
    "markers": MarkersSpec,
    "cameras": CameraFiles,
    "board": BoardSpec,
    "excitation": manifest_parts.Excitation,
    "calibration": manifest_parts.Reuse,
    "radiation": manifest_parts.Radiation,
    "modes": manifest_parts.Sought,
    "force": manifest_parts.Force,
    "sweep": manifest_parts.Sweep,
}

GROUP_OF_PIECE = {
    "notes": "shape",
    "notes-modes": "modes",
    "notes-sound": "sound",
    "notes-force": "force",
}
"""By piece of the page: the group of notes that it lists."""


def list_fields(part: str) -> str:
    """List the fields of a part of the manifest, as a Markdown definition list.

    Parameters
    ----------
    part : str
        A name of :data:`MANIFEST_PARTS`.
    """
    model = MANIFEST_PARTS[part]
    fields = [
        {
            "name": name,
            "default": _format_default(model, name),
            "meaning": field.description,
            "allowed": describe_allowed(model, name),
        }
        for name, field in model.model_fields.items()
    ]
    return render(__file__, "record-fields", fields=fields)


def _format_default(model: type[BaseModel], name: str) -> str:
    """Return a field's default with its unit, or that it is required."""
    if model.model_fields[name].is_required():
        return "required" + (f", in {unit_of_field(name)}" if unit_of_field(name) else "")
    required = any(field.is_required() for field in model.model_fields.values())
    whole: Any = None if required else model()
    field = model.model_fields[name]
    value = getattr(whole, name) if whole else field.get_default(call_default_factory=True)
    if isinstance(value, BaseModel):
        return "its fields below"
    if value is None:
        return "null" + (f", else in {unit_of_field(name)}" if unit_of_field(name) else "")
    return f"{_format_value(value)} {unit_of_field(name)}".rstrip()


def _format_value(value: Any) -> str:
    """Return a value as it stands in YAML."""
    if isinstance(value, tuple):
        return f"[{', '.join(map(_format_value, value))}]"
    number = isinstance(value, float)
    return f"{value:.10g}" if number else json.dumps(value, ensure_ascii=False).strip('"')


PHONE_LAYOUTS = {
    "two on one side, 20° apart": (-10, 10),
    "two on one side, 90° apart": (-45, 45),
    "two that face each other": (0, 180),
    "three on one side, 45° apart": (-45, 0, 45),
    "three all around": (0, 120, 240),
    "four, as in the thesis": (10, -10, 170, 190),
}
ELEVATIONS_DEG = (5, 15, 25, 35, 50, 70)
SHUTTERS_PER_S = (60, 125, 250, 500, 1000)  # parts of a second
FREQUENCIES_HZ = (5, 25, 100)
F_NUMBERS = (2.8, 5.6, 11)
WIDTHS_PX = (1280, 1920)
STEADY_S = (1, 10, 60)
ALIASED_HZ, FRAME_RATE_HZ = 110.0, 60.0
MOTIONS_PX = (2.0, 1.0, messages.CHECK_LIMITS["small-motion"], 0.1)
EXAMPLE_PLATE: dict[str, Any] = {
    "cameras": 4,
    "structure.kind": "plate",
    "structure.length_mm": 600,
    "structure.width_mm": 400,
    "structure.thickness_mm": 3,
    "excitation.frequency_hz": 50,
    "excitation.amplitude_mm": 0.2,
}
"""A plate, for which the page answers whether phones will do."""
PHONE_CAMERAS: dict[str, dict[str, Any]] = {
    "full HD": {},
    "4K": {"cameras.width_px": 3840, "cameras.height_px": 2160},
}


def format_command(given: Mapping[str, Any]) -> str:
    """Format the command that makes the manifest, in lines that a page can show."""
    parts = [f"-p {name}={shlex.quote(str(value))}" for name, value in given.items()]
    lines = [" ".join(parts[i : i + 3]) for i in range(0, len(parts), 3)]
    return " \\\n    ".join(["thesis measure --new plate", *lines])


def state_rule() -> str:
    """State how many pixels of motion are enough, by the errors of films."""
    whole = float(cone_law.cone_deflection_error(1, 1, EXAMPLE_PLATE["cameras"], np.pi / 2))
    errors_px = {
        "as a phone compresses it": assess.COMPRESSED_ERROR_PX,
        "without loss": assess.LOSSLESS_ERROR_PX,
        "rounded to whole pixels, as in the thesis": whole,
    }
    films = [
        (name, [assess.format_error_share(error / moved) for moved in MOTIONS_PX])
        for name, error in errors_px.items()
    ]
    return render(__file__, "film-rule", motions_px=MOTIONS_PX, films=films)


def answer_for_plate() -> str:
    """Answer for the plate: what to type, what comes out, and whether it will do."""
    assessed = {
        name: assess.assess_manifest(draft_manifest(EXAMPLE_PLATE | phone))
        for name, phone in PHONE_CAMERAS.items()
    }
    steady_interval_s = assessed["full HD"].rig.steady_interval_s
    return render(
        __file__,
        "film-answer",
        rows=[_phone_values(name, one) for name, one in assessed.items()],
        frequency_hz=EXAMPLE_PLATE["excitation.frequency_hz"],
        known_hz=messages.CHECK_LIMITS["alias"] / steady_interval_s,
        command=format_command(EXAMPLE_PLATE),
        for_4k=" ".join(f"-p {name}={value}" for name, value in PHONE_CAMERAS["4K"].items()),
        check=_describe_check(assessed["full HD"]),
        verdict=assess.describe_verdict(assessed["full HD"]),
    )


def _phone_values(name: str, one: assess.Assessment) -> dict[str, Any]:
    """Return the motion in one kind of phone, and errors over the largest deflection."""
    verdict = one.verdict
    return {
        "name": name,
        "pixel_mm": one.table[0].ground_sample_mm,
        "motion_px": min(row.motion_px for row in one.table),
        "enough": verdict.outcome == "compressed",
        "compressed": assess.format_error_share(verdict.compressed),
        "lossless": assess.format_error_share(verdict.lossless),
        "whole": assess.format_error_share(verdict.whole_pixels),
    }


def _describe_check(assessed: assess.Assessment) -> list[str]:
    """Return the lines that ``thesis measure --check`` prints."""
    return [*assess.describe_assessment(assessed), "", *assess.describe_verdict(assessed)]


def assess_layout(azimuths_deg: Sequence[float], elevation_deg: float) -> assess.Assessment:
    """Assess the example's structure and camera, filmed from other places."""
    example = example_manifest(example_rig())
    cameras = tuple(
        example.cameras[0].model_copy(
            update={"name": str(i), "azimuth_deg": float(azimuth), "elevation_deg": elevation_deg}
        )
        for i, azimuth in enumerate(azimuths_deg)
    )
    return assess.assess_manifest(example.model_copy(update={"cameras": cameras}))


def _std_um(of: assess.Assessment) -> tuple[float, float]:
    """Return standard errors of one frame and of the fit, rms over the markers, in µm."""
    return 1000 * of.rig.one_frame[0], 1000 * of.rig.fit[0]


def _example_camera() -> CameraFiles:
    return example_manifest(example_rig()).cameras[0]


def tabulate_layouts() -> str:
    """Tabulate the effect of the sides from which cameras look."""
    return render(
        __file__,
        "film-layouts",
        rows=[(name, *_std_um(assess_layout(at, 25.0))) for name, at in PHONE_LAYOUTS.items()],
        fit_s=assess_layout((0, 180), 25.0).rig.steady_interval_s,
        camera=_example_camera(),
        centre_noise_px=assess.CENTRE_NOISE_PX,
    )


def tabulate_elevations() -> str:
    """Tabulate the effect of the elevation."""
    rows = []
    for degrees in ELEVATIONS_DEG:
        phi, found = np.radians(degrees), assess_layout((0, 180), float(degrees))
        values = {
            "degrees": degrees,
            "cosine": np.cos(phi),
            "across_px": found.table[0].across_px,
            "slides": 1 / np.tan(phi),
            "one_frame_um": _std_um(found)[0],
        }
        rows.append(values)
    return render(__file__, "film-elevations", rows=rows)


def _amplitude_loss(turns: float) -> float | None:
    """Return the share of an amplitude that a mean over so many turns loses; None of a whole."""
    return float(1 - np.sinc(turns)) if turns < 1 else None


def tabulate_exposure() -> str:
    """Tabulate what shutters take from the amplitude."""
    limit = messages.CHECK_LIMITS["long-exposure"]
    return render(
        __file__,
        "film-exposure",
        frequencies_hz=FREQUENCIES_HZ,
        rows=[
            (n, [_amplitude_loss(hertz / n) for hertz in FREQUENCIES_HZ]) for n in SHUTTERS_PER_S
        ],
        limit=limit,
        limit_loss=_amplitude_loss(limit),
    )


def tabulate_alias() -> str:
    """Tabulate what a vibration above half of the frame rate needs."""
    return render(
        __file__,
        "film-alias",
        rate_hz=FRAME_RATE_HZ,
        frequency_hz=ALIASED_HZ,
        alias_hz=float(fold_frequency(ALIASED_HZ, FRAME_RATE_HZ)),
        turns=messages.CHECK_LIMITS["alias"],
        turns_loss=_amplitude_loss(messages.CHECK_LIMITS["alias"]),
        steady_interval_s=STEADY_S,
        edge_turns=messages.CHECK_LIMITS["alias-edge"],
    )


def tabulate_focus() -> str:
    """Tabulate the depths that apertures keep sharp."""
    camera, outlook = (
        _example_camera(),
        assess.assess_manifest(example_manifest(example_rig())).table,
    )
    focal_mm, distance_mm = camera.focal_length_mm or 0.0, camera.distance_mm or 0.0
    circles_mm = [
        messages.CHECK_LIMITS["depth-of-field"] * (camera.sensor_width_mm or 0.0) / w
        for w in WIDTHS_PX
    ]
    rows = [
        (stop, [depth_of_field(focal_mm, stop, distance_mm, circle) for circle in circles_mm])
        for stop in F_NUMBERS
    ]
    return render(
        __file__,
        "film-focus",
        widths_px=WIDTHS_PX,
        rows=rows,
        camera=camera,
        sharp_px=messages.CHECK_LIMITS["depth-of-field"],
        nearest_mm=min(one.nearest_mm for one in outlook),
        farthest_mm=max(one.farthest_mm for one in outlook),
    )


def describe_markers() -> str:
    """Describe what markers must look like."""
    return render(__file__, "film-markers", limit=messages.CHECK_LIMITS)


def show_check() -> str:
    """Show what the command reports of the example."""
    return render(
        __file__,
        "film-check",
        lines=_describe_check(assess.assess_manifest(example_manifest(example_rig()))),
    )


PIECES: dict[str, Callable[[], str]] = {
    **{f"record-{part}": partial(list_fields, part) for part in MANIFEST_PARTS},
    "record-warnings": partial(render, __file__, "record-warnings", groups=messages.CHECK_GROUPS),
    "record-unchecked": partial(
        render, __file__, "record-lines", lines=messages.UNCHECKED_MESSAGES
    ),
    "record-new": partial(render, __file__, "record-lines", lines=messages.NEW_MESSAGES),
    **{
        f"record-{name}": partial(
            render, __file__, "record-notes", notes=messages.NOTE_GROUPS[group]
        )
        for name, group in GROUP_OF_PIECE.items()
    },
    "film-rule": state_rule,
    "film-answer": answer_for_plate,
    "film-check": show_check,
    "film-layouts": tabulate_layouts,
    "film-elevations": tabulate_elevations,
    "film-exposure": tabulate_exposure,
    "film-alias": tabulate_alias,
    "film-focus": tabulate_focus,
    "film-markers": describe_markers,
    "guide-summary": format_sample_summary,
    "guide-counted": compare_smallest_deflection,
}
