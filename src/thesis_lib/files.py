"""Files: project folders, digests, atomic writes, and protection of a user's files.

No command overwrites a user's file. The record :data:`RECORD_NAME` in a folder of results holds the
digests of all files that commands wrote there. A command refuses to replace a file that is not in
the record. It renames, instead of replacing, one that is in the record and has been edited since.
"""

import atexit
import contextlib
import hashlib
import itertools
import json
import os
import shutil
import socket
import tempfile
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import cache
from pathlib import Path

from filelock import FileLock, Timeout

from thesis_lib.text import FailedError, RefusedError, has_hidden, one_line, print_status

_SHIPPED_FOLDER = "_project"  # the project files that a wheel contains
STAGING_PREFIX = ".staging-"
OWNER_RECORD = ".owner.json"  # in a staging folder: the host and process that write to it
LOCK_NAME = ".lock"
_temporary: set[Path] = set()  # folders of this process
_CACHE_VARIABLE = "THESIS_CACHE"  # replaces a cache folder that is not writable


class NoCloneError(RefusedError):
    """The request needs a clone of the project; the library is installed without one."""


def shipped() -> Path:
    """Return the folder of notebooks, facts, published values, recordings and the lock.

    This is the checkout or, if the library is installed without one, a folder in its package.
    """
    inside = Path(__file__).with_name(_SHIPPED_FOLDER)
    return inside if inside.is_dir() else inside.parents[2]


def project_root() -> Path:
    """Return the checkout that the library is installed from.

    Raises
    ------
    NoCloneError
        If the library was installed without its checkout.
    """
    root, package = shipped(), Path(__file__).parent
    if root.name == _SHIPPED_FOLDER:
        wanted = "this needs a clone of the project, installed with `pip install -e .`"
        raise NoCloneError(f"{package}: {wanted}")
    return root


def workplace() -> Path:
    """Return the folder of runs, caches and logs: the checkout, else the working directory."""
    root = shipped()
    return _start_folder() if root.name == _SHIPPED_FOLDER else root


@cache
def _start_folder() -> Path:
    """Return the working directory at the first call: a kernel gets a folder of its own later."""
    return Path.cwd()


def find_obstacle(folder: Path) -> Path | None:
    """Return the file or folder that prevents creating or writing to a folder, if any."""
    there = next(place for place in (folder, *folder.parents) if os.path.lexists(place))
    return None if there.is_dir() and os.access(there, os.W_OK | os.X_OK) else there


def cache_folder() -> Path:
    """Return the folder of cached results: ``build/cache``, or a temporary one.

    Where ``build/cache`` cannot be written to, as in another user's checkout, a command and
    the processes that it starts share a folder that is removed when the command ends.
    """
    folder = Path(os.environ.get(_CACHE_VARIABLE, workplace() / "build" / "cache"))
    if find_obstacle(folder):
        folder = Path(tempfile.mkdtemp(prefix="thesis-cache-"))
        _temporary.add(folder)
        atexit.register(remove_temporary)
        os.environ[_CACHE_VARIABLE] = str(folder)
    return folder


def library_files() -> list[Path]:
    """Return all files of the library, the thesis's facts, and the lock.

    Their order is the same in a checkout and in an installed package.
    """
    package, root = Path(__file__).parent, shipped()
    return [
        *sorted((root / "data" / "thesis").iterdir()),
        root / "requirements" / "book.txt",
        *folder_files([package]),
    ]


def folder_files(places: Iterable[Path]) -> list[Path]:
    """Return the given files and those in the given folders, without compiled Python files."""
    given = [*places]
    found = {*given}
    for place in given:
        for folder, below, names in os.walk(place):
            below[:] = {*below} - {"__pycache__", _SHIPPED_FOLDER}  # these are skipped
            found.update(Path(folder, name) for name in names)
    return sorted(path for path in found if path.is_file() and path.suffix != ".pyc")


@cache
def library_digest() -> str:
    """Return the SHA-256 of the library's files at the first call."""
    return digest_of(library_files())


def stat_file(path: Path) -> tuple[int, ...]:
    """Return inode, size and times of a file, one of which changes with its content."""
    now = path.stat()
    return now.st_ino, now.st_size, now.st_mtime_ns, now.st_ctime_ns


