"""Direct tracking of markers in rendered frames, without files and with known clocks.

Cameras are known, too, or calibrated first. Only the effects of geometry, pixels, noise and the
tracker remain. A few periods are enough for these, so that many rigs can be simulated in the time
of one full recording.

Cameras in front of a planar structure of any outline are slightly misaimed, and calibrated jointly
from board images. Their sensors are then cropped to the structure, and markers are tracked from the
corners of the outline, marked to a pixel. In an impact test, the free decay of the structure is cut
out of the tracks.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy
import xarray as xr

from thesis_lib.arrays import Array, ArrayLike, ComplexArray, IntArray
from thesis_lib.laboratory import recording_files, render, rig as rigs
from thesis_lib.laboratory.rig import Rig, Station
from thesis_lib.measure.calibration.bundle_adjustment import Adjustment, adjust_bundle
from thesis_lib.measure.calibration.corners import BoardNotFound, find_corners
from thesis_lib.measure.calibration.rig import calibrate_camera, unify_corners
from thesis_lib.measure.fitting import harmonics as fits
from thesis_lib.measure.fitting.reconstruction import Rest, check_rest, fit_grid, triangulate_seen
from thesis_lib.measure.modes.shapes import Track
from thesis_lib.measure.recordings.board import Board, Markers, on_surface
from thesis_lib.measure.tracking.homography import TrackingError, View, corner_view, darken_markers
from thesis_lib.measure.tracking.tracker import Tracker, sharpen_view
from thesis_lib.studies.schema import label_values, read_variables
from thesis_lib.studies.workers import map_in_two_threads
from thesis_lib.vibration.motion import Component, Motion
from thesis_lib.vibration.polygons import Point
from thesis_lib.vibration.structure import Structure
from thesis_lib.vision import pinhole

MAX_CENTRE_ERROR_PX = 1.0  # px from the truth; beyond, a marker counts as confused with another
TRACK_VARIABLES = read_variables(__file__, "tracks")


@dataclass(frozen=True)
class TrackedCentres:
    """Tracks of the markers in one camera."""

    times: Array  #: World times of the frames, s, shape (frames,)
    #: Centres with lens distortion, px; NaN where missing, shape (frames, 2, markers)
    centres: Array

    @property
    def missing(self) -> float:
        """Return the share of the marker images that are missing."""
        return float(np.mean(np.isnan(self.centres[:, 0])))

    def error(self, rig: Rig, station: Station) -> Array:
        """Return distances from the true centres in mid-exposure, shape (frames, markers), px."""
        truth = true_centres(rig, station, self.times)
        return np.asarray(np.hypot(*(self.centres - truth).swapaxes(0, 1)), float)


def frame_times(rig: Rig, station: Station) -> Array:
    """Return world times of a camera's frames in s."""
    count = int(rig.duration * station.frame_rate)
    return np.asarray(station.start + np.arange(count) / station.frame_rate)


def true_centres(rig: Rig, station: Station, times: Array) -> Array:
    """Project the markers at times (n, ...), shape (n, 2, ..., markers), px."""
    points = rig.markers.centres
    world = on_surface(rig.markers.extent, points, rig.motion.deflection(points, times))
    return np.asarray(pinhole.project_points(station.camera, world).swapaxes(0, 1))


def true_view(camera: pinhole.Camera, markers: Markers) -> View:
    """Return a camera's true view of the structure at rest."""
    corners = pinhole.project_points(camera, on_surface(markers.extent, markers.corners))
    return corner_view(camera, markers, pinhole.undistort_pixels(camera, corners))


def track_camera(
    rig: Rig, index: int, view: View, corners: Sequence[Point] | None = None
) -> TrackedCentres:
    """Render and track the markers in one camera.

    `view` is its assumed view of the structure, `corners` (n, 2) in m are those of the outline if
    that is not a rectangle. Centres are NaN if the markers are not found in the first frame.
    """
    station, markers = rig.stations[index], rig.markers
    scene = render.BeamView(station.camera, markers, rig.motion, station.sensor, corners)
    times = frame_times(rig, station)
    centres = np.full((len(times), 2, markers.count), np.nan)
    turn = 2 * np.pi * min(part.frequency for part in rig.motion.components) / station.frame_rate
    tracker = None
    for k, time in enumerate(times.tolist()):
        image = darken_markers(scene.frame(time, rig.generator(1, index, k)), markers)
        try:
            tracker = tracker or Tracker(sharpen_view(image, view), turn)
        except TrackingError:
            break
        centres[k] = tracker.centres(image)
    return TrackedCentres(times, centres)


