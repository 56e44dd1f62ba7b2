"""Cubes that are cached for later: believed only while they are what was written.

Next to a cached file stands its digest. A file without it, or that has another, was cut, edited or
copied there by hand: it is named, and computed again. What other packages computed has other keys.
"""

from __future__ import annotations

import hashlib
import json
import re
import time
from collections.abc import Callable, Iterable
from contextlib import suppress
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import xarray as xr

from thesis_lib.files import (
    cache_folder,
    digest_of,
    library_digest,
    library_files,
    sha256,
    shipped,
    whole_text,
)
from thesis_lib.studies.request import Study
from thesis_lib.studies.schema import with_provenance
from thesis_lib.studies.storage import CubeError, open_netcdf, write_netcdf
from thesis_lib.text import aside

# Not numba, which the book does without: with it, results are the same up to rounding.
RESULT_PACKAGES = (
    "numpy", "scipy", "scikit-fem", "xarray", "pandas", "h5py", "opencv-python-headless", "av",
)  # fmt: skip


@cache
def package_versions() -> dict[str, str]:
    """Return the versions of the packages that results are computed with, of those installed."""
    found = {}
    for name in RESULT_PACKAGES:
        with suppress(PackageNotFoundError):
            found[name] = version(name)
    return found


def differing_packages() -> list[str]:
    """Return what is installed in another version than the lock has, in words."""
    lock = (shipped() / "requirements" / "book.txt").read_text(encoding="utf-8")
    pins = re.findall(r"^([\w.-]+)==([^\s;]+)", lock, re.MULTILINE)  # one for each Python
    return [
        f"{name} {here} is installed, the lock has {' or '.join(locked)}"
        for name, here in package_versions().items()
        if (locked := [pin for package, pin in pins if package == name]) and here not in locked
    ]


def _digest(path: Path) -> Path:
    return path.with_name(f".{path.name}.sha256")


def read_cache(path: Path) -> xr.Dataset | None:
    """Return the dataset cached in a file; None if there is none, or it is damaged (a warning)."""
    if not path.exists():
        return None
    try:
        if _digest(path).read_text(encoding="ascii").strip() == sha256(path):
            return open_netcdf(path)
    except (OSError, ValueError, CubeError):
        pass
    aside(f"{path} is not what was stored there; it is computed again")
    return None


def trust_file(path: Path) -> None:
    """Trust from now on what has been written to a file."""
    whole_text(_digest(path), f"{sha256(path)}\n")


def load_or_compute(path: Path, compute: Callable[[], xr.Dataset], key: str = "") -> xr.Dataset:
    """Return what a file holds, if it has the key; else compute, write and read it.

    Its attribute `run_time_s` says how long it took.
    """
    data = read_cache(path)
    if data is not None and data.attrs.get("key", "") == key:
        return data
    begun = time.perf_counter()
    cube = compute()
    cube = cube.assign_attrs(run_time_s=time.perf_counter() - begun)
    write_netcdf(cube.assign_attrs({"key": key} if key else {}), path)
    trust_file(path)
    return open_netcdf(path)


def cached_study(
    study: Study, compute: Callable[[Any], xr.Dataset], key: str = "", library: str = ""
) -> xr.Dataset:
    """Return a study's cube, computed once for its parameters and the code that it rests on.

    Notebooks that need the same cube share it through ``build/cache``.

    Parameters
    ----------
    study : Study
        What is asked for.
    compute : callable
        Makes it, from the study.
    key, library : str
        Digests of all that determines it besides the request, and of the code alone; empty if that
        is the whole library.
    """
    path = cache_path(study, key or digest_of(library_files()))
    cube = load_or_compute(path, lambda: compute(study))
    return with_provenance(cube, study, float(cube.attrs.pop("run_time_s")), library)


def cache_path(study: Study, key: str) -> Path:
    """Return the file of a study's cube, whose name tells what determines the cube."""
    name = hashlib.sha256(f"{study.name} {study.digest} {key}".encode()).hexdigest()[:16]
    return cache_folder() / f"{study.name}-{name}.nc"


def key_of(values: Any, files: Iterable[Path] = ()) -> str:
    """Return the key of a step that depends on JSON values and on the contents of files.

    A file's digest is remembered while its size, times and inode are the same; reading a gigabyte
    takes about a second, tracking it takes minutes.
    """
    stamps = [[file.name, sha256(file)] for file in files]
    text = json.dumps([values, stamps, library_digest(), package_versions()])
    return hashlib.sha256(text.encode()).hexdigest()[:32]
