"""The parameters of ``shape-l`` and ``shape-holes``: plates without symmetry, cut from a rectangle.

Both are as thick as the thesis's plate and of its material, and so large as to fill its box.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from thesis_lib.facts import setups
from thesis_lib.studies.fields import Positive, Real, refuse_value
from thesis_lib.studies.request import PlateMarkers
from thesis_lib.vibration.panel import Panel
from thesis_lib.vibration.polygons import Circle, Hole, ShapeError

Coordinate = Annotated[Real, Field(ge=0, le=1e5)]
Corner = tuple[Coordinate, Coordinate]
Support = Literal["simply supported", "clamped", "free"]
Edge = Annotated[str, Field(pattern=r"^[1-9][0-9]?$", title="numbers of edges as text")]
FORCE_AT = setups.thesis_plate().force_position
CONTOUR_FIELDS = ("outline_mm", "circles_mm", "cutouts_mm")
SHAPE_FIELDS = {
    "outline": "outline_mm",
    "supports": "edge_supports",
    "grid": "grid",
    "force_position": "force_mm",
    "element_size": "element_mm",
}


class ShapeMarkers(PlateMarkers):
    """Parameters of a plate of any shape."""

    outline_mm: Annotated[list[Corner], Field(min_length=3, max_length=40)] = Field(
        ...,
        description="corners of the outline, one after the other; the least x and the least y "
        "are 0",
    )
    circles_mm: Annotated[list[tuple[Coordinate, Coordinate, Positive]], Field(max_length=20)] = (
        Field(..., description="round holes [x, y, radius] that do not touch")
    )
    cutouts_mm: Annotated[
        list[Annotated[tuple[Corner, ...], Field(min_length=3, max_length=40)]],
        Field(max_length=10),
    ] = Field(..., description="holes with corners")
    support: Support = Field(
        "simply supported", description="how the outline is held; edges of holes are free"
    )
    edge_supports: dict[Edge, Support] = Field(
        {},
        description="edges of the outline that are held otherwise, by number: 1 goes from the "
        'first corner to the second, such as {"2": "free"}',
    )
    force_mm: Corner = Field(
        (1000 * FORCE_AT[0], 1000 * FORCE_AT[1]),
        description='where the force acts, if amplitude_mm is "force"',
    )
    element_mm: Annotated[Real, Field(gt=0, le=1000)] = Field(
        10.0, description="length of the sides of the finite elements"
    )

    @property
    def structure(self) -> Panel:
        """Return the structure that is measured."""
        plate, count = setups.thesis_plate(self.grid), len(self.outline_mm)
        if any(int(edge) > count for edge in self.edge_supports):
            refuse_value("edge_supports", self.edge_supports, f"allowed: edges from 1 to {count}")
        try:
            return Panel(
                tuple((x / 1000, y / 1000) for x, y in self.outline_mm),
                tuple(self.edge_supports.get(str(i + 1), self.support) for i in range(count)),
                self.holes,
                plate.thickness,
                plate.density,
                plate.youngs_modulus,
                plate.poisson,
                plate.damping,
                (self.force_mm[0] / 1000, self.force_mm[1] / 1000),
                plate.grid,
                self.element_mm / 1000,
            )
        except ShapeError as error:
            name = SHAPE_FIELDS.get(error.what) or self._hole_field(error.given)
            refuse_value(name, getattr(self, name), f"allowed: {error.allowed}")
            raise

    @property
    def holes(self) -> tuple[Hole, ...]:
        """Return the holes in m."""
        cut = (tuple((x / 1000, y / 1000) for x, y in corners) for corners in self.cutouts_mm)
        return (*(Circle(x / 1000, y / 1000, r / 1000) for x, y, r in self.circles_mm), *cut)

    def _hole_field(self, given: object) -> str:
        round_ = isinstance(given, Circle) or (
            isinstance(given, tuple) and any(isinstance(one, Circle) for one in given)
        )
        return "circles_mm" if round_ else "cutouts_mm"
