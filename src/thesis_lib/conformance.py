"""The report of conformance: what the tests measured, with its tolerance, for the book.

The tests themselves tell what they compare (`tests/conforms.py`); here their report is asked for
and laid out. No number of it is kept anywhere else.
"""

from __future__ import annotations

import html
import json
import math
import re
import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from thesis_lib.files import project_root, whole_text
from thesis_lib.markdown import escape, table
from thesis_lib.runs import RunError

Record = dict[str, Any]

AREAS = {
    "Beam and plate": "structures plate",
    "Vision": "cameras triangulation optics compiled explorer",
    "Acoustics": "radiation planes sound",
    "The studies": "studies readings stated_numbers conclusions ledger trends",
    "The experiment": "scene lens render media corners calibration adjustment synchronisation "
    "listening tracking reconstruction laboratory experiment_study lab_layouts lab_motions",
    "Own recordings": "feasibility measuring measure result own_recordings foreign",
    "Beyond the thesis": "rounding design_law dither polytope estimators planner "
    "finite_elements shapes",
}
KINDS = {
    "closed form": "closed forms",
    "order": "orders",
    "invariance": "invariances",
    "independent": "independent evaluations",
    "sampled": "predictions against samples",
}
NEEDED = ("pytest", "xdist", "hypothesis")
REPORT = "conformance.json"
FIGURE = "conformance.svg"
_HEADER = ("Check", "Kind", "Today", "Allowed", "Off by", "Used")


def test_files() -> list[Path]:
    """Files that the report depends on besides the library; none in a book without tests."""
    root = project_root()
    folders = [root / name for name in ("tests", "benchmarks")]
    return sorted(path for folder in folders for path in folder.rglob("*.py"))


def run(path: Path) -> None:
    """Run the tests that measure something, and let them write their report.

    Checks that fail are in the report, and no error here. Tests that take long are left out.

    Parameters
    ----------
    path : Path
        The report, JSON.

    Raises
    ------
    RunError
        If the tests could not be run.
    """
    absent = [name for name in NEEDED if find_spec(name) is None]
    if not test_files():
        absent = ["tests"]
    if absent:
        whole_text(path, json.dumps({"checks": [], "failed": {}, "skipped": {}, "absent": absent}))
        return
    path.unlink(missing_ok=True)
    words = ["-q", "-n", "2", "--dist", "loadfile", "--conformance", str(path), "--quick"]
    words += ["--continue-on-collection-errors", "-p", "no:cacheprovider", "tests"]
    done = subprocess.run(
        [sys.executable, "-m", "pytest", *words],
        cwd=project_root(),
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        encoding="utf-8",
    )
    if done.returncode not in (0, 1) or not path.is_file():
        said = (done.stdout + done.stderr).strip().splitlines() or ["nothing was said"]
        raise RunError(f"pytest ended with status {done.returncode}: {said[-1]}")


def read(path: Path) -> Record:
    """A report as the tests wrote it."""
    return json.loads(path.read_text(encoding="utf-8"))


def verdict(path: Path) -> None:
    """Refuse a report with failures.

    Raises
    ------
    RunError
        Naming the tests that failed.
    """
    failed = read(path)["failed"]
    if failed:
        first, reason = next(iter(failed.items()))
        others = f" and {len(failed) - 1} more" if len(failed) > 1 else ""
        raise RunError(f"{first}{others} failed: {reason}")


def pieces(folder: Path) -> list[Path]:
    """The files of a folder that the page includes."""
    return [*(folder / f"{name}.md" for name in PIECES), folder / FIGURE]


def write(path: Path, folder: Path) -> None:
    """Put the pieces of the page made from a report into a folder."""
    from thesis_lib.conformance_figure import draw
    from thesis_lib.style import POWERS, svg

    report = read(path)
    for name, piece in PIECES.items():
        whole_text(folder / f"{name}.md", piece(report))
    whole_text(folder / FIGURE, svg(draw(report), POWERS))


def module(test: str) -> str:
    """The name of a test's module, without what all have: ``plate`` of tests/test_plate.py."""
    return Path(test.partition("::")[0]).stem.removeprefix("test_")


def area(test: str) -> str:
    """The area that a test is about."""
    return next((name for name, of in AREAS.items() if module(test) in of.split()), "Other")


def sentence(test: str) -> str:
    """The name of a test as words."""
    words = test.rpartition("::")[2].removeprefix("test_").replace("_", " ")
    return words[:1].upper() + words[1:]


def totals(report: Record) -> str:
    """How many checks there are, of which kinds and areas, and what was not checked."""
    if "absent" in report:
        names = ", ".join(report["absent"])
        return f"*Nothing was checked here: {names} missing. A clone of the project has them.*\n"
    checks, failed = report["checks"], report["failed"]
    tests = {check["test"] for check in checks}
    kinds = Counter(check["kind"] for check in checks)
    values = sum(check["count"] for check in checks)
    counted = ", ".join(f"{kinds[kind]} {plural}" for kind, plural in KINDS.items())
    outcome = "**All hold.**"
    if failed:
        outcome = f"**FAILED: {len(failed)} of them**, named below and marked in the tables."
    lines = [
        f"{len(checks)} checks in {len(tests)} tests compared {_thousands(values)} numbers in "
        f"{report['seconds']:.0f} s: {counted}. {outcome}\n"
    ]
    rows = []
    for name in [*AREAS, "Other"]:
        mine = [check for check in checks if area(check["test"]) == name]
        if mine:
            by = Counter(check["kind"] for check in mine)
            most = max(check["share"] or 0 for check in mine)
            rows.append([name, *(str(by[kind]) for kind in KINDS), str(len(mine)), used(most)])
    rows.append(["all", *(str(kinds[kind]) for kind in KINDS), str(len(checks)), ""])
    lines.append(table(["Area", *KINDS, "all", "most used"], rows))
    lines += [f"* `{test}` FAILED: {escape(reason)}\n" for test, reason in failed.items()]
    return "\n".join(lines)


