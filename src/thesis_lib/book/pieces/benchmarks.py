"""What the page of benchmarks says: one published run of ``python -m benchmarks --publish``."""

from __future__ import annotations

import json
import statistics
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from thesis_lib.book.pieces import times
from thesis_lib.files import project_root
from thesis_lib.web.markdown import columns, table

Row = Mapping[str, Any]
Cells = dict[str, str]  # by the names of their columns

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


def comparison(data: Row) -> Iterator[Cells]:
    """Every contender's rate, what it is beside the peers and the limit, and its error."""
    rows = data["triangulation"]
    for row in rows:
        best = fastest_peer(rows, row["cameras"], row["refined"])
        ceres = find(rows, row["cameras"], True, CERES) if row["refined"] else None
        own = row["package"] in OWN and row["name"] in (NUMPY, COMPILED)
        yield {
            "cameras": str(row["cameras"]),
            "estimate": "refined" if row["refined"] else "linear",
            "by": row["name"],
            "million points/s": f"{rate(row):.3g}",
            "× fastest peer": _times(row, best),
            "× pycolmap": _times(row, ceres),
            "of the limit": f"{rate(row) / row['limit']:.0%}" if own else "–",
            "rms error, µm": f"{row['error_um']:.0f}",
            "first-order bound, µm": f"{row['bound_um']:.0f}",
            "points": str(row["points"]),
        }


def targets(data: Row) -> Iterator[Cells]:
    """What was aimed at, and what was measured, for each number of cameras."""
    rows = data["triangulation"]
    counts = sorted({row["cameras"] for row in rows})

    def line(what: str, aim: str, value: Callable[[int], str]) -> Cells:
        return {"": what, "aim": aim} | {f"{n} cameras": value(n) for n in counts}

    def share(n: int) -> str:
        row = find(rows, n, True, COMPILED)
        return "–" if row is None else f"{rate(row) / row['limit']:.0%}"

    def linear(n: int) -> str:
        return _times(find(rows, n, False, NUMPY), fastest_peer(rows, n, False))

    def refined(name: str, n: int) -> str:
        return _times(find(rows, n, True, name), find(rows, n, True, CERES))

    yield line("NumPy, linear, × the fastest peer", "≥ 20", linear)
    yield line("NumPy, refined, × pycolmap", "≥ 50 for 12", partial(refined, NUMPY))
    yield line("compiled, refined, × pycolmap", "≥ 200 for 12", partial(refined, COMPILED))
    yield line("compiled, refined, of one core's limit", "≥ 40 %", share)


def machine(data: Row) -> Cells:
    """Where, when and with what was measured."""
    place, limits = data["machine"], data["limits"]
    return {
        "date": data["date"],
        "machine": f"{place['processor']}, {place['cores']} cores, {place['system']}",
        "load over 1, 5 and 15 minutes": ", ".join(f"{x:.1f}" for x in place["load"]) or "unknown",
        "Python": data["python"],
        "packages": ", ".join(f"{name} {number}" for name, number in data["versions"].items()),
        "not installed": ", ".join(data["missing"]) or "none",
        "one core computes": f"{limits['peak']:.0f} Gflop/s: {limits['by']}",
        "one core reads": f"{limits['bandwidth']:.0f} GB/s",
    }


def needs(data: Row) -> Iterator[Cells]:
    """Arithmetic and traffic per point, and the rates that either allows one core."""
    limits = data["limits"]
    for row in data["triangulation"]:
        if row["name"] == NUMPY:
            allowed = 1e3 * limits["bandwidth"] / row["bytes"]
            yield {
                "cameras": str(row["cameras"]),
                "estimate": "refined" if row["refined"] else "linear",
                "flops per point": str(row["flops"]),
                "bytes per point": str(row["bytes"]),
                "arithmetic allows, million points/s": f"{1e3 * limits['peak'] / row['flops']:.0f}",
                "memory allows, million points/s": f"{allowed:.0f}",
            }


def rayleigh(data: Row) -> Iterator[Cells]:
    """Rates of the transfer from pistons to points."""
    rows = data["rayleigh"]
    for row in rows:
        yield {
            "by": row["name"],
            "million pairs/s": f"{rate(row):.3g}",
            "× direct": f"{ratio(row, rows[0]):.2g}",
            "apart from direct, of the largest": f"{row['difference']:.0e}",
        }


