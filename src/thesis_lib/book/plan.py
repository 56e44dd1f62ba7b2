"""What the book is made of, and where."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from thesis_lib.book import downloads
from thesis_lib.figure_sets.registry import STUDIES
from thesis_lib.files import project_root
from thesis_lib.runs.execute import Job
from thesis_lib.studies import effort, times


@dataclass(frozen=True)
class Plan:
    """The places of a book, and what has failed so far, by the name of the step."""

    root: Path  #: The project
    jobs: Sequence[Job]  #: Its figure sets, in the order in which they begin
    #: What these and other steps of a whole book will take, by name, as far as it is known
    seconds: Mapping[str, float] = field(default_factory=dict)
    publish: bool = False  #: Whether these results become the published ones
    failed: dict[str, str] = field(default_factory=dict)  #: Why a step failed, by its name

    @property
    def ran(self) -> list[Job]:
        """The figure sets that did not fail."""
        return [job for job in self.jobs if job.study.name not in self.failed]

    @property
    def without(self) -> list[str]:
        """Names of the figure sets that are not in it."""
        ran = {job.study.name for job in self.ran}
        return [name for name in STUDIES if name not in ran]

    @property
    def executed(self) -> Path:
        """Folder of what pages include."""
        return self.root / "book" / "executed"

    @property
    def tables(self) -> Path:
        """Folder of the numbers that pages offer."""
        return self.root / "build" / "tables"

    @property
    def index(self) -> Path:
        """The page to open."""
        return self.root / "build" / "html" / "index.html"

    @property
    def archive(self) -> Path:
        """The whole book as one file."""
        return self.root / "build" / f"{downloads.ARCHIVE}.zip"

    @property
    def pages(self) -> list[Path]:
        """What is rendered, beside what is executed and included."""
        there = [path for path in (self.root / "book").rglob("*") if path.is_file()]
        there = [path for path in there if self.executed not in path.parents]
        return sorted({*there, self.root / "book" / "assets" / "overview.svg"})


def planned(publish: bool = False) -> Plan:
    """Return the plan of the book in this project; what takes longest comes first."""
    root = project_root()
    executed, results = root / "book" / "executed", root / "data" / "results"
    seconds = {name: cost.seconds for name, cost in effort.read().items()}
    seconds |= times.expected(times.read(times.published_path())["book"])
    names = sorted(STUDIES, key=lambda name: -seconds.get(name, 0.0))
    jobs = [Job(STUDIES[n](), executed / f"{n}.ipynb", results / f"{n}.nc") for n in names]
    return Plan(root, jobs, seconds, publish)
