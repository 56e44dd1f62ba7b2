"""Parts of a manifest: structure, excitation, recorded force and sound radiation.

Lengths are in the unit of a field's suffix; properties without a suffix are in SI units.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import PurePath
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
import scipy
from pydantic import BeforeValidator, Field, model_validator

from thesis_lib.arrays import Array
from thesis_lib.measure.recordings.board import MarkersSpec, Place, beam_default
from thesis_lib.studies.fields import Fields, Flag, Positive, Real, Whole, refuse_value
from thesis_lib.templates import join_words
from thesis_lib.vibration import polygons

if TYPE_CHECKING:
    from thesis_lib.acoustics.radiation import Medium


class StructureSpec(Fields):
    """The structure that is filmed."""

    kind: Literal["beam", "plate", "flat"] = "beam"
    """kind of structure, which determines the model for comparison with measured shapes"""
    length_mm: Positive = Field(default_factory=beam_default("length", 1000))
    """length along x"""
    width_mm: Positive = Field(default_factory=beam_default("width", 1000))
    """width along y"""
    thickness_mm: Positive = Field(default_factory=beam_default("thickness", 1000))
    """thickness"""
    density_kg_m3: Positive = Field(default_factory=beam_default("density"))
    """density"""
    youngs_modulus_pa: Real = Field(default_factory=beam_default("youngs_modulus"), gt=0, le=1e13)
    """Young's modulus"""
    poissons_ratio: Real = Field(0.3, ge=0, le=0.5)
    """Poisson's ratio, for the model of a plate"""
    damping: Real = Field(default_factory=beam_default("damping"), gt=0, lt=0.7)
    """modal damping ratio"""
    force_position_mm: Positive = Field(default_factory=beam_default("force_position", 1000))
    """distance of the force from x = 0, a beam's clamp"""
    force_across_mm: Positive | None = None
    """distance of the force from y = 0; null is half the width"""
    markers: MarkersSpec = Field(default_factory=MarkersSpec)
    """its markers"""

    @model_validator(mode="after")
    def _check(self) -> StructureSpec:
        if self.force_position_mm > self.length_mm:
            self.refuse("force_position_mm", "allowed: at most length_mm, in mm")
        if self.force_across_mm is not None and self.force_across_mm > self.width_mm:
            self.refuse("force_across_mm", "allowed: null, or at most width_mm, in mm")
        if self.kind == "plate" and self.markers.points_mm is None and self.markers.rows < 2:
            refuse_value("markers.rows", self.markers.rows, "allowed on a plate: at least 2")
        size, radius = np.array([[self.length_mm], [self.width_mm]]), self.markers.diameter_mm / 2
        points, hole = 1000 * self.marker_points, self.markers.hole_mm
        given = self.markers.model_dump(mode="json", exclude={"hole_mm"})
        if np.any(points < radius - 1e-9) or np.any(points > size - radius + 1e-9):
            refuse_value("markers", given, "allowed: markers that lie on the structure")
        apart = np.linalg.norm(points[:, :, None] - points[:, None], axis=0)
        if np.any(apart[np.triu_indices(points.shape[1], 1)] < 2 * radius):
            refuse_value("markers", given, "allowed: markers that do not overlap")
        if hole is not None:
            place = np.array(hole)[:, None]
            near = np.linalg.norm(points - place, axis=0).min() < 2 * radius
            if near or np.any(place < 0) or np.any(place > size):
                away = "on the structure, at least a diameter from every marker's centre"
                refuse_value("markers.hole_mm", hole, f"allowed: null, or [x, y] {away}")
        return self

    @property
    def extent(self) -> tuple[float, float]:
        """Return length and width, in m."""
        return self.length_mm / 1000, self.width_mm / 1000

    @property
    def marker_points(self) -> Array:
        """Return the markers' centres (2, markers) in m, from the clamped corner, row by row."""
        m = self.markers
        if m.points_mm is not None:
            return np.array(m.points_mm).T / 1000
        x = self.length_mm / 2 + (np.arange(m.columns) - (m.columns - 1) / 2) * m.spacing_mm
        y = self.width_mm / 2 + (np.arange(m.rows) - (m.rows - 1) / 2) * m.row_spacing_mm
        return np.stack([np.tile(x, m.rows), np.repeat(y, m.columns)]) / 1000

    @property
    def force_place(self) -> Array:
        """Return the force's point of action, shape (2,), in m, from the clamped corner."""
        across = self.force_across_mm or self.width_mm / 2
        return np.array([self.force_position_mm, across]) / 1000


