"""How long tasks will take: the arithmetic on a clock of the test's own, and the words."""

from __future__ import annotations

import io
import re
import threading
import time

import pytest

from thesis_lib import asides
from thesis_lib.runs import progress, tasks

LAST = {"pages": ["a", "b", "c"]}


class Clock:
    """Tells what the test has set."""

    now = 0.0

    def __call__(self) -> float:
        return self.now


@pytest.mark.parametrize(
    ("known", "at_work", "waits", "pace", "workers", "wanted"),
    [
        ({}, {}, {}, 1, 2, 0),
        ({"a": 10}, {}, {}, 1, 2, 10),
        ({"a": 10, "b": 10}, {}, {}, 1, 2, 10),  # two at once
        ({"a": 10, "b": 10}, {}, {}, 1, 1, 20),
        ({"a": 10, "b": 4, "c": 5}, {}, {}, 1, 2, 10),  # b after c
        ({"b": 4, "c": 4, "a": 10}, {}, {}, 1, 2, 10),  # the longest first
        ({"b": 4, "c": 4, "a": 1, "d": 9}, {}, {"d": ["a"]}, 1, 2, 10),  # so does what waits
        ({"a": 10, "b": 4, "c": 7}, {}, {}, 1, 2, 11),
        ({"a": 10, "b": 4, "c": 7, "pages": 30}, {}, LAST, 1, 2, 41),  # alone at the end
        ({"c": 7, "pages": 30}, {}, LAST, 1, 2, 37),  # what is done is waited for no more
        ({"a": 10, "b": 10}, {"a": 6, "b": 1}, {}, 1, 2, 9),
        ({"a": 10, "b": 10}, {"a": 6, "b": 1}, {}, 3, 2, 29),
        ({"a": 10, "b": 20, "c": 5}, {"b": 1}, {}, 1, 1, 34),  # what is at work comes first
        ({"a": 10, "pages": 5}, {"a": 99}, {"pages": ["a"]}, 1, 2, 5),  # late: any moment now
    ],
)
def test_seconds_left_are_those_of_the_run_to_come(known, at_work, waits, pace, workers, wanted):
    assert progress.seconds_left(known, at_work, waits, pace, workers) == pytest.approx(wanted)


def test_a_cycle_is_no_order():
    with pytest.raises(ValueError, match="cycle"):
        progress.seconds_left({"a": 1, "b": 1}, {}, {"a": ["b"], "b": ["a"]})


@pytest.fixture
def clock():
    return Clock()


def of(known, clock, waits=LAST):
    return progress.Progress(9, dict(known), waits, clock=clock)


def test_time_left_follows_the_pace_of_what_has_ended(clock):
    told = of({"a": 60, "b": 60, "c": 60, "pages": 60}, clock)
    assert told.left() == "about 3 min"  # a and b, c, pages
    for name in "ab":
        told.begin(name)
    clock.now = 30.0
    assert told.left() == "about 2 min"
    clock.now = 150.0
    assert told.left() == "at least 2 min"  # a and b are late, and no pace is known
    assert told.end("a", measured=True) == 150
    assert told.end("b", measured=True) == 150
    assert told.left() == "about 4 min"  # twice as slow, with a minute as known: 120 + 120 s
    told.begin("c")
    clock.now = 152.0
    assert told.end("c", measured=False) == 2  # failed, or up to date after all
    assert told.left() == "about 2 min"
    told.begin("pages")
    clock.now = 260.0
    assert told.left() == "about 20 s"


def test_one_short_step_tells_little_of_the_pace(clock):
    told = of({"a": 1, "b": 200, "c": 200, "pages": 100}, clock)
    told.begin("a")
    clock.now = 3.0
    told.end("a", measured=True)
    assert told.left() == "about 5 min"  # and not three times as long


def test_nothing_is_said_where_nothing_is_known(clock):
    assert of({}, clock).left() == ""
    assert of({"a": 0, "b": 0}, clock).left() == ""
    assert of({"a": 0, "b": 31}, clock).left() == "at least 40 s"


def test_lines_are_plain_where_there_is_no_screen(clock, capsys):
    told = of({"a": 60, "b": 61, "pages": 1}, clock)
    told.foretell()
    told.begin("a")
    told.begin("b")
    clock.now = 12.0
    told.tell(passing=False)
    told.end("a", measured=False)
    of({"a": 0}, clock).foretell()
    assert capsys.readouterr().err.splitlines() == [
        "[0/9]   0.0 s  3 of 9 steps to do: about 1 min",
        "[0/9]  12.0 s  about 50 s left; at work: a 12 s, b 12 s",
    ]


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


def test_a_run_foretells_and_tells_what_is_left(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(tasks, "workplace", lambda: tmp_path)
    first, second = tmp_path / "first", tmp_path / "second"
    made = [
        tasks.task("a", first.touch, [], [first], seconds=20),
        tasks.task("b", second.touch, [first], [second], seconds=1000),
    ]
    tasks.run(made)
    lines = capsys.readouterr().err.splitlines()
    assert lines[0].endswith("s  2 of 2 steps to do: about 17 min")
    assert lines[1].endswith("s  a: running")
    assert re.search(r"a: done in [\d.]+ s; about \d+ min left$", lines[2])
    assert re.search(r"b: done in [\d.]+ s$", lines[-1])
    tasks.run(made)
    again = capsys.readouterr().err.splitlines()
    assert [line.split(" s  ")[1] for line in again] == ["a: up to date", "b: up to date"]
