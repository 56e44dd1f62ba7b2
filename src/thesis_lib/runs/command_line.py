"""Command line: set-up and shutdown of the process, and arguments.

The process gets sufficient limits and a fixed number of threads, and leaves no temporary files.
Arguments are figure sets, parameters, folders and workers.
"""

from __future__ import annotations

import atexit
import contextlib
import gc
import hashlib
import logging
import os
import signal
import sys
import threading
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import click

from thesis_lib.files import cache_folder, find_obstacle, remove_temporary, workplace
from thesis_lib.text import RefusedError, has_hidden, one_line, parse_json

if TYPE_CHECKING:
    from thesis_lib.studies.request import Study

MAX_WAIT_FOR_THREADS_S = 1.0
MIN_OPEN_FILES = 128  # a run opens some 90 at a time
MAX_PATH_BYTES = 3900  # of a folder for results, whose files have longer paths
_HANDLED_SIGNALS = [
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
]
_THREAD_VARIABLES = [f"{of}_NUM_THREADS" for of in ("OPENBLAS", "OMP", "MKL", "BLIS", "NUMEXPR")]
_THREAD_VARIABLES += ["VECLIB_MAXIMUM_THREADS"]


def check_process() -> None:
    """Open closed standard streams, raise a low limit of open files, check the working directory.

    Else opened files would get the descriptors of closed streams, and their output.
    """
    while (number := os.open(os.devnull, os.O_RDWR)) < 3:
        pass
    os.close(number)
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:  # Python's value for a closed stream
            setattr(sys, name, open(os.devnull, "w"))  # noqa: PTH123, SIM115
    if sys.platform != "win32":
        import resource

        soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
        if soft < MIN_OPEN_FILES <= hard:
            resource.setrlimit(resource.RLIMIT_NOFILE, (MIN_OPEN_FILES, hard))
    try:
        Path.cwd()
    except FileNotFoundError:
        raise RefusedError(
            "the working directory has been deleted; change to another, and run the command again"
        ) from None


def list_variables() -> dict[str, str]:
    """Return environment variables: one thread per library, since sums depend on their number.

    Matplotlib's font list is also the project's, not the user's.
    """
    return {
        **dict.fromkeys(_THREAD_VARIABLES, "1"),
        "MPLCONFIGDIR": str(cache_folder() / "matplotlib"),
    }


def isolate_process() -> None:
    """Isolate this process from the user's settings, before numerical libraries are imported.

    Nothing is imported from the user's ``PYTHONPATH``. SIGTERM and SIGHUP do what Ctrl-C does,
    unless the parent process has them ignored (``nohup``).
    """
    given = os.environ.get("PYTHONPATH", "").split(os.pathsep)
    readers = {Path(place).resolve() for place in given if place}
    readers.discard(Path(__file__).resolve().parents[2])  # this library
    sys.path[:] = [place for place in sys.path if Path(place).resolve() not in readers]
    for name in list(os.environ):
        if name.startswith(("JUPYTER", "IPYTHON")):
            del os.environ[name]
    os.environ.update(list_variables() | {"MPLBACKEND": "agg"})
    warnings.simplefilter("ignore")  # of libraries; ours are errors or in results
    logging.getLogger().addHandler(logging.NullHandler())
    sys.unraisablehook = threading.excepthook = _ignore_error
    atexit.register(gc.freeze)  # else the last garbage collection takes a second
    for number in _HANDLED_SIGNALS[1:]:
        if signal.getsignal(number) is signal.SIG_DFL:
            signal.signal(number, signal.default_int_handler)


def _ignore_error(_: Any) -> None:
    """Ignore an error that cannot be caught; it is reported elsewhere."""


def stop_process(status: int) -> NoReturn:
    """Exit at once: kill the child processes, so that threads remove their temporary files."""
    for number in _HANDLED_SIGNALS:
        signal.signal(number, signal.SIG_IGN)
    try:
        _end_children()
        for thread in threading.enumerate():  # they fail without their kernels
            if thread is not threading.current_thread():
                thread.join(MAX_WAIT_FOR_THREADS_S)
        _end_children()
        remove_temporary()
        with contextlib.suppress(OSError, ValueError):
            print("interrupted; run the same command again to go on", file=sys.stderr)
            sys.stdout.flush()
            sys.stderr.flush()
    finally:
        os._exit(status)  # without waiting for other threads


def _end_children() -> None:
    """Kill all child processes."""
    import psutil

    with contextlib.suppress(psutil.Error):
        for child in psutil.Process().children(recursive=True):
            with contextlib.suppress(psutil.Error):
                if not any("resource_tracker" in word for word in child.cmdline()):
                    child.kill()  # the tracker removes semaphores, and ends by itself


