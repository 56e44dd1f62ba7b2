"""Fused multiply–add of independent numbers that stay in registers; needs numba."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numba import njit

WIDTHS = (32, 48, 64, 96)  # as many chains as hide the latency, as few as registers hold


def chains(width: int) -> Callable[[int], float]:
    """What multiplies and adds to each of `width` numbers, so many times as it is told."""

    def run(passes: int) -> float:
        x = np.ones(width)  # known when it is compiled, so that all of it stays in registers
        for _ in range(passes):
            for i in range(width):
                x[i] = x[i] * 0.999999 + 1e-9
        return float(x.sum())

    compiled: Callable[[int], float] = njit(error_model="numpy", fastmath={"contract"})(run)
    return compiled
