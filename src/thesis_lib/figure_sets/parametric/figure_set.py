"""Chapters 3, 4 and 6, and plates of other shapes: one parameter is varied at a time.

One model per figure set serves the command line, the notebooks and the tables of the book. Tables
and error messages show the same ``allowed`` text of a field.
"""

from collections.abc import Mapping
from copy import copy
from itertools import pairwise
from typing import Annotated, Any, Literal, Self, cast

from pydantic import BaseModel, BeforeValidator, Field, create_model, model_validator

from thesis_lib.facts import setups
from thesis_lib.figure_sets.figure_set import FigureSet
from thesis_lib.figure_sets.parametric.camera_study import CAMERA_CONDITIONS, CameraStudy
from thesis_lib.studies import fields
from thesis_lib.studies.request import PlateMarkers, SoundPlanes, validate_values
from thesis_lib.vibration.panel import Panel
from thesis_lib.vibration.polygons import Circle, Hole, ShapeError
from thesis_lib.vibration.structure import Structure

_AS_TYPED = BeforeValidator(
    lambda name: name.replace("4a′", "4a'") if isinstance(name, str) else name
)
Case = Annotated[Literal["4a", "4a'", "4b", "4c", "4d", "4e"], _AS_TYPED]
Order = Literal["printed", "reversed"]
Layout = list[
    Annotated[list[tuple[fields.Azimuth, fields.Elevation]], Field(min_length=2, max_length=100)]
]
FromCentre = Annotated[
    fields.Positive,
    Field(description="distance of all cameras from the structure's centre, beyond its reach"),
]
OfPair = Annotated[
    fields.Azimuth, Field(description="the pair stands at plus and minus this azimuth")
]


# The four studies. A field without a default here has that of the structure's table.


class Distance(CameraStudy):
    """Case 1: two cameras at growing distance (sections 3.3.1, 4.2.1, 6.2.1)."""

    study = "distance"
    title = "distance of the cameras"
    varied = "distance_mm"
    varied_label = "distance d"
    list_settings = staticmethod(setups.distance_settings)

    distances_mm: fields.Several[fields.Positive]
    """distances of the pair from the structure's centre, beyond its reach"""
    azimuth_deg: OfPair
    elevation_deg: fields.Elevation
    """elevation of the cameras"""
    resolution_px: fields.SensorSize


class Aperture(CameraStudy):
    """Cases 2a–2d: two cameras at growing aperture (sections 3.3.2, 4.2.2, 6.2.2)."""

    study = "aperture"
    title = "aperture between the cameras"
    varied = "aperture_deg"
    varied_label = "aperture α"
    list_settings = staticmethod(setups.aperture_settings)

    cases: fields.Several[Literal["2a", "2b", "2c", "2d"]] = ["2a", "2b", "2c", "2d"]
    """cases to run"""
    half_apertures_deg: fields.Several[fields.HalfAperture]
    """half of the azimuths between the cameras, cases 2a and 2c"""
    elevations_deg: fields.Several[fields.Elevation]
    """elevations of the cameras, cases 2b and 2d"""
    elevation_deg: fields.Elevation
    """elevation in cases 2a and 2c"""
    distance_mm: FromCentre
    resolution_px: fields.SensorSize


class Resolutions(CameraStudy):
    """Case 3: two cameras of growing resolution (sections 3.3.3, 4.2.3, 6.2.3)."""

    study = "resolution"
    title = "resolution of the cameras"
    varied = "width_px"
    varied_label = "resolution"
    list_settings = staticmethod(setups.resolution_settings)

    widths_px: fields.Several[fields.Width]
    """widths of the sensors; heights are 9/16 of them"""
    distance_mm: FromCentre
    azimuth_deg: OfPair
    elevation_deg: fields.Elevation
    """elevation of the cameras"""


