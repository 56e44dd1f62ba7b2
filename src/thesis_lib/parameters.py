"""The parameters of every figure set: typed, bounded, and refused in one line.

One model per figure set serves the command line, the notebooks and the tables of the book. A
field's ``allowed`` text is what the user reads, in the table and in the error message alike.
"""

from __future__ import annotations

import difflib
import hashlib
import json
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator
from pydantic_core import PydanticCustomError, from_json

from thesis_lib import setups
from thesis_lib.cameras import hemisphere_directions
from thesis_lib.setups import Setting
from thesis_lib.structures import Beam, peak_deflection

Positive = Annotated[float, Field(gt=0, le=1e5)]
Azimuth = Annotated[float, Field(ge=-360, le=360)]
Elevation = Annotated[float, Field(gt=0, le=90)]
Width = Annotated[int, Field(ge=2, le=20_000)]
Resolution = tuple[Width, Width]
Mode = Annotated[int, Field(ge=1, le=30)]
Order = Literal["printed", "reversed"]
Layout = list[Annotated[list[tuple[Azimuth, Elevation]], Field(min_length=2, max_length=100)]]
Name = Annotated[str, Field(pattern=r"^\S(.{0,38}\S)?$")]

LENGTHS = "a list of different numbers above 0, at most 100000"
ELEVATION = "a number above 0, at most 90"


class ParameterError(ValueError):
    """A request that cannot be run; the message is one line for the person who made it."""


def _field(default: Any, what: str, allowed: str, **bounds: Any) -> Any:
    factory = {"default_factory": default} if callable(default) else {"default": default}
    return Field(description=what, json_schema_extra={"allowed": allowed}, **factory, **bounds)


def _printed(study: str, key: str) -> Any:
    """Default of a field: what the thesis's table says."""
    return lambda: setups.table("beam", study)[key]


def _resolution(study: str) -> Any:
    return _field(
        lambda: tuple(setups.table("beam", study)["resolution_px"]),
        "width and height of the sensors",
        "[width, height], whole numbers from 2 to 20000",
    )


def _distance(study: str) -> Any:
    return _field(
        _printed(study, "distance_mm"),
        "distance of all cameras from the structure's centre",
        "a number above the structure's reach, at most 100000",
    )


class CameraStudy(BaseModel):
    """Parameters that all camera studies share."""

    model_config = ConfigDict(
        extra="forbid", strict=True, frozen=True, allow_inf_nan=False, validate_default=True
    )

    name: ClassVar[str]
    title: ClassVar[str]
    varied: ClassVar[str]  # name of the varied parameter
    varied_label: ClassVar[str]

    focal_length_mm: Positive = _field(
        24.0, "focal length of the lenses", "a number above 0, at most 100000"
    )
    sensor_width_mm: Positive = _field(
        36.0, "width of the sensors", "a number above 0, at most 100000"
    )
    amplitude_mm: Positive | list[Positive] | Literal["force"] = _field(
        5.5,
        "peak of the deflection over the structure",
        'a number above 0, a list with one for each mode, or "force" (the response to 1 N)',
    )
    rest: Literal["rebuilt", "known"] = _field(
        "rebuilt",
        "whether the rest position is rebuilt from rounded pixels or known",
        '"rebuilt" or "known"',
    )
    modes: list[Mode] = _field(
        lambda: [1, 2, 3],
        "modes to measure",
        "a list of different whole numbers from 1 to 30",
        min_length=1,
    )
    trials: int = _field(
        200,
        "random shifts of the pixel grids beside the literal run",
        "a whole number from 0 to 10000",
        ge=0,
        le=10_000,
    )
    seed: int = _field(
        0, "seed of the random shifts", "a whole number from 0 to 2^63 - 1", ge=0, lt=2**63
    )
    cube: str = _field(
        "",
        "file to write the cube to, from the project's folder; empty writes nothing",
        "a path that ends in .nc, or empty",
    )

    def settings(self) -> list[Setting]:
        """The study's settings in the order of the thesis's tables."""
        raise NotImplementedError

    @property
    def structure(self) -> Beam:
        """What is measured."""
        return setups.beam()

    @property
    def peaks_m(self) -> list[float]:
        """Peak deflection of each mode in m."""
        if self.amplitude_mm == "force":
            return [peak_deflection(self.structure, mode) for mode in self.modes]
        if isinstance(self.amplitude_mm, list):
            return [peak / 1000 for peak in self.amplitude_mm]
        return [float(self.amplitude_mm) / 1000] * len(self.modes)

    @property
    def request(self) -> dict[str, Any]:
        """All that determines the result, as JSON values; where it is written does not."""
        return self.model_dump(mode="json", exclude={"cube"})

    @property
    def digest(self) -> str:
        """Ten hexadecimal digits that stand for the request."""
        text = json.dumps([self.name, self.request])  # the order of layouts is part of it
        return hashlib.sha256(text.encode()).hexdigest()[:10]

    @model_validator(mode="after")
    def _check_together(self) -> CameraStudy:
        for field in type(self).model_fields:
            value = getattr(self, field)
            repeats = isinstance(value, list) and len(set(value)) < len(value)
            if repeats and field != "amplitude_mm":
                self._refuse(field)
        if isinstance(self.amplitude_mm, list) and len(self.amplitude_mm) != len(self.modes):
            self._refuse("amplitude_mm")
        if self.cube and not self.cube.endswith(".nc"):
            self._refuse("cube")
        settings = self.settings()
        _check_reach(self, settings)
        for setting in settings:
            _check_coincidence(self, setting)
        return self

    def _refuse(self, field: str) -> None:
        _refuse(field, getattr(self, field), _permitted(type(self), field))


