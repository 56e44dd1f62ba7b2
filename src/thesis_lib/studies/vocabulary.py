"""The vocabulary of parameters: types with bounds and meaning, their units, and words for both.

A request declares ``focal_length_mm: FocalLength = 24.0``. Where a field means or allows something
else it says so itself: ``cone_deg: Angle = field(55.0, "angle of the cone, from the normal")``.
What refusals, tables and forms tell of bounds is made from the type, unless a field or its type has
words of its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from types import NoneType
from typing import Annotated, Any, Literal, TypeVar, get_args, get_origin

from pydantic import BaseModel, ConfigDict, Field

SHARED = (
    "focal_length_mm",
    "sensor_width_mm",
    "amplitude_mm",
    "rest",
    "azimuth_zero",
    "principal_offset_px",
    "estimator",
    "noise_px",
    "modes",
)
"""Parameters that mean the same in all figure sets: they are told after a set's own."""

UNITS = {
    "_mm": "mm",
    "_deg": "°",
    "_px": "px",
    "_m_s": "m/s",
    "_kg_m3": "kg/m³",
    "_hz": "Hz",
    "_ms": "ms",
    "_db": "dB",
    "_pa": "Pa",
    "_n": "N",
    "_s": "s",
}
"""Units of parameters by the end of their names; of two that fit the first."""

NO_UNIT = (
    "f_number",
    "f_numbers",
    "lens_k1",
    "in_view",
    "poissons_ratio",
    "damping",
    "shot_noise",  # grey levels
    "read_noise",  # grey levels
    "pixels_per_second",
    "target_percent",
    "prices",  # of any currency
    "layouts",  # names beside degrees
)
"""Parameters without a unit beyond name and meaning; whole numbers that count need not be here."""


def unit(field: str) -> str:
    """Unit of a parameter by the end of its name, or empty.

    Examples
    --------
    >>> unit("distances_mm"), unit("azimuth_deg"), unit("speed_of_sound_m_s"), unit("seed")
    ('mm', '°', 'm/s', '')
    """
    return next((unit for suffix, unit in UNITS.items() if field.endswith(suffix)), "")


def field(default: Any, what: str = "", allowed: str = "", **bounds: Any) -> Any:
    """A parameter that its type does not tell all of.

    Parameters
    ----------
    default : object
        Its default, a function that makes it, or ``...`` if there is none.
    what, allowed : str
        Its meaning, and what is allowed in words; what is empty is left to its type.
    **bounds
        As pydantic takes them.
    """
    told: dict[str, Any] = {"default_factory" if callable(default) else "default": default}
    if what:
        told["description"] = what
    if allowed:
        told["json_schema_extra"] = {"allowed": allowed}
    return Field(**told, **bounds)


def means(what: str, allowed: str = "", **bounds: Any) -> Any:
    """The meaning of a type, and what it allows where bounds do not say all."""
    return field(..., what, allowed, **bounds)


def allowed_text(model: type[BaseModel], field: str) -> str:
    """What a field allows, in words."""
    info = model.model_fields[field]
    extra = info.json_schema_extra
    own = extra.get("allowed") if isinstance(extra, dict) else None
    return str(own or words(info.annotation, info.metadata))


def tell_allowed(schema: dict[str, Any], model: type[BaseModel]) -> None:
    """Write into the JSON schema of a model what its fields allow."""
    for name, part in schema["properties"].items():
        part["allowed"] = allowed_text(model, name)


class Fields(BaseModel):
    """Values as they are typed, all of them known, unchangeable; checks are built when used."""

    model_config = ConfigDict(
        extra="forbid",
        strict=True,
        frozen=True,
        allow_inf_nan=False,
        validate_default=True,
        defer_build=True,
        json_schema_extra=tell_allowed,
    )


def words(kind: Any, limits: Sequence[Any] = (), several: bool = False) -> str:
    """What a type allows, in words.

    Parameters
    ----------
    kind : type
        A number or choice, one that may be null, or a list of such.
    limits : sequence
        Bounds of the number.
    several : bool
        Whether it is told as what a list is of.

    Examples
    --------
    >>> words(Positive), words(Positive | None)
    ('a number above 0, at most 100000', 'null, or a number above 0, at most 100000')
    >>> words(list[Mode]), words(Literal["Y", "X"])
    ('a list of different whole numbers from 1 to 30', '"Y" or "X"')
    >>> words(Annotated[float, Field(ge=0, lt=90)]), words(Annotated[int, Field(ge=2)])
    ('a number from 0, below 90', 'a whole number from 2')
    """
    origin, inside = get_origin(kind), get_args(kind)
    if origin is Annotated:
        bounds = [bound for one in inside[1:] for bound in getattr(one, "metadata", [])]
        return words(inside[0], bounds, several)
    if origin is list:
        return f"a list of different {words(inside[0], several=True)}"
    if origin is Literal and several:
        return f"ones of {', '.join(map(str, inside))}"
    if origin is Literal:
        *others, last = (f'"{one}"' for one in inside)
        return f"{', '.join(others)} or {last}"
    if NoneType in inside:
        return f"null, or {words(inside[0], limits)}"
    if kind is bool:
        return "true or false"
    noun = {int: "whole number", float: "number", str: "text"}.get(kind, "value")
    return (f"{noun}s" if several else f"a {noun}") + _between(limits)


