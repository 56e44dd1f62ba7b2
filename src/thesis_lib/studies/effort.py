"""Time and memory of figure sets in the published run."""

import csv
import json
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from thesis_lib.files import shipped, whole_text
from thesis_lib.text import RefusedError, describe_damage

EFFORT_COLUMNS = ("figure_set", "seconds", "peak_memory_mb", "cube_mb")


@dataclass(frozen=True)
class Effort:
    """Time and memory that a figure set takes."""

    seconds: float  #: Run time of the notebook
    peak_memory_mb: float  #: Largest resident memory of its process
    cube_mb: float  #: Size of its cube

    @property
    def kind(self) -> str:
        """Return the scale of the waiting time: ``seconds`` or ``minutes``."""
        return "minutes" if self.seconds >= 60 else "seconds"

    @property
    def time(self) -> str:
        """Return the run time as text, rounded for planning.

        Examples
        --------
        >>> [Effort(seconds, 300, 1).time for seconds in (0.2, 7.4, 89, 170, 7300)]
        ['1 s', '7 s', '1 min', '3 min', '122 min']
        """
        size, unit = (self.seconds / 60, "min") if self.seconds >= 60 else (self.seconds, "s")
        return f"{max(round(size), 1)} {unit}"

    @property
    def memory(self) -> str:
        """Return the memory as text, to tens of MB."""
        return f"{max(round(self.peak_memory_mb, -1), 10):.0f} MB"


def peak_memory_mb() -> float:
    """Return the largest resident memory of this process in MB; 0 where it is not known."""
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


def _published_path() -> Path:
    return shipped() / "data" / "published" / "effort.csv"


def read_efforts() -> dict[str, Effort]:
    """Return the published efforts by figure set, if any.

    Raises
    ------
    RefusedError
        If the file is damaged.
    """
    path = _published_path()
    if not path.is_file():
        return {}
    try:
        with path.open(encoding="utf-8", newline="") as stream:
            rows = [[row[name] for name in EFFORT_COLUMNS] for row in csv.DictReader(stream)]
        return {name: Effort(*map(float, numbers)) for name, *numbers in rows}
    except (OSError, ValueError, KeyError, TypeError, csv.Error) as error:
        raise RefusedError(describe_damage(path, error)) from None


def write_efforts(notebooks: Iterable[Path]) -> None:
    """Publish the time and memory stored in executed notebooks."""
    lines = [",".join(EFFORT_COLUMNS)]
    for notebook in notebooks:
        carried = json.loads(notebook.read_text(encoding="utf-8"))["metadata"]["thesis_lib"]
        seconds, memory, size = (float(carried[name]) for name in EFFORT_COLUMNS[1:])
        lines.append(f"{notebook.stem},{seconds:.1f},{memory:.0f},{size:.2f}")
    whole_text(_published_path(), "\n".join(lines) + "\n")
