"""Limits of what can be measured, and what an assessment by them holds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from thesis_lib.measure.feasibility.outlook import CIRCLE_PX, CameraOutlook, RigOutlook

DEVIATIONS = 3.0  # standard errors that the smallest measurable deflection stands out by


class Threshold(NamedTuple):
    """A limit that a warning stands for, its unit, and why it is this one."""

    value: float
    unit: str
    reason: str


THRESHOLDS = {
    "undersampled": Threshold(0.5, "of the frame rate", "from there on frames show an alias"),
    "near-nyquist": Threshold(0.4, "of the frame rate", "fewer than 2.5 frames a period are left"),
    "few-samples": Threshold(5, "frames a period", "with fewer, only one harmonic can be fitted"),
    "alias": Threshold(0.1, "turns of drift", "takes 1.6 % of the amplitude"),
    "alias-edge": Threshold(2, "turns", "fewer are not told from a constant"),
    "higher-modes": Threshold(1, "turns apart", "less is not told from the vibration"),
    "long-exposure": Threshold(0.1, "periods", "takes 1.6 % of the amplitude"),
    "motion-blur": Threshold(0.5, "of the short axis", "doubles the scatter; at 1 markers go"),
    "depth-of-field": Threshold(CIRCLE_PX, "px", "a pixel spreads as much by itself"),
    "too-near": Threshold(1, "focal length", "nothing nearer is sharp"),
    "coarse": Threshold(5, "px", "rendered markers were tracked down to 3.8 px"),
    "foreshortened": Threshold(3, "px", "twice what rendered markers are missed at"),
    "crowded-markers": Threshold(2, "px", "twice what rendered neighbours are missed at"),
    "small-motion": Threshold(0.5, "px", "a phone's compression takes about a tenth of it"),
    "out-of-view": Threshold(1, "of the markers", "what is cut off is not measured"),
    "lost-markers": Threshold(2, "cameras", "fewer give no point in space"),
    "shallow-view": Threshold(8, "°", "markers are a seventh as high as wide"),
    "steep-view": Threshold(80, "°", "the error grows with 1/cos φ, to six times here"),
    "same-line": Threshold(5, "°", "depth errs 23 times as much as the place across"),
    "weak-markers": Threshold(5, "times the best error", "they would rule the shape's error"),
    "below-noise": Threshold(DEVIATIONS, "standard errors", "less is not told from noise"),
    "large-move": Threshold(0.45, "of the spacing", "the tracker's gate"),
    "short-rest": Threshold(1, "s", "cameras that are started by hand differ by as much"),
    "few-rest-frames": Threshold(10, "frames", "their mean adds 5 % to the noise of one frame"),
    "few-frames": Threshold(20, "frames", "the fit takes two thirds off the noise of one frame"),
    "steady-at-rest": Threshold(0, "s of overlap", "nothing vibrates there"),
    "few-periods": Threshold(2, "periods", "in fewer, constant and harmonics mix"),
}
LIMIT = {code: threshold.value for code, threshold in THRESHOLDS.items()}


@dataclass(frozen=True)
class Warning:
    """What cannot be reached, or not well: a stable code, the field it is about, one line."""

    code: str
    where: str
    text: str


@dataclass(frozen=True)
class Assessment:
    """Warnings, checks that could not be made, numbers of each camera, and of all together."""

    warnings: tuple[Warning, ...]
    unknown: tuple[str, ...]
    table: tuple[CameraOutlook, ...]
    rig: RigOutlook
