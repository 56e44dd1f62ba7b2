"""Files: where the project is, what results depend on, and writing whole or not at all."""

from __future__ import annotations

import ast
import atexit
import contextlib
import hashlib
import os
import re
import shutil
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from pathlib import Path

_SHIPPED = "_project"  # what of the project a wheel has beside the library
_STAGING = ".staging-"
_NAME = re.compile(re.escape(_STAGING) + r"[a-z0-9_]{8}")  # as mkdtemp makes them
_LOCK = ".lock"
_STRING_OR_COMMENT = re.compile(r"""(("{3}|'{3}|["'])(?:\\.|.)*?\2)|#[^\n]*""", re.DOTALL)
_held: set[Path] = set()  # staging folders of this process
_CACHE = "THESIS_CACHE"  # in the environment: the cache of a command that cannot write its own


class NoCloneError(RuntimeError):
    """What needs a clone of the project was asked of a library that is installed without one."""


def shipped() -> Path:
    """Where notebooks, facts, published values, recordings and the lock are, to be read.

    The checkout; of a library that was installed without one, a folder in its package.
    """
    inside = Path(__file__).with_name(_SHIPPED)
    return inside if inside.is_dir() else inside.parents[2]


def project_root() -> Path:
    """The checkout that the library is installed from.

    Raises
    ------
    NoCloneError
        If the library was installed without its checkout.
    """
    root, package = shipped(), Path(__file__).parent
    if root.parent == package:
        wanted = "this needs a clone of the project, installed with `pip install -e .`"
        raise NoCloneError(f"{package}: {wanted}")
    return root


def workplace() -> Path:
    """Where runs, caches and logs are written: the checkout, else the working directory."""
    try:
        return project_root()
    except NoCloneError:
        return _began_in()


@cache
def _began_in() -> Path:
    """The working directory when this was first asked: a kernel has a home of its own later."""
    return Path.cwd()


def cache_folder() -> Path:
    """Return the folder of cached results: ``build/cache``, or a temporary one.

    Where ``build/cache`` cannot be written to, as in a checkout of somebody else's, a command and
    the processes that it starts share a folder that is removed when the command ends.
    """
    if _CACHE not in os.environ:
        folder = workplace() / "build" / "cache"
        there = next(place for place in (folder, *folder.parents) if os.path.lexists(place))
        if there.is_dir() and os.access(there, os.W_OK | os.X_OK):
            return folder
        own = Path(tempfile.mkdtemp(prefix="thesis-cache-"))
        _held.add(own)
        atexit.register(_let_go, own)
        os.environ[_CACHE] = str(own)
    return Path(os.environ[_CACHE])


def library_files() -> list[Path]:
    """Files that every result depends on: the thesis's facts, the lock, the library.

    Their order is the same in a checkout and in an installed package.
    """
    package, root = Path(__file__).parent, shipped()
    files = [p for p in package.rglob("*") if p.is_file() and p.suffix != ".pyc"]
    files = [p for p in files if not {"__pycache__", _SHIPPED} & {*p.relative_to(package).parts}]
    facts = (root / "data" / "thesis").iterdir()
    return [*sorted(facts), root / "requirements" / "book.txt", *sorted(files)]


@cache
def library_digest() -> str:
    """SHA-256 of the library's files as they were when this was first asked."""
    return digest_of(library_files())


def digest_of(paths: Iterable[Path]) -> str:
    """SHA-256 of files and folders by name and content; what is missing counts as missing."""
    total = hashlib.sha256()
    for path in paths:
        total.update(f"{path.name} {sha256(path)}\n".encode())
    return total.hexdigest()


def code(path: Path) -> bytes:
    """What of a file can change a result: of Python no comments, docstrings and blank lines."""
    return path.read_bytes() if path.suffix != ".py" else _read(path, _as_it_is(path))[0]


def imports(path: Path) -> list[ast.Import | ast.ImportFrom]:
    """All imports of a Python file, those inside functions included."""
    return _read(path, _as_it_is(path))[1]


def _as_it_is(path: Path) -> tuple[int, ...]:
    now = path.stat()
    return now.st_ino, now.st_size, now.st_mtime_ns, now.st_ctime_ns


_PARSING = threading.Lock()  # CPython 3.11 counts the depths of all threads' trees as one


@cache
def _read(
    path: Path, _as_it_is: tuple[int, ...]
) -> tuple[bytes, list[ast.Import | ast.ImportFrom]]:
    """Code and imports of a Python file, which is parsed once for both."""
    text, found = path.read_text(encoding="utf-8"), []
    lines = _STRING_OR_COMMENT.sub(lambda one: one[1] or "", text).splitlines()
    with _PARSING:
        tree = ast.parse(text)
    for node in statements([tree]):
        if isinstance(node, ast.Import | ast.ImportFrom):
            found.append(node)
        body = getattr(node, "body", None)
        first = body[0] if isinstance(body, list) and body else None
        if isinstance(first, ast.Expr) and isinstance(getattr(first.value, "value", None), str):
            for row in range(first.lineno - 1, first.end_lineno or first.lineno):
                lines[row] = ""
    return "".join(f"{line.rstrip()}\n" for line in lines if line.strip()).encode(), found