class ModeSearch(Fields):
    """Search options where there are several modes or sines."""

    from_hz: Positive = 2.0
    """lowest frequency"""
    to_hz: Positive | None = None
    """highest frequency; null is half of the lowest frame rate, above which cameras must differ in
    rate or start"""
    count: Whole | None = Field(None, ge=1, le=20)
    """number of modes or sines; null takes all that stand out of the noise"""
    near_hz: tuple[Positive, ...] | None = Field(None, min_length=1, max_length=20)
    """approximate frequencies of the modes or sines; replaces count"""

    @model_validator(mode="after")
    def _check(self) -> ModeSearch:
        if self.to_hz is not None and self.to_hz <= self.from_hz:
            self.refuse("to_hz", "allowed: null, or a number above from_hz, in Hz")
        high = self.to_hz or np.inf
        if self.near_hz and not all(self.from_hz <= f <= high for f in self.near_hz):
            self.refuse("near_hz", "allowed: null, or frequencies between from_hz and to_hz")
        return self


Kind = Literal["sine", "multisine", "free_decay", "sweep", "random"]


@dataclass(frozen=True)
class Behaviour:
    """Properties of a kind of excitation: permitted inputs, and method of measurement."""

    #: First result: one deflection shape, several modes or sines, or motion over a recorded force
    result: Literal["shape", "modes", "response"]
    title: str  #: Name of the measured quantity in reports
    force: Literal["none", "optional", "required"] = "none"  #: Whether a force is recorded
    has_one_frequency: bool = False  #: Sound and phase follow from one steady sine
    decays: bool = False  #: The modes decay freely, fitted from the largest motion on
    sweeps: bool = False  #: The force sweeps from one frequency to another
    is_noise: bool = False  #: Segments are averaged: the force neither begins nor ends at rest
    assumption: str = ""  #: Assumption of the fit that the data cannot verify


EXCITATION_KINDS: dict[Kind, Behaviour] = {
    "sine": Behaviour("shape", "Deflection", has_one_frequency=True),
    "multisine": Behaviour(
        "modes", "Tones", assumption="Each tone is steady. Its shape may hold several modes."
    ),
    "free_decay": Behaviour(
        "modes",
        "Modes",
        force="optional",
        decays=True,
        assumption="Nothing drives the structure in the interval that is fitted: each mode decays "
        "freely.",
    ),
    "sweep": Behaviour("response", "Receptance", force="required", sweeps=True),
    "random": Behaviour("response", "Receptance", force="required", is_noise=True),
}
"""Behaviour by kind of excitation; other code asks for behaviour, not for names of kinds."""


def list_kinds(wanted: Callable[[Behaviour], bool]) -> str:
    """Return the kinds with the wanted behaviour, as text for an error message."""
    return join_words([f'"{name}"' for name, one in EXCITATION_KINDS.items() if wanted(one)], "or")


TABLE_SUFFIXES = frozenset([".csv", ".txt", ".tsv", ".tab", ".dat", ".asc", ".lvm"])
"""Suffixes of files that are read as a force table."""

INSIDE_TEXT = "a path inside the manifest's folder"
FileName = Annotated[str, Field(min_length=1, max_length=500, title=INSIDE_TEXT)]
Channel = Annotated[Whole, Field(ge=1, le=64)]


class Sweep(Fields):
    """A force that sweeps from one frequency to another."""

    from_hz: Positive | None = None
    """frequency at the start; null estimates it from the force"""
    to_hz: Positive | None = None
    """frequency at the end; null estimates it from the force"""
    duration_s: Positive | None = None
    """duration of the sweep; null estimates it from the force"""

    @model_validator(mode="after")
    def _check(self) -> Sweep:
        if self.to_hz is not None and self.to_hz == self.from_hz:
            self.refuse("to_hz", "allowed: null, or a number that is not from_hz, in Hz")
        return self


