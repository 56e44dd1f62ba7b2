"""What a book and a run promise, on the real commands: nothing is believed that is not so."""

import json
import os
import random
import re
import signal
import subprocess
import sys
import time

import nbformat
import pytest
import xarray as xr
from small_book import BAD, GOOD, shrink

from conftest import Checkout, until_study
from thesis_lib.figure_sets.registry import STUDIES
from thesis_lib.studies.schema import RUN_DEPENDENT

pytest.importorskip("doit", reason="the book needs doit")
pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="signals")
STATES = """
import json, sys
from thesis_lib.book import build
from thesis_lib.figure_sets import cube_file

for line in sys.stdin:
    cube_file.code_digest.cache_clear()  # as in a process of its own
    found = [[build.results_key(name), build.is_result_current(name)] for name in line.split()]
    print(json.dumps(dict(zip(line.split(), found))), flush=True)
"""
EVERY = {GOOD, BAD}
WAITS = """
import time
from pathlib import Path

Path({begun!r}).touch()
for _ in range(3000):
    if Path({go!r}).exists():
        break
    time.sleep(0.1)
"""
NO_SPACE = 'raise OSError(28, "No space left on device")'


def shorten(checkout, name, last=""):
    """Leave a notebook its parameters and its study, and give it one more cell."""

    def edit(document):
        until_study(document)
        if last:
            document.cells.append(nbformat.v4.new_code_cell(last, id="last"))

    checkout.change(name, edit)


def append(path, text):
    with path.open("ab") as stream:
        stream.write(text.encode())


def cubes(folder):
    found = {}
    for path in sorted(folder.glob("*.nc")):
        with xr.open_dataset(path) as cube:
            found[path.stem] = cube.load()
        for name in (*RUN_DEPENDENT, "library_sha256"):
            del found[path.stem].attrs[name]
    return found


@pytest.fixture(scope="module")
def book(tmp_path_factory):
    """A checkout whose book has two figure sets, executed."""
    made = Checkout(tmp_path_factory.mktemp("book") / "project")
    shrink(made)
    for name in (GOOD, BAD):
        shorten(made, name)
    done = made.thesis("book", cwd=made.root, timeout=300)
    assert done.returncode == 0, done.stderr
    return made


@pytest.fixture(scope="module")
def states(book):
    """Key of some figure sets, and whether their files are believed, as one process finds it."""
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    command = [sys.executable, "-c", STATES]
    with subprocess.Popen(command, cwd=book.root, env=book.environment, **pipes) as running:

        def ask(*names):
            running.stdin.write(" ".join(names) + "\n")
            running.stdin.flush()
            return json.loads(running.stdout.readline())

        yield ask


@pytest.fixture
def restored(book, states):
    """Put back what a test changes, with its times."""
    places = [path for path in book.root.rglob("*") if path.is_file() and path.name != ".lock"]
    kept = [path for path in places if "build" not in path.parts]
    before = {path: (path.read_bytes(), path.stat()) for path in kept}
    assert all(believed for _, believed in states(*EVERY).values())
    yield
    for path, (content, status) in before.items():
        if not path.exists() or path.read_bytes() != content:
            path.write_bytes(content)
            os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns))
    assert all(believed for _, believed in states(*EVERY).values())


# Killed.


@pytest.mark.nightly
@pytest.mark.parametrize("number", range(3))
@pytest.mark.usefixtures("restored")
def test_a_book_killed_at_any_moment_gives_the_same_cubes_when_called_again(book, number):
    results = book.root / "data" / "results"
    wanted, asked = cubes(results), {name: book.notebook(name).read_bytes() for name in EVERY}
    for name in EVERY:  # it is killed while it puts the cubes of another request there
        text = re.sub(rb"trials: int = \d+", b"trials: int = %d" % (10 + number), asked[name])
        assert text != asked[name]
        book.notebook(name).write_bytes(text)
    process = subprocess.Popen(
        [sys.executable, "-m", "thesis_lib", "book"],
        cwd=book.root, env=book.environment, stdin=-3, stdout=-3, stderr=-3,
    )  # fmt: skip
    time.sleep(random.Random(number).uniform(2, 15))
    process.kill()
    process.wait()
    for name in EVERY:
        book.notebook(name).write_bytes(asked[name])
    done = book.thesis("book", cwd=book.root, timeout=300)
    assert done.returncode == 0, done.stderr
    made = cubes(results)
    assert made.keys() == wanted.keys()
    assert all(made[name].identical(cube) for name, cube in wanted.items())


