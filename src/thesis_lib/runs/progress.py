"""How far some tasks are, and which of them begins first."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from graphlib import TopologicalSorter

from thesis_lib import asides
from thesis_lib.text import duration, message


def urgency(known: Mapping[str, float], waits: Mapping[str, Iterable[str]]) -> dict[str, float]:
    """Seconds from the beginning of each task to the end of the longest chain that waits for it.

    `known` are the seconds that each takes, `waits` what comes before each. What has most behind it
    begins first, so that as little as can be is left for one worker alone.

    Examples
    --------
    >>> urgency({"a": 10, "b": 12, "pages": 5}, {"pages": ["a"]})
    {'a': 15, 'b': 12, 'pages': 5}
    """
    before = {name: [w for w in waits.get(name, ()) if w in known] for name in known}
    found = dict(known)
    for name in reversed([*TopologicalSorter(before).static_order()]):
        for each in before[name]:
            found[each] = max(found[each], known[each] + found[name])
    return found


@dataclass
class Progress:
    """Count of tasks that are done, and the names of those at work."""

    total: int  #: Number of tasks
    clock: Callable[[], float] = time.monotonic  #: Seconds since any moment
    done: int = 0
    at_work: dict[str, float] = field(default_factory=dict)  # when they began
    took: dict[str, float] = field(default_factory=dict)  # seconds

    def __post_init__(self) -> None:
        self.began = self.clock()

    def begin(self, name: str) -> None:
        """Count a task as at work."""
        self.at_work[name] = self.clock()

    def end(self, name: str, measured: bool) -> float:
        """Count a task as done, and return its seconds, which are noted if they are `measured`."""
        now = self.clock()
        took = now - self.at_work.pop(name, now)
        self.done += 1
        if measured:
            self.took[name] = took
        return took

    def report_running(self, passing: bool) -> None:
        """Print what is at work."""
        now = self.clock()
        names = [f"{name} {duration(now - began)}" for name, began in dict(self.at_work).items()]
        self.say(f"at work: {', '.join(names)}", passing)

    def say(self, text: str, passing: bool = False) -> None:
        """Print a text after the number of tasks that are done."""
        elapsed = self.clock() - self.began
        with contextlib.suppress(OSError, ValueError):  # nobody listens any more
            line = f"[{self.done}/{self.total}] {elapsed:5.1f} s  {message(text)}"
            asides.say(line, passing)
