"""Fields of requests and manifests: types with bounds, units, and text for refusals.

A request declares ``focal_length_mm: FocalLength = 24.0``, or ``cone_deg: Angle = 55.0`` with its
meaning as a string on the next line. :func:`describe_type` generates the text on bounds for
refusals, tables and forms from the type. A type that its bounds do not describe fully has a
``title``. The model checks conditions on several fields, with messages of its own.
"""

import ast
import difflib
import inspect
import json
import math
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from itertools import groupby, pairwise
from types import NoneType
from typing import Annotated, Any, Literal, TypeVar, get_args, get_origin

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, Strict, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails, PydanticCustomError

from thesis_lib.text import one_line

FIELD_UNITS = {
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
"""Units of fields by the suffix of their names; the first match counts."""


def unit_of_field(field: str) -> str:
    """Return the unit of a field by the suffix of its name, or an empty text.

    Examples
    --------
    >>> fields = "distances_mm", "azimuth_deg", "speed_of_sound_m_s", "seed"
    >>> [unit_of_field(field) for field in fields]
    ['mm', '°', 'm/s', '']
    """
    return next((unit for suffix, unit in FIELD_UNITS.items() if field.endswith(suffix)), "")


# Refusals.


def format_given(value: Any) -> str:
    """Format a value for a refusal; a long list by its length."""
    try:
        text = one_line(json.dumps(value, ensure_ascii=False, default=repr))
        is_long = isinstance(value, list | tuple) and text.endswith("...")
        return f"a list of {len(value)}" if is_long else text
    except (TypeError, ValueError, RecursionError):
        return f"a {type(value).__name__} that is not JSON"


def refuse_value(field: str, given: Any, why: str) -> None:
    """Refuse a value in one line, from inside a validator."""
    message = f"{field}: given {format_given(given)}, {why}"
    raise PydanticCustomError("refused", "{message}", {"message": message})


def format_limit(limit: float, upper: bool = True, digits: int = 4) -> str:
    """Format a limit, 0 or above, to some digits, rounded to the allowed side.

    Examples
    --------
    >>> format_limit(16.6667), format_limit(16.66), format_limit(3.33333, upper=False)
    ('16.66', '16.66', '3.334')
    >>> format_limit(math.inf), format_limit(math.nan)
    ('inf', 'nan')
    """
    if not math.isfinite(limit):
        return f"{limit:g}"
    step = 10.0 ** (math.floor(math.log10(limit or 1)) - digits + 1)
    steps = limit / step
    whole = math.floor(steps + 1e-9 * steps) if upper else math.ceil(steps - 1e-9 * steps)
    return f"{whole * step:.{digits}g}"


def suggest_name(name: str, names: Iterable[str]) -> str:
    """Return a hint at the name that was probably meant, or an empty text."""
    meant = difflib.get_close_matches(name, list(names), 1, 0.6)
    return f" (did you mean {meant[0]}?)" if meant else ""


class Fields(BaseModel):
    """Immutable values without unknown fields; validators are built at their first use."""

    model_config = ConfigDict(
        extra="forbid", frozen=True, allow_inf_nan=False, validate_default=True, defer_build=True
    )

    def refuse(self, field: str, why: str) -> None:
        """Refuse the value of a field that conflicts with the others."""
        refuse_value(field, getattr(self, field), why)


@cache
def _written_meanings(model: type) -> dict[str, str]:
    """Return the strings below fields in the source of a class, by field."""
    try:
        source = textwrap.dedent(inspect.getsource(model))
    except (OSError, TypeError):  # it was made by a function
        return {}
    made: Any = ast.parse(source).body[0]
    found = {}
    for pair in pairwise(made.body):
        match pair:
            case ast.AnnAssign(target=ast.Name(id=field)), ast.Expr(ast.Constant(str(text))):
                found[field] = " ".join(text.split())
    return found


def describe_field(model: type[BaseModel], field: str) -> str:
    """Return a field's meaning: the string below it, else the description of its type.

    It is looked up on demand: pydantic's `use_attribute_docstrings` takes a second.
    """
    written = (_written_meanings(one).get(field) for one in model.__mro__)
    return next(filter(None, written), model.model_fields[field].description or "")


def describe_allowed(model: type[BaseModel], field: str) -> str:
    """Describe the values that a field allows."""
    info = model.model_fields[field]
    return info.title or describe_type(info.annotation, info.metadata)


def describe_permitted(model: type[BaseModel], field: str) -> str:
    """Describe the values that a field allows, with its unit, for a refusal."""
    unit = unit_of_field(field)
    return f"allowed: {describe_allowed(model, field)}" + (f", in {unit}" if unit else "")


def first_problem(model: type[BaseModel], values: Any, error: ValidationError) -> str:
    """Describe the first problem in one line: the field, the given value, the allowed ones."""
    unknown = "extra_forbidden", "invalid_key"

    def rank(one: ErrorDetails) -> tuple[bool, bool]:
        # A misspelt field comes first: it explains a missing one. A missing part comes last.
        return one["type"] not in unknown, one["type"] == "missing" and len(one["loc"]) == 1

    problem = min(error.errors(include_url=False), key=rank)
    inside, holder, name, place = values, model, "", ""
    within: type[BaseModel] | None = model
    for part in problem["loc"]:  # place in the value; other parts are pydantic's own
        if isinstance(inside, Sequence) and isinstance(part, int) and part < len(inside):
            place, inside = f"{place}[{part}]", inside[part]
        elif within is not None and isinstance(inside, Mapping):
            place = f"{place}.{one_line(str(part))}".lstrip(".")
            inside = inside.get(part)
            if part in within.model_fields:
                holder, name = within, str(part)
                within = _model_in(within.model_fields[name].annotation)
        elif isinstance(inside, Mapping) and part in inside:
            place, inside = f"{place}[{format_given(part)}]", inside[part]
    if problem["type"] == "refused":
        return f"{place}.{problem['msg']}".lstrip(".")
    if problem["type"] in unknown:
        own = list((within or holder).model_fields)
        hint = suggest_name(str(problem["loc"][-1]), own)
        return f"{place}: no such field{hint}; there are {', '.join(own)}"
    if problem["type"] == "missing" and not isinstance(problem["loc"][-1], int):
        return f"{place}: missing, {describe_permitted(holder, name)}"
    return f"{place}: given {format_given(problem['input'])}, {describe_permitted(holder, name)}"


def _model_in(annotation: Any) -> type[BaseModel] | None:
    """Return the model in an annotation, also inside a list; None if there is none."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    return next(filter(None, map(_model_in, get_args(annotation))), None)


# Descriptions of types.


def describe_type(kind: Any, limits: Sequence[Any] = (), several: bool = False) -> str:
    """Describe the values that a type with bounds allows; with `several`, in the plural.

    Examples
    --------
    >>> describe_type(Positive), describe_type(Positive | None)
    ('a number above 0, at most 100000', 'null, or a number above 0, at most 100000')
    >>> describe_type(Several[Mode]), describe_type(Literal["Y", "X"])
    ('a list of different whole numbers from 1 to 30', '"Y" or "X"')
    >>> describe_type(Resolution)
    'a list of 2 whole numbers from 2 to 20000'
    >>> describe_type(tuple[Azimuth, Elevation])
    'a list of 2: a number from -360 to 360; a number above 0, at most 90'
    """
    origin, inside = get_origin(kind), get_args(kind)
    lists = "lists" if several else "a list"
    if origin is Annotated:
        about = [one for one in inside[1:] if isinstance(one, FieldInfo)]
        if title := next((one.title for one in about if one.title), None):
            return title
        bounds = [bound for one in inside[1:] for bound in getattr(one, "metadata", [one])]
        return describe_type(inside[0], [*bounds, *limits], several)
    if origin is list or (origin is tuple and inside[-1] is Ellipsis):
        different = "different " if DIFFERENT in limits else ""
        return f"{lists} of {_count(limits)}{different}{describe_type(inside[0], several=True)}"
    if origin is tuple:
        return f"{lists} of {len(inside)}{_items(inside)}"
    if origin is dict:
        names, values = (describe_type(one, several=True) for one in inside)
        return f"an object whose names are {names} and whose values are {values}"
    if origin is Literal and several:
        return f"ones of {', '.join(map(str, inside))}"
    if origin is Literal:
        *others, last = (json.dumps(one) for one in inside)
        return f"{', '.join(others)} or {last}" if others else last
    if len(inside) > 1:
        return _union(inside, limits, several)
    if isinstance(kind, type) and issubclass(kind, BaseModel):
        return "objects" if several else "an object"
    if kind is bool:
        return "true or false"
    noun = {int: "whole number", float: "number", str: "text"}.get(kind, "value")
    one = f"{noun}s" if several else noun if kind is str else f"a {noun}"
    return one + _between(limits)


def _items(kinds: Sequence[Any]) -> str:
    """Describe the items of a list of fixed length."""
    groups = [list(group) for _, group in groupby(kinds)]
    if len(groups) == 1:
        return f" {describe_type(kinds[0], several=True)}"
    words = [
        describe_type(kind) if not more else f"{1 + len(more)} {describe_type(kind, several=True)}"
        for kind, *more in groups
    ]
    return f": {'; '.join(words)}"


def _union(kinds: Sequence[Any], limits: Sequence[Any], several: bool) -> str:
    """Describe a union of types."""
    choices = tuple(one for kind in kinds if get_origin(kind) is Literal for one in get_args(kind))
    others = [kind for kind in kinds if kind is not NoneType and get_origin(kind) is not Literal]
    if choices:
        others.append(Literal[choices])
    words = [describe_type(kind, limits, several) for kind in others]
    some = f"{'; '.join(words[:-1])}; or {words[-1]}" if len(words) > 1 else words[0]
    return f"null, or {some}" if NoneType in kinds else some


def _count(limits: Sequence[Any]) -> str:
    """Describe the allowed length of a list, such as "2 to 8 "; empty for all above 0."""
    least = next((one.min_length for one in limits if hasattr(one, "min_length")), 0)
    most = next((one.max_length for one in limits if hasattr(one, "max_length")), None)
    if most is not None:
        return f"{least} to {most} " if least else f"at most {most} "
    return f"at least {least} " if least > 1 else ""


_BOUND_KEYS = {
    "gt": " above", "gtlt": " and below", "gtle": ", at most",
    "ge": " from", "gelt": ", below", "gele": " to",
    "lt": " below", "le": " up to",
}  # fmt: skip


def _between(limits: Sequence[Any]) -> str:
    """Describe bounds, such as " above 0, at most 100000"."""
    at = {key: getattr(one, key) for one in limits for key in _BOUND_KEYS if hasattr(one, key)}
    low = next((key for key in ("gt", "ge") if key in at), "")
    high = next((key for key in ("lt", "le") if key in at), "")
    told = [(low, at.get(low)), (low + high, at.get(high))]
    words = [f"{_BOUND_KEYS[key]} {bound:.12g}" for key, bound in told if bound is not None]
    return "".join(words).replace("e+", "e")


# Numbers, choices and positions. Numbers are strict: no text or boolean is accepted.

T = TypeVar("T")


def _refuse_repeats(values: list[T]) -> list[T]:
    """Refuse a list that holds a value twice; its items need not be hashable."""
    if len(set(map(repr, values))) < len(values):
        raise ValueError
    return values


DIFFERENT = AfterValidator(_refuse_repeats)
Real = Annotated[float, Strict()]
Whole = Annotated[int, Strict()]
Flag = Annotated[bool, Strict()]
Distinct = Annotated[list[T], DIFFERENT, Field(json_schema_extra={"uniqueItems": True})]
Several = Annotated[Distinct[T], Field(min_length=1)]
Positive = Annotated[Real, Field(gt=0, le=1e5)]
Angle = Annotated[Real, Field(gt=0, lt=90)]
HalfAperture = Annotated[Real, Field(gt=0, lt=180)]
Azimuth = Annotated[Real, Field(ge=-360, le=360)]
Elevation = Annotated[Real, Field(gt=0, le=90)]
MAX_WIDTH_PX = 20_000
Width = Annotated[Whole, Field(ge=2, le=MAX_WIDTH_PX)]
Mode = Annotated[Whole, Field(ge=1, le=30)]
Resolution = tuple[Width, Width]
Name = Annotated[
    str,
    Field(
        pattern=r"^[^\p{C}\p{Z}]([^\p{C}\p{Zl}\p{Zp}]{0,38}[^\p{C}\p{Z}])?$",
        title="text of 1 to 40 characters that can be seen",
    ),
]
Estimator = Literal["least-squares", "analytic-centre", "interval"]

# Every request.

Trials = Annotated[
    Whole,
    Field(
        ge=0,
        le=1_000_000,
        description="random shifts of the pixel grids, in addition to the nominal run",
    ),
]
Shifts = Annotated[Whole, Field(ge=2, le=10_000, description="random shifts of the pixel grids")]
Seed = Annotated[Whole, Field(ge=0, lt=2**63, title="a whole number from 0 to 2^63 - 1")]

# Cameras.

FocalLength = Annotated[Positive, Field(description="focal length of the lenses")]
SensorWidth = Annotated[Positive, Field(description="width of the sensors")]
SensorSize = Annotated[Resolution, Field(description="width and height of the sensors")]
Separation = Annotated[Real, Field(ge=0, le=1e5, description="least distance between two cameras")]
Step = Annotated[
    Real, Field(ge=2, le=45, description="step of the grid on which the search begins")
]
Starts = Annotated[
    Whole,
    Field(ge=0, le=100, description="random layouts to begin with, for each number of cameras"),
]

# Rendered recordings.

BeamDistance = Annotated[
    Positive, Field(description="distance of the cameras from the beam's centre")
]
RigAzimuth = Annotated[
    Angle, Field(description="A and B stand at plus and minus this azimuth, C and D opposite")
]
TipPeak = Annotated[Real, Field(gt=0, le=6, description="deflection of the beam's tip")]
RigRate = Annotated[Real, Field(ge=10, le=240, description="frames per second")]
FilmedElevation = Annotated[Real, Field(ge=10, le=75)]
FilmedWidth = Annotated[Whole, Field(ge=320, le=1920)]
FilmedMode = Annotated[Whole, Field(ge=1, le=5)]
FrameRate = Annotated[Real, Field(ge=10, le=5000)]
Peak = Annotated[Real, Field(gt=0, le=100)]
Frames = Annotated[
    Whole, Field(ge=8, le=500, description="frames of the steady vibration in each recording")
]
Exposure = Annotated[
    Positive, Field(description="exposure time of a frame, at most the time between frames")
]
BriefExposure = Annotated[
    Exposure,
    Field(
        description="exposure time of a frame, at most the time between frames and 0.8 of the "
        "shortest period"
    ),
]
Distortion = Annotated[
    Real, Field(ge=-0.3, le=0.3, description="first coefficient of the lens distortion")
]
ShotNoise = Annotated[
    Real, Field(ge=0, le=50, description="variance of the noise over the grey level")
]
ReadNoise = Annotated[
    Real, Field(ge=0, le=50, description="standard deviation of the dark noise in grey levels")
]
