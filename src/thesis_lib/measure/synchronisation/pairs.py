"""Starts and clocks of recordings beside the first one's, though their clocks drift apart."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from thesis_lib.arrays import Signal
from thesis_lib.measure.synchronisation.audio import SPAN_SAMPLES, AudioSource, part_of
from thesis_lib.measure.synchronisation.decimation import common_rate
from thesis_lib.measure.synchronisation.drift import (
    MAX_SECOND_PEAK_RATIO,
    MIN_PEAK_DISTANCE_S,
    MIN_WINDOWS,
    WINDOW_SEARCH_S,
    Drift,
    drift_of,
    loudness_candidates,
    loudness_match,
)
from thesis_lib.measure.synchronisation.tones import SynchronisationError
from thesis_lib.measure.synchronisation.transients import WHITENING_BINS, room_match

COMPARED_RATE_HZ = 16000.0  # Hz at which windows are compared
MAX_COMPARED_S = 1800.0  # s from the start that are
MIN_AGREEING_SHARE = 0.5  # share of the windows that must agree on a delay
MIN_DECIDING_WINDOWS = 6  # windows that decide alone; unlike sounds had four at most


def beside_first(
    recordings: Sequence[AudioSource], others: Mapping[int, float | None]
) -> dict[int, Drift]:
    """Find start and clock of each of the `others` beside the first recording.

    Where time stamps state another pace than the sample rate does, the sounds are compared at both,
    since either may be the true one, and what is found counts by the time stamps.

    Parameters
    ----------
    recordings : sequence of AudioSource
        The files.
    others : mapping
        Delay of the sound of each in s where it is known, else it is sought.

    Raises
    ------
    MediaError, SynchronisationError
        If a file has no whole sound, or its sound is unlike the first one's.
    """
    found: dict[int, Drift] = {}
    stamped, stated = _Tracks(recordings, stated=False), _Tracks(recordings, stated=True)
    for k, known in others.items():
        if known is not None:
            delay = known + stamped.starts[0] - stamped.starts[k]
            found[k] = drift_of(
                stamped[0], stamped[k], stamped.rate, (stamped.starts[0], stamped.starts[k]), delay
            )
        else:
            found[k] = _surest(recordings, stamped, stated, k)
        kept = (1 - found[k].drift) * stamped.paces[k] / stamped.paces[0]
        found[k] = replace(found[k], sample_drift=1 - kept)
    return found


def _surest(recordings: Sequence[AudioSource], stamped: _Tracks, stated: _Tracks, k: int) -> Drift:
    """Find start and clock of a sound at either pace.

    Raises
    ------
    SynchronisationError
        If there is doubt.
    """
    tries = [_find_start(stamped, k)]
    if stamped.paces[k] != stamped.paces[0]:
        tries.append(_by_stamps(_find_start(stated, k), stamped, k))
    sure = [one for one in tries if one is not None]
    if not sure:
        raise SynchronisationError(
            f"{recordings[k].name}: no sound in it matches that of {recordings[0].name} "
            "beyond doubt; clap a few times where all cameras hear it, within a minute of the "
            "first one's start"
        )
    return max(sure, key=lambda one: one.score)


class _Tracks:
    """Sounds of recordings at one rate, the first of which and one other are held at a time."""

    def __init__(self, recordings: Sequence[AudioSource], *, stated: bool) -> None:
        """Take time by the rates that the files state, from the first sample on, or by stamps."""
        self.recordings = recordings
        self.paces, self.rates, starts = [], [], []
        for recording in recordings:
            with recording.opened() as audio:
                #: Seconds of the time stamps for one of the samples at the stated rate
                self.paces.append(audio.stated_rate / audio.rate)
                self.rates.append(audio.stated_rate if stated else audio.rate)
                starts.append(0.0 if stated else audio.start)
        self.low = common_rate(self.rates, COMPARED_RATE_HZ)
        self.rate = self.low.rate
        self.starts = [start + self.low.cut for start in starts]  #: Of the first samples, s
        self._read: dict[int, Signal] = {}

    def __getitem__(self, k: int) -> Signal:
        """Read the sound of a recording."""
        if k not in self._read:
            self._read = {i: one for i, one in self._read.items() if i == 0}
            with self.recordings[k].opened() as audio:
                low = self.low.reduce(audio.blocks, self.rates[k])
                part = part_of(low, 0, round(MAX_COMPARED_S * self.rate))
                blocks = [np.asarray(block, np.float32) for block in part]
            self._read[k] = np.concatenate([np.empty(0, np.float32), *blocks])
        return self._read[k]


def _find_start(tracks: _Tracks, k: int) -> Drift | None:
    """Find start and clock of a sound whose delay is unknown; None if there is doubt.

    Candidates come from the loudness and from the waveform of the first minutes; windows of the
    whitened waveform decide between them. One is certain if enough windows agree on it, fewer
    where loudness or the whole waveform says the same, and if no other comes near it.
    """
    one, other, rate = tracks[0], tracks[k], tracks.rate
    starts = tracks.starts[0], tracks.starts[k]
    if min(len(one), len(other)) <= 2 * WHITENING_BINS:
        return None
    loud = loudness_match(one, other, rate)
    room = room_match(one[:SPAN_SAMPLES], other[:SPAN_SAMPLES], rate)
    delays = [room.delay] if room.certain else []
    delays += [
        delay
        for delay in loudness_candidates(one, other, rate)
        if not room.certain or abs(delay - room.delay) > MIN_PEAK_DISTANCE_S
    ]
    found = [drift_of(one, other, rate, starts, delay + starts[0] - starts[1]) for delay in delays]
    if not found:
        return None
    best, *rest = sorted(found, key=lambda one: -one.score)
    apart = [one for one in rest if abs(one.delay - best.delay) > MIN_PEAK_DISTANCE_S]
    if any(one.score > MAX_SECOND_PEAK_RATIO * best.score for one in apart):
        return None
    sound_delay = best.delay + starts[1] - starts[0]
    by_room = room.certain and abs(sound_delay - room.delay) < WINDOW_SEARCH_S
    by_loudness = loud.certain and abs(sound_delay - loud.delay) < WINDOW_SEARCH_S
    agreeing = best.agreement >= MIN_AGREEING_SHARE
    enough = MIN_WINDOWS if by_loudness else MIN_DECIDING_WINDOWS
    return best if by_room or (agreeing and len(best.times) >= enough) else None


def _by_stamps(found: Drift | None, stamped: _Tracks, k: int) -> Drift | None:
    """Convert a drift between samples at their stated rates to one between time stamps."""
    if found is None:
        return None
    (first, own), cut = (stamped.paces[0], stamped.paces[k]), stamped.low.cut
    begin, its_begin = stamped.starts[0] - cut, stamped.starts[k] - cut
    kept = first * (1 - found.drift) / own  # seconds of the first clock for one of the other
    times = its_begin + own * found.times
    there = begin + first * (found.times + found.delays)
    drifts = np.isfinite(found.drift)
    kept = kept if drifts else first / own
    return replace(
        found,
        delay=begin + first * found.delay - kept * its_begin,
        delay_deviation=first * found.delay_deviation,
        drift=1 - kept if drifts else np.nan,
        drift_deviation=first / own * found.drift_deviation,
        times=times,
        delays=there - times,
    )