class Force(Fields):
    """A recorded force and its point of action."""

    file: FileName
    """recording of the force: a sound file, a video with the force as audio, or a table (.csv,
    .txt, .tsv, .dat, .lvm) of time and force"""
    full_scale_n: Positive | None = None
    """force in N at full scale of a sound file"""
    channel: Channel = 1
    """channel of a sound file with the force"""
    sound_channel: Channel | None = None
    """channel with a sound that the first camera also recorded, to compare the clocks; null takes
    the channel of the force"""
    offset_s: Annotated[Real, Field(ge=-1e5, le=1e5)] | None = None
    """start of the file on the first camera's clock; null estimates it from the sound"""
    at_mm: Place | None = None
    """point of action, from the clamped corner; null is the structure's force_position_mm and
    force_across_mm"""
    segment_s: Positive | Literal["whole"] | None = None
    """length of the averaged segments; whole is for motion that begins and ends at rest; null takes
    whole for a free decay or a sweep, and an eighth of the recording for random"""

    @property
    def is_table(self) -> bool:
        """Return whether the file is a table, with the force in N."""
        return PurePath(self.file).suffix.lower() in TABLE_SUFFIXES

    @model_validator(mode="after")
    def _check(self) -> Force:
        if self.is_table and self.full_scale_n is not None:
            self.refuse("full_scale_n", "allowed with a table, which is in N: null")
        if not self.is_table and self.full_scale_n is None:
            self.refuse("full_scale_n", "allowed with a sound file: a number above 0, in N")
        if self.is_table and self.offset_s is None:
            self.refuse("offset_s", "allowed with a table, which has no sound: a number")
        return self


class Excitation(Fields):
    """Excitation of the structure, and content of the audio tracks."""

    kind: Kind = "sine"
    """motion after rest_duration_s: a steady sine, several sines, the free decay after an impact or
    a release, or the response to a force that is a sweep or noise"""
    modes: ModeSearch = Field(default_factory=ModeSearch)
    """search options for modes, where kind is multisine or free_decay"""
    sweep: Sweep = Field(default_factory=Sweep)
    """the sweep, where kind is sweep"""
    frequency_hz: Positive | None = Field(
        default_factory=lambda data: (
            4.25 if EXCITATION_KINDS[data.get("kind", "sine")].has_one_frequency else None
        )
    )
    """frequency of the vibration; null estimates it"""
    undersampled: Flag = False
    """whether frequency_hz is known so accurately that it may exceed half of the frame rate"""
    amplitude_mm: Positive | None = None
    """largest expected deflection, for the warnings before measuring"""
    sound: Literal["force", "room", "none"] = "force"
    """content of the audio tracks: the force's signal, sound from microphones, or none that is
    needed, since the vibration is steady and the images determine its phase"""
    steady_interval_s: tuple[Real, Real] | None = None
    """begin and end of the steady-state interval on the first camera's clock; null detects it in
    the force's signal, or takes all after rest_duration_s"""
    rest_duration_s: Real = Field(1.0, ge=0, le=3600)
    """duration of the rest interval at the start; without sound it may be 0"""
    force_per_full_scale_n: Positive | None = None
    """force at the sound's full scale"""

    @property
    def behaviour(self) -> Behaviour:
        """Return the behaviour of this kind of excitation."""
        return EXCITATION_KINDS[self.kind]

    @model_validator(mode="after")
    def _check(self) -> Excitation:
        one = self.behaviour.has_one_frequency
        if not one and self.frequency_hz is not None:
            self.refuse("frequency_hz", f"allowed where kind is {self.kind}: null")
        if not one and self.sound == "none":
            self.refuse("sound", 'allowed for several modes: "force" or "room"')
        if self.undersampled and self.frequency_hz is None:
            self.refuse("undersampled", "allowed with a given frequency_hz: true or false")
        begin, end = self.steady_interval_s or (0.0, 1.0)
        if not 0 <= begin < end <= 1e5:
            self.refuse("steady_interval_s", "allowed: [begin, end], from 0 to 100000, in s")
        return self


class ReusedRig(Fields):
    """An earlier calibration, by this library or another program; a path alone is its file."""

    file: Annotated[str, Field(min_length=1, max_length=500)]
    """folder of an earlier measurement, or with one file for each camera; or a file:
    calibration.nc, YAML, XML or JSON of OpenCV, YAML of ROS or Kalibr, TOML of aniposelib,
    caliscope or Pose2Sim"""
    poses: Literal["kept", "anew"] = "kept"
    """kept if the cameras have not moved since; else their poses are estimated from the board
    images, and only the lenses are taken from the file"""
    unit: Literal["m", "mm"] | None = None
    """unit of the file's lengths; null is the unit that the file states, else m"""

    @model_validator(mode="before")
    @classmethod
    def _path(cls, given: Any) -> Any:
        return {"file": given} if isinstance(given, str) else given


Length = Annotated[Real, Field(ge=-1e5, le=1e5)]
Point = tuple[Length, Length, Annotated[Real, Field(gt=0, le=1e5)]]
Edge = Literal["free", "held"]
Wall = Annotated[
    Literal["yes", "no", "unknown"],  # YAML reads yes and no as true and false
    BeforeValidator(lambda value: ("no", "yes")[value] if isinstance(value, bool) else value),
]
MIN_SURFACE_MARKERS = 6  # for a surface fit


