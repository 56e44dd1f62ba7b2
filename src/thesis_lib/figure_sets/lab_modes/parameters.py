"""The parameters of ``lab-modes``: faster vibrations and torsion of the beam."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from thesis_lib.facts import setups
from thesis_lib.facts.setups import Direction, Setting
from thesis_lib.laboratory import filming
from thesis_lib.studies.refusals import permitted, refuse
from thesis_lib.studies.vocabulary import (
    Azimuth,
    BeamDistance,
    FilmedElevation,
    FilmedMode,
    FilmedWidth,
    FrameRate,
    Peak,
    Positive,
    RigAzimuth,
    Several,
    field,
)
from thesis_lib.vibration.structure import resonance

RIG = setups.table("experiment", "rig")
ROWS, MARKER = 0.010, 0.005  # distance of the markers' rows and their diameter, m


class BeamMotions(filming.Film):
    """What is rendered of the beam: higher modes with torsion, at several frame rates."""

    distance_mm: BeamDistance = RIG["distance_mm"]
    azimuth_deg: RigAzimuth = RIG["azimuth_deg"]
    elevation_deg: FilmedElevation = field(RIG["elevation_deg"], "elevation of the cameras")
    width_px: FilmedWidth = field(1280, "width of the frames; the height is 9/16 of it")
    frame_rates_hz: Several[FrameRate] = field(
        lambda: [60.0, 120.0, 240.0, 480.0],
        "frames per second of the recordings",
        "a list of different numbers from 10 to 5000 that keep the alias of every mode away from 0 "
        "and from half of them",
    )
    modes: Several[FilmedMode] = field(lambda: [2, 3], "bending modes to render")
    amplitude_mm: Peak | list[Peak] | Literal["force"] = field(
        "force",
        "deflection of the beam's tip by bending",
        'a number above 0, at most 100, a list with one for each mode, or "force" (the response '
        "to 1 N)",
    )
    torsion_mm: Annotated[float, Field(ge=0, le=5)] = field(
        0.01, "deflection of the tip's edges by the first torsional shape, at the same frequency"
    )
    torsion_phase_deg: Azimuth = field(90.0, "phase by which the torsion is ahead of the bending")
    starts: Literal["free", "together"] = field(
        "free", "whether the cameras start when they like or all at the same instant"
    )

    @property
    def peaks_m(self) -> list[float]:
        """Deflection of the tip in m for each mode."""
        return filming.peaks_m(setups.beam(), self.modes, self.amplitude_mm)

    @property
    def directions_deg(self) -> tuple[Direction, ...]:
        """Azimuth and elevation of cameras A to D."""
        a = self.azimuth_deg
        return tuple((azimuth, self.elevation_deg) for azimuth in (a, -a, 180 + a, 180 - a))

    def setting(self, case: str, rate: float) -> Setting:
        """The four cameras at a frame rate."""
        size = (self.width_px, round(self.width_px * 9 / 16))
        return Setting(case, rate, f"{rate:g} fps", self.distance_mm, self.directions_deg, size)

    @model_validator(mode="after")
    def _check_motions(self) -> BeamMotions:
        beam = setups.beam()
        filming.check_amplitudes(type(self), self.modes, self.amplitude_mm)
        filming.check_rates(self, beam, self.modes, "frame_rates_hz", self.frame_rates_hz)
        lift = max(self.peaks_m) + self.torsion_mm / 1000
        setting = self.setting("", self.frame_rates_hz[0])
        filming.check_place(self, beam.extent, lift, setting, "distance_mm", self.distance_mm)
        filming.check_markers(self, ROWS, MARKER, lift, setting, "width_px", self.width_px)
        return self


class BeamRecordings(BeamMotions, filming.LabStudy):
    """The recordings of the beam, rendered once."""

    name = "lab-modes-recordings"
    title = "Laboratory: recordings of the beam"
    study = "modes"
    varied = "frame_rate_hz"
    varied_label = "frame rate"


class LabModes(filming.Repeated, BeamMotions, filming.LabStudy):
    """Higher bending modes and torsion of the beam, at frame rates that suffice and do not."""

    name = "lab-modes"
    title = "Laboratory: higher modes and torsion"
    study = "modes"
    varied = "frame_rate_hz"
    varied_label = "frame rate"
    draws = "starts and noise"

    cases: Several[Literal["instant", "read", "found", "known"]] = field(
        lambda: ["instant", "read", "found", "known"], "cases to run"
    )
    highest_hz: Positive = field(
        300.0,
        "frequency up to which aliases are taken for the truth, case found",
        "a number above the highest mode's frequency, at most 100000",
    )

    def settings(self) -> list[Setting]:
        """One setting per case and frame rate."""
        return [self.setting(case, rate) for case in self.cases for rate in self.frame_rates_hz]

    @property
    def recordings(self) -> BeamRecordings:
        """What has to be rendered."""
        fields = {name: getattr(self, name) for name in BeamMotions.model_fields}
        return BeamRecordings(**fields, seed=self.seed, trials=0)

    @property
    def others(self) -> LabModes:
        """The same in every way of measuring, without trials and file: what is rendered again."""
        update = {"trials": 0, "repeats": "kept", "cube": "", "cases": type(self)().cases}
        return self.model_copy(update=update)

    @model_validator(mode="after")
    def _check_highest(self) -> LabModes:
        highest = max(resonance(setups.beam(), mode) for mode in self.modes) / (2 * np.pi)
        if self.highest_hz <= highest:
            refuse("highest_hz", self.highest_hz, permitted(type(self), "highest_hz"))
        return self
