"""Executing notebooks: validated parameters to cube and page.

A notebook is executed again only if its code, the library, the thesis's data, the lock file or the
parameters differ from those that its files were made from, or one of these files is not what was
made; where prose alone differs, it is put into what was executed. Files appear whole or not at all:
everything is written in a staging folder beside its place and renamed, the notebook, which holds
the digests of all, last.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping, Sequence, Set
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

from thesis_lib import files, records
from thesis_lib.asides import aside
from thesis_lib.figure_sets import cube_file, keys, outside, recorded
from thesis_lib.figure_sets.registry import FIGURE_SETS
from thesis_lib.files import digest_of, shipped, staging, workplace
from thesis_lib.runs import edits as executed_notebook
from thesis_lib.runs.beforehand import made_beforehand
from thesis_lib.runs.tasks import RunError, Task, full_disk, log
from thesis_lib.studies import comparison, effort, reach
from thesis_lib.studies.commands import given
from thesis_lib.studies.published import published_path
from thesis_lib.studies.request import Study

_LAST_WORDS = "import thesis_lib.studies.effort\n\nprint(thesis_lib.studies.effort.told())"


@dataclass(frozen=True)
class Job:
    """One figure set to execute, and the files it makes."""

    study: Study  #: Validated parameters
    #: Where the executed notebook and the cube go
    notebook: Path
    cube: Path
    page: Path | None = None  #: Where the self-contained page goes, if one is wanted

    @property
    def targets(self) -> list[Path]:
        """All files that the job makes."""
        return [self.notebook, self.cube, *([self.page] if self.page else [])]


def source(name: str) -> Path:
    """The parameterised notebook of a figure set."""
    return outside.notebook(name) or shipped() / "notebooks" / f"{name}.ipynb"


def digest(job: Job) -> str:
    """Two digests of all that determines a job's files: of its words; of all else.

    That is cells, request, code, facts, data and lock. The page shows the difference from the
    published run, so that counts for it, too.
    """
    name, figure_set = job.study.name, FIGURE_SETS[job.study.name]
    notebook = json.loads(source(name).read_text(encoding="utf-8"))
    words = _words(notebook)
    cells = [
        [c["cell_type"], c["id"], "" if c["id"] in words else "".join(c["source"]), c["metadata"]]
        for c in notebook["cells"]
    ]
    drawing = figure_set.figure.partition(":")[0] or __name__
    beside = reach.file_of(figure_set.module).parent.glob("*.py")
    shown = keys.together([source(name), *beside, *keys.code_of(__name__, drawing)])
    shown.remove(source(name))  # of which the cells count
    inputs = [of.path for of in recorded.behind(job.study)]
    inputs += [published_path(name)] if job.page else []
    parts = [
        keys.key(figure_set, job.study),
        keys.digest([*shown, *keys.facts_of(shown)]),
        digest_of([*keys.assets_of(shown), *inputs]),
    ]
    told = (json.dumps(one, sort_keys=True).encode() for one in (words, [cells, *parts]))
    return " ".join(hashlib.sha256(one).hexdigest() for one in told)


def _words(notebook: Mapping[str, Any]) -> dict[str, str]:
    """Texts of a notebook's cells that are prose, by id."""
    return {
        c["id"]: "".join(c["source"]) for c in notebook["cells"] if c["cell_type"] == "markdown"
    }


def _only_words_changed(job: Job, made_from: str) -> bool:
    """Whether a job's files are there, of all that they would be made from but its words."""
    kept = records.read(job.notebook)
    same = kept is not None and kept.made_from.partition(" ")[2] == made_from.partition(" ")[2]
    return same and not records.damage(job.notebook, job.targets)


def _retold(job: Job) -> Any:
    """A job's executed notebook with the prose that its source has now."""
    document = json.loads(job.notebook.read_text(encoding="utf-8"))
    words = _words(json.loads(source(job.study.name).read_text(encoding="utf-8")))
    for cell in document["cells"]:
        if cell["id"] in words:
            cell["source"] = words[cell["id"]].splitlines(keepends=True)
    return document


def execute(job: Job, made_from: str) -> None:
    """Execute a job's notebook and put its files in place, with the digest of what it is made from.

    Raises
    ------
    RunError
        If a cell fails, or the process that executes them ends.
    """
    name = job.study.name
    with staging(job.notebook.parent) as folder:
        if _only_words_changed(job, made_from):
            _put(job, folder, _retold(job), made_from, [])
            return
        import nbformat  # papermill and nbconvert take a second to import

        from thesis_lib.runs import provenance

        executed, cube = folder / f"{name}.ipynb", folder / f"{name}.nc"
        _in_kernel(job, folder, executed, cube)
        notebook = nbformat.read(executed, as_version=4)
        executed_notebook.hide_staging(notebook, name)
        executed_notebook.place_figures(notebook)
        said = notebook.cells.pop().outputs[0]["text"]
        for told in json.loads(said)["asides"]:
            aside(f"{name}: {told}")
        cost = effort.heard(said, notebook.metadata["papermill"]["duration"], cube)
        result = cube_file.read(cube)
        about = provenance.record(job.study, result, cube, cost)
        notebook.metadata["thesis_lib"] = {"cube_sha256": about.sha256, **asdict(cost)}
        provenance.add(notebook, about, result, in_book=job.page is None)
        if job.page:
            _stand_alone(notebook, job.study, result)
        document = json.loads(nbformat.writes(notebook))
        _put(job, folder, document, made_from, [(cube, job.cube)])


