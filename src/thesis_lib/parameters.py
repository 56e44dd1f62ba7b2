"""The parameters of every figure set: typed, bounded, and refused in one line.

One model per figure set serves the command line, the notebooks and the tables of the book. A
field's ``allowed`` text is what the user reads, in the table and in the error message alike.
"""

from __future__ import annotations

import difflib
import json
from collections.abc import Iterable, Mapping, Sequence
from copy import copy
from itertools import pairwise
from typing import Annotated, Any, Literal

from pydantic import BaseModel, Field, ValidationError, create_model, model_validator
from pydantic_core import from_json

from thesis_lib import setups
from thesis_lib.camera_study import (
    Azimuth,
    CameraStudy,
    Elevation,
    Layout,
    Name,
    Order,
    ParameterError,
    Positive,
    Resolution,
    Study,
    Width,
    allowed_text,
    field,
    permitted,
    shown,
    trials,
    unit,
)
from thesis_lib.design_request import DesignLaw
from thesis_lib.experiment.lab_layouts import LabElevation, LabLayout
from thesis_lib.experiment.lab_motions import LabModes
from thesis_lib.experiment.lab_plates import LabPlate
from thesis_lib.experiment.requests import ExperimentCameras, ExperimentResolution
from thesis_lib.ledger_requests import Claims
from thesis_lib.optics_request import Cameras
from thesis_lib.planning.questions import Planner
from thesis_lib.planning.request import PlanRequest
from thesis_lib.setups import Setting
from thesis_lib.shapes import CONTOURS, ShapeMarkers
from thesis_lib.sound_planes import PlateMarkers, SoundPlanes
from thesis_lib.structures import Structure
from thesis_lib.text import first_hidden, listed, one_line

__all__ = ["CHAPTERS", "STUDIES", "CameraStudy", "ParameterError", "Study", "camera_study",
           "chapter_title", "describe", "nearest", "plan_request", "unit", "validate"]  # fmt: skip

ELEVATION = "a number above 0, at most 90"
DISTANCE = field(
    ...,
    "distance of all cameras from the structure's centre",
    "a number above the structure's reach, at most 100000",
)
RESOLUTION = field(
    ...,
    "width and height of the sensors",
    "[width, height], whole numbers from 2 to 20000",
)
AZIMUTH = field(..., "the pair stands at plus and minus this azimuth", "a number from -360 to 360")


# The four studies. Where a field has no default here, it is what the table of the structure says.


class Distance(CameraStudy):
    """Case 1: two cameras at growing distance (sections 3.3.1, 4.2.1, 6.2.1)."""

    study = "distance"
    title = "distance of the cameras"
    varied = "distance_mm"
    varied_label = "distance d"

    distances_mm: list[Positive] = field(
        ...,
        "distances of the pair from the structure's centre",
        "a list of different numbers above the structure's reach, at most 100000",
        min_length=1,
    )
    azimuth_deg: Azimuth = AZIMUTH
    elevation_deg: Elevation = field(..., "elevation of the cameras", ELEVATION)
    resolution_px: Resolution = RESOLUTION

    def printed(self) -> list[Setting]:
        """One setting per distance."""
        return setups.distance_settings(
            self.distances_mm, self.azimuth_deg, self.elevation_deg, self.resolution_px
        )


class Aperture(CameraStudy):
    """Cases 2a–2d: two cameras at growing aperture (sections 3.3.2, 4.2.2, 6.2.2)."""

    study = "aperture"
    title = "aperture between the cameras"
    varied = "aperture_deg"
    varied_label = "aperture α"

    cases: list[Literal["2a", "2b", "2c", "2d"]] = field(
        lambda: ["2a", "2b", "2c", "2d"],
        "cases to run",
        "a list of different ones of 2a, 2b, 2c, 2d",
        min_length=1,
    )
    half_apertures_deg: list[Annotated[float, Field(gt=0, lt=180)]] = field(
        ...,
        "half of the azimuths between the cameras, cases 2a and 2c",
        "a list of different numbers above 0 and below 180",
        min_length=1,
    )
    elevations_deg: list[Elevation] = field(
        ...,
        "elevations of the cameras, cases 2b and 2d",
        "a list of different numbers above 0 and below 90",
        min_length=1,
    )
    elevation_deg: Elevation = field(..., "elevation in cases 2a and 2c", ELEVATION)
    distance_mm: Positive = DISTANCE
    resolution_px: Resolution = RESOLUTION

    def printed(self) -> list[Setting]:
        """Cases in the order asked for, apertures in the order of the table."""
        return setups.aperture_settings(
            self.cases,
            self.half_apertures_deg,
            self.elevations_deg,
            self.elevation_deg,
            self.distance_mm,
            self.resolution_px,
        )


