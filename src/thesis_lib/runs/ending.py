"""How a command begins and ends: no foreign words on the screen, and nothing left by a signal."""

from __future__ import annotations

import contextlib
import importlib.util
import logging
import os
import signal
import sys
import threading
import time
import warnings
from pathlib import Path
from typing import Any, NoReturn

from thesis_lib import files
from thesis_lib.runs.kernel_main import fixed, without_dask

_MIN_FILES = 128  # open at a time: a run needs some 90

_SIGNALS = [
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
]
_PATIENCE = 5.0  # s that threads have to end in


class SurroundingsError(RuntimeError):
    """A process in which no command can work; the message is one line."""


def check_surroundings() -> None:
    """Open the standard streams that are closed, and refuse limits under which nothing works.

    Raises
    ------
    SurroundingsError
        If too few files may be open at a time, or the working directory is gone.
    """
    while (number := os.open(os.devnull, os.O_RDWR)) < 3:  # else a file would be written into
        pass
    os.close(number)
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:  # as Python has one that is closed
            setattr(sys, name, open(os.devnull, "w"))  # noqa: PTH123, SIM115
    try:
        Path.cwd()
    except FileNotFoundError:
        raise SurroundingsError(
            "the working directory has been deleted; change to another, and run the command again"
        ) from None
    if sys.platform != "win32":
        import resource

        soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
        if soft < _MIN_FILES <= hard:
            resource.setrlimit(resource.RLIMIT_NOFILE, (_MIN_FILES, hard))
        elif soft < _MIN_FILES:
            raise SurroundingsError(
                f"only {soft} files may be open at a time, allowed: {_MIN_FILES} or more; raise "
                "the limit (ulimit -n), and run the command again"
            )


def prepare() -> None:
    """Before anything is imported that computes or has something to say.

    The libraries' threads are fixed for this process and those that it starts, and none of them is
    taken from the reader's ``PYTHONPATH``. Terminating or hanging up does what Ctrl-C does, unless
    whoever started this has it ignored (``nohup``).
    """
    given = os.environ.get("PYTHONPATH", "").split(os.pathsep)
    readers = {Path(place).resolve() for place in given if place}
    readers.discard(Path(__file__).resolve().parents[2])  # where we are
    sys.path[:] = [place for place in sys.path if Path(place).resolve() not in readers]
    os.environ.update(fixed() | {"MPLBACKEND": "agg"})  # the reader may have named one there is not
    without_dask()
    warnings.simplefilter("ignore")  # of libraries; ours are errors or results
    logging.getLogger().addHandler(logging.NullHandler())
    sys.unraisablehook = threading.excepthook = _say_nothing
    forget_old_bytecode(Path(__file__).parents[1])
    for number in _SIGNALS[1:]:
        if signal.getsignal(number) is signal.SIG_DFL:
            signal.signal(number, signal.default_int_handler)


def forget_old_bytecode(package: Path) -> None:
    """Have modules compiled anew that were changed after they were compiled.

    Python compares their size and the second of their last change, so an edit within that second,
    or one that keeps the time, leaves the old code at work under the new code's digest.
    """
    for source in package.rglob("*.py"):
        with contextlib.suppress(OSError):
            compiled = Path(importlib.util.cache_from_source(str(source)))
            if compiled.stat().st_mtime_ns < source.stat().st_ctime_ns:
                compiled.unlink()


def _say_nothing(_: Any) -> None:
    """What fails where nobody can catch it has been told elsewhere, or does not matter."""


def stop(status: int) -> NoReturn:
    """End at once what is under way, with all processes and folders that belong to it."""
    for number in _SIGNALS:
        signal.signal(number, signal.SIG_IGN)
    try:
        until = time.monotonic() + _PATIENCE
        while _end_children() and time.monotonic() < until:
            time.sleep(0.1)
        files.let_go()
        with contextlib.suppress(OSError, ValueError):
            print("interrupted; the same command goes on where this one stopped", file=sys.stderr)
            sys.stdout.flush()
            sys.stderr.flush()
    finally:
        os._exit(status)  # threads that do not listen do not matter any more


def _end_children() -> bool:
    """Kill all processes that this one has started; whether threads are still at work."""
    import psutil

    with contextlib.suppress(psutil.Error):
        for child in psutil.Process().children(recursive=True):
            with contextlib.suppress(psutil.Error):
                if not any("resource_tracker" in word for word in child.cmdline()):
                    child.kill()  # the tracker removes semaphores, and ends by itself
    here = threading.main_thread()
    return any(one is not here and not one.daemon for one in threading.enumerate())
