"""Recordings by rigs that have equal pixels per second, measured from end to end.

For every recording the cameras are aimed anew. They take pictures of a board
that is held over the plate, and are calibrated together from these. Then they film. Markers are
followed by the cameras as calibrated, from the plate's corners, marked to a pixel; harmonics are
fitted and triangulated. Only the clocks are known. What is kept of a recording is what comes out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from thesis_lib.figure_sets.lab_equal_pixels.parameters import EqualPixels, Kind
from thesis_lib.files import code, workplace
from thesis_lib.laboratory import direct, outlined
from thesis_lib.laboratory.recordings import film_seed, sensor, settled
from thesis_lib.laboratory.render import Sensor
from thesis_lib.laboratory.rig import Rig, default_rig
from thesis_lib.measure.calibration.alignment import align
from thesis_lib.measure.calibration.rig import alike
from thesis_lib.measure.calibration.zhang import CalibrationError
from thesis_lib.measure.fitting.harmonics import amplitude, deviation
from thesis_lib.measure.recordings.markers import Markers, on_surface
from thesis_lib.measure.tracking.homography import view_of
from thesis_lib.studies import reach
from thesis_lib.studies.cache import kept
from thesis_lib.studies.parallel import abreast
from thesis_lib.studies.variables import declared, labelled
from thesis_lib.vibration.motion import Component, amplitudes
from thesis_lib.vision import lens
from thesis_lib.vision.cone_law import cone_directions
from thesis_lib.vision.lens import Camera

POSES = 8  # of the board
VARIABLES = declared("""
    deflection(part, point) [m] amplitudes in phase with the truth and a quarter of a period later
    known_deflection(part, point) [m] the same by the same centres and the true cameras
    deviation(point) [m] standard deviation of a part by the scatter of the centres
    centre_scatter() [px] scatter of the centres about their harmonics
    centre_error() [px] rms error of a centre's coordinate
    missing() [1] share of the marker images that are missing
    wrong() [1] share of those found that are more than 1 px off
    board_views() [1] pictures of the board that were used, of all
    place_error() [m] rms error of the centres of projection, cameras aligned as a body
    turn_error() [rad] rms error of the orientations about one axis
""")


def sensor_of(film: EqualPixels) -> Sensor:
    """The sensor of a camera that gets its full light."""
    return sensor(film)  # type: ignore[arg-type]  # it has all that is asked for


def rig_of(film: EqualPixels, kind: Kind, recording: int) -> Rig:
    """What films one recording: cameras on the cone, the board's poses, the plate."""
    plate, distance = film.plate, film.distance_mm / 1000
    seed = film_seed(film.seed, kind, recording)
    draw = np.random.default_rng([seed, 7])
    part = Component("bending", 1, film.frequency_hz, film.amplitude_mm / 1000)
    directions = np.degrees(cone_directions(np.radians(film.cone_deg), kind.count)).T
    rig = default_rig(
        plate,
        directions.tolist(),
        focal_length=film.focal_length_mm / 1000,
        sensor_width=film.sensor_width_mm / 1000,
        distance=distance,
        size=kind.size,
        sensor=replace(sensor_of(film), shot=kind.shot_noise),
        frame_rate=kind.frame_rate,
        components=(part,),
        lens_k1=film.lens_k1,
        seed=seed,
        markers=Markers(plate.extent, plate.markers, kind.diameter / 1000),
    )
    rig = outlined.aimed(rig, distance, draw, POSES)
    return settled(rig, draw.random(kind.count).tolist(), round(film.duration_s * kind.frame_rate))


def measured(film: EqualPixels, kind: Kind, recording: int) -> xr.Dataset:
    """One recording, rendered and measured; NaN where cameras or markers are not found."""
    rig = rig_of(film, kind, recording)
    marks = [on_surface(rig.markers.extent, rig.markers.corners)] * kind.count
    corners = [np.rint(lens.project(*one)) for one in zip(rig.cameras, marks, strict=True)]
    values = {
        name: np.full([{"part": 2, "point": rig.markers.count}[dim] for dim in one.dims], np.nan)
        for name, one in VARIABLES.items()
    }
    try:
        calibration = outlined.calibrated(rig)
        cameras, places, turns = align(calibration.cameras, rig.cameras)
        views = [
            view_of(camera, rig.markers, lens.undistorted(camera, four))
            for camera, four in zip(cameras, corners, strict=True)
        ]
        found = [direct.followed(rig, index, view) for index, view in enumerate(views)]
        values |= _compared(film, rig, cameras, found)
        values["board_views"] = np.isfinite(calibration.residuals[:, :, 0, 0]).mean()
        values["place_error"] = np.sqrt(np.mean(np.sum(places**2, axis=1)))
        values["turn_error"] = np.sqrt(np.mean(turns**2))
    except CalibrationError:
        pass  # a result, too: these cameras cannot be calibrated so
    return xr.Dataset(labelled(values, VARIABLES))


def _compared(
    film: EqualPixels, rig: Rig, cameras: Sequence[Camera], found: list[direct.Seen]
) -> dict[str, Any]:
    """Amplitudes by the cameras as calibrated and as they are, and how well centres were found."""
    omega, exposure = 2 * np.pi * film.frequency_hz, film.exposure_ms / 1000
    every = np.concatenate([own.error().ravel() for own in found])
    seen = every[np.isfinite(every)]
    values = {
        "missing": 1 - seen.size / every.size,
        "wrong": np.mean(seen > direct.WRONG) if seen.size else np.nan,
        "centre_error": np.sqrt(np.mean(seen**2) / 2) if seen.size else np.nan,
    }
    phase = np.angle(amplitudes(rig.motion, film.plate.force_point, film.frequency_hz))
    for name, those in (("deflection", cameras), ("known_deflection", rig.cameras)):
        try:
            fit = direct.fit_of(outlined.seen_by(rig, those), found, omega)
        except ValueError:  # too few markers at rest
            return values
        turned = amplitude(fit, omega, exposure) * np.exp(-1j * phase)
        values[name] = np.stack([turned.real, turned.imag])
    values["deviation"] = deviation(fit, omega, exposure)
    values["centre_scatter"] = np.sqrt(np.nanmean(fit.sigma**2))
    return values


def made(film: EqualPixels, kind: Kind, recording: int) -> xr.Dataset:
    """What :func:`measured` finds, kept in ``build/cache`` so that a run can go on after a stop."""
    rests_on = b"".join(code(file) for file in sorted(reach.reached(Path(__file__))))
    folder = workplace() / "build" / "cache" / f"{film.name}-{film.digest}"
    path = folder / f"{film.filmed_kinds.index(kind)}-{recording}.nc"
    return kept(path, partial(measured, film, kind, recording), sha256(rests_on).hexdigest())


def run(film: EqualPixels) -> xr.Dataset:
    """All recordings, two at a time: the first of every rig, then the second, and so on.

    Returns
    -------
    xarray.Dataset
        :data:`VARIABLES` along ``rig``, in the order of ``film.filmed_kinds``, and ``trial``.
    """
    kinds, trials = film.filmed_kinds, range(film.trials + 1)
    jobs = [(kind, recording) for recording in trials for kind in kinds]
    with alike():
        done = iter(abreast(lambda job: made(film, *job), jobs))
    rows = [xr.concat([next(done) for _ in kinds], "rig") for _ in trials]
    data = xr.concat(rows, "trial").transpose("rig", "trial", "part", "point")
    return data.astype("float32").drop_attrs(deep=False)
