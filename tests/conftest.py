"""A copy of the project that a test may change, and the ``thesis`` command run from it."""

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import nbformat
import pytest
from browser import browser, find_browser
from command import hears_signals

pytest_plugins = ["conforms", "scenes.shared", "small_book", "tiers"]
PROJECT = Path(__file__).parents[1]
PARTS = ["src", "notebooks", "data", "requirements", "pyproject.toml", "dodo.py",
         "book/_toc.yml"]  # fmt: skip


def until_study(document):
    """Leave a notebook its parameters and what comes until it has its cube."""
    last = next(i for i, cell in enumerate(document.cells) if cell.id.endswith("-02"))
    document.cells = document.cells[: last + 1]


class Checkout:
    """A copy of the library, the notebooks and the data; Python started here imports the copy."""

    def __init__(self, root):
        self.root = root
        root.mkdir(parents=True)
        ignored = shutil.ignore_patterns("results", ".ipynb_checkpoints")  # what is compiled stays
        for part in PARTS:
            if (PROJECT / part).is_dir():
                shutil.copytree(PROJECT / part, root / part, ignore=ignored)
            else:
                (root / part).parent.mkdir(exist_ok=True)
                shutil.copy(PROJECT / part, root / part)
        reader = {k: v for k, v in os.environ.items() if not k.startswith("JUPYTER_")}  # of nbval
        self.environment = {**reader, "PYTHONPATH": str(root / "src")}

    def notebook(self, name):
        return self.root / "notebooks" / f"{name}.ipynb"

    def change(self, name, edit):
        """Rewrite a notebook after `edit` has changed it."""
        document = nbformat.read(self.notebook(name), as_version=4)
        edit(document)
        nbformat.write(document, self.notebook(name))

    def python(self, *arguments, cwd, timeout=150, **extra):
        """Run Python with the copy on its path; standard input is empty."""
        return subprocess.run(
            [sys.executable, *map(str, arguments)],
            cwd=cwd,
            env={**self.environment, **extra},
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            encoding="utf-8",
            timeout=timeout,
        )

    def thesis(self, *arguments, cwd, timeout=150):
        """Run the ``thesis`` command and wait for it."""
        return self.python("-m", "thesis_lib", *arguments, cwd=cwd, timeout=timeout)


class Running:
    """A ``thesis`` command under way, in a session of its own."""

    def __init__(self, checkout, log, *arguments):
        self.log = log
        with log.open("w") as stream:
            self.process = subprocess.Popen(
                [sys.executable, "-m", "thesis_lib", *map(str, arguments)],
                cwd=log.parent,
                env=checkout.environment,
                stdin=subprocess.DEVNULL,
                stdout=stream,
                stderr=stream,
                start_new_session=True,
                preexec_fn=hears_signals,
            )

    def said(self):
        return self.log.read_text(encoding="utf-8")

    def wait_for(self, condition):
        """Wait until `condition` holds while the command is still running."""
        for _ in range(6000):
            if condition():
                return
            assert self.process.poll() is None, f"ended too early:\n{self.said()}"
            time.sleep(0.05)
        pytest.fail(f"nothing came of it within five minutes:\n{self.said()}")

    def end(self):
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait(timeout=30)


@pytest.fixture(scope="module")
def checkout(tmp_path_factory):
    """A fresh copy for all tests of one file."""
    return Checkout(tmp_path_factory.mktemp("checkout") / "project")


@pytest.fixture
def own_checkout(tmp_path):
    """A fresh copy that one test may change."""
    return Checkout(tmp_path / "project")


@pytest.fixture(scope="module")
def chromium():
    """A headless browser for the tests of one file, which are skipped where there is none."""
    pytest.importorskip("playwright", reason="the browser tests need the playwright package")
    if find_browser() is None:
        pytest.skip("no Chromium or Chrome on this machine")
    with browser() as running:
        yield running


@pytest.fixture
def start():
    """Start ``thesis`` commands that are ended with the test at the latest."""
    running = []

    def begin(checkout, log, *arguments):
        running.append(Running(checkout, log, *arguments))
        return running[-1]

    yield begin
    for one in running:
        one.end()


@pytest.fixture
def interrupts_ignored():
    """The tests themselves cannot be interrupted, as in a background shell; their commands can."""
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    yield
    signal.signal(signal.SIGINT, before)
