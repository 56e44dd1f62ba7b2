"""What a plate and its sound add to a study's parameters: markers, planes, medium (thesis 6.1)."""

from __future__ import annotations

import warnings
from typing import Annotated

from pydantic import Field, model_validator

from thesis_lib.acoustics.planes import Plane, pistons
from thesis_lib.acoustics.sources import Medium, check_pistons
from thesis_lib.facts import setups
from thesis_lib.facts.readings import reading
from thesis_lib.studies.refusals import permitted, refuse
from thesis_lib.studies.vocabulary import Fields, Positive, field, means
from thesis_lib.vibration.plate import Plate
from thesis_lib.vibration.structure import Structure, resonance

Markers = Annotated[int, Field(ge=2, le=60)]
Grid = Annotated[
    tuple[Markers, Markers],
    means("markers along and across the plate", "[along, across], whole numbers from 2 to 60"),
]
PlanePoints = Annotated[int, Field(ge=2, le=500)]
READING = reading("sound")


class PlateMarkers(Fields):
    """Parameters of a plate."""

    grid: Grid

    @property
    def structure(self) -> Structure:
        """What is measured."""
        return setups.plate(self.grid)


class SoundPlanes(PlateMarkers):
    """Parameters of the sound field."""

    speed_of_sound_m_s: Positive = field(
        READING["speed_of_sound_m_s"], "speed of sound in the fluid"
    )
    air_density_kg_m3: Positive = field(READING["air_density_kg_m3"], "density of the fluid")
    plane_half_width_mm: Positive = field(
        READING["plane_half_width_mm"], "the planes reach |X|, |Y| up to this"
    )
    plane_bottom_mm: Positive = field(READING["plane_bottom_mm"], "lowest height of the planes")
    plane_top_mm: Positive = field(
        READING["plane_top_mm"],
        "greatest height of the planes",
        "a number above plane_bottom_mm, at most 100000",
    )
    plane_shape: tuple[PlanePoints, PlanePoints] = field(
        tuple(READING["plane_shape"]),
        "points along X or Y, and along Z",
        "[width, height], whole numbers from 2 to 500",
    )

    @property
    def medium(self) -> Medium:
        """The fluid."""
        return Medium(self.speed_of_sound_m_s, self.air_density_kg_m3)

    @property
    def planes(self) -> tuple[Plane, Plane]:
        """The planes XZ and YZ."""
        half, bottom, top = (
            length / 1000
            for length in (self.plane_half_width_mm, self.plane_bottom_mm, self.plane_top_mm)
        )
        return (
            Plane("XZ", half, bottom, top, self.plane_shape),
            Plane("YZ", half, bottom, top, self.plane_shape),
        )

    @model_validator(mode="after")
    def _check_sound(self) -> SoundPlanes:
        if self.plane_top_mm <= self.plane_bottom_mm:
            refuse("plane_top_mm", self.plane_top_mm, permitted(type(self), "plane_top_mm"))
        plate, highest = self.structure, max(self.modes)  # type: ignore[attr-defined]
        assert isinstance(plate, Plate)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # the page warns
                check_pistons(pistons(plate), resonance(plate, highest), self.medium)
        except ValueError as error:
            known, here = "use more and smaller pistons", "take lower modes or a finer grid"
            refuse("modes", highest, str(error).replace(known, here))
        return self
