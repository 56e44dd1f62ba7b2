"""The book, or a chapter: run what is stale, compute the numbers of its prose, render, publish."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import ModuleType

from thesis_lib import files
from thesis_lib.book import chapter as one_chapter
from thesis_lib.book import (
    crate,
    demos,
    downloads,
    missing,
    sample,
    sphinx_process,
    unchanged,
)
from thesis_lib.book import publish as publishing
from thesis_lib.book import site as book
from thesis_lib.book.conclusions import figure as conclusions_figure
from thesis_lib.book.conformance import report as conformance
from thesis_lib.book.pieces import assumptions, illustrations, shown, sketches, thesis_index
from thesis_lib.book.pieces import benchmarks as benchmark_tables
from thesis_lib.book.pieces import manifest as reference
from thesis_lib.book.pieces import write as pieces_write
from thesis_lib.book.plan import Plan, planned
from thesis_lib.figure_sets import keys, recorded
from thesis_lib.figure_sets.experiment.parameters import ExperimentResolution
from thesis_lib.figure_sets.experiment.walk import numbers as walk_numbers
from thesis_lib.figure_sets.experiment.walk import pictures
from thesis_lib.figure_sets.registry import FIGURE_SETS
from thesis_lib.runs import execute as runs
from thesis_lib.runs import nursery, tasks
from thesis_lib.studies import effort, times
from thesis_lib.web.page import PACKAGES


def build(publish: bool = False, chapter: str = "") -> Path:
    """Bring the book, or that of one chapter, up to date.

    What fails is told in its place in the book, and everything else is made all the same.

    Parameters
    ----------
    publish : bool
        Also make these results the published ones: ``data/published`` and the outputs that the
        notebooks carry.
    chapter : str, optional
        One of :data:`thesis_lib.figure_sets.registry.CHAPTERS`: its sets and pages alone, in a
        place of their own.

    Returns
    -------
    Path
        The page to open.

    Raises
    ------
    RunError
        If anything failed; the message names all of it.
    """
    begun = unchanged.written()
    nursery.ready()  # both import while this process looks for what is stale
    sphinx_process.begin(files.project_root())
    plan = planned(chapter, publish)
    while True:  # each time round without what failed before
        steps = _tasks(plan)
        try:
            took = tasks.run(steps)
            break
        except tasks.RunError as error:
            new = {name: text for name, text in error.failed.items() if name not in error.unmet}
            if not new or plan.step("pages") in new:
                raise tasks.RunError("\n".join([*plan.failed.values(), str(error)])) from None
            plan.failed.update(new)
            _stand_in(plan, steps, new)
    if plan.failed:
        lines = [*plan.failed.values(), f"the book without these is {plan.index}"]
        raise tasks.RunError("\n".join(lines))
    if not chapter:
        times.note("book", took)
        unchanged.remember([plan.index.parent, *plan.archives], begun)
    return plan.index


def forget() -> None:
    """Let the next book compute and execute everything; what was made stays until then."""
    root = files.project_root()
    for notebook in (root / "book" / "executed").glob("*.ipynb"):
        notebook.unlink()
    shutil.rmtree(root / "build" / "cache", ignore_errors=True)


def _stand_in(plan: Plan, steps: Sequence[tasks.Task], failed: Mapping[str, str]) -> None:
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


def _tasks(plan: Plan) -> list[tasks.Task]:
    """All steps of the book that have not failed."""
    root, library, made = plan.root, files.library_files(), [job.cube for job in plan.ran]
    published = []
    if plan.publish and not plan.failed:
        picture = root / "book" / "assets" / "overview.svg"
        made_known = [picture, effort.published_path(), times.published_path()]
        measured = root / "build" / conformance.REPORT
        made_known += [conformance.published_path()] if measured.is_file() else []
        publish = partial(publishing.publish, plan.jobs, picture, measured)
        published = [tasks.task("published run", publish, made, made_known, always=True)]
    scripts = tasks.task(
        "MathJax and MiniSearch",
        lambda: book.install_assets(root),
        [root / "package-lock.json", root / "package.json"],
        [root / "build" / "assets" / name for name in PACKAGES],
        seconds=plan.seconds.get("MathJax and MiniSearch", 0.0),
    )
    pieces = _pieces(plan, made, frozenset(one.name for one in published))
    of_cubes = list(_of_cubes(plan, made))
    needs = [path for one in (*pieces, scripts, *of_cubes) for path in one.makes]
    needs += [*plan.pages, *(job.notebook for job in plan.jobs), *made, *library]
    needs += [root / name for name in ("_config.yml", "package-lock.json")]
    needs += [root / "book" / name for name in ("_toc.yml", "references.bib", "assets")]
    pages = tasks.task(
        plan.step("pages"),
        lambda: _render(plan),
        needs,
        [plan.index.parent, *plan.archives],
        seconds=plan.takes("pages"),
        elsewhere=True,
    )
    first = [*runs.job_tasks(plan.ran, plan.seconds), scripts, *published]
    steps = [*first, *pieces, *of_cubes, pages]
    return [step for step in steps if step.name not in plan.failed]


def _pieces(plan: Plan, made: Sequence[Path], after: frozenset[str]) -> list[tasks.Task]:
    """The steps that make what the pages include."""
    executed = plan.executed
    costs = [effort.published_path()] if plan.publish or effort.published_path().is_file() else []
    read = (benchmark_tables.published_path(), times.published_path())
    costs += [path for path in read if path.is_file()]
    figures, notebooks = shown.names(plan.pages), [job.notebook for job in plan.jobs]
    numbers = [name for name in pieces_write.PIECES if plan.includes(f"{name}.md")]
    of_ledger = [name for name in numbers if name in pieces_write.OF_LEDGER]
    numbers = [name for name in numbers if name not in of_ledger]
    others = [path for path in made if path.stem != "claims"]
    published = sorted((plan.root / "data" / "published").glob("*.csv"))

    def texts(names: Iterable[str]) -> list[str]:
        return [f"{name}.md" for name in names]

    def step(
        name: str,
        act: Callable[[], object],
        by: Iterable[ModuleType],
        needs: Sequence[Path],
        makes: Iterable[str],
    ) -> tasks.Task:
        key, files = keys.made_by(*(one.__name__ for one in by)), [executed / one for one in makes]
        return tasks.task(plan.step(name), act, needs, files, key, seconds=plan.takes(name))

    steps = [
        replace(_conformance(plan), after=after),
        step(
            "numbers",
            lambda: pieces_write.write(others, executed, plan.without, numbers, costs),
            [pieces_write],
            [*others, *costs],
            texts(numbers),
        ),
        step(
            "numbers of the ledger",
            lambda: pieces_write.write(made, executed, plan.without, of_ledger, costs),
            [pieces_write],
            [*made, *costs],
            texts(of_ledger),
        ),
        step(
            "figures of notebooks",
            lambda: shown.write(figures, notebooks, executed),
            [shown],
            notebooks,
            [f"{name}{kind}" for name in figures for kind in (".md", ".svg")],
        ),
        step("sketches", lambda: sketches.write(executed), [sketches], [], sketches.NAMES),
        step(
            "figure of the conclusions",
            lambda: conclusions_figure.write(made, executed),
            [conclusions_figure],
            conclusions_figure.used(made),
            [conclusions_figure.NAME],
        ),
        step(
            "walk through chapter 5",
            lambda: _walk_through(executed),
            [pictures, walk_numbers, recorded],
            [one.path for one in recorded.behind(ExperimentResolution())],
            [*map(pictures.file_name, pictures.PICTURES), *texts(walk_numbers.PIECES)],
        ),
        step(
            "reference of own recordings",
            lambda: reference.write(executed),
            [reference],
            [],
            texts(reference.PIECES),
        ),
        step(
            "sample report",
            lambda: sample.write(executed),
            [sample],
            [recorded.folder() / "example.json"],
            sample.NAMES,
        ),
        step(
            "index and assumptions",
            lambda: [one.write(executed) for one in (thesis_index, assumptions)],
            [thesis_index, assumptions],
            plan.pages,
            texts([*thesis_index.PIECES, *assumptions.PIECES]),
        ),
        step(
            "explorer, form and demonstrations",
            lambda: demos.write(executed),
            [demos],
            published,
            [f"{name}.html" for name in demos.PAGES],
        ),
    ]
    return [one for one in steps if any(plan.includes(path.name) for path in one.makes)]


def _of_cubes(plan: Plan, made: Sequence[Path]) -> Iterator[tasks.Task]:
    """Of each cube the figures of it that stand in chapters, and its numbers to download."""
    key = keys.made_by(illustrations.__name__, downloads.__name__)
    figures = {path.stem: list[str]() for path in made}
    for name in illustrations.NAMES:
        if plan.includes(name):
            figures.setdefault(illustrations.cube_of(name), []).append(name)
    for of, names in figures.items():
        cube, name = [path for path in made if path.stem == of], f"figures and numbers of {of}"
        kinds = [kind for kind in ("", ".csv") if cube and (kind or FIGURE_SETS[of].figure)]
        makes = [plan.tables / f"{of}{kind}" for kind in kinds]
        makes += [plan.executed / one for one in names]

        def act(cube: Sequence[Path] = cube, names: Sequence[str] = names) -> None:
            illustrations.write(cube, plan.executed, names)
            downloads.tables(plan.tables, cube)

        yield tasks.task(plan.step(name), act, cube, makes, key, seconds=plan.takes(name))


def _conformance(plan: Plan) -> tasks.Task:
    """The page of what the tests measured when it was published."""
    published = conformance.published_path()
    there = [published] if published.is_file() else []
    library = [file for file in files.library_files() if file.suffix == ".py"]
    return tasks.task(
        "conformance",
        lambda: conformance.write(plan.executed),
        [*there, *library, *conformance.test_files()],
        conformance.pieces(plan.executed),
        seconds=plan.seconds.get("conformance", 0.0),
    )


def _render(plan: Plan) -> None:
    """Pages, downloads, their description, and all of it as one file."""

    def finish(html: Path) -> None:
        downloads.fill(html, [job.cube for job in plan.ran], plan.tables)
        crate.write(html, [(job.notebook, job.cube) for job in plan.ran])
        if (report := plan.executed / sample.PAGE).is_file():
            shutil.copyfile(report, html / sample.PAGE)

    if plan.chapter:
        notebooks = [job.notebook for job in plan.jobs]
        with files.staging(plan.root / "build") as work:
            one_chapter.lay_out(plan.root, plan.chapter, plan.executed, notebooks, work)
            book.render(work, plan.index.parent, finish)
        return
    book.render(plan.root, plan.index.parent, finish)
    for place in plan.archives:
        downloads.archive(plan.index.parent, place)


def _walk_through(executed: Path) -> None:
    """Pictures and numbers of the laboratory's page, from the recordings of chapter 5."""
    data = recorded.measured(*recorded.behind(ExperimentResolution()))
    pictures.write(data, executed)
    for name, piece in walk_numbers.PIECES.items():
        files.whole_text(executed / f"{name}.md", piece(data))
