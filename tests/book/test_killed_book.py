"""A book and a run killed in earnest, kernels included: hours, so `make test-nightly` alone."""

from __future__ import annotations

import os
import random
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import xarray as xr
from small_book import MAKE, make

from thesis_lib.studies.attributes import RUN_DEPENDENT

pytest.importorskip("jupyter_book", reason="the book needs jupyter-book")
pytestmark = [pytest.mark.nightly, pytest.mark.skipif(sys.platform == "win32", reason="kills")]
MOMENTS = 50
IN_A_ROW = 5  # books killed one after another, before one is made whole


def left_over(root: Path) -> list[str]:
    """What a killed process leaves, anywhere in a project."""
    return [str(path.relative_to(root)) for path in root.rglob(".staging-*")]


def numbers(folder: Path) -> dict[str, xr.Dataset]:
    found = {}
    for path in sorted(folder.glob("*.nc")):
        with xr.open_dataset(path) as cube:
            found[path.stem] = cube.load()
        for name in RUN_DEPENDENT:
            del found[path.stem].attrs[name]
    return found


def killed(command: list[str], cwd: Path, environment: dict[str, str], after: float) -> bool:
    """Start a command and kill it after some seconds; whether it was still at work."""
    process = subprocess.Popen(
        command, cwd=cwd, env=environment, stdin=-3, stdout=-3, stderr=-3, start_new_session=True
    )
    try:
        process.wait(timeout=after)
    except subprocess.TimeoutExpired:
        os.kill(process.pid, signal.SIGKILL)
        process.wait()
        return True
    return False


def test_book_killed_at_random_moments_is_made_whole_by_the_next_call(small):
    command, root = [sys.executable, "-c", MAKE], small.root
    done = make(small)
    assert done.returncode == 0, done.stderr
    wanted = numbers(root / "data" / "results")
    pages = sorted(p.relative_to(root) for p in (root / "build" / "html").rglob("*.html"))
    begin = time.monotonic()
    for number in range(MOMENTS + 1):
        with (root / "src" / "thesis_lib" / "vision" / "rounding.py").open("a") as stream:
            stream.write(f"_n = {number}\n")  # all sets are stale
        if number == 0:
            done = make(small)
            assert all(f"{name}: done in" in done.stderr for name in wanted), done.stderr
            takes = time.monotonic() - begin
            continue
        killed(command, root, small.environment, random.Random(number).uniform(0, takes))
        if number % IN_A_ROW:
            continue
        done = make(small)
        assert done.returncode == 0, done.stderr
        assert left_over(root) == []
        made = numbers(root / "data" / "results")
        assert made.keys() == wanted.keys()
        for name, cube in wanted.items():
            xr.testing.assert_equal(made[name], cube)
        assert pages == sorted(p.relative_to(root) for p in (root / "build/html").rglob("*.html"))


def test_run_killed_at_random_moments_is_made_whole_by_the_next_call(checkout, tmp_path):
    run = ["-m", "thesis_lib", "run", "beam-distance", "-p", "trials=2", "-p", "modes=[1]", "--out"]
    begin = time.monotonic()
    done = checkout.python(*run, tmp_path / "peace", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    takes = time.monotonic() - begin
    wanted = numbers(tmp_path / "peace")["beam-distance"]
    for number in range(MOMENTS):
        shutil.rmtree(checkout.root / "build", ignore_errors=True)
        out = tmp_path / f"{number}"
        after = random.Random(number).uniform(0, takes)
        command = [sys.executable, *run, str(out)]
        killed(command, tmp_path, checkout.environment, after)
        done = checkout.python(*run, out, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        assert numbers(out)["beam-distance"].identical(wanted)
        assert left_over(out) == left_over(checkout.root) == []
