"""Checks of numbers that fail as an assert does, and that are kept for the report of conformance.

A test takes the fixture `conforms` and says what kind of check it makes::

    conforms.closed_form(beam.angular_frequencies(3), expected, rtol=1e-13)
    conforms.order(orders(errors), 2, atol=0.05)
    conforms.sampled(scatter / predicted, above=0.95, below=1.05)

``pytest --conformance FILE.json`` also writes what was measured: one entry per check, the worst of
its values, examples and parameters. ``-m conforms`` chooses the tests that measure, and no others.
"""

from __future__ import annotations

import ast
import json
import sys
import textwrap
from collections.abc import Generator
from datetime import UTC, datetime
from functools import cache, partialmethod
from pathlib import Path
from types import CodeType
from typing import Any

import hypothesis
import numpy as np
import pytest
from hypothesis import is_hypothesis_test

Record = dict[str, Any]
_SHOWN = 70  # characters of an expression


def compare(value, expected=None, *, rtol=None, atol=None, above=None, below=None) -> Record:
    """Compare numbers with what is expected, or with open bounds, and tell of the worst one.

    Parameters
    ----------
    value, expected : array_like
        Real or complex numbers of one shape; either may be a single number.
    rtol, atol : array_like
        With `expected`: allowed is |value - expected| <= atol + rtol |expected|.
    above, below : array_like
        Without `expected`: allowed is above < value < below.

    Returns
    -------
    dict
        ``passed``; the worst ``value`` and what it was compared with; the ``share`` of the
        tolerance that it uses, None where there is no scale; the ``count`` of values.

    Raises
    ------
    TypeError
        Without a tolerance, or with bounds beside an expected value.
    ValueError
        If shapes differ or nothing is compared.
    """
    tolerant = rtol is not None or atol is not None
    bounded = above is not None or below is not None
    if (expected is not None) != tolerant or tolerant == bounded:
        raise TypeError("conforms: needs an expected value with rtol or atol, or else bounds")
    given = {"value": value, "expected": expected, "above": above, "below": below}
    sides = {name: 1.0 * np.asarray(side) for name, side in given.items() if side is not None}
    shapes = {side.shape for side in sides.values() if side.shape}
    if len(shapes) > 1 or any(0 in shape for shape in shapes):
        raise ValueError(f"conforms: given shapes {sorted(shapes)}, allowed: one, not empty")
    sides = dict(zip(sides, np.broadcast_arrays(*sides.values()), strict=True))
    with np.errstate(all="ignore"):
        if bounded:
            passed, share = _within(**sides)
        else:
            apart = np.abs(sides["value"] - sides["expected"])
            absolute, relative = (0 if one is None else np.asarray(one) for one in (atol, rtol))
            allowed = absolute + relative * np.abs(sides["expected"])
            passed, share = apart <= allowed, np.where(apart == 0, 0, apart / allowed)
            sides.update(apart=apart, allowed=np.broadcast_to(allowed, apart.shape))
    at = np.argmax(np.where(np.isfinite(share), share, np.where(passed, 0, np.inf)))
    fraction = float(share.flat[at])
    return {
        "passed": bool(passed.all()),
        "share": fraction if np.isfinite(fraction) else None,
        "count": passed.size,
        **{name: f"{side.flat[at]:.6g}" for name, side in sides.items()},
    }


def _within(value, above=None, below=None):
    """Whether values are inside open bounds, and how much of the room they take."""
    passed = np.isfinite(value)
    passed &= True if above is None else value > above
    passed &= True if below is None else value < below
    if below is None:
        share = np.where((above > 0) & (value > 0), above / value, np.nan)
    elif above is None or not above.any():
        share = np.where(below > 0, np.maximum(value, 0) / below, np.nan)
    else:
        share = np.abs(value - (above + below) / 2) / ((below - above) / 2)
    return passed, share


def worse(one: Record, other: Record) -> Record:
    """Of two outcomes of a check the one nearer to its tolerance, with the values of both."""
    worst = max(one, other, key=lambda record: (not record["passed"], record["share"] or 0))
    return {**worst, "count": one["count"] + other["count"]}


class Conforms:
    """Makes checks, and remembers the worst outcome of each until the test is over."""

    def __init__(self) -> None:
        self.records: dict[tuple[CodeType, int], Record] = {}

    def _check(self, kind: str, value, expected=None, **allowed) -> None:
        __tracebackhide__ = True
        record = {"kind": kind, **compare(value, expected, **allowed)}
        frame = sys._getframe(1)
        place = (frame.f_code, frame.f_lasti)
        record["line"], record["code"] = _expression(*place)
        known = self.records.get(place)
        self.records[place] = worse(known, record) if known else record
        if not record["passed"]:
            told = {k: v for k, v in record.items() if k not in ("passed", "share", "line", "code")}
            words = ", ".join(f"{name} {said}" for name, said in told.items())
            raise AssertionError(f"{record['code']}: {words}")

    closed_form = partialmethod(_check, "closed form")
    order = partialmethod(_check, "order")
    invariance = partialmethod(_check, "invariance")
    sampled = partialmethod(_check, "sampled")
    independent = partialmethod(_check, "independent")


