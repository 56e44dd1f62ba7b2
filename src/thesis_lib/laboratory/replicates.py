"""Rigs for fast vibrations that the parameters describe, and their perturbed replicates.

Each camera has a few frames of the structure at rest and then, after half a period that no frame
needs, frames of the steady vibration. A real structure takes its time to get there; frames before
that are useless.

In a replicate the cameras are set up again, with other starts and other noise. Nobody puts a tripod
back to where it stood: each camera is a little off its place and its direction, so that all markers
fall on other parts of their pixels. Starts and noise come from the seed of the rig.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from thesis_lib.arrays import Array, ComplexArray
from thesis_lib.facts.setups import Setting
from thesis_lib.laboratory import tracking
from thesis_lib.laboratory.render import Sensor
from thesis_lib.laboratory.rig import Rig, Station, default_rig
from thesis_lib.laboratory.tracking import WINDOW_MARGIN_PX, TrackedCentres
from thesis_lib.measure.recordings.board import Markers, on_surface
from thesis_lib.studies.parallel import map_in_pairs
from thesis_lib.studies.schema import label_values, parse_variables
from thesis_lib.vibration.motion import Component, Motion
from thesis_lib.vision import lens

REST_FRAMES = 4  # frames at rest
RAMP_PERIODS = 0.5  # periods in which the vibration takes up
EXPOSURE_SAMPLES = 3  # of the motion within an exposure
TRACK_VARIABLES = parse_variables("""
    tracks(camera, frame, axis, marker) [px] marker centres, lens distortion included
    truth(camera, frame, axis, marker) [px] true marker images at the middle of the exposure
    quiet(camera, frame, axis, marker) [px] centres in frames without noise
    time(camera, frame) [s] middle of the exposure
""")


def make_sensor(film: Any) -> Sensor:
    """Return the sensor, with positions in an exposure whose variance is that of the light.

    n positions in the middle of equal parts of a time T have the variance T² (1 − 1/n²) / 12.
    """
    exposure = film.exposure_ms / 1000 / np.sqrt(1 - 1 / EXPOSURE_SAMPLES**2)
    return Sensor(exposure, EXPOSURE_SAMPLES, shot=film.shot_noise, read=film.read_noise)


def derive_seed(seed: int, *what: object) -> int:
    """Derive a seed that belongs to what is rendered alone."""
    text = repr((seed, *what)).encode()
    return int.from_bytes(hashlib.sha256(text).digest()[:6], "big")


def settle_rig(rig: Rig, offsets: Sequence[float], frames: int) -> Rig:
    """Return the rig with frames at rest, then so many of the steady vibration.

    Camera i starts `offsets[i]` of a frame after time 0.
    """
    rate = rig.stations[0].frame_rate
    stations = tuple(
        replace(station, start=offset / rate)
        for station, offset in zip(rig.stations, offsets, strict=True)
    )
    components = rig.motion.components
    ramp = RAMP_PERIODS / min(part.frequency for part in components)
    motion = Motion(rig.motion.structure, components, (REST_FRAMES + 1) / rate, ramp)
    count = int(np.ceil(motion.steady * rate)) + frames
    return replace(rig, stations=stations, motion=motion, duration=(count + 0.5) / rate)


def camera_rig(
    request: Any,
    structure: Any,
    setting: Setting,
    rate: float,
    components: tuple[Component, ...],
    seed: int,
    markers: Markers | None = None,
    own_sensor: Sensor | None = None,
) -> Rig:
    """Return a rig that renders a structure `rate` times per second, by the cameras of a setting.

    Lenses and sensors are those of a `request` (:class:`.CameraParameters`).
    """
    return default_rig(
        structure,
        setting.directions_deg,
        focal_length=request.focal_length_mm / 1000,
        sensor_width=request.sensor_width_mm / 1000,
        distance=setting.distance_mm / 1000,
        size=setting.resolution_px,
        sensor=own_sensor or make_sensor(request),
        frame_rate=rate,
        components=components,
        lens_k1=request.lens_k1,
        seed=seed,
        markers=markers,
    )


def record_tracks(
    rigs: Sequence[Rig],
    frames: int,
    look: Callable[[Rig], list[TrackedCentres]] = tracking.track_cameras,
) -> xr.Dataset:
    """Track what the cameras of some rigs see at rest and in the last `frames` frames.

    Two rigs at a time; `look` films a rig and tracks its markers.

    Returns
    -------
    xarray.Dataset
        ``tracks``, ``truth`` and ``time`` of :data:`TRACK_VARIABLES`, along ``rig``, too.
    """
    every = map_in_pairs(look, rigs)
    every = [[select_frames(own, frames) for own in found] for found in every]
    of = {"tracks": "centres", "truth": "truth", "time": "times"}
    values = {
        name: [[getattr(own, field) for own in found] for found in every]
        for name, field in of.items()
    }
    return xr.Dataset(label_values(values, TRACK_VARIABLES, ["rig"]))


def select_frames(own: TrackedCentres, frames: int) -> TrackedCentres:
    """Select the frames at rest and the last `frames` frames."""
    chosen = np.r_[:REST_FRAMES, len(own.times) - frames : len(own.times)]
    return TrackedCentres(own.times[chosen], own.centres[chosen], own.truth[chosen])


def read_tracks(tracks: Array, rig: Rig) -> list[TrackedCentres]:
    """Return what the cameras of a rig saw, from their stored tracks.

    `tracks` has the shape (cameras, frames, 2, markers), px. Times and true places are not stored:
    the rig gives them, to the last bit.
    """
    found = []
    for station, centres in zip(rig.stations, tracks, strict=True):
        times = tracking.frame_times(rig, station)
        times = times[np.r_[:REST_FRAMES, len(times) + REST_FRAMES - len(centres) : len(times)]]
        found.append(TrackedCentres(times, centres, tracking.true_centres(rig, station, times)))
    return found


PLACE_STD_M = 1e-3  # m, standard deviation of a camera's place along X, Y and Z
TURN_STD_RAD = np.radians(0.1)  # of its direction about each of its axes
DEFLECTION_VARIABLES = parse_variables("""
    deflection(setting, mode, point) [m] measured deflection of the markers at its maximum
    quadrature(setting, mode, point) [m] a quarter of a period before
    deviation(setting, mode, point) [m] standard deviation of the deflection by the noise of the
        centres alone