@pytest.mark.slow
@pytest.mark.few(1)
@pytest.mark.parametrize("politely", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
@pytest.mark.usefixtures("interrupts_ignored")
def test_an_interrupted_run_says_so_and_leaves_nothing_behind(checkout, tmp_path, start, politely):
    begun = tmp_path / "begun"
    shorten(checkout, BAD, WAITS.format(begun=str(begun), go=str(tmp_path / "go")))
    running = start(checkout, tmp_path / "log.txt", "run", BAD, "-p", "trials=1", "--out", "o")
    running.wait_for(begun.exists)
    os.killpg(running.process.pid, politely)
    assert running.process.wait(timeout=60) == 130
    assert "interrupted; run the same command again to go on" in running.said()
    assert "Traceback" not in running.said()
    assert [path.name for path in (tmp_path / "o").iterdir() if path.name != ".lock"] == []


# Edited or damaged.

EDITS = {  # file, what is added to it, and which figure sets are stale then
    "library": ("src/thesis_lib/vision/rounding.py", "_n = 1\n", EVERY),
    "another figure set": ("src/thesis_lib/figure_sets/planner/compute.py", "_n = 1\n", set()),
    "what measures": ("src/thesis_lib/measure/steps.py", "_n = 1\n", set()),
    "fact": ("data/thesis/setups.toml", "\n", EVERY),
    "the ledger's fact": ("data/thesis/claims.csv", "\n", set()),
    "lock": ("requirements/book.txt", "\n", EVERY),
    "notebook": (f"notebooks/{BAD}.ipynb", "\n", {BAD}),
    "a bit of a cube": (f"data/results/{BAD}.nc", None, {BAD}),
    "executed notebook": (f"book/executed/{BAD}.ipynb", "\n", {BAD}),
}


@pytest.mark.slow
@pytest.mark.parametrize("edit", EDITS)
@pytest.mark.usefixtures("restored")
def test_an_edit_makes_stale_what_depends_on_it(book, states, edit):
    file, added, stale = EDITS[edit]
    if added:
        append(book.root / file, added)
    else:
        content = bytearray((book.root / file).read_bytes())
        content[-1000] ^= 1
        (book.root / file).write_bytes(content)
    assert {name for name, (_, believed) in states(*EVERY).items() if not believed} == stale


@pytest.mark.slow
@pytest.mark.usefixtures("restored")
def test_an_edited_recording_makes_its_figure_set_and_the_ledger_stale(book, states):
    (recording,) = (book.root / "data" / "recordings").glob("lab-plate*.nc")
    before = states(*STUDIES)
    append(recording, "x")
    after = states(*STUDIES)
    changed = {name for name, (key, _) in after.items() if key != before[name][0]}
    assert changed == {"lab-plate", "claims"}


# Two at once, and failures.

IN_TURNS = """
import sys, time
from pathlib import Path
from thesis_lib.files import lock_folder

folder = Path(sys.argv[1])
for _ in range(30):
    with lock_folder(folder, wait=True):
        mine = folder / "mine"
        assert not mine.exists()
        mine.touch()
        time.sleep(0.002)
        mine.unlink()
"""


def test_commands_wait_for_each_other_and_leave_no_lock(tmp_path):
    command = [sys.executable, "-c", IN_TURNS, str(tmp_path)]
    processes = [subprocess.Popen(command, stderr=subprocess.PIPE) for _ in range(3)]
    assert [process.communicate()[1] for process in processes] == [b""] * 3
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
@pytest.mark.few(1)
@pytest.mark.parametrize("command", [["run", BAD, "-p", "trials=1", "--out", "out"], ["book"]])
def test_of_two_commands_in_one_folder_the_second_is_refused(
    own_checkout, tmp_path, start, command
):
    begun, go = tmp_path / "begun", tmp_path / "go"
    shrink(own_checkout)
    shorten(own_checkout, GOOD)
    shorten(own_checkout, BAD, WAITS.format(begun=str(begun), go=str(go)))
    first = start(own_checkout, tmp_path / "log.txt", *command)
    first.wait_for(begun.exists)
    second = own_checkout.thesis(*command, cwd=tmp_path)
    assert second.returncode == 1
    (line,) = second.stderr.splitlines()
    assert "another command writes there; wait until it has ended" in line
    go.touch()
    assert first.process.wait(timeout=300) == 0, first.said()


@pytest.mark.nightly
def test_a_full_disk_and_a_killed_kernel_are_told_in_one_line_and_nothing_is_lost(
    checkout, tmp_path
):
    run = ["run", BAD, "-p", "trials=1", "--out", "out"]
    shorten(checkout, BAD)
    assert checkout.thesis(*run, cwd=tmp_path).returncode == 0
    before = {path: path.read_bytes() for path in (tmp_path / "out").glob(f"{BAD}.*")}
    shorten(checkout, BAD, NO_SPACE)
    full = checkout.thesis(*run, cwd=tmp_path)
    assert full.returncode == 1
    assert "failed with OSError: [Errno 28] No space left on device" in full.stderr.splitlines()[-1]
    shorten(checkout, BAD, "import os\n\nos.kill(os.getpid(), 9)")
    killed = checkout.thesis(*run, cwd=tmp_path)
    assert killed.returncode == 1
    said = f"thesis: {BAD}: the process that executes its notebook has ended"
    assert killed.stderr.splitlines()[-1].startswith(said)
    assert {path: path.read_bytes() for path in before} == before
