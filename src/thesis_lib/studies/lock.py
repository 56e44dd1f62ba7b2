"""Comparison of the installed packages with those of the lock."""

from __future__ import annotations

import re
from contextlib import suppress
from functools import cache
from importlib.metadata import PackageNotFoundError, version

from thesis_lib.files import shipped

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
