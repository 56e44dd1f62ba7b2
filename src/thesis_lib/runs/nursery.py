"""Kernels are copies of one process that has imported what notebooks need, where Linux can do that.

To import it takes 1.5 s, the copy a few milliseconds. The copy gets the environment that a kernel
started alone would get. A nursery is given up for a new one when the library, or what is kept of
the environment, is no longer what it was when it was started.
"""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from typing import Any

from thesis_lib.files import library_files
from thesis_lib.runs import kernel_main

_ALONE = threading.Lock()
_now: Nursery | None = None


class Nursery:
    """The process that kernels are copied from."""

    def __init__(self) -> None:
        self.of = _as_it_is()
        self.process = subprocess.Popen(
            [sys.executable, "-I", kernel_main.__file__, "--nursery"],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
            start_new_session=True,
        )  # fmt: skip

    def end(self) -> None:
        """Ask for no more: it ends with its last kernel."""
        if self.process.stdin:
            self.process.stdin.close()

    def kernel(self, arguments: Sequence[str]) -> Kernel:
        """A new kernel; raises OSError if there is no nursery."""
        asked = {"arguments": [*arguments], "environment": dict(os.environ)}
        to, back = self.process.stdin, self.process.stdout
        print(json.dumps(asked), file=to, flush=True)
        number = back.readline() if back else ""
        if not number.strip().isdecimal():
            raise OSError("there is no nursery any more")
        return Kernel(int(number))


class Kernel:
    """A running kernel, with as much of ``subprocess.Popen`` as Jupyter asks of one."""

    stdin = stdout = stderr = None

    def __init__(self, pid: int) -> None:
        self.pid = pid

    def poll(self) -> int | None:
        """None while it runs."""
        try:
            os.kill(self.pid, 0)
        except ProcessLookupError:
            return 1
        return None

    def wait(self) -> int:
        """Until it has ended."""
        while (status := self.poll()) is None:
            time.sleep(0.01)
        return status

    def send_signal(self, number: int) -> None:
        """To it alone, if it is there."""
        with contextlib.suppress(ProcessLookupError):
            os.kill(self.pid, number)

    def terminate(self) -> None:
        """Ask it to end."""
        self.send_signal(signal.SIGTERM)

    def kill(self) -> None:
        """End it."""
        self.send_signal(signal.SIGKILL)


def library_as_it_is() -> Any:
    """What tells whether a process that has imported the library has imported what it is now."""
    return [(path, path.stat().st_ctime_ns) for path in library_files()]


def _as_it_is() -> Any:
    """All that a nursery rests on."""
    kept = {name: os.environ.get(name) for name in kernel_main.KEPT if name != "JPY_PARENT_PID"}
    return library_as_it_is(), kept


def ready() -> Nursery | None:
    """The nursery, started if there is none; None where processes cannot be copied so."""
    global _now
    if sys.platform != "linux":
        return None
    with _ALONE:
        if _now is None or _now.process.poll() is not None or _now.of != _as_it_is():
            if _now is not None:
                _now.end()
            _now = Nursery()
        return _now


def kernel(arguments: Sequence[str]) -> Kernel | None:
    """A new kernel by the arguments of its command; None if it is to be started alone."""
    try:
        nursery = ready()
        if nursery is None:
            return None
        with _ALONE:
            return nursery.kernel(arguments)
    except (OSError, ValueError):
        return None