def digest_of(paths: Iterable[Path]) -> str:
    """Return one SHA-256 over names and contents of files; a missing file has an empty digest."""
    total = hashlib.sha256()
    for path in paths:
        total.update(f"{path.parent.name}/{path.name} {sha256(path)}\n".encode())
    return total.hexdigest()


def sha256(path: Path) -> str:
    """Return the SHA-256 of a file; empty if there is none.

    The digest is cached in this process while the file is the same by :func:`stat_file`.
    """
    try:
        return _sha256(path, stat_file(path))
    except (FileNotFoundError, NotADirectoryError):
        return ""


@cache
def _sha256(path: Path, _as_it_is: tuple[int, ...]) -> str:
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def whole_file(path: Path, write: Callable[[Path], object]) -> None:
    """Write a file atomically: `write` fills a temporary file, which is renamed to `path`."""
    with staging(path.parent) as folder:
        temporary = folder / path.name
        write(temporary)
        temporary.replace(path)


def whole_text(path: Path, text: str) -> None:
    """Write a text file (UTF-8) atomically, unless it already has this text."""
    content = text.encode()
    if not (path.is_file() and path.read_bytes() == content):
        whole_file(path, lambda part: part.write_bytes(content))


@contextlib.contextmanager
def staging(folder: Path) -> Iterator[Path]:
    """Provide an empty staging folder inside `folder`, which is removed at the end.

    Staging folders that killed commands left there are removed first.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for path in [*folder.glob(f"{STAGING_PREFIX}*")]:
        if _is_abandoned(path):
            shutil.rmtree(path, ignore_errors=True)
    path = Path(tempfile.mkdtemp(prefix=STAGING_PREFIX, dir=folder))
    _temporary.add(path)
    try:
        owner = {"thesis_lib": [socket.gethostname(), os.getpid()]}
        (path / OWNER_RECORD).write_text(json.dumps(owner), encoding="utf-8")
        work = path / "new"
        work.mkdir()
        yield work
    finally:
        shutil.rmtree(path, ignore_errors=True)
        _temporary.discard(path)


def _is_abandoned(path: Path) -> bool:
    """Return whether a staging folder's process, by its record, ran on this host and has ended."""
    try:
        record = json.loads((path / OWNER_RECORD).read_text(encoding="utf-8"))
        host, process = record["thesis_lib"]
        process = int(process)
    except (OSError, ValueError, LookupError, TypeError):
        return False
    import psutil

    return host == socket.gethostname() and not psutil.pid_exists(process)


def remove_temporary() -> None:
    """Remove the temporary folders of this process, which is about to end."""
    for folder in list(_temporary):
        shutil.rmtree(folder, ignore_errors=True)
        _temporary.discard(folder)


@contextlib.contextmanager
def lock_folder(folder: Path, wait: bool = False) -> Iterator[None]:
    """Lock a folder against other commands; if one holds the lock, wait or raise FailedError.

    The folder is created, and removed again if the command writes nothing there.
    """
    new = not folder.exists()
    folder.mkdir(parents=True, exist_ok=True)
    lock = FileLock(folder / LOCK_NAME, thread_local=False, is_singleton=True)
    try:
        lock.acquire(timeout=-1 if wait else 0)
    except Timeout:
        raise FailedError(
            f"{folder}: another command writes there; wait until it has ended, and run the same "
            "command again"
        ) from None
    try:
        yield
    finally:
        if lock.lock_counter == 1:  # a command that waits for the removed file creates a new one
            with contextlib.suppress(OSError):
                (folder / LOCK_NAME).unlink()
                if new:
                    folder.rmdir()  # refused unless it is empty
        lock.release()


RECORD_NAME = ".written.json"
CACHE_TAG = "CACHEDIR.TAG"  # https://bford.info/cachedir: backups skip such a folder
_THREAD_LOCK = threading.Lock()  # a folder's lock excludes other processes, not threads
_TAG_TEXT = "Signature: 8a477f597d28d172789f06886806bc55\n# A cache of thesis_lib\n"


_REMEDY = "move it away, or write elsewhere"