REFUSED_STATUS, FAILED_STATUS, INTERRUPTED_STATUS = 2, 1, 130
_ANY_FOLDER = "a folder, new or not"


def parse_assignments(assignments: Sequence[str]) -> dict[str, Any]:
    """Return the values of parameters from ``KEY=VALUE`` texts, as JSON or else as text."""
    values: dict[str, Any] = {}
    for assignment in assignments:
        key, equals, text = assignment.partition("=")
        if not equals or not key:
            raise RefusedError(f"-p: given {assignment!r}, allowed: KEY=VALUE")
        if key in values:
            raise RefusedError(f"-p: {key!r} is given twice, allowed: once")
        if key == "cube":
            why = "cube is where a notebook writes; use --out to choose the folder"
            raise RefusedError(f"-p: {why}")
        try:
            values[key] = parse_json(text)
        except KeyError as error:
            repeated = one_line(repr(error.args[0]))
            raise RefusedError(f"-p: {key}: {repeated} is given twice, allowed: once") from None
    return values


def is_folder(name: str) -> bool:
    """Return whether an argument is a folder of figure sets, existing or not."""
    return os.sep in name or name in (".", "..")


def expand_name(name: str) -> list[str]:
    """Return the figure sets that a set, a chapter or a folder stands for."""
    from thesis_lib.figure_sets.registry import CHAPTER_SETS, load_sets

    return load_sets(Path(name)) if is_folder(name) else CHAPTER_SETS.get(name, [name])


def build_requests(names: Sequence[str], values: dict[str, Any]) -> list[Study]:
    """Return validated studies of sets and chapters; each set takes the parameters that it has.

    A folder stands for the figure sets in it.
    """
    from thesis_lib.figure_sets.registry import model_of
    from thesis_lib.studies.request import check_names, validate_values

    expanded = [one for name in names for one in expand_name(name)]
    models = [model_of(name) for name in dict.fromkeys(expanded)]
    known = {key for model in models for key in model.model_fields}
    check_names(models[0], (key for key in values if key not in known))
    own = [{key: values[key] for key in values if key in model.model_fields} for model in models]
    studies = [validate_values(*pair) for pair in zip(models, own, strict=True)]
    for model in models:
        for key in values:
            if key not in model.model_fields:
                click.echo(f"{model.name} has no {key}: it runs without", err=True)
    return studies


def use_scheduler(scheduler: str, studies: Sequence[Study]) -> None:
    """Check that a scheduler can be used, and select it for the notebooks' kernels."""
    from thesis_lib.figure_sets.registry import FIGURE_SETS
    from thesis_lib.studies import workers

    workers.check_address(scheduler, "--scheduler")
    others = [study.name for study in studies if not FIGURE_SETS[study.name].in_pieces]
    if len(others) == len(studies):
        raise RefusedError(
            f"--scheduler: given with {', '.join(others)}, allowed with camera and sound studies "
            "(beam-…, plate-…, sound-…, shape-…), which can be cut into pieces"
        )
    for name in others:
        click.echo(workers.describe_unsupported(name), err=True)
    workers.check_scheduler(scheduler)
    os.environ[workers.SCHEDULER_VARIABLE] = scheduler


def output_folder(names: Sequence[str], studies: Sequence[Study], out: Path | None) -> Path:
    """Return the folder of a run: the given one, or one named by the requests."""
    if out is None:
        words = [Path(name).resolve().name if is_folder(name) else name for name in names]
        digest = studies[0].digest
        if len(studies) > 1:
            joined = " ".join(study.digest for study in studies)
            digest = hashlib.sha256(joined.encode()).hexdigest()[:10]
        out = workplace() / "runs" / f"{'+'.join(dict.fromkeys(words))}-{digest}"
    return new_folder(out)


def new_folder(out: Path, option: str = "--out") -> Path:
    """Check that an output folder can be created and written to; return its absolute path."""
    if str(out) in ("", "."):
        raise RefusedError(f"{option}: given no folder of its own, allowed: {_ANY_FOLDER}")
    folder = out.absolute()
    longest = max(len(os.fsencode(part)) for part in folder.parts)
    if has_hidden(str(folder)) or longest > 255 or len(os.fsencode(folder)) > MAX_PATH_BYTES:
        why = f"allowed: visible names of at most 255 bytes, {MAX_PATH_BYTES} in all"
        raise RefusedError(f"{option}: given {one_line(str(out))!r}, {why}")
    if obstacle := find_obstacle(folder):
        raise RefusedError(
            f"{option}: given {out}, but {obstacle} cannot be written to as a folder; "
            f"allowed: {_ANY_FOLDER}"
        )
    return folder
