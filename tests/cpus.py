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
                with xr.open_dataset(path) as one, xr.open_dataset(results / path.name) as other:
                    a, b, exact = one.variables, other.variables, cpu == "this again"
                    far = [n for n in sorted({*a, *b}) if not is_close(a.get(n), b.get(n), exact)]
                failed += [f"{path.stem} on {cpu}: {name} differs" for name in far]
    print(*(failed or [f"the same on {', '.join(CPUS)}"]), sep="\n")
    return bool(failed)


def is_close(x, y, exact):
    """Return whether a variable is the same in two files, or close if it holds numbers."""
    if x is None or y is None or x.dtype != y.dtype or x.shape != y.shape:
        return False
    if exact or x.dtype.kind != "f":
        return x.equals(y)
    bound = MAX_SINGLE_DIFFERENCE if x.dtype == np.float32 else MAX_DIFFERENCE
    peak = np.max(np.abs(x.values), where=np.isfinite(x.values), initial=0.0)
    return np.allclose(x, y, rtol=0, atol=bound * peak, equal_nan=True)


if __name__ == "__main__":
    sys.exit(main())
