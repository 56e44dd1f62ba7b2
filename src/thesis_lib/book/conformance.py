"""The tables on conformance: what the tests compared, with tolerances, as pytest recorded it."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

from thesis_lib import templates
from thesis_lib.files import project_root, whole_text

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
    for piece in PIECES:
        whole_text(folder / f"{piece}.md", templates.render(__file__, piece, **report))