class Resolutions(CameraStudy):
    """Case 3: two cameras of growing resolution (sections 3.3.3, 4.2.3, 6.2.3)."""

    study = "resolution"
    title = "resolution of the cameras"
    varied = "width_px"
    varied_label = "resolution"

    widths_px: list[Width] = field(
        ...,
        "widths of the sensors; heights are 9/16 of them",
        "a list of different whole numbers from 2 to 20000",
        min_length=1,
    )
    distance_mm: Positive = DISTANCE
    azimuth_deg: Azimuth = AZIMUTH
    elevation_deg: Elevation = field(..., "elevation of the cameras", ELEVATION)

    def printed(self) -> list[Setting]:
        """One setting per width."""
        return setups.resolution_settings(
            self.widths_px, self.distance_mm, self.azimuth_deg, self.elevation_deg
        )


class Arrays(CameraStudy):
    """Cases 4a–4e: growing numbers of cameras (sections 3.3.4, 4.2.4, 6.2.4), and own layouts."""

    study = "arrays"
    title = "number and layout of the cameras"
    varied = "n_cameras"
    varied_label = "cameras"

    cases: list[Literal["4a", "4a'", "4b", "4c", "4d", "4e"]] = field(
        lambda: ["4a", "4a'", "4b", "4c", "4d", "4e"],
        "cases to run",
        "a list of different ones of 4a, 4a', 4b, 4c, 4d, 4e; empty only with layouts",
    )
    pair_order: dict[Literal["4a", "4a'", "4b", "4c", "4d", "4e"], Order] = field(
        lambda: {},
        'order of adding pairs by case, over the default {"4d": "reversed"}',
        'an object such as {"4b": "reversed"}: cases of Table 3.4 to "printed" or "reversed"',
    )
    layouts: dict[Name, Annotated[Layout, Field(min_length=1, max_length=50)]] = field(
        lambda: {},
        "your own layouts: name to a list of growing sets of [azimuth, elevation] in degrees",
        'an object such as {"mine": [[[0, 20], [90, 20]]]}: new names of 1 to 40 characters, each '
        "with growing sets of 2 to 100 different cameras, azimuth -360 to 360, elevation above 0 "
        "to 90",
    )
    distance_mm: Positive = DISTANCE
    resolution_px: Resolution = RESOLUTION

    @model_validator(mode="after")
    def _check_cases(self) -> Arrays:
        if not self.cases and not self.layouts:
            self.refuse("cases")
        grow = all(
            len(one) < len(other) for sets in self.layouts.values() for one, other in pairwise(sets)
        )
        if set(self.layouts) & set(setups.pairs()) or not grow:
            self.refuse("layouts")
        return self

    def printed(self) -> list[Setting]:
        """Growing sets of cameras, cases first and layouts after them."""
        return setups.array_settings(
            self.cases,
            setups.reading("beam")["pair_order"]
            | {str(case): order for case, order in self.pair_order.items()},
            self.layouts,
            self.distance_mm,
            self.resolution_px,
        )


class OfL(Arrays):
    """Cases 4a–4e around an L-shaped plate."""

    study = "l"
    title = "an L"
    trials: int = trials(100)


class Perforated(Arrays):
    """Cases 4a–4e around a plate with holes."""

    study = "holes"
    title = "a plate with holes"
    trials: int = trials(100)


