"""Whether the locks install from wheels alone on every platform and Python that README promises.

Asks uv, and uv the registry, for each combination; nothing is installed. `make platforms` does it.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

ROOT = Path(__file__).parents[1]
UV = Path(sys.executable).with_name("uv")
LOCKS = (
    "requirements/uv.txt",
    "requirements/book.txt",
    "requirements.lock",
    "requirements/scale.txt",
    "requirements/npm.txt",
)
PYTHONS = ("3.11", "3.12", "3.13", "3.14")
PLATFORMS = {  # uv's name, and the oldest macOS
    "Linux, x86-64": ("x86_64-manylinux_2_28", ""),
    "Linux, ARM": ("aarch64-manylinux_2_28", ""),
    "Windows, x86-64": ("x86_64-pc-windows-msvc", ""),
    "macOS 13, ARM": ("aarch64-apple-darwin", "13.0"),
    "macOS 13, Intel": ("x86_64-apple-darwin", "13.0"),
}


def missing(lock: str, platform: str, python: str) -> list[str]:
    """Return packages of a lock that have no wheel there.

    Raises
    ------
    SystemExit
        If uv gives no answer, with its last words.
    """
    target, macos = PLATFORMS[platform]
    left, lacking = (ROOT / lock).read_text(encoding="utf-8"), []
    with tempfile.TemporaryDirectory() as folder:
        asked = Path(folder) / "asked.txt"
        command = [
            str(UV), "pip", "install", "--dry-run", "--no-deps", "--require-hashes",
            "--only-binary", ":all:", "--python-platform", target, "--python-version", python,
            "--python", sys.executable, "--target", folder, "-r", str(asked),
        ]  # fmt: skip
        env = os.environ | {"UV_PYTHON_DOWNLOADS": "never", "MACOSX_DEPLOYMENT_TARGET": macos}
        while True:
            asked.write_text(left, encoding="utf-8")
            done = subprocess.run(command, env=env, capture_output=True, text=True, check=False)
            if done.returncode == 0:
                return lacking
            named = re.search(r"Because ([\w.-]+)==\S+ has no", done.stderr)
            if named is None:
                raise SystemExit(f"uv: {' '.join(done.stderr.split())[-400:]}")
            lacking.append(named[1])
            left = re.sub(rf"^{re.escape(named[1])}==(?:.*\\\n)*.*\n", "", left, flags=re.MULTILINE)


def rows() -> Iterator[tuple[str, str, list[str]]]:
    """Lock, platform, and for each Python what is missing there, or ``all``."""
    asked = [(lock, platform) for lock in LOCKS for platform in PLATFORMS]
    with ThreadPoolExecutor(4) as pool:
        found = [[pool.submit(missing, *one, python) for python in PYTHONS] for one in asked]
        for (lock, platform), answers in zip(asked, found, strict=True):
            yield lock, platform, [" ".join(one.result()) or "all" for one in answers]


def main() -> int:
    """Print the table; 1 if a wheel is missing anywhere."""
    form = "{:24}{:18}" + "{:10}" * len(PYTHONS)
    print(form.format("lock", "platform", *PYTHONS))
    whole = True
    for lock, platform, cells in rows():
        print(form.format(lock, platform, *cells), flush=True)
        whole &= set(cells) == {"all"}
    return 0 if whole else 1


if __name__ == "__main__":
    raise SystemExit(main())
