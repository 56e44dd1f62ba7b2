"""Computation of studies in blocks, by this process, by local processes, or by a Dask cluster.

A study is cut into *blocks*: runs of trials of one setting, by its parameters alone. All arithmetic
stays within a block, since the last bits of results depend on how many points BLAS multiplies at a
time. The cube is the same bit for bit, no matter which worker computes which block. So the workers
are no parameter: ``thesis run --scheduler`` selects them, or ``THESIS_SCHEDULER`` where papermill
runs a notebook. An existing cluster needs ``distributed`` (``pip install thesis-lib[scale]``),
whose configuration has the keys for TLS.
"""

import asyncio
import concurrent.futures as pools
import logging
import multiprocessing
import os
import platform
import re
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass, field
from importlib.metadata import version
from typing import Any, TypeVar

from thesis_lib.files import library_digest
from thesis_lib.studies.request import ParameterError

BLOCK_BYTES = 24 * 2**20  # of images: 200 trials of 150 markers in 3 modes by 12 cameras fit
SCHEDULER_VARIABLE = "THESIS_SCHEDULER"
PROCESS_SCHEDULER = "processes"
ADDRESS_PATTERN = re.compile(r"t(?:cp|ls)://(?:[\w.-]+|\[[0-9A-Fa-f:.]+\]):(\d{1,5})", re.ASCII)
MAX_WAIT_S = 10.0  # for a scheduler, and for its first worker
THREAD_VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")  # of BLAS

Item = TypeVar("Item")
Result = TypeVar("Result")


class SchedulerError(RuntimeError):
    """Workers are not available; the message is one line: the scheduler, problem and remedy."""


@dataclass(frozen=True)
class Block:
    """A run of trials of one setting."""

    setting: int  #: Index of the setting
    trials: slice  #: First trial, and the one after the last
    load: Any = field(compare=False)  #: Input of its computation

    @property
    def place(self) -> tuple[int, slice, slice]:
        """Return the index of the block's results in a variable (setting, mode, trial, ...)."""
        return self.setting, slice(None), self.trials


def runs_of_trials(trials: int, trial_bytes: int) -> Iterator[slice]:
    """Cut the trials 0 … `trials` into runs of one or more within :data:`BLOCK_BYTES`.

    Examples
    --------
    >>> list(runs_of_trials(200, 2 * 2**20))[0], len(list(runs_of_trials(200, 2 * 2**20)))
    (slice(0, 12, None), 17)
    """
    step = max(1, BLOCK_BYTES // max(1, trial_bytes))
    for first in range(0, trials + 1, step):
        yield slice(first, min(first + step, trials + 1))


def compute_blocks(
    work: Callable[[Block], Result], blocks: Iterable[Block], scheduler: str = ""
) -> Iterator[tuple[Block, Result]]:
    """Yield each block and its result by `work`, which can be sent to a worker, in order.

    Without a `scheduler`, as in :func:`check_address`, they are computed here, one after another.

    Raises
    ------
    SchedulerError
        If the workers cannot be reached, or end before their work.
    """
    if not scheduler:
        yield from ((block, work(block)) for block in blocks)
        return
    every = list(blocks)
    with _start_processes() if scheduler == PROCESS_SCHEDULER else _connect(scheduler) as pool:
        yield from zip(every, pool.map(work, every), strict=True)


def check_address(scheduler: str, source: str) -> None:
    """Refuse a scheduler, given by `source`, that is not allowed."""
    match = ADDRESS_PATTERN.fullmatch(scheduler)
    if scheduler != PROCESS_SCHEDULER and not (match and 0 < int(match[1]) < 2**16):
        raise ParameterError(
            f"{source}: given {scheduler!r:.80}, allowed: {PROCESS_SCHEDULER}, or tcp://HOST:PORT "
            "or tls://HOST:PORT of a Dask scheduler"
        )


def check_scheduler(scheduler: str) -> None:
    """Refuse a scheduler that cannot be used, before anything starts."""
    if scheduler != PROCESS_SCHEDULER:
        with _connect(scheduler):
            pass


def describe_unsupported(name: str) -> str:
    """Return the message on a figure set that cannot use a scheduler."""
    return f"{name} is not cut into pieces: it runs in one process, without the scheduler"


@contextmanager
def _start_processes() -> Iterator[pools.Executor]:
    """Start worker processes that communicate through private pipes."""
    for name in THREAD_VARIABLES:
        os.environ.setdefault(name, "1")  # spawned processes inherit it
    count = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    try:
        with pools.ProcessPoolExecutor(count, multiprocessing.get_context("spawn")) as pool:
            yield pool
    except BrokenProcessPool:
        raise SchedulerError(
            "a worker process ended before its work; run without --scheduler, or give it memory"
        ) from None


@contextmanager
def _connect(scheduler: str) -> Iterator[pools.Executor]:
    """Connect to a cluster whose workers have the same versions, and so the same results."""
    named = f"scheduler {scheduler}"
    try:
        import distributed
        from distributed.comm.core import connect
    except ImportError:
        raise SchedulerError(
            f"{named}: the package distributed is not installed; "
            "pip install thesis-lib[scale], or run without a scheduler"
        ) from None
    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # errors are raised here

    async def greet() -> None:  # a client would wait for ever at a silent port
        keys = distributed.Security().get_connection_args("client")
        (await asyncio.wait_for(connect(scheduler, MAX_WAIT_S, **keys), MAX_WAIT_S)).abort()

    try:
        with pools.ThreadPoolExecutor(1) as thread:  # a notebook's thread has an event loop already
            thread.submit(asyncio.run, greet()).result()
        client = distributed.Client(scheduler, timeout=MAX_WAIT_S, set_as_default=False)
    except (OSError, TimeoutError) as error:
        raise SchedulerError(
            f"{named}: no scheduler answers there within {MAX_WAIT_S:g} s "
            f"({type(error).__name__}); start one (dask scheduler), or run without"
        ) from None
    with client:
        try:
            client.wait_for_workers(1, timeout=MAX_WAIT_S)
        except TimeoutError:
            raise SchedulerError(
                f"{named}: it has no worker within {MAX_WAIT_S:g} s; "
                f"start some (dask worker {scheduler}), and run the same command again"
            ) from None
        here = common_versions()
        for worker, there in client.run(common_versions, on_error="return").items():
            if there != here:
                raise SchedulerError(
                    f"{named}: worker {worker} has {there}, here {here}; "
                    "install the same versions there and restart it"
                )
        try:
            yield client.get_executor(pure=False)
        except (distributed.KilledWorker, pools.CancelledError) as error:
            raise SchedulerError(
                f"{named}: workers ended before their work ({type(error).__name__}); "
                "give them memory, and run the same command again"
            ) from None


def common_versions() -> dict[str, str]:
    """Return the versions that worker and client must have in common."""
    packages = {name: version(name) for name in ("numpy", "scipy", "scikit-fem")}
    python = ".".join(platform.python_version_tuple()[:2])
    return {"Python": python, **packages, "library": library_digest()[:12]}


def map_in_two_threads(
    one: Callable[[Item], Result], items: Iterable[Item], stop: Callable[[], object] = lambda: None
) -> list[Result]:
    """Map a function over items in two threads, and return the results in order.

    After the first failure or an interrupt no further item begins, `stop` is called to end the
    running ones, and the failure is raised.
    """
    with pools.ThreadPoolExecutor(2) as pool:
        try:
            futures = [pool.submit(one, item) for item in items]
            for future in pools.as_completed(futures):
                future.result()
            return [future.result() for future in futures]
        except BaseException:
            stop()
            pool.shutdown(wait=False, cancel_futures=True)
            raise
