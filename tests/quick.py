"""``make quick``: the tests that what was edited can reach, the nearest first, for half a minute.

What was edited is what differs from the last commit. A test reaches what it names, the folder of a
figure set that it names, and the room of the library whose tests it belongs to.
"""

import re
import subprocess
import sys
import time
from pathlib import Path

import pytest

from thesis_lib.files import project_root
from thesis_lib.studies.schema import VARIABLES_FILE

FILES = 12  # no more are imported
FAR = 3  # what a test does not reach
SECONDS = 25  # of tests, from the first one; the test that runs when they are over comes on top
OPTIONS = ["-q", "-rs", "-n", "2", "--dist", "loadfile"]
OPTIONS += ["-m", "not (slow or book or nightly)", "--seconds", str(SECONDS)]
ROOMS = {"notebooks": "notebook", "book": "book", "data/thesis": "facts", "data/published": "book"}
"""Folders of tests for what is not in the library, whose folders have the library's names."""


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--seconds", type=float, help="skip the tests that would begin later")


def pytest_configure(config: pytest.Config) -> None:
    if seconds := config.getoption("--seconds"):
        config.pluginmanager.register(_UntilThen(seconds))


class _UntilThen:
    def __init__(self, seconds: float) -> None:
        self.seconds, self.end, self.ran = seconds, float("inf"), 0

    @pytest.hookimpl(tryfirst=True)  # before any fixture
    def pytest_runtest_setup(self) -> None:
        self.end = min(self.end, time.monotonic() + self.seconds)
        if time.monotonic() > self.end:
            pytest.skip("the time is over: `make test` runs it")

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        self.ran += report.when == "call" and not report.skipped

    @pytest.hookimpl(tryfirst=True)
    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        if not self.ran and session.exitstatus == pytest.ExitCode.OK:
            session.exitstatus = pytest.ExitCode.NO_TESTS_COLLECTED


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


def names_of(file: Path) -> list[str]:
    """Return the names by which tests may call an edited file: its own, and its figure set's."""
    parts = file.relative_to(project_root()).parts
    own = [] if file.name == VARIABLES_FILE else [file.stem]
    if parts[:3] == ("src", "thesis_lib", "figure_sets") and len(parts) > 4:
        own += [parts[3], parts[3].replace("_", "-")]
    return own


def room_of(file: Path) -> str:
    """Return the folder of tests that an edited file belongs to; empty if there is none."""
    parts = file.relative_to(project_root()).parts
    if parts[:2] == ("src", "thesis_lib"):
        return parts[2]
    return ROOMS.get(parts[0]) or ROOMS.get("/".join(parts[:2]), "")


def distance(file: Path, test: Path, text: str) -> int:
    """Return how near an edited file is to a test: 0 is its own, 1 names it, 2 is in its room."""
    if test.name in (file.name, f"test_{file.stem}.py"):
        return 0
    if any(re.search(rf"\b{re.escape(name)}\b", text) for name in names_of(file)):
        return 1
    return 2 if room_of(file) == test.parent.name else FAR


def main() -> int:
    """Run the tests that the edited files reach; 5 if there are none, as pytest has it."""
    root = project_root()
    files = edited(root)
    if not files:
        print("nothing differs from the last commit, so no test ran")
        return 0
    near = {}
    for test in sorted((root / "tests").rglob("test_*.py")):
        text = test.read_text(encoding="utf-8")
        near[test] = min(distance(file, test, text) for file in files)
    chosen = sorted((test for test in near if near[test] < FAR), key=lambda test: near[test])
    none = "no test ran that the edited files reach: run `make test`"
    if not chosen:
        print(none)
        return pytest.ExitCode.NO_TESTS_COLLECTED
    print(f"{len(chosen)} files of tests reach it; the nearest {FILES}:", flush=True)
    tests = [str(test) for test in chosen[:FILES]]
    status = subprocess.call([sys.executable, "-m", "pytest", *OPTIONS, *tests], cwd=root)
    if status == pytest.ExitCode.NO_TESTS_COLLECTED:
        print(none)
    return status


if __name__ == "__main__":
    sys.exit(main())