def _put(
    job: Job, folder: Path, document: Any, made_from: str, ready: list[tuple[Path, Path]]
) -> None:
    """Put a job's files in place, the executed notebook, which holds the digests of all, last."""
    executed = folder / f"{job.study.name}.ipynb"
    if job.page:
        from thesis_lib.web.page import page

        executed.write_text(json.dumps(document), encoding="utf-8")
        html = folder / f"{job.study.name}.html"
        html.write_text(page(executed, job.study.title), encoding="utf-8")
        ready = [*ready, (html, job.page)]
    made = {place.name: place for place in job.targets if place != job.notebook}
    made |= {place.name: file for file, place in ready}
    sealed = records.seal(document, job.notebook.name, made_from, made)
    executed.write_text(sealed, encoding="utf-8")
    with files.one_at_a_time(job.notebook.parent):
        for file, place in [*ready, (executed, job.notebook)]:
            place.parent.mkdir(parents=True, exist_ok=True)
            file.replace(place)


def _in_kernel(job: Job, folder: Path, executed: Path, cube: Path) -> None:
    """Execute a job's cells, and one more that tells what it took."""
    import nbformat
    import papermill
    from nbclient.exceptions import DeadKernelError

    from thesis_lib.runs import kernel

    name = job.study.name
    asked = nbformat.read(source(name), as_version=4)
    asked.cells.append(nbformat.v4.new_code_cell(_LAST_WORDS, id="last-words"))
    nbformat.write(asked, folder / "asked.ipynb")
    try:
        papermill.execute_notebook(
            str(folder / "asked.ipynb"),
            str(executed),
            parameters={**given(job.study), "cube": str(cube)},
            kernel_name="python3",
            language="python",
            kernel_manager_class=kernel.manager(folder / "kernel"),
            progress_bar=False,
            store_widget_state=False,
        )
    except papermill.PapermillExecutionError as error:
        kept = log(name, re.sub(r"\x1b\[[0-9;]*m", "", str(error)))
        if full := full_disk(folder):
            raise RunError(f"{name}: {full}") from None
        why = f"{error.ename}: {' '.join(error.evalue.split())}"
        codes = [cell for cell in asked.cells if cell.cell_type == "code"]
        tags = [cell.metadata.get("tags", []) for cell in codes]
        injected = next(i for i, tagged in enumerate(tags, 1) if "parameters" in tagged)
        number = error.exec_count - (error.exec_count > injected)
        raise RunError(
            f"{name}: cell {number} failed with {why}; {kept}; "
            "mend the cause and run the same command again"
        ) from None
    except (DeadKernelError, RuntimeError) as error:
        raise RunError(
            full_disk(folder)
            or f"{name}: the process that executes its notebook has ended ({error}), killed or "
            "short of memory; run the same command again"
        ) from None


def _stand_alone(notebook: Any, study: Study, result: Any) -> None:
    """What only a page of its own says: how its numbers differ from the published ones."""
    import nbformat

    text = "\n".join(comparison.difference_lines(result))
    text = f"## Difference from the published run\n\n```text\n{text}\n```"
    cell = nbformat.v4.new_markdown_cell(text, id=f"{study.name}-difference")
    notebook.cells.insert(-1, cell)
    if FIGURE_SETS[study.name].reads():
        executed_notebook.cut_links(notebook)


def job_tasks(jobs: Sequence[Job], seconds: Mapping[str, float] | None = None) -> list[Task]:
    """The jobs as tasks; what needs another's cube, or the same recordings, waits for it.

    What a set needs beside the cubes of others that it reads comes first.
    `seconds` are those that figure sets are known to take, by name.
    """
    first = {job.study.digest: job.study.name for job in jobs}  # to make what others need, too
    tasks: list[Task] = []
    for job in jobs:
        name, files = job.study.name, list[Path]()
        figure_set = FIGURE_SETS[name]
        needed = [asked.digest for _, asked in figure_set.needs(job.study).values()]
        after = {first.setdefault(each, name) for each in needed}
        if read := {one.name for one in figure_set.reads()}:
            files, after = _cubes(read, jobs), read & set(first.values())
            if len(jobs) > 1:
                early = made_beforehand(job.study, seconds or {})
                tasks.insert(0, early)
                after.add(early.name)
        one = Task(
            name,
            partial(execute, job),
            makes=job.targets,
            record=job.notebook,
            needs=files,
            key=digest(job),
            after=frozenset(after - {name}),
            seconds=(seconds or {}).get(name, 0.0),
            elsewhere=True,
        )
        tasks.append(one)
    return tasks


def _cubes(others: Set[str], jobs: Sequence[Job]) -> list[Path]:
    """Cubes of figure sets that another reads: those of this run, else those of the last book."""
    made = {job.cube.name: job.cube for job in jobs if job.study.name in others}
    results = workplace() / "data" / "results"
    there = {path.name: path for path in results.glob("*.nc") if path.stem in others}
    return sorted({**there, **{n: p for n, p in made.items() if p.parent == results}}.values())
