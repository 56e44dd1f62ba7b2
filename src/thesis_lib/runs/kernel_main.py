"""The process that executes a notebook: ``python -I kernel_main.py -f CONNECTION_FILE``.

With ``--nursery`` instead it imports what all notebooks need, once, and is then copied for each
kernel that it is asked for (:mod:`thesis_lib.runs.nursery`).

A result depends on its request, the library and the lock file, not on the machine of whoever makes
it. So no configuration of IPython or Jupyter is read, no start-up file is run, nothing is imported
from the working directory or from ``PYTHONPATH``, the library is the one that this file belongs
to, and of the environment only what :data:`KEPT` names is left. The folder of the connection file,
in which there is nothing else, is home and working directory.
"""

from __future__ import annotations

import json
import logging
import os
import signal
import sys
import time
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path

SOURCE = next(p.parent for p in Path(__file__).resolve().parents if p.name == "thesis_lib")
THREADS = [f"{of}_NUM_THREADS" for of in ("OPENBLAS", "OMP", "MKL", "BLIS", "NUMEXPR")]
THREADS += ["VECLIB_MAXIMUM_THREADS"]
KEPT = (
    "PATH", "TMPDIR", "TEMP", "TMP", "LD_LIBRARY_PATH", "DYLD_LIBRARY_PATH", "SYSTEMROOT",
    "OPENBLAS_CORETYPE", "NPY_DISABLE_CPU_FEATURES", "GLIBC_TUNABLES", "OPENCV_CPU_DISABLE",
    "NUMBA_CPU_NAME",  # these five let libraries compute as on an older processor
    "THESIS_SCHEDULER", "THESIS_FIGURE_SETS", "THESIS_CACHE", "JPY_PARENT_PID", "GIT_CONFIG_GLOBAL",
)  # fmt: skip

IMPORTED = ("ipykernel.kernelapp", "h5netcdf", "thesis_lib.notebook.show")  # by a nursery


def fixed() -> dict[str, str]:
    """What every process has: threads, since sums depend on them, and where fonts are listed."""
    from thesis_lib.files import cache_folder

    fonts = cache_folder() / "matplotlib"
    return {**dict.fromkeys(THREADS, "1"), "MPLCONFIGDIR": str(fonts)}


def without_dask() -> None:
    """Let xarray not ask whether an array is dask's: where dask is, that imports all of its arrays.

    It takes 0.4 s, and none of ours is. A reader's own folder may have some
    (:func:`thesis_lib.figure_sets.outside.load`).
    """
    sys.modules.setdefault("dask.array", None)  # type: ignore[arg-type]


def environment(of: Mapping[str, str], home: Path) -> dict[str, str]:
    """What is left of an environment."""
    from thesis_lib.asides import QUIET

    kept = {name: of[name] for name in KEPT if name in of}
    git = Path(of.get("HOME", os.sep)) / ".gitconfig"  # which owners of checkouts are trusted
    own = {"HOME": str(home), "LANG": "C.UTF-8", "GIT_CONFIG_GLOBAL": str(git), QUIET: "1"}
    return own | kept | fixed()


def main(arguments: list[str]) -> None:
    """Be a kernel, or where kernels come from."""
    sys.path.insert(0, str(SOURCE))
    logging.getLogger().addHandler(logging.NullHandler())  # libraries' remarks are no output
    if arguments == ["--nursery"]:
        nursery()
    else:
        kernel(arguments, os.environ)


def nursery() -> None:
    """For each line that asks for a kernel be copied, and let the copy be it and say its number.

    When nobody can ask any more it ends, and with it the kernels, unless whoever asked is there.
    """
    manager = os.getppid()
    become(environment(os.environ, Path(os.sep)))
    without_dask()
    for module in IMPORTED:
        import_module(module)
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # kernels that end leave nothing
    while line := sys.stdin.readline():
        if not os.fork():
            os.setsid()
            signal.signal(signal.SIGCHLD, signal.SIG_DFL)
            print(os.getpid(), flush=True)
            nowhere = os.open(os.devnull, os.O_RDWR)
            for stream in range(3):
                os.dup2(nowhere, stream)
            asked = json.loads(line)
            kernel(asked["arguments"], asked["environment"] | {"JPY_PARENT_PID": str(os.getppid())})
            os._exit(0)
    while os.getppid() == manager and kernels():
        time.sleep(0.2)


def kernels() -> bool:
    """Whether a kernel of this process goes on."""
    try:
        return os.waitpid(-1, os.WNOHANG) == (0, 0)
    except ChildProcessError:
        return False


def become(left: Mapping[str, str]) -> None:
    """Have this environment and no other."""
    os.environ.clear()
    os.environ.update(left)


def kernel(arguments: list[str], given: Mapping[str, str]) -> None:
    """Be the kernel that the connection file asks for, in what is left of an environment."""
    home = Path(arguments[arguments.index("-f") + 1]).resolve().parent
    become(environment(given, home))
    os.chdir(home)
    without_dask()
    if numpy := sys.modules.get("numpy"):
        numpy.random.seed()  # else all kernels would draw the same numbers as their parent

    from ipykernel.kernelapp import IPKernelApp

    class Kernel(IPKernelApp):
        """A kernel that reads nothing but its connection file."""

        def load_config_file(self, *_: object, **__: object) -> None:
            """Read no configuration, the system's neither."""

        def init_code(self) -> None:
            """Run no start-up files."""

    watched = f"--IPKernelApp.parent_handle={os.environ.get('JPY_PARENT_PID', 0)}"
    # No file of past inputs, which another kernel could lock; this kernel's own are known.
    Kernel.launch_instance([*arguments, watched, "--HistoryManager.enabled=False"])


if __name__ == "__main__":
    main(sys.argv[1:])
