"""Executing notebooks: validated parameters to cube and page, side by side, nothing twice.

doit keeps what was done and with which inputs: a notebook is executed again only if its cells, the
library, the thesis's data, the lock file or the parameters differ. Files appear whole or not at
all: everything is written in a staging folder beside its place and renamed.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import sys
import time
import traceback
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import h5py
from doit.cmd_base import ModuleTaskLoader
from doit.dependency import SqliteDB
from doit.doit_cmd import DoitMain
from doit.exceptions import TaskFailed, UnmetDependency
from doit.tools import config_changed

from thesis_lib import comparison, cubes, effort, executed_notebook
from thesis_lib.commands import given
from thesis_lib.files import library_files, project_root, staging, sweep
from thesis_lib.pages import BookError
from thesis_lib.parameters import STUDIES, Study
from thesis_lib.published import published_path

_LAST_WORDS = "import thesis_lib.effort\n\nprint(thesis_lib.effort.told())"


class RunError(RuntimeError):
    """A run that failed; the message says what, where, and how to go on.

    Parameters
    ----------
    message : str
        All of it.
    failed : mapping, optional
        What failed, by name.
    unmet : iterable of str, optional
        Names of those that were not run since others failed.
    """

    def __init__(
        self, message: str, failed: Mapping[str, str] | None = None, unmet: Iterable[str] = ()
    ) -> None:
        super().__init__(message)
        self.failed, self.unmet = dict(failed or {}), frozenset(unmet)


@dataclass(frozen=True)
class Job:
    """One figure set to execute, and the files it makes.

    Parameters
    ----------
    study : Study
        Validated parameters.
    notebook, cube : Path
        Where the executed notebook and the cube go.
    page : Path or None
        Where the self-contained page goes, if one is wanted.
    """

    study: Study
    notebook: Path
    cube: Path
    page: Path | None = None

    @property
    def targets(self) -> list[Path]:
        """All files that the job makes."""
        return [self.notebook, self.cube, *([self.page] if self.page else [])]


def source(name: str) -> Path:
    """The parameterised notebook of a figure set."""
    return project_root() / "notebooks" / f"{name}.ipynb"


def digest(job: Job) -> str:
    """Hash of all that determines a job's files: cells, request, library, facts, lock.

    The page shows the difference from the published run, so that counts for it, too.
    """
    notebook = json.loads(source(job.study.name).read_text(encoding="utf-8"))
    cells = [[c["cell_type"], "".join(c["source"]), c["metadata"]] for c in notebook["cells"]]
    total = hashlib.sha256(json.dumps(cells, sort_keys=True).encode())
    total.update(json.dumps([job.study.name, job.study.request]).encode())
    published = [published_path(job.study.name)] if job.page else []
    for path in [*library_files(), *filter(Path.is_file, published)]:
        total.update(f"{path.name} {hashlib.sha256(path.read_bytes()).hexdigest()}\n".encode())
    return total.hexdigest()


def execute(job: Job) -> None:
    """Execute a job's notebook and put its files in place.

    Raises
    ------
    RunError
        If a cell fails.
    """
    import nbformat  # papermill and nbconvert take a second to import
    import papermill

    from thesis_lib import provenance

    name = job.study.name
    with staging(job.notebook.parent) as folder:
        executed, cube = folder / f"{name}.ipynb", folder / f"{name}.nc"
        asked = nbformat.read(source(name), as_version=4)
        asked.cells.append(nbformat.v4.new_code_cell(_LAST_WORDS, id="last-words"))
        nbformat.write(asked, folder / "asked.ipynb")
        try:
            papermill.execute_notebook(
                str(folder / "asked.ipynb"),
                str(executed),
                parameters={**given(job.study), "cube": str(cube)},
                kernel_name="python3",
                progress_bar=False,
                store_widget_state=False,
                extra_arguments=["--log-level=CRITICAL"],  # kernels chat on standard error
            )
        except papermill.PapermillExecutionError as error:
            log = _log(name, re.sub(r"\x1b\[[0-9;]*m", "", str(error)))
            raise RunError(
                f"{name}: cell {error.exec_count} failed with {error.ename}: {error.evalue}; "
                f"the traceback is in {log}; mend the cause and run the same command again"
            ) from None
        notebook = nbformat.read(executed, as_version=4)
        executed_notebook.hide_staging(notebook, name)
        said = notebook.cells.pop().outputs[0]["text"]
        cost = effort.heard(said, notebook.metadata["papermill"]["duration"], cube)
        result = cubes.read(cube)
        about = provenance.record(job.study, result, cube, cost)
        notebook.metadata["thesis_lib"] = {"cube_sha256": about.sha256, **asdict(cost)}
        provenance.add(notebook, about, result, in_book=job.page is None)
        if job.page:
            from thesis_lib.viewer_data import as_in_the_thesis

            text = "\n".join(comparison.difference_lines(result))
            text = f"## Difference from the published run\n\n```text\n{text}\n```"
            cell = nbformat.v4.new_markdown_cell(text, id=f"{name}-difference")
            notebook.cells.insert(-1, cell)
            if job.study.subject != "claims" and not as_in_the_thesis(result):
                executed_notebook.disown_captions(notebook)
            if job.study.subject == "claims":
                executed_notebook.cut_links(notebook)
        nbformat.write(notebook, executed)
        ready = [(executed, job.notebook), (cube, job.cube)]
        if job.page:
            from thesis_lib.pages import page

            html = folder / f"{name}.html"
            html.write_text(page(executed, job.study.title), encoding="utf-8")
            ready.append((html, job.page))
        for made, place in ready:
            place.parent.mkdir(parents=True, exist_ok=True)
            made.replace(place)


def _log(name: str, text: str) -> Path:
    """Keep a traceback for whoever mends its cause."""
    path = project_root() / "build" / "logs" / f"{name}.txt"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    return path


def job_tasks(jobs: Sequence[Job]) -> list[dict[str, Any]]:
    """The jobs as doit tasks; what uses another's results, or the same recordings, waits for it."""
    names = {job.study.name for job in jobs}
    tasks = []
    for job in jobs:
        # The digest is taken before the run, not after it as doit does with files: what is edited
        # while a notebook runs makes it stale.
        needs = _judged(jobs) if job.study.subject == "claims" else []
        made = task(job.study.name, partial(execute, job), needs, job.targets, digest(job))
        made["uptodate"].append(partial(_cube_is_whole, job))
        first = job.study.name.replace("sound-", "plate-")
        first = first.replace("experiment-cameras", "experiment-resolution")
        if first != job.study.name and first in names:
            made["task_dep"] = [f"thesis:{first}"]
        if job.study.subject == "claims":
            made["task_dep"] = [f"thesis:{name}" for name in names - {job.study.name}]
        tasks.append(made)
    return tasks


