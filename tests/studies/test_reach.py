"""What a file rests on, followed by imports, and which tests ``make quick`` takes for an edit."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
import quick

from thesis_lib import files
from thesis_lib.studies import reach

FILES = {
    "src/lib/__init__.py": "",
    "src/lib/base.py": "import numpy",
    "src/lib/middle.py": "from lib import base\nSTYLE = 'page.css'",
    "src/lib/lazy.py": "def f():\n    try:\n        import lib.base\n    finally:\n        pass",
    "src/lib/alone.py": "'import lib.base'",
    "src/lib/room/__init__.py": "from lib.room.wall import height as tall\nfrom .door import open_",
    "src/lib/room/wall.py": "from ..middle import STYLE",
    "src/lib/room/door.py": "from . import wall",
    "src/lib/page.css": "p {}",
    "src/thesis_lib/__main__.py": "from lib import alone",
    "tests/conftest.py": "",
    "tests/scene.py": "from lib import lazy",
    "tests/test_base.py": "import lib.base",
    "tests/test_scene.py": "from scene import lazy",
    "tests/test_tall.py": "from lib.room import tall",
    "tests/test_open.py": "from lib.room import open_",
    "tests/test_room.py": "import lib.room",
    "tests/test_command.py": "def test_it(checkout): pass",
}


@pytest.fixture
def project(tmp_path, monkeypatch):
    for name, text in FILES.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    monkeypatch.setattr(reach, "shipped", lambda: tmp_path)
    monkeypatch.setattr(quick, "project_root", lambda: tmp_path)
    monkeypatch.setattr(reach, "__file__", str(tmp_path / "src" / "lib" / "studies" / "reach.py"))
    return tmp_path


def names(root: Path, test: str) -> dict[str, int]:
    return {file.stem: far for file, far in reach.reached(root / "tests" / test).items()}


def test_imports_are_followed_wherever_they_stand(project):
    assert names(project, "test_base.py") == {"test_base": 0, "base": 1}
    assert names(project, "test_scene.py") == {"test_scene": 0, "scene": 1, "lazy": 2, "base": 3}


def test_a_name_of_a_package_counts_as_the_module_that_defines_it(project):
    assert names(project, "test_tall.py") == {"test_tall": 0, "wall": 1, "middle": 2, "base": 3}
    assert "door" in names(project, "test_open.py")
    assert {"__init__", "wall", "door"} <= names(project, "test_room.py").keys()


@pytest.mark.parametrize(
    ("edit", "tests"),
    [
        ("src/lib/base.py", "base tall room open scene"),
        ("src/lib/room/door.py", "open room"),
        ("src/lib/page.css", "tall room open"),
        ("src/lib/alone.py", "command"),
        ("tests/conftest.py", "base command open room scene tall"),
        ("README.md", ""),
    ],
)
def test_an_edit_is_tested_by_what_reaches_it_the_nearest_first(
    project, monkeypatch, capsys, edit, tests
):
    (project / edit).write_text("new")
    called = []
    monkeypatch.setattr(quick, "edited", lambda root: {root / edit})
    monkeypatch.setattr(quick.subprocess, "call", lambda words, cwd: called.append(words) or 1)
    assert quick.main() == bool(tests)
    chosen = [Path(word).stem.removeprefix("test_") for word in called[0][-len(tests.split()) :]
              ] if called else []  # fmt: skip
    assert set(chosen) == set(tests.split())
    if edit.endswith("base.py"):
        assert chosen[0] == "base"
        assert chosen.index("tall") < chosen.index("open")
    assert (f"no test reaches {edit}" in capsys.readouterr().out) == (not tests)


def test_edited_files_are_those_that_differ_from_the_last_commit(tmp_path):
    words = ["-c", "user.name=a", "-c", "user.email=a@b.c", "commit", "-qm", "one"]
    for name in ("same", "other"):
        (tmp_path / name).write_text("1")
    for command in (["init", "-q"], ["add", "."], words):
        subprocess.run(["git", *command], cwd=tmp_path, check=True)
    (tmp_path / "other").write_text("2")
    (tmp_path / "new").write_text("")
    assert quick.edited(tmp_path) == {tmp_path / "other", tmp_path / "new"}


def test_what_would_begin_too_late_is_skipped(tmp_path):
    (tmp_path / "test_a.py").write_text("def test_a(): raise OSError")
    words = ["-p", "quick", "--seconds", "-1", "-rs", "-p", "no:cacheprovider", tmp_path]
    done = subprocess.run(
        [sys.executable, "-m", "pytest", *map(str, words)], cwd=tmp_path, capture_output=True,
        text=True, env={"PYTHONPATH": str(Path(__file__).parents[1])},
    )  # fmt: skip
    assert done.returncode == 0, done.stdout
    assert "1 skipped" in done.stdout
    assert "`make test` runs it" in done.stdout


def test_every_module_is_reached_from_the_command():
    root = files.project_root()
    library = root / "src" / "thesis_lib"
    found = {path.name for path in reach.reached(library / "__main__.py")}
    assert {"cli.py", "build.py", "triangulation.py", "cache.py"} <= found
