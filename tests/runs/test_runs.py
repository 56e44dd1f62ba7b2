"""Runs: nothing twice, nothing half-written, and on from where it stopped."""

from __future__ import annotations

import contextlib
import dataclasses
import json
import os
import signal
import stat
import subprocess
import sys
import time
from pathlib import Path

import nbformat
import pytest
import xarray as xr

from conftest import until_study
from thesis_lib import files
from thesis_lib.facts import setups
from thesis_lib.figure_sets.registry import validate
from thesis_lib.runs import execute as runs
from thesis_lib.runs import tasks
from thesis_lib.studies import reach

GOOD, SLOW = "beam-resolution", "beam-distance"
BOTH = ["run", GOOD, SLOW, "-p", "trials=1", "--out", "out"]
ONE = ["run", SLOW, "-p", "trials=1", "--out", "out"]
WAITS = """
import time
from pathlib import Path

Path(cube).with_name("begun").touch()
for _ in range(3000):  # five minutes, as long as the test waits for the other set
    if Path({go!r}).exists():
        break
    time.sleep(0.1)
else:
    raise TimeoutError
"""


def shorten(checkout, name: str, last: str = "") -> None:
    """Leave a notebook its parameters and its study, and give it one more cell."""

    def edit(document):
        until_study(document)
        if last:
            document.cells.append(nbformat.v4.new_code_cell(last, id="last"))

    checkout.change(name, edit)


def made(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir() if not path.name.startswith("."))


def targets(*names: str) -> list[str]:
    return sorted(f"{name}.{kind}" for name in names for kind in ("html", "ipynb", "nc"))


def left_over(folder: Path) -> list[Path]:
    return [path for path in folder.iterdir() if path.name.startswith(".staging-")]


# Stopped in mid-run.


@pytest.fixture
def stopped(own_checkout, tmp_path, start):
    """Run two sets, and stop the command while the second is at work and the first is done."""
    out, go = tmp_path / "out", tmp_path / "go"
    shorten(own_checkout, GOOD)
    shorten(own_checkout, SLOW, WAITS.format(go=str(go)))

    def stop(by: signal.Signals, how=os.killpg):
        running = start(own_checkout, tmp_path / "log.txt", *BOTH)
        running.wait_for(
            lambda: (
                f"{GOOD}: done in" in running.said()
                and any(any(path.rglob("begun")) for path in left_over(out))
            )
        )
        how(running.process.pid, by)
        running.process.wait(timeout=60)
        go.touch()
        return running

    return stop


@pytest.mark.slow
def test_kill_leaves_nothing_half_written_and_the_next_call_goes_on(
    stopped, own_checkout, tmp_path
):
    kernels, out = [], tmp_path / "out"

    def only_the_runner(pid, by):
        kernels.extend(one for one in processes_of(tmp_path) if one != str(pid))
        os.kill(pid, by)

    running = stopped(signal.SIGKILL, only_the_runner)
    assert running.process.returncode == -signal.SIGKILL
    if Path("/proc/self/cwd").exists():  # Linux can be asked for processes
        assert kernels
        for _ in range(300):
            if not set(kernels) & set(processes_of(tmp_path)):
                break
            time.sleep(0.1)
        assert not set(kernels) & set(processes_of(tmp_path)), "still run after 30 s"
    assert made(out) == targets(GOOD)
    left = left_over(out)
    assert len(left) == 1
    done = {path: path.stat().st_mtime_ns for path in out.glob(f"{GOOD}.*")}
    again = own_checkout.thesis(*BOTH, cwd=tmp_path)
    assert again.returncode == 0, again.stderr
    assert f"{GOOD}: up to date" in again.stderr
    assert f"{SLOW}: done in" in again.stderr
    assert made(out) == sorted([*targets(GOOD, SLOW), "index.html"])
    assert left_over(out) == []
    assert {path: path.stat().st_mtime_ns for path in out.glob(f"{GOOD}.*")} == done


def processes_of(folder: Path) -> list[str]:
    """Processes that have to do with a folder."""
    found = []
    for process in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            words = (process / "environ").read_bytes() + (process / "cmdline").read_bytes()
            if str(folder).encode() in words:
                found.append(process.name)
    return found


