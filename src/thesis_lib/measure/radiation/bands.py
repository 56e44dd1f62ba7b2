"""Octave bands of a sound of several tones (IEC 61260-1)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from thesis_lib.acoustics.estimates import Estimate
from thesis_lib.arrays import Array

OCTAVE = 10**0.3  # base ten, as the standard has it
NOMINAL = (16, 31.5, 63, 125, 250, 500, 1000, 2000, 4000, 8000, 16000)


@dataclass(frozen=True)
class Bands:
    """What falls into octave bands."""

    centres: tuple[float, ...]  #: Nominal centre frequencies in Hz, of bands with a tone
    sums: Estimate  #: Of powers, or of mean squares, shape (bands, ...)


def octaves(hertz: Array, value: Array, error: Array) -> Bands:
    """Powers of tones (tones, ...), or mean squares, summed by octave; tones err independently.

    Tones below the lowest or above the highest band are left out.
    """
    number = np.rint(np.log(np.asarray(hertz) / 1000) / np.log(OCTAVE)).astype(int) + 6
    found = [k for k in range(len(NOMINAL)) if np.any(number == k)]
    sums = [np.sum(value[number == k], axis=0) for k in found]
    errors = [np.sqrt(np.sum(error[number == k] ** 2, axis=0)) for k in found]
    return Bands(
        tuple(float(NOMINAL[k]) for k in found), Estimate(np.array(sums), np.array(errors))
    )
