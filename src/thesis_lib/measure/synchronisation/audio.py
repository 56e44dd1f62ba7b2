"""Audio tracks of any length, read block by block, of which a bounded part is held at a time."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from thesis_lib.arrays import Array
from thesis_lib.measure.recordings.audio import AudioTrack, open_audio
from thesis_lib.measure.synchronisation.decimation import (
    LowRate,
    common_rate,
    cut_off,
    decimate_blocks,
    step_to,
)
from thesis_lib.measure.synchronisation.delays import (
    CORRELATION_RATE,
    ROOM_RATE,
    Match,
    force_match,
    room_match,
)
from thesis_lib.measure.synchronisation.tones import TONE_RATE, check_blocks, check_rate

Track = NDArray[np.float32]

SPAN_SAMPLES = 1 << 21  # samples of each camera that are held at a time
ROOM_SPANS = 8  # of them in which a room's sound is compared: ten minutes
MIN_AUDIO_S = 0.5  # of a track in which a tone is sought
BUTTON_SOUND_S = 0.5  # s at either end of a room's recording, in which buttons are pressed


@dataclass(frozen=True)
class AudioSource:
    """A file with sound, mostly a camera's."""

    name: str  #: Of the camera, for errors
    path: Path  #: The file
    channel: int | None = None  #: Which channel counts, the first is 1; None: all of them, mixed

    def opened(self) -> AbstractContextManager[AudioTrack]:
        """Open the file's sound; it can be read within the context."""
        return open_audio(self.path, self.channel)


@dataclass(frozen=True)
class LoadedAudio:
    """What was read of all recordings."""

    low: LowRate  #: At which the force is measured
    #: Of the sound of each after its first frame, s, shape (recordings,)
    starts: Array
    ends: Array
    #: Of each as much as is held, at some tens of samples per period; empty without a tone, shape
    #: (samples,)
    tones: list[Track]
    tone_rate: float  #: Sample rate of the tones in Hz
    tone_start: float  #: When the tones' first samples come after the first samples of the files, s
    sources: tuple[str, ...]  #: Which track and channels each one's sound is, empty if all


def _sample_rates(recordings: Sequence[AudioSource]) -> list[float]:
    """Return the sample rates of the recordings by their videos' clocks, Hz."""
    rates = []
    for recording in recordings:
        with recording.opened() as audio:
            rates.append(audio.rate)
    return rates


def part_of(blocks: Iterable[Array], first: int, last: int) -> Iterator[Array]:
    """Yield samples `first` to `last` of a signal in blocks; later samples are not read."""
    count = 0
    for block in blocks:
        yield block[max(first - count, 0) : max(last - count, 0)]
        count += len(block)
        if count >= last:
            return


def hold_signal(blocks: Iterable[Array], skip: int, most: int) -> tuple[Track, int]:
    """Return the whole signal, or, if it is longer than `most` samples, so many from `skip` on.

    All blocks are taken.

    Returns
    -------
    ndarray, shape (samples,)
        What is held.
    int
        How many samples came before.
    """
    kept, size, begin, count = np.empty(most, np.float32), 0, 0, 0
    for block in blocks:
        if not begin and skip and size + len(block) > most:
            begin, size = skip, max(size - skip, 0)
            kept[:size] = kept[skip : skip + size].copy()
        part = block[max(begin - count, 0) :][: most - size]
        kept[size : size + len(part)] = part
        size, count = size + len(part), count + len(block)
    return kept[:size].copy(), begin


def load_audio(
    recordings: Sequence[AudioSource], frequency: float | None, skip: float
) -> LoadedAudio:
    """Read and check all tracks, and hold a tone of theirs.

    Parameters
    ----------
    recordings : sequence of AudioSource
        The files.
    frequency : float or None
        Frequency of the tone in Hz; None if there is none to hold, as in a room.
    skip : float
        From when on the tone is held if it cannot be held from the start, s.

    Raises
    ------
    MediaError, SynchronisationError
        If a track is missing, too short, silent or clipped.
    """
    shortest = 4 * BUTTON_SOUND_S if frequency is None else 2.5 / frequency
    rates = _sample_rates(recordings)
    wanted = TONE_RATE * (frequency or 0.0)
    low = common_rate(rates, max(CORRELATION_RATE, wanted))
    step = step_to(low.rate, wanted) if frequency else 1
    starts, ends, tones, skipped, sources = [], [], [], [], []
    for recording in recordings:
        with recording.opened() as audio:
            lengths: list[int] = []
            blocks = check_blocks(
                _note_lengths(audio.blocks, lengths), audio.rate, shortest, recording.name
            )
            if frequency is None:
                blocks = (block[:0] for block in blocks)
            else:
                check_rate(audio.rate, frequency)
                blocks = decimate_blocks(low.reduce(blocks, audio.rate), step)
            tone, before = hold_signal(blocks, round(skip * low.rate / step), SPAN_SAMPLES)
            tones.append(tone)
            skipped.append(before)
            starts.append(audio.start)
            ends.append(audio.start + sum(lengths) / audio.rate)
            sources.append(audio.source)
    later, tone_rate = max(skipped), low.rate / step
    return LoadedAudio(
        low=low,
        starts=np.array(starts),
        ends=np.array(ends),
        tones=[tone[later - before :] for tone, before in zip(tones, skipped, strict=True)],
        tone_rate=tone_rate,
        tone_start=low.cut + cut_off(low.rate, tone_rate) + later / tone_rate,
        sources=tuple(sources),
    )


