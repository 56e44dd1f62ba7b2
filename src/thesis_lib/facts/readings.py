"""Assumptions where the thesis leaves something open, and other interpretations."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from thesis_lib.facts.setups import read_toml

ADOPTED_READING = "adopted"


@dataclass(frozen=True)
class Reading:
    """Another reading of what the thesis leaves open."""

    name: str  #: Short and unique
    topic: str  #: What it is about, as in ``assumptions.toml``
    values: dict[str, Any]  #: Parameters that differ; a study takes those that it has


def _focal(focal_mm: float, **more: Any) -> dict[str, Any]:
    return {"focal_length_mm": float(focal_mm), **more}


_REVERSED_CASES = dict.fromkeys(("4a", "4a'", "4b", "4c", "4d", "4e"), "reversed")
_ALL_READINGS = (
    Reading(ADOPTED_READING, "", {}),
    Reading("rest known", "rest position", {"rest": "known"}),
    Reading("rest known, 18 mm lens", "rest position", _focal(18, rest="known")),
    Reading("rest known, 20 mm lens", "rest position", _focal(20, rest="known")),
    Reading("1 N", "amplitude", {"amplitude_mm": "force"}),
    Reading("azimuth from X", "azimuth", {"azimuth_zero": "X"}),
    Reading("4d as printed", "pair order", {"pair_order": {"4d": "printed"}}),
    Reading("4b reversed", "pair order", {"pair_order": {"4b": "reversed"}}),
    Reading("all pairs reversed", "pair order", {"pair_order": _REVERSED_CASES}),
    *(
        Reading(f"{focal} mm lens", "focal length", _focal(focal))
        for focal in (18, 20, 22, 26, 28, 35, 50)
    ),
    Reading("markers from the clamp on", "beam markers", {"first_marker_mm": 0.0}),
    Reading("last marker at the tip", "beam markers", {"first_marker_mm": 23.0}),
    Reading("last marker at the tip, 26 mm lens", "beam markers", _focal(26, first_marker_mm=23.0)),
    Reading("principal point half a pixel off", "principal point", {"principal_offset_px": 0.5}),
)
READINGS = {reading.name: reading for reading in _ALL_READINGS}


def list_assumptions() -> list[dict[str, Any]]:
    """Return the assumptions made where the thesis states nothing, item by item."""
    items: list[dict[str, Any]] = read_toml("assumptions.toml")["assumption"]
    return items


def assumed_values(subject: str) -> dict[str, Any]:
    """Return the assumed parameters for beam, plate, sound, experiment or lab."""
    return {
        name: value
        for item in list_assumptions()
        if subject in item["subjects"]
        for name, value in item.get("parameters", {}).items()
    }
