"""The rendered laboratory: cameras like those of chapter 5, the structure, and the board.

World time begins before the first camera starts. Every camera starts at its own time, at which its
clock is 0; the exposure of frame k is centred at k / frame rate on that clock.

The board has twelve poses that all four cameras can see. Cameras that face each other at 22°
elevation have no good view of one printed face in common: a board that lies flat is seen at 68°
from its normal. The board therefore carries the pattern on both faces and stands upright between
them: tilted towards one pair it turns away from the other, whose incidence grows by the tilt. Tilts
up to 42° keep every view below 70°.

Parallel boards determine no focal length (Zhang 2000, section 4), and tilts about one axis only
leave the aspect ratio weak, so the board is tilted, turned and rolled, and it is moved through the
volume that the beam takes up, as far as its corners stay in the images.

Replicates repeat a recording with perturbed camera poses, other clocks and other noise.
"""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from thesis_lib.arrays import Array
from thesis_lib.facts.setups import Setting
from thesis_lib.laboratory.render import Sensor
from thesis_lib.measure.recordings.board import Board, Markers, on_surface, rows_on
from thesis_lib.vibration.motion import Component, Motion
from thesis_lib.vibration.structure import Beam, Plate
from thesis_lib.vision import pinhole

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
    """Return twelve poses of the board: rotations (12, 3, 3) into the world, and centres in m."""
    tilt, turn, roll = np.radians(_BOARD_POSES[:, :3]).T
    upright = _rotate_about_axis(2, turn) @ _rotate_about_axis(0, tilt) @ _UPRIGHT_ROTATION
    return upright @ _rotate_about_axis(2, roll), _BOARD_POSES[:, 3:] * 1e-3


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
    """A camera with its sensor, frame rate and start time."""

    camera: pinhole.Camera  #: Optics and pose
    sensor: Sensor  #: Exposure, spread, noise, grey levels
    frame_rate: float  #: Frames per second
    start: float  #: World time of its first frame, s


@dataclass(frozen=True)
class Rig:
    """Cameras, marked structure, motion and calibration board of a rendered recording."""

    stations: tuple[Station, ...]  #: The cameras
    markers: Markers  #: The structure's extent and its markers
    motion: Motion  #: Motion of the structure, in world time
    duration: float  #: Length of each recording, s
    #: Power of the force over that of the noise on the audio tracks, dB
    audio_noise_db: float = 20.0
    seed: int = 0  #: Seed of all noise
    board: Board = field(default_factory=Board)  #: The calibration board
    #: Poses of the board in the world
    rotations: Array = field(default_factory=lambda: default_poses()[0])
    translations: Array = field(default_factory=lambda: default_poses()[1])

    @property
    def cameras(self) -> list[pinhole.Camera]:
        """Return the cameras of the stations."""
        return [station.camera for station in self.stations]

    @property
    def full_scale(self) -> float:
        """Return the force in N at full scale of the audio tracks."""
        times = np.linspace(self.motion.start, self.motion.steady + 1, 4000)
        return float(np.abs(self.motion.force(times)).max()) / MAX_FORCE_SHARE

    def generator(self, what: int, camera: int, item: int) -> np.random.Generator:
        """Return the noise generator of one frame, calibration image or audio track."""
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
    seed: int = 0,
    markers: Markers | None = None,
) -> Rig:
    """Return the rig of section 5.1: similar, but not identical cameras that face the structure.

    Focal lengths, principal points and distortions differ as between cameras of one model. The
    structure is at rest for at least a second, the motion grows over two periods, and its steady
    state is rendered for a second or five periods, whichever is longer.

    Lengths are in m; pixels are square and fill the sensor's width. All cameras stand `distance`
    from the structure's centre, at these azimuths and elevations. Markers default to those of the
    thesis's beam, or to a plate's with a fifth of their least spacing as diameter.
    """
    angles = np.radians(directions_deg)
    rotations = pinhole.hemisphere_rotations(angles[:, 0], angles[:, 1])
    centres = distance * pinhole.hemisphere_directions(angles[:, 0], angles[:, 1])
    starts = np.random.default_rng([seed, 0]).uniform(0, MAX_START_S, len(angles))
    focal = focal_length / sensor_width * size[0]
    stations = []
    for i, (R, centre, start) in enumerate(zip(rotations, centres, starts, strict=True)):
        differs = np.sin([1.0 + 7 * i, 2.0 + 5 * i, 3.0 + 3 * i, 4.0 + 2 * i])  # in −1…1
        K = pinhole.intrinsics(focal * (1 + 0.005 * differs[0]), size)
        K[:2, 2] += 0.004 * size[0] * differs[1:3]
        distortion = lens_k1 * (1 + 0.2 * differs[3]) * np.array([1, -0.15, 0.005, -0.004, 0])
        camera = pinhole.Camera(chr(ord("A") + i), K, distortion, R, centre, size)
        stations.append(Station(camera, sensor or Sensor(), frame_rate, float(start)))
    if markers is None and isinstance(structure, Beam):
        markers = rows_on(structure)
    elif markers is None:
        cells = Markers(structure.extent, structure.markers, 0.0)
        markers = replace(cells, diameter=float(cells.nearest.min()) / 5)
    period = 1 / min(part.frequency for part in components)
    motion = Motion(structure, components, REST_S + MAX_START_S, 2 * period)
    duration = motion.steady + max(1.0, 5 * period)
    return Rig(tuple(stations), markers, motion, duration, seed=seed)


