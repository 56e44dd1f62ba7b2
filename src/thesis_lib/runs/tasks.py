"""Tasks: each makes files from files, in the order in which they need each other, nothing twice.

What was done is not remembered apart from what was made: beside or in its files a task leaves a
record of digests (:mod:`thesis_lib.records`), and is run again unless all of them agree.
"""

from __future__ import annotations

import contextlib
import re
import shutil
import traceback
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass
from graphlib import TopologicalSorter
from pathlib import Path

from thesis_lib import records
from thesis_lib.asides import aside, live, say
from thesis_lib.files import cache_folder, digest_of, sweep, workplace
from thesis_lib.runs.progress import Progress, urgency
from thesis_lib.studies.lock import differing_packages
from thesis_lib.text import message, of_error
from thesis_lib.web.page import BookError

_FULL = 2**20  # bytes: a disk with less is full
_SILENCE = 60.0  # s, after which what is at work is told


class RunError(RuntimeError):
    """A run that failed; the message says what, where, and how to go on.

    `failed` tells why, by name; `unmet` are the names of those not run since others failed.
    """

    def __init__(
        self, message: str, failed: Mapping[str, str] | None = None, unmet: Iterable[str] = ()
    ) -> None:
        super().__init__(message)
        self.failed, self.unmet = dict(failed or {}), frozenset(unmet)


@dataclass(frozen=True)
class Task:
    """Something to do that makes files."""

    name: str  #: What it is called
    #: Does it, and leaves the record last; given the digest of all that it is made from
    act: Callable[[str], object]
    makes: Sequence[Path]  #: Files, and folders as a whole
    record: Path  #: Where the record is
    needs: Sequence[Path] = ()  #: Files that it depends on; what makes one of them comes before
    key: str = ""  #: What else it depends on
    after: frozenset[str] = frozenset()  #: Names of tasks that come before, if they are there
    always: bool = False  #: Whether to do it even if it is up to date
    seconds: float = 0.0  #: How long it will take; 0 if that is not known
    elsewhere: bool = False  #: Whether another process does it

    def made_from(self) -> str:
        """Digest of all that it depends on, as it is now."""
        return f"{self.key}{digest_of(self.needs)}"

    def damage(self, made_from: str) -> str | None:
        """None if it is up to date; else what is wrong with what was made, if anything is."""
        found = records.damage(self.record, self.makes)
        kept = records.read(self.record)
        fits = kept is not None and kept.made_from == made_from
        return None if fits and not found else found

    def is_stale(self) -> bool:
        """Whether it will be done; what cannot be told now is told when its turn comes."""
        try:
            return self.always or self.damage(self.made_from()) is not None
        except OSError:
            return True


def task(
    name: str,
    action: Callable[[], object],
    needs: Sequence[Path],
    makes: Sequence[Path],
    key: str = "",
    record: Path | None = None,
    always: bool = False,
    seconds: float = 0.0,
    elsewhere: bool = False,
) -> Task:
    """A task whose record is a file of its own."""
    place = record or workplace() / "build" / "made" / f"{_slug(name)}.json"

    def act(made_from: str) -> None:
        action()
        records.write(place, made_from, makes)

    return Task(
        name, act, makes, place, needs, key, always=always, seconds=seconds, elsewhere=elsewhere
    )


