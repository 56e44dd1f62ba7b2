"""Closed-form predictions of camera performance, and draft manifests.

A draft manifest plans a recording with phones around a structure.
"""

import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import scipy

from thesis_lib.arrays import Array, Mask
from thesis_lib.files import whole_text
from thesis_lib.measure.fitting.reconstruction import group_visible
from thesis_lib.measure.messages import CHECK_LIMITS
from thesis_lib.measure.recordings import board, template, validation
from thesis_lib.measure.recordings.manifest import Manifest, ManifestError, validate_manifest
from thesis_lib.vibration.motion import fold_frequency
from thesis_lib.vision import optics, pinhole, rounding, triangulation

DEFAULT_STEADY_S = 1.0  # steady-state interval of predicted errors if the manifest has none
OPTICS_FIELDS = (
    "focal_length_mm", "sensor_width_mm", "distance_mm", "azimuth_deg", "elevation_deg",
)  # fmt: skip
_PHONE_FILE = Path(__file__).with_name("phone.toml")
PHONE_CAMERA = tomllib.loads(_PHONE_FILE.read_text(encoding="utf-8"))
FIRST_AZIMUTH_DEG, ELEVATION_DEG = 20.0, 30.0  # of the first camera, of all
DISTANCE_MARGIN = 1.05  # over the least distance at which the structure fits into every image
MARKER_COLUMNS, MARKER_ROWS = 6, 4  # of a plate's markers, unless they are given
MAX_DIAMETER_MM = 12.0  # of a marker
STEADY_INTERVAL_S = [5.0, 35.0]  # half a minute
REPORTED_FIELDS = (
    *(name for name in template.ASKED_FIELDS if name != "cameras.exposure_s"),
    "excitation.amplitude_mm",
    *(f"cameras.{name}" for name in (*PHONE_CAMERA, "distance_mm", "elevation_deg")),
)


@dataclass(frozen=True)
class CameraPrediction:
    """Predicted performance of one camera; NaN where the manifest lacks values."""

    name: str
    #: Length d/f that a pixel spans at the structure's centre across the axis, mm
    ground_sample_mm: float
    #: Axes D f/d and D sin φ f/d of a marker's image there, px
    along_px: float
    across_px: float
    #: Largest image motion in an exposure, min(2πfT, 2) A ∂(u, v)/∂Z, px, and the share 1 −
    #: sin(πfT)/(πfT) of the amplitude that motion blur removes
    blur_px: float
    lost: float
    #: Limits of the depth of field, mm
    near_mm: float
    far_mm: float
    #: Depths of the nearest and the farthest vibrating marker, mm; largest circle of confusion
    #: of the two, f²/(N(d − f)) |1 − d/z|, px
    nearest_mm: float
    farthest_mm: float
    defocus_px: float
    in_view: float  #: Share of the markers that stay in the image
    gap_px: float  #: Least distance between the edges of two images of markers and hole, px
    motion_px: float  #: Largest image motion from rest, A ∂(u, v)/∂Z, px
    #: Largest apparent motion between frames along the plane at rest, 2A |sin(πf/r)| times the
    #: cotangent of the line of sight's elevation, over the least spacing
    move_spacings: float


@dataclass(frozen=True)
class RigPrediction:
    """Predicted standard errors of the deflection: rms over the markers, and worst, in mm."""

    located: int  #: Cameras with given lens and position; others are ignored
    noise_px: float  #: Assumed scatter of the centres, px
    #: Length of the steady-state interval, s, and the slowest camera's frames in it
    steady_interval_s: float
    frames: int
    #: Of one frame, of the harmonic fit, and of whole-pixel centres at `amplitude_mm`, mm
    one_frame: tuple[float, float]
    fit: tuple[float, float]
    rounding: tuple[float, float]
    smallest_mm: float  #: Three standard errors of the fit at the worst marker, mm


@dataclass(frozen=True)
class PredictedView:
    """Predicted views of the markers, NaN for unlocated cameras; the first axis is the camera.

    Values of OPTICS_FIELDS; projection matrices; directions; world points (3, n); depths (cameras,
    3, n) at −A, 0 and A; whether markers stay in the image, and corners at rest; Jacobian (cameras,
    2, 3, n) in px/m; apparent motion along the plane at rest over deflection.
    """

    optics: Array
    P: Array
    directions: Array
    points: Array
    depths: Array
    seen: Mask
    corners: Mask
    J: Array
    slide: Array

    @property
    def located(self) -> Mask:
        """Return which cameras have a lens and a position."""
        return np.asarray(np.isfinite(self.optics).all(axis=1))


