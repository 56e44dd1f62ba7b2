"""Tasks: each makes files from files, in the order in which they need each other, nothing twice.

What was done is not remembered apart from what was made: beside or in its files a task leaves a
record of digests (:mod:`thesis_lib.records`), and is run again unless all of them agree.
"""

from __future__ import annotations

import contextlib
import re
import shutil
import sys
import time
import traceback
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass, field
from graphlib import TopologicalSorter
from pathlib import Path

from thesis_lib import records
from thesis_lib.files import digest_of, sweep, workplace
from thesis_lib.text import message, of_error
from thesis_lib.web.page import BookError

_FULL = 2**20  # bytes: a disk with less is full


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
class Task:
    """Something to do that makes files.

    Parameters
    ----------
    name : str
        What it is called.
    act : callable
        Does it, and leaves the record last; given the digest of all that it is made from.
    makes : sequence of Path
        Files, and folders as a whole.
    record : Path
        Where the record is.
    needs : sequence of Path
        Files that it depends on; what makes one of them comes before.
    key : str
        What else it depends on.
    after : frozenset of str
        Names of tasks that come before, if they are there.
    always : bool
        Whether to do it even if it is up to date.
    """

    name: str
    act: Callable[[str], object]
    makes: Sequence[Path]
    record: Path
    needs: Sequence[Path] = ()
    key: str = ""
    after: frozenset[str] = frozenset()
    always: bool = False

    def made_from(self) -> str:
        """Digest of all that it depends on, as it is now."""
        return f"{self.key}{digest_of(self.needs)}"

    def damage(self, made_from: str) -> str | None:
        """None if it is up to date; else what is wrong with what was made, if anything is."""
        found = records.damage(self.record, self.makes)
        kept = records.read(self.record)
        fits = kept is not None and kept.made_from == made_from
        return None if fits and not found else found


def task(
    name: str, action: Callable[[], object], needs: Sequence[Path], makes: Sequence[Path],
    key: str = "", record: Path | None = None, always: bool = False,
) -> Task:  # fmt: skip
    """A task whose record is a file of its own."""
    place = record or workplace() / "build" / "made" / f"{_slug(name)}.json"

    def act(made_from: str) -> None:
        action()
        records.write(place, made_from, makes)

    return Task(name, act, makes, place, needs, key, always=always)


@dataclass
class _Progress:
    """How many tasks there are, how many are done, and since when."""

    total: int
    done: int = 0
    begin: float = field(default_factory=time.monotonic)

    def say(self, name: str, text: str) -> None:
        elapsed = time.monotonic() - self.begin
        line = message(f"{name}: {text}")
        with contextlib.suppress(OSError, ValueError):  # nobody listens any more
            sys.stderr.write(f"[{self.done}/{self.total}] {elapsed:5.1f} s  {line}\n")
            sys.stderr.flush()


def run(tasks: Sequence[Task], workers: int = 2) -> None:
    """Run what is stale of some tasks, side by side.

    Parameters
    ----------
    tasks : sequence of Task
        Tasks, of which those at the beginning begin first.
    workers : int
        Tasks at a time.

    Raises
    ------
    RunError
        If a task failed; the others have been run all the same.
    """
    build = workplace() / "build"
    made = [file.parent for one in tasks for file in (one.record, *one.makes)]
    sweep(*dict.fromkeys([build, build / "cache", *made]))
    progress = _Progress(len(tasks))
    named = {one.name: one for one in tasks}
    waits = _waits(tasks)
    failed: dict[str, str] = {}
    unmet: set[str] = set()
    order: TopologicalSorter[str] = TopologicalSorter(dict.fromkeys(named, ()))
    for name, others in waits.items():
        order.add(name, *others)
    order.prepare()
    pool = ThreadPoolExecutor(workers)
    at_work: dict[Future[str], str] = {}
    try:
        while order.is_active():
            for name in order.get_ready():
                if without := sorted(waits[name] & failed.keys()):
                    failed[name] = f"not run, since {', '.join(without)} failed"
                    unmet.add(name)
                    progress.done += 1
                    order.done(name)
                else:
                    at_work[pool.submit(_one, named[name], progress)] = name
            for future in wait(at_work, return_when=FIRST_COMPLETED).done:
                name = at_work.pop(future)
                if problem := future.result():
                    failed[name] = problem
                order.done(name)
    finally:  # an interrupt does not wait for what is under way
        pool.shutdown(wait=False, cancel_futures=True)
    if failed:
        told = {n: t if t.startswith(n) else f"{n}: {t}" for n, t in failed.items()}
        raise RunError("\n".join(told.values()), told, unmet)


def _waits(tasks: Sequence[Task]) -> dict[str, set[str]]:
    """Of each task the names of those that come before it."""
    maker = {path: one.name for one in tasks for path in one.makes}
    names = {one.name for one in tasks}
    return {
        one.name: ({maker[p] for p in one.needs if p in maker} | (one.after & names)) - {one.name}
        for one in tasks
    }


def _one(task: Task, progress: _Progress) -> str:
    """Do a task unless it is up to date; what went wrong, or nothing."""
    problem = ""
    started = time.monotonic()
    try:
        # The digest is taken before the run: what is edited during it makes its files stale.
        made_from = task.made_from()
        damage = "" if task.always else task.damage(made_from)
        if damage is None:
            progress.done += 1
            progress.say(task.name, "up to date")
            return ""
        progress.say(task.name, f"{damage}; it is made anew" if damage else "running")
        task.act(made_from)
    except (RunError, BookError) as error:  # warnings of a book are told in lines of their own
        problem = "\n".join(map(message, str(error).splitlines()))
    except Exception as error:
        found = full_disk(task.record.parent) or f"{of_error(error)}; {log(task.name)}"
        problem = message(found)
    progress.done += 1
    took = f"done in {time.monotonic() - started:.1f} s"
    progress.say(task.name, "FAILED" if problem else took)
    return problem


def _slug(name: str) -> str:
    return re.sub(r"[^\w-]+", "-", name)


def full_disk(*places: Path) -> str:
    """What to say if one of the disks in use is full; libraries find odd words for that."""
    for place in (*places, workplace()):
        with contextlib.suppress(OSError):
            if shutil.disk_usage(place).free < _FULL:
                return f"the disk of {place} is full; make room, and run the same command again"
    return ""


def log(name: str, text: str = "") -> str:
    """Keep a traceback, by default of what is being handled; says where it is, or why it is not."""
    path = workplace() / "build" / "logs" / f"{_slug(name)}.txt"
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text or traceback.format_exc(), encoding="utf-8")
    except OSError as error:
        return f"the traceback could not be kept ({of_error(error)})"
    return f"the traceback is in {path}"
