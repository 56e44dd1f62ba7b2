"""Recordings of a flat structure of any outline: cameras aimed, calibrated, cropped and followed.

Each camera is a little off its aim and takes pictures of a board; all are calibrated together from
these. Then they read no more of their sensors than the structure reaches, and markers are followed
from the corners of the outline, marked to a pixel.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from thesis_lib.arrays import Array, Image
from thesis_lib.laboratory.another import MARGIN
from thesis_lib.laboratory.direct import Seen, times_of, true_centres
from thesis_lib.laboratory.film import shots
from thesis_lib.laboratory.render import BeamView
from thesis_lib.laboratory.rig import Rig, Station
from thesis_lib.measure.calibration.bundle_adjustment import Adjustment, adjust
from thesis_lib.measure.calibration.corners import find_corners
from thesis_lib.measure.calibration.grids import BoardNotFound
from thesis_lib.measure.calibration.symmetry import unify
from thesis_lib.measure.calibration.zhang import zhang
from thesis_lib.measure.fitting.reconstruction import fit_grid, triangulate_seen
from thesis_lib.measure.recordings.board import Board
from thesis_lib.measure.recordings.markers import on_surface
from thesis_lib.measure.tracking.homography import TrackingError, View, view_of
from thesis_lib.measure.tracking.tracker import Tracker, sharpen
from thesis_lib.vibration.meshing import pieces
from thesis_lib.vibration.polygons import Point
from thesis_lib.vision import lens
from thesis_lib.vision.lens import Camera
from thesis_lib.vision.pinhole import project

AIM = 1.0  # ° about each axis, standard deviation of how cameras are aimed
TILES, TILE = (5, 4), 0.12  # of the board, and their size over the cameras' distance
TILT = 15.0  # of the board in all poses but one, which is flat, °
STEP = 0.004  # m, between the places of an outline that are drawn


def aimed(rig: Rig, distance: float, draw: np.random.Generator, poses: int = 10) -> Rig:
    """The rig with cameras that are a little off their aim, and a board held over the structure.

    Parameters
    ----------
    rig : Rig
        Cameras that look at the structure's centre.
    distance : float
        Of the cameras, m; the board is as large as it needs.
    draw : numpy.random.Generator
        Turns of the cameras, and poses of the board.
    poses : int
        Of the board, the first one flat.
    """
    turns = Rotation.from_rotvec(np.radians(AIM) * draw.standard_normal((len(rig.stations), 3)))
    cameras = [
        replace(camera, R_camera_world=turn @ camera.R_camera_world)
        for camera, turn in zip(rig.cameras, turns.as_matrix(), strict=True)
    ]
    around = 2 * np.pi * (np.arange(poses) + draw.uniform(-0.2, 0.2, poses)) / (poses - 1)
    tilts = np.radians(TILT) * np.stack([np.cos(around), np.sin(around), 0 * around], axis=1)
    tilts[0] = 0
    rolls = Rotation.from_euler("z", draw.uniform(-20, 20, (poses, 1)), degrees=True)
    sideways, up = draw.uniform(-0.08, 0.08, (poses, 2)), draw.uniform(-0.02, 0.06, (poses, 1))
    return replace(
        seen_by(rig, cameras),
        board=Board(*TILES, TILE * distance, TILE * distance / 2),
        rotations=(Rotation.from_rotvec(tilts) * rolls).as_matrix(),
        translations=distance * np.concatenate([sideways, up], axis=1),
    )


def seen_by(rig: Rig, cameras: Sequence[Camera]) -> Rig:
    """The rig with other cameras in the same places of the list."""
    pairs = zip(rig.stations, cameras, strict=True)
    return replace(rig, stations=tuple(replace(one, camera=camera) for one, camera in pairs))


def calibrated(rig: Rig) -> Adjustment:
    """The cameras as their pictures of the board have them, in a world of their own.

    Raises
    ------
    CalibrationError
        If the board is not found often enough.
    """

    def corners(image: Image) -> Array | None:
        try:
            return find_corners(image, rig.board)
        except BoardNotFound:
            return None

    found = [[corners(image) for image in shots(rig, i)] for i in range(len(rig.stations))]
    single = [
        zhang(row, rig.board, camera.size, name=camera.name)
        for row, camera in zip(found, rig.cameras, strict=True)
    ]
    observed, _ = unify(single, found, rig.board)
    return adjust(observed, rig.board.corners, [one.camera() for one in single])


def cropped(rig: Rig, cameras: Sequence[Camera]) -> tuple[Rig, list[Camera]]:
    """The rig with cameras that read the part of their sensors which the structure reaches.

    Parameters
    ----------
    rig : Rig
        Cameras that read all of their sensors.
    cameras : sequence of Camera
        The same as they are calibrated.

    Returns
    -------
    tuple of Rig and list of Camera
        Both with these parts alone.
    """
    lift = sum(abs(part.amplitude) for part in rig.motion.components)
    box = on_surface(
        rig.markers.extent, rig.markers.corners[:, None], np.array([[-lift], [lift]])
    ).reshape(3, -1)
    parts, others = [], []
    for camera, other in zip(rig.cameras, cameras, strict=True):
        uv, most = lens.project(camera, box), np.array(camera.size)
        low = np.clip(np.floor(uv.min(axis=1)).astype(int) - MARGIN, 0, most - 1)
        high = np.clip(np.ceil(uv.max(axis=1)).astype(int) + MARGIN, low + 1, most)
        parts.append(_part(camera, low, high))
        others.append(_part(other, low, high))
    return seen_by(rig, parts), others


def _part(camera: Camera, low: Array, high: Array) -> Camera:
    """A camera that reads its sensor from one corner to another."""
    K = camera.K.copy()
    K[:2, 2] -= low
    return replace(camera, K=K, size=(int(high[0] - low[0]), int(high[1] - low[1])))


class OutlinedView(BeamView):
    """One camera's view of a marked, moving structure with the corners (n, 2) in m."""

    def __init__(self, rig: Rig, station: Station, corners: Sequence[Point]) -> None:
        super().__init__(station.camera, rig.markers, rig.motion, station.sensor)
        first = self.polygons.first
        outline = pieces(tuple(corners), STEP).T
        self.points = np.concatenate([outline, self.points[:, first[1] :]], axis=1)
        moved = np.where(first > 0, first - first[1] + outline.shape[1], 0)
        self.polygons = replace(self.polygons, first=moved)
        self.shapes = rig.motion.shapes(self.points)