def statements(nodes: Iterable[ast.AST]) -> Iterator[ast.AST]:
    """All statements, those inside others included."""
    for node in nodes:
        yield node
        for part in ("body", "orelse", "finalbody", "handlers", "cases"):
            inside = getattr(node, part, ())
            yield from statements(inside if isinstance(inside, list) else ())


def sha256(path: Path) -> str:
    """SHA-256 of a file, or of all files in a folder; empty if there is neither.

    Content is read anew unless the file has been read before by this process and its size, times
    and inode are what they were.
    """
    try:
        if path.is_dir():
            inside = sorted(p for p in path.rglob("*") if p.is_file())
            lines = [f"{p.relative_to(path).as_posix()} {sha256(p)}\n" for p in inside]
            return hashlib.sha256("".join(lines).encode()).hexdigest()
        now = path.stat()
        return _sha256(path, (now.st_ino, now.st_size, now.st_mtime_ns, now.st_ctime_ns))
    except (FileNotFoundError, NotADirectoryError):
        return ""


@cache
def _sha256(path: Path, _as_it_is: tuple[int, ...]) -> str:
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def whole_file(path: Path, write: Callable[[Path], object]) -> None:
    """Let `write` fill a temporary file beside `path`, then rename it: never a half-written one."""
    with staging(path.parent) as folder:
        temporary = folder / path.name
        write(temporary)
        temporary.replace(path)


def whole_text(path: Path, text: str) -> None:
    """Write a text file (UTF-8), whole or not at all."""
    whole_file(path, lambda part: part.write_text(text, encoding="utf-8"))


@contextlib.contextmanager
def staging(folder: Path) -> Iterator[Path]:
    """An empty folder inside `folder` to write in, which is removed in the end.

    Beside it is a file that its process has locked. What has the name of such a folder and no lock
    was left by a process that was killed, and is removed.
    """
    folder.mkdir(parents=True, exist_ok=True)
    sweep(folder)
    lock = None
    while lock is None:  # another process may sweep the folder just before it is locked
        path = Path(tempfile.mkdtemp(prefix=_STAGING, dir=folder))
        _held.add(path)
        try:
            lock = _locked(path, wait=True)
        finally:
            if lock is None:
                _let_go(path)
    try:
        inside = path / "new"
        inside.mkdir()
        yield inside
    finally:
        _let_go(path)
        os.close(lock)


@contextlib.contextmanager
def one_at_a_time(folder: Path) -> Iterator[None]:
    """Let no other process be here for the same folder, on disks that have locks."""
    if sys.platform == "win32":
        yield
        return
    import fcntl

    place = os.open(folder, os.O_RDONLY)
    try:
        with contextlib.suppress(OSError):
            fcntl.flock(place, fcntl.LOCK_EX)
        yield
    finally:
        os.close(place)


def sweep(*folders: Path) -> None:
    """Remove the staging folders in some folders that killed processes left."""
    if sys.platform == "win32":
        return  # where nothing is locked in this way
    for folder in folders:
        for left in folder.glob(f"{_STAGING}*"):
            if not _NAME.fullmatch(left.name) or left.is_symlink() or not left.is_dir():
                continue  # none of ours
            with contextlib.suppress(OSError):
                if not (left / _LOCK).is_file():  # killed before it was locked, or none of ours
                    left.rmdir()  # if it is empty
                    continue
                lock = _locked(left, wait=False)
                if lock is not None:
                    _remove(left)
                    os.close(lock)


def let_go() -> None:
    """Remove the staging folders of this process, which is about to end without unwinding."""
    for path in list(_held):
        _let_go(path)


def _let_go(path: Path) -> None:
    _remove(path)
    _held.discard(path)


def _remove(folder: Path) -> None:
    for _ in range(5):  # a kernel whose runner was killed writes for a second more
        shutil.rmtree(folder, ignore_errors=True)
        if not folder.exists():
            return
        time.sleep(0.2)


def _locked(folder: Path, wait: bool) -> int | None:
    """The lock of a staging folder, an open file; None if another holds it, or it has gone.

    Raises
    ------
    OSError
        If the folder may not be written to, or cannot be locked and nobody waits for it.
    """
    if sys.platform == "win32":
        return os.open(folder / _LOCK, os.O_RDWR | os.O_CREAT)
    import fcntl

    try:
        lock = os.open(folder / _LOCK, os.O_RDWR | os.O_CREAT, 0o600)
    except FileNotFoundError:
        return None
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
        if os.path.samestat(os.fstat(lock), (folder / _LOCK).stat()):
            return lock
    except (FileNotFoundError, BlockingIOError):
        pass
    except OSError:  # a disk without locks: what is there is never swept
        if wait:
            return lock
    os.close(lock)
    return None
