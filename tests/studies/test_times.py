"""Times of steps and tests: kept, published, compared by what the machine does meanwhile."""

from __future__ import annotations

import doctest
from types import SimpleNamespace

import pytest
from times import pytest_collection_modifyitems as ordered

from thesis_lib.book.pieces import benchmarks as page
from thesis_lib.studies import times


@pytest.fixture(autouse=True)
def places(tmp_path, monkeypatch):
    monkeypatch.setattr(times, "measured_path", lambda: tmp_path / "times.json")
    monkeypatch.setattr(times, "published_path", lambda: tmp_path / "published.json")


def test_what_ran_last_counts_and_the_rest_is_kept(monkeypatch):
    loops = iter([0.01, 0.02])
    monkeypatch.setattr(times, "calibration", lambda: next(loops))
    times.note("book", {"pages": 40.04, "planner": 60.0})
    times.note("book", {"pages": 20.0})
    times.note("tests", {})
    known = times.read(times.measured_path())
    assert known == {"book": {"planner": (60.0, 0.01), "pages": (20.0, 0.02)}, "tests": {}}
    times.write(times.published_path(), known)
    assert times.read(times.published_path()) == known
    assert "| `planner` | 60.0 | 6000 |" in page.tabulate_times()
    assert "all of them take 1 min" in page.tabulate_times()


def test_files_that_take_longest_begin_first():
    times.write(times.published_path(), {"book": {}, "tests": {"b.py": (1, 1), "c.py": (9, 1)}})
    items = [SimpleNamespace(nodeid=name) for name in ("a.py::x", "b.py::y", "c.py::z", "c.py::w")]
    for asked, expected in ((False, "xyzw"), (True, "zwyx")):
        ordered(SimpleNamespace(getoption=lambda _, asked=asked: asked), items)
        assert "".join(one.nodeid[-1] for one in items) == expected


@pytest.mark.parametrize("text", ["", "{", "[]", '{"book": 3}', '{"book": {"a": [1]}}', "[" * 9999])
def test_damaged_times_are_none(text):
    times.published_path().write_text(text)
    assert times.read(times.published_path()) == {"book": {}, "tests": {}}
    assert page.tabulate_times() == "Nothing was timed yet.\n"


def test_examples():
    assert doctest.testmod(times).failed == 0
