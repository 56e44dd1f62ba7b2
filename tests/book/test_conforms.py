"""The checks of numbers: what they refuse, which outcome they keep, and how it is published."""

import os
import re
import subprocess
import sys

import numpy as np
import pytest
from conforms import compare

from conftest import PROJECT
from thesis_lib.book.pieces import benchmarks

TESTS = """
import pytest
from hypothesis import given, strategies as st

@pytest.mark.parametrize("x", [0.5, 0.875, 0.25])
def test_of_three_the_worst_is_kept(conforms, x):
    conforms.closed_form([x, 0.125], below=1)
    conforms.order(2 + x / 10, 2, atol=0.1)

@given(st.integers(0, 3))
def test_examples_count(conforms, n):
    conforms.invariance(n, n, atol=0)

def test_of_one_that_fails(conforms):
    conforms.sampled(2.0, below=1)

def test_without_the_fixture():
    raise RuntimeError("not to be run")
"""


@pytest.mark.parametrize(
    ("value", "allowed"),
    [
        (1.1, {"expected": 1, "atol": 0.09}),
        (1.1, {"expected": 1, "rtol": 0.09}),
        (np.nan, {"expected": np.nan, "rtol": 1}),
        (np.inf, {"expected": np.inf, "rtol": 1}),
        (-np.inf, {"below": 1}),
        (1, {"above": 1}),
        ([0.5, 1.5], {"above": 0.4, "below": 1.4}),
        ([1, 2, 3], {"expected": [1, 2, 4], "atol": 0}),
        (1 + 1e-3j, {"expected": 1, "atol": 1e-4}),
    ],
)
def test_what_is_outside_fails(value, allowed):
    assert not compare(value, **allowed)["passed"]


@pytest.mark.slow
def test_the_page_shows_one_row_for_each_check_and_names_what_failed(tmp_path):
    report = tmp_path / "report.xml"
    benchmarks.write_conformance(tmp_path, report)
    assert "have not run here yet" in (tmp_path / "conformance-totals.md").read_text()
    (tmp_path / "test_small.py").write_text(TESTS, encoding="utf-8")
    paths = [str(PROJECT / "tests"), str(PROJECT / "src"), str(tmp_path)]
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-p", "conforms", "-p", "no:cacheprovider",
         "-m", "conforms", "--junitxml", "report.xml", "-n", "2"],
        cwd=tmp_path, capture_output=True, text=True, timeout=150,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(paths)},
    )  # fmt: skip
    assert "1 failed, 4 passed" in done.stdout
    checks = {check["kind"]: check for check in benchmarks.read_checks(report)["checks"]}
    worst = checks["closed form"]
    assert (worst["share"], worst["count"], worst["value"]) == (0.875, 6, "0.875")
    assert checks["order"]["share"] == pytest.approx(0.875)
    assert checks["invariance"]["count"] >= 4
    benchmarks.write_conformance(tmp_path, report)
    tables = (tmp_path / "conformance-tables.md").read_text()
    assert "Of three the worst is kept <small>6 values</small><td>closed form<td>0.875" in tables
    totals = (tmp_path / "conformance-totals.md").read_text()
    assert "4 checks in 3 tests" in totals
    assert re.search(r"\*\*These tests failed\*\* .*of_one_that_fails`\.", totals)
