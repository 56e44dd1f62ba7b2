"""The report on the shipped example, as `thesis measure` writes it, and what the guide shows of it.

The report is no page of Sphinx: it loads nothing, and is the file that a user would get.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import xarray as xr

from thesis_lib import files

PAGE = "sample-report.html"
SHAPE = "guide-shape.svg"


def page(data: xr.Dataset) -> str:
    """The report, written from what was measured."""
    from thesis_lib.figure_sets import sample
    from thesis_lib.measure.feasibility.assess import assess
    from thesis_lib.measure.report import page as report

    manifest = sample.manifest_of(data)
    pictures = report.figures(data, data, manifest, sample.first_frames())
    return report.page(data, manifest, assess(manifest), pictures)


def summary(data: xr.Dataset) -> str:
    """The last lines that the measurement prints, as a block of text."""
    from thesis_lib.measure.report import page as report
    from thesis_lib.measure.report.notes import notes

    lines = [*report.summary(data), *(f"note: {n.text} [{n.code}]" for n in notes(data))]
    return "\n".join(["```text", *lines, "```", ""])


def counted(data: xr.Dataset) -> str:
    """What the assessment of the manifest counts and does not, against what was measured."""
    from thesis_lib.figure_sets import sample
    from thesis_lib.measure.feasibility.assess import assess
    from thesis_lib.measure.fitting.models import rms

    foretold = assess(sample.manifest_of(data)).rig.smallest_mm
    measured = 3 * rms(1000 * data["standard_error"].values)
    return (
        f"`--check` foretells {foretold:.2g} mm as the smallest deflection of the example, and its "
        f"measurement tells {measured:.2g} mm from rest. The first counts the noise of the "
        "centres alone. The second also holds what the compressed videos, the calibration and the "
        "clocks add, which nobody knows before. So take the first for a limit that only the best "
        "films come near.\n"
    )


PIECES: dict[str, Callable[[xr.Dataset], str]] = {
    "guide-summary": summary,
    "guide-counted": counted,
}
NAMES = (PAGE, SHAPE, *(f"{name}.md" for name in PIECES))


def write(folder: Path) -> None:
    """Write :data:`NAMES` into a folder."""
    from thesis_lib.figure_sets import sample
    from thesis_lib.measure.report import figures as draw
    from thesis_lib.plotting.style import svg

    data = sample.sample()
    files.whole_text(folder / PAGE, page(data))
    files.whole_text(folder / SHAPE, svg(draw.shape(data, sample.manifest_of(data))))
    for name, piece in PIECES.items():
        files.whole_text(folder / f"{name}.md", piece(data))
