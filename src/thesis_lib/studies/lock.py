"""Whether the packages that results rest on are those of the lock."""

from __future__ import annotations

import re
from importlib.metadata import PackageNotFoundError, version

from thesis_lib.files import shipped

PACKAGES = ("numpy", "scipy", "scikit-fem", "xarray", "pandas", "opencv-python-headless", "av")


def differing_packages() -> list[str]:
    """Return what is installed in another version than the lock has, in words."""
    lock = (shipped() / "requirements" / "book.txt").read_text(encoding="utf-8")
    pins = re.findall(r"^([\w.-]+)==([^\s;]+)", lock, re.MULTILINE)  # one for each Python
    found = []
    for name in PACKAGES:
        try:
            here = version(name)
        except PackageNotFoundError:
            continue
        locked = [pin for package, pin in pins if package == name]
        if locked and here not in locked:
            found.append(f"{name} {here} is installed, the lock has {' or '.join(locked)}")
    return found