class Arrays(CameraStudy):
    """Cases 4a–4e: growing numbers of cameras (sections 3.3.4, 4.2.4, 6.2.4); users' layouts."""

    study = "arrays"
    title = "number and layout of the cameras"
    varied = "n_cameras"
    varied_label = "cameras"

    cases: fields.Distinct[Case] = ["4a", "4a'", "4b", "4c", "4d", "4e"]
    """cases to run"""
    pair_order: dict[Case, Order] = {}
    """order of adding pairs by case, over the default {"4d": "reversed"}"""
    layouts: dict[
        Annotated[fields.Name, _AS_TYPED], Annotated[Layout, Field(min_length=1, max_length=50)]
    ] = {}
    """your own layouts: name to a list of growing sets of [azimuth, elevation] in degrees, such as
    {"mine": [[[0, 20], [90, 20]]]}"""
    distance_mm: FromCentre
    resolution_px: fields.SensorSize

    @model_validator(mode="after")
    def _check_cases(self) -> Self:
        if not self.cases and not self.layouts:
            self.refuse("cases", CAMERA_CONDITIONS["cases"])
        grow = all(
            len(one) < len(other) for sets in self.layouts.values() for one, other in pairwise(sets)
        )
        if set(self.layouts) & set(setups.camera_pairs()) or not grow:
            self.refuse("layouts", CAMERA_CONDITIONS["layouts"])
        return self

    def thesis_settings(self) -> list[setups.Setting]:
        """Return growing sets of cameras, cases first and layouts after them."""
        return setups.array_settings(
            self.cases,
            setups.assumed_values("beam")["pair_order"]
            | {str(case): order for case, order in self.pair_order.items()},
            self.layouts,
            self.distance_mm,
            self.resolution_px,
        )


class OfL(Arrays):
    """Cases 4a–4e around an L-shaped plate."""

    study = "l"
    title = "an L"
    trials: fields.Trials = 100


class Perforated(Arrays):
    """Cases 4a–4e around a plate with holes."""

    study = "holes"
    title = "a plate with holes"
    trials: fields.Trials = 100


# Further parameters of beam and sound.


class BeamMarkers(fields.Fields):
    """Parameters of the beam."""

    first_marker_mm: Annotated[fields.Real, Field(ge=0, le=23)]
    """distance of the first marker from the clamp"""

    @property
    def structure(self) -> Structure:
        """Return the structure that is measured."""
        return setups.thesis_beam(self.first_marker_mm / 1000)


class PlateSoundStudy(SoundPlanes):
    """Parameters of the sound field of a plate's study."""

    @property
    def plate_request(self) -> dict[str, Any]:
        """Parameters of the plate's study whose deflections radiate."""
        model = CAMERA_STUDIES[self.name.replace("sound", "plate")]  # type: ignore[attr-defined]
        return {key: value for key, value in self.model_dump().items() if key in model.model_fields}


# Plates without symmetry, cut from a rectangle, with thickness and material of the thesis's plate.

Coordinate = Annotated[fields.Real, Field(ge=0, le=1e5)]
Corner = tuple[Coordinate, Coordinate]
Support = Literal["simply supported", "clamped", "free"]
Edge = Annotated[str, Field(pattern=r"^[1-9][0-9]?$", title="numbers of edges as text")]
FORCE_AT = setups.thesis_plate().force_position
SHAPE_FIELDS = {
    "outline": "outline_mm",
    "supports": "edge_supports",
    "grid": "grid",
    "force_position": "force_mm",
    "element_size": "element_mm",
}


class ShapeMarkers(PlateMarkers):
    """Parameters of a plate of any shape."""

    outline_mm: Annotated[fields.Distinct[Corner], Field(min_length=3, max_length=40)]
    """corners of the outline, one after the other; the least x and the least y are 0"""
    circles_mm: Annotated[
        fields.Distinct[tuple[Coordinate, Coordinate, fields.Positive]], Field(max_length=20)
    ]
    """round holes [x, y, radius] that do not touch"""
    cutouts_mm: Annotated[
        fields.Distinct[Annotated[tuple[Corner, ...], Field(min_length=3, max_length=40)]],
        Field(max_length=10),
    ]
    """holes with corners"""
    support: Support = "simply supported"
    """how the outline is held; edges of holes are free"""
    edge_supports: dict[Edge, Support] = {}
    """edges of the outline that are held otherwise, by number: 1 goes from the first corner to the
    second, such as {"2": "free"}"""
    force_mm: Corner = (1000 * FORCE_AT[0], 1000 * FORCE_AT[1])
    """where the force acts, if amplitude_mm is "force"
    """
    element_mm: Annotated[fields.Real, Field(gt=0, le=1000)] = 10.0
    """length of the sides of the finite elements"""

    @property
    def structure(self) -> Panel:
        """Return the structure that is measured."""
        plate, count = setups.thesis_plate(self.grid), len(self.outline_mm)
        if any(int(edge) > count for edge in self.edge_supports):
            fields.refuse_value(
                "edge_supports", self.edge_supports, f"allowed: edges from 1 to {count}"
            )
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
            holes = error.given if isinstance(error.given, tuple) else (error.given,)
            round_ = any(isinstance(hole, Circle) for hole in holes)
            of_hole = "circles_mm" if round_ else "cutouts_mm"
            name = SHAPE_FIELDS.get(error.what, of_hole)
            fields.refuse_value(name, getattr(self, name), f"allowed: {error.allowed}")
            raise

    @property
    def holes(self) -> tuple[Hole, ...]:
        """Return the holes in m."""
        cut = (tuple((x / 1000, y / 1000) for x, y in corners) for corners in self.cutouts_mm)
        return (*(Circle(x / 1000, y / 1000, r / 1000) for x, y, r in self.circles_mm), *cut)