# What beam and sound add.


class BeamMarkers(BaseModel):
    """Parameters of the beam."""

    first_marker_mm: Annotated[float, Field(ge=0, le=23)] = field(
        ..., "distance of the first marker from the clamp", "a number from 0 to 23"
    )

    @property
    def structure(self) -> Structure:
        """What is measured."""
        return setups.beam(self.first_marker_mm / 1000)


class PlateSound(SoundPlanes):
    """Parameters of the sound field of a plate's study."""

    @property
    def plate_request(self) -> dict[str, Any]:
        """Parameters of the plate's study whose deflections radiate."""
        model = CAMERA_STUDIES[self.name.replace("sound", "plate")]  # type: ignore[attr-defined]
        return {key: value for key, value in self.model_dump().items() if key in model.model_fields}


def _figure_set(subject: str, kind: type[CameraStudy], *more: type[BaseModel]) -> type[CameraStudy]:
    """A study of one structure: its fields default to what the structure's tables say."""
    grid = {"grid": setups.plate().grid}
    like = "plate" if subject == "shape" else subject
    printed = {**grid, **setups.reading(like), **setups.table(subject, kind.study)}
    bases = (*more, kind)
    fields: dict[str, Any] = {}
    for name, info in {
        k: v for base in reversed(bases) for k, v in base.model_fields.items()
    }.items():
        if name in printed and info.is_required():
            filled = copy(info)
            filled.default = _held(name, printed[name])
            fields[name] = (info.annotation, filled)
    model: type[CameraStudy] = create_model(
        f"{subject.title()}{kind.__name__}",
        __base__=bases,  # type: ignore[arg-type]
        __doc__=kind.__doc__,
        **fields,
    )
    model.subject, model.name = subject, f"{subject}-{kind.study}"
    model.title = f"{subject.title()}: {kind.title}"
    return model


def _held(name: str, value: Any) -> Any:
    """A value of the tables as models hold it."""
    if name == "resolution_px":
        return tuple(value)
    return list(map(_frozen, value)) if name in CONTOURS else value


def _frozen(value: Any) -> Any:
    return tuple(map(_frozen, value)) if isinstance(value, list) else float(value)


_KINDS: tuple[type[CameraStudy], ...] = (Distance, Aperture, Resolutions, Arrays)
_EXTRA: dict[str, tuple[type[BaseModel], ...]] = {
    "beam": (BeamMarkers,), "plate": (PlateMarkers,), "sound": (PlateSound,),
}  # fmt: skip
CAMERA_STUDIES: dict[str, type[CameraStudy]] = {
    study.name: study
    for subject, extra in _EXTRA.items()
    for study in (_figure_set(subject, kind, *extra) for kind in _KINDS)
}
_SUBJECTS = {"ch2": "cameras", "ch3": "beam", "ch4": "plate", "ch5": "experiment", "lab": "lab",
             "ch6": "sound", "beyond": "design", "shapes": "shape", "": "claims"}  # fmt: skip
_ALL: list[type[Study]] = [
    Cameras, *CAMERA_STUDIES.values(), ExperimentResolution, ExperimentCameras,
    LabElevation, LabLayout, LabModes, LabPlate, DesignLaw, Planner,
    *(_figure_set("shape", kind, ShapeMarkers) for kind in (OfL, Perforated)), Claims,
]  # fmt: skip
STUDIES: dict[str, type[Study]] = {
    study.name: study
    for subject in _SUBJECTS.values()
    for study in _ALL
    if study.subject == subject
}
CHAPTERS = {
    chapter: [name for name, study in STUDIES.items() if study.subject == subject]
    for chapter, subject in _SUBJECTS.items()
    if chapter
}


def chapter_title(name: str) -> str:
    """What a name of :data:`CHAPTERS` stands for.

    Examples
    --------
    >>> chapter_title("ch3"), chapter_title("lab")
    ('Chapter 3', 'Beyond chapter 5')
    """
    titles = {
        "lab": "Beyond chapter 5",
        "beyond": "Beyond the thesis",
        "shapes": "Shapes without symmetry",
    }
    return titles.get(name, f"Chapter {name.removeprefix('ch')}")


