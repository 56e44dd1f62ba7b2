"""Jupyter's own Python kernel, started without anything of the reader's machine.

A result depends on its request, the library and the lock file. So no kernel that a reader has
installed is used, no configuration or start-up file of IPython is read, nothing is imported from
the working directory or from ``PYTHONPATH``, and of the environment only
:data:`PASSED_VARIABLES` is left.
"""

from __future__ import annotations

import os
import subprocess
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from jupyter_client.kernelspec import KernelSpecManager
from jupyter_client.manager import AsyncKernelManager

from thesis_lib.asides import QUIET_VARIABLE
from thesis_lib.files import shipped
from thesis_lib.runs.surroundings import list_variables

KERNEL_OPTIONS = (
    "--HistoryManager.enabled=False",
)  # no file of past inputs, which kernels would share
MAX_SOCKET_LENGTH = 103  # characters of a socket's path, on macOS
PASSED_VARIABLES = (
    "PATH", "TMPDIR", "TEMP", "TMP", "LD_LIBRARY_PATH", "DYLD_LIBRARY_PATH", "SYSTEMROOT",
    "OPENBLAS_CORETYPE", "NPY_DISABLE_CPU_FEATURES", "GLIBC_TUNABLES", "OPENCV_CPU_DISABLE",
    "NUMBA_CPU_NAME",  # these five let libraries compute as on an older processor
    "THESIS_SCHEDULER", "THESIS_FIGURE_SETS", "THESIS_CACHE", "GIT_CONFIG_GLOBAL",
)  # fmt: skip


def kernel_environment(given: Mapping[str, str], home: Path) -> dict[str, str]:
    """Return the environment of a kernel whose home and only files are in the folder `home`."""
    passed = {name: given[name] for name in PASSED_VARIABLES if name in given}
    git = Path(given.get("HOME", os.sep)) / ".gitconfig"  # which owners of checkouts are trusted
    own = {
        "HOME": str(home),
        "IPYTHONDIR": str(home / "ipython"),
        "JUPYTER_PREFER_ENV_PATH": "1",
        "PYTHONNOUSERSITE": "1",
        "PYTHONSAFEPATH": "1",
        "LANG": "C.UTF-8",
        "GIT_CONFIG_GLOBAL": str(git),
        QUIET_VARIABLE: "1",
    }
    source = shipped() / "src"
    if source.is_dir():  # the kernel imports the checkout that the command runs from
        own["PYTHONPATH"] = str(source)
    return own | passed | list_variables()


def choose_transport(connection: Path) -> str:
    """Return how to talk to a kernel: by sockets beside its connection file, or else by ports.

    Two kernels that start at the same time may be given the same port, and one of them dies.
    """
    socket = f"{connection}-ipc-5"  # the longest of their names
    return "ipc" if os.name == "posix" and len(socket) <= MAX_SOCKET_LENGTH else "tcp"


def build_manager_class(home: Path) -> type[AsyncKernelManager]:
    """Return a class whose managers start a kernel in the folder `home`, which this makes.

    nbclient is given the class, not a manager: it ends only kernels of managers that it made.
    """
    home.mkdir()

    class Manager(AsyncKernelManager):
        def __init__(self, **options: Any) -> None:
            super().__init__(
                transport=choose_transport(home / "connection"),
                # Without folders of kernels the one of this Python's ipykernel is left.
                kernel_spec_manager=KernelSpecManager(kernel_dirs=[]),
                connection_file=str(home / "connection.json"),
                **options,
            )

        async def _async_start_kernel(self, **options: Any) -> None:
            environment = kernel_environment(os.environ, home)
            nowhere = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
            await super()._async_start_kernel(**options, **nowhere, env=environment, cwd=str(home))

        start_kernel = _async_start_kernel

    return Manager