def run(tasks: Sequence[Task], workers: int = 2) -> dict[str, float]:
    """Run what is stale of some tasks, so many at a time, those first that most waits for.

    Beside those that other processes do, one more is done here, where only one can compute.

    Returns the seconds of each task that was not up to date, by its name.

    Raises
    ------
    RunError
        If a task failed; the others have been run all the same.
    """
    for differs in differing_packages():
        aside(f"{differs}: results may differ; `make book` in a fresh clone installs the lock's")
    build = workplace() / "build"
    made = [file.parent for one in tasks for file in (one.record, *one.makes)]
    sweep(*dict.fromkeys([build, cache_folder(), *made]))
    named = {one.name: one for one in tasks}
    waits = _waits(tasks)
    progress, stale = Progress(len(tasks)), _to_do(tasks)
    if any(stale.values()):  # of a book; a run says what it runs anyway
        progress.say(f"{len(stale)} of {len(tasks)} steps to do")
    failed: dict[str, str] = {}
    unmet: set[str] = set()
    order: TopologicalSorter[str] = TopologicalSorter(dict.fromkeys(named, ()))
    for name, others in waits.items():
        order.add(name, *others)
    order.prepare()
    pool = ThreadPoolExecutor(workers + 1)
    most = urgency(dict.fromkeys(named, 0.0) | stale, waits)
    at_work: dict[Future[str], str] = {}
    ready: list[str] = []
    try:
        while order.is_active():
            ready = sorted([*ready, *order.get_ready()], key=lambda name: -most[name])
            for name in [one for one in ready if waits[one] & failed.keys()]:
                failed[name] = (
                    f"not run, since {', '.join(sorted(waits[name] & failed.keys()))} failed"
                )
                unmet.add(name)
                progress.end(name, measured=False)
                order.done(name)
                ready.remove(name)
            for name in [*ready]:
                if _may_begin(named[name], [named[one] for one in at_work.values()], workers):
                    ready.remove(name)
                    at_work[pool.submit(_one, named[name], progress)] = name
            passing = live()
            ended = wait(at_work, 1 if passing else _SILENCE, FIRST_COMPLETED).done
            if at_work and not ended:
                progress.report_running(passing)
            for future in ended:
                name = at_work.pop(future)
                if problem := future.result():
                    failed[name] = problem
                order.done(name)
    finally:  # an interrupt does not wait for what is under way
        if live():
            say("", passing=True)
        pool.shutdown(wait=False, cancel_futures=True)
    if failed:
        told = {n: t if t.startswith(n) else f"{n}: {t}" for n, t in failed.items()}
        raise RunError("\n".join(told.values()), told, unmet)
    return progress.took


def _may_begin(task: Task, at_work: Sequence[Task], workers: int) -> bool:
    """Whether there is room for a task beside others."""
    elsewhere = sum(one.elsewhere for one in at_work)
    here = len(at_work) - elsewhere
    if task.elsewhere:
        return elsewhere < workers and len(at_work) <= workers
    return here < (1 if elsewhere else workers)


def _makers(tasks: Sequence[Task]) -> dict[str, set[str]]:
    """Of each task the names of those that make what it is made from."""
    maker = {path: one.name for one in tasks for path in one.makes}
    return {one.name: {maker[p] for p in one.needs if p in maker} - {one.name} for one in tasks}


def _waits(tasks: Sequence[Task]) -> dict[str, set[str]]:
    """Of each task the names of those that come before it."""
    makers = _makers(tasks)
    return {one.name: makers[one.name] | (one.after & makers.keys()) for one in tasks}


def _to_do(tasks: Sequence[Task]) -> dict[str, float]:
    """Return the seconds of what is stale or made from what is stale, 0 where unknown."""
    named, makers = {one.name: one for one in tasks}, _makers(tasks)
    found = set[str]()
    for name in TopologicalSorter(makers).static_order():
        if makers[name] & found or named[name].is_stale():
            found.add(name)
    return {name: one.seconds for name, one in named.items() if name in found}


def _one(task: Task, progress: Progress) -> str:
    """Do a task unless it is up to date; what went wrong, or nothing."""
    problem = ""
    progress.begin(task.name)
    try:
        # The digest is taken before the run: what is edited during it makes its files stale.
        made_from = task.made_from()
        damage = "" if task.always else task.damage(made_from)
        if damage is None:
            progress.end(task.name, measured=False)
            progress.say(f"{task.name}: up to date")
            return ""
        told = f"{damage}; it is made anew" if damage else "running"
        progress.say(f"{task.name}: {told}")
        task.act(made_from)
    except (RunError, BookError) as error:  # warnings of a book are told in lines of their own
        problem = "\n".join(map(message, str(error).splitlines()))
    except Exception as error:
        found = full_disk(task.record.parent) or f"{of_error(error)}; {log(task.name)}"
        problem = message(found)
    took = progress.end(task.name, measured=not problem)
    how = "FAILED" if problem else f"done in {took:.1f} s"
    progress.say(f"{task.name}: {how}")
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
