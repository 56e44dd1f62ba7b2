"""Decimate and resample sound of any length block by block."""

import sys
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import scipy

from thesis_lib.arrays import Array, ArrayLike, NDArray, Signal
from thesis_lib.measure.recordings.audio import AudioTrack, probe_audio

Track = NDArray[np.float32]

SPAN_SAMPLES = 1 << 21  # samples of each camera per correlation
MAX_CLIPPED_SHARE = 0.02  # largest accepted share of clipped samples; a full-scale sine has 0.009
TAP_PHASES = 512  # tabulated sub-sample positions of the resampler's taps: error -105 dB
FILTER_REACH_SAMPLES = 10  # half length of the low-pass in samples of the low rate
KAISER_BETA = 5.0  # of the low-pass's window: 50 dB stop-band attenuation
RESAMPLED_SAMPLES = 1 << 13  # samples per resampling step
FILTERED_SAMPLES = 1 << 17  # samples per filtering step


class SynchronisationError(ValueError):
    """Recordings that cannot be synchronised; the message is one line."""


@dataclass(frozen=True)
class AudioSource:
    """A file with sound, usually a camera's video."""

    name: str  #: Camera name, for error messages
    path: Path  #: The file
    channel: int | None = None  #: Number from 1; None: all channels that hold sound, mixed

    def probe(self) -> AudioTrack:
        """Return the file's sound track, whose samples are not yet read."""
        return probe_audio(self.path, self.channel)


def check_sound(sound: AudioTrack, shortest: float, name: str) -> None:
    """Refuse a sound that is silent, clipped or shorter than `shortest` s; errors name `name`."""
    if not sound.samples or sound.samples < shortest * sound.rate:
        raise SynchronisationError(
            f"{name}: {sound.samples / sound.rate:.3f} s of audio, allowed: at least "
            f"{shortest:.3f} s"
        )
    if sound.silence:
        raise SynchronisationError(f"{name}: {sound.silence}")
    if sound.clipped > MAX_CLIPPED_SHARE * sound.samples:
        percent = 100 * sound.clipped / sound.samples
        raise SynchronisationError(
            f"{name}: clipped audio ({percent:.1f} % of the samples at full scale), "
            f"allowed: at most {100 * MAX_CLIPPED_SHARE:g} %"
        )


def part_of(blocks: Iterable[Array], first: int, last: int) -> Iterator[Array]:
    """Yield samples `first` to `last` of a signal in blocks, without reading later samples."""
    count = 0
    for block in blocks:
        yield block[max(first - count, 0) : max(last - count, 0)]
        count += len(block)
        if count >= last:
            return


def join_blocks(blocks: Iterable[Array]) -> Track:
    """Concatenate the blocks of a signal in single precision."""
    return np.concatenate([np.empty(0, np.float32), *(np.float32(block) for block in blocks)])


class Sounds:
    """Sounds of recordings, read at the lowest common rate above `wanted` in Hz.

    Times follow the time stamps, or, if `stated`, start at 0 with the rates stated in the files.
    """

    def __init__(
        self, recordings: Sequence[AudioSource], wanted: float, stated: bool = False
    ) -> None:
        self.tracks = [recording.probe() for recording in recordings]
        self.rates = [one.stated_rate if stated else one.rate for one in self.tracks]
        self.low = common_rate(self.rates, wanted)
        #: Times of the first samples at the common rate, s
        self.starts = [(0.0 if stated else one.start) + self.low.cut for one in self.tracks]

    def blocks(self, k: int) -> Iterator[Array]:
        """Yield the sound of a recording in blocks."""
        return self.low.reduce(self.tracks[k].blocks(), self.rates[k])

    def read(self, k: int, first: int = 0, last: int = sys.maxsize) -> Track:
        """Return samples `first` to `last` of the sound of a recording."""
        return join_blocks(part_of(self.blocks(k), first, last))


