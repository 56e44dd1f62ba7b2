"""What can be turned to make errors smaller, and where it is simulated or rendered."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from thesis_lib.arrays import Array

Source = tuple[str, str, tuple[str, ...], tuple[str, ...]]

MEAN = ("mean_error",)

PLANES = ("plane_error_xz", "plane_error_yz")


@dataclass(frozen=True)
class Knob:
    """One of the five things that the thesis varies."""

    #: What it is, with its unit, and what the error is taken to be a power of
    label: str
    symbol: str
    better: int  #: 1 if more of it should measure better, else -1
    #: Who measured it: name of the group, figure set, cases (none means all) and errors
    sources: tuple[Source, ...]
    # What the error is taken to be a power of, from the values
    exponent_of: Callable[[Array], Array] = field(default=lambda values: values)


def _cosine(degrees: Array) -> Array:
    return np.cos(np.radians(degrees))


def _simulated(study: str, *cases: str) -> tuple[Source, ...]:
    """The same study of beam, plate and sound."""
    return tuple(
        (subject, f"{subject}-{study}", cases, PLANES if subject == "sound" else MEAN)
        for subject in ("beam", "plate", "sound")
    )


def _rendered_plate(case: str) -> tuple[Source, ...]:
    return (
        ("plate, rendered", "lab-plate", (case,), MEAN),
        ("sound, rendered", "lab-plate", (case,), PLANES),
    )


KNOBS: dict[str, Knob] = {
    "closer": Knob(
        "distance, mm", "d", -1,
        (*_simulated("distance"), ("beam, rendered", "lab-layout", ("distance",), MEAN),
         *_rendered_plate("distance")),
    ),
    "wider": Knob(
        "aperture, °", "α", 1,
        (*_simulated("aperture", "2a", "2c"), ("beam, rendered", "lab-layout", ("aperture",), MEAN),
         *_rendered_plate("aperture")),
    ),
    "lower": Knob(
        "elevation, °", "cos φ", -1,
        (*_simulated("aperture", "2b", "2d"),
         ("beam, rendered", "lab-elevation", ("three-rows",), MEAN), *_rendered_plate("elevation")),
        _cosine,
    ),
    "finer": Knob(
        "width of the sensor, px", "W", 1,
        (*_simulated("resolution"), ("experiment", "experiment-resolution", ("matched",), MEAN),
         *_rendered_plate("resolution")),
    ),
    "more": Knob(
        "number of cameras", "N", 1,
        (*_simulated("arrays"), ("experiment", "experiment-cameras", ("matched",), MEAN),
         *_rendered_plate("cameras")),
    ),
}  # fmt: skip
