"""Studies in bounded pieces, by this process or by many workers.

A study is cut into *blocks*: runs of trials of one setting, by its parameters alone. All arithmetic
stays within a block, for in their last bits results depend on how many points BLAS multiplies at a
time. Who computes which block is free: the cube is the same bit for bit.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any

from thesis_lib.studies import schedulers

BLOCK_BYTES = 24 * 2**20  # of images: 200 trials of 150 markers in 3 modes by 12 cameras fit
HELD_BYTES = 64 * 2**20  # that a small file of someone else may fill of the memory


@dataclass(frozen=True)
class Block:
    """A run of trials of one setting."""

    setting: int  #: Index of the setting
    trials: slice  #: First trial, and the one after the last
    load: Any = field(compare=False)  #: What computing it needs

    @property
    def place(self) -> tuple[int, slice, slice]:
        """Return the index of the block's results in a variable (setting, mode, trial, ...)."""
        return self.setting, slice(None), self.trials


def runs_of_trials(trials: int, trial_bytes: int) -> Iterator[slice]:
    """Cut the trials 0 … `trials` into runs whose arrays stay within ``BLOCK_BYTES``.

    Each has one trial at least.

    Examples
    --------
    >>> list(runs_of_trials(200, 2 * 2**20))[0], len(list(runs_of_trials(200, 2 * 2**20)))
    (slice(0, 12, None), 17)
    """
    step = max(1, BLOCK_BYTES // max(1, trial_bytes))
    for first in range(0, trials + 1, step):
        yield slice(first, min(first + step, trials + 1))


def compute_blocks(
    work: Callable[[Block], Any], blocks: Iterable[Block], scheduler: str = ""
) -> Iterator[tuple[Block, Any]]:
    """Yield blocks and what `work` makes of them, in their order.

    Parameters
    ----------
    work : callable
        What can be sent to a worker and computes a block.
    blocks : iterable of Block
        What is computed.
    scheduler : str
        As in :func:`thesis_lib.studies.schedulers.check_address`; empty computes here, one after
        another.

    Raises
    ------
    SchedulerError
        If the workers cannot be reached, or end before their work.
    """
    if not scheduler:
        return ((block, work(block)) for block in blocks)
    every = list(blocks)
    return zip(every, schedulers.map_in_order(work, every, scheduler), strict=True)
