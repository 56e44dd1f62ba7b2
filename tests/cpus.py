"""Compute all result files as on other processors, and compare: ``python tests/cpus.py [NAME …]``.

Numerical libraries choose their kernels by what the processor can do; environment variables let
them choose as on others. Everything runs in clones of the last commit, where nothing is cached.
"""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import xarray as xr

PROJECT = Path(__file__).parents[1]
AVX512 = "X86_V4,AVX512_ICL"
CPUS = {
    "this": {},
    "this again": {},
    "AVX2": {"OPENBLAS_CORETYPE": "Haswell", "NPY_DISABLE_CPU_FEATURES": AVX512},
    "SSE3": {
        "OPENBLAS_CORETYPE": "Prescott",
        "NPY_DISABLE_CPU_FEATURES": f"X86_V3,{AVX512}",
        "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA,-AVX512F,-FMA4,-AVX",
        "OPENCV_CPU_DISABLE": "AVX2,FMA3,FP16,AVX,SSE4.2,SSE4.1",
        "NUMBA_CPU_NAME": "generic",
    },
}
MAX_DIFFERENCE = 1e-9  # of the largest value of a variable
MAX_SINGLE_DIFFERENCE = 2.0**-13  # of those in single precision, which are stored to 14 bits
COMPUTE = """
import sys
from thesis_lib.figure_sets.registry import STUDIES
from thesis_lib.notebook.show import study
for name in sys.argv[2:] or sorted(STUDIES, key="claims".__eq__):  # the ledger reads the others
    study(name, {"cube": f"{sys.argv[1]}/{name}.nc"})
"""


def main():
    """Compute and compare; return 1 if anything differs by more than it may."""
    failed = []
    with tempfile.TemporaryDirectory() as work:
        for cpu, environment in CPUS.items():
            clone, results = Path(work, f"{cpu} clone"), Path(work, cpu)
            subprocess.run(["git", "clone", "-q", PROJECT, clone], check=True)
            own = {"PYTHONPATH": str(clone / "src"), "OPENBLAS_NUM_THREADS": "1", **environment}
            command = [sys.executable, "-c", COMPUTE, str(results), *sys.argv[1:]]
            subprocess.run(command, cwd=clone, env={**os.environ, **own}, check=True)
            for path in sorted(Path(work, "this").glob("*.nc")):
                far = compare_files(path, results / path.name, exact=cpu == "this again")
                failed += [f"{path.stem} on {cpu}: {variable} differs" for variable in far]
    print(*(failed or [f"the same on {', '.join(CPUS)}"]), sep="\n")
    return bool(failed)


def compare_files(one, other, exact=False):
    """Return the variables of two files that differ by more than they may, or that one lacks."""
    with xr.open_dataset(one) as a, xr.open_dataset(other) as b:
        both = set(a.variables) & set(b.variables)
        same = {name for name in both if close(a[name].values, b[name].values, exact)}
        return sorted(map(str, {*a.variables, *b.variables} - same))


def close(x, y, exact):
    """Return whether two arrays are equal, or close if they hold numbers."""
    numbers = x.dtype.kind == "f"
    if x.shape != y.shape or x.dtype != y.dtype or not numbers or exact:
        return x.dtype == y.dtype and np.array_equal(x, y, equal_nan=numbers)
    bound = MAX_SINGLE_DIFFERENCE if x.dtype == np.float32 else MAX_DIFFERENCE
    peak = np.max(np.abs(x), where=np.isfinite(x), initial=0.0)
    return np.allclose(x, y, rtol=0, atol=bound * peak, equal_nan=True)


if __name__ == "__main__":
    sys.exit(main())