_SUBJECTS: dict[str, tuple[str, str, type[BaseModel], str]] = {
    # chapter, section of the thesis, class of further parameters, drawing function
    "beam": ("ch3", "section 3.3", BeamMarkers, "beam_figure"),
    "plate": ("ch4", "section 4.2", PlateMarkers, "plate_figure"),
    "sound": ("ch6", "section 6.2", PlateSoundStudy, "sound_figure"),
    "shape": ("shapes", "section 7.1", ShapeMarkers, "plate_figure"),
}


def figure_set(subject: str, kind: type[CameraStudy]) -> type[CameraStudy]:
    """Return a study of one structure, with defaults from the structure's tables."""
    _, section, more, _ = _SUBJECTS[subject]
    grid = {"grid": setups.thesis_plate().grid}
    like = "plate" if subject == "shape" else subject
    printed = {**grid, **setups.assumed_values(like), **setups.setup_table(subject, kind.study)}
    bases = (more, kind)
    defaults: dict[str, Any] = {}
    every = {name: info for one in reversed(bases) for name, info in one.model_fields.items()}
    for name, info in every.items():
        shared = name in CameraStudy.model_fields  # whose defaults are from the beam's table
        if name in printed and (shared or info.is_required()):
            filled, annotation = copy(info), cast(Any, info.annotation)
            filled.default = printed[name]
            defaults[name] = (annotation, filled)
    model: Any = cast(Any, create_model)(
        f"{subject.title()}{kind.__name__}", __base__=bases, __doc__=kind.__doc__, **defaults
    )
    model.subject, model.name = subject, f"{subject}-{kind.study}"
    model.title = f"{subject.title()}: {kind.title}"
    model.section = section
    return model


_STUDY_KINDS: tuple[type[CameraStudy], ...] = (Distance, Aperture, Resolutions, Arrays)
CAMERA_STUDIES: dict[str, type[CameraStudy]] = {
    study.name: study
    for subject in ("beam", "plate", "sound")
    for study in (figure_set(subject, kind) for kind in _STUDY_KINDS)
}
SHAPE_STUDIES: dict[str, type[CameraStudy]] = {
    study.name: study for study in (figure_set("shape", kind) for kind in (OfL, Perforated))
}


def camera_study(name: str, values: Mapping[str, Any] | None = None) -> CameraStudy:
    """Return the parameters of one of the camera studies, of chapters 3, 4 and 6 or of a shape."""
    return validate_values({**CAMERA_STUDIES, **SHAPE_STUDIES}[name], values or {})


def camera_set(request: type[CameraStudy]) -> FigureSet:
    """Return the figure set of a camera study."""
    chapter, _, _, figure = _SUBJECTS[request.subject]
    how: dict[str, Any] = {"module": f"{__package__}.compute", "kept": request.subject == "plate"}
    if request.subject == "sound":
        how = {"module": f"{__package__}.sound", "after": (f"plate-{request.study}",)}
    return FigureSet(request=request, chapter=chapter, figure=figure, in_pieces=True, **how)


FIGURE_SETS = [*map(camera_set, (*CAMERA_STUDIES.values(), *SHAPE_STUDIES.values()))]