class BeamDistance(CameraStudy):
    """Case 1: two cameras at growing distance (thesis 3.3.1)."""

    name = "beam-distance"
    title = "Beam: distance of the cameras"
    varied = "distance_mm"
    varied_label = "distance d"

    distances_mm: list[Positive] = _field(
        _printed("distance", "distances_mm"),
        "distances of the pair from the structure's centre",
        "a list of different numbers above the structure's reach, at most 100000",
        min_length=1,
    )
    azimuth_deg: Azimuth = _field(
        _printed("distance", "azimuth_deg"), "the pair stands at plus and minus this azimuth",
        "a number from -360 to 360",
    )  # fmt: skip
    elevation_deg: Elevation = _field(
        _printed("distance", "elevation_deg"), "elevation of the cameras", ELEVATION
    )
    resolution_px: Resolution = _resolution("distance")

    def settings(self) -> list[Setting]:
        """One setting per distance."""
        return setups.distance_settings(
            self.distances_mm, self.azimuth_deg, self.elevation_deg, self.resolution_px
        )


class BeamAperture(CameraStudy):
    """Cases 2a–2d: two cameras at growing aperture (thesis 3.3.2)."""

    name = "beam-aperture"
    title = "Beam: aperture between the cameras"
    varied = "aperture_deg"
    varied_label = "aperture α"

    cases: list[Literal["2a", "2b", "2c", "2d"]] = _field(
        lambda: ["2a", "2b", "2c", "2d"],
        "cases to run",
        "a list of different ones of 2a, 2b, 2c, 2d",
        min_length=1,
    )
    half_apertures_deg: list[Annotated[float, Field(gt=0, lt=180)]] = _field(
        _printed("aperture", "half_apertures_deg"),
        "half of the azimuths between the cameras, cases 2a and 2c",
        "a list of different numbers above 0 and below 180",
        min_length=1,
    )
    elevations_deg: list[Elevation] = _field(
        _printed("aperture", "elevations_deg"),
        "elevations of the cameras, cases 2b and 2d",
        "a list of different numbers above 0 and below 90",
        min_length=1,
    )
    elevation_deg: Elevation = _field(
        _printed("aperture", "elevation_deg"), "elevation in cases 2a and 2c", ELEVATION
    )
    distance_mm: Positive = _distance("aperture")
    resolution_px: Resolution = _resolution("aperture")

    def settings(self) -> list[Setting]:
        """Cases in the order asked for, apertures in the order of the table."""
        return setups.aperture_settings(
            self.cases,
            self.half_apertures_deg,
            self.elevations_deg,
            self.elevation_deg,
            self.distance_mm,
            self.resolution_px,
        )


