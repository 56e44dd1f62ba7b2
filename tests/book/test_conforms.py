"""The recorder of checks: what it refuses, which outcome it keeps, and what the report says."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import numpy as np
import pytest
from conforms import RECORDER, compare, nightly, worse

from conftest import PROJECT
from thesis_lib.book import build as publishing
from thesis_lib.book import publish
from thesis_lib.book.conformance import areas as conformance_areas
from thesis_lib.book.conformance import report as conformance
from thesis_lib.book.conformance.areas import AREAS
from thesis_lib.book.plan import Plan
from thesis_lib.runs import tasks
from thesis_lib.runs.tasks import RunError

TESTS = """
import pytest
import numpy as np
from hypothesis import given, strategies as st

@pytest.mark.parametrize("x", [0.5, 0.875, 0.25])
def test_of_three_the_worst_is_kept(conforms, x):
    conforms.closed_form([x, 0.125], below=1)
    conforms.order(2 + x / 10, 2, atol=0.1)

@given(st.integers(0, 3))
def test_examples_count(conforms, n):
    conforms.invariance(n, n, atol=0)

def test_without_the_fixture():
    raise RuntimeError("not to be run")
"""
GOOD = {"kind": "order", **compare(2, 1, atol=1.5)}
DOCTOR = """
from thesis_lib.vibration.plate import Plate

def pytest_configure(config):
    law = Plate.angular_frequencies
    Plate.angular_frequencies = lambda self, n: law(self, n) * 1.001
