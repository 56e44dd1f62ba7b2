"""Cubes that are kept for later: believed only while they are what was written.

Beside a kept file stands its digest. A file without it, or that has another, was cut, edited or
copied there by hand: it is named, and computed anew.
"""

from __future__ import annotations

from pathlib import Path

import xarray as xr

from thesis_lib.asides import aside
from thesis_lib.files import sha256, whole_text
from thesis_lib.storage import CubeError, opened


def _digest(path: Path) -> Path:
    return path.with_name(f".{path.name}.sha256")


def read(path: Path) -> xr.Dataset | None:
    """What was kept in a file; None if nothing was, or if it is damaged, which is told."""
    if not path.exists():
        return None
    try:
        if _digest(path).read_text(encoding="ascii").strip() == sha256(path):
            return opened(path)
    except (OSError, ValueError, CubeError):
        pass
    aside(f"{path} is not what was kept there; it is computed anew")
    return None


def keep(path: Path) -> None:
    """From now on believe what has been written to a file."""
    whole_text(_digest(path), f"{sha256(path)}\n")
