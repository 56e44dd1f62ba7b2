"""Progress of some steps, as lines on standard error."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Iterator

from thesis_lib import asides
from thesis_lib.text import message

REPORT_INTERVAL_S = 5.0  # a silent command seems to hang


class Progress:
    """Count of the steps that are done, and when each of the others began."""

    def __init__(self, total: int) -> None:
        self.total, self.done = total, 0
        self._begun = time.monotonic()
        self._steps: dict[str, float] = {}

    def begin(self, name: str) -> None:
        """Report that a step begins."""
        self._steps[name] = time.monotonic()
        self.write_line(f"{name}: running")

    def end(self, name: str, failed: bool = False) -> None:
        """Report that a step has ended, and how long it took."""
        self.done += 1
        seconds = time.monotonic() - self._steps.pop(name, time.monotonic())
        self.write_line(f"{name}: {'FAILED' if failed else 'done'} in {seconds:.1f} s")

    @contextlib.contextmanager
    def report_step(self, name: str) -> Iterator[None]:
        """Report when a step begins and ends, and every few seconds that it still runs."""
        ended, failed = threading.Event(), True

        def report_running() -> None:
            while not ended.wait(REPORT_INTERVAL_S):
                self.write_line(f"{name}: still running")

        self.begin(name)
        threading.Thread(target=report_running, daemon=True).start()
        try:
            yield
            failed = False
        finally:
            ended.set()
            self.end(name, failed)

    def skip_step(self) -> None:
        """Count a step that is up to date."""
        self.done += 1

    def write_line(self, text: str) -> None:
        """Print a text after the number of steps that are done."""
        seconds = time.monotonic() - self._begun
        with contextlib.suppress(OSError, ValueError):  # nobody listens any more
            asides.say(f"[{self.done}/{self.total}] {seconds:5.1f} s  {message(text)}")
