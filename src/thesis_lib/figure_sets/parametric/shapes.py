"""The parameters of ``shape-l`` and ``shape-holes``: plates without symmetry, cut from a rectangle.

Both are as thick as the thesis's plate and of its material, and so large as to fill its box.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from thesis_lib.facts import setups
from thesis_lib.studies.refusals import refuse
from thesis_lib.studies.shared_fields import PlateMarkers
from thesis_lib.studies.vocabulary import Positive, field
from thesis_lib.vibration.finite_elements import SIMPLY_SUPPORTED
from thesis_lib.vibration.panel import Panel
from thesis_lib.vibration.polygons import Circle, Hole, ShapeError

Coordinate = Annotated[float, Field(ge=0, le=1e5)]
Corner = tuple[Coordinate, Coordinate]
Support = Literal["simply supported", "clamped", "free"]
Edge = Annotated[str, Field(pattern=r"^[1-9][0-9]?$")]
CONTOURS = ("outline_mm", "circles_mm", "cutouts_mm")
FIELDS = {
    "outline": "outline_mm",
    "supports": "edge_supports",
    "grid": "grid",
    "force_position": "force_mm",
    "element_size": "element_mm",
}


class ShapeMarkers(PlateMarkers):
    """Parameters of a plate of any shape."""

    outline_mm: Annotated[list[Corner], Field(min_length=3, max_length=40)] = field(
        ...,
        "corners of the outline, one after the other",
        "a list of 3 to 40 different [x, y], numbers from 0 to 100000 of which the least x and the "
        "least y are 0, whose edges do not cross",
    )
    circles_mm: Annotated[list[tuple[Coordinate, Coordinate, Positive]], Field(max_length=20)] = (
        field(
            ...,
            "round holes, each with its centre and radius",
            "a list of at most 20 different [x, y, radius] inside the outline that do not touch",
        )
    )
    cutouts_mm: Annotated[
        list[Annotated[tuple[Corner, ...], Field(min_length=3, max_length=40)]],
        Field(max_length=10),
    ] = field(
        ...,
        "holes with corners",
        "a list of at most 10 different lists of 3 to 40 corners [x, y] inside the outline, which "
        "do not touch",
    )
    support: Support = field(SIMPLY_SUPPORTED, "how the outline is held; edges of holes are free")
    edge_supports: dict[Edge, Support] = field(
        lambda: {},
        "edges of the outline that are held otherwise, by number: 1 goes from the first corner to "
        "the second",
        'an object such as {"2": "free"}: numbers of edges to "simply supported", "clamped" or '
        '"free", which leaves no rigid motion',
    )
    force_mm: Corner = field(
        tuple(1000 * c for c in setups.plate().force_position),
        'where the force of amplitude_mm="force" acts',
        "[x, y] on the plate",
    )
    element_mm: Annotated[float, Field(gt=0, le=1000)] = field(
        10.0,
        "length of the sides of the finite elements",
        "a number above 0, at most 1000, that makes 200 to 60000 triangles and is less than the "
        "plate is narrow",
    )

    @property
    def structure(self) -> Panel:
        """What is measured."""
        plate, count = setups.plate(self.grid), len(self.outline_mm)
        if any(int(edge) > count for edge in self.edge_supports):
            refuse("edge_supports", self.edge_supports, f"allowed: edges from 1 to {count}")
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
            name = FIELDS.get(error.what) or self._hole_field(error.given)
            refuse(name, getattr(self, name), f"allowed: {error.allowed}")
            raise

    @property
    def holes(self) -> tuple[Hole, ...]:
        """Holes in m."""
        cut = (tuple((x / 1000, y / 1000) for x, y in corners) for corners in self.cutouts_mm)
        return (*(Circle(x / 1000, y / 1000, r / 1000) for x, y, r in self.circles_mm), *cut)

    def _hole_field(self, given: object) -> str:
        round_ = isinstance(given, Circle) or (
            isinstance(given, tuple) and any(isinstance(one, Circle) for one in given)
        )
        return "circles_mm" if round_ else "cutouts_mm"