def decimate_blocks(blocks: Iterable[Array], step: int) -> Iterator[Array]:
    """Low-pass a signal in blocks (samples,), and yield every `step`-th sample.

    The result does not depend on the blocks: a zero-phase FIR low-pass, evaluated only where it
    does not reach beyond the signal's ends. The first sample thus lies
    `FILTER_REACH_SAMPLES` · `step` samples after that of the signal.
    """
    if step == 1:
        yield from blocks
        return
    reach = FILTER_REACH_SAMPLES * step
    taps = _low_pass(np.arange(-reach, reach + 1) / step)
    held = np.empty(0)
    for block in blocks:
        held = np.concatenate([held, block])
        count = (len(held) - len(taps)) // step + 1
        if count > 0:
            # Taps and samples in rows of `step`: matrix products compute these sums fastest.
            rows = held[: (count + 2 * FILTER_REACH_SAMPLES - 1) * step].reshape(-1, step)
            sums = rows @ taps[:-1].reshape(-1, step).T
            kept = taps[-1] * held[2 * FILTER_REACH_SAMPLES * step :: step][:count]
            for k in range(2 * FILTER_REACH_SAMPLES):
                kept += sums[k : k + count, k]
            yield kept
            held = held[count * step :]


def decimate_signal(signal: ArrayLike, rate: float, wanted: float) -> tuple[Signal, float]:
    """Low-pass a signal to the lowest rate above `wanted`; return it and that rate in Hz.

    The signal is cut where the filter would reach beyond its ends. All recordings then start later
    by the same time, which does not change their delays.
    """
    x, low = np.asarray(signal), common_rate([rate], wanted)
    if low.rate == rate:
        return (x if x.dtype.kind == "f" else x.astype(float)), rate
    blocks = (x[k : k + FILTERED_SAMPLES] for k in range(0, len(x), FILTERED_SAMPLES))
    return np.concatenate([np.empty(0), *low.reduce(blocks, rate)]), low.rate


@dataclass(frozen=True)
class LowRate:
    """A common sample rate to which signals of different rates are reduced."""

    rate: float  #: In Hz, not above that of any signal
    cut: float  #: Time from a signal's first sample to the first reduced sample, s

    def reduce(self, blocks: Iterable[Array], rate: float) -> Iterator[Array]:
        """Reduce a signal in blocks from a rate in Hz to the common rate."""
        ratio = rate / self.rate
        step = round(ratio)
        if abs(ratio - step) < 1e-12 * step and (step > 1) == (self.cut > 0):
            return decimate_blocks(blocks, step)
        return _resample_blocks(blocks, ratio, self.cut * rate)


def common_rate(rates: Sequence[float], wanted: float) -> LowRate:
    """Return the lowest rate above `wanted` in Hz that divides the lowest of `rates`."""
    least = min(rates)
    rate = least / max(1, int(least // wanted))
    return LowRate(rate, FILTER_REACH_SAMPLES / rate if rate < least else 0.0)


def _low_pass(x: Array) -> Array:
    """Return Kaiser-windowed sinc taps (..., n) at positions in samples of the low rate."""
    inside = np.clip(1 - (x / FILTER_REACH_SAMPLES) ** 2, 0, None)
    window = scipy.special.i0(KAISER_BETA * np.sqrt(inside)) / scipy.special.i0(KAISER_BETA)
    taps = np.sinc(x) * window * (np.abs(x) <= FILTER_REACH_SAMPLES)
    return np.asarray(taps / taps.sum(axis=-1, keepdims=True), float)


@cache
def _phases(ratio: float) -> Array:
    """Tabulate the low-pass at sub-sample positions, shape (phases + 1, taps)."""
    reach = int(np.ceil(FILTER_REACH_SAMPLES * ratio))
    shift = np.arange(TAP_PHASES + 1)[:, None] / TAP_PHASES
    return _low_pass((np.arange(-reach, reach + 2) - shift) / ratio)


def _resample_blocks(blocks: Iterable[Array], ratio: float, first: float) -> Iterator[Array]:
    """Low-pass a signal in blocks, and yield a sample every `ratio` samples, at any ratio.

    Like :func:`decimate_blocks`, with the low-pass between samples interpolated from a table, and
    zeros before the signal. The first sample lies at `first` samples of the signal.
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
