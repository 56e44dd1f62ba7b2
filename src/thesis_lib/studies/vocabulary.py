"""Types of parameters that many requests share."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BaseModel, Field

Positive = Annotated[float, Field(gt=0, le=1e5)]
Azimuth = Annotated[float, Field(ge=-360, le=360)]
Elevation = Annotated[float, Field(gt=0, le=90)]
Width = Annotated[int, Field(ge=2, le=20_000)]
Resolution = tuple[Width, Width]
Mode = Annotated[int, Field(ge=1, le=30)]
Name = Annotated[str, Field(pattern=r"^\S(.{0,38}\S)?$")]

SHARED = ("focal_length_mm", "sensor_width_mm", "amplitude_mm", "rest", "azimuth_zero",
          "principal_offset_px", "estimator", "modes")  # fmt: skip
"""Parameters that mean the same in all figure sets: they are told after a set's own."""


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
