"""Files: where the project is, what results depend on, and writing whole or not at all."""

from __future__ import annotations

import atexit
import contextlib
import hashlib
import os
import shutil
import tempfile
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path


def project_root() -> Path:
    """The checkout that the library is installed from.

    Raises
    ------
    FileNotFoundError
        If the library was installed without its checkout.
    """
    root = Path(__file__).parents[2]
    if not (root / "notebooks").is_dir():
        raise FileNotFoundError(
            f"{root}: no notebooks here; run this from a clone of the project, "
            "in which the library is installed with `pip install -e .`"
        )
    return root


def library_files() -> list[Path]:
    """Files that every result depends on: the library, the thesis's facts, the lock.

    Of a package that was installed without its checkout: all its files, the facts among them.
    """
    package = Path(__file__).parent
    files = [p for p in package.rglob("*") if p.is_file()]
    files = [p for p in files if p.suffix != ".pyc" and "__pycache__" not in p.parts]
    root = package.parents[1]
    if (lock := root / "requirements" / "book.txt").is_file():
        files += [*(root / "data" / "thesis").iterdir(), lock]
    return sorted(files)


@cache
def library_digest() -> str:
    """SHA-256 of the library's files as they were when this was first asked."""
    total = hashlib.sha256()
    for path in library_files():
        total.update(f"{path.name} {hashlib.sha256(path.read_bytes()).hexdigest()}\n".encode())
    return total.hexdigest()


def whole_file(path: Path, write: Callable[[Path], object]) -> None:
    """Let `write` fill a temporary file beside `path`, then rename it: never a half-written one."""
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(prefix=f".{path.stem}-", suffix=path.suffix, dir=path.parent)
    os.close(handle)
    temporary = Path(name)
    try:
        write(temporary)
        temporary.chmod(0o644)
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def whole_text(path: Path, text: str) -> None:
    """Write a text file (UTF-8), whole or not at all."""
    whole_file(path, lambda part: part.write_text(text, encoding="utf-8"))


@contextlib.contextmanager
def staging(folder: Path) -> Iterator[Path]:
    """A folder inside `folder` to write in; those that dead processes left are removed."""
    folder.mkdir(parents=True, exist_ok=True)
    sweep(folder)
    path = Path(tempfile.mkdtemp(prefix=f".staging-{os.getpid()}-", dir=folder))
    atexit.register(shutil.rmtree, path, ignore_errors=True)  # an interrupt unwinds no thread
    try:
        yield path
    finally:
        shutil.rmtree(path, ignore_errors=True)


def sweep(folder: Path) -> None:
    """Remove the staging folders in `folder` that dead processes left."""
    for left in folder.glob(".staging-*"):
        if not _alive(int(left.name.split("-")[1])):
            shutil.rmtree(left, ignore_errors=True)


def _alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True
