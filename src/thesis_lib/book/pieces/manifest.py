"""Own recordings: manifests, warnings, numbers for filming, and the example's report.

The report is not made by Sphinx: it is the self-contained file that a user would get.
"""

import json
import shlex
import tomllib
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel

from thesis_lib.figure_sets import record
from thesis_lib.files import whole_text
from thesis_lib.laboratory.recording_files import example_manifest, example_rig
from thesis_lib.measure import messages
from thesis_lib.measure.feasibility import assess, prediction
from thesis_lib.measure.recordings import board, manifest as manifests, manifest_parts
from thesis_lib.measure.report import build, figures, warnings
from thesis_lib.plotting.style import figure_svg
from thesis_lib.studies.fields import describe_allowed, describe_field, unit_of_field
from thesis_lib.templates import render
from thesis_lib.vibration.motion import fold_frequency
from thesis_lib.vision import cone_law, optics

SAMPLE_PAGE = "sample-report.html"
SHAPE_FIGURE = "guide-shape.svg"
SAMPLE_FILES = (SAMPLE_PAGE, SHAPE_FIGURE)


def write_sample(folder: Path) -> None:
    """Write the report on the shipped example into a folder, and a figure of it for the guide."""
    data, frames = record.read_example(), record.first_frames()
    manifest = record.manifest_of(data)
    whole_text(folder / SAMPLE_PAGE, build.build_shape(data, data, manifest, frames).page)
    whole_text(folder / SHAPE_FIGURE, figure_svg(figures.draw_shape(data, manifest)))


def format_sample_summary() -> str:
    """Format the last lines that the measurement of the example prints, as a block of text."""
    data = record.read_example()
    notes = [f"note: {note.text} [{note.code}]" for note in warnings.check_shape(data)]
    return "\n".join(["```text", *build.summarise_shape(data), *notes, "```", ""])


def compare_smallest_deflection() -> str:
    """Compare the smallest deflection at the example's worst marker, predicted and measured."""
    data = record.read_example()
    predicted_mm = assess.assess_manifest(record.manifest_of(data)).rig.smallest_mm
    measured_mm = 3 * np.nanmax(1000 * data["standard_error"].values)
    return render(__file__, "guide-counted", predicted_mm=predicted_mm, measured_mm=measured_mm)


MANIFEST_PARTS: dict[str, type[BaseModel]] = {
    "manifest": manifests.Manifest,
    "structure": manifest_parts.StructureSpec,
    "markers": board.MarkersSpec,
    "cameras": manifests.CameraFiles,
    "board": board.BoardSpec,
    "excitation": manifest_parts.Excitation,
    "calibration": manifest_parts.ReusedRig,
    "radiation": manifest_parts.Radiation,
    "modes": manifest_parts.ModeSearch,
    "force": manifest_parts.Force,
    "sweep": manifest_parts.Sweep,
}


def list_fields(part: str) -> str:
    """List the fields of a part of :data:`MANIFEST_PARTS`, as a Markdown definition list."""
    model = MANIFEST_PARTS[part]
    fields = [
        (name, *(of(model, name) for of in (_format_default, describe_field, describe_allowed)))
        for name in model.model_fields
    ]
    return render(__file__, "record-fields", fields=fields)


def _format_default(model: type[BaseModel], name: str) -> str:
    """Return a field's default with its unit, or that it is required."""
    field, unit = model.model_fields[name], unit_of_field(name)
    if field.is_required():
        return f"required, in {unit}" if unit else "required"
    value = getattr(model.model_construct(), name)  # also if other fields are required
    if isinstance(value, BaseModel):
        return "its fields below"
    if value is None:
        return f"null, else in {unit}" if unit else "null"
    return f"{_format_value(value)} {unit}".rstrip()


def _format_value(value: Any) -> str:
    """Format a value as in YAML."""
    if isinstance(value, tuple):
        return f"[{', '.join(map(_format_value, value))}]"
    number = isinstance(value, float)
    return f"{value:.10g}" if number else json.dumps(value, ensure_ascii=False).strip('"')


