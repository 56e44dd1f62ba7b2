"""Workers of a study: processes of this machine, which open no port, or an existing Dask cluster.

Which of them compute a study is no parameter of it: it changes nothing in the cube. It comes by
``thesis run --scheduler``, or by the environment variable ``THESIS_SCHEDULER`` where papermill runs
a notebook. A cluster needs ``distributed`` (``pip install thesis-lib[scale]``), whose configuration
has the keys for TLS.
"""

from __future__ import annotations

import asyncio
import logging
import multiprocessing
import os
import platform
import re
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError, Executor, ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from importlib.metadata import version
from typing import Any

from thesis_lib.files import library_digest

SCHEDULER_VARIABLE = "THESIS_SCHEDULER"
PROCESS_SCHEDULER = "processes"
ALLOWED_TEXT = (
    f"allowed: {PROCESS_SCHEDULER}, or tcp://HOST:PORT or tls://HOST:PORT of a Dask scheduler"
)
MAX_WAIT_S = 10.0  # for a scheduler, and for its first worker
THREAD_VARIABLES = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
)  # of BLAS, one a process


class SchedulerError(RuntimeError):
    """Workers that cannot be had; the message is one line: which, what is wrong, how to go on."""


def check_address(scheduler: str) -> str:
    """Return the scheduler as it was given, or raise ValueError with what is allowed.

    Examples
    --------
    >>> check_address("tcp://10.0.0.5:8786"), check_address("tcp://[::1]:8786")
    ('tcp://10.0.0.5:8786', 'tcp://[::1]:8786')
    """
    match = re.fullmatch(
        r"t(?:cp|ls)://(?:[\w.-]+|\[[0-9A-Fa-f:.]+\]):(\d{1,5})", scheduler, re.ASCII
    )
    if scheduler != PROCESS_SCHEDULER and not (match and 0 < int(match[1]) < 2**16):
        raise ValueError(f"given {scheduler!r:.80}, {ALLOWED_TEXT}")
    return scheduler


def from_environment() -> str:
    """Return the scheduler that ``THESIS_SCHEDULER`` asks for, or empty."""
    given = os.environ.get(SCHEDULER_VARIABLE, "")
    try:
        return check_address(given) if given else ""
    except ValueError as error:
        raise ValueError(f"{SCHEDULER_VARIABLE}: {error}") from None


def describe_alone(name: str) -> str:
    """Describe a figure set that no scheduler can help."""
    return f"{name} is not cut into pieces: it runs in one process, without the scheduler"


def check_scheduler(scheduler: str) -> None:
    """Refuse, before anything starts, a scheduler that cannot be used."""
    if scheduler != PROCESS_SCHEDULER:
        with _cluster(scheduler):
            pass


def map_in_order(
    work: Callable[[Any], Any], pieces: Sequence[Any], scheduler: str
) -> Iterator[Any]:
    """Yield what workers make of pieces, in the order of the pieces; or raise SchedulerError."""
    with _processes() if scheduler == PROCESS_SCHEDULER else _cluster(scheduler) as executor:
        yield from executor.map(work, pieces)


@contextmanager
def _processes() -> Iterator[Executor]:
    """Start processes that speak through pipes which nobody else can open."""
    for name in THREAD_VARIABLES:
        os.environ.setdefault(name, "1")  # which spawned processes inherit
    count = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    try:
        with ProcessPoolExecutor(count, multiprocessing.get_context("spawn")) as pool:
            yield pool
    except BrokenProcessPool:
        raise SchedulerError(
            "a worker process ended before its work; run without --scheduler, or give it memory"
        ) from None


@contextmanager
def _cluster(scheduler: str) -> Iterator[Executor]:
    """Connect to an existing cluster whose workers have this library, as it is here."""
    try:
        import distributed
    except ImportError:
        raise SchedulerError(
            f"scheduler {scheduler}: the package distributed is not installed; "
            "pip install thesis-lib[scale], or run without a scheduler"
        ) from None
    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # what matters is raised here
    try:
        _check_address(scheduler)
        client = distributed.Client(scheduler, timeout=MAX_WAIT_S, set_as_default=False)
    except (OSError, TimeoutError) as error:
        raise SchedulerError(
            f"scheduler {scheduler}: no scheduler answers there within {MAX_WAIT_S:g} s "
            f"({type(error).__name__}); start one (dask scheduler), or run without"
        ) from None
    with client:
        _check_workers(client, scheduler)
        try:
            yield client.get_executor(pure=False)
        except (distributed.KilledWorker, CancelledError) as error:
            raise SchedulerError(
                f"scheduler {scheduler}: workers ended before their work "
                f"({type(error).__name__}); give them memory, and run the same command again"
            ) from None


def _check_address(scheduler: str) -> None:
    """Raise an error where nothing answers; a client would wait for ever at a mute port."""
    from distributed import Security
    from distributed.comm.core import connect

    async def greet() -> None:
        keys = Security().get_connection_args("client")
        (await asyncio.wait_for(connect(scheduler, MAX_WAIT_S, **keys), MAX_WAIT_S)).abort()

    with ThreadPoolExecutor(1) as thread:  # a notebook's own thread has a loop already
        thread.submit(asyncio.run, greet()).result()


def _check_workers(client: Any, scheduler: str) -> None:
    """Refuse a cluster without workers, and workers that would compute other last bits."""
    try:
        client.wait_for_workers(1, timeout=MAX_WAIT_S)
    except TimeoutError:
        raise SchedulerError(
            f"scheduler {scheduler}: it has no worker within {MAX_WAIT_S:g} s; "
            f"start some (dask worker {scheduler}), and run the same command again"
        ) from None
    here = common_versions()
    for worker, there in client.run(common_versions, on_error="return").items():
        if there != here:
            raise SchedulerError(
                f"scheduler {scheduler}: worker {worker} has {there}, here {here}; "
                "install the same versions there and restart it"
            )


def common_versions() -> dict[str, str]:
    """Return what a worker must have in common with the client."""
    packages = {name: version(name) for name in ("numpy", "scipy", "scikit-fem")}
    python = ".".join(platform.python_version_tuple()[:2])
    return {"Python": python, **packages, "library": library_digest()[:12]}
