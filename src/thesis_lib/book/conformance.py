"""The tables on conformance: what the tests compared, with tolerances, as pytest recorded it."""

from __future__ import annotations

import html
import json
import xml.etree.ElementTree as ET
from collections import Counter
from pathlib import Path
from typing import Any

from thesis_lib import templates
from thesis_lib.files import project_root, whole_text

JUNIT_REPORT = "conformance.xml"  # in the folder build; written by ``pytest --junitxml``
CHECK_KINDS = {
    "closed form": "closed forms",
    "order": "orders",
    "invariance": "invariances",
    "independent": "independent evaluations",
    "sampled": "predictions against samples",
}
PIECES = ("conformance-totals", "conformance-tables")


def locate_report() -> Path:
    """Return where ``make test-all`` leaves what pytest recorded."""
    return project_root() / "build" / JUNIT_REPORT


def read_checks(path: Path) -> dict[str, Any]:
    """Return what a report of pytest says of checks: date, seconds, checks, and failed tests.

    No checks if the tests have not run here.
    """
    if not path.is_file():
        return {"checks": [], "failed": []}
    suite = ET.parse(path).getroot()[0]
    checks: dict[tuple[str, int], dict[str, Any]] = {}
    failed = []
    for case in suite.iter("testcase"):
        file = case.get("classname", "").replace(".", "/")
        test = f"{file}.py::{case.get('name')}".partition("[")[0]
        if case.find("failure") is not None or case.find("error") is not None:
            failed.append(test)
        for found in case.iterfind(".//property[@name='conforms']"):
            new = {"test": test, **json.loads(found.get("value", ""))}
            old = checks.get((test, new["line"]), {**new, "count": 0})
            worst = max(old, new, key=lambda one: one["share"] or 0)
            checks[test, new["line"]] = {**worst, "count": old["count"] + new["count"]}
    return {
        "date": suite.get("timestamp", "").partition("T")[0],
        "seconds": float(suite.get("time", 0)),
        "checks": [checks[key] for key in sorted(checks)],
        "failed": sorted(set(failed)),
    }


def write_conformance(folder: Path, report_path: Path | None = None) -> None:
    """Write the tables and their totals into a folder, from what the tests last recorded here."""
    report = read_checks(report_path or locate_report())
    files: dict[str, list[dict[str, Any]]] = {}
    for check in report["checks"]:
        file, _, name = check["test"].partition("::")
        check["words"] = html.escape(name.removeprefix("test_").replace("_", " ").capitalize())
        check["percent"] = None if check["share"] is None else int(100 * check["share"])
        files.setdefault(file, []).append(check)
    counts = {
        kind: Counter(check["kind"] for check in report["checks"])[kind] for kind in CHECK_KINDS
    }
    for piece in PIECES:
        text = templates.render(
            __file__, piece, files=files, counts=counts, kinds=CHECK_KINDS, **report
        )
        whole_text(folder / f"{piece}.md", text)
