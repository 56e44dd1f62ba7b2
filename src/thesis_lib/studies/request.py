"""Requests: the validated parameters of a figure set, and the equivalent command."""

import hashlib
import json
import shlex
import warnings
from collections.abc import Iterable, Mapping, Sequence
from typing import Annotated, Any, ClassVar, Self, TypeVar

from pydantic import Field, ValidationError, model_validator

from thesis_lib.acoustics.planes import Plane, plate_pistons
from thesis_lib.acoustics.radiation import FINER_PISTONS, Medium, check_pistons
from thesis_lib.facts import setups
from thesis_lib.studies import fields
from thesis_lib.text import RefusedError, format_list, one_line
from thesis_lib.vibration import structure as structures

CHOOSING_FIELDS = {"cube", "trials", "repeats", "seed", "modes", "cases", "layouts"}
"""Parameters that only select from the thesis's study, or concern trials and output."""
SHARED_FIELDS = (
    "focal_length_mm", "sensor_width_mm", "amplitude_mm", "rest", "azimuth_zero",
    "principal_offset_px", "estimator", "noise_px", "modes",
)  # fmt: skip
"""Parameters that mean the same in all figure sets: they are listed after a set's own."""


class ParameterError(RefusedError):
    """A request that cannot be run; the message is one line for the user."""


class Study(fields.Fields):
    """Parameters that all figure sets share."""

    name: ClassVar[str]
    title: ClassVar[str]
    subject: ClassVar[str]  # a word, such as beam, plate, sound or experiment
    section: ClassVar[str] = ""  # of the thesis, if it is about one
    folder: ClassVar[str] = ""  # its folder, if outside the library
    study: ClassVar[str]  # a word for the varied quantity, such as distance or aperture
    varied: ClassVar[str]  # name of the varied parameter
    varied_label: ClassVar[str]
    varied_parameters: ClassVar[dict[str, str]] = {}  # of cases in which it is not `varied`
    first: ClassVar[str] = "nominal run"  # description of trial 0
    predicts: ClassVar[str] = "law of rounding"  # meaning of predicted_error
    draws: ClassVar[str] = "pixel-grid shifts"  # difference between trials
    hints: ClassVar[dict[str, str]] = {}  # hints on names that are no parameters

    trials: fields.Trials = 200
    seed: fields.Seed = 0
    """seed of the random shifts"""
    cube: str = Field("", pattern=r"^$|\.nc$", title="a path that ends in .nc, or empty")
    """file to write the cube to, from the project's folder; empty writes nothing"""

    def settings(self) -> list[setups.Setting]:
        """Return the study's settings in the order of the thesis's tables, if any."""
        return []

    @property
    def structure(self) -> structures.Structure:
        """Return the structure that is measured."""
        return setups.thesis_beam()

    @property
    def predicted_by(self) -> str:
        """Return the meaning of `predicted_error`, for legends."""
        return self.predicts

    @property
    def is_of_the_thesis(self) -> bool:
        """Return whether all parameters that affect numbers have the thesis's values."""
        model = type(self)
        if model.folder or any(info.is_required() for info in model.model_fields.values()):
            return False
        printed, names = model(), set(model.model_fields) - CHOOSING_FIELDS
        return all(getattr(self, name) == getattr(printed, name) for name in names)

    @property
    def request(self) -> dict[str, Any]:
        """Return the parameters that determine the result, all but `cube`, as JSON values."""
        return self.model_dump(mode="json", exclude={"cube"})

    @property
    def digest(self) -> str:
        """Return ten hexadecimal digits that identify the request."""
        text = json.dumps([self.name, self.request])  # the order of layouts is part of it
        return hashlib.sha256(text.encode()).hexdigest()[:10]


AnyStudy = TypeVar("AnyStudy", bound=Study)


def peaks_m(
    structure: structures.Structure, modes: Sequence[int], amplitude_mm: float | list[float] | str
) -> list[float]:
    """Return the largest deflection of each mode in m; ``force`` means that by 1 N."""
    if isinstance(amplitude_mm, str):
        return [structures.peak_deflection(structure, mode) for mode in modes]
    if isinstance(amplitude_mm, list):
        return [peak / 1000 for peak in amplitude_mm]
    return [amplitude_mm / 1000] * len(modes)


def distance_limit(reach: float | str) -> str:
    """Describe, for a refusal, the least distance from a structure; `reach` is in mm."""
    number = reach if isinstance(reach, str) else f"{reach:.4g}"
    return f"allowed: more than {number} mm, the reach of the structure and its deflection"


def check_names(model: type[Study], names: Iterable[str]) -> None:
    """Refuse a parameter that a figure set does not have."""
    for name in names:
        if name not in model.model_fields:
            hint = fields.suggest_name(name, model.model_fields)
            own = [one for one in model.model_fields if one != "cube"]
            command = "plan --parameters" if model.name == "plan" else f"list {model.name}"
            words = model.hints.get(name) or f"{hint}; {format_list(own, f'thesis {command}')}"
            raise ParameterError(f"{model.name}: no parameter {one_line(str(name))}{words}")