@contextlib.contextmanager
def name_failing_path(place: Path) -> Iterator[None]:
    """Add the file or folder to system errors that name none, such as that of a full disk."""
    try:
        yield
    except OSError as error:
        if error.filename:
            raise
        raise OSError(error.errno, error.strerror, str(place)) from error  # PyAV's accept no name


def check_outputs(folder: Path, files: Iterable[Path], inputs: Iterable[Path] = ()) -> None:
    """Refuse to replace files of the user's, before anything is computed.

    The command will write `files` into `folder`. It reads the files and folders `inputs`, which it
    never replaces, even if a command wrote them.

    Raises
    ------
    RefusedError
        For the first file that is an input, or that exists and is not in the record.
    """
    record = _read_record(folder)
    given = [path.resolve() for path in inputs]
    for file in files:
        if any(map(file.resolve().is_relative_to, given)):
            raise RefusedError(f"{file}: is read by this command, allowed: another place to write")
        if os.path.lexists(file) and file.relative_to(folder).as_posix() not in record:
            raise RefusedError(f"{file}: is there already and would be overwritten; {_REMEDY}")


def check_file(file: Path, ending: str) -> None:
    """Refuse a user's existing file, another extension, or hidden characters in the name."""
    if file.suffix.lower() != ending:
        given = one_line(str(file) if file.name else "")
        raise RefusedError(f"given the file {given!r}, allowed: one that ends in {ending}")
    if has_hidden(file.name):
        raise RefusedError(f"given the file {file.name!r}, allowed: a visible name")
    check_outputs(file.parent, [file])


def put_files(part: Path, folder: Path) -> None:
    """Move all files of a staging folder into another, replacing files that commands wrote.

    It raises the errors of :func:`check_outputs` before it moves any file.
    """
    found = [path for path in sorted(part.rglob("*")) if path.is_file()]
    names = [path.relative_to(part).as_posix() for path in found]
    with _THREAD_LOCK, lock_folder(folder, wait=True):
        check_outputs(folder, [folder / name for name in names])
        record = dict(_read_record(folder))
        for name in names:  # with the present digest: a kill may precede the replacement
            there = {sha256(folder / name)} & {*record.get(name, [])}
            record[name] = [*there, sha256(part / name)]
        whole_text(folder / RECORD_NAME, json.dumps({"thesis_lib": record}, indent=1) + "\n")
        for name in names:
            file = folder / name
            if os.path.lexists(file) and (file.is_symlink() or sha256(file) not in record[name]):
                others = (file.with_stem(f"{file.stem}.{k}") for k in itertools.count(1))
                kept = next(other for other in others if not os.path.lexists(other))
                file.rename(kept)
                print_status(f"{file} has changed since it was written; it is kept as {kept.name}")
            file.parent.mkdir(parents=True, exist_ok=True)
            (part / name).replace(file)


def check_cache(folder: Path) -> None:
    """Refuse an existing folder that is not a cache of this command."""
    tag = folder / CACHE_TAG
    if tag.is_file() and tag.read_bytes() == _TAG_TEXT.encode():
        return
    # A killed command may have left the staging folder of the tag.
    begun = folder.is_dir() and all(p.name.startswith(STAGING_PREFIX) for p in folder.iterdir())
    if os.path.lexists(folder) and not begun:
        raise RefusedError(f"{folder}: is there already, and no cache of this command; {_REMEDY}")


def mark_cache(folder: Path) -> None:
    """Create a cache folder and tag it; its files may be replaced and removed at any time."""
    folder.mkdir(parents=True, exist_ok=True)
    if not (folder / CACHE_TAG).is_file():
        whole_text(folder / CACHE_TAG, _TAG_TEXT)


def _read_record(folder: Path) -> Mapping[str, list[str]]:
    """Return the digests of each file that commands wrote into a folder, by file name."""
    path = folder / RECORD_NAME
    if not os.path.lexists(path):
        return {}
    try:
        record = json.loads(path.read_text(encoding="utf-8"))["thesis_lib"]
        return {str(name): [str(digest) for digest in all_] for name, all_ in record.items()}
    except (OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError):
        raise RefusedError(f"{path}: no record of what was written there; {_REMEDY}") from None
