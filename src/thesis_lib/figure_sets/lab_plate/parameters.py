"""The parameters of ``lab-plate``: the plate rendered with one parameter varied at a time."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import model_validator

from thesis_lib.facts import setups
from thesis_lib.facts.setups import Direction, Setting
from thesis_lib.laboratory import filming
from thesis_lib.studies.shared_fields import Grid, PlateMarkers, SoundPlanes
from thesis_lib.studies.vocabulary import (
    Angle,
    BriefExposure,
    FilmedElevation,
    FilmedMode,
    FilmedWidth,
    FrameRate,
    Frames,
    HalfAperture,
    Peak,
    Positive,
    Several,
    field,
)
from thesis_lib.vibration.plate import Plate

MARKER = 0.2  # diameter of a marker over the smaller distance of two
Stand = tuple[Direction, float, int]  # azimuth and elevation in °, distance in mm, width in px
OBSERVED = {
    "distance": "distances_mm",
    "aperture": "half_apertures_deg",
    "elevation": "elevations_deg",
    "resolution": "widths_px",
    "cameras": "camera_counts",
}


class Plates(PlateMarkers, filming.Film):
    """What is rendered of the plate: five parameters, one at a time, about one pair of cameras."""

    cases: Several[Literal["distance", "aperture", "elevation", "resolution", "cameras"]] = field(
        lambda: list(OBSERVED), "cases to run: which parameter is varied"
    )
    distances_mm: Several[Positive] = field(
        lambda: [750.0, 1000.0, 1500.0],
        "distances of the pair, case distance",
        "a list of different numbers above the plate's reach, at most 100000",
    )
    half_apertures_deg: Several[HalfAperture] = field(
        lambda: [8.0, 30.0, 55.0, 80.0], "azimuths of the pair, case aperture"
    )
    elevations_deg: Several[FilmedElevation] = field(
        lambda: [15.0, 25.0, 40.0, 60.0], "elevations of the pair, case elevation"
    )
    widths_px: Several[FilmedWidth] = field(
        lambda: [480, 960, 1920], "widths of the frames, case resolution; heights are 9/16 of them"
    )
    camera_counts: Several[Literal[2, 4, 6]] = field(
        lambda: [2, 4, 6],
        "numbers of cameras, case cameras: the pair, a pair opposite, a pair at the ends",
    )
    distance_mm: Positive = field(
        1000.0,
        "distance of the cameras where it is not varied",
        "a number above the plate's reach, at most 100000",
    )
    azimuth_deg: Angle = field(
        30.0, "the pair stands at plus and minus this azimuth where it is not varied"
    )
    elevation_deg: FilmedElevation = field(25.0, "elevation of the cameras where it is not varied")
    width_px: FilmedWidth = field(960, "width of the frames where it is not varied")
    frame_rate_hz: FrameRate = field(
        60.0,
        "frames per second",
        "a number from 10 to 5000 that keeps the alias of every mode away from 0 and from half "
        "of it",
    )
    exposure_ms: BriefExposure = 0.2
    frames: Frames = 16
    modes: Several[FilmedMode] = field(lambda: [1, 2, 3], "modes to render")
    amplitude_mm: Peak | list[Peak] = field(
        1.0,
        "peak of the deflection over the plate",
        "a number above 0, at most 100, or a list with one for each mode",
    )
    grid: Grid = setups.plate().grid

    @property
    def plate(self) -> Plate:
        """The plate with its markers."""
        return setups.plate(self.grid)

    @property
    def spacing(self) -> float:
        """The smaller distance of two markers in m."""
        return min(self.plate.length / self.grid[0], self.plate.width / self.grid[1])

    @property
    def peaks_m(self) -> list[float]:
        """Peak deflection of each mode in m."""
        return filming.peaks_m(self.plate, self.modes, self.amplitude_mm)

    def settings(self) -> list[Setting]:
        """One parameter at a time is varied; the others stay as they are."""
        a, e, d, w = self.azimuth_deg, self.elevation_deg, self.distance_mm, self.width_px
        every: dict[str, list[tuple[Any, ...]]] = {
            "distance": [(x, f"{x:g} mm", a, e, x, w) for x in self.distances_mm],
            "aperture": [(2 * x, f"{2 * x:g}°", x, e, d, w) for x in self.half_apertures_deg],
            "elevation": [(x, f"{x:g}°", a, x, d, w) for x in self.elevations_deg],
            "resolution": [(x, f"{x}×{round(x * 9 / 16)}", a, e, d, x) for x in self.widths_px],
            "cameras": [(n, f"{n} cameras", a, e, d, w, n) for n in self.camera_counts],
        }
        return [_setting(case, *given) for case in self.cases for given in every[case]]

    @property
    def stands(self) -> list[Stand]:
        """Every camera that some setting needs, once."""
        return list(dict.fromkeys(s for setting in self.settings() for s in stands_of(setting)))

    @model_validator(mode="after")
    def _check_motions(self) -> Plates:
        filming.check_amplitudes(type(self), self.modes, self.amplitude_mm)
        filming.check_rates(self, self.plate, self.modes, "frame_rate_hz", [self.frame_rate_hz])
        lift, extent = max(self.peaks_m), self.plate.extent
        # The cameras that are not varied come first: what is wrong with them is not a list's fault.
        settings = sorted(self.settings(), key=lambda setting: setting.case != "cameras")
        for setting in settings:
            name, value = OBSERVED[setting.case], setting.value
            if setting.case == "cameras":
                name, value = "distance_mm", self.distance_mm
            elif setting.case == "aperture":
                value /= 2
            filming.check_place(self, extent, lift, setting, name, value)
            apart = self.spacing
            filming.check_markers(self, apart, MARKER * apart, lift, setting, name, value)
        return self


def stands_of(setting: Setting) -> list[Stand]:
    """The cameras of a setting."""
    return [(d, setting.distance_mm, setting.resolution_px[0]) for d in setting.directions_deg]


def _setting(
    case: str,
    value: float,
    label: str,
    azimuth: float,
    elevation: float,
    distance: float,
    width: int,
    count: int = 2,
) -> Setting:
    azimuths = (azimuth, -azimuth, 180 + azimuth, 180 - azimuth, 90.0, -90.0)[:count]
    directions = tuple((a, elevation) for a in azimuths)
    return Setting(case, value, label, distance, directions, (width, round(width * 9 / 16)))


class PlateRecordings(Plates, filming.LabStudy):
    """The recordings of the plate, rendered once."""

    name = "lab-plate-recordings"
    title = "Laboratory: recordings of the plate"
    study = "plate"
    varied = "setup"
    varied_label = "setup"


class LabPlate(filming.Repeated, Plates, SoundPlanes, filming.LabStudy):
    """The plate rendered, five parameters one at a time, and its sound."""

    name = "lab-plate"
    title = "Laboratory: the plate and its sound"
    study = "plate"
    varied = "setup"
    varied_label = "one parameter at a time"
    draws = "centre noise"

    @property
    def recordings(self) -> PlateRecordings:
        """What has to be rendered."""
        fields = {name: getattr(self, name) for name in Plates.model_fields}
        return PlateRecordings(**fields, seed=self.seed, trials=0)
