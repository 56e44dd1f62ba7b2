"""What commands give out: lines, status messages, and files in no other file's place.

Lines and JSON go to standard output, status messages to standard error; none of it changes a
result. A folder of results holds a record, :data:`RECORD_NAME`, of the digests of all that commands
wrote there. A file that is not in it is the user's: the command refuses to replace it. One that is
in it and has been edited since is kept beside, under another name.
"""

from __future__ import annotations

import itertools
import json
import os
import re
import shutil
import sys
import threading
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import click

from thesis_lib.files import only_command, sha256, whole_text
from thesis_lib.text import has_hidden, message, one_line, visible

QUIET_VARIABLE = "THESIS_QUIET"
"""Set in the environment of kernels, whose standard error would be an output of the notebook."""
JSON_OPTION = click.option("--json", "as_json", is_flag=True, help="Print one JSON document.")
_VERDICT_COLOURS = {"agrees": "green", "within scatter": "yellow", "differs": "red"}
_VERDICT_PATTERN = re.compile("|".join(_VERDICT_COLOURS))


def aside(text: str) -> None:
    """Write one line on standard error, but not in a notebook's kernel, where it is output."""
    if QUIET_VARIABLE not in os.environ:
        say(message(text))


def echo(*lines: str, err: bool = False, verdicts: bool = False, colour: str = "") -> None:
    """Print lines on standard output, or on standard error.

    On a screen, unless NO_COLOR is set, verdicts are coloured if asked for, or whole lines are.
    Names of files are anybody's: what could act on a screen is written out, a line feed too.
    """
    on_screen = not err and sys.stdout.isatty() and not os.environ.get("NO_COLOR")
    for line in map(visible, lines):
        shown = _VERDICT_PATTERN.sub(_colour_verdict, line) if verdicts and on_screen else line
        click.echo(click.style(shown, fg=colour) if colour and on_screen else shown, err=err)


def _colour_verdict(found: re.Match[str]) -> str:
    return click.style(found[0], fg=_VERDICT_COLOURS[found[0]])


def print_json(value: Any) -> None:
    """Print a value as one JSON document on standard output; what is not finite is null."""
    from pydantic_core import to_jsonable_python

    plain = to_jsonable_python(value, inf_nan_mode="null", fallback=lambda one: one.tolist())
    click.echo(json.dumps(plain, ensure_ascii=False, indent=1))


def live() -> bool:
    """Return whether standard error is a screen, on which a line can be written over."""
    return not sys.stderr.closed and sys.stderr.isatty()


def say(line: str, passing: bool = False) -> None:
    """Write a line on standard error; on a screen over a passing one, which the next replaces."""
    if live():
        width = shutil.get_terminal_size().columns - 1
        line = f"\r\x1b[K{line[:width] if passing else line}"
    sys.stderr.write(line if passing else f"{line}\n")
    sys.stderr.flush()


RECORD_NAME = ".written.json"
CACHE_TAG = "CACHEDIR.TAG"  # https://bford.info/cachedir: backups leave such a folder out
_THREAD_LOCK = threading.Lock()  # a lock of a folder keeps out other processes, not threads
_TAG_TEXT = "Signature: 8a477f597d28d172789f06886806bc55\n# A cache of thesis_lib\n"


class OutputError(RuntimeError):
    """An output that would replace a file of the user's; the message is one line."""


def check_outputs(folder: Path, files: Iterable[Path], inputs: Iterable[Path] = ()) -> None:
    """Refuse, before anything is computed, to replace files of the user's.

    Parameters
    ----------
    folder : Path
        Where the command writes.
    files : iterable of Path
        What it will write there, or what matches it.
    inputs : iterable of Path
        Files and folders that it reads, which it never replaces, no matter who wrote them.

    Raises
    ------
    OutputError
        With the first file that is there and that no record proves to be the command's own.
    """
    record = _read_record(folder)
    given = [path.resolve() for path in inputs]
    for file in files:
        if any(map(file.resolve().is_relative_to, given)):
            raise OutputError(f"{file}: is read by this command, allowed: another place to write")
        if os.path.lexists(file) and file.relative_to(folder).as_posix() not in record:
            raise OutputError(
                f"{file}: is there already and would be overwritten; move it away, or write "
                "elsewhere"
            )


def check_file(file: Path, ending: str) -> None:
    """Refuse to write a file that is there, or whose name has another ending or hides something.

    Raises
    ------
    OutputError
        In one line.
    """
    if file.suffix.lower() != ending:
        given = one_line(str(file) if file.name else "")
        raise OutputError(f"given the file {given!r}, allowed: one that ends in {ending}")
    if has_hidden(file.name):
        raise OutputError(f"given the file {file.name!r}, allowed: a visible name")
    check_outputs(file.parent, [file])


def put_files(part: Path, folder: Path) -> None:
    """Move all files of a folder of staging into another, in place of the command's own.

    Raises
    ------
    OutputError
        As :func:`check_outputs`; then nothing has been moved.
    """
    found = [path for path in sorted(part.rglob("*")) if path.is_file()]
    names = [path.relative_to(part).as_posix() for path in found]
    with _THREAD_LOCK, only_command(folder, wait=True):
        check_outputs(folder, [folder / name for name in names])
        record = dict(_read_record(folder))
        for name in names:  # what is there, too: a kill may come before it is replaced
            there = {sha256(folder / name)} & {*record.get(name, [])}
            record[name] = [*there, sha256(part / name)]
        whole_text(folder / RECORD_NAME, json.dumps({"thesis_lib": record}, indent=1) + "\n")
        for name in names:
            file = folder / name
            if os.path.lexists(file) and (file.is_symlink() or sha256(file) not in record[name]):
                _set_aside(file)
            file.parent.mkdir(parents=True, exist_ok=True)
            (part / name).replace(file)


def check_cache(folder: Path) -> None:
    """Refuse a folder for intermediate results that is there and none of ours.

    Raises
    ------
    OutputError
        In one line.
    """
    tag = folder / CACHE_TAG
    if tag.is_file() and tag.read_bytes() == _TAG_TEXT.encode():
        return
    if os.path.lexists(folder) and not (folder.is_dir() and not any(folder.iterdir())):
        raise OutputError(
            f"{folder}: is there already, and no cache of this command; move it away, or write "
            "elsewhere"
        )


def mark_cache(folder: Path) -> None:
    """Make a folder for intermediate results, which are replaced and removed at will."""
    folder.mkdir(parents=True, exist_ok=True)
    if not (folder / CACHE_TAG).is_file():
        whole_text(folder / CACHE_TAG, _TAG_TEXT)


def _set_aside(file: Path) -> None:
    """Rename a result that has been edited since it was written, and say so."""
    names = (file.with_stem(f"{file.stem}.{k}") for k in itertools.count(1))
    kept = next(name for name in names if not os.path.lexists(name))
    file.rename(kept)
    aside(f"{file} has changed since it was written; it is kept as {kept.name}")


def _read_record(folder: Path) -> Mapping[str, list[str]]:
    """Return the digests of each file that commands wrote into a folder, by its name there."""
    path = folder / RECORD_NAME
    if not os.path.lexists(path):
        return {}
    try:
        record = json.loads(path.read_text(encoding="utf-8"))["thesis_lib"]
        return {str(name): [str(digest) for digest in all_] for name, all_ in record.items()}
    except (OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError):
        raise OutputError(
            f"{path}: no record of what was written there; move it away, or write elsewhere"
        ) from None
