"""What one core could do: arithmetic per point, the peak measured, memory's rate."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

MATRIX = 512  # rows of a product of matrices that stays in the caches
STREAM = 2**25  # numbers, 256 MiB, more than any cache


def flops(n_cameras: int, steps: int) -> int:
    """Additions, multiplications and divisions that a point needs, done one after the other.

    Linear equations: 2 to shift the image, 12 for the rows, 4 for the right sides. Gauss–Newton:
    21 for depth, h and g, 2 for the residual, 18 for the rows. To either add 36 for the normal
    equations. The solution of a 3×3 system by LDLᵀ takes 32.
    """
    solution, equations = 32, 36
    linear, reprojection = 18 + equations, 41 + equations
    return n_cameras * linear + solution + steps * (n_cameras * reprojection + solution)


def traffic(n_cameras: int) -> int:
    """Bytes per point that go through memory: images in, a point out."""
    return 16 * n_cameras + 24


@dataclass(frozen=True)
class Limits:
    """Of one core: thousand million flops and bytes a second, and how the former was measured."""

    peak: float
    bandwidth: float
    by: str

    def rate(self, n_cameras: int, steps: int) -> float:
        """Million points a second at which either arithmetic or memory is at its limit."""
        arithmetic = self.peak / flops(n_cameras, steps)
        return 1e3 * min(arithmetic, self.bandwidth / traffic(n_cameras))


def processor_seconds(work: Callable[[], object]) -> float:
    """Processor time of one call, all threads together: other jobs on the machine add nothing."""
    start = time.process_time()
    work()
    return time.process_time() - start


def measure(repetitions: int = 7, matrix: int = MATRIX, stream: int = STREAM) -> Limits:
    """The fastest of several repetitions: a limit is what was possible once."""
    a, b = np.random.default_rng(0).normal(size=(2, matrix, matrix))
    long = np.ones(stream)

    def best(work: Callable[[], object]) -> float:
        work()
        return min(processor_seconds(work) for _ in range(repetitions))

    calls = max(1, 2**29 // matrix**3)  # so many that a clock can tell
    product = best(lambda: [a @ b for _ in range(calls)])
    peak = calls * 2e-9 * matrix**3 / product
    bandwidth = 8e-9 * stream / best(lambda: long @ long)
    return Limits(peak, bandwidth, "a product of matrices (a lower bound)")