def _judged(jobs: Sequence[Job]) -> list[Path]:
    """Cubes that the ledger is made from: those of this run, else those of the last book."""
    made = {job.cube.name: job.cube for job in jobs if job.study.subject != "claims"}
    results = project_root() / "data" / "results"
    there = {path.name: path for path in results.glob("*.nc") if path.stem in STUDIES}
    there.pop("claims.nc", None)
    return sorted({**there, **{n: p for n, p in made.items() if p.parent == results}}.values())


def task(
    name: str, action: Any, needs: Sequence[Path], makes: Sequence[Path], key: str = ""
) -> dict[str, Any]:
    """A doit task whose errors arrive as one line."""

    def act() -> TaskFailed | None:
        try:
            action()
        except (RunError, BookError) as error:
            return TaskFailed(str(error))
        except Exception as error:
            log = _log(name, traceback.format_exc())
            return TaskFailed(f"{type(error).__name__}: {error}; the traceback is in {log}")
        return None

    return {
        "name": name,
        "actions": [act],
        "file_dep": [str(path) for path in needs],
        "targets": [str(path) for path in makes],
        "uptodate": [config_changed(key), partial(_cubes_open, makes)] if key else [],
        "io": {"capture": False},
    }


def _cubes_open(made: Sequence[Path]) -> bool:
    """Whether no cube among these files is damaged; a damaged one is made anew."""
    try:
        for path in made:
            if path.suffix == ".nc" and path.is_file():
                h5py.File(path).close()
    except OSError:
        return False
    return True


