"""Whether other processors give the same: ``python tests/cpus.py``, or ``make test-cpus``.

Numerical libraries choose among their kernels by what the processor can do. Environment variables
let them choose as on others: with each of these the tests and the notebooks must pass, and the
cubes of all figure sets must be those of this processor, which are made twice. Everything is run
in copies of the project, where nothing has been computed or filmed before.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import xarray as xr

PROJECT = Path(__file__).parents[1]
CPUS = {
    "this": {},
    "AVX2": {"OPENBLAS_CORETYPE": "Haswell", "NPY_DISABLE_CPU_FEATURES": "X86_V4,AVX512_ICL"},
    "SSE3": {
        "OPENBLAS_CORETYPE": "Prescott",
        "NPY_DISABLE_CPU_FEATURES": "X86_V3,X86_V4,AVX512_ICL",
        "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA,-AVX512F,-FMA4,-AVX",
        "OPENCV_CPU_DISABLE": "AVX2,FMA3,FP16,AVX,SSE4.2,SSE4.1",
        "NUMBA_CPU_NAME": "generic",
    },
}
MADE = {".venv", "build", "runs", "book/executed", "data/results"}
STEPS = ("tests", "notebooks", "cubes")
PYTEST = ("-m", "pytest", "-q", "-n", "2", "--dist", "loadfile")
BOUND = 1e-9  # of the largest value of a variable
DRAWN = 2.0**-13  # of those in single precision, which are drawn, and stored to 14 bits
_CUBES = """
import sys
from thesis_lib.notebook.show import study

for name in sys.argv[2:]:
    study(name, {"cube": f"{sys.argv[1]}/{name}.nc"})
"""


def main() -> int:
    """Run what is asked for; the exit status is 1 if anything differs or fails."""
    from thesis_lib.figure_sets.registry import STUDIES

    # the ledger judges the others' cubes, which are made by then
    every = [name for name in STUDIES if name != "claims"] + ["claims"]
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--steps", nargs="+", choices=STEPS, default=STEPS)
    parser.add_argument("--cpus", nargs="+", choices=list(CPUS)[1:], default=list(CPUS)[1:])
    parser.add_argument("--sets", nargs="+", choices=every, default=every, metavar="FIGURE_SET")
    given = parser.parse_args()
    failed = []
    for cpu in given.cpus:
        here = copy(cpu)
        if "tests" in given.steps and run(
            here, cpu, *PYTEST, "-m", "not (book or nightly)", "tests"
        ):
            failed.append(f"{cpu}: tests")
        notebooks = [f"notebooks/{name}.ipynb" for name in given.sets]
        if "notebooks" in given.steps and run(here, cpu, *PYTEST, "--nbval", *notebooks):
            failed.append(f"{cpu}: notebooks")
    if "cubes" in given.steps:
        failed += compared(given.cpus, given.sets)
    print(*(failed or [f"the same on {', '.join(given.cpus)}"]), sep="\n")
    return bool(failed)


def copy(name: str) -> Path:
    """A copy of the project without anything that it has made."""
    folder = PROJECT / "build" / "cpus" / name.replace(" ", "-")

    def made(where: str, names: list[str]) -> list[str]:
        here = Path(where).relative_to(PROJECT)
        return [one for one in names if one == "__pycache__" or (here / one).as_posix() in MADE]

    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(PROJECT, folder, ignore=made, symlinks=True)
    return folder


def run(folder: Path, cpu: str, *words: str) -> int:
    """Run Python in a copy as if on a processor; returns the exit status."""
    print(f"{cpu}: {' '.join(word.strip().partition(chr(10))[0] for word in words)}", flush=True)
    own = {"PYTHONPATH": str(folder / "src"), "OPENBLAS_NUM_THREADS": "1"}
    environment = {**os.environ, **own, **CPUS[cpu]}
    return subprocess.run([sys.executable, *words], cwd=folder, env=environment).returncode


def compared(cpus: list[str], sets: list[str]) -> list[str]:
    """Make all cubes on every processor, on this one twice; what differs by more than it may."""
    made = {}
    for name, cpu in {"this": "this", "this again": "this", **{cpu: cpu for cpu in cpus}}.items():
        folder = copy(f"cubes {name}")
        made[name] = folder / "data" / "results"
        made[name].mkdir()
        if run(folder, cpu, "-c", _CUBES, str(made[name]), *sets):
            return [f"{name}: not all cubes could be made"]
    failed = []
    for one in sets:
        for name in list(made)[1:]:
            found = differences(*(made[who] / f"{one}.nc" for who in ("this", name)))
            far = {v: d for v, (d, bound) in found.items() if d > bound * (name != "this again")}
            exact = {v: d for v, (d, bound) in found.items() if bound != DRAWN}
            worst = max(exact, key=exact.__getitem__)
            print(f"{one}, {name}: {exact[worst]:.1e} of the peak ({worst})", flush=True)
            failed += [f"{one}, {name}: {v} differs by {d:.1e} of its peak" for v, d in far.items()]
    return failed


def differences(one: Path, other: Path, bound: float = BOUND) -> dict[str, tuple[float, float]]:
    """How far each variable of two cubes differs, over its peak, and how far it may."""
    with xr.open_dataset(one) as a, xr.open_dataset(other) as b:
        names = sorted(map(str, {*a.variables, *b.variables}))
        both = {name for name in names if name in a.variables and name in b.variables}
        return {
            n: (apart(a[n].values, b[n].values), DRAWN if a[n].dtype == np.float32 else bound)
            if n in both
            else (np.inf, bound)
            for n in names
        }


def apart(x: np.ndarray, y: np.ndarray) -> float:
    """Largest difference over the largest value; infinite if more than numbers differ."""
    if x.shape != y.shape or x.dtype != y.dtype:
        return np.inf
    if x.dtype.kind != "f":
        return 0.0 if np.array_equal(x, y) else np.inf
    known = np.isfinite(x)
    if not np.array_equal(x[~known], y[~known], equal_nan=True):
        return np.inf
    difference = np.max(np.abs(x[known].astype(float) - y[known]), initial=0.0)
    return float(difference / np.max(np.abs(x[known]))) if difference else 0.0


if __name__ == "__main__":
    sys.exit(main())
