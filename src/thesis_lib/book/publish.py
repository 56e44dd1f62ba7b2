"""Publishing: errors, efforts, conformance, and the outputs that the notebooks carry."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from thesis_lib import files
from thesis_lib.book import conformance
from thesis_lib.figure_sets import cube_file
from thesis_lib.figure_sets.display import as_svg
from thesis_lib.figure_sets.registry import STUDIES
from thesis_lib.runs import execute as runs
from thesis_lib.studies import effort, published, times


def publish(jobs: Sequence[runs.Job], picture: Path, measured: Path) -> None:
    """Make the results of all figure sets, executed, the published ones.

    `picture` is that of the README, which is drawn anew, `measured` what the tests have measured.

    Raises
    ------
    RunError
        If a test had failed; nothing is published then.
    """
    if measured.is_file():  # first, for what failed in it publishes nothing
        conformance.publish(measured)
    for job in jobs:
        published.publish(cube_file.read(job.cube))
        keep_outputs(runs.source(job.study.name), job.notebook)
    costs = {job.study.name: effort.of(job.notebook) for job in jobs}
    effort.write((name, costs[name]) for name in STUDIES)
    times.write(times.published_path(), times.read(times.measured_path()))
    arrays = next(job for job in jobs if job.study.name == "beam-arrays")
    text = as_svg(cube_file.read(arrays.cube), "4a", 3)
    files.whole_text(picture, text)


def keep_outputs(notebook: Path, executed: Path) -> None:
    """Give a notebook the text outputs of its executed copy; pictures and widgets stay out."""
    import nbformat

    document = nbformat.read(notebook, as_version=4)
    ran = {cell["id"]: cell for cell in nbformat.read(executed, as_version=4).cells}
    codes = [cell for cell in document.cells if cell.cell_type == "code"]
    for number, cell in enumerate(codes, 1):
        ignored = "nbval-ignore-output" in cell.metadata.get("tags", [])
        cell.execution_count = number  # nbval compares nothing without a count
        cell.outputs = [] if ignored else [_text_only(out) for out in ran[cell["id"]].outputs]
    files.whole_file(notebook, lambda part: nbformat.write(document, part))


def _text_only(output: dict[str, object]) -> dict[str, object]:
    if "execution_count" in output:
        output["execution_count"] = None
    data = output.get("data")
    if isinstance(data, dict):
        output["data"] = {kind: text for kind, text in data.items() if kind.startswith("text/")}
    return output
