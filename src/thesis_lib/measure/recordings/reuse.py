"""Which calibration a manifest takes from elsewhere."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from thesis_lib.studies.refusals import Refusing
from thesis_lib.studies.vocabulary import field


class Reuse(Refusing):
    """A calibration that was made before, here or by another program; a path alone is its file."""

    file: Annotated[str, Field(min_length=1, max_length=500)] = field(
        ...,
        "folder of an earlier measurement, or of one file for each camera; or a file: "
        "calibration.nc, YAML, XML or JSON of OpenCV, YAML of ROS or Kalibr, TOML of aniposelib, "
        "caliscope or Pose2Sim",
        "a path, seen from the manifest's folder",
    )
    poses: Literal["kept", "anew"] = field(
        "kept",
        "whether the cameras stand where they stood, or are placed anew by this folder's pictures "
        "of the board, which need no lens then",
        '"kept" or "anew"',
    )
    unit: Literal["m", "mm"] | None = field(
        None, "unit of the file's lengths; null is what the file says, else m", 'null, "m" or "mm"'
    )

    @model_validator(mode="before")
    @classmethod
    def _path(cls, given: Any) -> Any:
        return {"file": given} if isinstance(given, str) else given
