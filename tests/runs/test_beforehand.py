"""What the ledger needs beside cubes is made before them, and is what it would make itself."""

from __future__ import annotations

import pytest

from thesis_lib.figure_sets.claims import figure_set, own_runs, readings
from thesis_lib.figure_sets.claims.parameters import Claims
from thesis_lib.figure_sets.registry import STUDIES
from thesis_lib.figure_sets.run import made
from thesis_lib.runs import beforehand, tasks
from thesis_lib.runs.execute import Job, job_tasks

ASKED = Claims(trials=3, readings=["1 N"])


@pytest.fixture
def empty(tmp_path, monkeypatch):
    """A place without a cache, for this process and those that it starts."""
    monkeypatch.setenv("THESIS_CACHE", str(tmp_path / "build" / "cache"))
    return tmp_path


def test_it_comes_first_and_the_ledger_waits_for_it_and_for_all_cubes(tmp_path):
    jobs = [
        Job(STUDIES[name](), tmp_path / f"{name}.ipynb", tmp_path / f"{name}.nc")
        for name in ("beam-distance", "claims")
    ]
    steps = {one.name: one for one in job_tasks(jobs, {"claims, beforehand": 7.0})}
    assert next(iter(steps)) == "claims, beforehand"
    assert steps["claims, beforehand"].seconds == 7.0
    assert steps["claims"].after == {"claims, beforehand", "beam-distance"}
    assert [one.name for one in job_tasks(jobs[1:])] == ["claims"]


@pytest.mark.slow
def test_the_ledger_finds_what_it_would_have_made(empty, monkeypatch):
    step = beforehand.made_beforehand(ASKED, {})
    assert step.is_stale()
    tasks.run([step])
    assert not step.is_stale()
    fresh = [own_runs.run(ASKED.own_runs), readings.run(ASKED.other_readings)]
    for module in (own_runs, readings):
        monkeypatch.setattr(module, "run", None)  # nothing is computed any more
    needed = figure_set.needs(ASKED)
    for one, there in zip(("own", "other"), fresh, strict=True):
        assert made(*needed[one]).drop_attrs().identical(there.drop_attrs())
    (empty / "build" / "cache" / "claims-beforehand.json").unlink()
    assert step.is_stale()


def test_what_fails_there_is_said_in_a_line(empty, monkeypatch):
    monkeypatch.setattr(beforehand, "_START", "raise SystemExit('no such thing')")
    with pytest.raises(tasks.RunError, match=r"^claims, beforehand: no such thing$"):
        tasks.run([beforehand.made_beforehand(ASKED, {})])
