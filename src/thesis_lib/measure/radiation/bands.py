"""Octave bands of a sound of several tones (IEC 61260-1)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from thesis_lib.arrays import IntArray

OCTAVE = 10**0.3  # base ten, as the standard has it
NOMINAL = (16, 31.5, 63, 125, 250, 500, 1000, 2000, 4000, 8000, 16000)
ALL = "all"


def octaves(hertz: ArrayLike) -> dict[str, IntArray]:
    """Which tones fall into which octave, by its nominal centre in Hz; before them all together.

    Tones below the lowest or above the highest band are in none.

    Examples
    --------
    >>> {name: own.tolist() for name, own in octaves([110.0, 5.0, 130.0, 300.0]).items()}
    {'all': [0, 1, 2, 3], '125': [0, 2], '250': [3]}
    """
    f = np.asarray(hertz, float)
    number = np.rint(np.log(f / 1000) / np.log(OCTAVE)).astype(int) + 6
    found = {f"{centre:g}": np.flatnonzero(number == k) for k, centre in enumerate(NOMINAL)}
    return {ALL: np.arange(len(f))} | {name: own for name, own in found.items() if len(own)}
