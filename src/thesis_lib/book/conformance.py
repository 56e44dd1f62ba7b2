"""The page on conformance: what the tests compared, with tolerances, as pytest recorded it."""

from __future__ import annotations

import html
import json
import xml.etree.ElementTree as ET
from collections import Counter
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from thesis_lib import templates
from thesis_lib.files import project_root, whole_text
from thesis_lib.web.page import BookError

JUNIT_REPORT = "conformance.xml"  # in the folder build; written by ``pytest --junitxml``
CHECK_KINDS = {
    "closed form": "closed forms",
    "order": "orders",
    "invariance": "invariances",
    "independent": "independent evaluations",
    "sampled": "predictions against samples",
}
PIECES = ("conformance-totals", "conformance-tables")


def locate_checks() -> Path:
    """Return the path of the published checks."""
    return project_root() / "data" / "published" / "conformance.json"


def publish_checks(path: Path) -> None:
    """Publish the checks in a report of pytest, unless a test failed.

    Raises
    ------
    BookError
        If a test failed; the message names the first one.
    """
    suite = ET.parse(path).getroot()[0]
    checks: dict[tuple[str, int], dict[str, Any]] = {}
    for case in suite.iter("testcase"):
        file = case.get("classname", "").replace(".", "/")
        test = f"{file}.py::{case.get('name')}".partition("[")[0]
        if case.find("failure") is not None or case.find("error") is not None:
            raise BookError(f"{path} is not published: {test} failed")
        for found in case.iterfind(".//property[@name='conforms']"):
            new = {"test": test, **json.loads(found.get("value", ""))}
            old = checks.get((test, new["line"]), {**new, "count": 0})
            worst = max(old, new, key=lambda one: one["share"] or 0)
            checks[test, new["line"]] = {**worst, "count": old["count"] + new["count"]}
    seconds, date = float(suite.get("time", 0)), datetime.now(UTC).date().isoformat()
    report = {"date": date, "seconds": seconds, "checks": [checks[key] for key in sorted(checks)]}
    whole_text(locate_checks(), json.dumps(report, indent=1, ensure_ascii=False) + "\n")


def write_conformance(folder: Path) -> None:
    """Write the pieces of the page, from the published checks, into a folder."""
    path = locate_checks()
    report = json.loads(path.read_text("utf-8")) if path.is_file() else {"checks": []}
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
