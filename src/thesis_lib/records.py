"""Records: what something was made from and what was made, so that neither is believed blindly.

A task is up to date only if the digest of all that it depends on is that of its record, and the
digests of all its files, too. A figure set's record travels in its executed notebook, others are
files of their own; a record is written last, so a run that was stopped leaves none that fits.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from thesis_lib.files import sha256, whole_text

_KEY = "thesis_lib"  # in a notebook's metadata


@dataclass(frozen=True)
class Record:
    """Digests of one run of a task."""

    made_from: str  #: Of all that it depends on: request, code, inputs
    #: Of each file that it has made, by name, in a folder with the folder's before it; of the
    #: notebook that holds the record, of all but the record
    made: Mapping[str, str]


def read(path: Path) -> Record | None:
    """The record in a file, or in a notebook; None if there is none that can be read."""
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
        kept = document["metadata"][_KEY]["record"] if "cells" in document else document
        return Record(str(kept["made_from"]), {str(k): str(v) for k, v in kept["made"].items()})
    except (OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError):
        return None


def write(path: Path, made_from: str, made: Iterable[Path]) -> None:
    """Record in a file of its own what was made."""
    record = Record(made_from, {name: digest for one in made for name, digest in _files(one)})
    whole_text(path, json.dumps(asdict(record), indent=1) + "\n")


def _files(path: Path) -> Iterator[tuple[str, str]]:
    """A file, or every file of a folder, by name from the folder's on, with its digest."""
    inside = sorted(p for p in path.rglob("*") if p.is_file()) if path.is_dir() else [path]
    for one in inside:
        yield one.relative_to(path.parent).as_posix(), sha256(one)


def seal(document: dict[str, Any], name: str, made_from: str, made: Mapping[str, Path]) -> str:
    """An executed notebook with its record, which is put into it, as the text of its file `name`.

    `made_from` is the digest of all that it was made from, `made` what else was made, by the names
    it will have.
    """
    digests = {there: sha256(file) for there, file in made.items()}
    record = Record(made_from, digests | {name: _of_notebook(document)})
    document["metadata"].setdefault(_KEY, {})["record"] = asdict(record)
    return json.dumps(document, indent=1, ensure_ascii=False, sort_keys=True) + "\n"


def _of_notebook(document: Mapping[str, Any]) -> str:
    """Digest of a notebook without the record that it carries."""
    metadata = dict(document["metadata"])
    metadata[_KEY] = {k: v for k, v in metadata.get(_KEY, {}).items() if k != "record"}
    text = json.dumps({**document, "metadata": metadata}, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


def damage(path: Path, made: Iterable[Path]) -> str:
    """What is not as the record says: the first such file and what is wrong; empty if all is."""
    record = read(path)
    if record is None:
        return f"{path} holds no record of a run" if path.exists() else ""
    for one in made:
        found = dict(_files(one))
        if one == path:
            found[one.name] = _of_notebook(json.loads(one.read_text(encoding="utf-8")))
        begin = f"{one.name}/"
        expected = {n: d for n, d in record.made.items() if n == one.name or n.startswith(begin)}
        for name in sorted({*found, *expected}):
            if not found.get(name):
                return f"{one.parent / name} is missing"
            if found[name] != expected.get(name):
                return f"{one.parent / name} is not what was made"
        if not found:
            return f"{one} is missing"
    return ""
