"""The whole book: run what is stale, compute the numbers of its prose, render, publish."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path

from thesis_lib import (
    assumptions,
    book,
    cubes,
    explorer,
    figures,
    files,
    prose,
    rerun_form,
    runs,
    thesis_index,
)
from thesis_lib.experiment import filmed, pictures
from thesis_lib.experiment import numbers as walk_numbers
from thesis_lib.experiment.requests import ExperimentResolution
from thesis_lib.files import project_root
from thesis_lib.measuring import reference
from thesis_lib.parameters import STUDIES


def build(publish: bool = False) -> Path:
    """Bring the book up to date.

    Parameters
    ----------
    publish : bool
        Also make these results the published ones: ``data/published`` and the outputs that the
        notebooks carry.

    Returns
    -------
    Path
        The page to open.
    """
    root = project_root()
    executed, results = root / "book" / "executed", root / "data" / "results"
    jobs = [
        runs.Job(study(), executed / f"{name}.ipynb", results / f"{name}.nc")
        for name, study in STUDIES.items()
    ]
    filmed = ("experiment", "lab")  # what takes longest comes first
    jobs.sort(key=lambda job: job.study.subject not in filmed)
    made = [job.cube for job in jobs]
    numbers = [executed / f"{name}.md" for name in prose.PIECES]
    pages = [p for p in (root / "book").rglob("*") if p.is_file() and executed not in p.parents]
    pages = list({*pages, root / "book" / "assets" / "overview.svg"})
    pages += [root / "_config.yml", root / "package-lock.json"]
    sources = [*pages, *(job.notebook for job in jobs), *numbers, *files.library_files()]
    walk = [executed / pictures.file_name(name) for name in pictures.PICTURES]
    walk += [executed / f"{name}.md" for name in walk_numbers.PIECES]
    told = [executed / f"{name}.md" for name in reference.PIECES]
    own_words = [executed / f"{n}.md" for n in (*thesis_index.PIECES, *assumptions.PIECES)]
    own_words += [executed / f"{name}.html" for name in ("explorer", *rerun_form.PIECES)]
    published = sorted((root / "data" / "published").glob("*.csv"))
    index = root / "build" / "html" / "index.html"
    tasks = [
        *runs.job_tasks(jobs),
        runs.task(
            "numbers",
            lambda: prose.write(made, executed),
            [*made, *files.library_files()],
            numbers,
        ),
        runs.task(
            "walk through chapter 5",
            lambda: _walk_through(executed),
            [*made, *files.library_files()],
            walk,
        ),
        runs.task(
            "reference of own recordings",
            lambda: reference.write(executed),
            files.library_files(),
            told,
        ),
        runs.task(
            "index, assumptions, explorer, form",
            lambda: _tell(executed),
            [*files.library_files(), *(root / "book").glob("*.md"), *published],
            own_words,
        ),
        runs.task(
            "pages",
            lambda: book.render(root, index.parent),
            [*sources, *walk, *told, *own_words],
            [index],
        ),
    ]
    if publish:
        picture = root / "book" / "assets" / "overview.svg"
        tasks.insert(
            -1, runs.task("published run", lambda: _publish(jobs, picture), made, [picture])
        )
        tasks[-2]["uptodate"] = [False]  # asked for, so done
    runs.run(tasks, root / "build" / "state.sqlite")
    return index


def _tell(executed: Path) -> None:
    """What the pages include that depends on the library alone."""
    thesis_index.write(executed)
    assumptions.write(executed)
    page = explorer.explorer_html()
    whole = partial(Path.write_text, data=page, encoding="utf-8")
    files.whole_file(executed / "explorer.html", whole)
    rerun_form.write(executed)


def _walk_through(executed: Path) -> None:
    """Pictures and numbers of the laboratory's page, from the recordings of chapter 5."""
    data = cubes.cached(ExperimentResolution().recordings, filmed.run, filmed.sources())
    pictures.write(data, executed)
    for name, piece in walk_numbers.PIECES.items():
        text = piece(data)
        files.whole_file(
            executed / f"{name}.md", partial(Path.write_text, data=text, encoding="utf-8")
        )


def _publish(jobs: Sequence[runs.Job], picture: Path) -> None:
    for job in jobs:
        cubes.publish(cubes.read(job.cube))
        keep_outputs(runs.source(job.study.name), job.notebook)
    arrays = next(job for job in jobs if job.study.name == "beam-arrays")
    text = figures.as_svg(cubes.read(arrays.cube), "4a", 3)
    files.whole_file(picture, partial(Path.write_text, data=text, encoding="utf-8"))


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