def _cube_is_whole(job: Job) -> bool:
    """Whether the cube is the one that the executed notebook tells of; else it is made anew."""
    from thesis_lib.provenance import sha256

    try:
        kept = json.loads(job.notebook.read_text(encoding="utf-8"))["metadata"]
        return bool(kept["thesis_lib"]["cube_sha256"] == sha256(job.cube))
    except (OSError, ValueError, KeyError):
        return False


class _Journal(SqliteDB):  # type: ignore[misc]
    """doit's database, kept up to date at once: what was done survives a pulled plug."""

    def set(self, task_id: str, dependency: str, value: Any) -> None:
        super().set(task_id, dependency, value)
        if dependency == "deps:":  # the last of a task's entries
            self._conn.execute(
                "insert or replace into doit values (?,?)",
                (task_id, self.codec.encode(self._cache[task_id])),
            )
            self._conn.commit()


class _Progress:
    """doit reporter: which task, how many, how long; collects the failures."""

    desc = "progress"

    def __init__(self, total: int) -> None:
        self.total, self.done = total, 0
        self.started: dict[str, float] = {}
        self.failures: dict[str, str] = {}
        self.unmet: set[str] = set()
        self.begin = time.monotonic()

    def _say(self, task: Any, text: str) -> None:
        elapsed = time.monotonic() - self.begin
        print(
            f"[{self.done}/{self.total}] {elapsed:5.1f} s  {_title(task)}: {text}",
            file=sys.stderr, flush=True,
        )  # fmt: skip

    def execute_task(self, task: Any) -> None:
        if task.has_subtask:  # the group, which doit reports like a task
            return
        self.started[task.name] = time.monotonic()
        self._say(task, "running")

    def add_success(self, task: Any) -> None:
        if task.has_subtask:
            return
        self.done += 1
        self._say(task, f"done in {time.monotonic() - self.started[task.name]:.1f} s")

    def skip_uptodate(self, task: Any) -> None:
        if task.has_subtask:
            return
        self.done += 1
        self._say(task, "up to date")

    def add_failure(self, task: Any, fail: Any) -> None:
        if task.has_subtask:
            return
        self.done += 1
        self._say(task, "FAILED")
        title, message = _title(task), str(fail.message).strip()
        if isinstance(fail, UnmetDependency):
            message = f"not run, since {message.replace('thesis:', '')} failed"
            self.unmet.add(title)
        self.failures[title] = message if message.startswith(title) else f"{title}: {message}"

    def runtime_error(self, message: str) -> None:
        self.failures[""] = message

    def cleanup_error(self, error: Any) -> None:
        self.failures[""] = str(error)

    def __getattr__(self, name: str) -> Any:  # the events that need no words
        if name in {"initialize", "get_status", "skip_ignore", "teardown_task", "complete_run"}:
            return lambda *_: None
        raise AttributeError(name)


def _title(task: Any) -> str:
    return str(task.name).partition(":")[2] or str(task.name)


def run(tasks: Sequence[dict[str, Any]], state: Path, workers: int = 2) -> None:
    """Run what is stale of some tasks, side by side.

    Parameters
    ----------
    tasks : sequence of dict
        Tasks as :func:`job_tasks` and :func:`task` make them.
    state : Path
        File in which doit remembers what was done.
    workers : int
        Tasks at a time.

    Raises
    ------
    RunError
        If a task failed; the others have been run all the same.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as many processes as cores already
    state.parent.mkdir(parents=True, exist_ok=True)
    sweep(project_root() / "build" / "cache")  # what was being filmed when a run was stopped
    progress = _Progress(len(tasks))
    config = {
        "GLOBAL": {
            "backend": "journal",
            "dep_file": str(state),
            "reporter": progress,
            "num_process": workers,
            "par_type": "thread",
            "continue": True,
            "verbosity": 0,
        },
        "BACKEND": {"journal": "thesis_lib.runs:_Journal"},
    }
    loader = ModuleTaskLoader({"task_thesis": lambda: (dict(task) for task in tasks)})
    status = DoitMain(loader, config_filenames=(), extra_config=config).run(["run"])
    if progress.failures or status:
        text = "\n".join(progress.failures.values()) or f"the task runner stopped ({status})"
        raise RunError(text, progress.failures, progress.unmet)
