"""What the page of benchmarks says: one published run of ``python -m benchmarks --publish``."""

from __future__ import annotations

import json
import statistics
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from thesis_lib.book.pieces import times
from thesis_lib.files import project_root
from thesis_lib.web.markdown import table

Row = Mapping[str, Any]

NUMPY, COMPILED, CERES = (
    "thesis_lib, NumPy",
    "thesis_lib, compiled",
    "pycolmap, Ceres, points alone",
)
OWN = ("", "numba")  # what needs no peer's package
RECONSTRUCTIONS = 10**9
CHUNK = 2**20  # points that a worker holds at a time
WORKERS = (1, 2, 8, 32)
NOT_YET = "Nothing was measured yet; `python -m benchmarks --publish` does.\n"


def published_path() -> Path:
    """Where the published run is kept."""
    return project_root() / "data" / "published" / "benchmarks.json"


def read(path: Path | None = None) -> dict[str, Any]:
    """The published run; empty if there is none."""
    path = path or published_path()
    return json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}


def rate(row: Row) -> float:
    """Median over the rounds, in million a second."""
    return statistics.median(row["rates"])


def ratio(row: Row, other: Row) -> float:
    """How many times as fast as another: median over the rounds, in each of which both ran."""
    return statistics.median(a / b for a, b in zip(row["rates"], other["rates"], strict=True))


def find(rows: Sequence[Row], cameras: int, refined: bool, name: str) -> Row | None:
    """A contender's row, if it took part."""
    for row in rows:
        if (row["cameras"], row["refined"], row["name"]) == (cameras, refined, name):
            return row
    return None


def fastest_peer(rows: Sequence[Row], cameras: int, refined: bool) -> Row | None:
    """The fastest of those that are not of this project, nor written for its benchmarks."""
    peers = [
        row
        for row in rows
        if row["package"] not in OWN and (row["cameras"], row["refined"]) == (cameras, refined)
    ]
    return max(peers, key=rate) if peers else None


def _times(row: Row | None, other: Row | None) -> str:
    if row is None or other is None:
        return "–"
    value = ratio(row, other)
    return f"{value:.0f}" if value >= 20 else f"{value:.2g}"


def comparison(data: Row) -> tuple[list[str], list[list[str]]]:
    """Every contender's rate, what it is beside the peers and the limit, and its error."""
    rows = data["triangulation"]
    cells = []
    for row in rows:
        best = fastest_peer(rows, row["cameras"], row["refined"])
        ceres = find(rows, row["cameras"], True, CERES) if row["refined"] else None
        own = row["package"] in OWN and row["name"] in (NUMPY, COMPILED)
        cells.append(
            [
                str(row["cameras"]),
                "refined" if row["refined"] else "linear",
                row["name"],
                f"{rate(row):.3g}",
                _times(row, best),
                _times(row, ceres),
                f"{rate(row) / row['limit']:.0%}" if own else "–",
                f"{row['error_um']:.0f}",
                f"{row['bound_um']:.0f}",
                str(row["points"]),
            ]
        )
    header = [
        "cameras",
        "estimate",
        "by",
        "million points/s",
        "× fastest peer",
        "× pycolmap",
        "of the limit",
        "rms error, µm",
        "first-order bound, µm",
        "points",
    ]
    return header, cells


def targets(data: Row) -> tuple[list[str], list[list[str]]]:
    """What was aimed at, and what was measured, for each number of cameras."""
    rows = data["triangulation"]
    counts = sorted({row["cameras"] for row in rows})

    def line(what: str, aim: str, value: Callable[[int], str]) -> list[str]:
        return [what, aim, *map(value, counts)]

    def share(n: int) -> str:
        row = find(rows, n, True, COMPILED)
        return "–" if row is None else f"{rate(row) / row['limit']:.0%}"

    def linear(n: int) -> str:
        return _times(find(rows, n, False, NUMPY), fastest_peer(rows, n, False))

    def refined(name: str, n: int) -> str:
        return _times(find(rows, n, True, name), find(rows, n, True, CERES))

    cells = [
        line("NumPy, linear, × the fastest peer", "≥ 20", linear),
        line("NumPy, refined, × pycolmap", "≥ 50 for 12", partial(refined, NUMPY)),
        line("compiled, refined, × pycolmap", "≥ 200 for 12", partial(refined, COMPILED)),
        line("compiled, refined, of one core's limit", "≥ 40 %", share),
    ]
    return ["", "aim", *(f"{n} cameras" for n in counts)], cells


def machine(data: Row) -> tuple[list[str], list[list[str]]]:
    """Where, when and with what was measured."""
    place, limits = data["machine"], data["limits"]
    told = {
        "date": data["date"],
        "machine": f"{place['processor']}, {place['cores']} cores, {place['system']}",
        "load over 1, 5 and 15 minutes": ", ".join(f"{x:.1f}" for x in place["load"]) or "unknown",
        "Python": data["python"],
        "packages": ", ".join(f"{name} {number}" for name, number in data["versions"].items()),
        "not installed": ", ".join(data["missing"]) or "none",
        "one core computes": f"{limits['peak']:.0f} Gflop/s: {limits['by']}",
        "one core reads": f"{limits['bandwidth']:.0f} GB/s",
    }
    return ["", ""], [list(pair) for pair in told.items()]


