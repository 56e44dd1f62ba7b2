"""Starts and clocks of recordings beside the first one's, though their clocks drift apart."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from thesis_lib.arrays import Signal
from thesis_lib.measure.synchronisation.audio import Recording, part_of
from thesis_lib.measure.synchronisation.decimation import cut_off, decimate, step_to
from thesis_lib.measure.synchronisation.drift import Drift, drift_of, loudness_match
from thesis_lib.measure.synchronisation.tones import SynchronisationError

RATE = 16000.0  # Hz at which windows are compared
LONGEST = 1800.0  # s from the start that are


def beside_first(
    recordings: Sequence[Recording], others: Mapping[int, float | None]
) -> dict[int, Drift]:
    """Start and clock of each of the `others` beside the first recording.

    Parameters
    ----------
    recordings : sequence of Recording
        The files.
    others : mapping
        Delay of the sound of each in s where it is known, else it is sought by loudness.

    Raises
    ------
    MediaError, SynchronisationError
        If a file has no whole sound, or its sound is unlike the first one's.
    """
    found: dict[int, Drift] = {}
    reference: tuple[Signal, float, float] | None = None
    for k, known in others.items():
        sound, rate, start = reference = reference or track_of(recordings[0])
        other, _, its_start = track_of(recordings[k])
        if known is None:
            match = loudness_match(sound, other, rate)
            if not match.certain:
                raise SynchronisationError(
                    f"{recordings[k].name}: no sound in it matches that of {recordings[0].name} "
                    "beyond doubt; clap a few times where all cameras hear it, within a minute of "
                    "the first one's start"
                )
            known = match.delay
        starts = start, its_start
        found[k] = drift_of(sound, other, rate, starts, known + start - its_start)
    return found


def track_of(recording: Recording) -> tuple[Signal, float, float]:
    """Sound, its sample rate in Hz, and the time of its first sample in the video, s."""
    with recording.opened() as audio:
        step = step_to(audio.rate, RATE)
        rate = audio.rate / step
        part = part_of(decimate(audio.blocks, step), 0, round(LONGEST * rate))
        blocks = [np.asarray(block, np.float32) for block in part]
        return np.concatenate(blocks), rate, audio.start + cut_off(audio.rate, rate)