def view_markers(manifest: Manifest, amplitude: float) -> PredictedView:
    """Predict the views of the cameras for markers that vibrate with an amplitude in m."""
    cameras, s = manifest.cameras, manifest.structure
    optics = np.array([[getattr(c, name) for name in OPTICS_FIELDS] for c in cameras], float)
    azimuth, elevation = np.radians(optics[:, 3:].T)
    focal_px = optics[:, 0] / optics[:, 1] * [c.width_px for c in cameras]
    K = np.array([pinhole.intrinsics(f, c.size) for f, c in zip(focal_px, cameras, strict=True)])
    directions = pinhole.hemisphere_directions(azimuth, elevation)
    centres = optics[:, 2:3] / 1000 * directions
    rotations = pinhole.hemisphere_rotations(azimuth, elevation)
    P = pinhole.CameraArray(K, rotations, centres, cameras[0].size).P
    X = board.on_surface(s.extent, s.marker_points)
    corners = board.on_surface(s.extent, np.array(s.extent)[:, None] * [[0, 1, 1, 0], [0, 0, 1, 1]])
    swing = np.repeat(X[:, None], 3, axis=1)
    swing[2] += amplitude * np.array([[-1.0], [0.0], [1.0]])

    def images(points: Array) -> tuple[Array, Mask]:
        uv, flat = pinhole.project(P, points), points.reshape(3, -1)
        depth = (P[:, 2, :3] @ flat + P[:, 2, 3:]).reshape(len(P), *points.shape[1:])
        on = [pinhole.on_sensor(own[None], c.size)[0] for own, c in zip(uv, cameras, strict=True)]
        return depth, (depth > 0) & np.array(on)

    depths, seen = images(swing)
    slide = np.hypot(*(X[:2, None] - centres.T[:2, :, None])) / centres[:, 2:]
    ahead = depths[:, 1] > 0
    J = np.where(ahead[:, None, None], triangulation.image_jacobian(P, X), np.nan)
    stay, inside = np.asarray(seen.all(axis=1)), images(corners)[1]
    slide = np.where(ahead, slide, np.nan)
    return PredictedView(optics, P, directions, X, depths, stay, inside, J, slide)


def _least_gap(P: Array, markers: board.Markers) -> float:
    """Return the least distance in px between the edges of two images, of markers and hole.

    P projects their centres. The distance of convex sets is the largest gap between their
    projections on any direction n; discs with the Jacobian J = ∂(u, v)/∂(X, Y), shape (2, 2, n),
    reach D/2 |Jᵀn| from their centres.
    """
    X = markers.world
    uv, J = pinhole.project(P[None], X)[0], triangulation.image_jacobian(P[None], X)[0, :, :2]
    if uv.shape[1] < 2 or not np.isfinite(uv).all() or np.any(P[2, :3] @ X + P[2, 3] <= 0):
        return np.nan
    angles = np.arange(90) * np.pi / 90
    normals = np.stack([np.cos(angles), np.sin(angles)])
    wide = markers.diameter * np.linalg.norm(np.tensordot(normals, J, (0, 0)), axis=1).T
    near = scipy.spatial.cKDTree(uv.T).query(uv.T, k=min(9, uv.shape[1]))[1][:, 1:]
    apart = np.abs(np.tensordot(uv[:, near] - uv[:, :, None], normals, (0, 0)))
    return float((apart - wide[:, None]).max(axis=2).min())


def predict_camera(
    manifest: Manifest, view: PredictedView, i: int, amplitude: float
) -> CameraPrediction:
    """Return the predicted performance of camera i, for an amplitude in m."""
    camera, markers = manifest.cameras[i], validation.markers_of(manifest)
    diameter_mm = manifest.structure.markers.diameter_mm
    f, exposure = manifest.excitation.frequency_hz or np.nan, camera.exposure_s
    focal, sensor, distance, _, elevation = view.optics[i]
    pitch, stop = sensor / camera.width_px, float(camera.f_number or np.nan)
    sample = distance * pitch / focal
    ends = 1000 * np.array([view.depths[i].min(), view.depths[i].max()])
    circle = optics.blur_circle(focal, stop, distance, ends).max() / pitch
    swept = min(2 * np.pi * f * exposure, 2.0) * amplitude
    step = 2 * amplitude * abs(np.sin(np.pi * f / camera.rate_hz))
    lift = np.fmax.reduce(np.linalg.norm(view.J[i, :, 2], axis=0))
    widest = CHECK_LIMITS["depth-of-field"] * pitch  # acceptable circle of confusion, mm
    near, far = map(float, optics.depth_of_field(focal, stop, distance, widest))
    spacing = markers.nearest.min()  # infinite for one marker
    return CameraPrediction(
        camera.name,
        sample,
        diameter_mm / sample,
        diameter_mm / sample * np.sin(np.radians(elevation)),
        swept * lift,
        1 - np.sinc(f * exposure),
        near,
        far,
        ends[0],
        ends[1],
        circle if ends[0] > 0 and distance > focal else np.nan,
        view.seen[i].mean() if view.located[i] else np.nan,
        _least_gap(view.P[i], markers),
        amplitude * lift,
        step * np.fmax.reduce(view.slide[i]) / spacing,
    )