class BeamResolution(CameraStudy):
    """Case 3: two cameras of growing resolution (thesis 3.3.3)."""

    name = "beam-resolution"
    title = "Beam: resolution of the cameras"
    varied = "width_px"
    varied_label = "resolution"

    widths_px: list[Width] = _field(
        _printed("resolution", "widths_px"),
        "widths of the sensors; heights are 9/16 of them",
        "a list of different whole numbers from 2 to 20000",
        min_length=1,
    )
    distance_mm: Positive = _distance("resolution")
    azimuth_deg: Azimuth = _field(
        _printed("resolution", "azimuth_deg"), "the pair stands at plus and minus this azimuth",
        "a number from -360 to 360",
    )  # fmt: skip
    elevation_deg: Elevation = _field(
        _printed("resolution", "elevation_deg"), "elevation of the cameras", ELEVATION
    )

    def settings(self) -> list[Setting]:
        """One setting per width."""
        return setups.resolution_settings(
            self.widths_px, self.distance_mm, self.azimuth_deg, self.elevation_deg
        )


class BeamArrays(CameraStudy):
    """Cases 4a–4e: growing numbers of cameras (thesis 3.3.4), and the reader's own layouts."""

    name = "beam-arrays"
    title = "Beam: number and layout of the cameras"
    varied = "n_cameras"
    varied_label = "cameras"

    cases: list[Literal["4a", "4a'", "4b", "4c", "4d", "4e"]] = _field(
        lambda: ["4a", "4a'", "4b", "4c", "4d", "4e"],
        "cases to run",
        "a list of different ones of 4a, 4a', 4b, 4c, 4d, 4e; empty only with layouts",
    )
    pair_order: dict[Literal["4a", "4a'", "4b", "4c", "4d", "4e"], Order] = _field(
        lambda: {},
        'order of adding pairs by case, over the default {"4d": "reversed"}',
        'an object such as {"4b": "reversed"}: cases of Table 3.4 to "printed" or "reversed"',
    )
    layouts: dict[Name, Annotated[Layout, Field(min_length=1, max_length=50)]] = _field(
        lambda: {},
        "your own layouts: name to a list of growing sets of [azimuth, elevation] in degrees",
        'an object such as {"mine": [[[0, 20], [90, 20]]]}: new names of 1 to 40 characters, each '
        "with sets of 2 to 100 different cameras, azimuth -360 to 360, elevation above 0 to 90",
    )
    distance_mm: Positive = _distance("arrays")
    resolution_px: Resolution = _resolution("arrays")

    @model_validator(mode="after")
    def _check_cases(self) -> BeamArrays:
        if not self.cases and not self.layouts:
            self._refuse("cases")
        if set(self.layouts) & set(setups.pairs()):
            self._refuse("layouts")
        return self

    def settings(self) -> list[Setting]:
        """Growing sets of cameras, cases first and layouts after them."""
        return setups.array_settings(
            self.cases,
            {"4d": "reversed"} | {str(case): order for case, order in self.pair_order.items()},
            self.layouts,
            self.distance_mm,
            self.resolution_px,
        )


STUDIES: dict[str, type[CameraStudy]] = {
    study.name: study for study in (BeamDistance, BeamAperture, BeamResolution, BeamArrays)
}
CHAPTERS = {"ch3": ["beam-distance", "beam-aperture", "beam-resolution", "beam-arrays"]}


def validate(name: str, values: Mapping[str, Any]) -> CameraStudy:
    """Parameters of a figure set from plain values.

    Raises
    ------
    ParameterError
        In one line: the set and field, what was given, what is allowed and in which unit.
    """
    if name not in STUDIES:
        raise ParameterError(
            f"{_line(name)}: no such figure set{_hint(name, [*STUDIES, *CHAPTERS])}; "
            f"there are {', '.join(STUDIES)}"
        )
    model = STUDIES[name]
    parts = []
    for field, value in values.items():
        if field not in model.model_fields:
            names = list(model.model_fields)
            hint = _hint(str(field), names)
            raise ParameterError(
                f"{name}: no parameter {_line(str(field))}{hint}; there are {', '.join(names)}"
            )
        try:
            text = json.dumps(value).replace("4a\\u2032", "4a'")
            from_json(f"[{text}]")
        except (TypeError, ValueError, RecursionError):  # not JSON, or nested beyond measure
            problem = f"{field}: given {_shown(value)}, {_permitted(model, field)}"
            raise ParameterError(f"{name}: {problem}") from None
        parts.append(f'"{field}": {text}')
    try:
        return model.model_validate_json(f"{{{', '.join(parts)}}}")
    except ValidationError as error:
        raise ParameterError(f"{name}: {_first_problem(model, values, error)}") from None


