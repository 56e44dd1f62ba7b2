"""Lower sample rates, block by block, so that a recording of any length needs little memory."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import cache

import numpy as np
from numpy.typing import ArrayLike
from scipy.signal import firwin

from thesis_lib.arrays import Array, Signal

EDGE = 10  # samples that the low-pass reaches to either side
BLOCK = 1 << 17  # samples that are filtered at once


def step_to(rate: float, wanted: float) -> int:
    """Of how many samples one is kept for the lowest rate that is not below `wanted`."""
    return max(1, int(rate // wanted))


@cache
def low_pass(step: int) -> Array:
    """Taps of the low-pass before every `step`-th sample is kept, symmetric."""
    return firwin(2 * EDGE * step + 1, 1 / step, window=("kaiser", 5.0))


def decimate(blocks: Iterable[Array], step: int) -> Iterator[Array]:
    """A signal in blocks, low-passed, of which every `step`-th sample is kept.

    The same as doing it to the whole signal: an FIR low-pass without delay, whose result is kept
    where it does not reach beyond the signal's ends.

    Parameters
    ----------
    blocks : iterable of ndarray, shape (samples,)
        The signal, of any division; long blocks are faster.
    step : int
        Of how many samples one is kept.

    Yields
    ------
    ndarray, shape (samples,)
        The first sample lies `EDGE` · `step` samples after that of the signal.
    """
    if step == 1:
        yield from blocks
        return
    taps = low_pass(step)
    held = np.empty(0)
    for block in blocks:
        held = np.concatenate([held, block])
        count = (len(held) - len(taps)) // step + 1
        if count > 0:
            # Taps and samples in rows of `step`: products of matrices are the fastest sums.
            rows = held[: (count + 2 * EDGE - 1) * step].reshape(-1, step)
            sums = rows @ taps[:-1].reshape(-1, step).T
            kept = taps[-1] * held[2 * EDGE * step :: step][:count]
            for k in range(2 * EDGE):
                kept += sums[k : k + count, k]
            yield kept
            held = held[count * step :]


def decimated(signal: ArrayLike, rate: float, wanted: float) -> tuple[Signal, float]:
    """The signal low-passed at the lowest rate above `wanted`, and that rate in Hz.

    Where the filter reaches beyond its ends the signal is cut: it starts later, but that of all
    recordings alike, which leaves their delays.
    """
    x, step = np.asarray(signal), step_to(rate, wanted)
    if step == 1:
        return (x if x.dtype.kind == "f" else x.astype(float)), rate
    blocks = (x[k : k + BLOCK] for k in range(0, len(x), BLOCK))
    return np.concatenate([np.empty(0), *decimate(blocks, step)]), rate / step


def cut_off(rate: float, low_rate: float) -> float:
    """How much later in s a signal starts that was :func:`decimated` from one rate to another."""
    return EDGE / low_rate if low_rate < rate else 0.0
