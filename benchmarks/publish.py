"""One run beside the peers as JSON, from which the book's page is written."""

from __future__ import annotations

import datetime
import json
import os
import platform
from collections.abc import Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

from benchmarks.limits import Limits, flops, traffic
from benchmarks.peers import Timed, missing, versions
from benchmarks.rayleigh import Transfer
from thesis_lib import files
from thesis_lib.book.pieces import benchmarks as benchmark_tables


def processor() -> str:
    """The processor's name, where the system tells it."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text(encoding="utf-8").splitlines() if info.is_file() else []
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()


def load() -> list[float]:
    """Jobs that wanted a processor over the last 1, 5 and 15 minutes, where the system tells."""
    return [round(x, 2) for x in os.getloadavg()] if hasattr(os, "getloadavg") else []


def rounded(value: Any) -> Any:
    """Numbers to five digits: more is noise."""
    if isinstance(value, float):
        return float(f"{value:.5g}")
    if isinstance(value, dict):
        return {key: rounded(entry) for key, entry in value.items()}
    return [rounded(entry) for entry in value] if isinstance(value, list) else value


def run(limits: Limits, timed: Sequence[Timed], fields: Sequence[Transfer]) -> dict[str, Any]:
    """What one run measured, where and when."""
    return rounded({
        "date": datetime.datetime.now(datetime.UTC).date().isoformat(),
        "machine": {"processor": processor(), "cores": os.cpu_count(),
                    "system": platform.system(), "load": load()},
        "python": platform.python_version(),
        "versions": versions(),
        "missing": missing(),
        "limits": asdict(limits),
        "triangulation": [
            asdict(t) | {"flops": flops(t.cameras, 3 if t.refined else 0),
                         "bytes": traffic(t.cameras),
                         "limit": limits.rate(t.cameras, 3 if t.refined else 0)}
            for t in timed
        ],
        "rayleigh": [asdict(f) for f in fields],
    })  # fmt: skip


def write(data: dict[str, Any], path: Path) -> None:
    """As JSON, whole or not at all."""
    text = json.dumps(data, indent=1, ensure_ascii=False) + "\n"
    files.whole_file(path, partial(Path.write_text, data=text, encoding="utf-8"))


def keep(data: dict[str, Any]) -> None:
    """Make this what the book shows, beside what else was measured."""
    path = benchmark_tables.locate_benchmarks()
    write(benchmark_tables.read_benchmarks() | data, path)
    print(f"kept: {path}")