def validate(name: str, values: Mapping[str, Any]) -> Study:
    """Parameters of a figure set from plain values.

    Raises
    ------
    ParameterError
        In one line: the set and field, what was given, what is allowed and in which unit.
    """
    if name not in STUDIES:
        raise ParameterError(
            f"{one_line(name)}: no such figure set{_hint(name, [*STUDIES, *CHAPTERS])}; "
            f"{listed([*STUDIES, *CHAPTERS], 'thesis list')}"
        )
    return _validated(STUDIES[name], values)


def plan_request(values: Mapping[str, Any]) -> PlanRequest:
    """Parameters of ``thesis plan`` from plain values; errors as :func:`validate`."""
    request = _validated(PlanRequest, values)
    assert isinstance(request, PlanRequest)
    return request


def _validated(model: type[Study], values: Mapping[str, Any]) -> Study:
    """A model's parameters from plain values, refused in one line."""
    name = model.name
    parts = []
    for key, value in values.items():
        if key not in model.model_fields:
            names = list(model.model_fields)
            hint = _hint(str(key), names)
            command = "thesis plan --parameters" if name == "plan" else f"thesis list {name}"
            there = listed((one for one in names if one != "cube"), command)
            raise ParameterError(f"{name}: no parameter {one_line(str(key))}{hint}; {there}")
        try:
            text = json.dumps(value).replace("4a\\u2032", "4a'")
            from_json(f"[{text}]")
        except (TypeError, ValueError, RecursionError):  # not JSON, or nested beyond measure
            problem = f"{key}: given {shown(value)}, {permitted(model, key)}"
            raise ParameterError(f"{name}: {problem}") from None
        parts.append(f'"{key}": {text}')
    try:
        request = model.model_validate_json(f"{{{', '.join(parts)}}}")
    except ValidationError as error:
        raise ParameterError(f"{name}: {_first_problem(model, values, error)}") from None
    if problem := first_hidden(values):
        raise ParameterError(f"{name}: {problem}")
    return request


def camera_study(name: str, values: Mapping[str, Any] | None = None) -> CameraStudy:
    """Parameters of one of the camera studies, of chapters 3, 4 and 6."""
    study = validate(name, values or {})
    assert isinstance(study, CameraStudy)
    return study


def describe(model: type[Study]) -> list[dict[str, str]]:
    """One row per parameter: name, default, unit, allowed, meaning."""
    defaults = model().model_dump(mode="json")
    return [
        {
            "name": name,
            "default": json.dumps(defaults[name], ensure_ascii=False),
            "unit": unit(name),
            "allowed": allowed_text(model, name),
            "meaning": info.description or "",
        }
        for name, info in sorted(
            model.model_fields.items(),
            key=lambda item: (item[0] in Study.model_fields, item[0] in CameraStudy.model_fields),
        )
    ]


def nearest(name: str, names: Iterable[str]) -> str:
    """The name most like `name`, or empty if none is."""
    return next(iter(difflib.get_close_matches(name, list(names), 1, 0.6)), "")


def _hint(name: str, names: Iterable[str]) -> str:
    meant = nearest(name, names)
    return f" (did you mean {meant}?)" if meant else ""


def _first_problem(model: type[Study], values: Mapping[str, Any], error: ValidationError) -> str:
    problem = error.errors(include_url=False)[0]
    if problem["type"] == "refused":
        return problem["msg"]
    key = str(problem["loc"][0])
    place, inside = key, values[key]
    for part in problem["loc"][1:]:  # where in the value; the rest is pydantic's own words
        if isinstance(inside, Mapping) and part in inside:
            place, inside = f"{place}[{shown(part)}]", inside[part]
        elif isinstance(inside, Sequence) and isinstance(part, int) and part < len(inside):
            place, inside = f"{place}[{part}]", inside[part]
    return f"{place}: given {shown(problem['input'])}, {permitted(model, key)}"