def _note_lengths(blocks: Iterable[Array], lengths: list[int]) -> Iterator[Array]:
    """Yield the blocks, and note their lengths."""
    for block in blocks:
        lengths.append(len(block))
        yield block


def low_track(recording: AudioSource, least: float, skip: float) -> tuple[Track, float, float]:
    """Return a track that is checked and held, for looking for a tone.

    Parameters
    ----------
    recording : AudioSource
        The file.
    least : float
        Rate in Hz that the track must keep at least.
    skip : float
        From when on it is held if it cannot be held from the start, s.

    Returns
    -------
    ndarray, shape (samples,)
        What is held.
    float
        Its sample rate in Hz.
    float
        Time of its first sample after the first frame, s.
    """
    with recording.opened() as audio:
        step = step_to(audio.rate, max(CORRELATION_RATE, least))
        rate = audio.rate / step
        blocks = check_blocks(audio.blocks, audio.rate, MIN_AUDIO_S, recording.name)
        track, before = hold_signal(decimate_blocks(blocks, step), round(skip * rate), SPAN_SAMPLES)
        return track, rate, audio.start + cut_off(audio.rate, rate) + before / rate


def low_part(recording: AudioSource, low: LowRate, first: int, last: int) -> Iterator[Array]:
    """Yield samples `first` to `last` of a track at a lower rate, in blocks."""
    with recording.opened() as audio:
        yield from part_of(low.reduce(audio.blocks, audio.rate), first, last)


def match_recordings(
    recordings: Sequence[AudioSource], frequency: float | None
) -> dict[int, Match]:
    """Match each recording but the first to the first.

    Correlation sees :data:`SPAN_SAMPLES` at a time, the same of all recordings: the first span in
    which a recording matches without doubt counts, or else the one in which it matches best. Spans
    overlap by half, so that what all heard is within one if they started less than that apart. In
    a room only the first `ROOM_SPANS` are tried.

    Parameters
    ----------
    recordings : sequence of AudioSource
        The files, which :func:`load_audio` has checked.
    frequency : float or None
        Frequency of the force's tone in Hz; None of tracks that hold what microphones hear.
    """
    room = frequency is None
    low = common_rate(_sample_rates(recordings), ROOM_RATE if room else CORRELATION_RATE)
    found: dict[int, Match] = {}
    with ExitStack() as files:
        tracks = []
        for recording in recordings:
            audio = files.enter_context(recording.opened())
            blocks = low.reduce(audio.blocks, audio.rate)
            tracks.append(
                without_ends(blocks, round(BUTTON_SOUND_S * low.rate)) if room else blocks
            )
        for span in islice(joint_spans(tracks, SPAN_SAMPLES), ROOM_SPANS if room else None):
            for i, other in enumerate(span[1:], 1):
                if i in found and (found[i].certain or len(other) < SPAN_SAMPLES // 4):
                    continue
                match = (
                    room_match(span[0], other, low.rate)
                    if frequency is None
                    else force_match(span[0], other, low.rate, frequency)
                )
                best = found.get(i, match)
                found[i] = max(best, match, key=lambda one: (one.certain, one.peak))
            if all(match.certain for match in found.values()):
                break
    return found


def without_ends(blocks: Iterable[Array], n: int) -> Iterator[Array]:
    """Yield a signal in blocks without its first and its last `n` samples."""
    last, drop = np.empty(0), n
    for block in blocks:
        last = np.concatenate([last, block[drop:]])
        drop = max(drop - len(block), 0)
        yield last[: max(len(last) - n, 0)]
        last = last[max(len(last) - n, 0) :]


def joint_spans(tracks: Sequence[Iterable[Array]], length: int) -> Iterator[list[Track]]:
    """Yield the same spans of some signals in blocks, each half a `length` after the one before.

    The first is given in any case; others while the first signal and another one last.
    """
    halves = [signal_pieces(track, length // 2) for track in tracks]
    none = np.empty(0, np.float32)
    before = [next(half, none) for half in halves]
    first = True
    while True:
        after = [next(half, none) for half in halves]
        if not first and not (len(after[0]) and any(map(len, after[1:]))):
            return
        span = [np.concatenate(pair) for pair in zip(before, after, strict=True)]
        before = [whole[len(half) :] for whole, half in zip(span, before, strict=True)]
        first = False
        del after
        yield span


def signal_pieces(blocks: Iterable[Array], length: int) -> Iterator[Track]:
    """Yield a signal in blocks as pieces of `length` samples, the last of which may be shorter."""
    piece, size = np.empty(length, np.float32), 0
    for block in blocks:
        start = 0
        while start < len(block):
            part = block[start : start + length - size]
            piece[size : size + len(part)] = part
            start, size = start + len(part), size + len(part)
            if size == length:
                full, piece, size = [piece], np.empty(length, np.float32), 0
                yield full.pop()  # of which nothing is kept here
    if size:
        yield piece[:size]