def track_cameras(rig: Rig) -> list[TrackedCentres]:
    """Track the markers in all cameras in parallel, with known cameras and corners."""
    views = [true_view(camera, rig.markers) for camera in rig.cameras]
    return map_in_two_threads(lambda job: track_camera(rig, *job), enumerate(views))


def record_tracks(
    every_rig: Sequence[Rig],
    frames: int,
    look: Callable[[Rig], list[TrackedCentres]] = track_cameras,
) -> xr.Dataset:
    """Track the markers of several rigs at rest and in the last `frames` frames.

    Two rigs run at a time; `look` renders a rig and tracks its markers. The dataset has ``tracks``
    of :data:`TRACK_VARIABLES`, with ``rig`` as an additional dimension.
    """
    every = map_in_two_threads(look, every_rig)
    tracks = [[own.centres[_stored_frames(own.times, frames)] for own in found] for found in every]
    return xr.Dataset(label_values({"tracks": tracks}, TRACK_VARIABLES, ["rig"]))


def read_tracks(tracks: Array, rig: Rig) -> list[TrackedCentres]:
    """Restore the centres of a rig from stored tracks (cameras, frames, 2, markers), px.

    Times are not stored: the rig reproduces them exactly.
    """
    found = []
    for station, centres in zip(rig.stations, tracks, strict=True):
        times = frame_times(rig, station)
        stored = _stored_frames(times, len(centres) - rigs.REST_FRAMES)
        found.append(TrackedCentres(times[stored], centres))
    return found


def _stored_frames(times: Array, frames: int) -> IntArray:
    """Return the indices of the frames at rest and of the last `frames` frames."""
    return np.r_[: rigs.REST_FRAMES, len(times) - frames : len(times)]


def fit_rig(rig: Rig, found: list[TrackedCentres], omega: float, order: int = 2) -> fits.Fitted:
    """Fit harmonics in the steady-state interval with the true cameras, and the markers' frame.

    Raise ValueError if two cameras see fewer than three markers at rest.
    """
    harmonics: list[fits.Harmonics] = []
    rest = []
    for camera, own in zip(rig.cameras, found, strict=True):
        uv = pinhole.undistort_tracks(camera, own.centres)
        steady = own.times >= rig.motion.steady
        harmonics.append(fits.fit_harmonics(omega, own.times[steady], uv[steady], order))
        rest.append(fits.mean_of(uv[own.times < rig.motion.start]))
    return fits.combine_fit(rig.cameras, harmonics, np.array(rest), rig.markers)


AIM_STD_DEG = 1.0  # standard deviation of the cameras' aim about each axis, °
BOARD_TILES, TILE_SHARE = (5, 4), 0.12  # of the board, and their size over the cameras' distance
BOARD_TILT_DEG = 15.0  # of the board in all poses but one, which is flat, °


def aim_cameras(rig: Rig, distance: float, draw: np.random.Generator, poses: int = 10) -> Rig:
    """Perturb the cameras' aim, and place a board over the structure in some poses.

    The cameras look at its centre from a `distance` in m; the board's size is a share of this.
    """
    Rotation = scipy.spatial.transform.Rotation
    turned = np.radians(AIM_STD_DEG) * draw.standard_normal((len(rig.stations), 3))
    pairs = zip(rig.cameras, Rotation.from_rotvec(turned).as_matrix(), strict=True)
    cameras = [replace(c, R_camera_world=turn @ c.R_camera_world) for c, turn in pairs]
    around = 2 * np.pi * (np.arange(poses) + draw.uniform(-0.2, 0.2, poses)) / (poses - 1)
    axes = np.stack([np.cos(around), np.sin(around), 0 * around], axis=1)
    tilts = np.radians(BOARD_TILT_DEG) * axes
    tilts[0] = 0
    rolls = Rotation.from_euler("z", draw.uniform(-20, 20, (poses, 1)), degrees=True)
    sideways, up = draw.uniform(-0.08, 0.08, (poses, 2)), draw.uniform(-0.02, 0.06, (poses, 1))
    return replace(
        rigs.replace_cameras(rig, cameras),
        board=Board(*BOARD_TILES, TILE_SHARE * distance, TILE_SHARE * distance / 2),
        rotations=(Rotation.from_rotvec(tilts) * rolls).as_matrix(),
        translations=distance * np.concatenate([sideways, up], axis=1),
    )


