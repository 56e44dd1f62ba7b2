"""The rendered laboratory: cameras like those of chapter 5, the structure, and the board.

World time counts from before the first camera starts. Every camera starts when it likes, its clock
counts from there, and frame k is exposed around k / frame rate on that clock.

The board is held in twelve poses that all four cameras can share. Cameras that face each other at
22° elevation have no good view of one printed face in common: a board that lies flat is seen at 68°
from its normal. The board therefore carries the pattern on both faces and stands upright between
them: tilted towards one pair it turns away from the other, whose incidence grows by the tilt. Tilts
up to 42° keep every view below 70°.

Parallel boards determine no focal length (Zhang 2000, section 4), and tilts about one axis only
leave the aspect ratio weak, so the board is tilted, turned and rolled, and it is moved through the
volume that the beam takes up, as far as its corners stay in the images.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from thesis_lib.arrays import Array
from thesis_lib.laboratory.render import Sensor
from thesis_lib.measure.recordings.board import Board, Markers, rows_on
from thesis_lib.vibration.beam import Beam
from thesis_lib.vibration.motion import Component, Motion
from thesis_lib.vibration.plate import Plate
from thesis_lib.vision.lens import Camera
from thesis_lib.vision.pinhole import hemisphere_directions, hemisphere_rotations, intrinsics

# Columns of the upright board's rotation: its x is −X, its y is Z, its normal Y.
_UPRIGHT_ROTATION = np.array([[-1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]])

# Tilt back from the vertical, turn about the vertical, roll about the normal, all in degrees, and
# the position of the board's centre (X, Y, Z) in mm.
_BOARD_POSES = np.array(
    [
        [0, 0, 0, 0, 0, -13],
        [25, 0, 3, 0, -38, 0],
        [-25, 0, -3, 0, 38, 0],
        [42, 15, 0, -29, -39, 39],
        [-42, 15, 0, 29, 39, 39],
        [42, -25, 0, 35, -38, 45],
        [-42, -25, 0, -35, 38, 45],
        [15, 25, 0, -79, -29, 16],
        [-15, 25, 0, 79, 29, 16],
        [25, -25, 20, -37, -35, -25],
        [-25, -25, -20, 37, 35, -25],
        [35, 35, 0, -49, -39, 43],
    ]
)


def default_poses() -> tuple[Array, Array]:
    """Return twelve poses of a two-sided board for cameras at ±22° elevation on both sides of XZ.

    Returns
    -------
    rotations : ndarray, shape (12, 3, 3)
        Turn directions in the board's frame into directions in the world.
    translations : ndarray, shape (12, 3)
        The board's centre in the world, m.
    """
    tilt, turn, roll = np.radians(_BOARD_POSES[:, :3]).T
    rotations = (
        _rotate_about_axis(2, turn)
        @ _rotate_about_axis(0, tilt)
        @ _UPRIGHT_ROTATION
        @ _rotate_about_axis(2, roll)
    )
    return rotations, _BOARD_POSES[:, 3:] * 1e-3


def _rotate_about_axis(axis: int, angle: Array) -> Array:
    """Return rotations (n, 3, 3) about a coordinate axis by angles (n,) in rad."""
    i, j = (axis + 1) % 3, (axis + 2) % 3
    R = np.zeros((len(angle), 3, 3))
    R[:, axis, axis] = 1
    R[:, i, i] = R[:, j, j] = np.cos(angle)
    R[:, j, i] = np.sin(angle)
    R[:, i, j] = -np.sin(angle)
    return R


REST_S = 1.0  # s at rest at the start of every recording
MAX_START_S = 0.25  # s within which the cameras start
MAX_FORCE_SHARE = 0.5  # largest force on the audio track over full scale


@dataclass(frozen=True)
class Station:
    """A camera, what its sensor does, how fast it takes frames, and when it starts."""

    camera: Camera  #: Optics and pose
    sensor: Sensor  #: Exposure, spread, noise, grey levels
    frame_rate: float  #: Frames per second
    start: float  #: World time of its first frame, s


@dataclass(frozen=True)
class Rig:
    """All that is seen and heard."""

    stations: tuple[Station, ...]  #: The cameras
    markers: Markers  #: The beam and what is printed on it
    motion: Motion  #: How it moves, in world time
    duration: float  #: Length of each recording, s
    #: Power of the force over that of the noise on the audio tracks, dB
    audio_noise_db: float = 20.0
    seed: int = 0  #: Seed of all noise
    board: Board = field(default_factory=Board)  #: The calibration board
    #: Poses of the board in the world
    rotations: Array = field(default_factory=lambda: default_poses()[0])
    translations: Array = field(default_factory=lambda: default_poses()[1])

    @property
    def cameras(self) -> list[Camera]:
        """The cameras alone."""
        return [station.camera for station in self.stations]

    @property
    def full_scale(self) -> float:
        """Return the force in N at full scale of the audio tracks."""
        times = np.linspace(self.motion.start, self.motion.steady + 1, 4000)
        return float(np.abs(self.motion.force(times)).max()) / MAX_FORCE_SHARE

    def generator(self, what: int, camera: int, item: int) -> np.random.Generator:
        """Return the generator of the noise of one frame, image or track."""
        return np.random.default_rng([self.seed, what, camera, item])


def default_rig(
    structure: Beam | Plate,
    directions_deg: Sequence[tuple[float, float]],
    *,
    focal_length: float = 0.024,
    sensor_width: float = 0.036,
    distance: float = 0.57,
    size: tuple[int, int] = (1920, 1080),
    sensor: Sensor | None = None,
    frame_rate: float = 60.0,
    components: tuple[Component, ...] = (Component(),),
    lens_k1: float = -0.08,
    audio_noise_db: float = 20.0,
    seed: int = 0,
    markers: Markers | None = None,
) -> Rig:
    """Return the rig of section 5.1: similar, but not identical cameras that face the structure.

    Focal lengths, principal points and distortions differ by what cameras of one kind differ by.
    The motion is at rest for a second, grows over two periods, and is filmed in its steady state
    for a second and at least five periods.

    Parameters
    ----------
    structure : Beam or Plate
        What is filmed.
    directions_deg : sequence of tuple
        Azimuth and elevation of each camera.
    focal_length, sensor_width : float
        In m; the pixels are square and fill the width.
    distance : float
        Of all cameras from the structure's centre, m.
    size : tuple of int
        Width and height of the sensors in px.
    sensor : Sensor, optional
        Exposure, spread, noise and grey levels.
    frame_rate : float
        Frames per second.
    components : tuple of Component
        The steady vibration.
    lens_k1 : float
        First coefficient of the lens distortion.
    audio_noise_db : float
        Power of the force over that of the noise on the audio tracks, dB.
    seed : int
        Seed of all noise and of the cameras' starts.
    markers : Markers, optional
        Those of the thesis's beam if not given, or in the plate's cells with a fifth of their side
        as diameter.
    """
    angles = np.radians(directions_deg)
    rotations = hemisphere_rotations(angles[:, 0], angles[:, 1])
    centres = distance * hemisphere_directions(angles[:, 0], angles[:, 1])
    starts = np.random.default_rng([seed, 0]).uniform(0, MAX_START_S, len(angles))
    focal = focal_length / sensor_width * size[0]
    stations = []
    for i, (R, centre, start) in enumerate(zip(rotations, centres, starts, strict=True)):
        differs = np.sin([1.0 + 7 * i, 2.0 + 5 * i, 3.0 + 3 * i, 4.0 + 2 * i])  # in −1…1
        K = intrinsics(focal * (1 + 0.005 * differs[0]), size)
        K[:2, 2] += 0.004 * size[0] * differs[1:3]
        distortion = lens_k1 * (1 + 0.2 * differs[3]) * np.array([1, -0.15, 0.005, -0.004, 0])
        camera = Camera(chr(ord("A") + i), K, distortion, R, centre, size)
        stations.append(Station(camera, sensor or Sensor(), frame_rate, float(start)))
    period = 1 / min(part.frequency for part in components)
    motion = Motion(structure, components, REST_S + MAX_START_S, 2 * period)
    return Rig(
        tuple(stations),
        markers or _default_markers(structure),
        motion,
        duration=motion.steady + max(1.0, 5 * period),
        audio_noise_db=audio_noise_db,
        seed=seed,
    )


def _default_markers(structure: Beam | Plate) -> Markers:
    if isinstance(structure, Beam):
        return rows_on(structure)
    cells = Markers(structure.extent, structure.markers, 0.0)
    return replace(cells, diameter=float(cells.nearest.min()) / 5)
