"""The report on the shipped example, as `thesis measure` writes it: a page of the book's folder.

It is no page of Sphinx: it loads nothing, and is the file that a user would get.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path

from thesis_lib import files
from thesis_lib.figure_sets import sample
from thesis_lib.measure.feasibility.assess import assess
from thesis_lib.measure.report import page as report

NAME = "sample-report.html"


def page() -> str:
    """The report, written from what was measured."""
    data = sample.sample()
    manifest = sample.manifest_of(data)
    pictures = report.figures(data, data, manifest, sample.first_frames())
    return report.page(data, manifest, assess(manifest), pictures)


def write(folder: Path) -> None:
    """Write :data:`NAME` into a folder."""
    files.whole_file(folder / NAME, partial(Path.write_text, data=page(), encoding="utf-8"))