def calibrate_rig(rig: Rig) -> Adjustment:
    """Calibrate the cameras from their calibration images, in the calibration's own frame.

    Raise CalibrationError if the board is not found often enough.
    """
    found: list[list[Array | None]] = [[] for _ in rig.stations]
    for index, row in enumerate(found):
        for image in recording_files.render_board_images(rig, index):
            try:
                row.append(find_corners(image, rig.board))
            except BoardNotFound:
                row.append(None)
    single = [
        calibrate_camera(row, rig.board, camera.size, name=camera.name)
        for row, camera in zip(found, rig.cameras, strict=True)
    ]
    observed, _ = unify_corners(single, found, rig.board)
    return adjust_bundle(observed, rig.board.corners, [one.lens for one in single])


def crop_sensors(rig: Rig, cameras: Sequence[pinhole.Camera]) -> tuple[Rig, list[pinhole.Camera]]:
    """Crop the sensors of a rig's cameras to the reach of the structure.

    `cameras` are the calibrated ones of the rig, and are returned with the same crop.
    """
    lift = sum(abs(part.amplitude) for part in rig.motion.components)
    lifts = np.array([[-lift], [lift]])
    box = on_surface(rig.markers.extent, rig.markers.corners[:, None], lifts).reshape(3, -1)
    parts, others = [], []
    for camera, other in zip(rig.cameras, cameras, strict=True):
        uv, most = pinhole.project_points(camera, box), np.array(camera.size)
        low = np.clip(np.floor(uv.min(axis=1)).astype(int) - rigs.WINDOW_MARGIN_PX, 0, most - 1)
        high = np.clip(np.ceil(uv.max(axis=1)).astype(int) + rigs.WINDOW_MARGIN_PX, low + 1, most)
        parts.append(rigs.crop_camera(camera, low, high))
        others.append(rigs.crop_camera(other, low, high))
    return rigs.replace_cameras(rig, parts), others


def mark_outline(
    rig: Rig, cameras: Sequence[pinhole.Camera], corners: Sequence[Point]
) -> list[View]:
    """Return the cameras' views of a planar structure with marked corners (n, 2) in m.

    Corners marked to a pixel in every image are triangulated, and the outline is fitted to them as
    a rigid body: four corners of a narrow structure in one image do not define its perspective.
    """
    outline = on_surface(rig.markers.extent, np.array(corners).T)
    images = []
    for true, camera in zip(rig.cameras, cameras, strict=True):
        marked = np.rint(pinhole.project_points(true, outline))
        images.append(pinhole.undistort_pixels(camera, marked))
    P = pinhole.projection_matrices(cameras)
    frame = fit_grid(triangulate_seen(P, np.array(images))[0], outline)
    box = frame.R.T @ on_surface(rig.markers.extent, rig.markers.corners) + frame.origin[:, None]
    pairs = zip(cameras, pinhole.project(P, box), strict=True)
    return [corner_view(camera, rig.markers, four) for camera, four in pairs]