@cache
def _expression(code: CodeType, instruction: int) -> tuple[int, str]:
    """Line of a check, and the value that it was given, as the test writes it."""
    first, last, start, end = list(code.co_positions())[instruction // 2]
    lines = Path(code.co_filename).read_bytes().splitlines()[first - 1 : last]
    lines[-1] = lines[-1][:end]
    lines[0] = lines[0][start:]
    call = ast.parse(b"\n".join(lines), mode="eval").body
    assert isinstance(call, ast.Call)
    text = ast.unparse(call.args[0])
    return first, text if len(text) <= _SHOWN else text[: _SHOWN - 1] + "…"


RECORDER = Conforms()


@pytest.fixture(scope="session")  # the same for all examples of hypothesis
def conforms() -> Conforms:
    """Checks by kind: closed form, order, invariance, sampled, independent."""
    return RECORDER


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--conformance",
        type=Path,
        metavar="FILE.json",
        help="write what the tests that use the fixture `conforms` measured",
    )


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line("markers", "conforms: uses the fixture `conforms`; set by itself")
    path = config.getoption("--conformance")
    if path and not hasattr(config, "workerinput"):
        config.pluginmanager.register(_Report(path.resolve(), config.rootpath))


@pytest.hookimpl(tryfirst=True)  # before -m chooses
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    for item in items:
        if "conforms" in getattr(item, "fixturenames", ()):
            item.add_marker("conforms")
            if config.getoption("--conformance") and is_hypothesis_test(item.function):
                hypothesis.seed(0)(item.function)  # what is published is the same each time


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Generator[None]:
    RECORDER.records.clear()
    try:
        return (yield)
    finally:  # what a test's report carries comes back from a worker of xdist, too
        item.user_properties += [("conforms", one) for one in RECORDER.records.values()]


class _Report:
    """Gathers the checks of all tests, and writes them when all have run."""

    def __init__(self, path: Path, root: Path) -> None:
        self.path, self.root = path, root
        self.seconds = 0.0
        self.checks: dict[tuple[str, int], Record] = {}
        self.failed: dict[str, str] = {}
        self.skipped: dict[str, str] = {}
        self.slow: set[str] = set()

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if "conforms" not in report.keywords:
            return
        test = report.nodeid.partition("[")[0]
        self.seconds += report.duration
        if "slow" in report.keywords:
            self.slow.add(test)
        if report.failed:
            self.failed.setdefault(test, _reason(report))
        elif report.skipped:
            self.skipped.setdefault(test, str(report.longrepr[2]))
        if report.when == "call":
            for name, record in report.user_properties:
                if name == "conforms":
                    place = (test, record["line"])
                    known = self.checks.get(place)
                    self.checks[place] = worse(known, record) if known else record

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        if report.failed:
            self.failed.setdefault(report.nodeid, _reason(report))

    def pytest_sessionfinish(self, exitstatus: int) -> None:
        if exitstatus not in (pytest.ExitCode.OK, pytest.ExitCode.TESTS_FAILED):
            return  # an interrupted run has not measured all
        from thesis_lib import files  # not needed by every run of pytest
        from thesis_lib.book.conformance import (
            report as conformance,  # not needed by every run of pytest
        )

        tested = sorted({test.partition("::")[0] for test, _ in self.checks})
        report = {
            "date": datetime.now(UTC).date().isoformat(),
            "seconds": round(self.seconds, 1),
            "checks": [{"test": test, **self.checks[test, n]} for test, n in sorted(self.checks)],
            "files": {file: _about(self.root / file) for file in tested},
            "failed": self.failed,
            "skipped": self.skipped,
            "slow": sorted(self.slow),
            "nightly": nightly(self.root),
            "code": conformance.code(self.root / file for file in tested),
        }
        files.whole_text(self.path, json.dumps(report, indent=1, ensure_ascii=False))


def nightly(root: Path) -> dict[str, bool]:
    """Tests that only `make test-nightly` runs, and whether they make checks, from their text."""
    found, folder = {}, root / "tests"
    for file in sorted(folder.rglob("test_*.py") if folder.is_dir() else root.glob("test_*.py")):
        module = ast.parse(file.read_bytes())
        marks = [
            one.value
            for one in module.body
            if isinstance(one, ast.Assign) and ast.unparse(one.targets) == "pytestmark"
        ]
        for one in module.body:
            if isinstance(one, ast.FunctionDef) and one.name.startswith("test_"):
                text = " ".join(map(ast.unparse, [*marks, *one.decorator_list]))
                if "mark.nightly" in text:
                    name = f"{file.relative_to(root).as_posix()}::{one.name}"
                    found[name] = "conforms" in [each.arg for each in one.args.args]
    return found


def _about(file: Path) -> str:
    """First paragraph of what a file of tests says of itself."""
    text = ast.get_docstring(ast.parse(file.read_bytes())) or ""
    return " ".join(text.partition("\n\n")[0].split())


def _reason(report: pytest.TestReport | pytest.CollectReport) -> str:
    """Why a test failed, in one line."""
    crash = getattr(report.longrepr, "reprcrash", None)
    text = crash.message if crash else str(report.longrepr)
    told = [line.removeprefix("E ") for line in text.splitlines() if line.startswith("E ")]
    return textwrap.shorten(" ".join(told) or text, 300)