"""


def pytest_run(cwd, *words, **extra):
    """Run pytest with the recorder; standard output, and the report."""
    paths = [str(PROJECT / "tests"), str(PROJECT / "src"), str(PROJECT), str(cwd)]
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-p", "conforms", "-p", "no:cacheprovider",
         "-m", "conforms", "--conformance", "report.json", *map(str, words)],
        cwd=cwd, capture_output=True, text=True, timeout=150,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(paths), **extra},
    )  # fmt: skip
    return done, json.loads((cwd / "report.json").read_text(encoding="utf-8"))


@pytest.mark.parametrize(
    ("value", "allowed"),
    [
        (1.1, {"expected": 1, "atol": 0.09}),
        (1.1, {"expected": 1, "rtol": 0.09}),
        (np.nan, {"expected": 1, "rtol": 1}),
        (np.nan, {"expected": np.nan, "rtol": 1}),
        (np.inf, {"expected": np.inf, "rtol": 1}),
        (1, {"expected": np.nan, "atol": 1}),
        (np.nan, {"below": 1}),
        (np.nan, {"above": 0, "below": 1}),
        (-np.inf, {"below": 1}),
        (1, {"below": 1}),
        (1, {"above": 1}),
        ([0.5, 1.5], {"above": 0.4, "below": 1.4}),
        ([1, 2, 3], {"expected": [1, 2, 4], "atol": 0}),
        (1 + 1e-3j, {"expected": 1, "atol": 1e-4}),
    ],
)
def test_what_is_outside_fails_and_is_kept(value, allowed):
    assert not compare(value, **allowed)["passed"]
    RECORDER.records.clear()
    with pytest.raises(AssertionError, match=r"^value: kind closed form, .*value"):
        RECORDER.closed_form(value, **allowed)
    (record,) = RECORDER.records.values()
    RECORDER.records.clear()
    assert (record["passed"], record["kind"], record["code"]) == (False, "closed form", "value")


@pytest.mark.parametrize(
    ("allowed", "share"),
    [
        ({"expected": 1, "atol": 0.2}, 0.5),
        ({"expected": 1, "atol": 0.1, "rtol": 0.1}, 0.5),
        ({"expected": 1.1, "atol": 0}, 0),
        ({"below": 2.2}, 0.5),
        ({"above": 0.55}, 0.5),
        ({"above": 0.9, "below": 1.1 + 0.2}, 0),
        ({"above": 0, "below": 4.4}, 0.25),
        ({"above": -1}, None),
        ({"below": 10, "above": -10}, 0.11),
    ],
)
def test_share_of_the_tolerance(allowed, share):
    found = compare(1.1, **allowed)
    assert found["passed"]
    assert found["share"] == (None if share is None else pytest.approx(share, abs=1e-12))


@pytest.mark.parametrize(
    ("allowed", "error"),
    [
        ({}, TypeError),
        ({"expected": 1}, TypeError),
        ({"rtol": 1}, TypeError),
        ({"expected": 1, "below": 2}, TypeError),
        ({"expected": 1, "atol": 1, "above": 0}, TypeError),
        ({"expected": [1, 2], "atol": 1}, ValueError),
        ({"expected": [], "atol": 1}, ValueError),
        ({"below": np.ones((3, 1))}, ValueError),
    ],
)
def test_a_check_without_tolerance_or_with_other_shapes_is_refused(allowed, error):
    with pytest.raises(error, match="conforms: "):
        compare([1, 2, 3], **allowed)
    with pytest.raises(ValueError, match="not empty"):
        compare([], expected=1, atol=1)


def test_the_worst_value_is_told_and_a_failure_is_worse_than_any():
    one = compare([1, 1.3, 0.9], 1, atol=0.5)
    assert (one["value"], one["count"]) == ("1.3", 3)
    other = compare([1.1, np.nan], 1, atol=0.5)
    for found in (worse(one, other), worse(other, one)):
        assert (found["passed"], found["value"], found["count"]) == (False, "nan", 5)
    assert worse(one, compare(1.4, 1, atol=0.5))["value"] == "1.4"


@pytest.mark.parametrize("workers", [0, pytest.param(2, marks=pytest.mark.slow)])
def test_report_has_one_row_for_each_check_however_many_workers(tmp_path, workers):
    (tmp_path / "test_small.py").write_text(TESTS, encoding="utf-8")
    done, report = pytest_run(tmp_path, "-n", workers)
    assert done.returncode == 0, done.stdout
    rows = {(c["test"].partition("::")[2], c["code"]): c for c in report["checks"]}
    assert set(rows) == {
        ("test_of_three_the_worst_is_kept", "[x, 0.125]"),
        ("test_of_three_the_worst_is_kept", "2 + x / 10"),
        ("test_examples_count", "n"),
    }
    by_code = {code: row for (_, code), row in rows.items()}
    assert (by_code["[x, 0.125]"]["share"], by_code["[x, 0.125]"]["count"]) == (0.875, 6)
    assert by_code["2 + x / 10"]["share"] == pytest.approx(0.875)
    assert by_code["n"]["count"] >= 4
    assert {c["kind"] for c in report["checks"]} == {"closed form", "order", "invariance"}
    assert (report["failed"], report["skipped"]) == ({}, {})


@pytest.mark.slow
def test_a_doctored_law_fails_in_the_report_which_is_not_published(tmp_path):
    (tmp_path / "doctor.py").write_text(DOCTOR, encoding="utf-8")
    chosen = PROJECT / "tests" / "vibration" / "test_plate.py"
    done, report = pytest_run(
        tmp_path, "-p", "doctor", "-k", "closed_form or damped", "--rootdir", PROJECT, chosen
    )
    assert done.returncode == 1
    test = "tests/vibration/test_plate.py::test_frequencies_are_those_of_the_closed_form"
    (row,) = [check for check in report["checks"] if check["test"] == test]
    assert not row["passed"]
    assert row["share"] == pytest.approx(1e-3 / 1e-13, rel=1e-3)
    assert test in report["failed"]
    with pytest.raises(RunError, match=f"{test}.* failed: .*AssertionError"):
        conformance.publish(tmp_path / "report.json")


def test_what_failed_is_not_published_and_what_holds_is(tmp_path, monkeypatch):
    published = tmp_path / "data" / "published" / conformance.REPORT
    monkeypatch.setattr(conformance, "published_path", lambda: published)
    (tmp_path / "report.json").write_text(json.dumps({"failed": {"a": "x", "b": "y"}}))
    with pytest.raises(RunError, match=r"report\.json is not published: a and 1 more failed: x$"):
        publish.publish([], tmp_path / "picture.svg", tmp_path / "report.json")
    assert not published.exists()
    (tmp_path / "report.json").write_text(json.dumps({"failed": {}}))
    conformance.publish(tmp_path / "report.json")
    assert published.read_bytes() == (tmp_path / "report.json").read_bytes()
    published.write_text(json.dumps({"failed": {}, "slow": ["tests/test_a.py::test_b"]}))
    with pytest.raises(RunError, match=r"report\.json is not published: no slow test was run"):
        conformance.publish(tmp_path / "report.json")


def test_a_book_shows_the_published_report_and_marks_what_changed_since(tmp_path, monkeypatch):
    plate, beam = "tests/vibration/test_plate.py", "tests/vibration/test_structures.py"
    rows = [
        {"test": f"{file}::test_of_it", "line": 1, "code": "x", **GOOD} for file in (plate, beam)
    ]
    code = conformance.code([PROJECT / plate, PROJECT / beam])
    assert {plate, beam, "src/thesis_lib/vibration/structure.py"} <= code.keys()
    report = {"date": "2026-01-02", "seconds": 1.0, "checks": rows, "failed": {}, "skipped": {},
              "files": {plate: "Plates.", beam: "Beams."}, "code": code}  # fmt: skip
    published = tmp_path / "published.json"
    monkeypatch.setattr(conformance, "published_path", lambda: published)

    monkeypatch.setattr(tasks, "workplace", lambda: tmp_path)

    def pieces():
        plan = Plan(tmp_path, [])
        tasks.run([publishing._conformance(plan)])
        return [path.read_text(encoding="utf-8") for path in conformance.pieces(plan.executed)]

    assert pieces()[:2] == [conformance.NOT_YET, ""]
    published.write_text(json.dumps(report), encoding="utf-8")
    totals, tables, _ = pieces()
    assert "**All held** on 2026-01-02" in totals
    assert "change" not in totals + tables
    code[plate] = "other"
    published.write_text(json.dumps(report), encoding="utf-8")
    totals, tables, _ = pieces()
    assert "The code of 1 of them has changed since" in totals
    assert tables.count("<b>before a change</b>") == 1
    assert tables.index("### tests/vibration/test_structures.py") < tables.index("before a change")
    assert f"**Changed since:** `{plate}`." in tables
    del code["src/thesis_lib/vibration/structure.py"]
    assert conformance.changed(report) == {
        plate: ["src/thesis_lib/vibration/structure.py", plate],
        beam: ["src/thesis_lib/vibration/structure.py"],
    }
    report["files"] = {"tests/test_gone.py": ""}
    assert conformance.changed(report) == {"tests/test_gone.py": ["tests/test_gone.py"]}


def test_a_skipped_test_is_named(tmp_path):
    text = TESTS.replace("@given", "@pytest.mark.skip(reason='no *stars*')\n@given")
    (tmp_path / "test_small.py").write_text(text, encoding="utf-8")
    _, report = pytest_run(tmp_path)
    assert list(report["skipped"]) == ["test_small.py::test_examples_count"]
    said = conformance.tables({**report, "changed": {}})
    assert "no &#42;stars&#42;:" in said
    assert "examples count" in said


MARKED = """
import pytest
pytestmark = pytest.mark.slow

