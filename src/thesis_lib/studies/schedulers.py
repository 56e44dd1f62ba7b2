"""Workers: processes of this machine, which open no port, or an existing Dask cluster.

Which scheduler computes a study is no parameter of it: it changes nothing in the cube. It comes by
``thesis run --scheduler``, or by the environment variable ``THESIS_SCHEDULER`` where papermill runs
a notebook. ``distributed`` (``pip install thesis-lib[scale]``) is imported when a cluster is asked
for, and not before; its keys for TLS come from Dask's own configuration.

Work goes out a few pieces ahead of what is taken, and comes back in its order. Dask computes again
what was lost with a worker. Every wait is bounded. Workers may come and go: each piece comes back
with what its worker is, and one that differs from here, however late it joined, ends the run.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import multiprocessing
import os
import platform
import re
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import CancelledError, ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from importlib.metadata import version
from typing import Any

import numpy as np
import scipy

from thesis_lib.files import library_digest

ENVIRONMENT = "THESIS_SCHEDULER"
PROCESSES = "processes"
ALLOWED = f"allowed: {PROCESSES}, or tcp://HOST:PORT or tls://HOST:PORT of a Dask scheduler"
WAIT_S = 10.0  # for a scheduler, and for a first worker
LOST_S = 60.0  # for what workers say of themselves, and for any worker while there is work
AHEAD = 2  # pieces sent out beforehand, for each worker
# Of worker processes: a BLAS thread each
WORKER = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}


class SchedulerError(RuntimeError):
    """Workers that cannot be had; the message is one line: which, what is wrong, how to go on."""


def checked(scheduler: str) -> str:
    """The scheduler as it was given.

    Parameters
    ----------
    scheduler : str
        ``processes`` for worker processes on this machine, as many as it has cores, or
        ``tcp://HOST:PORT`` or ``tls://HOST:PORT`` for an existing cluster.

    Raises
    ------
    ValueError
        In one line: what was given, what is allowed.

    Examples
    --------
    >>> checked("tcp://10.0.0.5:8786"), checked("tcp://[::1]:8786")
    ('tcp://10.0.0.5:8786', 'tcp://[::1]:8786')
    """
    match = re.fullmatch(
        r"t(?:cp|ls)://(?:[\w.-]+|\[[0-9A-Fa-f:.]+\]):(\d{1,5})", scheduler, re.ASCII
    )
    if scheduler != PROCESSES and not (match and 0 < int(match[1]) < 2**16):
        raise ValueError(f"given {scheduler!r:.80}, {ALLOWED}")
    return scheduler


def from_environment() -> str:
    """The scheduler that ``THESIS_SCHEDULER`` asks for, or empty.

    Raises
    ------
    ValueError
        As :func:`checked`.
    """
    given = os.environ.get(ENVIRONMENT, "")
    try:
        return checked(given) if given else ""
    except ValueError as error:
        raise ValueError(f"{ENVIRONMENT}: {error}") from None


def alone(name: str) -> str:
    """What is said of a figure set that no scheduler can help."""
    return f"{name} is not cut into pieces: it runs in one process, without the scheduler"


def check(scheduler: str) -> None:
    """Refuse, before anything starts, a scheduler that cannot be used.

    Raises
    ------
    SchedulerError
        As :func:`workers`; that worker processes of this machine start is left to them.
    """
    if scheduler != PROCESSES:
        with workers(scheduler):
            pass


def _distributed(scheduler: str) -> Any:
    try:
        import distributed
    except ImportError:
        raise SchedulerError(
            f"scheduler {scheduler}: the package distributed is not installed; "
            "pip install thesis-lib[scale], or run without a scheduler"
        ) from None
    return distributed


@contextlib.contextmanager
def workers(scheduler: str) -> Iterator[Any]:
    """A client of workers that have this library, as it is here.

    Parameters
    ----------
    scheduler : str
        As in :func:`checked`.

    Yields
    ------
    distributed.Client
        A client.

    Raises
    ------
    SchedulerError
        If ``distributed`` is not installed, nothing answers within ``WAIT_S``, or a worker has
        another state of the library or of NumPy, whose last bits might differ.
    """
    distributed = _distributed(scheduler)
    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # what matters is raised here
    _check_address(scheduler)
    with distributed.Client(scheduler, timeout=WAIT_S, set_as_default=False) as client:
        _check(client, scheduler)
        yield client


def by_processes(work: Callable[[Any], Any], pieces: Iterable[Any]) -> Iterator[tuple[Any, Any]]:
    """Yield pieces and what processes of this machine make of them, in their order.

    They speak through pipes that nobody else can open.

    Raises
    ------
    SchedulerError
        If a process ends before its work, as where memory is short.
    """
    count = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    under_way: deque[tuple[Any, Any]] = deque()
    before = {name: os.environ.get(name) for name in WORKER}
    os.environ.update(WORKER)  # which spawned processes inherit
    pool = ProcessPoolExecutor(count, multiprocessing.get_context("spawn"))
    try:
        for piece in pieces:
            under_way.append((piece, pool.submit(work, piece)))
            if len(under_way) > AHEAD * (count or 1):
                piece, future = under_way.popleft()
                yield piece, future.result()
        while under_way:
            piece, future = under_way.popleft()
            yield piece, future.result()
    except BrokenProcessPool:
        raise SchedulerError(
            "a worker process ended before its work; run without --scheduler, or give it memory"
        ) from None
    finally:
        for name, value in before.items():
            os.environ.pop(name) if value is None else os.environ.update({name: value})
        pool.shutdown(wait=True, cancel_futures=True)


def _check_address(scheduler: str) -> None:
    """Refuse an address where no scheduler says who it is; a client alone would wait for ever."""
    from distributed import rpc

    async def ask() -> Any:
        async with rpc(scheduler, timeout=WAIT_S) as there:
            return await there.identity()

    def wait() -> Any:
        return asyncio.run(asyncio.wait_for(ask(), WAIT_S))

    try:
        with ThreadPoolExecutor(1) as thread:  # a notebook's own thread has a loop already
            who = thread.submit(wait).result()["type"]
        problem = "" if who == "Scheduler" else "another server"
    except Exception as error:  # what another server says can be anything
        problem = type(error).__name__
    if problem:
        raise SchedulerError(
            f"scheduler {scheduler}: no scheduler answers there within {WAIT_S:g} s ({problem}); "
            "start one (dask scheduler), or run without"
        )


def _check(client: Any, scheduler: str) -> None:
    """Refuse a cluster without workers, and workers with another state of the library."""
    try:
        client.wait_for_workers(1, timeout=WAIT_S)
    except TimeoutError:
        raise SchedulerError(
            f"scheduler {scheduler}: it has no worker within {WAIT_S:g} s; "
            f"start some (dask worker {scheduler}), and run the same command again"
        ) from None
    try:
        said = client.run(standing, on_error="return", callback_timeout=LOST_S)
    except TimeoutError:
        raise SchedulerError(
            f"scheduler {scheduler}: its workers do not answer within {LOST_S:g} s; "
            "restart them, and run the same command again"
        ) from None
    for worker, there in said.items():
        _refuse_other(f"scheduler {scheduler}: worker {worker}", there)


def _refuse_other(who: str, there: Any) -> None:
    """Refuse a worker that says of itself other than we say of us."""
    here = standing()
    if there == here:
        return
    lacks = f"{type(there).__name__}: {there}"
    if isinstance(there, dict):
        told = {k: there.get(k, "unknown") for k in here}
        lacks = ", ".join(f"{k} {told[k]}, here {here[k]}" for k in here if told[k] != here[k])
    raise SchedulerError(
        f"{who} differs from here ({lacks}); install the same versions there and restart it"
    )


def standing() -> dict[str, str]:
    """What a worker must have in common with the client."""
    return {
        "Python": ".".join(platform.python_version_tuple()[:2]),
        "NumPy": np.__version__,
        "SciPy": scipy.__version__,
        "scikit-fem": version("scikit-fem"),
        "library": library_digest()[:12],
    }


@dataclass(frozen=True)
class _Signed:
    """Work whose result says which worker made it, and what that is; others do not begin."""

    work: Callable[[Any], Any]
    asked_by: dict[str, str]

    def __call__(self, piece: Any) -> tuple[str, dict[str, str], Any]:
        from distributed import get_worker

        there = standing()
        made = self.work(piece) if there == self.asked_by else None
        return str(get_worker().address), there, made


def in_order(
    client: Any, work: Callable[[Any], Any], pieces: Iterable[Any]
) -> Iterator[tuple[Any, Any]]:
    """Pieces and what workers make of them, in their order, a few of them under way at a time.

    Raises
    ------
    SchedulerError
        If all workers are lost for ``LOST_S``, a piece ends one worker after another, or the
        worker that was given a piece is another than those that were checked at the start.
    """
    signed = _Signed(work, standing())
    ahead = AHEAD * max(1, len(client.nthreads()))
    under_way: deque[tuple[Any, Any]] = deque()

    def taken() -> tuple[Any, Any]:
        piece, future = under_way.popleft()
        return piece, _result(client, future)

    for piece in pieces:
        under_way.append((piece, client.submit(signed, piece, pure=False)))
        if len(under_way) > ahead:
            yield taken()
    while under_way:
        yield taken()


def _result(client: Any, future: Any) -> Any:
    """What a worker made, however long it takes as long as there is one."""
    from distributed import KilledWorker

    alive = time.monotonic()
    while True:
        try:
            worker, there, made = future.result(timeout=WAIT_S)
            _refuse_other(f"worker {worker}", there)
            return made
        except TimeoutError:
            with contextlib.suppress(OSError, ValueError):
                alive = time.monotonic() if client.nthreads() else alive
            if time.monotonic() - alive > LOST_S:
                where = client.scheduler.address if client.scheduler else "the scheduler"
                raise SchedulerError(
                    f"{where} has had no worker for {LOST_S:g} s; start some, and run the same "
                    "command again"
                ) from None
        except KilledWorker as error:
            raise SchedulerError(
                f"workers ended one after another while they computed the same piece "
                f"(the last: {error.last_worker.address}); give them more memory"
            ) from None
        except CancelledError:
            raise SchedulerError(
                "the scheduler went away; start it again, and run the same command again"
            ) from None
        except SchedulerError:
            raise
        except Exception:  # of a worker that cannot even read what it is given, or of the work
            _check(client, client.scheduler.address)
            raise
