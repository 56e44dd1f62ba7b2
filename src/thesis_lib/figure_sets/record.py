"""All recordings rendered anew, one after the other; what was stopped goes on where it stopped."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from functools import partial

from thesis_lib.figure_sets import recorded, repeated
from thesis_lib.files import whole_text, workplace
from thesis_lib.text import duration

MANY = 20
"""Recordings of every setting that are data: one in full, the others by what was fitted."""

Step = tuple[str, Callable[[], object]]


def record(many: int = MANY, say: Callable[[str], object] = print) -> None:
    """Render what is measured in full, then others until there are `many` of every setting.

    First the second of everything, then the third: wherever it is stopped, all have about as many.
    Others that are complete are rendered anew, too, unless `many` is 1; those that are not go on.
    """
    if not (begun := workplace() / "build" / "recording.txt").exists():
        for others in repeated.every():
            if 0 < many - 1 <= others.count:
                others.forget()
        whole_text(begun, "")
    steps, seconds = list(_steps(many)), dict[str, float]()
    for done, (name, film) in enumerate(steps):
        start = time.monotonic()
        film()
        seconds[name] = time.monotonic() - start
        mean = sum(seconds.values()) / len(seconds)
        left = sum(seconds.get(other, mean) for other, _ in steps[done + 1 :])
        say(f"{name}: rendered, {done + 1} of {len(steps)}; {duration(left)} left")
    begun.unlink()


def _steps(many: int) -> Iterator[Step]:
    """What is left to be done, in its order."""
    done = (workplace() / "build" / "recording.txt").read_text(encoding="utf-8").splitlines()
    for of in recorded.every():
        if of.made_from not in done:
            yield of.request.name, partial(_in_full, of)
    counts = [(others.count, others) for others in repeated.every()]
    for number in range(1, many):
        for count, others in counts:
            if count < number:
                yield f"others of {others.request.name}", others.film


def _in_full(of: recorded.Recordings) -> None:
    recorded.record(of)
    begun = workplace() / "build" / "recording.txt"
    whole_text(begun, f"{begun.read_text(encoding='utf-8')}{of.made_from}\n")
