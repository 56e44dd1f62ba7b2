"""The process that executes a notebook: ``python -I kernel_main.py -f CONNECTION_FILE``.

A result depends on its request, the library and the lock file, not on the machine of whoever makes
it. So no configuration of IPython or Jupyter is read, no start-up file is run, nothing is imported
from the working directory or from ``PYTHONPATH``, the library is the one that this file belongs
to, and of the environment only what :data:`KEPT` names is left. The folder of the connection file,
in which there is nothing else, is home and working directory.
"""

from __future__ import annotations

import logging
import os
import sys
from collections.abc import Mapping
from pathlib import Path

SOURCE = next(p.parent for p in Path(__file__).resolve().parents if p.name == "thesis_lib")
THREADS = [f"{of}_NUM_THREADS" for of in ("OPENBLAS", "OMP", "MKL", "BLIS", "NUMEXPR")]
THREADS += ["VECLIB_MAXIMUM_THREADS"]
KEPT = (
    "PATH", "TMPDIR", "TEMP", "TMP", "LD_LIBRARY_PATH", "DYLD_LIBRARY_PATH", "SYSTEMROOT",
    "OPENBLAS_CORETYPE", "NPY_DISABLE_CPU_FEATURES", "GLIBC_TUNABLES", "OPENCV_CPU_DISABLE",
    "NUMBA_CPU_NAME",  # these five let libraries compute as on an older processor
    "THESIS_SCHEDULER", "THESIS_FIGURE_SETS", "JPY_PARENT_PID", "GIT_CONFIG_GLOBAL",
)  # fmt: skip


def fixed() -> dict[str, str]:
    """What every process has: threads, since sums depend on them, and where fonts are listed."""
    from thesis_lib.files import workplace

    fonts = workplace() / "build" / "cache" / "matplotlib"
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
    """Be the kernel that the connection file asks for."""
    home = Path(arguments[arguments.index("-f") + 1]).resolve().parent
    sys.path.insert(0, str(SOURCE))
    left = environment(os.environ, home)
    os.environ.clear()
    os.environ.update(left)
    os.chdir(home)
    logging.getLogger().addHandler(logging.NullHandler())  # libraries' remarks are no output
    without_dask()

    from ipykernel.kernelapp import IPKernelApp

    class Kernel(IPKernelApp):
        """A kernel that reads nothing but its connection file."""

        def load_config_file(self, *_: object, **__: object) -> None:
            """Read no configuration, the system's neither."""

        def init_code(self) -> None:
            """Run no start-up files."""

    # No file of past inputs, which another kernel could lock; this kernel's own are known.
    Kernel.launch_instance([*arguments, "--HistoryManager.enabled=False"])


if __name__ == "__main__":
    main(sys.argv[1:])
