"""Tables of the results of benchmarks and tests.

Benchmarks: one published run of ``python -m benchmarks --publish``. Tests: the compared values
with their tolerances, as pytest last recorded them here.
"""

import json
import statistics
import xml.etree.ElementTree as ET
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from thesis_lib.files import project_root, whole_text
from thesis_lib.templates import render
from thesis_lib.text import format_share

Row = Mapping[str, Any]

OWN_ROW, CERES_ROW = "thesis_lib, NumPy", "pycolmap, Ceres, points alone"
WORKER_COUNTS = (1, 2, 8, 32)
NOT_YET = "Nothing was measured yet; `python -m benchmarks --publish` does.\n"


def locate_benchmarks() -> Path:
    """Return the path of the published run."""
    return project_root() / "data" / "published" / "benchmarks.json"


def read_benchmarks(path: Path | None = None) -> dict[str, Any]:
    """Read the published run; empty if there is none."""
    path = path or locate_benchmarks()
    return json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}


def median_rate(row: Row) -> float:
    """Return the median rate over the rounds, in millions per second."""
    return statistics.median(row["rates"])


def median_ratio(values: Sequence[float], others: Sequence[float]) -> float:
    """Return the median ratio of `values` to `others`, over the rounds in which both ran."""
    return statistics.median(a / b for a, b in zip(values, others, strict=True))


def compare_contenders(run: Row) -> list[dict[str, Any]]:
    """Compare each contender's rate with its fastest peer, with Ceres and with one core's limit.

    Peers are packages neither of this project nor written for its benchmarks. A ratio is None if
    the other did not take part. The share of the limit is None except for this library.
    """
    rows = []
    for row in run["triangulation"]:
        problem = row["cameras"], row["refined"]
        same = [r for r in run["triangulation"] if (r["cameras"], r["refined"]) == problem]
        peer = max((one for one in same if one["package"]), key=median_rate, default=None)
        ceres = next((one for one in same if row["refined"] and one["name"] == CERES_ROW), None)
        values = {
            "rate": (rate := median_rate(row)),
            "to_peer": peer and median_ratio(row["rates"], peer["rates"]),
            "to_ceres": ceres and median_ratio(row["rates"], ceres["rates"]),
            "share": rate / row["limit"] if row["name"] == OWN_ROW else None,
        }
        rows.append({**row, **values})
    return rows


def compare_targets(run: Row) -> list[tuple[Any, ...]]:
    """Return by number of cameras the library's rate over the fastest peer's and over Ceres's."""
    own = {(r["cameras"], r["refined"]): r for r in compare_contenders(run) if r["name"] == OWN_ROW}
    return [
        (n, own.get((n, False), {}).get("to_peer"), own.get((n, True), {}).get("to_ceres"))
        for n in sorted({row["cameras"] for row in run["triangulation"]})
    ]


BENCHMARK_PARTS = {
    "machine": "machine",
    "rayleigh": "rayleigh",
    "tracking": "tracking",
    "compression": "compression",
    **dict.fromkeys(("targets", "comparison", "needs", "plan"), "triangulation"),
}
"""The measurement that each part of the page needs."""


def tabulate_benchmarks(part: str, run: Row | None = None) -> str:
    """Fill in a part of the page from a run, by default the published one."""
    run = read_benchmarks() if run is None else run
    if BENCHMARK_PARTS[part] not in run:
        return NOT_YET
    compare = {"targets": compare_targets, "comparison": compare_contenders}.get(part)
    return render(
        __file__,
        f"benchmarks-{part}",
        run=run,
        rows=compare(run) if compare else [],
        own=OWN_ROW,
        workers=WORKER_COUNTS,
        median=statistics.median,
        median_rate=median_rate,
        median_ratio=median_ratio,
        share=format_share,
    )


PIECES: dict[str, Callable[[], str]] = {
    f"benchmarks-{part}": partial(tabulate_benchmarks, part) for part in BENCHMARK_PARTS
}


CONFORMANCE_PIECES = ("conformance-totals", "conformance-tables")


def read_checks(path: Path) -> dict[str, Any]:
    """Return date, seconds, checks and failed tests from a report of pytest.

    Without a report, since the tests have not run here, there are no checks.
    """
    if not path.is_file():
        return {"checks": [], "failed": []}
    suite = ET.parse(path).getroot()[0]
    checks: dict[tuple[str, int], dict[str, Any]] = {}
    failed = set()
    for case in suite.iter("testcase"):
        file = case.get("classname", "").replace(".", "/")
        test = f"{file}.py::{case.get('name')}".partition("[")[0]
        if case.find("failure") is not None or case.find("error") is not None:
            failed.add(test)
        for found in case.iterfind(".//property[@name='conforms']"):
            new = {"file": f"{file}.py", "test": test, **json.loads(found.get("value", ""))}
            old = checks.get((test, new["line"]), {**new, "count": 0})
            worst = max(old, new, key=lambda one: (not one["passed"], one["share"] or 0))
            checks[test, new["line"]] = {**worst, "count": old["count"] + new["count"]}
    return {
        "date": suite.get("timestamp", "").partition("T")[0],
        "seconds": float(suite.get("time", 0)),
        "checks": [checks[key] for key in sorted(checks)],
        "failed": sorted(failed),
    }


def write_conformance(folder: Path, report_path: Path) -> None:
    """Write the tables and their totals into a folder, from a report of pytest."""
    report = read_checks(report_path)
    for piece in CONFORMANCE_PIECES:
        whole_text(folder / f"{piece}.md", render(__file__, piece, **report))