@dataclass(frozen=True)
class ImpactMotion(Motion):
    """Motion of a structure at rest after one impact: free decay of its modes.

    The force is a half sine of `impulse` at `point`, from `start` on and `ramp` long. Every mode of
    angular frequency ω and damping ratio ζ follows q̈ + 2ζω q̇ + ω² q = φ(point) F / m.
    """

    impulse: float = 0.01  #: N s
    point: tuple[float, float] = (0.0, 0.0)  #: Point of the impact, m
    damping: tuple[float, ...] = ()  #: Damping ratio of each component

    @property
    def poles(self) -> ComplexArray:
        """Return λ = ω (−ζ + j √(1 − ζ²)) of every mode, 1/s, shape (components,)."""
        omega = 2 * np.pi * np.array([part.frequency for part in self.components])
        zeta = np.array(self.damping)
        return np.asarray(omega * (1j * np.sqrt(1 - zeta**2) - zeta), complex)

    def coordinates(self, times: ArrayLike) -> Array:
        """Return the displacement of each mode where its shape is 1, shape (components, ...), m."""
        return np.stack([one.imag for one in self._responses(np.asarray(times, float))])

    def force(self, times: ArrayLike) -> Array:
        """Return the force of the impact in N."""
        t = np.asarray(times, float) - self.start
        inside = (t >= 0) & (t <= self.ramp)
        return np.where(inside, self._peak * np.sin(np.pi * t / self.ramp), 0.0)

    def amplitudes(self, points: ArrayLike, at: float) -> ComplexArray:
        """Return complex shapes (modes, n) of the free modes e^{λ (t − at)} at points (2, n), m."""
        size = -1j * np.array(self._responses(np.array(at)))
        return np.asarray(size[:, None] * self.shapes(points), complex)

    @property
    def _peak(self) -> float:
        return self.impulse * np.pi / (2 * self.ramp)

    def _responses(self, times: Array) -> list[ComplexArray]:
        """Return each mode's complex response; the displacement in m is its imaginary part."""
        place, found = np.array(self.point)[:, None], []
        for part, pole in zip(self.components, self.poles, strict=True):
            drive = float(part.shape(self.structure, place)[0])
            mass = self.structure.mass / self.structure.shape_peak(part.mode) ** 2
            gain = self._peak * drive / (mass * pole.imag)
            found.append(gain * _integrate_pulse(complex(pole), times - self.start, self.ramp))
        return found


def _integrate_pulse(pole: complex, t: Array, length: float) -> ComplexArray:
    """Integrate sin(πs/T) e^{λ(t − s)} over the past part of a pulse of length T."""
    kappa, until = np.pi / length, np.clip(t, 0, length)
    decay = np.exp(pole * (np.maximum(t, 0) - until))
    past = -(pole * np.sin(kappa * until) + kappa * np.cos(kappa * until)) * decay
    return np.asarray((past + kappa * np.exp(pole * np.maximum(t, 0))) / (pole**2 + kappa**2))


def add_impact(
    rig: Rig,
    damping: tuple[float, ...],
    point: tuple[float, float],
    *,
    rest: float = 0.3,
    seconds: float = 2.0,
    rates: tuple[float, ...] = (),
    impulse: float = 0.01,
    pulse: float = 0.002,
) -> Rig:
    """Return the rig with an impact test that lasts `seconds` in all.

    The first modes respond, one for each damping ratio. The impact at `point` in m has an `impulse`
    in N s, lasts `pulse` s and begins `rest` s after the last camera's start. `rates` are the
    cameras' frame rates if they differ from the rig's.
    """
    structure: Structure = rig.motion.structure
    hertz = structure.angular_frequencies(len(damping)) / (2 * np.pi)
    parts = tuple(Component("bending", n, frequency=float(f)) for n, f in enumerate(hertz, 1))
    given = rates or tuple(station.frame_rate for station in rig.stations)
    pairs = zip(rig.stations, given, strict=True)
    stations = tuple(replace(station, frame_rate=rate) for station, rate in pairs)
    begin = max(station.start for station in stations) + rest
    motion = ImpactMotion(structure, parts, begin, pulse, impulse, point, damping)
    return replace(rig, stations=stations, motion=motion, duration=seconds)


def select_free_decay(rig: Rig, found: list[TrackedCentres]) -> tuple[list[Track], Rest]:
    """Select tracks of the free decay after the impact, and the markers at rest before it."""
    tracks, still = [], []
    for station, own in zip(rig.stations, found, strict=True):
        uv = pinhole.undistort_tracks(station.camera, own.centres)
        exposure = station.sensor.exposure
        still.append(fits.mean_of(uv[own.times < rig.motion.start]))
        ring = own.times > rig.motion.steady + exposure
        own_v = own.centres[ring, 1]
        tracks.append(Track(station.camera, own.times[ring], uv[ring], exposure, 0.0, own_v))
    thick = float(getattr(rig.motion.structure, "thickness", 0.0))
    return tracks, check_rest(rig.cameras, np.array(still), rig.markers, thick)
