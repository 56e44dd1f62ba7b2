"""How much of a motion a compressed film leaves, by the pixels that it moves a marker's image.

The films of :mod:`benchmarks.tracking`, with the beam moving less and less, as H.264 leaves them
and lossless, followed by the library. Nothing is timed.
"""

from __future__ import annotations

import datetime
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from benchmarks.tracking import amplitudes, filmed, follower

FILMS = {"lossless": None, "H.264, crf 18": 18, "H.264, crf 23": 23, "H.264, crf 28": 28}
TIPS = (0.004, 0.0012, 0.0004, 0.00012)  # m
ABOUT = (0.05, 0.1, 0.2, 0.5, 1.0, 2.0)  # px that images move, rest to maximum
WITHIN = 1.4  # times more or less


@dataclass(frozen=True)
class Left:
    """Markers whose images move about as much, in one kind of film."""

    film: str
    motion_px: float  #: Amplitude in the picture, about, px
    error: float  #: rms of the amplitude's error over the amplitude
    markers: int


def compare(steady: int = 90) -> Iterator[Left]:
    """What each kind of film leaves of each size of motion."""
    for film, crf in FILMS.items():
        moved, off = [], []
        for tip in TIPS:
            f = filmed(steady, crf=crf, tip=tip)
            true = amplitudes(f, f.truth)
            found = amplitudes(f, follower(f)())
            moved.append(np.hypot(*np.abs(true)))
            off.append(np.hypot(*np.abs(found - true)) / moved[-1])
        size, error = np.concatenate(moved), np.concatenate(off)
        for about in ABOUT:
            among = (size > about / WITHIN) & (size < about * WITHIN)
            rms = float(np.sqrt(np.nanmean(error[among] ** 2)))
            yield Left(film, about, rms, int(np.count_nonzero(among)))


def run() -> dict[str, Any]:
    """What was measured, for the book."""
    today = datetime.datetime.now(datetime.UTC).date().isoformat()
    return {"compression": {"date": today, "rows": [asdict(one) for one in compare()]}}
