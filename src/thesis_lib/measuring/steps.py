"""Steps that are kept: a measurement that was stopped goes on after what it has done.

A step's result stands in a file that carries the key of all that it depends on: parts of the
manifest, the recordings by name, size and time, and the library itself.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import xarray as xr

from thesis_lib import kept as kept_cubes
from thesis_lib import storage
from thesis_lib.files import library_digest


def key_of(values: Any, files: Iterable[Path] = ()) -> str:
    """Key of a step that depends on JSON values and on files.

    Files count by name, size and time of change: reading gigabytes would take as long as the step.
    """
    stamps = [[file.name, file.stat().st_size, file.stat().st_mtime_ns] for file in files]
    text = json.dumps([values, stamps, library_digest()])
    return hashlib.sha256(text.encode()).hexdigest()[:32]


def kept(folder: Path, name: str, key: str, compute: Callable[[], xr.Dataset]) -> xr.Dataset:
    """The step's result: from its file if that has the key, else computed and written."""
    path = folder / f"{name}.nc"
    data = kept_cubes.read(path)
    if data is None or data.attrs.get("key") != key:
        data = compute().assign_attrs(key=key)
        storage.write(data, path)
        kept_cubes.keep(path)
    return data