def marked(rig: Rig, cameras: Sequence[Camera], corners: Sequence[Point]) -> list[View]:
    """How cameras, as calibrated, see the plane of a structure whose corners (n, 2) are marked, m.

    Marked to a pixel in every picture, corners are triangulated, and the outline is put there as a
    rigid body: four corners of a narrow structure in one picture would leave its perspective open.
    """
    outline = on_surface(rig.markers.extent, np.array(corners).T)
    images = np.array(
        [
            lens.undistorted(camera, np.rint(lens.project(true, outline)))
            for true, camera in zip(rig.cameras, cameras, strict=True)
        ]
    )
    P = lens.projection_matrices(cameras)
    frame = fit_grid(triangulate_seen(P, images)[0], outline)
    box = frame.R.T @ on_surface(rig.markers.extent, rig.markers.corners) + frame.origin[:, None]
    pairs = zip(cameras, project(P, box), strict=True)
    return [view_of(camera, rig.markers, four) for camera, four in pairs]


def followed(rig: Rig, index: int, view: View, corners: Sequence[Point]) -> Seen:
    """What one camera of a rig sees, rendered and tracked, of a structure with corners (n, 2) in m.

    `view` is how it is thought to see the structure. All is NaN if it does not find the markers in
    its first frame.
    """
    station = rig.stations[index]
    times = times_of(rig, station)
    truth = true_centres(rig, station, times)
    centres = np.full_like(truth, np.nan)
    scene = OutlinedView(rig, station, corners)
    turn = 2 * np.pi * rig.motion.components[0].frequency / station.frame_rate
    tracker = None
    for k, time in enumerate(times):
        image = scene.frame(float(time), rig.generator(1, index, k))
        try:
            tracker = tracker or Tracker(sharpen(image, view), turn)
        except TrackingError:
            break
        centres[k] = tracker.centres(image)
    return Seen(times, centres, truth)