def steady_seconds(manifest: Manifest) -> float:
    """Return the length of the steady-state interval in s."""
    begin, end = manifest.excitation.steady_interval_s or (0.0, DEFAULT_STEADY_S)
    return end - begin


def predict_errors(
    manifest: Manifest, view: PredictedView, amplitude: float, noise: float
) -> list[Array]:
    """Predict the errors in mm of each marker: of one frame, of the fit, of whole pixels."""
    on = view.located
    if np.count_nonzero(on) < 2:
        return [np.full(view.points.shape[1], np.nan)] * 3
    P, X, seen = view.P[on], view.points, view.seen[on]
    rates = np.array([c.rate_hz for c in manifest.cameras])[on]
    exposures = np.array([c.exposure_s for c in manifest.cameras])[on]
    f = manifest.excitation.frequency_hz or 0.0
    fit = noise * np.sqrt(2 / (rates * steady_seconds(manifest))) / np.abs(np.sinc(f * exposures))
    turn = 2 * np.pi * fold_frequency(f, rates.min()) / rates.min()
    return [
        1000 * predict_noise_errors(P, X, np.full(len(P), noise), seen),
        1000 * predict_noise_errors(P, X, fit, seen),
        1000 * rounding_errors(P, X, amplitude, turn, seen),
    ]


def reduce_errors(errors: Array) -> tuple[float, float]:
    """Return root mean square and largest of the known errors; NaN if there are none."""
    known = errors[~np.isnan(errors)]
    if len(known) == 0:
        return np.nan, np.nan
    return float(np.sqrt(np.mean(known**2))), float(known.max())


def predict_noise_errors(P: Array, points: Array, sigma: Array, seen: Mask) -> Array:
    """Return the standard errors √Σ (∂Z/∂m σ)² of heights for centre noise, shape (n,), m.

    P are projection matrices (cameras, 3, 4), `points` (3, n) in m, `sigma` the noise of each
    camera's coordinates in px, (cameras,): for the amplitude of a harmonic fit to N frames √(2/N)
    times that of one. `seen` (cameras, n) is whether a camera sees a point; NaN where fewer than
    two do.
    """

    def variance(on: Mask, X: Array) -> Array:
        gain = triangulation.triangulation_gain(P[on], X)[2]
        return np.asarray(np.sum((gain * sigma[on, None, None]) ** 2, axis=(0, 1)))

    return _errors_by_view(variance, points, seen)


def rounding_errors(P: Array, points: Array, amplitude: float, turn: float, seen: Mask) -> Array:
    """Return the rms errors of whole-pixel centres by the law of rounding, shape (n,), m.

    The frame nearest to a maximum shows A cos ψ, with ψ uniform in ±turn/2, for an amplitude A in m
    and a phase step `turn` between frames in rad. Others are as in :func:`predict_noise_errors`.
    """
    up = np.zeros((3, 16, 1))
    up[2, :, 0] = amplitude * np.cos((np.arange(16) + 0.5) / 16 * turn / 2)

    def variance(on: Mask, X: Array) -> Array:
        each = rounding.deflection_variance(P[on], X[:, None], X[:, None] + up)
        return np.maximum(each.mean(axis=0), 0)

    return _errors_by_view(variance, points, seen)


def _errors_by_view(variance: Callable[[Mask, Array], Array], points: Array, seen: Mask) -> Array:
    """Return errors by the cameras that see a point; infinite where these are in line with it."""
    result = np.full(points.shape[1], np.nan)
    for on, where in group_visible(seen):
        each = np.sqrt(variance(on, points[:, where]))
        result[where] = np.where(np.isnan(each), np.inf, each)
    return result


