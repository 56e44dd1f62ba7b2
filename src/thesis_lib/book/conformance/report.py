"""The report of conformance: what the tests measured, with its tolerance, for the book.

The tests themselves tell what they compare (`tests/conforms.py`), `make test-all` leaves their
report in `build`, and `thesis book --publish` makes it the published one, which is laid out here.
"""

from __future__ import annotations

import hashlib
import html
import json
import math
import re
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

from thesis_lib.book.conformance.areas import AREAS, KINDS, area, module
from thesis_lib.files import project_root, whole_text
from thesis_lib.runs.tasks import RunError
from thesis_lib.studies.reach import digest, reached
from thesis_lib.web.markdown import escape, table

Record = dict[str, Any]
REPORT = "conformance.json"
NOT_YET = "Nothing is published yet; `make test-all` measures, `thesis book --publish` publishes.\n"
FIGURE = "conformance.svg"
_HEADER = ("Check", "Kind", "Value", "Allowed", "Off by", "Used")


def published_path() -> Path:
    """Where the published report is kept."""
    return project_root() / "data" / "published" / REPORT


def read(path: Path | None = None) -> Record:
    """A report as the tests wrote it, the published one by default; one of nothing if none is."""
    path = path or published_path()
    if path.is_file():
        return json.loads(path.read_text(encoding="utf-8"))
    return {"checks": [], "files": {}, "failed": {}, "skipped": {}, "code": {}}


def publish(path: Path) -> None:
    """Make a report the published one.

    Raises
    ------
    RunError
        If something failed in it, naming what; or if it lacks the slow tests, which a full run has.
    """
    if failed := read(path)["failed"]:
        first, reason = next(iter(failed.items()))
        others = f" and {len(failed) - 1} more" if len(failed) > 1 else ""
        raise RunError(f"{path} is not published: {first}{others} failed: {reason}")
    if read().get("slow") and not read(path).get("slow"):
        raise RunError(f"{path} is not published: no slow test was run; make test-all runs all")
    whole_text(published_path(), path.read_text(encoding="utf-8"))


def test_files() -> list[Path]:
    """The code that measures; none in a book without tests."""
    root = project_root()
    return sorted(path for name in ("tests", "benchmarks") for path in (root / name).rglob("*.py"))


def code(files: Iterable[Path]) -> dict[str, str]:
    """Digests of all code that some files rest on, by the place in the project."""
    root = project_root()
    every = {one for file in files for one in reached(file) if one.is_relative_to(root)}
    return {path.relative_to(root).as_posix(): digest(path) for path in sorted(every)}


def changed(report: Record) -> dict[str, list[str]]:
    """Code that has changed since it was measured, for each file of tests that rests on such."""
    root, found = project_root(), {}
    for test in report["files"]:
        now = code([root / test]) if (root / test).is_file() else {test: ""}
        found[test] = [file for file, is_now in now.items() if report["code"].get(file) != is_now]
    return {test: files for test, files in found.items() if files}


def pieces(folder: Path) -> list[Path]:
    """The files of a folder that the page includes."""
    return [*(folder / f"{name}.md" for name in PIECES), folder / FIGURE]


def write(folder: Path) -> None:
    """Put the pieces of the page, made from the published report, into a folder."""
    from thesis_lib.book.conformance.figure import draw
    from thesis_lib.plotting.style import POWERS, svg

    report = read()
    report["changed"] = changed(report)
    for name, piece in PIECES.items():
        whole_text(folder / f"{name}.md", piece(report))
    whole_text(folder / FIGURE, svg(draw(report), POWERS))


def sentence(test: str) -> str:
    """The name of a test as words."""
    words = test.rpartition("::")[2].removeprefix("test_").replace("_", " ")
    return words[:1].upper() + words[1:]


