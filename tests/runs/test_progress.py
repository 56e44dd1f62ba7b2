"""How far tasks are, in what order they begin, and the words."""

from __future__ import annotations

import io
import re
import threading
import time

import pytest

from thesis_lib import asides
from thesis_lib.runs import progress, tasks


def test_lines_count_what_is_done_and_name_what_is_at_work(capsys):
    now = [0.0]
    told = progress.Progress(9, lambda: now[0])
    told.begin("a")
    told.begin("b")
    now[0] = 12.0
    told.report_running(passing=False)
    assert told.end("a", measured=True) == 12.0
    told.say("b: running")
    assert told.took == {"a": 12.0}
    assert capsys.readouterr().err.splitlines() == [
        "[0/9]  12.0 s  at work: a 12 s, b 12 s",
        "[1/9]  12.0 s  b: running",
    ]


def test_a_cycle_is_no_order():
    with pytest.raises(ValueError, match="cycle"):
        progress.urgency({"a": 1, "b": 1}, {"a": ["b"], "b": ["a"]})


def test_a_passing_line_is_written_over_and_not_wider_than_the_screen(monkeypatch):
    class Screen(io.StringIO):
        def isatty(self) -> bool:
            return True

    screen = Screen()
    monkeypatch.setattr(asides.sys, "stderr", screen)
    monkeypatch.setenv("COLUMNS", "20")
    asides.say("x" * 30, passing=True)
    asides.say("y" * 30)
    assert screen.getvalue() == f"\r\x1b[K{'x' * 19}\r\x1b[K{'y' * 30}\n"


def test_what_is_made_of_what_is_stale_is_to_do(tmp_path, monkeypatch):
    monkeypatch.setattr(tasks, "workplace", lambda: tmp_path)
    first, second, other = (tmp_path / name for name in ("first", "second", "other"))

    def all_of(key: str) -> list[tasks.Task]:
        return [
            tasks.task("b", second.touch, [first], [second], seconds=2),
            tasks.task("a", first.touch, [], [first], key, seconds=1),
            tasks.task("c", other.touch, [], [other]),
        ]

    assert tasks._to_do(all_of("one")) == {"b": 2, "a": 1, "c": 0}
    tasks.run(all_of("one"))
    assert tasks._to_do(all_of("one")) == {}
    assert tasks._to_do(all_of("two")) == {"b": 2, "a": 1}


def test_what_most_waits_for_begins_first(tmp_path, monkeypatch):
    monkeypatch.setattr(tasks, "workplace", lambda: tmp_path)
    began = list[str]()

    def one(name: str, seconds: float, *needs: str) -> tasks.Task:
        def act() -> None:
            began.append(name)
            (tmp_path / name).touch()

        files = [tmp_path / each for each in needs]
        return tasks.task(name, act, files, [tmp_path / name], seconds=seconds)

    made = [one("a", 1), one("b", 2), one("unknown", 0), one("c", 1), one("d", 5, "c")]
    tasks.run(made, workers=1)
    assert began == ["c", "d", "b", "a", "unknown"]


@pytest.mark.parametrize(("elsewhere", "here", "most_here"), [(2, 3, 1), (1, 3, 1), (0, 3, 2)])
def test_one_is_done_here_beside_what_other_processes_do(
    tmp_path, monkeypatch, elsewhere, here, most_here
):
    monkeypatch.setattr(tasks, "workplace", lambda: tmp_path)
    over, lock, at_work, most = threading.Event(), threading.Lock(), [0], [0]

    def of_processes() -> None:
        assert over.wait(20)

    def of_this() -> None:
        with lock:
            at_work[0] += 1
            most[0] = max(most[0], at_work[0])
        time.sleep(0.05)
        with lock:
            at_work[0] -= 1
            done.append(1)
        if len(done) == here:
            over.set()

    done = list[int]()
    made = [
        tasks.task(f"{act.__name__} {n}", act, [], [], elsewhere=act is of_processes, seconds=s)
        for act, number, s in ((of_processes, elsewhere, 9), (of_this, here, 1))
        for n in range(number)
    ]
    tasks.run(made)  # which would not end if what is done here waited for other processes
    assert most[0] == most_here


def test_a_run_prints_its_steps(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(tasks, "workplace", lambda: tmp_path)
    first, second = tmp_path / "first", tmp_path / "second"
    made = [
        tasks.task("a", first.touch, [], [first], seconds=20),
        tasks.task("b", second.touch, [first], [second], seconds=1000),
    ]
    tasks.run(made)
    lines = capsys.readouterr().err.splitlines()
    assert lines[0].endswith("s  2 of 2 steps to do")
    assert lines[1].endswith("s  a: running")
    assert re.search(r"a: done in [\d.]+ s$", lines[2])
    assert re.search(r"b: done in [\d.]+ s$", lines[-1])
    tasks.run(made)
    again = capsys.readouterr().err.splitlines()
    assert [line.split(" s  ")[1] for line in again] == ["a: up to date", "b: up to date"]
