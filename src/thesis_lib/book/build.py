"""The whole book: run what is stale, compute the numbers of its prose, render, publish."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

from thesis_lib import files
from thesis_lib.book import crate, downloads, explorer, missing, rerun_form, unchanged
from thesis_lib.book import site as book
from thesis_lib.book.conclusions import figure as conclusions_figure
from thesis_lib.book.conformance import report as conformance
from thesis_lib.book.pieces import assumptions, thesis_index
from thesis_lib.book.pieces import benchmarks as benchmark_tables
from thesis_lib.book.pieces import manifest as reference
from thesis_lib.book.pieces import write as pieces_write
from thesis_lib.figure_sets import cube_file, recorded
from thesis_lib.figure_sets.display import as_svg
from thesis_lib.figure_sets.experiment.parameters import ExperimentResolution
from thesis_lib.figure_sets.experiment.walk import numbers as walk_numbers
from thesis_lib.figure_sets.experiment.walk import pictures
from thesis_lib.figure_sets.registry import STUDIES
from thesis_lib.files import project_root
from thesis_lib.runs import execute as runs
from thesis_lib.runs import tasks
from thesis_lib.studies import effort, published
from thesis_lib.web.page import MATHJAX

PAGES: dict[str, Callable[[], str]] = {
    "explorer": explorer.explorer_html,
    "explorer-home": partial(explorer.explorer_html, "s=beam&m=3&t=4a-6", compact=True),
    "rerun-form": rerun_form.page,
}
"""Pieces of pages that depend on the library, and what is published, alone."""


@dataclass(frozen=True)
class _Plan:
    """The places of a book, and what has failed so far, by the name of the step."""

    root: Path
    jobs: list[runs.Job]
    publish: bool
    failed: dict[str, str] = field(default_factory=dict)

    @property
    def ran(self) -> list[runs.Job]:
        """The figure sets that did not fail."""
        return [job for job in self.jobs if job.study.name not in self.failed]

    @property
    def executed(self) -> Path:
        """Folder of what pages include."""
        return self.root / "book" / "executed"

    @property
    def index(self) -> Path:
        """The page to open."""
        return self.root / "build" / "html" / "index.html"

    @property
    def archive(self) -> Path:
        """The book as one file."""
        return self.root / "build" / f"{downloads.ARCHIVE}.zip"


def build(publish: bool = False) -> Path:
    """Bring the book up to date.

    What fails is told in its place in the book, and everything else is made all the same.

    Parameters
    ----------
    publish : bool
        Also make these results the published ones: ``data/published`` and the outputs that the
        notebooks carry.

    Returns
    -------
    Path
        The page to open.

    Raises
    ------
    RunError
        If anything failed; the message names all of it.
    """
    root = project_root()
    executed, results = root / "book" / "executed", root / "data" / "results"
    jobs = [
        runs.Job(study(), executed / f"{name}.ipynb", results / f"{name}.nc")
        for name, study in STUDIES.items()
    ]
    seconds = {name: cost.seconds for name, cost in effort.read().items()}
    jobs.sort(key=lambda job: -seconds.get(job.study.name, 0.0))  # what takes longest comes first
    plan = _Plan(root, jobs, publish)
    while True:  # each time round without what failed before
        steps = _tasks(plan)
        try:
            tasks.run(steps)
            break
        except tasks.RunError as error:
            new = {name: text for name, text in error.failed.items() if name not in error.unmet}
            if not new or "pages" in new:
                raise tasks.RunError("\n".join([*plan.failed.values(), str(error)])) from None
            plan.failed.update(new)
            _stand_in(plan, steps, new)
    if plan.failed:
        lines = [*plan.failed.values(), f"the book without these is {plan.index}"]
        raise tasks.RunError("\n".join(lines))
    unchanged.remember([plan.index.parent, plan.archive])
    return plan.index


def forget() -> None:
    """Let the next book compute and execute everything; what was made stays until then."""
    root = project_root()
    for notebook in (root / "book" / "executed").glob("*.ipynb"):
        notebook.unlink()
    shutil.rmtree(root / "build" / "cache", ignore_errors=True)


def _stand_in(plan: _Plan, steps: Sequence[tasks.Task], failed: Mapping[str, str]) -> None:
    """Let what is missing say so where it would be."""
    jobs = {job.study.name: job for job in plan.jobs}
    made = {step.name: step.makes for step in steps}
    for name, reason in failed.items():
        if name in jobs:
            missing.write_page(runs.source(name), name, reason, jobs[name].notebook)
            continue
        for target in made[name]:
            if target.parent == plan.executed:
                missing.write_placeholder(target, name)


def _tasks(plan: _Plan) -> list[tasks.Task]:
    """All steps of the book that have not failed."""
    root, executed, library = plan.root, plan.executed, files.library_files()
    made = [job.cube for job in plan.ran]
    numbers = [executed / f"{name}.md" for name in pieces_write.PIECES]
    pages = [p for p in (root / "book").rglob("*") if p.is_file() and executed not in p.parents]
    pages = list({*pages, root / "book" / "assets" / "overview.svg"})
    pages += [root / "_config.yml", root / "package-lock.json"]
    sources = [*pages, *(job.notebook for job in plan.jobs), *made, *numbers]
    walk = [executed / pictures.file_name(name) for name in pictures.PICTURES]
    walk += [executed / f"{name}.md" for name in walk_numbers.PIECES]
    picture_of_all = executed / conclusions_figure.NAME
    told = [executed / f"{name}.md" for name in reference.PIECES]
    own_words = [executed / f"{n}.md" for n in (*thesis_index.PIECES, *assumptions.PIECES)]
    own_words += [executed / f"{name}.html" for name in PAGES]
    checked = conformance.pieces(executed)
    published = sorted((root / "data" / "published").glob("*.csv"))
    costs = [effort.published_path()] if plan.publish or effort.published_path().is_file() else []
    costs += [path for path in [benchmark_tables.published_path()] if path.is_file()]
    without = [job.study.name for job in plan.jobs if job not in plan.ran]
    publishing = []
    if plan.publish and not plan.failed:
        picture = root / "book" / "assets" / "overview.svg"
        made_known = [picture, effort.published_path()]
        measured = root / "build" / conformance.REPORT
        made_known += [conformance.published_path()] if measured.is_file() else []
        publish = partial(_publish, plan.jobs, picture, measured)
        publishing = [tasks.task("published run", publish, made, made_known, always=True)]
    assets = root / "build" / "assets"
    mathjax = [assets / Path(MATHJAX).parent]
    steps = [
        *runs.job_tasks(plan.ran),
        tasks.task(
            "MathJax",
            lambda: book.install_assets(root),
            [root / "package-lock.json", root / "package.json"],
            mathjax,
        ),
        *publishing,
        replace(_conformance(plan), after=frozenset(one.name for one in publishing)),
        tasks.task(
            "numbers",
            lambda: pieces_write.write(made, executed, without),
            [*made, *costs, *library],
            numbers,
        ),
        tasks.task(
            "figure of the conclusions",
            lambda: conclusions_figure.write(made, executed),
            [*made, *library],
            [picture_of_all],
        ),
        tasks.task(
            "walk through chapter 5",
            lambda: _walk_through(executed),
            [*made, *library],
            walk,
        ),
        tasks.task(
            "reference of own recordings",
            lambda: reference.write(executed),
            library,
            told,
        ),
        tasks.task(
            "index, assumptions, explorer, form",
            lambda: _tell(executed),
            [*library, *pages, *published],
            own_words,
        ),
        tasks.task(
            "pages",
            lambda: _render(plan),
            [*sources, picture_of_all, *walk, *told, *own_words, *checked, *mathjax, *library],
            [plan.index.parent, plan.archive],
        ),
    ]
    return [step for step in steps if step.name not in plan.failed]


def _conformance(plan: _Plan) -> tasks.Task:
    """The page of what the tests measured when it was published."""
    published = conformance.published_path()
    there = [published] if published.is_file() else []
    library = [file for file in files.library_files() if file.suffix == ".py"]
    return tasks.task(
        "conformance",
        lambda: conformance.write(plan.executed),
        [*there, *library, *conformance.test_files()],
        conformance.pieces(plan.executed),
    )


def _render(plan: _Plan) -> None:
    """Pages, downloads, their description, and all of it as one file."""

    def finish(html: Path) -> None:
        downloads.slim_sources(html)
        downloads.fill(html, [job.cube for job in plan.ran])
        crate.write(html, [(job.notebook, job.cube) for job in plan.ran])

    book.render(plan.root, plan.index.parent, finish)
    downloads.archive(plan.index.parent, plan.archive)


def _tell(executed: Path) -> None:
    """What the pages include that depends on the library alone."""
    thesis_index.write(executed)
    assumptions.write(executed)
    for name, page in PAGES.items():
        files.whole_text(executed / f"{name}.html", page())


def _walk_through(executed: Path) -> None:
    """Pictures and numbers of the laboratory's page, from the recordings of chapter 5."""
    data = recorded.measured(*recorded.behind(ExperimentResolution()))
    pictures.write(data, executed)
    for name, piece in walk_numbers.PIECES.items():
        files.whole_text(executed / f"{name}.md", piece(data))


def _publish(jobs: Sequence[runs.Job], picture: Path, measured: Path) -> None:
    if measured.is_file():  # first, for what failed in it publishes nothing
        conformance.publish(measured)
    for job in jobs:
        published.publish(cube_file.read(job.cube))
        keep_outputs(runs.source(job.study.name), job.notebook)
    costs = {job.study.name: effort.of(job.notebook) for job in jobs}
    effort.write((name, costs[name]) for name in STUDIES)
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