def validate_values(model: type[AnyStudy], values: Mapping[str, Any]) -> AnyStudy:
    """Validate plain values as a model's parameters; refuse them in one line."""
    if not isinstance(values, Mapping):  # from an unknown file
        given = fields.format_given(values)
        why = f"{model.name}: given {given}, allowed: an object of parameters by name"
        raise ParameterError(why)
    check_names(model, values)
    try:
        return model.model_validate(values)
    except ValidationError as error:
        problem = fields.first_problem(model, values, error)
        raise ParameterError(f"{model.name}: {problem}") from None


def describe_parameters(model: type[Study]) -> list[dict[str, Any]]:
    """Return one row per parameter: name, default as a JSON value, unit, allowed, meaning."""
    defaults = validate_values(model, {}).model_dump(mode="json")
    return [
        {
            "name": name,
            "default": defaults[name],
            "unit": fields.unit_of_field(name),
            "allowed": fields.describe_allowed(model, name),
            "meaning": fields.describe_field(model, name),
        }
        for name in sorted(
            model.model_fields, key=lambda name: (name in Study.model_fields, name in SHARED_FIELDS)
        )
    ]


def whole_numbers(value: Any) -> Any:
    """Convert floats without a fraction in plain values to integers."""
    if isinstance(value, list):
        return [whole_numbers(one) for one in value]
    return int(value) if isinstance(value, float) and value.is_integer() else value


def changed_parameters(study: Study) -> dict[str, Any]:
    """Return the parameters that differ from the defaults.

    Examples
    --------
    >>> from thesis_lib.figure_sets.parametric.figure_set import camera_study
    >>> changed_parameters(camera_study("beam-distance", {"modes": [1], "seed": 0}))
    {'modes': [1]}
    """
    defaults = type(study)().request
    return {key: value for key, value in study.request.items() if value != defaults[key]}


def study_command(study: Study) -> str:
    """Return the command that runs a study.

    Examples
    --------
    >>> from thesis_lib.figure_sets.parametric.figure_set import camera_study
    >>> study_command(camera_study("beam-distance", {"modes": [1]}))
    "thesis run beam-distance -p 'modes=[1]'"
    """
    return join_command(["thesis", "run", study.folder or study.name], changed_parameters(study))


def join_command(words: list[str], parameters: Mapping[str, Any]) -> str:
    """Join words and parameters into a shell command.

    Examples
    --------
    >>> join_command(["thesis", "plan"], {"body": "plate", "counts": [2, 3]})
    "thesis plan -p body=plate -p 'counts=[2, 3]'"
    """
    options = (
        f"-p {shlex.quote(f'{key}={value if isinstance(value, str) else json.dumps(value)}')}"
        for key, value in parameters.items()
    )
    return " ".join([shlex.join(words), *options])


# Plates and their sound: markers, planes, medium (thesis 6.1).

Markers = Annotated[fields.Whole, Field(ge=2, le=60)]
Grid = Annotated[tuple[Markers, Markers], Field(description="markers along and across the plate")]
PlanePoints = Annotated[fields.Whole, Field(ge=2, le=500)]
SOUND_READING = setups.assumed_values("sound")


class PlateMarkers(fields.Fields):
    """Parameters of a plate."""

    grid: Grid

    @property
    def structure(self) -> structures.Structure:
        """Return the structure that is measured."""
        return setups.thesis_plate(self.grid)


class SoundPlanes(PlateMarkers):
    """Parameters of the sound field."""

    speed_of_sound_m_s: fields.Positive = SOUND_READING["speed_of_sound_m_s"]
    """speed of sound in the fluid"""
    air_density_kg_m3: fields.Positive = SOUND_READING["air_density_kg_m3"]
    """density of the fluid"""
    plane_half_width_mm: fields.Positive = SOUND_READING["plane_half_width_mm"]
    """the planes reach |X|, |Y| up to this"""
    plane_bottom_mm: fields.Positive = SOUND_READING["plane_bottom_mm"]
    """lowest height of the planes"""
    plane_top_mm: fields.Positive = SOUND_READING["plane_top_mm"]
    """greatest height of the planes, above plane_bottom_mm"""
    plane_shape: tuple[PlanePoints, PlanePoints] = tuple(SOUND_READING["plane_shape"])
    """points along X or Y, and along Z"""

    @property
    def medium(self) -> Medium:
        """Return the fluid."""
        return Medium(self.speed_of_sound_m_s, self.air_density_kg_m3)

    @property
    def planes(self) -> tuple[Plane, Plane]:
        """Return the planes XZ and YZ."""
        lengths_mm = self.plane_half_width_mm, self.plane_bottom_mm, self.plane_top_mm
        half, bottom, top = (length / 1000 for length in lengths_mm)
        xz, yz = (Plane(name, half, bottom, top, self.plane_shape) for name in ("XZ", "YZ"))
        return xz, yz

    @model_validator(mode="after")
    def _check_sound(self) -> Self:
        if self.plane_top_mm <= self.plane_bottom_mm:
            self.refuse("plane_top_mm", "allowed: a number above plane_bottom_mm, in mm")
        plate, highest = self.structure, max(self.modes)  # type: ignore[attr-defined]
        assert isinstance(plate, structures.Plate)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # the page warns
                omega = structures.resonance_frequency(plate, highest)
                check_pistons(plate_pistons(plate), omega, self.medium)
        except ValueError as error:
            why = str(error).replace(FINER_PISTONS, "take lower modes or a finer grid")
            fields.refuse_value("modes", highest, why)
        return self
