"""The process of a command: limits it can work in, fixed threads, and an end without leftovers."""

from __future__ import annotations

import contextlib
import logging
import os
import signal
import sys
import threading
import warnings
from pathlib import Path
from typing import Any, NoReturn

from thesis_lib.files import cache_folder, remove_temporary

MIN_OPEN_FILES = 128  # a run needs some 90 at a time
MAX_WAIT_FOR_THREADS_S = 1.0
_HANDLED_SIGNALS = [
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
]
_THREAD_VARIABLES = [f"{of}_NUM_THREADS" for of in ("OPENBLAS", "OMP", "MKL", "BLIS", "NUMEXPR")]
_THREAD_VARIABLES += ["VECLIB_MAXIMUM_THREADS"]


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
        if soft < MIN_OPEN_FILES <= hard:
            resource.setrlimit(resource.RLIMIT_NOFILE, (MIN_OPEN_FILES, hard))
        elif soft < MIN_OPEN_FILES:
            raise SurroundingsError(
                f"only {soft} files may be open at a time, allowed: {MIN_OPEN_FILES} or more; "
                "raise the limit (ulimit -n), and run the command again"
            )


def list_variables() -> dict[str, str]:
    """Return variables of every process: one thread a library, since sums depend on their number.

    Matplotlib's list of fonts is the project's, too, not the reader's.
    """
    return {
        **dict.fromkeys(_THREAD_VARIABLES, "1"),
        "MPLCONFIGDIR": str(cache_folder() / "matplotlib"),
    }


def isolate_process() -> None:
    """Isolate this process from the reader's settings, before anything that computes is imported.

    Nothing is imported from the reader's ``PYTHONPATH``. Terminating or hanging up does what
    Ctrl-C does, unless the parent process has it ignored (``nohup``).
    """
    given = os.environ.get("PYTHONPATH", "").split(os.pathsep)
    readers = {Path(place).resolve() for place in given if place}
    readers.discard(Path(__file__).resolve().parents[2])  # where we are
    sys.path[:] = [place for place in sys.path if Path(place).resolve() not in readers]
    for name in [name for name in os.environ if name.startswith(("JUPYTER", "IPYTHON"))]:
        del os.environ[name]
    os.environ.update(list_variables() | {"MPLBACKEND": "agg"})
    warnings.simplefilter("ignore")  # of libraries; ours are errors or results
    logging.getLogger().addHandler(logging.NullHandler())
    sys.unraisablehook = threading.excepthook = _ignore_error
    for number in _HANDLED_SIGNALS[1:]:
        if signal.getsignal(number) is signal.SIG_DFL:
            signal.signal(number, signal.default_int_handler)


def _ignore_error(_: Any) -> None:
    """Print nothing of an error that nobody can catch; it is reported elsewhere."""


def stop_process(status: int) -> NoReturn:
    """End at once: kill the processes of this one, so that its threads remove what they wrote."""
    for number in _HANDLED_SIGNALS:
        signal.signal(number, signal.SIG_IGN)
    try:
        _end_children()
        for thread in threading.enumerate():  # which fail without their kernels
            if thread is not threading.current_thread():
                thread.join(MAX_WAIT_FOR_THREADS_S)
        _end_children()
        remove_temporary()
        with contextlib.suppress(OSError, ValueError):
            print("interrupted; run the same command again to go on", file=sys.stderr)
            sys.stdout.flush()
            sys.stderr.flush()
    finally:
        os._exit(status)  # threads that do not listen do not matter any more


def _end_children() -> None:
    """Kill all processes that this one has started."""
    import psutil

    with contextlib.suppress(psutil.Error):
        for child in psutil.Process().children(recursive=True):
            with contextlib.suppress(psutil.Error):
                if not any("resource_tracker" in word for word in child.cmdline()):
                    child.kill()  # the tracker removes semaphores, and ends by itself
