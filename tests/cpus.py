"""Compute all result files as on other processors, and compare: ``python tests/cpus.py [NAME …]``.

Numerical libraries choose their kernels by the instruction set of the processor, which environment
variables restrict. All runs use one clone of the last commit, and begin with an empty cache.
"""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import xarray as xr

CPUS = {
    "this": {},
    "this again": {},
    "AVX2": {"OPENBLAS_CORETYPE": "Haswell", "NPY_DISABLE_CPU_FEATURES": "X86_V4,AVX512_ICL"},
    "SSE3": {
        "OPENBLAS_CORETYPE": "Prescott",
        "NPY_DISABLE_CPU_FEATURES": "X86_V3,X86_V4,AVX512_ICL",
        "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA,-AVX512F,-FMA4,-AVX",
        "OPENCV_CPU_DISABLE": "AVX2,FMA3,FP16,AVX,SSE4.2,SSE4.1",
    },
}
# Of the largest value of a variable; those in single precision are stored to 14 bits
MAX_DIFFERENCES = {"float64": 1e-9, "float32": 2.0**-13}


def main():
    """Compute and compare; return 1 if anything differs by more than it may."""
    failed = []
    with tempfile.TemporaryDirectory() as work:
        clone = Path(work, "clone")
        subprocess.run(["git", "clone", "-q", Path(__file__).parents[1], clone], check=True)
        names = sys.argv[1:] or [path.stem for path in clone.glob("notebooks/*.ipynb")]
        for cpu, variables in CPUS.items():
            own = {"PYTHONPATH": f"{clone}/src", "THESIS_CACHE": f"{work}/{cpu}/cache"}
            command = [sys.executable, "-m", "thesis_lib", "run", *names, "--out", f"{work}/{cpu}"]
            subprocess.run(command, cwd=clone, env=os.environ | own | variables, check=True)
            for path in sorted(Path(work, "this").glob("*.nc")):
                a = xr.load_dataset(path).variables
                b = xr.load_dataset(f"{work}/{cpu}/{path.name}").variables
                far = [n for n in sorted({*a, *b}) if not is_close(a[n], b[n], cpu == "this again")]
                failed += [f"{path.stem} on {cpu}: {name} differs" for name in far]
    print(*(failed or [f"the same on {', '.join(CPUS)}"]), sep="\n")
    return bool(failed)


def is_close(x, y, exact):
    """Return whether a variable is the same in two files, or close if it holds numbers."""
    if exact or x.dtype.kind != "f" or x.dtype != y.dtype or x.shape != y.shape:
        return x.dtype == y.dtype and x.equals(y)
    peak = np.max(np.abs(x.values), where=np.isfinite(x.values), initial=0.0)
    return np.allclose(x, y, rtol=0, atol=MAX_DIFFERENCES[x.dtype.name] * peak, equal_nan=True)


if __name__ == "__main__":
    sys.exit(main())