class Radiation(Fields):
    """Sound radiation of the structure, and the points at which it is computed."""

    outline_mm: Literal["structure", "hull"] | tuple[Place, ...] = "structure"
    """radiating area: length by width, hull of the markers, or corners from the clamped corner"""
    edges: Literal["by kind"] | tuple[Edge, ...] = "by kind"
    """edges of the outline that are held at rest, from each corner to the next; by kind: a beam's
    at x = 0, a plate's four, else none"""
    between: Literal["model", "spline"] | None = None
    """interpolation between markers: modes of the model, or a thin plate spline; null takes the
    model where there is one that fits"""
    points_mm: tuple[Point, ...] = Field(((0.0, 0.0, 1000.0),), min_length=1, max_length=20)
    """points of the pressure: X, Y from the structure's centre, Z above its plane"""
    plane_half_width_mm: Positive | None = None
    """half width of the planes XZ and YZ; null is the longer side"""
    plane_bottom_mm: Positive = 50.0
    """lowest height of the planes"""
    plane_top_mm: Positive | None = None
    """greatest height of the planes; null is the longer side above the lowest"""
    wall: Wall = "unknown"
    """whether the structure lies in a wall, which keeps air from flowing around its edges"""
    speed_of_sound_m_s: Positive = 343.0
    """speed of sound in the air"""
    air_density_kg_m3: Positive = 1.21
    """density of the air"""

    @property
    def medium(self) -> Medium:
        """Return the properties of the air."""
        from thesis_lib.acoustics.radiation import Medium

        return Medium(self.speed_of_sound_m_s, self.air_density_kg_m3)

    @property
    def points(self) -> Array:
        """Return the points at which the pressure is computed, shape (3, n), m."""
        return np.array(self.points_mm, float).T / 1000

    def corners(self, structure: StructureSpec) -> Array:
        """Return the corners (n, 2) in m of the outline."""
        if isinstance(self.outline_mm, tuple):
            return np.array(self.outline_mm, float) / 1000
        if self.outline_mm == "structure":
            return np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * np.array(structure.extent)
        turn, radius = 2 * np.pi * np.arange(8) / 8, structure.markers.diameter_mm / 1000 / 2
        circle = radius * np.stack([np.cos(turn), np.sin(turn)])
        discs = structure.marker_points[:, :, None] + circle[:, None]
        every = discs.reshape(2, -1).T
        return np.asarray(every[scipy.spatial.ConvexHull(every).vertices], float)

    def held_edges(self, kind: str) -> list[int]:
        """Return the indices of the edges that are held at rest."""
        if self.edges != "by kind":
            return [i for i, edge in enumerate(self.edges) if edge == "held"]
        if self.outline_mm != "structure":
            return []
        return {"beam": [3], "plate": [0, 1, 2, 3]}.get(kind, [])

    def check(self, structure: StructureSpec) -> None:
        """Refuse values that do not fit the structure."""
        markers, corners = structure.marker_points, self.corners(structure)
        if (count := markers.shape[1]) < MIN_SURFACE_MARKERS:
            least = f"allowed with {MIN_SURFACE_MARKERS} markers or more, given {count}"
            self._refuse("outline_mm", f"{least}: fewer do not tell how the surface moves")
        if isinstance(self.outline_mm, tuple):
            if not (3 <= len(self.outline_mm) <= 200 and polygons.is_simple(self.outline_mm)):
                why = "allowed: 3 to 200 corners [x, y] whose edges do not cross"
                self._refuse("outline_mm", why)
            on = polygons.polygon_depths(corners, markers) > -1e-9
            if not on.all():
                x, y = 1000 * markers[:, ~on][:, 0]
                why = f"allowed: corners around all markers, the one at ({x:g}, {y:g}) is outside"
                self._refuse("outline_mm", why)
        if self.edges != "by kind" and len(self.edges) != len(corners):
            self._refuse("edges", f'allowed: "by kind", or {len(corners)} of "free" and "held"')
        if self.between == "model" and (structure.kind == "flat" or self.outline_mm != "structure"):
            self._refuse("between", 'allowed: null or "spline", no model of this outline')
        if self.plane_top_mm is not None and self.plane_top_mm <= self.plane_bottom_mm:
            self._refuse("plane_top_mm", "allowed: null, or a number above plane_bottom_mm, in mm")

    def _refuse(self, name: str, why: str) -> None:
        refuse_value(f"radiation.{name}", getattr(self, name), why)
