"""How far some tasks are, and how long the rest will take, as far as anybody can know."""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from graphlib import TopologicalSorter
from heapq import heappop, heappush

from thesis_lib import asides
from thesis_lib.text import duration, message

_TRUSTED = 60.0  # s, as if that much had gone as known: one short step tells little of the pace


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


def seconds_left(
    known: Mapping[str, float],
    at_work: Mapping[str, float],
    waits: Mapping[str, Iterable[str]],
    pace: float = 1.0,
    workers: int = 2,
) -> float:
    """How long tasks will take, the most urgent first, so many at a time.

    `known` are the seconds that each has taken elsewhere, here `pace` times as long; `at_work`
    those since some of them began; `waits` what comes before each, done if it is not `known`.

    Examples
    --------
    >>> seconds_left({"a": 10, "b": 4, "pages": 5}, {"a": 3}, {"pages": ["a", "b"]})
    12.0
    """
    left = {name: max(pace * known[name] - at_work.get(name, 0.0), 0.0) for name in known}
    most = urgency(known, waits)
    first = sorted(known, key=lambda name: (name not in at_work, -most[name]))
    order = TopologicalSorter({n: [w for w in waits.get(n, ()) if w in known] for n in first})
    order.prepare()
    now, ready, ends = 0.0, list[str](), list[tuple[float, str]]()
    while order.is_active():
        ready = sorted([*ready, *order.get_ready()], key=first.index)
        while ready and len(ends) < workers:
            name = ready.pop(0)
            heappush(ends, (now + left[name], name))
        now, name = heappop(ends)
        order.done(name)
    return now


@dataclass
class Progress:
    """How many tasks there are and are done, since when, and what is known of the rest."""

    total: int  #: Number of tasks
    #: Of what is to do the seconds that it has taken elsewhere, by name; 0 if nobody knows
    known: dict[str, float]
    waits: Mapping[str, Iterable[str]]  #: Of each task those that come before it
    workers: int = 2  #: Tasks at a time
    clock: Callable[[], float] = time.monotonic  #: Seconds since any moment
    done: int = 0
    at_work: dict[str, float] = field(default_factory=dict)  # when they began
    ended: list[tuple[float, float]] = field(default_factory=list)  # seconds here, and elsewhere
    took: dict[str, float] = field(default_factory=dict)  # seconds here

    def __post_init__(self) -> None:
        self.began = self.clock()

    def begin(self, name: str) -> None:
        """Count a task as at work."""
        self.at_work[name] = self.clock()

    def end(self, name: str, measured: bool) -> float:
        """Count a task as done; its seconds tell of this machine if they are `measured`."""
        now = self.clock()
        took, known = now - self.at_work.pop(name, now), self.known.pop(name, 0.0)
        self.done += 1
        if measured:
            self.took[name] = took
        if measured and known:
            self.ended.append((took, known))
        return took

    def left(self) -> str:
        """How long the rest will take, in words: at least, if not all is known; else empty."""
        now, known, ended = self.clock(), dict(self.known), list(self.ended)
        at_work = {name: now - began for name, began in dict(self.at_work).items()}
        took = _TRUSTED + sum(each for each, _ in ended)
        pace = took / (_TRUSTED + sum(each for _, each in ended))
        late = any(took > pace * known.get(name, took) for name, took in at_work.items())
        seconds = seconds_left(known, at_work, self.waits, pace, self.workers)
        sure = all(known.values()) and not late
        words = duration(10 * math.ceil(seconds / 10))
        return f"{'about' if sure else 'at least'} {words}" if seconds else ""

    def foretell(self) -> None:
        """Say what is to do, if it is known how long that takes."""
        if left := self.left():
            self.say(f"{len(self.known)} of {self.total} steps to do: {left}")

    def tell(self, passing: bool) -> None:
        """Say what is at work."""
        now, left = self.clock(), self.left()
        names = [f"{name} {duration(now - began)}" for name, began in dict(self.at_work).items()]
        self.say(f"{f'{left} left; ' if left else ''}at work: {', '.join(names)}", passing)

    def say(self, text: str, passing: bool = False) -> None:
        """Say something, with how far the tasks are."""
        elapsed = self.clock() - self.began
        with contextlib.suppress(OSError, ValueError):  # nobody listens any more
            line = f"[{self.done}/{self.total}] {elapsed:5.1f} s  {message(text)}"
            asides.say(line, passing)
