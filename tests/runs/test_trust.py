"""Nothing is believed that is not what was made: damage, other requests, kills and crashes."""

from __future__ import annotations

import errno
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import xarray as xr
from killing import NAME, REQUESTS, hand_out, job, wrong

from thesis_lib import files, records, text
from thesis_lib.runs import execute as runs
from thesis_lib.runs import tasks
from thesis_lib.studies import cache as kept
from thesis_lib.studies import lock, storage
from thesis_lib.web import page as pages

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="forks")


@pytest.fixture(scope="module")
def canned(tmp_path_factory):
    """What kernels make of two requests."""
    folder = tmp_path_factory.mktemp("canned")
    for which in REQUESTS:
        place = folder / which
        place.mkdir()
        runs._in_kernel(job(which, place), place, place / f"{NAME}.ipynb", place / f"{NAME}.nc")
    return folder


# Killed.


def killed(canned: Path, every: int) -> dict[str, object]:
    script = Path(__file__).parents[1] / "killing.py"
    command = [sys.executable, script, str(canned), str(every)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.mark.slow
def test_killed_at_some_changes_of_files(canned):
    found = killed(canned, 9)
    assert found["bad"] == []
    assert min(found["points"]) >= 9


@pytest.mark.nightly
def test_killed_at_every_change_of_a_file(canned):
    found = killed(canned, 1)
    assert found["bad"] == []
    assert min(found["points"]) >= 20


# Damaged.


@pytest.fixture(scope="module")
def made(canned, tmp_path_factory):
    """A finished run of A."""
    kernel, page = runs._in_kernel, pages.page
    out = tmp_path_factory.mktemp("made") / "out"
    hand_out(canned, "A")
    tasks.run(runs.job_tasks([job("A", out)]))
    yield out
    runs._in_kernel, pages.page = kernel, page


@pytest.fixture
def again(canned, made, tmp_path, capsys):
    """Run A where a finished run of it has been tampered with; what is said of it."""
    out = tmp_path / "out"
    shutil.copytree(made, out)

    def run(tamper=lambda out: None, which="A", wanted="A") -> str:
        tamper(out)
        hand_out(canned, which)
        capsys.readouterr()
        tampered = {path.name: path.read_bytes() for path in out.glob(f"{NAME}.*")}
        tasks.run(runs.job_tasks([job(wanted, out)]))
        for kept_aside in out.glob(f"{NAME}.1.*"):
            assert kept_aside.read_bytes() == tampered[kept_aside.name.replace(".1.", ".")]
            kept_aside.unlink()
        assert wrong(canned, out, wanted) == ""
        return capsys.readouterr().err

    return run


def cut(name: str):
    return lambda out: os.truncate(out / name, (out / name).stat().st_size // 2)


def flip(name: str, keep_time: bool = False):
    """Change one byte in the middle of a file, its time of change too or not."""

    def change(out: Path) -> None:
        path = out / name
        before, content = path.stat(), bytearray(path.read_bytes())
        content[len(content) // 2] ^= 1
        path.write_bytes(content)
        if keep_time:
            os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))

    return change


def falsify(out: Path) -> None:
    """Another number in an output of the notebook."""
    path = out / f"{NAME}.ipynb"
    document = json.loads(path.read_text(encoding="utf-8"))
    outputs = [o for cell in document["cells"] for o in cell.get("outputs", []) if "data" in o]
    outputs[0]["data"]["text/plain"] = ["the error is 0.1 %"]
    path.write_text(json.dumps(document), encoding="utf-8")


def unrecorded(out: Path) -> None:
    path = out / f"{NAME}.ipynb"
    document = json.loads(path.read_text(encoding="utf-8"))
    del document["metadata"]["thesis_lib"]["record"]
    path.write_text(json.dumps(document), encoding="utf-8")


def swapped(name: str, text: str):
    def change(out: Path) -> None:
        (out / name).unlink()
        (out / name).symlink_to(os.devnull) if text == "link" else (out / name).write_text(text)

    return change


DAMAGES = {
    f"{kind} {how}": (damage(f"{NAME}.{kind}"), f"{NAME}.{kind}")
    for kind in ("nc", "html", "ipynb")
    for how, damage in {
        "cut": cut,
        "one bit": flip,
        "one bit, same time": lambda name: flip(name, keep_time=True),
        "emptied": lambda name: swapped(name, ""),
        "of nothing": lambda name: swapped(name, "link"),
        "JSON of another kind": lambda name: swapped(name, "[[[1]]]"),
    }.items()
} | {
    "number in an output": (falsify, f"{NAME}.ipynb"),
    "no record": (unrecorded, f"{NAME}.ipynb"),
    "cube gone": (lambda out: (out / f"{NAME}.nc").unlink(), f"{NAME}.nc"),
    "page gone": (lambda out: (out / f"{NAME}.html").unlink(), f"{NAME}.html"),
    "page and cube swapped": (
        lambda out: (out / f"{NAME}.nc").rename(out / f"{NAME}.html"), NAME,
    ),
}  # fmt: skip


@pytest.mark.few(8)
@pytest.mark.parametrize("damage", DAMAGES)
def test_what_is_damaged_is_named_and_made_anew(again, damage):
    tamper, name = DAMAGES[damage]
    said = [line for line in again(tamper).splitlines() if not line.endswith(("to do", "running"))]
    first, *kept_aside, last = said
    assert name in first
    assert first.endswith("; it is made anew")
    assert all("has changed since it was written; it is kept as" in line for line in kept_aside)
    assert len(kept_aside) == (0 if damage in ("cube gone", "page gone") else 1)
    assert "done in" in last


def test_undamaged_is_up_to_date_wherever_it_is_put(again):
    assert again().splitlines()[0].endswith(f"{NAME}: up to date")


def test_files_of_another_request_are_not_taken_for_this_one(again, canned):
    assert "done in" in again(which="B", wanted="B")
    assert "done in" in again(which="A")


def test_a_cube_of_another_request_beside_this_notebook_is_noticed(again, canned):
    def put(out: Path) -> None:
        shutil.copy(canned / "B" / f"{NAME}.nc", out / f"{NAME}.nc")

    assert f"{NAME}.nc is not what was made; it is made anew" in again(put)


def test_a_former_state_of_a_task_runner_does_not_matter(canned, made, tmp_path, capsys):
    out = shutil.copytree(made, tmp_path / "out")
    (out / ".state.sqlite").write_text("garbage")
    hand_out(canned, "A")
    tasks.run(runs.job_tasks([job("A", out)]))
    assert "up to date" in capsys.readouterr().err
    assert (out / ".state.sqlite").read_text() == "garbage"


# Staging folders.


def test_names_that_are_not_ours_stay(tmp_path):
    precious = tmp_path / "precious"
    precious.mkdir()
    (precious / "photo").write_text("mine")
    (tmp_path / ".staging-abc").mkdir()
    (tmp_path / ".staging-").mkdir()
    (tmp_path / ".staging-99999-abcdefgh").mkdir()
    (tmp_path / ".staging-abcdefgh").symlink_to(precious)
    (tmp_path / ".staging-abcdefg_").write_text("a file")
    before = sorted(tmp_path.rglob("*"))
    files.sweep(tmp_path, tmp_path / "nowhere", precious / "photo")
    assert sorted(tmp_path.rglob("*")) == before


def test_what_dead_processes_left_is_removed_locked_or_not_yet(tmp_path):
    (tmp_path / ".staging-abcdefgh").mkdir()  # killed before it was locked
    (tmp_path / ".staging-12345678" / "kernel").mkdir(parents=True)
    (tmp_path / ".staging-12345678" / ".lock").touch()
    files.sweep(tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_folders_made_by_many_at_once_are_never_swept_while_they_live(tmp_path):
    code = (
        "import sys; from pathlib import Path; from thesis_lib import files\n"
        "for _ in range(200):\n"
        "    with files.staging(Path(sys.argv[1])) as folder:\n"
        "        (folder / 'x').write_text('x'); files.sweep(folder.parents[1])\n"
        "        assert (folder / 'x').read_text() == 'x'\n"
    )
    command = [sys.executable, "-c", code, str(tmp_path)]
    at_once = [subprocess.Popen(command, stderr=subprocess.PIPE, text=True) for _ in range(4)]
    for one in at_once:
        assert one.communicate()[1] == ""
        assert one.returncode == 0
    assert list(tmp_path.iterdir()) == []


def test_a_disk_without_locks_is_written_to_and_never_swept(tmp_path, monkeypatch):
    fcntl = pytest.importorskip("fcntl")
    (tmp_path / ".staging-abcdefgh").mkdir()
    (tmp_path / ".staging-abcdefgh" / ".lock").touch()

    def no_locks(*_):
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr(fcntl, "flock", no_locks)
    files.whole_text(tmp_path / "a.txt", "whole")
    files.sweep(tmp_path)
    assert (tmp_path / "a.txt").read_text() == "whole"
    assert (tmp_path / ".staging-abcdefgh").is_dir()


# What is kept.


def test_other_content_of_the_same_size_and_time_is_noticed(tmp_path):
    video = tmp_path / "A.mkv"
    video.write_bytes(b"sound and pictures")
    key, before = kept.key_of([1], [video]), video.stat()
    assert kept.key_of([1], [video]) == key
    video.write_bytes(b"other and pictures")
    os.utime(video, ns=(before.st_atime_ns, before.st_mtime_ns))
    assert video.stat().st_mtime_ns == before.st_mtime_ns
    assert kept.key_of([1], [video]) != key
    video.write_bytes(b"sound and pictures")  # and copied, at another time, it is what it was
    assert kept.key_of([1], [video]) == key


@pytest.fixture
def cube(tmp_path):
    path = tmp_path / "cache" / "cube.nc"
    storage.write(xr.Dataset({"a": ("x", [1.0, 2.0])}), path)
    kept.keep(path)
    return path


def test_what_is_kept_is_read_and_told_of_only_if_damaged(cube, capsys):
    assert kept.read(cube)["a"].values.tolist() == [1.0, 2.0]
    assert kept.read(cube.with_name("none.nc")) is None
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(
    "tamper",
    [
        lambda path: storage.write(xr.Dataset({"a": ("x", [1.0, 3.0])}), path),
        lambda path: os.truncate(path, 100),
        lambda path: os.truncate(path, 0),
        lambda path: kept._digest(path).unlink(),
        lambda path: kept._digest(path).write_bytes(b"\xff\xfe"),
        lambda path: (path.unlink(), path.mkdir()),
        lambda path: (path.write_text("no cube"), kept.keep(path)),
    ],
    ids=["edited", "cut", "empty", "no digest", "odd digest", "folder", "vouched for, no cube"],
)
def test_a_kept_cube_that_is_damaged_is_named_and_not_used(cube, tamper, capsys):
    tamper(cube)
    assert kept.read(cube) is None
    (line,) = capsys.readouterr().err.splitlines()
    assert str(cube) in line


# Packages.


def test_packages_other_than_the_locks_are_noticed(monkeypatch):
    assert lock.differing_packages() == []
    monkeypatch.setattr(lock, "version", lambda name: "0.1")
    assert any(line.startswith("numpy 0.1 is installed") for line in lock.differing_packages())


# Surroundings.


def test_a_cache_that_cannot_be_written_is_a_temporary_one(tmp_path, monkeypatch):
    monkeypatch.setattr(files, "workplace", lambda: tmp_path)
    monkeypatch.delenv("THESIS_CACHE", raising=False)
    assert files.cache_folder() == tmp_path / "build" / "cache"
    (tmp_path / "build").write_text("a file")
    monkeypatch.setenv("THESIS_CACHE", "")
    monkeypatch.delenv("THESIS_CACHE")
    own = files.cache_folder()
    assert own != tmp_path / "build" / "cache"
    assert files.cache_folder() == own  # as the processes that it starts find
    files.whole_text(own / "a.txt", "whole")
    files.let_go()
    assert not own.exists()


def in_a_shell(line: str, folder: Path) -> subprocess.CompletedProcess[str]:
    command = ["bash", "-c", line, "bash", sys.executable, "-m", "thesis_lib", "list", "design-law"]
    return subprocess.run(command, capture_output=True, text=True, check=False, cwd=folder)


def test_what_no_command_can_work_in_is_named(tmp_path):
    few = in_a_shell('ulimit -n 64; exec "$@"', tmp_path)
    assert (few.returncode, few.stdout) == (1, "")
    assert few.stderr.startswith("thesis: only 64 files may be open at a time")
    assert in_a_shell('ulimit -Sn 64; exec "$@"', tmp_path).returncode == 0
    gone = in_a_shell('mkdir gone; cd gone; rmdir ../gone; exec "$@"', tmp_path)
    assert (gone.returncode, gone.stdout) == (1, "")
    assert gone.stderr.startswith("thesis: the working directory has been deleted")


@pytest.mark.parametrize("closed", ["<&- >&- 2>&-", "2>&-", ">&-"])
def test_closed_streams_are_none_of_the_files_that_are_written(tmp_path, closed):
    done = in_a_shell(f'exec "$@" {closed}', tmp_path)
    assert (done.returncode, done.stderr) == (0, "")


def test_a_machine_that_cannot_reach_itself_is_named_before_a_kernel_is_waited_for(monkeypatch):
    def refuse(*_, **__):
        raise OSError(errno.ENETUNREACH, "Network is unreachable")

    monkeypatch.setattr(runs.socket, "create_connection", refuse)
    with pytest.raises(tasks.RunError, match=r"through 127\.0\.0\.1, which cannot be reached"):
        runs._check_loopback()


# Records.


@pytest.mark.parametrize(
    "content",
    ["", "null", "[]", "7", '"x"', "{}", '{"made": 3, "made_from": "x"}', '{"cells": []}',
     '{"cells": [], "metadata": {"thesis_lib": []}}', "[" * 100_000, "\ud800", '{"made": {}}',
     '{"cells": [], "metadata": null}'],
)  # fmt: skip
def test_a_record_that_is_none_is_none(tmp_path, content):
    path = tmp_path / "record"
    path.write_text(content, encoding="utf-8", errors="surrogatepass")
    assert records.read(path) is None
    assert records.damage(path, []) != ""


def test_a_record_that_cannot_be_read_is_none(tmp_path):
    assert records.read(tmp_path / "none") is None
    assert records.read(tmp_path) is None
    assert records.damage(tmp_path / "none", []) == ""


def test_a_page_of_a_folder_counts(tmp_path):
    book, record = tmp_path / "html", tmp_path / "record.json"
    (book / "deep").mkdir(parents=True)
    (book / "deep" / "script.js").write_text("1")
    records.write(record, "x", [book])
    assert records.damage(record, [book]) == ""
    (book / "deep" / "script.js").unlink()
    assert records.damage(record, [book]) == f"{book}/deep/script.js is missing"
    (book / "deep" / "script.js").write_text("")
    assert records.damage(record, [book]) == f"{book}/deep/script.js is not what was made"
    (book / "deep" / "script.js").write_text("1")
    (book / "another.html").write_text("")
    assert records.damage(record, [book]) == f"{book}/another.html is not what was made"
    shutil.rmtree(book)
    assert records.damage(record, [book]) == f"{book} is missing"


# Messages.


def test_a_message_is_one_printable_line():
    line = text.message("a\nb\x1b[31m\u202e\u200b\x00" + 5000 * "é")
    assert line.isprintable()
    assert text.LONGEST - 5 <= len(line) <= text.LONGEST
    assert line.startswith(r"a\nb\x1b[31m\u202e\u200b\x00é")


def test_logs_that_cannot_be_written_are_said(tmp_path, monkeypatch):
    (tmp_path / "build").write_text("a file")
    monkeypatch.setattr(tasks, "workplace", lambda: tmp_path)

    def fails() -> None:
        raise ValueError("no\nink\x1b left")

    record = tmp_path / "made" / "bad.json"
    with pytest.raises(tasks.RunError) as error:
        tasks.run([tasks.task("bad", fails, [], [], record=record)])
    (line,) = str(error.value).splitlines()
    assert line.startswith("bad: ValueError: no ink")
    assert "the traceback could not be kept" in line
    assert line.isprintable()


def test_texts_beyond_ascii_come_back(tmp_path):
    storage.write(xr.Dataset({"a": ("x", ["320×180", "ψ"])}), tmp_path / "a.nc", compact=True)
    assert storage.opened(tmp_path / "a.nc")["a"].values.tolist() == ["320×180", "ψ"]


def test_a_full_disk_is_called_so(tmp_path, monkeypatch):
    usage = shutil.disk_usage(tmp_path)._replace(free=4096)
    monkeypatch.setattr(tasks.shutil, "disk_usage", lambda _: usage)
    monkeypatch.setattr(tasks, "workplace", lambda: tmp_path)

    def fails() -> None:
        raise RuntimeError("NetCDF: HDF error")

    with pytest.raises(tasks.RunError, match=r"^bad: the disk of .* is full; make room, and run"):
        tasks.run([tasks.task("bad", fails, [], [])])


def test_nobody_listening_is_no_failure(tmp_path, monkeypatch):
    monkeypatch.setattr(tasks, "workplace", lambda: tmp_path)
    monkeypatch.setattr(sys, "stderr", open(os.devnull))  # noqa: PTH123, SIM115
    made = tmp_path / "made"
    tasks.run([tasks.task("good", made.touch, [], [made])])
    assert made.exists()


def test_a_damaged_library_of_the_pages_is_installed_anew(tmp_path, monkeypatch):
    book = pytest.importorskip("thesis_lib.book.rendering")
    installed = []

    def npm(work: Path, *_: str) -> None:
        installed.append(work)
        for package, parts in pages.PACKAGES.items():
            for part in parts:
                file = work / "node_modules" / package / part
                file.parent.mkdir(parents=True, exist_ok=True)
                file.write_text("x = 1")

    monkeypatch.setattr(book, "npm_ci", npm)
    for name in ("package.json", "package-lock.json"):
        (tmp_path / name).write_text("{}")
    for wanted in (1, 1):
        assets = book.install_assets(tmp_path)
        assert len(installed) == wanted
    os.truncate(assets / pages.MATHJAX, 2)
    book.install_assets(tmp_path)
    (assets / pages.MATHJAX).unlink()
    book.install_assets(tmp_path)
    (tmp_path / "package-lock.json").write_text("[]")
    book.install_assets(tmp_path)
    assert len(installed) == 4
    assert (assets / pages.MATHJAX).read_text() == "x = 1"
    assert sorted(p.name for p in (tmp_path / "build").iterdir()) == ["assets"]