_BOUNDS = {
    "gt": " above",
    "gtlt": " and below",
    "gtle": ", at most",
    "ge": " from",
    "gelt": ", below",
    "gele": " to",
    "lt": " below",
    "le": " up to",
}


def _between(limits: Sequence[Any]) -> str:
    """Bounds in words, such as " above 0, at most 100000"."""
    at = {key: getattr(one, key) for one in limits for key in _BOUNDS if hasattr(one, key)}
    low = next((key for key in ("gt", "ge") if key in at), "")
    high = next((key for key in ("lt", "le") if key in at), "")
    told = [(low, at.get(low)), (low + high, at.get(high))]
    words = [f"{_BOUNDS[key]} {bound:.12g}" for key, bound in told if bound is not None]
    return "".join(words).replace("e+", "e")


# Numbers, choices and places.

T = TypeVar("T")
Several = Annotated[list[T], Field(min_length=1)]
Positive = Annotated[float, Field(gt=0, le=1e5)]
Angle = Annotated[float, Field(gt=0, lt=90)]
HalfAperture = Annotated[float, Field(gt=0, lt=180)]
Azimuth = Annotated[float, Field(ge=-360, le=360)]
Elevation = Annotated[float, Field(gt=0, le=90)]
Width = Annotated[int, Field(ge=2, le=20_000)]
Mode = Annotated[int, Field(ge=1, le=30)]
Resolution = tuple[Width, Width]
Name = Annotated[str, Field(pattern=r"^\S(.{0,38}\S)?$")]
Estimator = Literal["least-squares", "analytic-centre", "interval"]

# Every request.

Trials = Annotated[
    int, means("random shifts of the pixel grids beside the literal run", ge=0, le=1_000_000)
]
Repeats = Annotated[
    Annotated[int, Field(ge=1, le=1000)] | Literal["kept"],
    means(
        "recordings of every setting, the first included; the bands are over the others",
        'a whole number from 1 to 1000, or "kept" (what data/recordings holds of just these)',
    ),
]
Shifts = Annotated[int, means("random shifts of the pixel grids", ge=2, le=10_000)]
Runs = Annotated[int, means("further recordings of each setting, at most", ge=0, le=10_000)]
Seed = Annotated[
    int,
    means("seed of the random shifts", "a whole number from 0 to 2^63 - 1", ge=0, lt=2**63),
]
NoiseSeed = Annotated[Seed, means("seed of all noise")]

# Cameras.

FocalLength = Annotated[Positive, means("focal length of the lenses")]
SensorWidth = Annotated[Positive, means("width of the sensors")]
SensorSize = Annotated[
    Resolution,
    means("width and height of the sensors", "[width, height], whole numbers from 2 to 20000"),
]
Separation = Annotated[float, means("least distance between two cameras", ge=0, le=1e5)]
Step = Annotated[float, means("step of the grid on which the search begins", ge=2, le=45)]
Starts = Annotated[
    int, means("random layouts to begin with, for each number of cameras", ge=0, le=100)
]

# Films.

BeamDistance = Annotated[
    Positive,
    means(
        "distance of the cameras from the beam's centre",
        "a number above the beam's reach, at most 100000",
    ),
]
RigAzimuth = Annotated[
    Angle, means("A and B stand at plus and minus this azimuth, C and D opposite")
]
TipPeak = Annotated[float, means("deflection of the beam's tip", gt=0, le=6)]
RigRate = Annotated[float, means("frames per second", ge=10, le=240)]
FilmedElevation = Annotated[float, Field(ge=10, le=75)]
FilmedWidth = Annotated[int, Field(ge=320, le=1920)]
FilmedMode = Annotated[int, Field(ge=1, le=5)]
FrameRate = Annotated[float, Field(ge=10, le=5000)]
Peak = Annotated[float, Field(gt=0, le=100)]
Frames = Annotated[int, means("frames of the steady vibration in each recording", ge=8, le=500)]
Exposure = Annotated[
    Positive,
    means("exposure time of a frame", "a number above 0, at most the time between frames"),
]
BriefExposure = Annotated[
    Exposure,
    means(
        "exposure time of a frame",
        "a number above 0, at most the time between frames and 0.8 of the shortest period",
    ),
]
Distortion = Annotated[float, means("first coefficient of the lens distortion", ge=-0.3, le=0.3)]
ShotNoise = Annotated[float, means("variance of the noise over the grey level", ge=0, le=50)]
ReadNoise = Annotated[
    float, means("standard deviation of the dark noise in grey levels", ge=0, le=50)
]
