"""Lower sample rates, block by block, so that a recording of any length needs little memory."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import ArrayLike
from scipy.signal import firwin
from scipy.special import i0

from thesis_lib.arrays import Array, Signal

TAP_PHASES = 512  # of a sample at which the resampler's taps are tabulated: -105 dB between them
FILTER_REACH_SAMPLES = 10  # samples that the low-pass reaches to either side
KAISER_BETA = 5.0  # shape of the low-pass's window: 50 dB beyond its edge
RESAMPLED_SAMPLES = 1 << 13  # samples that are resampled at once
FILTERED_SAMPLES = 1 << 17  # samples that are filtered at once


def step_to(rate: float, wanted: float) -> int:
    """Return the decimation factor for the lowest rate that is not below `wanted`."""
    return max(1, int(rate // wanted))


@cache
def _low_pass(step: int) -> Array:
    """Return the taps of the low-pass before every `step`-th sample is kept, symmetric."""
    return firwin(2 * FILTER_REACH_SAMPLES * step + 1, 1 / step, window=("kaiser", KAISER_BETA))


def decimate_blocks(blocks: Iterable[Array], step: int) -> Iterator[Array]:
    """Low-pass a signal in blocks, and yield every `step`-th sample.

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
        The first sample lies `FILTER_REACH_SAMPLES` · `step` samples after that of the signal.
    """
    if step == 1:
        yield from blocks
        return
    taps = _low_pass(step)
    held = np.empty(0)
    for block in blocks:
        held = np.concatenate([held, block])
        count = (len(held) - len(taps)) // step + 1
        if count > 0:
            # Taps and samples in rows of `step`: products of matrices are the fastest sums.
            rows = held[: (count + 2 * FILTER_REACH_SAMPLES - 1) * step].reshape(-1, step)
            sums = rows @ taps[:-1].reshape(-1, step).T
            kept = taps[-1] * held[2 * FILTER_REACH_SAMPLES * step :: step][:count]
            for k in range(2 * FILTER_REACH_SAMPLES):
                kept += sums[k : k + count, k]
            yield kept
            held = held[count * step :]


def decimate_signal(signal: ArrayLike, rate: float, wanted: float) -> tuple[Signal, float]:
    """Low-pass a signal to the lowest rate above `wanted`; return it and that rate in Hz.

    Where the filter reaches beyond its ends the signal is cut: it starts later, but that of all
    recordings alike, which leaves their delays.
    """
    x, step = np.asarray(signal), step_to(rate, wanted)
    if step == 1:
        return (x if x.dtype.kind == "f" else x.astype(float)), rate
    blocks = (x[k : k + FILTERED_SAMPLES] for k in range(0, len(x), FILTERED_SAMPLES))
    return np.concatenate([np.empty(0), *decimate_blocks(blocks, step)]), rate / step


def cut_off(rate: float, low_rate: float) -> float:
    """Return the delay in s that :func:`decimate_signal` adds from one rate to another."""
    return FILTER_REACH_SAMPLES / low_rate if low_rate < rate else 0.0


@dataclass(frozen=True)
class LowRate:
    """A sample rate that several signals of their own rates are reduced to, and when they begin."""

    rate: float  #: In Hz, not above any of the signals' own
    cut: float  #: Time of its first sample after the first one of each signal, s

    def reduce(self, blocks: Iterable[Array], rate: float) -> Iterator[Array]:
        """Reduce a signal in blocks, of a rate in Hz, to this rate."""
        ratio = rate / self.rate
        step = round(ratio)
        if abs(ratio - step) < 1e-12 * step and (step > 1) == (self.cut > 0):
            return decimate_blocks(blocks, step)
        return _resample_blocks(blocks, ratio, self.cut * rate)


def common_rate(rates: Sequence[float], wanted: float) -> LowRate:
    """Return the lowest rate above `wanted` that divides the lowest of some signals' rates."""
    least = min(rates)
    rate = least / step_to(least, wanted)
    return LowRate(rate, cut_off(least, rate))


@cache
def _phases(ratio: float) -> Array:
    """Tabulate the low-pass between samples, shape (phases + 1, taps)."""
    reach = int(np.ceil(FILTER_REACH_SAMPLES * ratio))
    shift = np.arange(TAP_PHASES + 1)[:, None] / TAP_PHASES
    x = (np.arange(-reach, reach + 2) - shift) / ratio
    window = i0(KAISER_BETA * np.sqrt(np.clip(1 - (x / FILTER_REACH_SAMPLES) ** 2, 0, None))) / i0(
        KAISER_BETA
    )
    taps = np.sinc(x) * window * (np.abs(x) <= FILTER_REACH_SAMPLES)
    return np.asarray(taps / taps.sum(axis=1, keepdims=True), float)


def _resample_blocks(blocks: Iterable[Array], ratio: float, first: float) -> Iterator[Array]:
    """Low-pass a signal in blocks, and take a sample every `ratio` of its own, at any ratio.

    As :func:`decimate_blocks` does it, with the low-pass between samples taken from a table; what
    lies before the signal counts as 0. The first one lies at `first` samples of the signal.
    """
    table = _phases(ratio)
    reach = table.shape[1] // 2 - 1
    begin, held, count = -reach, np.zeros(reach), 0
    for block in blocks:
        held = np.concatenate([held, block])
        last = int(np.floor((begin + len(held) - reach - 2 - first) / ratio))
        if last < count:
            continue
        for start in range(count, last + 1, RESAMPLED_SAMPLES):
            at = first + ratio * np.arange(start, min(start + RESAMPLED_SAMPLES, last + 1))
            low = np.floor(at).astype(int)
            phase = (at - low) * TAP_PHASES
            near = phase.astype(int)
            part = phase - near
            rows = np.lib.stride_tricks.sliding_window_view(held, table.shape[1])
            samples = rows[low - reach - begin]
            before, after = (np.einsum("ij,ij->i", samples, table[near + k]) for k in (0, 1))
            yield before + part * (after - before)
        count = last + 1
        keep = max(int(np.floor(first + ratio * count)) - reach - begin, 0)
        begin, held = begin + keep, held[keep:]
