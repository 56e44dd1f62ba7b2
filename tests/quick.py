"""``make quick``: the tests that what was edited can reach, the nearest first, for half a minute.

What was edited is what differs from the last commit. A test reaches what it names, and the room of
the library whose tests it belongs to.
"""

from __future__ import annotations

import re
import subprocess
import sys
import time
from pathlib import Path

import pytest

from thesis_lib.files import project_root

FILES = 12  # no more are imported
FAR = 3  # what a test does not reach
SECONDS = 20  # of these; the test that runs when they are over comes on top
OPTIONS = ["-q", "-rs", "-n", "2", "--dist", "loadfile"]
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


def distance(file: Path, test: Path, text: str) -> int:
    """Return how near an edited file is to a test: 0 is the test, 1 named in it, 2 in its room."""
    root = project_root()
    if file == test:
        return 0
    if re.search(rf"\b{re.escape(file.stem)}\b", text):
        return 1
    rooms = [path.relative_to(root).parts for path in (file, test)]
    return 2 if rooms[0][:2] == ("src", "thesis_lib") and rooms[0][2] == rooms[1][1] else FAR


def main() -> int:
    """Run the tests that the edited files reach."""
    root = project_root()
    files = edited(root)
    near = {}
    for test in sorted((root / "tests").rglob("test_*.py")):
        text = test.read_text(encoding="utf-8")
        near[test] = min((distance(file, test, text) for file in files), default=FAR)
    chosen = sorted((test for test in near if near[test] < FAR), key=lambda test: near[test])
    if not chosen:
        return 0
    print(f"{len(chosen)} files of tests reach it; the nearest {FILES}:", flush=True)
    tests = [str(test) for test in chosen[:FILES]]
    status = subprocess.call([sys.executable, "-m", "pytest", *OPTIONS, *tests], cwd=root)
    return 0 if status == pytest.ExitCode.NO_TESTS_COLLECTED else status


if __name__ == "__main__":
    sys.exit(main())