def write_draft(folder: Path, given: Mapping[str, Any]) -> tuple[Path, list[str]]:
    """Write ``planned.yaml`` into a folder, which is created if missing; read no file in it.

    `given` has fields by path; ``cameras`` is the number of cameras. Return the path of the
    manifest, and lines with the camera positions and the assumed values. Raise ManifestError if the
    manifest exists, or for values that are not allowed.
    """
    path = folder / "planned.yaml"
    if path.exists():
        raise ManifestError(f"{path}: is there already, allowed: none; edit it, or remove it")
    manifest, own = draft_manifest(given), {k: v for k, v in given.items() if k != "cameras"}
    assumed = template.find_assumed(manifest, own, REPORTED_FIELDS)
    folder.mkdir(parents=True, exist_ok=True)
    whole_text(path, template.format_manifest(manifest, assumed))
    places = ", ".join(f"{c.azimuth_deg:g}°" for c in manifest.cameras)
    first = manifest.cameras[0]
    where = (
        f"{len(manifest.cameras)} cameras, {first.distance_mm:g} mm from the structure's centre "
        f"and {first.elevation_deg:g}° above its plane, at azimuths {places}"
    )
    return path, [where, *template.list_assumed(manifest, assumed)]


def draft_manifest(given: Mapping[str, Any]) -> Manifest:
    """Return a manifest of phones on all sides, as near as the whole structure is in view.

    Azimuths are evenly spaced; for a structure more than twice as long as wide they move towards
    its long sides, since its ends show it foreshortened. Raise ManifestError for values that are
    not allowed.
    """
    count, rest = given["cameras"], {k: v for k, v in given.items() if k != "cameras"}
    if type(count) is not int or not 2 <= count <= 16:
        raise ManifestError(f"-p: cameras: given {count}, allowed: a whole number from 2 to 16")
    cameras = [
        {
            "name": f"phone-{i + 1}",
            "video": f"phone-{i + 1}.mp4",
            "board_images": f"board/phone-{i + 1}",
            **PHONE_CAMERA,
            "distance_mm": 1000.0,
            "elevation_deg": ELEVATION_DEG,
        }
        for i in range(count)
    ]
    filled = {"excitation.steady_interval_s": STEADY_INTERVAL_S} | _default_markers(rest) | rest
    values = template.merge_given(cameras, filled)
    manifest = validate_manifest(values)
    size = manifest.structure.width_mm, manifest.structure.length_mm
    turn = np.radians(FIRST_AZIMUTH_DEG) + 2 * np.pi * np.arange(count) / count
    slender = min(1.0, 2 * size[0] / size[1])
    azimuths = np.degrees(np.arctan2(slender * np.sin(turn), np.cos(turn)))
    for camera, azimuth in zip(cameras, azimuths, strict=True):
        camera.setdefault("azimuth_deg", round(float(azimuth), 1))
    if "cameras.distance_mm" not in rest:
        distance = _nearest_distance(validate_manifest(values))
        for camera in cameras:
            camera["distance_mm"] = distance
    return validate_manifest(values)


def _default_markers(given: Mapping[str, Any]) -> dict[str, Any]:
    """Return markers that cover a plate; none if any field of markers is given."""
    size: list[Any] = [given.get(f"structure.{side}_mm") for side in ("length", "width")]
    known = all(isinstance(one, (int, float)) and one > 0 for one in size)
    own = any(name.startswith("structure.markers") for name in given)
    if own or not known or given.get("structure.kind", "beam") == "beam":
        return {}
    along, across = size[0] / (MARKER_COLUMNS + 0.5), size[1] / (MARKER_ROWS + 0.5)
    third = min(along, across) / 3
    return {
        "structure.markers.columns": MARKER_COLUMNS,
        "structure.markers.rows": MARKER_ROWS,
        "structure.markers.spacing_mm": float(f"{along:.2g}"),
        "structure.markers.row_spacing_mm": float(f"{across:.2g}"),
        "structure.markers.diameter_mm": min(MAX_DIAMETER_MM, float(f"{third:.2g}")),
    }


def _nearest_distance(manifest: Manifest) -> float:
    """Return the least distance in mm, with a margin, that puts the structure in all images."""
    low, high = 1.0, 1e5
    while high > 1.001 * low:
        middle = float(np.sqrt(low * high))
        cameras = tuple(c.model_copy(update={"distance_mm": middle}) for c in manifest.cameras)
        view = view_markers(manifest.model_copy(update={"cameras": cameras}), 0.0)
        inside = bool(view.corners.all() and view.seen.all())
        low, high = (low, middle) if inside else (middle, high)
    return float(10 * np.ceil(DISTANCE_MARGIN * high / 10))