FILMS = tomllib.loads(Path(__file__).with_name("manifest.toml").read_text(encoding="utf-8"))
EXAMPLE_PLATE: dict[str, Any] = FILMS["plate"]


def state_rule() -> str:
    """State how many pixels of motion are enough, by the errors of videos."""
    motions_px = (2.0, 1.0, messages.CHECK_LIMITS["small-motion"], 0.1)
    whole = float(cone_law.cone_deflection_error(1, 1, EXAMPLE_PLATE["cameras"], np.pi / 2))
    errors_px = {
        "as a phone compresses it": assess.COMPRESSED_ERROR_PX,
        "without loss": assess.LOSSLESS_ERROR_PX,
        "rounded to whole pixels, as in the thesis": whole,
    }
    values = {"errors_px": errors_px, "share": assess.format_error_share}
    return render(__file__, "film-rule", motions_px=motions_px, **values)


def answer_for_plate() -> str:
    """Show the check for the plate: the command, its output, and the verdict."""
    phones = {
        name: assess.assess_manifest(prediction.draft_manifest(EXAMPLE_PLATE | phone))
        for name, phone in FILMS["phones"].items()
    }
    full_hd = phones["full HD"]
    given = [f"-p {name}={shlex.quote(str(value))}" for name, value in EXAMPLE_PLATE.items()]
    lines = [" ".join(given[i : i + 3]) for i in range(0, len(given), 3)]  # short enough for a page
    return render(
        __file__,
        "film-answer",
        phones=phones,
        share=assess.format_error_share,
        frequency_hz=EXAMPLE_PLATE["excitation.frequency_hz"],
        known_hz=messages.CHECK_LIMITS["alias"] / full_hd.rig.steady_interval_s,
        command=" \\\n    ".join(["thesis measure --new plate", *lines]),
        for_4k=" ".join(f"-p {name}={value}" for name, value in FILMS["phones"]["4K"].items()),
        check=_describe_check(full_hd),
        verdict=assess.describe_verdict(full_hd),
    )


def _describe_check(assessed: assess.Assessment) -> list[str]:
    """Return the lines that ``thesis measure --check`` prints."""
    return [*assess.describe_assessment(assessed), "", *assess.describe_verdict(assessed)]


def _build_example() -> manifests.Manifest:
    return example_manifest(example_rig())


def assess_layout(azimuths_deg: Sequence[float], elevation_deg: float) -> assess.Assessment:
    """Assess the example's structure and camera, filmed from other positions."""
    example = _build_example()
    cameras = tuple(
        example.cameras[0].model_copy(
            update={"name": str(i), "azimuth_deg": float(azimuth), "elevation_deg": elevation_deg}
        )
        for i, azimuth in enumerate(azimuths_deg)
    )
    return assess.assess_manifest(example.model_copy(update={"cameras": cameras}))


def tabulate_layouts() -> str:
    """Tabulate the effect of the cameras' azimuths on rms standard errors."""
    rigs = {name: assess_layout(at, 25.0).rig for name, at in FILMS["layouts_deg"].items()}
    rows = [(name, 1000 * rig.one_frame[0], 1000 * rig.fit[0]) for name, rig in rigs.items()]
    camera, fit_s = _build_example().cameras[0], rigs["two that face each other"].steady_interval_s
    values = {"camera": camera, "fit_s": fit_s, "centre_noise_px": assess.CENTRE_NOISE_PX}
    return render(__file__, "film-layouts", rows=rows, **values)


def tabulate_elevations() -> str:
    """Tabulate the effect of the cameras' elevation."""
    rows = []
    for degrees in (5, 15, 25, 35, 50, 70):
        phi, found = np.radians(degrees), assess_layout((0, 180), float(degrees))
        across_px, one_frame_um = found.table[0].across_px, 1000 * found.rig.one_frame[0]
        rows.append((degrees, np.cos(phi), across_px, 1 / np.tan(phi), one_frame_um))
    return render(__file__, "film-elevations", rows=rows)


