"""Where the minutes go: what steps of the book and files of tests took, and on how fast a machine.

A second is worth what its machine does in it. So with each time there is that of a fixed loop,
measured in the same minutes: times are compared as multiples of it.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from thesis_lib.files import shipped, whole_text, workplace

Times = dict[str, dict[str, tuple[float, float]]]
"""Of a kind, by name: seconds, and those of the loop."""
KINDS = ("book", "tests")


def calibration(rounds: int = 5, clock: Callable[[], float] = time.perf_counter) -> float:
    """Seconds of a fixed loop in Python and NumPy, the least of some rounds."""
    taken = []
    for _ in range(rounds):
        start = clock()
        words = {str(number): number for number in range(20_000)}
        values = np.sin(np.arange(100_000) + float(len(words)))
        np.sort(values @ values * values)
        taken.append(clock() - start)
    return min(taken)


def measured_path() -> Path:
    """Where the last times of this clone are."""
    return workplace() / "build" / "times.json"


def published_path() -> Path:
    """Where the published times are."""
    return shipped() / "data" / "published" / "times.json"


def read(path: Path) -> Times:
    """Times that are kept in a file; none if it is not there or damaged."""
    try:
        kept = json.loads(path.read_text(encoding="utf-8"))
        return {
            kind: {str(n): (float(s), float(loop)) for n, (s, loop) in kept.get(kind, {}).items()}
            for kind in KINDS
        }
    except (OSError, ValueError, TypeError, AttributeError, RecursionError):
        return {kind: {} for kind in KINDS}


def note(kind: str, seconds: Mapping[str, float]) -> None:
    """Keep what some things took just now, beside what is known of others."""
    if not seconds:
        return
    loop, known = calibration(), read(measured_path())
    known[kind] |= {name: (round(taken, 1), round(loop, 5)) for name, taken in seconds.items()}
    write(measured_path(), known)


def expected(known: Mapping[str, tuple[float, float]]) -> dict[str, float]:
    """Seconds that things will take here, left alone: as many loops as they took elsewhere."""
    loop = calibration(clock=time.process_time)  # what else runs now may have ended soon
    return {name: loop * seconds / other for name, (seconds, other) in known.items()}


def write(path: Path, known: Times) -> None:
    """Write times, the longest first."""
    ordered = {k: dict(sorted(known[k].items(), key=lambda one: -one[1][0])) for k in KINDS}
    whole_text(path, json.dumps(ordered, indent=1) + "\n")


def longer(published: Times, here: Times, by: float = 1.5) -> list[tuple[str, float, float]]:
    """What takes `by` times as many loops here as published: its name, loops then, loops now.

    What takes less than 100 loops never counts.

    Examples
    --------
    >>> then, now = {"book": {"a": (9.0, 0.01)}}, {"book": {"a": (8.0, 0.005), "new": (1.0, 0.01)}}
    >>> longer(then, now)
    [('a', 900.0, 1600.0)]
    """
    found = []
    for kind, known in published.items():
        for name, (seconds, loop) in known.items():
            taken, own = here.get(kind, {}).get(name, (0.0, 1.0))
            if taken / own > max(by * seconds / loop, 100):
                found.append((name, seconds / loop, taken / own))
    return sorted(found, key=lambda one: one[1] - one[2])
