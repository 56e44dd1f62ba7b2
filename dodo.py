"""doit tasks of the book: execute notebooks, write pieces of pages from cubes, render pages.

``thesis book`` and ``doit`` run the tasks that are out of date; ``doit list --all`` lists all.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from thesis_lib.book import build, explorer, find_figure_names, rendering
from thesis_lib.book.build import EXECUTED_FOLDER, list_code, make_task, result_files
from thesis_lib.book.pieces import (
    benchmarks,
    factors,
    illustrations,
    manifest as recordings,
    opened,
    thesis_index,
    write as texts,
)
from thesis_lib.figure_sets import record as measured_sample
from thesis_lib.figure_sets.claims import compute as ledger
from thesis_lib.figure_sets.experiment import walk
from thesis_lib.figure_sets.experiment.figure_set import ExperimentResolution
from thesis_lib.figure_sets.registry import STUDIES
from thesis_lib.files import folder_files, library_files
from thesis_lib.web.page import NPM_PACKAGES

DRAWN = (illustrations.FACTS, *build.longest_first())  # drawn as soon as the cube exists
DOIT_CONFIG = {
    "dep_file": str(build.PROJECT_ROOT / "build" / ".doit.sqlite"),
    "backend": "sqlite3",  # its file stays intact after a kill
    "num_process": 2,
    "par_type": "thread",  # notebooks and Sphinx compute in processes of their own
    "continue": True,
    "reporter": build.StepReporter,
    # Two steps that compute in this process block each other, so a notebook runs next to each.
    "default_tasks": [
        "inputs",
        "assets",
        "text",
        *(f"figures:figures and numbers of {name}" for name in DRAWN),
        "notebook",
        "figures",
        "piece",
        "pages",
    ],
}
PAGES = [
    path
    for path in folder_files([build.PROJECT_ROOT / "book"])
    if EXECUTED_FOLDER not in path.parents
]
NOTEBOOKS = [result_files(name)[0] for name in STUDIES]
CHECKS = build.PROJECT_ROOT / "build" / "conformance.xml"  # written by `make test-all`
PUBLISHED = sorted((build.PROJECT_ROOT / "data" / "published").glob("*.*"))
WORD_CODE = ("templates.py", "text.py")  # used by all pieces
PIECE_CODE = list_code("book/pieces", *WORD_CODE)
TEXT_CODE = list_code(
    "book", "facts", "figure_sets", "ledger", "planning", "plotting", "web", *WORD_CODE
)


def task_inputs() -> Iterator[dict[str, Any]]:
    """Compute the interpretations of the thesis first: they take long and need no cube."""
    yield {
        "name": "interpretations",
        "actions": [build.precompute_ledger_inputs],
        "targets": ledger.input_files(ledger.Claims()),
        "uptodate": [True],  # their names contain a digest of request and code
        "io": {"capture": False},
    }


def task_notebook() -> Iterator[dict[str, Any]]:
    """Execute the notebooks; each makes its cube."""
    for name in build.longest_first():
        first = [f"notebook:{other}" for other in build.list_prerequisites(name)]
        yield {
            "name": name,
            "actions": [(build.make_results, [name])],
            "targets": list(result_files(name)),
            "task_dep": [*first, *["inputs"] * (name == "claims")],
            "uptodate": [lambda task, values, name=name: build.is_result_current(name)],
            "io": {"capture": False},
        }


def task_assets() -> Iterator[dict[str, Any]]:
    """Install MathJax and MiniSearch as locked in ``package-lock.json``."""
    needs = [build.PROJECT_ROOT / "package-lock.json", build.PROJECT_ROOT / "package.json"]
    made = [build.PROJECT_ROOT / "build" / "assets" / name for name in NPM_PACKAGES]
    yield make_task(
        "MathJax and MiniSearch", lambda: rendering.install_assets(build.PROJECT_ROOT), needs, made
    )


def write_pieces(pieces: Sequence[str], names: Iterable[str] = ()) -> None:
    """Write pieces of pages from the cubes of figure sets."""
    texts.write_pieces(build.list_cubes(names), EXECUTED_FOLDER, pieces)


def included(*names: str) -> list[Path]:
    """Return the Markdown files of pieces of pages."""
    return [EXECUTED_FOLDER / f"{name}.md" for name in names]


def task_text() -> Iterator[dict[str, Any]]:
    """Write the pieces of pages that need no cube."""
    recordings_code = [
        measured_sample.example_path(),
        *list_code("book/pieces", "laboratory", "measure", "planning", "plotting", "web"),
        *list_code(*WORD_CODE),
    ]
    data = ExperimentResolution().recordings.stored_path
    of_no_cube = {
        "reference of own recordings": (recordings.PIECES, [*PUBLISHED, *recordings_code]),
        "index and assumptions": (thesis_index.PIECES, [*PAGES, *PUBLISHED, *library_files()]),
        "benchmarks": (benchmarks.PIECES, [*PUBLISHED, *PIECE_CODE]),
    }
    yield make_task(
        "numbers of structures", lambda: write_pieces(texts.OF_NO_CUBE),
        [*PUBLISHED, *TEXT_CODE], included(*texts.OF_NO_CUBE),
    )  # fmt: skip
    for name, (written, needs) in of_no_cube.items():
        act = partial(opened.write_texts, EXECUTED_FOLDER, written)
        yield make_task(name, act, needs, included(*written))
    yield make_task(
        "walk through chapter 5", lambda: walk.write_all(EXECUTED_FOLDER),
        [data, *list_code("figure_sets/experiment", "laboratory", "measure", "plotting")],
        [
            *map(EXECUTED_FOLDER.joinpath, map(walk.file_name, walk.WALK_FIGURES)),
            *included(*walk.TEXT_VALUES),
        ],
    )  # fmt: skip
    yield make_task(
        "sample report", lambda: recordings.write_sample(EXECUTED_FOLDER), recordings_code,
        [EXECUTED_FOLDER / name for name in recordings.SAMPLE_FILES],
    )  # fmt: skip
    yield make_task(
        "conformance", lambda: benchmarks.write_conformance(EXECUTED_FOLDER, CHECKS),
        [*folder_files([CHECKS]), *list_code("book", *WORD_CODE)],
        included(*benchmarks.CONFORMANCE_PIECES),
    )  # fmt: skip
    yield make_task(
        "explorer, form and demonstrations",
        lambda: opened.write_texts(EXECUTED_FOLDER, explorer.DEMO_PAGES, ".html"),
        [*PUBLISHED, *TEXT_CODE],
        [EXECUTED_FOLDER / f"{name}.html" for name in explorer.DEMO_PAGES],
    )  # fmt: skip


def task_piece() -> Iterator[dict[str, Any]]:
    """Write the tables, sentences and figures that need several cubes."""
    measured = [name for name in STUDIES if name != "claims"]
    others = [result_files(name)[0] for name in measured]
    elsewhere = (*texts.OF_LEDGER, *texts.OF_NO_CUBE)
    numbers = [name for name in texts.PIECES if name not in elsewhere]
    figures = find_figure_names(PAGES)
    of_cubes = {
        "numbers": (numbers, measured, [*others, *PUBLISHED]),
        "numbers of the ledger": (texts.OF_LEDGER, STUDIES, NOTEBOOKS),
    }
    for name, (pieces, names, needs) in of_cubes.items():
        act = partial(write_pieces, pieces, names)
        yield make_task(name, act, [*needs, *TEXT_CODE], included(*pieces))
    yield make_task(
        "figure of the conclusions",
        lambda: factors.write_summary_figure(build.list_cubes(), EXECUTED_FOLDER),
        [*others, *TEXT_CODE], [EXECUTED_FOLDER / factors.FIGURE_FILE],
    )  # fmt: skip
    yield make_task(
        "figures of notebooks",
        lambda: opened.write_shown_figures(figures, NOTEBOOKS, EXECUTED_FOLDER),
        [*NOTEBOOKS, *PAGES, *PIECE_CODE],
        [EXECUTED_FOLDER / f"{name}{kind}" for name in figures for kind in (".md", ".svg")],
    )  # fmt: skip
    code = list_code("book/pieces")
    for name in opened.SETS_IN_CHAPTERS:
        notebook = result_files(name)[0]
        yield make_task(
            f"provenance of {name}",
            partial(opened.write_provenance, notebook, EXECUTED_FOLDER),
            [notebook, *code],
            included(f"provenance-{name}"),
        )


def task_figures() -> Iterator[dict[str, Any]]:
    """Draw the figures of chapters, and write the numbers of each cube as CSV files."""
    for name in (*STUDIES, illustrations.FACTS):
        drawn = [one for one, (of, _) in illustrations.FIGURES.items() if of == name]

        def act(name: str = name, drawn: list[str] = drawn) -> None:
            made = build.list_cubes([name])
            illustrations.write_illustrations(made, EXECUTED_FOLDER, drawn)
            rendering.write_tables(build.TABLES_FOLDER, made)

        of = [result_files(name)[0]]
        if name == illustrations.FACTS:
            of = list_code("planning", "vision")
        yield make_task(
            f"figures and numbers of {name}",
            act,
            [*of, *TEXT_CODE],
            [EXECUTED_FOLDER / one for one in drawn],
        )


def task_pages(creators: Sequence[Any] = (task_text, task_figures, task_piece)) -> dict[str, Any]:
    """Render the pages, which include the outputs of other tasks, and pack them as one file."""
    pieces = [target for tasks in creators for task in tasks() for target in task["targets"]]
    needs = [*PAGES, *NOTEBOOKS, *pieces, *library_files(), build.PROJECT_ROOT / "_config.yml"]
    task = make_task(
        "pages", build.render_pages, needs, [build.HTML_FOLDER / "index.html", build.ARCHIVE_FILE]
    )
    return {key: value for key, value in task.items() if key != "name"} | {
        "task_dep": DOIT_CONFIG["default_tasks"][:-1]
    }
