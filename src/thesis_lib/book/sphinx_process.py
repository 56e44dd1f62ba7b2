"""The process that runs Jupyter Book: it may be started before it is known what to do.

To import Jupyter Book, Sphinx and its extensions takes 2 s, in which a book can look for what is
stale and run it. Once told what to do, the process does it and ends. One that was started before
the library's last edit is not used.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
from collections.abc import Sequence
from pathlib import Path

from thesis_lib.files import library_digest

_PROGRAM = """
import gc, json, sys
gc.set_threshold(1_000_000, 50, 1000)  # trees of all pages stay: looking for waste costs a third
from functools import partial
from jupyter_book import sphinx
from jupyter_book.cli.main import main
import myst_nb, sphinx_book_theme, sphinxcontrib.bibtex, thesis_lib.book.extension
sphinx.build_sphinx = partial(sphinx.build_sphinx, jobs=2)
if line := sys.stdin.readline():
    sys.argv[1:] = json.loads(line)
    main()
"""
_ALONE = threading.Lock()
_early: tuple[subprocess.Popen[str], object] | None = None


def begin(root: Path) -> None:
    """Start it, for the next book of a project's `root` that this process renders."""
    global _early
    with _ALONE:
        if _early is None:
            _early = _started(root), _as_it_is(root)


def run(root: Path, arguments: Sequence[str]) -> tuple[int, str]:
    """Run Jupyter Book with arguments; its exit status, and what it said."""
    global _early
    with _ALONE:
        early, _early = _early, None
    if early is not None and early[1] != _as_it_is(root):
        early[0].communicate()  # told nothing, it ends
        early = None
    process = early[0] if early is not None else _started(root)
    said, _ = process.communicate(json.dumps([*arguments]) + "\n")
    return process.returncode, said


def _started(root: Path) -> subprocess.Popen[str]:
    path = [str(Path(__file__).resolve().parents[2]), os.environ.get("PYTHONPATH", "")]
    env = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, path)), "NO_COLOR": "1"}
    return subprocess.Popen(
        [sys.executable, "-c", _PROGRAM],
        cwd=root,
        env=env,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        encoding="utf-8",
        errors="replace",
    )


def _as_it_is(root: Path) -> object:
    """What it rests on."""
    return root, dict(os.environ), library_digest()