def test_slow(conforms):
    conforms.invariance(1, 1, atol=0)

@pytest.mark.nightly
def test_of_the_night(conforms):
    conforms.invariance(1, 2, atol=0)
"""


def test_the_head_tells_what_is_slow_and_what_only_the_night_runs(tmp_path):
    (tmp_path / "test_small.py").write_text(TESTS, encoding="utf-8")
    (tmp_path / "test_marked.py").write_text(MARKED, encoding="utf-8")
    done, report = pytest_run(tmp_path, "-m", "conforms and not nightly")
    assert done.returncode == 0, done.stdout
    assert report["slow"] == ["test_marked.py::test_slow"]
    assert report["nightly"] == {"test_marked.py::test_of_the_night": True}
    said = conformance.totals({**report, "changed": {}})
    assert "1 of the checks, in 1 tests, are *slow* and marked so" in said
    assert f"last measured them on {report['date']}" in said
    assert "1 *nightly* tests" in said
    assert "1 of them would make checks" in said
    assert "* `test_marked.py`: of the night" in said
    rows = [
        row
        for row in conformance.tables({**report, "changed": {}}).splitlines()
        if "<small>slow</small>" in row
    ]
    assert len(rows) == 1


@pytest.mark.slow
def test_tests_of_the_night_are_those_that_pytest_leaves_out():
    chosen = [sys.executable, "-m", "pytest", "--collect-only", "-q", "-p", "no:cacheprovider"]
    done = subprocess.run(
        [*chosen, "-m", "nightly", "tests"],
        cwd=PROJECT,
        capture_output=True,
        text=True,
        timeout=150,
    )
    found = {line.partition("[")[0] for line in done.stdout.splitlines() if "::" in line}
    assert set(nightly(PROJECT)) == found


def test_a_file_that_does_not_import_is_a_failure(tmp_path):
    (tmp_path / "test_small.py").write_text(TESTS, encoding="utf-8")
    (tmp_path / "test_broken.py").write_text("import nothing_of_the_kind  # conforms\n")
    _, report = pytest_run(tmp_path, "--continue-on-collection-errors")
    assert list(report["failed"]) == ["test_broken.py"]
    assert "nothing_of_the_kind" in report["failed"]["test_broken.py"]
    assert len(report["checks"]) == 3


def test_every_file_with_checks_has_an_area():
    files = [p for p in conformance.test_files() if p.name.startswith("test_")]
    using = {p for p in files if "conforms." in p.read_text(encoding="utf-8")}
    found = {conformance_areas.area(p.name) for p in using if p.name != "test_conforms.py"}
    assert found == set(AREAS)


@pytest.mark.parametrize(
    ("text", "read"),
    [("1.25e-07", "1.25e−7"), ("-3", "−3"), ("1e+12", "1e12"), ("1e+10", "1e10"), ("0", "0"),
     ("0.00123-4.5e-05j", "0.00123−4.5e−5j"), ("nan", "nan")],
)  # fmt: skip
def test_numbers_are_read_as_they_are(text, read):
    assert conformance._number(text) == read


def test_used_never_says_all_of_it_before_it_is():
    shares = [None, 0, 1e-9, 0.005, 0.42, 0.9999]
    assert [conformance.used(s) for s in shares] == [
        "–", "0 %", "< 0.01 %", "0.50 %", "42 %", "99 %"]  # fmt: skip
