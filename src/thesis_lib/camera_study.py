"""What the parameters of all figure sets share: fields, checks, and their one-line refusals."""

from __future__ import annotations

import hashlib
import json
import math
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator
from pydantic_core import PydanticCustomError

from thesis_lib import setups
from thesis_lib.cameras import hemisphere_directions
from thesis_lib.setups import Setting
from thesis_lib.structures import Structure, peak_deflection
from thesis_lib.text import one_line

Positive = Annotated[float, Field(gt=0, le=1e5)]
Azimuth = Annotated[float, Field(ge=-360, le=360)]
Elevation = Annotated[float, Field(gt=0, le=90)]
Width = Annotated[int, Field(ge=2, le=20_000)]
Resolution = tuple[Width, Width]
Mode = Annotated[int, Field(ge=1, le=30)]
Order = Literal["printed", "reversed"]
Layout = list[Annotated[list[tuple[Azimuth, Elevation]], Field(min_length=2, max_length=100)]]
LEAST_SQUARES = "least-squares"
Name = Annotated[str, Field(pattern=r"^\S(.{0,38}\S)?$")]


class ParameterError(ValueError):
    """A request that cannot be run; the message is one line for the person who made it."""


def field(default: Any, what: str, allowed: str, **bounds: Any) -> Any:
    """A parameter: default (or a function that makes it), meaning, and what is allowed in words."""
    factory = {"default_factory": default} if callable(default) else {"default": default}
    return Field(description=what, json_schema_extra={"allowed": allowed}, **factory, **bounds)


def trials(default: int) -> Any:
    """The field of a study's number of trials."""
    return field(
        default,
        "random shifts of the pixel grids beside the literal run",
        "a whole number from 0 to 1000000",
        ge=0,
        le=1_000_000,
    )


class Study(BaseModel):
    """Parameters that all figure sets share."""

    model_config = ConfigDict(
        extra="forbid", strict=True, frozen=True, allow_inf_nan=False, validate_default=True
    )

    name: ClassVar[str]
    title: ClassVar[str]
    subject: ClassVar[str]  # beam, plate, sound or experiment
    study: ClassVar[str]  # what is varied: distance, aperture, resolution, arrays, cameras
    varied: ClassVar[str]  # name of the varied parameter
    varied_label: ClassVar[str]
    first: ClassVar[str] = "literal run"  # what trial 0 is
    predicts: ClassVar[str] = "law of rounding"  # what predicted_error stands for
    draws: ClassVar[str] = "pixel-grid shifts"  # what differs from trial to trial

    trials: int = trials(200)
    seed: int = field(
        0, "seed of the random shifts", "a whole number from 0 to 2^63 - 1", ge=0, lt=2**63
    )
    cube: str = field(
        "",
        "file to write the cube to, from the project's folder; empty writes nothing",
        "a path that ends in .nc, or empty",
    )

    def settings(self) -> list[Setting]:
        """The study's settings in the order of the thesis's tables."""
        raise NotImplementedError

    @property
    def structure(self) -> Structure:
        """What is measured."""
        return setups.beam()

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
    def _check_lists(self) -> Study:
        for field in type(self).model_fields:
            value = getattr(self, field)
            repeats = isinstance(value, list) and len(set(value)) < len(value)
            if repeats and field != "amplitude_mm":
                self.refuse(field)
        if self.cube and not self.cube.endswith(".nc"):
            self.refuse("cube")
        return self

    def refuse(self, field: str) -> None:
        """Refuse the value of a field by what the field allows."""
        refuse(field, getattr(self, field), permitted(type(self), field))


