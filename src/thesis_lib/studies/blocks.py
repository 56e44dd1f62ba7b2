"""Studies in bounded pieces, on disk or in memory, by this process or by many workers.

A study is cut into *blocks*: runs of trials of one setting, by its parameters alone. All arithmetic
stays within a block, for in their last bits results depend on how many points BLAS multiplies at a
time. Who computes which block, and how many of them make up the *piece* that a worker is given,
is free: the cube is the same bit for bit.

An :class:`Outline` is a cube of which only the large variables are missing. They are filled in
block by block: arrays in memory, or variables of a file (:func:`thesis_lib.studies.cache.cached`),
which look alike. So neither images nor results are ever there as a whole.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import xarray as xr

from thesis_lib.studies import schedulers

BLOCK_BYTES = 24 * 2**20  # of images: 200 trials of 150 markers in 3 modes by 12 cameras fit
PIECE_BYTES = 8 * 2**20  # of images: what a worker is given at a time, in whole blocks
HELD_BYTES = 64 * 2**20  # a cube up to this size is held in memory


@dataclass(frozen=True)
class Block:
    """A run of trials of one setting."""

    setting: int  #: Index of the setting
    trials: slice  #: First trial, and the one after the last
    nbytes: int  #: Size of what is computed with
    load: Any = field(compare=False)  #: What computing it needs

    @property
    def place(self) -> tuple[int, slice, slice]:
        """Where its results go in a variable (setting, mode, trial, ...)."""
        return self.setting, slice(None), self.trials


def runs_of_trials(trials: int, trial_bytes: int) -> Iterator[slice]:
    """Runs of the trials 0 … `trials` whose arrays stay within ``BLOCK_BYTES``, at least one each.

    Examples
    --------
    >>> list(runs_of_trials(200, 2 * 2**20))[0], len(list(runs_of_trials(200, 2 * 2**20)))
    (slice(0, 12, None), 17)
    """
    step = max(1, BLOCK_BYTES // max(1, trial_bytes))
    for first in range(0, trials + 1, step):
        yield slice(first, min(first + step, trials + 1))


def pieces(blocks: Iterable[Block], bound: int) -> Iterator[list[Block]]:
    """Blocks in their order, as many together as stay within `bound` bytes, at least one."""
    piece: list[Block] = []
    for block in blocks:
        if piece and sum(other.nbytes for other in piece) + block.nbytes > bound:
            yield piece
            piece = []
        piece.append(block)
    if piece:
        yield piece


def computed(
    work: Callable[[Block], Any],
    blocks: Iterable[Block],
    scheduler: str = "",
    piece_bytes: int = PIECE_BYTES,
) -> Iterator[tuple[Block, Any]]:
    """Blocks and what `work` makes of them, in their order.

    Parameters
    ----------
    work : callable
        What can be sent to a worker and computes a block.
    blocks : iterable of Block
        Taken as they are needed.
    scheduler : str
        As in :func:`thesis_lib.studies.schedulers.checked`; empty computes here, one after another.
    piece_bytes : int
        What a worker is given at a time.

    Raises
    ------
    SchedulerError
        If the workers cannot be reached, or are lost and do not return.
    """
    if not scheduler:
        for block in blocks:
            yield block, work(block)
        return
    together = pieces(blocks, piece_bytes)
    if scheduler == schedulers.PROCESSES:
        for piece, results in schedulers.by_processes(_Each(work), together):
            yield from zip(piece, results, strict=True)
        return
    with schedulers.workers(scheduler) as client:
        for piece, results in schedulers.in_order(client, _Each(work), together):
            yield from zip(piece, results, strict=True)


@dataclass(frozen=True)
class _Each:
    """The same work for every block of a piece."""

    work: Callable[[Block], Any]

    def __call__(self, piece: list[Block]) -> list[Any]:
        return [self.work(block) for block in piece]


@dataclass(frozen=True)
class Outline:
    """A cube without its large variables, and what fills them in."""

    cube: xr.Dataset  #: Coordinates and small variables
    #: Dimensions, type and attributes of the large variables, by name; the dimensions are the
    #: cube's
    large: Mapping[str, tuple[tuple[str, ...], str, dict[str, str]]]
    #: Is given something to assign to by index for each large variable
    fill: Callable[[Mapping[str, Any]], None]
    order: tuple[str, ...]  #: Names of all variables as they shall stand in the cube

    def shape(self, name: str) -> tuple[int, ...]:
        """Shape of a large variable."""
        return tuple(self.cube.sizes[dim] for dim in self.large[name][0])

    @property
    def nbytes(self) -> int:
        """Size of the whole cube."""
        large = (math.prod(self.shape(n)) * np.dtype(self.large[n][1]).itemsize for n in self.large)
        return int(self.cube.nbytes) + sum(large)

    @property
    def is_held(self) -> bool:
        """Whether the whole cube is small enough to be held in memory."""
        return self.nbytes <= HELD_BYTES

    def in_memory(self) -> xr.Dataset:
        """The whole cube."""
        values = {name: np.empty(self.shape(name), self.large[name][1]) for name in self.large}
        self.fill(values)
        cube = self.cube.drop_vars(list(self.cube.data_vars))
        for name in self.order:
            if name in self.large:
                dims, _, attributes = self.large[name]
                cube[name] = (dims, values[name], attributes)
            else:
                cube[name] = self.cube[name]
        return cube
