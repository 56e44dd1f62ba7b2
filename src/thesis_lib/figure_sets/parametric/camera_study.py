"""Parameters of all camera studies: the lens, the vibration, and places of the cameras."""

import inspect
import math
from collections.abc import Callable
from typing import Annotated, ClassVar, Literal, Self

from pydantic import Field, model_validator

from thesis_lib.facts import setups
from thesis_lib.studies import fields, request
from thesis_lib.vision.simulation import LEAST_SQUARES

BEAM_READING = setups.assumed_values("beam")
CAMERA_CONDITIONS = {
    "amplitude_mm": 'allowed: a number, a list with one for each mode, or "force"',
    "cases": "allowed: at least one, or layouts",
    "layouts": "allowed: new names, each with sets that grow",
}
CAMERAS_HINT = (
    "; give the [azimuth, elevation] in ° of each to beam-arrays, plate-arrays or sound-arrays, "
    "for three as -p 'layouts={\"mine\": [[[-40, 20], [0, 20], [40, 20]]]}'"
)
COINCIDENT_TEXT = (
    "two cameras at the same place in case {}, {} ([azimuth, elevation] in °), "
    "allowed: different places"
)
"""Messages about inconsistent values; pages show the same texts."""
MAX_MEMORY_BYTES = 2 * 2**30
BYTES_PER_DEFLECTION = 16  # in single precision, with the copies that rounding and writing make


class CameraStudy(request.Study):
    """Parameters that all camera studies share; the defaults are those of the beam's studies."""

    hints = dict.fromkeys(("cameras", "n_cameras"), CAMERAS_HINT)

    focal_length_mm: fields.FocalLength = Field(BEAM_READING["focal_length_mm"])
    sensor_width_mm: fields.SensorWidth = Field(BEAM_READING["sensor_width_mm"])
    amplitude_mm: fields.Positive | list[fields.Positive] | Literal["force"] = BEAM_READING[
        "amplitude_mm"
    ]
    """peak of the deflection over the structure, for each mode if it is a list; "force" is the
    response to 1 N"""
    rest: Literal["rebuilt", "known"] = BEAM_READING["rest"]
    """whether the rest position is rebuilt from rounded pixels or known"""
    azimuth_zero: Literal["Y", "X"] = BEAM_READING["azimuth_zero"]
    """axis from which azimuths are measured, towards the other one"""
    principal_offset_px: Annotated[fields.Real, Field(ge=-0.5, le=0.5)] = BEAM_READING[
        "principal_offset_px"
    ]
    """how far right and down of the sensor's middle the principal point is"""
    estimator: fields.Estimator = "least-squares"
    """how points are estimated from rounded pixels; the thesis takes least squares"""
    noise_px: Annotated[fields.Real, Field(ge=0, le=10)] = 0.0
    """standard deviation of noise in the images before rounding; estimator interval uses it"""
    modes: fields.Several[fields.Mode] = [1, 2, 3]
    """modes to measure"""

    #: Returns the study's settings; its arguments are fields of the study
    list_settings: ClassVar[Callable[..., list[setups.Setting]]]

    def thesis_settings(self) -> list[setups.Setting]:
        """Return the study's settings with azimuths as they are given."""
        names = inspect.signature(self.list_settings).parameters
        return self.list_settings(**{name: getattr(self, name) for name in names})

    def settings(self) -> list[setups.Setting]:
        """Return the study's settings in the order of the thesis's tables, azimuths from +Y."""
        return [s.swap_axes() if self.azimuth_zero == "X" else s for s in self.thesis_settings()]

    @property
    def predicted_by(self) -> str:
        """Return the meaning of `predicted_error`, which always applies to least squares."""
        cause = f"{self.predicts} and noise" if self.noise_px else self.predicts
        return cause if self.estimator == LEAST_SQUARES else f"{cause} of least squares"

    @property
    def law(self) -> str:
        """Long name of `predicted_error`."""
        return f"rms error over the trials by the {self.predicted_by}"

    @property
    def peaks_m(self) -> list[float]:
        """Return the peak deflection of each mode in m."""
        return request.peaks_m(self.structure, self.modes, self.amplitude_mm)

    @model_validator(mode="after")
    def _check_together(self) -> Self:
        if isinstance(self.amplitude_mm, list) and len(self.amplitude_mm) != len(self.modes):
            self.refuse("amplitude_mm", CAMERA_CONDITIONS["amplitude_mm"])
        settings = self.thesis_settings()  # as given, so that messages quote them
        results = len(settings) * len(self.modes) * (self.trials + 1)
        needed = BYTES_PER_DEFLECTION * self.structure.markers.shape[1] * results
        if needed > MAX_MEMORY_BYTES:
            size, most = f"{needed / 1e9:.3g} GB", f"{MAX_MEMORY_BYTES / 1e9:.2g} GB or less"
            advice = "ask for fewer trials, settings or modes"
            self.refuse("trials", f"which needs {size} of memory, allowed: {most}; {advice}")
        reach = 1000 * (math.hypot(*self.structure.extent) / 2 + max(self.peaks_m))
        name = "distances_mm" if "distances_mm" in type(self).model_fields else "distance_mm"
        for setting in settings:
            if setting.distance_mm <= reach:
                fields.refuse_value(name, setting.distance_mm, request.distance_limit(reach))
        for setting in settings:
            for given in setting.coincident_cameras():
                field = "elevations_deg" if setting.case in setups.OPPOSITE_DEG else "elevation_deg"
                if setting.case in getattr(self, "layouts", {}):
                    field = "layouts"
                elif given[0][1] < 90:
                    field = "azimuth_deg"
                text = COINCIDENT_TEXT.format(fields.format_given(setting.case), setting.label)
                fields.refuse_value(field, given, text)
        return self
