"""The report on the shipped example, as `thesis measure` writes it, and what the guide shows of it.

The report is no page of Sphinx: it loads nothing, and is the file that a user would get.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import xarray as xr

from thesis_lib import files, templates

SAMPLE_PAGE = "sample-report.html"
SHAPE_FIGURE = "guide-shape.svg"


def build_sample_report(data: xr.Dataset) -> str:
    """Return the report, written from the measured data."""
    from thesis_lib.figure_sets import record
    from thesis_lib.measure.feasibility.assess import assess_manifest
    from thesis_lib.measure.report.build import build_shape

    manifest = record.manifest_of(data)
    return build_shape(data, data, manifest, assess_manifest(manifest), record.first_frames()).page


def format_sample_summary(data: xr.Dataset) -> str:
    """Format the last lines that the measurement prints, as a block of text."""
    from thesis_lib.measure.report.build import summarise_shape
    from thesis_lib.measure.report.warnings import check_shape

    notes = [f"note: {note.text} [{note.code}]" for note in check_shape(data)]
    lines = [*summarise_shape(data), *notes]
    return "\n".join(["```text", *lines, "```", ""])


def compare_smallest_deflection(data: xr.Dataset) -> str:
    """Compare the predicted smallest deflection of the example with the measured one."""
    from thesis_lib.figure_sets import record
    from thesis_lib.measure.feasibility.assess import assess_manifest
    from thesis_lib.measure.fitting.models import known_rms

    predicted_mm = assess_manifest(record.manifest_of(data)).rig.smallest_mm
    measured_mm = 3 * known_rms(1000 * data["standard_error"].values)
    return templates.render(
        __file__, "guide-counted", predicted_mm=predicted_mm, measured_mm=measured_mm
    )


PIECES: dict[str, Callable[[xr.Dataset], str]] = {
    "guide-summary": format_sample_summary,
    "guide-counted": compare_smallest_deflection,
}
SAMPLE_FILES = (SAMPLE_PAGE, SHAPE_FIGURE, *(f"{name}.md" for name in PIECES))


def write_sample(folder: Path) -> None:
    """Write :data:`SAMPLE_FILES` into a folder."""
    from thesis_lib.figure_sets import record
    from thesis_lib.measure.report import figures as draw
    from thesis_lib.plotting.style import figure_svg

    data = record.read_sample()
    files.whole_text(folder / SAMPLE_PAGE, build_sample_report(data))
    files.whole_text(
        folder / SHAPE_FIGURE, figure_svg(draw.draw_shape(data, record.manifest_of(data)))
    )
    for name, piece in PIECES.items():
        files.whole_text(folder / f"{name}.md", piece(data))
