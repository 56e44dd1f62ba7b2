"""Runs that are killed at the n-th change of a file: ``python killing.py DIR EVERY``.

DIR holds what the kernel makes of two requests, ``A`` and ``B``, as notebook and cube; here a
kernel only hands that out, so that a run takes no time. All else is as in a real run, and happens
in a process of its own that is killed with SIGKILL just before its n-th creation, renaming or
removal of a file or folder, for every EVERY-th n until nothing is left to be killed.
"""

from __future__ import annotations

import json
import os
import shutil
import signal
import sys
from pathlib import Path

from thesis_lib import records
from thesis_lib.figure_sets.registry import validate
from thesis_lib.outputs import RECORD
from thesis_lib.runs import execute as runs
from thesis_lib.runs import tasks
from thesis_lib.web import page as pages

NAME = "beam-distance"
REQUESTS = {"A": {"trials": 1, "modes": [1]}, "B": {"trials": 1, "modes": [2]}}
CHANGES = {"os.mkdir", "os.rename", "os.remove", "os.rmdir", "os.chmod", "os.link", "os.truncate"}


def job(which: str, out: Path) -> runs.Job:
    places = (out / f"{NAME}.{kind}" for kind in ("ipynb", "nc", "html"))
    return runs.Job(validate(NAME, REQUESTS[which]), *places)


def hand_out(canned: Path, which: str) -> None:
    """Have the kernel's work done beforehand, and a page that is quickly made."""

    def in_kernel(job: runs.Job, folder: Path, executed: Path, cube: Path) -> None:
        shutil.copy(canned / which / executed.name, executed)
        shutil.copy(canned / which / cube.name, cube)

    runs._in_kernel = in_kernel
    pages.page = lambda notebook, title: title + notebook.read_text(encoding="utf-8")


def place(arguments: tuple[object, ...]) -> str:
    """What an event is about; of what is named within an open folder, with the folder's path."""
    name, last = str(arguments[0]), arguments[-1]
    if name.startswith("/") or not isinstance(last, int) or last < 0:
        return name
    return str(Path(f"/proc/self/fd/{last}").readlink() / name)


def kill_at(number: int, below: Path) -> None:
    """Kill this process just before it changes files for the n-th time."""
    left = number

    def hook(event: str, arguments: tuple[object, ...]) -> None:
        nonlocal left
        writes = event == "open" and isinstance(arguments[2], int) and arguments[2] & 0o103
        if (writes or event in CHANGES) and place(arguments).startswith(str(below)):
            left -= 1
            if left == 0:
                os.kill(os.getpid(), signal.SIGKILL)

    sys.addaudithook(hook)


def attempt(canned: Path, out: Path, which: str, number: int = 0) -> int:
    """Run in a process of its own, killed or not; its status."""
    child = os.fork()
    if not child:
        os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
        hand_out(canned, which)
        if number:
            kill_at(number, out.parent)
        try:
            tasks.run(runs.job_tasks([job(which, out)]))
        except BaseException:
            os._exit(1)
        os._exit(0)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def wrong(canned: Path, out: Path, which: str) -> str:
    """What is not as it should be after a run that nobody disturbed; empty if all is."""
    wanted = job(which, out)
    here = sorted(path.name for path in out.iterdir() if path.name != RECORD)
    if here != sorted(path.name for path in wanted.targets):
        return f"there is {here}"
    if wanted.cube.read_bytes() != (canned / which / wanted.cube.name).read_bytes():
        return "another cube"
    kept = records.read(wanted.notebook)
    if kept is None or kept.made_from != runs.job_tasks([wanted])[0].made_from():
        return "another request's record"
    return records.damage(wanted.notebook, wanted.targets)


def main(folder: Path, every: int) -> None:
    """Print how many points there are, and what went wrong at which, as JSON."""
    work = folder / "work"
    tasks.workplace = lambda: work
    bad, counts = [], []
    for before in ("", "A"):  # into a new folder; B into A's folder, and then A again
        which = "B" if before else "A"
        for number in range(1, 1000, every):
            out = work / "out"
            shutil.rmtree(work, ignore_errors=True)
            work.mkdir(parents=True)
            if before and attempt(folder, out, before) != 0:
                bad.append("the run before failed")
            killed = attempt(folder, out, which, number)
            for again in [before, which] if before else [which]:
                status = attempt(folder, out, again)
                problem = wrong(folder, out, again) if status == 0 else f"status {status}"
                if problem:
                    bad.append(f"{which} killed at {number}, then {again}: {problem}")
            if left := [path.name for path in work.rglob(".staging-*")]:
                bad.append(f"{which} killed at {number}: left {left}")
            if killed == 0:
                break
        counts.append(number - 1)
    print(json.dumps({"points": counts, "bad": bad}))


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]))