def _amplitude_loss(turns: float) -> float | None:
    """Return the share of an amplitude lost by a mean over `turns` periods; None from one on."""
    return float(1 - np.sinc(turns)) if turns < 1 else None


def tabulate_exposure() -> str:
    """Tabulate the loss of amplitude by exposure time."""
    limit, frequencies_hz = messages.CHECK_LIMITS["long-exposure"], (5, 25, 100)
    rows = [
        (parts, [_amplitude_loss(hertz / parts) for hertz in frequencies_hz])
        for parts in (60, 125, 250, 500, 1000)  # of a second
    ]
    values = {"rows": rows, "limit": limit, "limit_loss": _amplitude_loss(limit)}
    return render(__file__, "film-exposure", frequencies_hz=frequencies_hz, **values)


def tabulate_alias() -> str:
    """Tabulate the requirements of a vibration above half of the frame rate."""
    frequency_hz, rate_hz, turns = 110.0, 60.0, messages.CHECK_LIMITS["alias"]
    return render(
        __file__,
        "film-alias",
        rate_hz=rate_hz,
        frequency_hz=frequency_hz,
        alias_hz=float(fold_frequency(frequency_hz, rate_hz)),
        turns=turns,
        turns_loss=_amplitude_loss(turns),
        steady_interval_s=(1, 10, 60),
        edge_turns=messages.CHECK_LIMITS["alias-edge"],
    )


def tabulate_focus() -> str:
    """Tabulate the depth of field by f-number."""
    example = _build_example()
    camera, outlook = example.cameras[0], assess.assess_manifest(example).table
    focal_mm, distance_mm = camera.focal_length_mm or 0.0, camera.distance_mm or 0.0
    sharp_px, widths_px = messages.CHECK_LIMITS["depth-of-field"], (1280, 1920)
    circles_mm = [sharp_px * (camera.sensor_width_mm or 0.0) / width for width in widths_px]
    return render(
        __file__,
        "film-focus",
        widths_px=widths_px,
        rows=[
            (stop, [optics.depth_of_field(focal_mm, stop, distance_mm, one) for one in circles_mm])
            for stop in (2.8, 5.6, 11)
        ],
        camera=camera,
        sharp_px=sharp_px,
        nearest_mm=min(one.nearest_mm for one in outlook),
        farthest_mm=max(one.farthest_mm for one in outlook),
    )


def show_check() -> str:
    """Show the output of the command for the example."""
    lines = _describe_check(assess.assess_manifest(_build_example()))
    return render(__file__, "film-check", lines=lines)


PIECES: dict[str, Callable[[], str]] = {
    **{f"record-{part}": partial(list_fields, part) for part in MANIFEST_PARTS},
    "record-warnings": partial(render, __file__, "record-warnings", groups=messages.CHECK_GROUPS),
    "record-unchecked": partial(
        render, __file__, "record-lines", lines=messages.UNCHECKED_MESSAGES
    ),
    "record-new": partial(render, __file__, "record-lines", lines=messages.NEW_MESSAGES),
    **{
        f"record-notes-{group}": partial(render, __file__, "record-notes", notes=notes)
        for group, notes in messages.NOTE_GROUPS.items()
    },
    "film-rule": state_rule,
    "film-answer": answer_for_plate,
    "film-check": show_check,
    "film-layouts": tabulate_layouts,
    "film-elevations": tabulate_elevations,
    "film-exposure": tabulate_exposure,
    "film-alias": tabulate_alias,
    "film-focus": tabulate_focus,
    "film-markers": partial(render, __file__, "film-markers", limit=messages.CHECK_LIMITS),
    "guide-summary": format_sample_summary,
    "guide-counted": compare_smallest_deflection,
}
