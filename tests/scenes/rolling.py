"""Cameras with rolling shutters: rows are exposed one after the other."""

from collections.abc import Iterator

import numpy as np

from thesis_lib.arrays import Image
from thesis_lib.laboratory.render import BeamView, Light, Sensor, collect_light
from thesis_lib.laboratory.rig import Rig
from thesis_lib.measure.recordings.board import Markers, on_surface
from thesis_lib.vibration.motion import Motion
from thesis_lib.vision import pinhole
from thesis_lib.vision.pinhole import Camera


class RollingView(BeamView):
    """A camera whose rows are exposed one after the other: each point at the time of its row."""

    def __init__(
        self, camera: Camera, markers: Markers, motion: Motion, sensor: Sensor, readout: float
    ) -> None:
        super().__init__(camera, markers, motion, sensor)
        self.readout = readout
        rest = pinhole.project_points(camera, on_surface(markers.extent, self.points))
        self.late = readout * (rest[1] / camera.size[1] - 0.5)

    def collect_light(self, time: float) -> Light:
        """Collect the light around a time in s of the motion, that of the middle row."""
        samples, late = self.sensor.samples, self.late
        within = ((np.arange(samples) + 0.5) / samples - 0.5) * self.sensor.exposure
        for _ in range(2):  # a moving point is seen at the time of the row where it is then
            at = time + within[:, None] + late
            deflection = np.einsum("kn,ksn->sn", self.shapes, self.motion.coordinates(at))
            uv = pinhole.project_points(
                self.camera, on_surface(self.markers.extent, self.points[:, None], deflection)
            )
            late = self.readout * (uv[1].mean(axis=0) / self.camera.size[1] - 0.5)
        return collect_light(uv, self.polygons, self.camera.size, self.sensor)


def rolling_frames(rig: Rig, index: int, readout: float) -> Iterator[Image]:
    """Render the frames of one camera whose rows are read in `readout` s."""
    station = rig.stations[index]
    view = RollingView(station.camera, rig.markers, rig.motion, station.sensor, readout)
    for k in range(int(rig.duration * station.frame_rate)):
        yield view.frame(station.start + k / station.frame_rate, rig.generator(1, index, k))
