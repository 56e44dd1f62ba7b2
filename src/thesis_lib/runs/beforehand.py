"""What the ledger needs beside the cubes of all others, made while these are.

Its other readings and own runs take most of its time and rest on no cube, so they need not wait for
one. They are computed in a process of their own, as isolated as a notebook's kernel, and kept where
the ledger's notebook finds them; whatever is not found there it computes itself.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Mapping
from functools import partial

from thesis_lib.figure_sets import keys
from thesis_lib.figure_sets.registry import FIGURE_SETS, validate
from thesis_lib.figure_sets.run import made
from thesis_lib.files import cache_folder, staging
from thesis_lib.runs.kernel import kernel_environment
from thesis_lib.runs.tasks import RunError, Task, task
from thesis_lib.studies.request import Study

_START = f"from {__name__} import make; make()"


def made_beforehand(asked: Study, seconds: Mapping[str, float]) -> Task:
    """The task to make what a figure set needs; its record goes where what is made goes.

    `seconds` are those that tasks are known to take, by name.
    """
    needs = FIGURE_SETS[asked.name].needs(asked).values()
    name, cache = f"{asked.name}, beforehand", cache_folder()
    return task(
        name,
        partial(_in_a_process, asked, name),
        [],
        [],
        key=" ".join(keys.key(*each) for each in needs),
        record=cache / f"{asked.name}-beforehand.json",
        seconds=seconds.get(name, 0.0),
        elsewhere=True,
    )


def _in_a_process(asked: Study, name: str) -> None:
    cache = cache_folder()
    with staging(cache) as home:
        done = subprocess.run(
            [sys.executable, "-c", _START, asked.name, json.dumps(asked.request)],
            env=kernel_environment(os.environ, home),
            stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, check=False,
        )  # fmt: skip
    if done.returncode:
        last = (done.stderr.strip().splitlines() or [f"exit status {done.returncode}"])[-1]
        raise RunError(f"{name}: {last}")


def make() -> None:
    """Make what the request on the command line needs, and keep it."""
    asked = validate(sys.argv[1], json.loads(sys.argv[2]))
    for needed in FIGURE_SETS[asked.name].needs(asked).values():
        made(*needed)
