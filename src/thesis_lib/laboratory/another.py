"""Another recording of the same: cameras put up again, on other clocks, with other noise.

Nobody puts a tripod back to where it stood: each camera is a little off its place and its
direction, so that all markers fall on other parts of their pixels. Starts and noise come from the
seed of the rig.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np
import xarray as xr

from thesis_lib.arrays import Array, ComplexArray
from thesis_lib.laboratory.recordings import film_seed
from thesis_lib.laboratory.rig import Rig, Station
from thesis_lib.measure.recordings.markers import on_surface
from thesis_lib.studies.request import Study
from thesis_lib.studies.variables import declared, labelled
from thesis_lib.vision import lens

Asked = TypeVar("Asked", bound=Study)

SHIFT = 1e-3  # m, standard deviation of a camera's place along X, Y and Z
TURN = np.radians(0.1)  # of its direction about each of its axes
MARGIN = 24  # px of the sensor that are read beside the structure
FITS = declared("""
    deflection(setting, mode, point) [m] measured deflection of the markers at its maximum
    quadrature(setting, mode, point) [m] a quarter of a period before
    deviation(setting, mode, point) [m] standard deviation of the deflection by the noise of the
        centres alone
""")


def put_up_again(rig: Rig) -> Rig:
    """The rig with every camera a little elsewhere, by draws of the rig's seed."""

    def moved(index: int, station: Station) -> Station:
        shift, turn = rig.generator(9, index, 0).standard_normal((2, 3))
        camera = station.camera
        R = _turned(TURN * turn) @ camera.R_camera_world
        camera = replace(camera, R_camera_world=R, centre=camera.centre + SHIFT * shift)
        return replace(station, camera=camera)

    return replace(rig, stations=tuple(moved(*each) for each in enumerate(rig.stations)))


def _turned(vector: Array) -> Array:
    """The rotation about a vector by its length in rad (Rodrigues)."""
    x, y, z = vector
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    angle = np.linalg.norm(vector)
    rotation: Array = np.eye(3) + np.sinc(angle / np.pi) * K
    return rotation + 0.5 * np.sinc(angle / 2 / np.pi) ** 2 * K @ K


def windowed(rig: Rig, whole: int = 1) -> Rig:
    """The rig with cameras that read no more of their sensors than the structure reaches."""
    stations = tuple(window_of(rig, station, whole)[0] for station in rig.stations)
    return replace(rig, stations=stations)


def window_of(rig: Rig, station: Station, whole: int = 1) -> tuple[Station, Array]:
    """The camera with only that part of its sensor which the structure reaches, and its corner.

    Real sensors read faster so, and rendering does. Corner and size are multiples of `whole` px.
    """
    camera, extent = station.camera, rig.markers.extent
    x, y = (np.linspace(0, side, 30) for side in extent)
    points = np.stack([np.tile(x, 30), np.repeat(y, 30)])
    lift = sum(
        abs(part.amplitude * part.shape(rig.motion.structure, points))
        for part in rig.motion.components
    )
    uv = lens.project(camera, on_surface(extent, points[:, None], np.stack([-lift, lift])))
    flat = uv.reshape(2, -1) / whole
    spare, most = MARGIN / whole, np.array(camera.size) // whole
    low = whole * np.clip(np.floor(flat.min(axis=1) - spare).astype(int), 0, most)
    high = whole * np.clip(np.ceil(flat.max(axis=1) + spare).astype(int), low // whole + 1, most)
    K = camera.K.copy()
    K[:2, 2] -= low
    size = (int(high[0] - low[0]), int(high[1] - low[1]))
    return replace(station, camera=replace(camera, K=K, size=size)), low.astype(float)


def again(request: Asked, number: int) -> Asked:
    """The request for recording `number` of the same, with a seed of its own."""
    return request.model_copy(update={"seed": film_seed(request.seed, "again", number)})


def of_every_setting(results: Sequence[tuple[Array | ComplexArray, Array]]) -> xr.Dataset:
    """Deflections and their standard deviations of every setting, each (modes, markers), in m.

    Returns
    -------
    xarray.Dataset
        ``deflection``, ``quadrature`` if they are complex, and ``deviation``, along ``setting``,
        ``mode`` and ``point``; NaN where a marker is not known.
    """
    motions, deviations = (np.array(each) for each in zip(*results, strict=True))
    values = {"deflection": motions.real, "deviation": deviations}
    if np.iscomplexobj(motions):
        values["quadrature"] = motions.imag
    return xr.Dataset(labelled(values, FITS))
