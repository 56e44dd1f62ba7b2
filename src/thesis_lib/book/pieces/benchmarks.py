"""Tables of what benchmarks and tests measured.

Of the former one published run of ``python -m benchmarks --publish``; of the latter what they
compared, with tolerances, as pytest last recorded it here.
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

NUMPY_ROW, COMPILED_ROW, CERES_ROW = (
    "thesis_lib, NumPy",
    "thesis_lib, compiled",
    "pycolmap, Ceres, points alone",
)
OWN_PACKAGES = ("", "numba")  # needed by no peer
PLANNED_POINTS = 10**9
CHUNK_POINTS = 2**20  # that a worker holds at a time
WORKER_COUNTS = (1, 2, 8, 32)
NOT_YET = "Nothing was measured yet; `python -m benchmarks --publish` does.\n"


def locate_benchmarks() -> Path:
    """Return where the published run is kept."""
    return project_root() / "data" / "published" / "benchmarks.json"


def read_benchmarks(path: Path | None = None) -> dict[str, Any]:
    """Read the published run; empty if there is none."""
    path = path or locate_benchmarks()
    return json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}


def median_rate(row: Row) -> float:
    """Return the median over the rounds, in million a second."""
    return statistics.median(row["rates"])


def median_ratio(row: Row | None, other: Row | None) -> float | None:
    """Return how many times as fast as another: median over the rounds, in each of which both ran.

    None if one of them is missing.
    """
    if row is None or other is None:
        return None
    return statistics.median(a / b for a, b in zip(row["rates"], other["rates"], strict=True))


def find_contender(rows: Sequence[Row], cameras: int, refined: bool, name: str) -> Row | None:
    """Find a contender's row, if it took part."""
    wanted = cameras, refined, name
    return next((r for r in rows if (r["cameras"], r["refined"], r["name"]) == wanted), None)


def fastest_peer(rows: Sequence[Row], cameras: int, refined: bool) -> Row | None:
    """Find the fastest that is neither of this project nor written for its benchmarks."""
    peers = [
        row
        for row in rows
        if row["package"] not in OWN_PACKAGES
        and (row["cameras"], row["refined"]) == (cameras, refined)
    ]
    return max(peers, key=median_rate) if peers else None


def _limit_share(row: Row | None) -> float | None:
    """Return the part of one core's limit that the library reaches, None of others."""
    own = row is not None and row["name"] in (NUMPY_ROW, COMPILED_ROW)
    return median_rate(row) / row["limit"] if row is not None and own else None


def compare_contenders(run: Row) -> dict[str, Any]:
    """Compare every contender's rate with the peers and the limit."""
    rows = run["triangulation"]
    return {
        "rows": [
            {
                **row,
                "rate": median_rate(row),
                "to_peer": median_ratio(row, fastest_peer(rows, row["cameras"], row["refined"])),
                "to_ceres": median_ratio(row, find_contender(rows, row["cameras"], True, CERES_ROW))
                if row["refined"]
                else None,
                "share": _limit_share(row),
            }
            for row in rows
        ]
    }


def compare_targets(run: Row) -> dict[str, Any]:
    """Compare with what was aimed at, for each number of cameras."""
    rows = run["triangulation"]
    counts = []
    for n in sorted({row["cameras"] for row in rows}):
        ceres = find_contender(rows, n, True, CERES_ROW)
        compiled = find_contender(rows, n, True, COMPILED_ROW)
        values = {
            "cameras": n,
            "linear": median_ratio(
                find_contender(rows, n, False, NUMPY_ROW), fastest_peer(rows, n, False)
            ),
            "refined": median_ratio(find_contender(rows, n, True, NUMPY_ROW), ceres),
            "compiled": median_ratio(compiled, ceres),
            "share": _limit_share(compiled),
        }
        counts.append(values)
    return {"counts": counts}


def estimate_limits(run: Row) -> dict[str, Any]:
    """Estimate the rates that arithmetic and traffic per point allow one core."""
    limits = run["limits"]
    return {
        "rows": [
            {
                **row,
                "by_arithmetic": 1e3 * limits["peak"] / row["flops"],
                "by_memory": 1e3 * limits["bandwidth"] / row["bytes"],
            }
            for row in run["triangulation"]
            if row["name"] == NUMPY_ROW
        ]
    }


def compare_transfers(run: Row) -> dict[str, Any]:
    """Compare the rates of the transfer from pistons to points."""
    rows = run["rayleigh"]
    return {
        "rows": [{**r, "rate": median_rate(r), "ratio": median_ratio(r, rows[0])} for r in rows]
    }


