"""What a manifest says of the sound that is asked for."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from pydantic import BeforeValidator, Field

from thesis_lib.arrays import Array
from thesis_lib.studies.refusals import Refusing, permitted, refuse
from thesis_lib.studies.vocabulary import Positive, field

if TYPE_CHECKING:
    from thesis_lib.acoustics.sources import Medium

Place = tuple[float, float]
Length = Annotated[float, Field(ge=-1e5, le=1e5)]
Point = tuple[Length, Length, Annotated[float, Field(gt=0, le=1e5)]]
Edge = Literal["free", "held"]
Wall = Annotated[
    Literal["yes", "no", "unknown"],  # YAML reads yes and no as true and false
    BeforeValidator(lambda value: ("no", "yes")[value] if isinstance(value, bool) else value),
]
FEWEST = 6  # markers that a surface needs


class Radiation(Refusing):
    """What the structure radiates, and where that is wanted."""

    outline_mm: Literal["structure", "hull"] | tuple[Place, ...] = field(
        "structure",
        "what radiates: length by width, the hull of the markers, or corners from the clamped "
        "corner",
        '"structure", "hull", or a list of 3 to 200 corners [x, y] whose edges do not cross, '
        "around all markers",
    )
    edges: Literal["by kind"] | tuple[Edge, ...] = field(
        "by kind",
        "edges of the outline that are held at rest, from each corner to the next; by kind: a "
        "beam's at x = 0, a plate's four, else none",
        '"by kind", or a list with "free" or "held" for each edge of the outline',
    )
    between: Literal["model", "spline"] | None = field(
        None,
        "what is fitted between markers: modes of the model, or a thin plate spline; null takes "
        "the model where there is one that fits",
        'null, "spline", or "model" for a beam or a plate',
    )
    points_mm: tuple[Point, ...] = field(
        ((0.0, 0.0, 1000.0),),
        "where the pressure is wanted: X, Y from the structure's centre, Z above its plane",
        "a list of 1 to 20 [X, Y, Z] with Z above 0",
        min_length=1,
        max_length=20,
    )
    plane_half_width_mm: Positive | None = field(
        None, "the planes XZ and YZ reach so far; null is the longer side"
    )
    plane_bottom_mm: Positive = field(50.0, "lowest height of the planes")
    plane_top_mm: Positive | None = field(
        None,
        "greatest height of the planes; null is the longer side above the lowest",
        "null, or a number above plane_bottom_mm, at most 100000",
    )
    wall: Wall = field(
        "unknown",
        "whether the structure lies in a wall, in whose plane no air flows around its edges",
    )
    speed_of_sound_m_s: Positive = field(343.0, "speed of sound in the air")
    air_density_kg_m3: Positive = field(1.21, "density of the air")

    @property
    def medium(self) -> Medium:
        """The air."""
        from thesis_lib.acoustics.sources import Medium

        return Medium(self.speed_of_sound_m_s, self.air_density_kg_m3)

    @property
    def points(self) -> Array:
        """Where the pressure is wanted, shape (3, n), m."""
        return np.array(self.points_mm, float).T / 1000

    def corners(self, size: tuple[float, float], markers: Array, diameter: float) -> Array:
        """The outline's corners (n, 2) in m, of a structure of a size with markers (2, m)."""
        if isinstance(self.outline_mm, tuple):
            return np.array(self.outline_mm, float) / 1000
        if self.outline_mm == "structure":
            return np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * np.array(size)
        from scipy.spatial import ConvexHull

        turn = 2 * np.pi * np.arange(8) / 8
        discs = markers[:, :, None] + diameter / 2 * np.stack([np.cos(turn), np.sin(turn)])[:, None]
        every = discs.reshape(2, -1).T
        return np.asarray(every[ConvexHull(every).vertices], float)

    def held(self, kind: str, corners: int) -> list[int]:
        """Numbers of the edges that are held at rest."""
        if self.edges != "by kind":
            return [i for i, edge in enumerate(self.edges) if edge == "held"]
        if self.outline_mm != "structure":
            return []
        return {"beam": [3], "plate": [0, 1, 2, 3]}.get(kind, [])

    def check(self, kind: str, size: tuple[float, float], markers: Array, diameter: float) -> None:
        """Refuse what does not go with the structure; lengths in m."""
        from thesis_lib.vibration.polygons import area, contains, distances, is_simple

        count = markers.shape[1]
        if count < FEWEST:
            why = "fewer do not tell how the surface between them moves"
            words = f"allowed with {FEWEST} markers or more, given {count}: {why}"
            self._refuse("outline_mm", words)
        corners = self.corners(size, markers, diameter)
        if isinstance(self.outline_mm, tuple):
            simple = 3 <= len(self.outline_mm) <= 200 and is_simple(self.outline_mm)
            if not simple or abs(area(self.outline_mm)) == 0:
                self._refuse("outline_mm")
            on = contains(corners, markers) | (distances(corners, markers).min(axis=0) < 1e-9)
            if not on.all():
                x, y = 1000 * markers[:, ~on][:, 0]
                why = f"allowed: corners around all markers, the one at ({x:g}, {y:g}) is outside"
                self._refuse("outline_mm", why)
        if self.edges != "by kind" and len(self.edges) != len(corners):
            edges = f'allowed: "by kind", or {len(corners)} of "free" and "held"'
            self._refuse("edges", edges)
        if self.between == "model" and (kind == "flat" or self.outline_mm != "structure"):
            why = 'allowed: null or "spline", since there is no model of this outline'
            self._refuse("between", why)
        if self.plane_top_mm is not None and self.plane_top_mm <= self.plane_bottom_mm:
            self._refuse("plane_top_mm")

    def _refuse(self, name: str, why: str = "") -> None:
        refuse(f"radiation.{name}", getattr(self, name), why or permitted(type(self), name))