@pytest.mark.slow
@pytest.mark.usefixtures("interrupts_ignored")
@pytest.mark.parametrize("politely", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_interrupt_says_so_and_leaves_nothing_behind(stopped, tmp_path, politely):
    running = stopped(politely)
    assert running.process.returncode == 130
    assert "interrupted; run the same command again to go on" in running.said()
    assert "Traceback" not in running.said()
    assert made(tmp_path / "out") == targets(GOOD)
    assert left_over(tmp_path / "out") == []


def test_folder_of_another_process_stays_while_it_lives(tmp_path):
    code = (
        "import sys; from pathlib import Path; from thesis_lib import files\n"
        "with files.staging(Path(sys.argv[1])) as folder:\n"
        "    print(folder, flush=True); sys.stdin.read()\n"
    )
    command = [sys.executable, "-c", code, str(tmp_path)]
    with subprocess.Popen(command, stdin=-1, stdout=-1, text=True) as other:
        theirs = Path(other.stdout.readline().strip())
        assert theirs.parents[1] == tmp_path
        with files.staging(tmp_path) as folder:
            assert folder.parents[1] == tmp_path
            assert theirs.is_dir()
        assert not folder.exists()
        other.kill()
    with files.staging(tmp_path):
        assert not theirs.exists()


# Failed.


@pytest.mark.slow
def test_what_was_done_beside_a_failure_is_not_done_again(own_checkout, tmp_path):
    shorten(own_checkout, GOOD)
    shorten(own_checkout, SLOW, "1 / 0")
    failed = own_checkout.thesis(*BOTH, cwd=tmp_path)
    assert failed.returncode == 1
    assert failed.stderr.splitlines()[-1].startswith(f"thesis: {SLOW}: ")
    assert "ZeroDivisionError" in failed.stderr
    assert made(tmp_path / "out") == targets(GOOD)
    shorten(own_checkout, SLOW)
    mended = own_checkout.thesis(*BOTH, cwd=tmp_path)
    assert mended.returncode == 0, mended.stderr
    assert f"{GOOD}: up to date" in mended.stderr
    assert f"{SLOW}: done in" in mended.stderr
    assert made(tmp_path / "out") == sorted([*targets(GOOD, SLOW), "index.html"])


@pytest.mark.slow
def test_a_failure_keeps_the_files_of_the_run_before(own_checkout, tmp_path):
    shorten(own_checkout, SLOW)
    assert own_checkout.thesis(*ONE, cwd=tmp_path).returncode == 0
    before = {path: path.read_bytes() for path in (tmp_path / "out").glob(f"{SLOW}.*")}
    shorten(own_checkout, SLOW, "1 / 0")
    assert own_checkout.thesis(*ONE, cwd=tmp_path).returncode == 1
    assert {path: path.read_bytes() for path in (tmp_path / "out").glob(f"{SLOW}.*")} == before


# Stale, or not.


@pytest.mark.slow
def test_edited_prose_is_put_into_what_was_executed(own_checkout, tmp_path):
    shorten(own_checkout, GOOD)
    run = ["run", GOOD, "-p", "trials=1", "--out", "out"]
    out = tmp_path / "out"

    def executed():
        document = json.loads((out / f"{GOOD}.ipynb").read_text(encoding="utf-8"))
        return document["metadata"]["papermill"]["start_time"], document

    assert own_checkout.thesis(*run, cwd=tmp_path).returncode == 0
    first, cube = executed()[0], (out / f"{GOOD}.nc").read_bytes()

    def edit(document):
        assert document.cells[0].cell_type == "markdown"
        document.cells[0].source = "# Edited prose"

    own_checkout.change(GOOD, edit)
    again = own_checkout.thesis(*run, cwd=tmp_path)
    assert f"{GOOD}: done in" in again.stderr
    start, document = executed()
    assert start == first
    assert "".join(document["cells"][0]["source"]) == "# Edited prose"
    assert "Edited prose" in (out / f"{GOOD}.html").read_text(encoding="utf-8")
    assert (out / f"{GOOD}.nc").read_bytes() == cube
    assert f"{GOOD}: up to date" in own_checkout.thesis(*run, cwd=tmp_path).stderr
    whole = (out / f"{GOOD}.html").read_text(encoding="utf-8")
    own_checkout.change(GOOD, lambda d: d.cells.append(nbformat.v4.new_markdown_cell("x", id="x")))
    assert own_checkout.thesis(*run, cwd=tmp_path).returncode == 0
    assert executed()[0] > first
    assert (out / f"{GOOD}.html").read_text(encoding="utf-8") != whole


@pytest.fixture
def root(own_checkout, monkeypatch):
    for module, place in (
        (files, "files.py"),
        (reach, "studies/reach.py"),
        (setups, "facts/setups.py"),
    ):
        monkeypatch.setattr(module, "__file__", str(library(own_checkout.root) / place))
    return own_checkout.root


def notebook(root: Path) -> Path:
    return root / "notebooks" / f"{SLOW}.ipynb"


def edit_notebook(root: Path, edit) -> None:
    document = json.loads(notebook(root).read_text(encoding="utf-8"))
    edit(document["cells"], document)
    notebook(root).write_text(json.dumps(document), encoding="utf-8")


def append(path: Path, text: str = "\n") -> None:
    with path.open("a", encoding="utf-8") as stream:
        stream.write(text)


def library(root: Path) -> Path:
    return root / "src" / "thesis_lib"


STALE = {
    "what computes": lambda root: append(library(root) / "vision" / "triangulation.py", "a = 1\n"),
    "what draws": lambda root: append(library(root) / "plotting" / "curves.py", "a = 1\n"),
    "what it imports": lambda root: append(
        library(root) / "vision" / "pinhole.py", "import vision\n"
    ),
    "asset": lambda root: append(library(root) / "web" / "assets" / "viewer.css"),
    "imported asset": lambda root: append(library(root) / "web" / "assets" / "parts.js"),
    "data": lambda root: append(root / "data" / "thesis" / "setups.toml"),
    "lock": lambda root: append(root / "requirements" / "book.txt"),
    "cell": lambda root: edit_notebook(
        root, lambda cells, _: cells[1].update(source="".join(cells[1]["source"]) + "\n")
    ),
    "prose": lambda root: edit_notebook(root, lambda cells, _: cells[0].update(source="# New")),
    "tags": lambda root: edit_notebook(root, lambda cells, _: cells[1].update(metadata={})),
    "order": lambda root: edit_notebook(root, lambda cells, _: cells.reverse()),
}
FRESH = {
    "outputs": lambda root: edit_notebook(
        root,
        lambda cells, _: cells[1].update(
            outputs=[{"output_type": "stream", "name": "stdout", "text": ["7"]}]
        ),
    ),
    "execution count": lambda root: edit_notebook(
        root, lambda cells, _: cells[1].update(execution_count=7)
    ),
    "kernel": lambda root: edit_notebook(root, lambda _, all_: all_["metadata"].update(x=1)),
    "one string for lines": lambda root: edit_notebook(
        root, lambda cells, _: [c.update(source="".join(c["source"])) for c in cells]
    ),
    "compiled library": lambda root: append(library(root) / "triangulation.pyc"),
    "published figures": lambda root: append(
        root / "data" / "published" / f"{SLOW}.csv", "published anew\n"
    ),
    "words about code": lambda root: append(library(root) / "vision" / "pinhole.py", "# told\n"),
    "new library file": lambda root: append(library(root) / "new.py"),
    "what makes the book": lambda root: append(library(root) / "book" / "build.py", "a = 1\n"),
    "what measures": lambda root: append(library(root) / "measure" / "pipeline.py", "a = 1\n"),
    "another figure set": lambda root: append(
        library(root) / "figure_sets" / "planner" / "compute.py", "a = 1\n"
    ),
    "asset of another page": lambda root: append(library(root) / "web" / "assets" / "explorer.css"),
    "the ledger's facts": lambda root: append(root / "data" / "thesis" / "trends.csv"),
    "other notebook": lambda root: append(root / "notebooks" / f"{GOOD}.ipynb"),
}


def job(out: Path, **values: object) -> runs.Job:
    return runs.Job(validate(SLOW, values), out / "a.ipynb", out / "a.nc")


@pytest.mark.few(5)
@pytest.mark.parametrize("edit", STALE)
def test_what_determines_a_result_makes_it_stale(root, tmp_path, edit):
    before = runs.digest(job(tmp_path))
    STALE[edit](root)
    assert runs.digest(job(tmp_path)) != before


@pytest.mark.few(5)
@pytest.mark.parametrize("edit", FRESH)
def test_what_does_not_determine_a_result_does_not(root, tmp_path, edit):
    before = runs.digest(job(tmp_path))
    files = {path: path.read_bytes() for path in root.rglob("*") if path.is_file()}
    FRESH[edit](root)
    assert files != {path: path.read_bytes() for path in root.rglob("*") if path.is_file()}
    assert runs.digest(job(tmp_path)) == before


def test_parameters_make_stale_but_not_the_place(root, tmp_path):
    digest = runs.digest(job(tmp_path))
    assert runs.digest(job(tmp_path, trials=7)) != digest
    assert runs.digest(job(tmp_path / "elsewhere", cube="x.nc")) == digest


def test_published_figures_make_a_page_stale(root, tmp_path):
    with_page = dataclasses.replace(job(tmp_path), page=tmp_path / "a.html")
    before = runs.digest(with_page)
    FRESH["published figures"](root)
    assert runs.digest(with_page) != before


@pytest.mark.slow
def test_edited_library_runs_again_and_new_outputs_do_not(own_checkout, tmp_path):
    shorten(own_checkout, SLOW)
    first = own_checkout.thesis(*ONE, cwd=tmp_path)
    assert first.returncode == 0, first.stderr
    edit_notebook(
        own_checkout.root,
        lambda cells, _: cells[1].update(
            outputs=[{"output_type": "stream", "name": "stdout", "text": ["7"]}]
        ),
    )
    second = own_checkout.thesis(*ONE, cwd=tmp_path)
    assert second.returncode == 0, second.stderr
    assert f"{SLOW}: up to date" in second.stderr
    append(library(own_checkout.root) / "vision" / "rounding.py", "changed = 1\n")
    (tmp_path / "out" / f"{SLOW}.html").write_text("old")
    third = own_checkout.thesis(*ONE, cwd=tmp_path)
    assert third.returncode == 0, third.stderr
    assert f"{SLOW}: done in" in third.stderr
    assert "<html" in (tmp_path / "out" / f"{SLOW}.html").read_text(encoding="utf-8")


# Tasks of any kind.


@pytest.fixture
def task(tmp_path, monkeypatch):
    """A task whose record is in a folder of this test."""
    monkeypatch.setattr(tasks, "workplace", lambda: tmp_path / "project")
    return tasks.task


def writer(path: Path, log: list[str]):
    def write() -> None:
        log.append(path.name)
        path.write_text("x")

    return write


def test_task_runs_once_until_its_key_or_its_file_changes(tmp_path, task):
    log: list[str] = []
    target = tmp_path / "made"

    def run(key: str) -> None:
        tasks.run([task("t", writer(target, log), [], [target], key)])

    run("one")
    run("one")
    assert len(log) == 1
    run("two")
    assert len(log) == 2
    target.unlink()
    run("two")
    assert len(log) == 3


def test_failing_task_is_told_and_the_others_are_done(tmp_path, task):
    log: list[str] = []

    def fails() -> None:
        raise ValueError("no ink left")

    jobs = [
        task("bad", fails, [], [tmp_path / "bad"], "key"),
        task("good", writer(tmp_path / "good", log), [], [tmp_path / "good"], "key"),
    ]
    for _ in range(2):
        with pytest.raises(
            tasks.RunError, match=r"^bad: ValueError: no ink left; the traceback is"
        ):
            tasks.run(jobs)
    assert log == ["good"]


def test_tasks_run_in_the_order_of_their_files(tmp_path, task):
    log: list[str] = []
    first, second = tmp_path / "first", tmp_path / "second"
    jobs = [
        task("b", writer(second, log), [first], [second]),
        task("a", writer(first, log), [], [first], "key"),
    ]
    tasks.run(jobs)
    assert log == ["first", "second"]


# Whole files.


def test_whole_file_replaces_and_is_readable_by_all(tmp_path):
    place = tmp_path / "new" / "file.txt"
    for text in ("one", "two"):
        files.whole_file(place, lambda part, text=text: part.write_text(text))
        assert place.read_text() == text
    assert stat.S_IMODE(place.stat().st_mode) == 0o644
    assert [path.name for path in place.parent.iterdir()] == ["file.txt"]


@pytest.mark.parametrize("error", [OSError("disk full"), KeyboardInterrupt()])
def test_whole_file_leaves_the_old_one_if_writing_fails(tmp_path, error):
    place = tmp_path / "file.txt"
    place.write_text("old")

    def write(part: Path) -> None:
        part.write_text("half")
        raise error

    with pytest.raises(type(error)):
        files.whole_file(place, write)
    assert place.read_text() == "old"
    assert [path.name for path in tmp_path.iterdir()] == ["file.txt"]


def test_damaged_cube_is_made_anew(tmp_path, task):
    cube, log = tmp_path / "cube.nc", []

    def make() -> None:
        log.append("made")
        xr.Dataset({"a": ("x", [1.0] * 3000)}).to_netcdf(cube, engine="h5netcdf")

    jobs = [task("cube", make, [], [cube], "key")]
    tasks.run(jobs)
    tasks.run(jobs)
    assert log == ["made"]
    cube.write_bytes(cube.read_bytes()[:2000])
    tasks.run(jobs)
    assert log == ["made", "made"]


@pytest.mark.slow
def test_two_requests_at_once_into_one_folder_are_not_mixed_up(own_checkout, tmp_path, start):
    go = tmp_path / "go"
    shorten(own_checkout, SLOW, WAITS.format(go=str(go)))
    both = [
        start(own_checkout, tmp_path / f"{seed}.txt", *ONE, "-p", f"seed={seed}") for seed in (1, 2)
    ]
    for running in both:
        running.wait_for(
            lambda: (
                sum(any(path.rglob("begun")) for path in left_over(tmp_path / "out")) == 2
                if (tmp_path / "out").is_dir()
                else False
            )
        )
    go.touch()
    status = sorted(running.process.wait(timeout=300) for running in both)
    assert status in ([0, 0], [0, 1])  # the first may see what the second has put there
    for running in both:
        if running.process.returncode == 1:
            assert "another run has meanwhile been written there" in running.said()
    assert made(tmp_path / "out") == targets(SLOW)
    assert left_over(tmp_path / "out") == []
    with xr.open_dataset(tmp_path / "out" / f"{SLOW}.nc") as cube:
        seed = int(cube.attrs["seed"])
    again = own_checkout.thesis(*ONE, "-p", f"seed={seed}", cwd=tmp_path)
    assert f"{SLOW}: up to date" in again.stderr  # all three files are of one of them


@pytest.mark.slow
def test_a_kernel_that_is_killed_is_told_in_one_line(own_checkout, tmp_path):
    shorten(own_checkout, SLOW, "import os\n\nos.kill(os.getpid(), 9)")
    done = own_checkout.thesis(*ONE, cwd=tmp_path)
    assert done.returncode == 1
    last = done.stderr.splitlines()[-1]
    assert last.startswith(f"thesis: {SLOW}: the process that executes its notebook has ended")
    assert len(done.stderr.splitlines()) == 3
    assert made(tmp_path / "out") == left_over(tmp_path / "out") == []


@pytest.mark.slow
def test_what_shall_outlive_its_terminal_goes_on(own_checkout, tmp_path):
    go = tmp_path / "go"
    shorten(own_checkout, SLOW, WAITS.format(go=str(go)))
    running = subprocess.Popen(
        ["nohup", sys.executable, "-m", "thesis_lib", *ONE],
        cwd=tmp_path,
        env=own_checkout.environment,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    try:
        for _ in range(1200):
            if any(tmp_path.glob("out/.staging-*/**/begun")) or running.poll() is not None:
                break
            time.sleep(0.05)
        os.killpg(running.pid, signal.SIGHUP)
        go.touch()
        assert running.wait(timeout=120) == 0
    finally:
        running.kill()
    assert made(tmp_path / "out") == targets(SLOW)