def totals(report: Record) -> str:
    """How many checks there are, of which kinds and areas, when they held, and what changed."""
    if not report["checks"]:
        return NOT_YET
    checks = report["checks"]
    tests = {check["test"] for check in checks}
    kinds = Counter(check["kind"] for check in checks)
    values = sum(check["count"] for check in checks)
    counted = ", ".join(f"{kinds[kind]} {plural}" for kind, plural in KINDS.items())
    stale = sum(_file(check) in report["changed"] for check in checks)
    total = hashlib.sha256(json.dumps(report["code"], sort_keys=True).encode()).hexdigest()
    lines = [
        f"{len(checks)} checks in {len(tests)} tests compared {_thousands(values)} numbers in "
        f"{report['seconds']:.0f} s: {counted}. **All held** on {report['date']}, with the code "
        f"whose digest is `{total[:16]}`.\n"
    ]
    lines.append(_left_out(report))
    if stale:
        lines.append(f"The code of {stale} of them has changed since; they are marked.\n")
    rows = []
    for name in [*AREAS, "Other"]:
        mine = [check for check in checks if area(check["test"]) == name]
        if mine:
            by = Counter(check["kind"] for check in mine)
            most = max(check["share"] or 0 for check in mine)
            rows.append([name, *(str(by[kind]) for kind in KINDS), str(len(mine)), used(most)])
    rows.append(["all", *(str(kinds[kind]) for kind in KINDS), str(len(checks)), ""])
    lines.append(table(["Area", *KINDS, "all", "most used"], rows))
    return "\n".join(lines)


def _left_out(report: Record) -> str:
    """Which checks are slow, and which tests are not here, with the reason."""
    slow = [check["test"] for check in report["checks"] if check["test"] in report.get("slow", [])]
    said = (
        f"{len(slow)} of the checks, in {len(set(slow))} tests, are *slow* and marked so: "
        f"`make test` leaves them out, `make test-all` last measured them on {report['date']}."
    )
    if skipped := report["skipped"]:
        said += (
            f" {len(skipped)} tests could not run in full; [the end](#not-measured-here) says why."
        )
    nightly = report.get("nightly", {})
    compared = sum(nightly.values())
    said += (
        f"\n\nLeft out are {len(nightly)} *nightly* tests, which take an hour or more "
        f"(`make test-nightly`); {compared or 'none'} of them would make checks. All other tests "
        "that are not here ask yes or no, of words, files and refusals above all.\n"
    )
    if nightly:
        files = _by_file(list(nightly)).items()
        said += "\n" + "\n".join(f"* `{file}`: {', '.join(own)}" for file, own in files) + "\n"
    return said


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
                files.setdefault(_file(check), []).append(check)
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


def _file(check: Record) -> str:
    """The file of a check's test."""
    return str(check["test"]).partition("::")[0]


def _by_file(tests: Sequence[str]) -> dict[str, list[str]]:
    """The names of tests as words, by file."""
    found: dict[str, list[str]] = {}
    for test in tests:
        found.setdefault(test.partition("::")[0], []).append(sentence(test).lower())
    return found


def _of_file(file: str, checks: Sequence[Record], report: Record) -> str:
    changed = report["changed"].get(file, [])
    about = escape(report["files"].get(file, ""))
    if changed:
        about += f"\n\n**Changed since:** {', '.join(f'`{name}`' for name in changed)}."
    tests: dict[str, list[Record]] = {}
    for check in sorted(checks, key=lambda check: int(check["line"])):
        tests.setdefault(check["test"], []).append(check)
    rows = []
    for test, own in tests.items():
        words = html.escape(sentence(test))
        if test in report.get("slow", []):
            words += " <small>slow</small>"
        if len(own) == 1:
            rows.append(_row(words, own[0], bool(changed)))
            continue
        rows.append(f'<tr><th colspan="{len(_HEADER)}" scope="rowgroup">{words}')
        rows += [
            _row(f"<code>{html.escape(one['code'])}</code>", one, bool(changed)) for one in own
        ]
    most = max(check["share"] or 0 for check in checks)
    head = "".join(f'<th scope="col">{name}' for name in _HEADER)
    summary = (
        f"{len(checks)} checks in {len(tests)} tests, the tolerance used to {used(most)} at most"
    )
    return (
        f"{about}\n\n"
        f'<details class="tl-conformance"><summary>{summary}</summary>'
        f'<div tabindex="0" role="region" aria-label="Checks of {file}"><table class="table">'
        f"<thead><tr>{head}</thead><tbody>\n" + "\n".join(rows) + "\n</table></div></details>\n"
    )


def _row(what: str, check: Record, stale: bool) -> str:
    """One check; it tells if its code has changed since."""
    share = check["share"]
    said = used(share) + (" <b>before a change</b>" if stale else "")
    bar = f' style="--u:{100 * (share or 0):.0f}%"'
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
