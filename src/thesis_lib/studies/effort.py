"""What a figure set costs: time and memory, measured, and known before one starts.

What was computed before comes from a cache in no time. Its cost is kept with it and counted again,
so that the effort of a set is always that of making all of it from nothing.
"""

from __future__ import annotations

import csv
import json
import sys
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

from thesis_lib.asides import asides
from thesis_lib.files import shipped, whole_file
from thesis_lib.text import damaged, duration

FIELDS = ("figure_set", "seconds", "peak_memory_mb", "cube_mb")
MINUTE = 60.0


class EffortError(ValueError):
    """Published efforts that cannot be read; the message is one line."""


@dataclass(frozen=True)
class Effort:
    """What a figure set costs."""

    seconds: float  #: Run time of the notebook on a machine with two cores, with all that it needs
    peak_memory_mb: float  #: Largest resident memory of its process
    cube_mb: float  #: Size of its cube

    @property
    def kind(self) -> str:
        """How long one waits: ``seconds`` or ``minutes``."""
        return "minutes" if self.seconds >= MINUTE else "seconds"

    @property
    def time(self) -> str:
        """The run time in words.

        Examples
        --------
        >>> Effort(7.4, 300, 1).time, Effort(170, 300, 1).time
        ('7 s', '3 min')
        """
        return duration(self.seconds)

    @property
    def memory(self) -> str:
        """The memory in words, to tens of MB."""
        return f"{max(round(self.peak_memory_mb, -1), 10):.0f} MB"


def together(efforts: Iterable[Effort]) -> Effort:
    """The effort of figure sets that are run one after another.

    Examples
    --------
    >>> together([Effort(40, 300, 1), Effort(50, 200, 2)])
    Effort(seconds=90, peak_memory_mb=300, cube_mb=3)
    """
    every = list(efforts)
    return Effort(
        sum(one.seconds for one in every),
        max(one.peak_memory_mb for one in every),
        sum(one.cube_mb for one in every),
    )


@dataclass
class _Loaded:
    """What came from caches in this process: the seconds it took, the memory it needed."""

    seconds: float = 0.0
    peak_memory_mb: float = 0.0


_loaded = _Loaded()


def loaded_seconds() -> float:
    """Seconds that caches have spared this process so far."""
    return _loaded.seconds


def note_loaded(seconds: float, peak_memory_mb: float) -> None:
    """Count what was taken from a cache as if it had been made here."""
    _loaded.seconds += seconds
    _loaded.peak_memory_mb = max(_loaded.peak_memory_mb, peak_memory_mb)


def stopwatch() -> Callable[[], float]:
    """Tells the seconds from now on, those that caches spare included."""
    start, before = time.perf_counter(), loaded_seconds()
    return lambda: time.perf_counter() - start + loaded_seconds() - before


def peak_memory_mb() -> float:
    """Largest resident memory so far, of this process and of what made the cached parts."""
    return max(_own_peak_mb(), _loaded.peak_memory_mb)


def _own_peak_mb() -> float:
    """Largest resident memory of this process in MB; 0 where the system does not tell."""
    try:  # getrusage counts, on Linux, the process that started this one, too
        status = Path("/proc/self/status").read_text(encoding="ascii", errors="replace")
        return float(status.partition("VmHWM:")[2].split()[0]) * 1024 / 1e6
    except (OSError, IndexError, ValueError):
        pass
    try:
        import resource
    except ImportError:
        return 0.0
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 1e6


def told() -> str:
    """The last words of a notebook that is executed for its files: what :func:`heard` reads."""
    said = {"loaded_s": loaded_seconds(), "peak_memory_mb": peak_memory_mb(), "asides": asides()}
    return json.dumps(said)


def heard(text: str, seconds: float, cube: Path) -> Effort:
    """The effort of an executed notebook that took so many seconds here, with what was cached.

    `text` is what :func:`told` said at its end.
    """
    said = json.loads(text)
    return Effort(seconds + said["loaded_s"], said["peak_memory_mb"], cube.stat().st_size / 1e6)


def of(notebook: Path) -> Effort:
    """The effort that an executed notebook carries."""
    kept = json.loads(notebook.read_text(encoding="utf-8"))["metadata"]["thesis_lib"]
    return Effort(*(float(kept[name]) for name in FIELDS[1:]))


def published_path() -> Path:
    """Where the measured efforts of the published run are kept."""
    return shipped() / "data" / "published" / "effort.csv"


def read(path: Path | None = None) -> dict[str, Effort]:
    """The published efforts by figure set; empty if there are none.

    Raises
    ------
    EffortError
        If the file is damaged, by name and line.
    """
    path = path or published_path()
    if not path.is_file():
        return {}
    found = {}
    with path.open(encoding="utf-8", newline="", errors="replace") as stream:
        rows = csv.DictReader(stream, strict=True)
        try:
            if tuple(rows.fieldnames or ()) != FIELDS:
                raise KeyError
            for row in rows:
                found[row["figure_set"]] = Effort(*(float(row[name]) for name in FIELDS[1:]))
        except (KeyError, ValueError, TypeError, csv.Error):
            raise EffortError(damaged(path, max(rows.line_num, 1), "cannot be read")) from None
    return found


def write(efforts: Iterable[tuple[str, Effort]], path: Path | None = None) -> Path:
    """Publish efforts; returns the file."""
    path = path or published_path()
    rows = [
        (name, f"{one.seconds:.1f}", f"{one.peak_memory_mb:.0f}", f"{one.cube_mb:.2f}")
        for name, one in efforts
    ]

    def fill(part: Path) -> None:
        with part.open("w", encoding="utf-8", newline="") as stream:
            csv.writer(stream, lineterminator="\n").writerows([FIELDS, *rows])

    whole_file(path, fill)
    return path
