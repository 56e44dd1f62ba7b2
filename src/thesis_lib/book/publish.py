"""Publishing: errors, efforts, and the outputs that the notebooks carry."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from thesis_lib import files
from thesis_lib.figure_sets import cube_file
from thesis_lib.figure_sets.display import as_svg
from thesis_lib.files import project_root
from thesis_lib.runs import execute as runs
from thesis_lib.studies import effort, published


def publish_results(made: Mapping[str, tuple[Path, Path]]) -> None:
    """Make results the published ones: executed notebook and cube of all figure sets.

    The picture of the README is drawn again, too.
    """
    for name, (notebook, cube) in made.items():
        published.publish_errors(cube_file.read_cube(cube))
        keep_outputs(runs.locate_notebook(name), notebook)
    effort.write_efforts(
        (name, effort.notebook_effort(notebook)) for name, (notebook, _) in made.items()
    )
    text = as_svg(cube_file.read_cube(made["beam-arrays"][1]), "4a", 3)
    files.whole_text(project_root() / "book" / "assets" / "overview.svg", text)


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
