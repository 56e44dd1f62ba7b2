"""What may be asked of the ledger: the alternative readings, and the draws of its own runs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from pydantic import model_validator

from thesis_lib.camera_study import Study, field, refuse
from thesis_lib.setups import Setting

ADOPTED = "adopted"


@dataclass(frozen=True)
class Reading:
    """Another reading of what the thesis leaves open.

    Parameters
    ----------
    name : str
        Short and unique.
    topic : str
        What it is about, as in ``assumptions.toml``.
    values : dict
        Parameters that differ; a study takes those that it has.
    """

    name: str
    topic: str
    values: dict[str, Any]


def _focal(focal_mm: float, **more: Any) -> dict[str, Any]:
    return {"focal_length_mm": float(focal_mm), **more}


_REVERSED = dict.fromkeys(("4a", "4a'", "4b", "4c", "4d", "4e"), "reversed")
_ALL = (
    Reading(ADOPTED, "", {}),
    Reading("rest known", "rest position", {"rest": "known"}),
    Reading("rest known, 18 mm lens", "rest position", _focal(18, rest="known")),
    Reading("rest known, 20 mm lens", "rest position", _focal(20, rest="known")),
    Reading("1 N", "amplitude", {"amplitude_mm": "force"}),
    Reading("azimuth from X", "azimuth", {"azimuth_zero": "X"}),
    Reading("4d as printed", "pair order", {"pair_order": {"4d": "printed"}}),
    Reading("4b reversed", "pair order", {"pair_order": {"4b": "reversed"}}),
    Reading("all pairs reversed", "pair order", {"pair_order": _REVERSED}),
    *(
        Reading(f"{focal} mm lens", "focal length", _focal(focal))
        for focal in (18, 20, 22, 26, 28, 35, 50)
    ),
    Reading("markers from the clamp on", "beam markers", {"first_marker_mm": 0.0}),
    Reading("last marker at the tip", "beam markers", {"first_marker_mm": 23.0}),
    Reading("last marker at the tip, 26 mm lens", "beam markers", _focal(26, first_marker_mm=23.0)),
    Reading("principal point half a pixel off", "principal point", {"principal_offset_px": 0.5}),
)
READINGS = {reading.name: reading for reading in _ALL}


class Ledger(Study):
    """What the ledger's runs have in common."""

    subject = "claims"
    study = "claims"
    varied = "claim"
    varied_label = "claim"

    trials: int = field(
        200,
        "random shifts of the pixel grids in the ledger's own runs",
        "a whole number from 2 to 10000",
        ge=2,
        le=10_000,
    )
    seed: int = field(
        0, "seed of the ledger's own runs", "a whole number from 0 to 2^63 - 1", ge=0, lt=2**63
    )

    def settings(self) -> list[Setting]:
        """Nothing is varied."""
        return []


class OwnRuns(Ledger):
    """Runs of layouts that the thesis only speaks of."""

    name = "claims-layouts"
    title = "Ledger: layouts that the thesis only speaks of"


class OtherReadings(Ledger):
    """All claims under other readings."""

    name = "claims-readings"
    title = "Ledger: other readings"

    readings: list[str] = field(
        lambda: [name for name in READINGS if name != ADOPTED],
        "readings of what the thesis leaves open, to compare with the adopted one",
        'a list of different ones of the page\'s table, such as ["rest known"]; the adopted one '
        "is always run",
    )

    @model_validator(mode="after")
    def _check_readings(self) -> OtherReadings:
        if unknown := [name for name in self.readings if name not in READINGS]:
            refuse("readings", unknown[0], f"allowed: {', '.join(READINGS)}")
        return self


class Claims(OtherReadings):
    """The ledger: every claim of the thesis beside what this book gets."""

    name = "claims"
    title = "The ledger: every claim of the thesis"

    @property
    def own_runs(self) -> OwnRuns:
        """The runs that its trends need."""
        return OwnRuns(trials=self.trials, seed=self.seed)

    @property
    def other_readings(self) -> OtherReadings:
        """The readings that it compares."""
        return OtherReadings(trials=self.trials, seed=self.seed, readings=self.readings)