def needs(data: Row) -> tuple[list[str], list[list[str]]]:
    """Arithmetic and traffic per point, and the rates that either allows one core."""
    limits, cells = data["limits"], []
    for row in data["triangulation"]:
        if row["name"] == NUMPY:
            cells.append(
                [
                    str(row["cameras"]),
                    "refined" if row["refined"] else "linear",
                    str(row["flops"]),
                    str(row["bytes"]),
                    f"{1e3 * limits['peak'] / row['flops']:.0f}",
                    f"{1e3 * limits['bandwidth'] / row['bytes']:.0f}",
                ]
            )
    header = [
        "cameras",
        "estimate",
        "flops per point",
        "bytes per point",
        "arithmetic allows, million points/s",
        "memory allows, million points/s",
    ]
    return header, cells


def rayleigh(data: Row) -> tuple[list[str], list[list[str]]]:
    """Rates of the transfer from pistons to points."""
    rows = data["rayleigh"]
    cells = [
        [row["name"], f"{rate(row):.3g}", f"{ratio(row, rows[0]):.2g}", f"{row['difference']:.0e}"]
        for row in rows
    ]
    return ["by", "million pairs/s", "× direct", "apart from direct, of the largest"], cells


def plan(data: Row) -> tuple[list[str], list[list[str]]]:
    """Time and memory of a thousand million refined points, at the measured rates."""
    rows, cells = data["triangulation"], []
    bandwidth = 1e9 * data["limits"]["bandwidth"]
    for row in rows:
        if row["refined"] and row["name"] in (NUMPY, COMPILED):
            seconds = RECONSTRUCTIONS / (1e6 * rate(row))
            cells.append(
                [
                    str(row["cameras"]),
                    row["name"].split(", ")[1],
                    f"{16e-9 * row['cameras'] * RECONSTRUCTIONS:.0f} GB",
                    f"{24e-9 * RECONSTRUCTIONS:.0f} GB",
                    f"{row['bytes'] * CHUNK / 2**20:.0f} MiB",
                    *(_duration(seconds / n) for n in WORKERS),
                    f"{bandwidth * seconds / (row['bytes'] * RECONSTRUCTIONS):.0f}",
                ]
            )
    header = [
        "cameras",
        "by",
        "images",
        "points",
        "a worker holds",
        *(f"{n} worker{'s' * (n > 1)}" for n in WORKERS),
        "workers that one core's memory rate feeds",
    ]
    return header, cells


def scale(data: Row) -> tuple[list[str], list[list[str]]]:
    """A large study in pieces: its rate, what 10⁹ points take at it, and memory."""
    cells = []
    for row in data["scale"]["rows"]:
        rate = row["points"] / row["seconds"]
        cells.append(
            [
                row["by"],
                str(row["workers"]),
                str(row["trials"]),
                f"{row['points'] / 1e6:.1f}",
                f"{row['start']:.1f} s",
                f"{row['seconds']:.1f} s",
                f"{rate / 1e6:.2f}",
                _duration(RECONSTRUCTIONS / rate),
                f"{row['cube_mb']:.0f} MB",
                f"{row['memory_mb']:.0f} MB",
            ]
        )
    header = [
        "by",
        "processes",
        "trials",
        "million points",
        "until the first result",
        "from then on",
        "million points/s",
        "10⁹ points",
        "cube",
        "largest memory",
    ]
    return header, cells


def scale_load(data: Row) -> str:
    """What else the machine did while the large study was measured."""
    load = ", ".join(f"{x:.1f}" for x in data["scale"]["load"]) or "unknown"
    return f"Load of the machine at the end, over 1, 5 and 15 minutes: {load}.\n"


def _duration(seconds: float) -> str:
    return f"{seconds / 60:.1f} min" if seconds >= 90 else f"{seconds:.2g} s"


def _piece(make: Callable[[Row], tuple[list[str], list[list[str]]]]) -> str:
    data = read()
    return table(*make(data)) if data else NOT_YET


def _scale() -> str:
    data = read()
    return f"{table(*scale(data))}\n{scale_load(data)}" if "scale" in data else NOT_YET


PIECES: dict[str, Callable[[], str]] = {
    "benchmarks-machine": partial(_piece, machine),
    "benchmarks-targets": partial(_piece, targets),
    "benchmarks-comparison": partial(_piece, comparison),
    "benchmarks-needs": partial(_piece, needs),
    "benchmarks-rayleigh": partial(_piece, rayleigh),
    "benchmarks-plan": partial(_piece, plan),
    "benchmarks-scale": _scale,
    "benchmarks-times": times.piece,
}
