"""``make quick``: the tests that what was edited can reach, the nearest first, for half a minute.

What was edited is what differs from the last commit. A test reaches what it imports, what that
imports, and files that one of these names; with a copy of the project it reaches the whole command.
"""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Iterable
from pathlib import Path

import pytest

from thesis_lib.files import project_root
from thesis_lib.studies.reach import reached

FILES = 12  # no more are imported
SECONDS = 20  # of these; the test that runs when they are over comes on top
OPTIONS = ["-q", "-rs", "-n", "2", "--dist", "loadfile", "--no-loadscope-reorder"]
OPTIONS += ["-m", "not (slow or book or nightly)", "--seconds", str(SECONDS)]


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--seconds", type=float, help="skip the tests that would begin later")


def pytest_configure(config: pytest.Config) -> None:
    if seconds := config.getoption("--seconds"):
        config.pluginmanager.register(_UntilThen(time.monotonic() + seconds))


class _UntilThen:
    def __init__(self, end: float) -> None:
        self.end = end

    @pytest.hookimpl(tryfirst=True)  # before any fixture
    def pytest_runtest_setup(self) -> None:
        if time.monotonic() > self.end:
            pytest.skip("the time is over: `make test` runs it")


def edited(root: Path) -> set[Path]:
    """Files that differ from the last commit, new ones included."""
    commands = ["diff --name-only HEAD", "ls-files --others --exclude-standard"]
    lines = [
        line
        for command in commands
        for line in subprocess.check_output(
            ["git", *command.split()], cwd=root, text=True
        ).splitlines()
    ]
    return {root / line for line in lines}


def steps_to(files: Iterable[Path], test: Path) -> dict[Path, int]:
    """How far each of some files is from a test; those that it does not reach are left out."""
    steps = dict(reached(test))
    behind = [project_root() / "tests" / "conftest.py"]  # its fixtures are not imported
    if "checkout" in test.read_text(encoding="utf-8"):
        behind.append(project_root() / "src" / "thesis_lib" / "__main__.py")
    for start in behind:
        for file, far in reached(start).items():
            steps.setdefault(file, far + 2)
    named = {file: file.name for file in files if file.suffix != ".py"}
    for one, far in list(steps.items()) if named else ():
        text = one.read_text(encoding="utf-8")
        for file, name in named.items():
            if name in text:
                steps[file] = min(far + 1, steps.get(file, far + 1))
    return {file: steps[file] for file in files if file in steps}


def main() -> int:
    """Run the tests that the edited files reach."""
    root = project_root()
    files = edited(root)
    near = {test: steps_to(files, test) for test in sorted((root / "tests").rglob("test_*.py"))}
    for file in sorted(files - {file for steps in near.values() for file in steps}):
        print(f"no test reaches {file.relative_to(root)}")
    chosen = [test for test, steps in near.items() if steps]
    chosen.sort(key=lambda test: (min(near[test].values()), len(reached(test))))
    if not chosen:
        return 0
    print(f"{len(chosen)} files of tests reach it; the nearest {FILES}:", flush=True)
    tests = [str(test) for test in chosen[:FILES]]
    status = subprocess.call([sys.executable, "-m", "pytest", *OPTIONS, *tests], cwd=root)
    return 0 if status == pytest.ExitCode.NO_TESTS_COLLECTED else status


if __name__ == "__main__":
    sys.exit(main())
