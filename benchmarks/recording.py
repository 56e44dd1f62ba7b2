"""What is timed of one's own recordings: the example from nothing to its report."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path


def _command(*arguments: str) -> tuple[float, float]:
    """Seconds, and the largest resident memory in MiB, of a `thesis measure` command."""
    start = time.perf_counter()
    process = subprocess.Popen(
        [sys.executable, "-m", "thesis_lib", "measure", *arguments],
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise subprocess.CalledProcessError(process.returncode, "thesis measure")
    return time.perf_counter() - start, used.ru_maxrss / 1024


def example() -> dict[str, tuple[float, float]]:
    """Seconds and MiB to make the example, to measure it, and to measure it again."""
    with tempfile.TemporaryDirectory() as parent:
        folder = Path(parent) / "example"
        manifest = str(folder / "manifest.yaml")
        return {
            "to render the example": _command("--example", str(folder)),
            "to measure it": _command(manifest),
            "to measure it again": _command(manifest),
        }