def plan(data: Row) -> Iterator[Cells]:
    """Time and memory of a thousand million refined points, at the measured rates."""
    rows = data["triangulation"]
    bandwidth = 1e9 * data["limits"]["bandwidth"]
    for row in rows:
        if row["refined"] and row["name"] in (NUMPY, COMPILED):
            seconds = RECONSTRUCTIONS / (1e6 * rate(row))
            fed = bandwidth * seconds / (row["bytes"] * RECONSTRUCTIONS)
            yield {
                "cameras": str(row["cameras"]),
                "by": row["name"].split(", ")[1],
                "images": f"{16e-9 * row['cameras'] * RECONSTRUCTIONS:.0f} GB",
                "points": f"{24e-9 * RECONSTRUCTIONS:.0f} GB",
                "a worker holds": f"{row['bytes'] * CHUNK / 2**20:.0f} MiB",
                **{f"{n} worker{'s' * (n > 1)}": _duration(seconds / n) for n in WORKERS},
                "workers that one core's memory rate feeds": f"{fed:.0f}",
            }


def scale(data: Row) -> Iterator[Cells]:
    """A large study in pieces: its rate, what 10⁹ points take at it, and memory."""
    for row in data["scale"]["rows"]:
        rate = row["points"] / row["seconds"]
        yield {
            "by": row["by"],
            "processes": str(row["workers"]),
            "trials": str(row["trials"]),
            "million points": f"{row['points'] / 1e6:.1f}",
            "until the first result": f"{row['start']:.1f} s",
            "from then on": f"{row['seconds']:.1f} s",
            "million points/s": f"{rate / 1e6:.2f}",
            "10⁹ points": _duration(RECONSTRUCTIONS / rate),
            "cube": f"{row['cube_mb']:.0f} MB",
            "largest memory": f"{row['memory_mb']:.0f} MB",
        }


def tracking(data: Row) -> Iterator[Cells]:
    """Trackers on the same frames: time, exactness, and what each loses."""
    rows = data["tracking"]["rows"]
    own = {row["film"]: row["milliseconds"] for row in rows if row["by"] == "thesis_lib"}
    for row in rows:
        pairs = zip(row["milliseconds"], own[row["film"]], strict=True)
        yield {
            "film": row["film"],
            "by": row["by"],
            "µs a marker and frame": f"{1e3 * statistics.median(row['milliseconds']):.1f}",
            "× thesis_lib": f"{statistics.median(a / b for a, b in pairs):.2g}",
            "rms amplitude error, px": f"{row['amplitude_error']:.4f}",
            "missing, said": f"{row['told']:.0%}",
            "lost, not said": f"{row['untold']:.0%}",
        }


def compression(data: Row) -> Iterator[Cells]:
    """What films leave of a motion, by the pixels that it moves an image."""
    rows = data["compression"]["rows"]
    for motion in sorted({row["motion_px"] for row in rows}):
        yield {"motion, px": f"{motion:g}"} | {
            row["film"]: percent(row["error"]) for row in rows if row["motion_px"] == motion
        }


def percent(share: float) -> str:
    """A share in percent, to two digits or whole."""
    return f"{100 * share:.{0 if share >= 0.1 else 1}f} %"


def scale_load(data: Row) -> str:
    """What else the machine did while the large study was measured."""
    load = ", ".join(f"{x:.1f}" for x in data["scale"]["load"]) or "unknown"
    return f"Load of the machine at the end, over 1, 5 and 15 minutes: {load}.\n"


def _duration(seconds: float) -> str:
    return f"{seconds / 60:.1f} min" if seconds >= 90 else f"{seconds:.2g} s"


def _piece(make: Callable[[Row], Iterator[Cells]]) -> str:
    data = read()
    return columns(make(data)) if data else NOT_YET


def _machine() -> str:
    data = read()
    return table(["", ""], [list(pair) for pair in machine(data).items()]) if data else NOT_YET


def _scale() -> str:
    data = read()
    return f"{columns(scale(data))}\n{scale_load(data)}" if "scale" in data else NOT_YET


def _tracking() -> str:
    data = read()
    return columns(tracking(data)) if "tracking" in data else NOT_YET


def _compression() -> str:
    data = read()
    return columns(compression(data)) if "compression" in data else NOT_YET


PIECES: dict[str, Callable[[], str]] = {
    "benchmarks-machine": _machine,
    "benchmarks-targets": partial(_piece, targets),
    "benchmarks-comparison": partial(_piece, comparison),
    "benchmarks-needs": partial(_piece, needs),
    "benchmarks-rayleigh": partial(_piece, rayleigh),
    "benchmarks-plan": partial(_piece, plan),
    "benchmarks-scale": _scale,
    "benchmarks-tracking": _tracking,
    "benchmarks-compression": _compression,
    "benchmarks-times": times.piece,
}