def plan_points(run: Row) -> dict[str, Any]:
    """Plan time and memory of a thousand million refined points, at the measured rates."""
    rows = []
    for row in run["triangulation"]:
        if row["refined"] and row["name"] in (NUMPY_ROW, COMPILED_ROW):
            seconds = PLANNED_POINTS / (1e6 * median_rate(row))
            read_bytes = 1e9 * run["limits"]["bandwidth"] * seconds
            values = {
                "cameras": row["cameras"],
                "by": row["name"].split(", ")[1],
                "images_gb": 16e-9 * row["cameras"] * PLANNED_POINTS,
                "points_gb": 24e-9 * PLANNED_POINTS,
                "chunk_mib": row["bytes"] * CHUNK_POINTS / 2**20,
                "seconds": seconds,
                "fed": read_bytes / (row["bytes"] * PLANNED_POINTS),
            }
            rows.append(values)
    return {"rows": rows, "workers": WORKER_COUNTS}


def compare_trackers(run: Row) -> dict[str, Any]:
    """Compare trackers on the same frames with the library's."""
    rows = run["tracking"]["rows"]
    own = {row["film"]: row["milliseconds"] for row in rows if row["by"] == "thesis_lib"}
    found = []
    for row in rows:
        pairs = zip(row["milliseconds"], own[row["film"]], strict=True)
        microseconds = 1e3 * statistics.median(row["milliseconds"])
        slower = statistics.median(a / b for a, b in pairs)
        found.append({**row, "microseconds": microseconds, "ratio": slower})
    return {"rows": found}


def compare_films(run: Row) -> dict[str, Any]:
    """Compare what films leave of a motion, by the pixels that it moves an image."""
    rows = run["compression"]["rows"]
    films = list(dict.fromkeys(row["film"] for row in rows))
    by = {(row["motion_px"], row["film"]): format_share(row["error"]) for row in rows}
    motions = sorted({row["motion_px"] for row in rows})
    return {"films": films, "rows": [(px, [by[px, film] for film in films]) for px in motions]}


BENCHMARK_VALUES: dict[str, tuple[str, Callable[[Row], dict[str, Any]]]] = {
    "machine": ("machine", lambda run: {}),
    "targets": ("triangulation", compare_targets),
    "comparison": ("triangulation", compare_contenders),
    "needs": ("triangulation", estimate_limits),
    "rayleigh": ("rayleigh", compare_transfers),
    "plan": ("triangulation", plan_points),
    "tracking": ("tracking", compare_trackers),
    "compression": ("compression", compare_films),
}
"""By part of the page: the measurement that it needs, and what computes its values."""


def tabulate_benchmarks(part: str, run: Row | None = None) -> str:
    """Fill in a part of the page from a run, by default the published one."""
    run = read_benchmarks() if run is None else run
    needs, values = BENCHMARK_VALUES[part]
    if needs not in run:
        return NOT_YET
    return render(__file__, f"benchmarks-{part}", run=run, **values(run))


PIECES: dict[str, Callable[[], str]] = {
    **{f"benchmarks-{part}": partial(tabulate_benchmarks, part) for part in BENCHMARK_VALUES}
}


CHECK_KINDS = {
    "closed form": "closed forms",
    "order": "orders",
    "invariance": "invariances",
    "independent": "independent evaluations",
    "sampled": "predictions against samples",
}
CONFORMANCE_PIECES = ("conformance-totals", "conformance-tables")


def locate_report() -> Path:
    """Return where ``make test-all`` leaves what pytest recorded."""
    return project_root() / "build" / "conformance.xml"


def read_checks(path: Path) -> dict[str, Any]:
    """Return what a report of pytest says of checks: date, seconds, checks, and failed tests.

    No checks if the tests have not run here.
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
            new = {"test": test, **json.loads(found.get("value", ""))}
            old = checks.get((test, new["line"]), {**new, "count": 0})
            worst = max(old, new, key=lambda one: one["share"] or 0)
            checks[test, new["line"]] = {**worst, "count": old["count"] + new["count"]}
    return {
        "date": suite.get("timestamp", "").partition("T")[0],
        "seconds": float(suite.get("time", 0)),
        "checks": [checks[key] for key in sorted(checks)],
        "failed": sorted(failed),
    }


def write_conformance(folder: Path, report_path: Path | None = None) -> None:
    """Write the tables and their totals into a folder, from what the tests last recorded here."""
    report = read_checks(report_path or locate_report())
    files: dict[str, list[dict[str, Any]]] = {}
    for check in report["checks"]:
        file, _, name = check["test"].partition("::")
        check["words"] = name.removeprefix("test_").replace("_", " ").capitalize()
        check["percent"] = None if check["share"] is None else int(100 * check["share"])
        files.setdefault(file, []).append(check)
    kinds = [check["kind"] for check in report["checks"]]
    report |= {
        "files": files,
        "counts": {CHECK_KINDS[one]: kinds.count(one) for one in CHECK_KINDS},
    }
    for piece in CONFORMANCE_PIECES:
        whole_text(folder / f"{piece}.md", render(__file__, piece, **report))