# Rigs for fast vibrations: a few frames at rest and then, after a ramp of half a period, frames of
# the steady vibration.

REST_FRAMES = 4  # frames at rest
RAMP_PERIODS = 0.5  # periods over which the vibration grows
EXPOSURE_SAMPLES = 3  # of the motion within an exposure


def make_sensor(film: Any) -> Sensor:
    """Return the sensor, with samples of an exposure whose variance in time is that of the light.

    n samples in the middle of equal parts of a time T have the variance T² (1 − 1/n²) / 12.
    """
    exposure = film.exposure_ms / 1000 / np.sqrt(1 - 1 / EXPOSURE_SAMPLES**2)
    return Sensor(exposure, EXPOSURE_SAMPLES, shot=film.shot_noise, read=film.read_noise)


def derive_seed(seed: int, *what: object) -> int:
    """Derive a seed from another and the identity of the rendered item."""
    return int.from_bytes(hashlib.sha256(repr((seed, *what)).encode()).digest()[:6], "big")


def shorten_rig(rig: Rig, offsets: Sequence[float], frames: int) -> Rig:
    """Return the rig with a few frames at rest, then `frames` of the steady vibration.

    Camera i starts `offsets[i]` frame intervals after time 0.
    """
    rate = rig.stations[0].frame_rate
    pairs = zip(rig.stations, offsets, strict=True)
    stations = tuple(replace(station, start=offset / rate) for station, offset in pairs)
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
    """Return a rig for a structure, with the cameras of a setting at a frame rate in Hz.

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


# Replicates: no tripod is put back exactly. Each camera is slightly off its position and direction,
# so that all markers fall on other parts of their pixels.

PLACE_STD_M = 1e-3  # m, standard deviation of a camera's position along X, Y and Z
TURN_STD_RAD = np.radians(0.1)  # of its direction about each of its axes
WINDOW_MARGIN_PX = 24  # px of the sensor that are read around the structure


def replace_cameras(rig: Rig, cameras: Sequence[pinhole.Camera]) -> Rig:
    """Replace the cameras of a rig, in the same order."""
    pairs = zip(rig.stations, cameras, strict=True)
    return replace(rig, stations=tuple(replace(one, camera=camera) for one, camera in pairs))


def perturb_cameras(rig: Rig) -> Rig:
    """Perturb the pose of every camera of a rig, by the rig's seed."""
    cameras = []
    for index, camera in enumerate(rig.cameras):
        shift, turn = rig.generator(9, index, 0).standard_normal((2, 3))
        R = _rotate_about(TURN_STD_RAD * turn) @ camera.R_camera_world
        centre = camera.centre + PLACE_STD_M * shift
        cameras.append(replace(camera, R_camera_world=R, centre=centre))
    return replace_cameras(rig, cameras)


def _rotate_about(vector: Array) -> Array:
    """Return the rotation about a vector by its length in rad (Rodrigues)."""
    x, y, z = vector
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    angle = np.linalg.norm(vector)
    rotation: Array = np.eye(3) + np.sinc(angle / np.pi) * K
    return rotation + 0.5 * np.sinc(angle / 2 / np.pi) ** 2 * K @ K


def crop_camera(camera: pinhole.Camera, low: Array, high: Array) -> pinhole.Camera:
    """Crop a camera's sensor to the rectangle from one corner to another, px."""
    K = camera.K.copy()
    K[:2, 2] -= low
    return replace(camera, K=K, size=(int(high[0] - low[0]), int(high[1] - low[1])))


def window_camera(rig: Rig, station: Station, whole: int = 1) -> tuple[Station, Array]:
    """Crop a camera's sensor to the reach of the structure; return the corner, too.

    A cropped sensor is faster to read and to render. Corner and size are multiples of `whole` px.
    """
    camera, extent = station.camera, rig.markers.extent
    x, y = (np.linspace(0, side, 30) for side in extent)
    points = np.stack([np.tile(x, 30), np.repeat(y, 30)])
    structure, parts = rig.motion.structure, rig.motion.components
    lift = sum(abs(part.amplitude * part.shape(structure, points)) for part in parts)
    reached = on_surface(extent, points[:, None], np.stack([-lift, lift]))
    flat = pinhole.project_points(camera, reached).reshape(2, -1) / whole
    spare, most = WINDOW_MARGIN_PX / whole, np.array(camera.size) // whole
    low = whole * np.clip(np.floor(flat.min(axis=1) - spare).astype(int), 0, most)
    high = whole * np.clip(np.ceil(flat.max(axis=1) + spare).astype(int), low // whole + 1, most)
    return replace(station, camera=crop_camera(camera, low, high)), low.astype(float)


def replicate_seed(seed: int, replicate: int) -> int:
    """Return the seed of a replicate; the first has that of the request."""
    return derive_seed(seed, "again", replicate) if replicate else seed


def make_replicate(rig: Rig, replicate: int) -> Rig:
    """Return the rig of a replicate: the first unchanged, others perturbed and cropped."""
    if replicate == 0:
        return rig
    again = perturb_cameras(rig)
    return replace(again, stations=tuple(window_camera(again, one)[0] for one in again.stations))