def unit(field: str) -> str:
    """Unit of a parameter from its suffix, or empty.

    Examples
    --------
    >>> unit("distances_mm"), unit("azimuth_deg"), unit("widths_px"), unit("seed")
    ('mm', '°', 'px', '')
    """
    return {"mm": "mm", "deg": "°", "px": "px"}.get(field.rsplit("_", 1)[-1], "")


def describe(model: type[CameraStudy]) -> list[dict[str, str]]:
    """One row per parameter: name, default, unit, allowed, meaning."""
    defaults = model().model_dump(mode="json")
    return [
        {
            "name": field,
            "default": json.dumps(defaults[field], ensure_ascii=False),
            "unit": unit(field),
            "allowed": _allowed(model, field),
            "meaning": info.description or "",
        }
        for field, info in sorted(
            model.model_fields.items(), key=lambda item: item[0] in CameraStudy.model_fields
        )
    ]


def _allowed(model: type[CameraStudy], field: str) -> str:
    extra = model.model_fields[field].json_schema_extra
    return str(extra["allowed"]) if isinstance(extra, dict) else ""


def _permitted(model: type[CameraStudy], field: str) -> str:
    return f"allowed: {_allowed(model, field)}" + (f", in {unit(field)}" if unit(field) else "")


def nearest(name: str, names: Iterable[str]) -> str:
    """The name most like `name`, or empty if none is."""
    return next(iter(difflib.get_close_matches(name, list(names), 1, 0.6)), "")


def _hint(name: str, names: Iterable[str]) -> str:
    meant = nearest(name, names)
    return f" (did you mean {meant}?)" if meant else ""


def _line(text: str) -> str:
    """At most 60 characters of a text, on one line."""
    text = "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)
    return text if len(text) <= 60 else text[:57] + "..."


def _shown(value: Any) -> str:
    try:
        return _line(json.dumps(value, ensure_ascii=False, default=repr))
    except (TypeError, ValueError, RecursionError):
        return f"a {type(value).__name__} that is not JSON"


def _first_problem(
    model: type[CameraStudy], values: Mapping[str, Any], error: ValidationError
) -> str:
    problem = error.errors(include_url=False)[0]
    if problem["type"] == "refused":
        return problem["msg"]
    field = str(problem["loc"][0])
    place, inside = field, values[field]
    for part in problem["loc"][1:]:  # where in the value; the rest is pydantic's own words
        if isinstance(inside, Mapping) and part in inside:
            place, inside = f"{place}[{_shown(part)}]", inside[part]
        elif isinstance(inside, Sequence) and isinstance(part, int) and part < len(inside):
            place, inside = f"{place}[{part}]", inside[part]
    return f"{place}: given {_shown(problem['input'])}, {_permitted(model, field)}"


def _refuse(field: str, given: Any, why: str) -> None:
    message = f"{field}: given {_shown(given)}, {why}"
    raise PydanticCustomError("refused", "{message}", {"message": message})


def _check_reach(study: CameraStudy, settings: list[Setting]) -> None:
    length, width = study.structure.extent
    reach = 1000 * (math.hypot(length, width) / 2 + max(study.peaks_m))
    field = "distances_mm" if "distances_mm" in type(study).model_fields else "distance_mm"
    for setting in settings:
        if setting.distance_mm <= reach:
            _refuse(field, setting.distance_mm, f"allowed: more than {reach:.4g} mm, the reach "
                    "of the structure and its deflection")  # fmt: skip


def _check_coincidence(study: CameraStudy, setting: Setting) -> None:
    angles = np.radians(setting.directions_deg)
    directions = hemisphere_directions(angles[:, 0], angles[:, 1])
    apart = np.linalg.norm(directions[:, None] - directions[None], axis=2)
    first, second = np.nonzero(np.triu(apart < 1e-6, k=1))
    if len(first):
        if setting.case in getattr(study, "layouts", {}):
            field = "layouts"
        elif setting.directions_deg[first[0]][1] < 90:
            field = "azimuth_deg"
        else:
            field = "elevations_deg" if setting.case in setups.OPPOSITE_DEG else "elevation_deg"
        given = [setting.directions_deg[first[0]], setting.directions_deg[second[0]]]
        where = f"case {_shown(setting.case)}, {setting.label}"
        _refuse(field, given, f"two cameras at the same place in {where} "
                "([azimuth, elevation] in °), allowed: different places")  # fmt: skip
