"""A large study in pieces: by one process and by workers, each in a process of its own.

``python -m benchmarks.scale TRIALS [SCHEDULER]`` measures one of them and prints it as JSON.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from benchmarks.publish import load

CASES = ["4a"]  # of the plate: 2 to 12 cameras
SCHEDULERS = ("", "processes")


class _Noted(Mapping[str, Any]):
    """What is filled in, and when that began."""

    def __init__(self, values: Mapping[str, Any]) -> None:
        self.values_, self.began = values, 0.0

    def __getitem__(self, name: str) -> Any:
        self.began = self.began or time.perf_counter()
        return self.values_[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.values_)

    def __len__(self) -> int:
        return len(self.values_)


def measure(trials: int, scheduler: str) -> dict[str, Any]:
    """Seconds until the first result and from then on, points, and the largest memory here."""
    from dataclasses import replace

    from thesis_lib.figure_sets.parametric import compute as studies
    from thesis_lib.figure_sets.parametric.parameters import camera_study
    from thesis_lib.studies import effort, storage

    study = camera_study("plate-arrays", {"trials": trials, "cases": CASES})
    outline = studies.outline(study, scheduler)
    noted = []

    def fill(values: Mapping[str, Any]) -> None:
        noted.append(_Noted(values))
        outline.fill(noted[0])

    start = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        storage.fill_in(replace(outline, fill=fill), Path(folder) / "cube.nc", lambda: 0.0)
    end = time.perf_counter()
    settings, markers = len(study.settings()), study.structure.markers.shape[1]
    return {
        "by": scheduler or "this process",
        "workers": (os.cpu_count() or 1) if scheduler else 1,
        "trials": trials,
        "points": settings * (trials + 1) * (1 + len(study.modes)) * markers,
        "start": noted[0].began - start,
        "seconds": end - noted[0].began,
        "cube_mb": outline.nbytes / 1e6,
        "memory_mb": effort.peak_memory_mb(),
    }


def compare(trials: tuple[int, ...] = (1000, 4000)) -> dict[str, Any]:
    """Every scheduler with few and with many trials, and the load of the machine meanwhile."""
    rows = []
    for scheduler in SCHEDULERS:
        for number in trials:
            done = subprocess.run(
                [sys.executable, "-m", "benchmarks.scale", str(number), scheduler],
                capture_output=True, text=True, check=True,
                env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
            )  # fmt: skip
            rows.append(json.loads(done.stdout))
    return {"rows": rows, "load": load()}


if __name__ == "__main__":
    print(json.dumps(measure(int(sys.argv[1]), (sys.argv[2:] or [""])[0])))
