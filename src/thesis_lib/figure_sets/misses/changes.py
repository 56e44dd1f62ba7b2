"""What the thesis may have done otherwise, change by change.

A change sets some fields of :class:`thesis_lib.figure_sets.misses.model.Model`; changes of one
topic exclude each other.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from thesis_lib.facts import setups

PEAK_MM = 5.5  # that this book takes
CASES = tuple(setups.pairs())


@dataclass(frozen=True)
class Change:
    """One thing that the thesis may have done otherwise."""

    topic: str  #: What it is about
    name: str  #: Short and unique
    #: Fields of a model that differ
    values: dict[str, Any] = field(hash=False)


def _each(topic: str, parameter: str, values: dict[str, Any]) -> list[Change]:
    return [Change(topic, name, {parameter: value}) for name, value in values.items()]


def _mode(number: int, factor: float) -> tuple[float, ...]:
    return tuple(PEAK_MM * (factor if mode == number else 1) for mode in (1, 2, 3))


CHANGES = (
    *_each(
        "rounding",
        "rounding",
        {
            "down": "down",
            "towards the middle of the picture": "towards the middle",
            "to half pixels": 0.5,
            "to tenths of a pixel": 0.1,
            "to two pixels": 2.0,
            "of v alone": "v",
            "of u alone": "u",
        },
    ),
    Change("rest", "rest position known", {"rest": "known"}),
    *_each(
        "sampling",
        "frames",
        {"half of peak to peak": 2, "fit to 6 frames": 6, "fit to 8 frames": 8},
    ),
    Change("estimator", "linear equations alone", {"steps": 0}),
    *_each(
        "deflection",
        "deflection",
        {"length of the way in space": "length", "distance to the true place": "place"},
    ),
    *_each(
        "reference",
        "reference",
        {
            "percent of the tip's deflection": "tip",
            "percent of the largest measured": "measured",
            "percent of peak to peak": "peak to peak",
            "percent of the rms deflection": "rms",
        },
    ),
    *_each(
        "mean error",
        "mean",
        {"mean of absolute errors": "absolute", "median": "median", "spread about the mean": "std"},
    ),
    *_each(
        "largest error",
        "largest",
        {
            "largest of what is too much": "over",
            "largest of what is too little": "under",
            "largest but one": "second",
            "where the deflection is largest": "peak",
        },
    ),
    Change("amplitude", "one newton", {"peaks_mm": "force"}),
    *_each(
        "amplitude",
        "peaks_mm",
        {f"{PEAK_MM * k:g} mm": (PEAK_MM * k,) * 3 for k in (0.5, 0.75, 1.4, 2.0)},
    ),
    *_each(
        "amplitude",
        "peaks_mm",
        {
            f"mode {mode} by {PEAK_MM * k:.2g} mm": _mode(mode, k)
            for mode in (1, 2, 3)
            for k in (0.75, 1.4)
        },
    ),
    *_each(
        "lens",
        "focal_length_mm",
        {f"{f:g} mm lens": float(f) for f in (15, 18, 20, 22, 26, 28, 35, 50)},
    ),
    *_each(
        "markers",
        "first_marker_mm",
        {"markers from the clamp on": 0.0, "last marker at the tip": 23.0},
    ),
    *_each(
        "aim", "aim", {"cameras aimed at the clamp": "clamp", "cameras aimed at the tip": "tip"}
    ),
    *_each(
        "distance",
        "distance",
        {"distance along the ground": "ground", "distance as height": "height"},
    ),
    Change("azimuth", "azimuth from X", {"azimuth_zero": "X"}),
    Change("elevation", "elevation from the normal", {"elevation_zero": "normal"}),
    *_each(
        "pair order",
        "turned",
        {f"pairs of {case} in the other order": (case,) for case in CASES}
        | {"all pairs in the other order": CASES},
    ),
)
TOPICS = tuple(dict.fromkeys(change.topic for change in CHANGES))
