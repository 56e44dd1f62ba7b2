"""Places as one sets up cameras: tenths of a degree, whole millimetres, or on a given limit.

Neither the costs of layouts nor what is seen are computed to the last digit, and that digit is not
the same on all machines. Among places so far apart the choice does not depend on it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from thesis_lib.arrays import Array

Limits = tuple[float, float]

PER_DEGREE = 10
PER_METRE = 1000
TIE = 1e-7  # relative: costs that are closer are equal
_DIGITS = 6  # of a number of steps; what follows is noise


def angles(values: Array, limits: Limits) -> Array:
    """Angles in rad rounded to tenths of a degree, within limits."""
    return np.clip(_rounded(values), *limits)


def azimuths(values: Array, limits: Limits) -> Array:
    """Azimuths rounded like :func:`angles`; of a full turn from -180° to below 180°."""
    if full_turn(limits):
        half = np.pi * (1 + 1e-12)  # -180° and 180° are one
        return _rounded(np.mod(_rounded(values) + half, 2 * np.pi) - half)
    middle = (limits[0] + limits[1]) / 2
    return angles(middle + np.mod(values - middle + np.pi, 2 * np.pi) - np.pi, limits)


def _rounded(values: Array) -> Array:
    return np.radians(np.rint(np.round(np.degrees(values) * PER_DEGREE, _DIGITS)) / PER_DEGREE)


def full_turn(limits: Limits) -> bool:
    """Whether azimuths have no limits."""
    return limits[1] - limits[0] >= 2 * np.pi * (1 - 1e-9)


def lengths(values: Array, limits: Limits) -> Array:
    """Lengths in m rounded to millimetres, within limits."""
    return np.clip(np.rint(np.round(values * PER_METRE, _DIGITS)) / PER_METRE, *limits)


def length_at(index: NDArray[np.int_], limits: Limits) -> Array:
    """The least length is number 0, those after it are whole millimetres, the last the largest."""
    first = np.floor(np.round(limits[0] * PER_METRE, _DIGITS))
    return np.clip((first + index) / PER_METRE, *limits)


def count_lengths(limits: Limits) -> int:
    """How many lengths :func:`length_at` tells apart, at most."""
    low, high = np.round(np.array(limits) * PER_METRE, _DIGITS)
    return int(np.ceil(high) - np.floor(low)) + 1


def first_least(costs: Array) -> int:
    """The first of the costs that are least, but for what may be noise."""
    return int(np.argmax(costs <= costs.min() * (1 + TIE)))


def first_most(values: Array) -> NDArray[np.int_]:
    """Where along the last axis the first of the largest values is, but for what may be noise."""
    return np.argmax(values >= values.max(axis=-1, keepdims=True) * (1 - TIE), axis=-1)


def by_rule(layout: Array) -> Array:
    """The same layout with its cameras by azimuth, elevation, distance and lens."""
    return layout[np.lexsort(_whole(layout).T[::-1])]


def rank(layout: Array) -> tuple[int, ...]:
    """What decides between layouts of equal cost: the least is taken."""
    return tuple(_whole(by_rule(layout)).ravel().tolist())


def _whole(layout: Array) -> NDArray[np.int_]:
    """Places in thousandths of a step, which have no noise."""
    steps = layout * [1, 1, PER_METRE, PER_METRE]
    steps[:, :2] = np.degrees(layout[:, :2]) * PER_DEGREE
    return np.rint(1000 * steps).astype(int)