def _thousands(number: int) -> str:
    return f"{number:,}".replace(",", "\N{NO-BREAK SPACE}")


def used(share: float | None) -> str:
    """Share of a tolerance in percent."""
    if share is None:
        return "–"
    percent = 100 * share
    if percent == 0:
        return "0 %"
    if percent < 0.01:
        return "< 0.01 %"
    return f"{percent:.2f} %" if percent < 1 else f"{math.floor(percent)} %"  # 100 % is the end


def tables(report: Record) -> str:
    """A table for each file of tests, in the order of the areas, and what was left out."""
    parts = []
    for name in [*AREAS, "Other"]:
        files: dict[str, list[Record]] = {}
        for check in report["checks"]:
            if area(check["test"]) == name:
                files.setdefault(check["test"].partition("::")[0], []).append(check)
        order = AREAS.get(name, "").split()
        if files:
            parts.append(f"## {name}\n")
        for file in sorted(files, key=lambda f: order.index(module(f)) if order else f):
            parts += [f"### {file}\n", _of_file(file, files[file], report)]
    if report["skipped"]:
        parts.append("## Not measured here\n")
        reasons: dict[str, list[str]] = {}
        for test, reason in report["skipped"].items():
            part = " (in part)" if any(c["test"] == test for c in report["checks"]) else ""
            reasons.setdefault(reason.removeprefix("Skipped: "), []).append(test + part)
        for reason, names in reasons.items():
            parts.append(f"{escape(reason)}:\n")
            parts += [f"* `{file}`: {', '.join(own)}" for file, own in _by_file(names).items()]
            parts.append("")
    return "\n".join(parts)


def _by_file(tests: Sequence[str]) -> dict[str, list[str]]:
    """The names of tests as words, by file."""
    found: dict[str, list[str]] = {}
    for test in tests:
        found.setdefault(test.partition("::")[0], []).append(sentence(test).lower())
    return found


def _of_file(file: str, checks: Sequence[Record], report: Record) -> str:
    about = report.get("files", {}).get(file, "")
    tests: dict[str, list[Record]] = {}
    for check in sorted(checks, key=lambda check: int(check["line"])):
        tests.setdefault(check["test"], []).append(check)
    rows = []
    for test, own in tests.items():
        words = html.escape(sentence(test))
        if len(own) == 1:
            rows.append(_row(words, own[0], test in report["failed"]))
            continue
        rows.append(f'<tr><th colspan="{len(_HEADER)}" scope="rowgroup">{words}')
        rows += [
            _row(f"<code>{html.escape(one['code'])}</code>", one, test in report["failed"])
            for one in own
        ]
    most = max(check["share"] or 0 for check in checks)
    head = "".join(f'<th scope="col">{name}' for name in _HEADER)
    summary = (
        f"{len(checks)} checks in {len(tests)} tests, the tolerance used to {used(most)} at most"
    )
    return (
        f"{escape(about)}\n\n"
        f'<details class="tl-conformance"><summary>{summary}</summary>'
        f'<div tabindex="0" role="region" aria-label="Checks of {file}"><table class="table">'
        f"<thead><tr>{head}</thead><tbody>\n" + "\n".join(rows) + "\n</table></div></details>\n"
    )


def _row(what: str, check: Record, test_failed: bool) -> str:
    """One check; a test that fails elsewhere does not let its other checks pass for sound."""
    share = check["share"]
    if not check["passed"]:
        said, bar = "<b>FAILED</b>", ""
    elif test_failed:
        said, bar = f"{used(share)} <b>test FAILED</b>", ""
    else:
        said, bar = used(share), f' style="--u:{100 * (share or 0):.0f}%"'
    many = f" <small>{_thousands(check['count'])} values</small>" if check["count"] > 1 else ""
    off = _number(check["apart"], 2) if "apart" in check else "–"
    cells = "".join(
        f"<td>{c}" for c in (check["kind"], _number(check["value"]), _allowed(check), off)
    )
    return f'<tr><th scope="row">{what}{many}{cells}<td{bar}>{said}'


def _allowed(check: Record) -> str:
    """What was allowed: the expected value with its tolerance, or bounds."""
    if "expected" in check:
        exact = float(check["allowed"]) == 0
        expected = _number(check["expected"])
        return f"{expected} exactly" if exact else f"{expected} ± {_number(check['allowed'], 2)}"
    low, high = (_number(check[side]) if side in check else "" for side in ("above", "below"))
    if low and high:
        return f"{low} … {high}"
    return f"&gt; {low}" if low else f"&lt; {high}"


def _number(text: str, digits: int = 6) -> str:
    """A number as it is read: a proper minus, and powers of ten without leading zeros."""
    number = complex(text)
    if number.imag:
        text = f"{number:.3g}"
    elif digits < 6:
        text = f"{number.real:.{digits}g}"
    return re.sub(r"e\+?(-?)0*(\d)", r"e\1\2", text).replace("-", "\N{MINUS SIGN}")


PIECES: dict[str, Callable[[Record], str]] = {
    "conformance-totals": totals,
    "conformance-tables": tables,
}
