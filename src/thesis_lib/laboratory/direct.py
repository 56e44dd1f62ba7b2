"""Recordings that are tracked as they are rendered: no files, calibration and clocks known.

What is left of the laboratory is what geometry, pixels, noise and the tracker do. A few periods
are enough for that, so that many rigs can be tried in the time of one full recording.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from thesis_lib.arrays import Array
from thesis_lib.laboratory.film import frames
from thesis_lib.laboratory.rig import Rig, Station
from thesis_lib.measure.fitting.harmonics import Fitted, Harmonics, fit_harmonics, fitted, mean_of
from thesis_lib.measure.recordings.markers import Markers, on_surface
from thesis_lib.measure.tracking.homography import TrackingError, View, as_dark, view_of
from thesis_lib.measure.tracking.tracker import Tracker, sharpen
from thesis_lib.studies.parallel import abreast
from thesis_lib.vibration.motion import Motion
from thesis_lib.vision import lens
from thesis_lib.vision.lens import Camera

WRONG = 1.0  # px from the truth beyond which a marker counts as taken for another


@dataclass(frozen=True)
class Seen:
    """What one camera has seen of the markers."""

    times: Array  #: World times of the frames, s, shape (frames,)
    #: As they were found, lens distortion included, px; NaN where missing, shape
    #: (frames, 2, markers)
    centres: Array
    truth: Array  #: Where they were at the middle of the exposure, px, shape (frames, 2, markers)

    @property
    def missing(self) -> float:
        """Share of the marker images that are missing."""
        return float(np.mean(np.isnan(self.centres[:, 0])))

    def error(self) -> Array:
        """Distance of the centres from where they were, shape (frames, markers), px."""
        return np.asarray(np.hypot(*(self.centres - self.truth).swapaxes(0, 1)), float)


def brief(rig: Rig, rest: int = 6, ramp: float = 1.0, steady: float = 2.0) -> Rig:
    """The rig with a short recording: frames at rest, periods that grow, periods that are steady.

    The cameras start within one frame of each other, each at its own time.
    """
    rate = rig.stations[0].frame_rate
    latest = max(station.start for station in rig.stations) or 1.0
    stations = tuple(
        replace(station, start=station.start / latest / rate) for station in rig.stations
    )
    period = 1 / min(part.frequency for part in rig.motion.components)
    start = (rest + 1) / rate
    motion = Motion(rig.motion.structure, rig.motion.components, start, ramp * period)
    duration = motion.steady + steady * period + 2 / rate
    return replace(rig, stations=stations, motion=motion, duration=duration)


def times_of(rig: Rig, station: Station) -> Array:
    """World times of a camera's frames in s."""
    count = int(rig.duration * station.frame_rate)
    return np.asarray(station.start + np.arange(count) / station.frame_rate)


def true_centres(rig: Rig, station: Station, times: Array) -> Array:
    """Where a camera has the markers at some times, shape (times, 2, markers), px."""
    points = rig.markers.centres
    world = on_surface(rig.markers.extent, points[:, None], rig.motion.deflection(points, times))
    return np.asarray(lens.project(station.camera, world).swapaxes(0, 1))


def true_view(camera: Camera, markers: Markers) -> View:
    """How a camera sees the structure at rest, by what only a rendered recording knows."""
    corners = lens.project(camera, on_surface(markers.extent, markers.corners))
    return view_of(camera, markers, lens.undistorted(camera, corners))


def followed(rig: Rig, index: int, view: View) -> Seen:
    """What one camera sees, rendered and tracked; `view` is how it is thought to see the structure.

    All is NaN if it does not find the markers in its first frame.
    """
    station, markers = rig.stations[index], rig.markers
    times = times_of(rig, station)
    truth = true_centres(rig, station, times)
    centres = np.full_like(truth, np.nan)
    first = min(part.frequency for part in rig.motion.components)
    for k, frame in enumerate(frames(rig, index)):
        image = as_dark(frame, markers)
        if k == 0:
            try:
                tracker = Tracker(sharpen(image, view), 2 * np.pi * first / station.frame_rate)
            except TrackingError:
                break
        centres[k] = tracker.centres(image)
    return Seen(times, centres, truth)


def seen(rig: Rig) -> list[Seen]:
    """What every camera sees, side by side; the structure's corners and the cameras are known."""

    def one(index: int) -> Seen:
        return followed(rig, index, true_view(rig.stations[index].camera, rig.markers))

    return abreast(one, range(len(rig.stations)))


def fit_of(rig: Rig, found: list[Seen], omega: float, order: int = 2) -> Fitted:
    """Harmonics of the steady part by the true cameras, and the frame of the markers at rest.

    Raises
    ------
    ValueError
        If fewer than three markers at rest are seen by two cameras.
    """
    harmonics: list[Harmonics] = []
    rest = []
    for camera, own in zip(rig.cameras, found, strict=True):
        uv = lens.undistorted_tracks(camera, own.centres)
        steady = own.times >= rig.motion.steady
        harmonics.append(fit_harmonics(omega, own.times[steady], uv[steady], order))
        rest.append(mean_of(uv[own.times < rig.motion.start]))
    return fitted(rig.cameras, harmonics, np.array(rest), rig.markers)