""")


def perturb_cameras(rig: Rig) -> Rig:
    """Move every camera of a rig a little, by draws of its seed."""

    def move_station(index: int, station: Station) -> Station:
        shift, turn = rig.generator(9, index, 0).standard_normal((2, 3))
        camera = station.camera
        R = _rotate_about(TURN_STD_RAD * turn) @ camera.R_camera_world
        camera = replace(camera, R_camera_world=R, centre=camera.centre + PLACE_STD_M * shift)
        return replace(station, camera=camera)

    return replace(rig, stations=tuple(move_station(*each) for each in enumerate(rig.stations)))


def _rotate_about(vector: Array) -> Array:
    """Return the rotation about a vector by its length in rad (Rodrigues)."""
    x, y, z = vector
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    angle = np.linalg.norm(vector)
    rotation: Array = np.eye(3) + np.sinc(angle / np.pi) * K
    return rotation + 0.5 * np.sinc(angle / 2 / np.pi) ** 2 * K @ K


def window_rig(rig: Rig, whole: int = 1) -> Rig:
    """Let the cameras of a rig read no more of their sensors than the structure reaches."""
    stations = tuple(window_camera(rig, station, whole)[0] for station in rig.stations)
    return replace(rig, stations=stations)


def window_camera(rig: Rig, station: Station, whole: int = 1) -> tuple[Station, Array]:
    """Crop a camera's sensor to what the structure reaches, and return the corner, too.

    Real sensors read faster so, and rendering does. Corner and size are multiples of `whole` px.
    """
    camera, extent = station.camera, rig.markers.extent
    x, y = (np.linspace(0, side, 30) for side in extent)
    points = np.stack([np.tile(x, 30), np.repeat(y, 30)])
    lift = sum(
        abs(part.amplitude * part.shape(rig.motion.structure, points))
        for part in rig.motion.components
    )
    uv = lens.project_points(camera, on_surface(extent, points[:, None], np.stack([-lift, lift])))
    flat = uv.reshape(2, -1) / whole
    spare, most = WINDOW_MARGIN_PX / whole, np.array(camera.size) // whole
    low = whole * np.clip(np.floor(flat.min(axis=1) - spare).astype(int), 0, most)
    high = whole * np.clip(np.ceil(flat.max(axis=1) + spare).astype(int), low // whole + 1, most)
    K = camera.K.copy()
    K[:2, 2] -= low
    size = (int(high[0] - low[0]), int(high[1] - low[1]))
    return replace(station, camera=replace(camera, K=K, size=size)), low.astype(float)


def replicate_seed(seed: int, replicate: int) -> int:
    """Return the seed of a replicate; that of the first is the request's own."""
    return derive_seed(seed, "again", replicate) if replicate else seed


def make_replicate(rig: Rig, replicate: int) -> Rig:
    """Return the rig of a replicate: the first as it is, others set up again and windowed."""
    return window_rig(perturb_cameras(rig)) if replicate else rig


def stack_settings(
    results: Sequence[Sequence[tuple[Array | ComplexArray, Array]]],
) -> xr.Dataset:
    """Return deflections and their standard deviations (markers,) of every setting and mode, in m.

    Returns
    -------
    xarray.Dataset
        ``deflection``, ``quadrature`` if they are complex, and ``deviation``, along ``setting``,
        ``mode`` and ``point``; NaN where a marker is not known.
    """
    motions, deviations = (
        np.array([[mode[part] for mode in setting] for setting in results]) for part in (0, 1)
    )
    values = {"deflection": motions.real, "deviation": deviations}
    if np.iscomplexobj(motions):
        values["quadrature"] = motions.imag
    return xr.Dataset(label_values(values, DEFLECTION_VARIABLES))