class CameraStudy(Study):
    """Parameters that all camera studies share."""

    focal_length_mm: Positive = field(
        ..., "focal length of the lenses", "a number above 0, at most 100000"
    )
    sensor_width_mm: Positive = field(
        ..., "width of the sensors", "a number above 0, at most 100000"
    )
    amplitude_mm: Positive | list[Positive] | Literal["force"] = field(
        ...,
        "peak of the deflection over the structure",
        'a number above 0, a list with one for each mode, or "force" (the response to 1 N)',
    )
    rest: Literal["rebuilt", "known"] = field(
        ...,
        "whether the rest position is rebuilt from rounded pixels or known",
        '"rebuilt" or "known"',
    )
    azimuth_zero: Literal["Y", "X"] = field(
        ...,
        "axis from which azimuths are measured, towards the other one",
        '"Y" or "X"',
    )
    principal_offset_px: Annotated[float, Field(ge=-0.5, le=0.5)] = field(
        ...,
        "how far right and down of the sensor's middle the principal point is",
        "a number from -0.5 to 0.5",
    )
    estimator: Literal["least-squares", "analytic-centre"] = field(
        "least-squares",
        "how points are estimated from rounded pixels; the thesis takes least squares",
        '"least-squares" or "analytic-centre"',
    )
    modes: list[Mode] = field(
        lambda: [1, 2, 3],
        "modes to measure",
        "a list of different whole numbers from 1 to 30",
        min_length=1,
    )

    def printed(self) -> list[Setting]:
        """The study's settings with azimuths as they are given."""
        raise NotImplementedError

    def settings(self) -> list[Setting]:
        """The study's settings in the order of the thesis's tables, azimuths measured from +Y."""
        return [s.turned() if self.azimuth_zero == "X" else s for s in self.printed()]

    @property
    def law(self) -> str:
        """Long name of `predicted_error`, which is a law of least squares for every estimator."""
        law = "rms error over the trials by the law of rounding"
        return law if self.estimator == LEAST_SQUARES else f"{law}, of least squares"

    @property
    def peaks_m(self) -> list[float]:
        """Peak deflection of each mode in m."""
        if self.amplitude_mm == "force":
            return [peak_deflection(self.structure, mode) for mode in self.modes]
        if isinstance(self.amplitude_mm, list):
            return [peak / 1000 for peak in self.amplitude_mm]
        return [float(self.amplitude_mm) / 1000] * len(self.modes)

    @model_validator(mode="after")
    def _check_together(self) -> CameraStudy:
        if isinstance(self.amplitude_mm, list) and len(self.amplitude_mm) != len(self.modes):
            self.refuse("amplitude_mm")
        settings = self.printed()  # as given, so that a refusal says what was given
        _check_reach(self, settings)
        for setting in settings:
            _check_coincidence(self, setting)
        return self


def unit(field: str) -> str:
    """Unit of a parameter from its suffix, or empty.

    Examples
    --------
    >>> unit("distances_mm"), unit("azimuth_deg"), unit("widths_px"), unit("seed")
    ('mm', '°', 'px', '')
    """
    units = {"_mm": "mm", "_deg": "°", "_px": "px", "_m_s": "m/s", "_kg_m3": "kg/m³",
             "_hz": "Hz", "_ms": "ms", "_db": "dB"}  # fmt: skip
    return next((unit for suffix, unit in units.items() if field.endswith(suffix)), "")


def allowed_text(model: type[BaseModel], field: str) -> str:
    """What a field allows, in words."""
    extra = model.model_fields[field].json_schema_extra
    return str(extra["allowed"]) if isinstance(extra, dict) else ""


def permitted(model: type[BaseModel], field: str) -> str:
    """What a field allows, with its unit, as it stands in a refusal."""
    return f"allowed: {allowed_text(model, field)}" + (f", in {unit(field)}" if unit(field) else "")


def shown(value: Any) -> str:
    """A value as it stands in a refusal."""
    try:
        return one_line(json.dumps(value, ensure_ascii=False, default=repr))
    except (TypeError, ValueError, RecursionError):
        return f"a {type(value).__name__} that is not JSON"


def refuse(field: str, given: Any, why: str) -> None:
    """Refuse a value in one line, from inside a validator."""
    message = f"{field}: given {shown(given)}, {why}"
    raise PydanticCustomError("refused", "{message}", {"message": message})


def _check_reach(study: CameraStudy, settings: list[Setting]) -> None:
    length, width = study.structure.extent
    reach = 1000 * (math.hypot(length, width) / 2 + max(study.peaks_m))
    field = "distances_mm" if "distances_mm" in type(study).model_fields else "distance_mm"
    for setting in settings:
        if setting.distance_mm <= reach:
            refuse(field, setting.distance_mm, f"allowed: more than {reach:.4g} mm, the reach "
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
        where = f"case {shown(setting.case)}, {setting.label}"
        refuse(field, given, f"two cameras at the same place in {where} "
                "([azimuth, elevation] in °), allowed: different places")  # fmt: skip
