"""Import and export of calibrated cameras, in files of other programs and of measurements.

YAML, XML and JSON are those of ``cv2.FileStorage``, YAML also that of ROS and Kalibr, TOML that of
aniposelib, caliscope and Pose2Sim. All of them count pixels from the centre of the first one, half
a pixel less than this library. Exported cameras are in the structure's frame at rest: origin at
its centre, X along its length, Z along its normal, in m.
"""

import json
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

import cv2
import numpy as np
import xarray as xr

from thesis_lib import __version__, templates
from thesis_lib.arrays import Array
from thesis_lib.files import whole_text
from thesis_lib.measure.calibration import bundle_adjustment as bundle, rig
from thesis_lib.measure.recordings import text_files
from thesis_lib.measure.recordings.manifest import Manifest, ManifestError
from thesis_lib.measure.steps import CALIBRATION_VARIABLES
from thesis_lib.studies import cubes, schema, storage
from thesis_lib.studies.fields import format_given
from thesis_lib.text import one_line
from thesis_lib.vision.pinhole import HALF_PIXEL, Camera

CALIBRATION_FILE = "calibration.nc"
_CAMERA_VARIABLES = ("K", "distortion", "size", "R_camera_world", "centre")
_UNCERTAINTY_VARIABLES = ("board_poses", "focal_deviation", "centre_deviation", "covariance")
FILE_SUFFIXES = (".yaml", ".yml", ".toml", ".xml", ".json", ".nc")
CALIBRATION_KINDS = (
    "YAML, XML or JSON of OpenCV, YAML of ROS or Kalibr, TOML of aniposelib, caliscope or Pose2Sim"
)
MIN_MILLIMETRE_SPAN_M = 100.0  # m; a larger span of the cameras suggests lengths in mm
# Names of the Brown model, which are accepted with no more than five nonzero coefficients
_BROWN_MODELS = {"", "plumb_bob", "opencv", "pinhole", "brown", "radtan", "rational_polynomial"}
_NAMES_FILE = Path(__file__).with_name("camera_names.toml")
_NAMES: dict[str, list[str]] = tomllib.loads(_NAMES_FILE.read_text(encoding="utf-8"))
# Focal lengths over an image's width: a fisheye lens has 0.3, the longest telephoto lens 250
_MIN_FOCAL, _MAX_FOCAL = 0.02, 2000
_MAX_SIDE_PX = 100_000
_AXES_TEXT = "x right, y down, and not mirrored"


@dataclass(frozen=True)
class ReusedCameras:
    """Cameras of a calibration file."""

    cameras: list[Camera]  #: In one frame, m
    placed: bool  #: Whether the file has their poses
    covariance: Array | None = None  #: Of their poses, then lenses, if known


def read_cameras(path: Path, unit: str | None = None) -> ReusedCameras:
    """Return the cameras of a calibration in a file or folder.

    Parameters
    ----------
    path : Path
        A file, the folder of a measurement, or a folder with a file for each camera.
    unit : str, optional
        Unit of lengths, "m" or "mm"; by default the file's, else m.

    Raises
    ------
    ManifestError
        If the calibration cannot be read, or has cameras that cannot be used.
    """
    files = [path]
    if path.is_dir():
        texts = sorted(one for one in path.iterdir() if one.suffix.lower() in FILE_SUFFIXES[:-1])
        files = [path / CALIBRATION_FILE] if (path / CALIBRATION_FILE).is_file() else texts
    if not files or not all(map(Path.is_file, files)):
        raise ManifestError(f"{path}: no calibration there, allowed: {', '.join(FILE_SUFFIXES)}")
    if files[0].suffix.lower() == ".nc":
        try:
            data = storage.open_netcdf(files[0])
            # The covariance has zeros for lenses with unknown errors
            told = np.isfinite(data["focal_deviation"].values).all()
            return ReusedCameras(rig.cameras_in(data), True, covariance_of(data) if told else None)
        except (cubes.CubeError, KeyError):
            raise ManifestError(f"{files[0]}: no calibration of a measurement") from None
    cameras, placed = [], []
    for file in files:
        values = _values(file)
        said = values.get("metadata")
        scale = unit or (said.get("units") if isinstance(said, Mapping) else None) or "m"
        if scale not in ("m", "mm"):
            raise ManifestError(f"{file}: lengths in {format_given(scale)}, allowed: m or mm")
        name = file.stem
        try:
            for name, entry in _entries(values, file.stem):
                camera, at = _camera(entry, name, 1e-3 if scale == "mm" else 1.0)
                cameras.append(camera)
                placed.append(at)
        except (KeyError, TypeError, ValueError, OverflowError) as error:
            why = f"no {error.args[0]}" if isinstance(error, KeyError) else error
            raise ManifestError(f"{file}: camera {one_line(name)}: {why}") from None
    if not cameras:
        raise ManifestError(f"{path}: no camera in it, allowed: those with a camera_matrix")
    centres = np.array([one.centre for one in cameras])
    apart = float(np.linalg.norm(np.ptp(centres, axis=0)))
    if apart > MIN_MILLIMETRE_SPAN_M:
        raise ManifestError(
            f"{path}: cameras {apart:.4g} m apart, allowed: {MIN_MILLIMETRE_SPAN_M:g} m; if its "
            "lengths are in mm, give calibration.unit: mm"
        )
    return ReusedCameras(cameras, all(placed))


def _values(path: Path) -> dict[str, Any]:
    """Read the values of a text file by name."""
    parsers: dict[str, Callable[[str], Any]] = {
        ".toml": text_files.parse_toml,
        ".json": text_files.parse_json,
        ".xml": lambda text: _of_xml(text_files.parse_xml(text)),
    }
    parse = parsers.get(path.suffix.lower(), text_files.parse_yaml)
    try:
        values = parse(text_files.read_text(path))
    except (OSError, text_files.TextFileError) as error:
        why = getattr(error, "strerror", None) or error
        raise ManifestError(
            f"{path}: not a calibration that can be read ({why}), allowed: {CALIBRATION_KINDS}, "
            f"{CALIBRATION_FILE}"
        ) from None
    return values if isinstance(values, dict) else {}


def _of_xml(element: Element) -> Any:
    """Convert an element of OpenCV's XML to a dictionary, text, number or list of numbers."""
    if len(element):
        return {inside.tag: _of_xml(inside) for inside in element}
    text = (element.text or "").strip()
    try:
        numbers = [float(number) for number in text.split()]
    except ValueError:
        return text.strip('"')
    return numbers[0] if len(numbers) == 1 else numbers


def _entries(values: Mapping[str, Any], stem: str) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the name and values of each camera in a file."""
    own = {str(key).lower(): value for key, value in values.items()}
    if own.get("ignore") is True:  # an uncalibrated camera of caliscope
        return
    inside = {key: value for key, value in values.items() if isinstance(value, Mapping)}
    if any(isinstance(own.get(name), list | Mapping) for name in _NAMES["matrix"]):
        keys = "name", "camera_name", "cam_id", "port"
        yield str(next((own[key] for key in keys if key in own), stem)), own
    elif chain := {key: value for key, value in inside.items() if "intrinsics" in value}:
        yield from _of_kalibr(chain)
    else:
        for key, value in inside.items():
            yield from _entries(value, str(key))


def _of_kalibr(cameras: Mapping[Any, Mapping[str, Any]]) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield name and values of each camera of a Kalibr camchain, with its accumulated pose."""
    pose = np.eye(4)
    for k, (name, given) in enumerate(cameras.items()):
        entry = {key.lower(): value for key, value in given.items()}
        focal = entry["intrinsics"]
        if entry.get("camera_model", "pinhole") != "pinhole":
            entry["distortion_model"] = entry["camera_model"]
        if isinstance(focal, list) and len(focal) == 4:
            f_x, f_y, c_x, c_y = focal
            entry["camera_matrix"] = [[f_x, 0, c_x], [0, f_y, c_y], [0, 0, 1]]
        step = entry.get("t_cn_cnm1")
        if k == 0 and len(cameras) > 1:
            step = np.eye(4).tolist()
        if step is not None:
            pose = _numbers(step, "T_cn_cnm1", (16,)).reshape(4, 4) @ pose
            entry |= {"rotation": pose[:3, :3].tolist(), "translation": pose[:3, 3].tolist()}
        yield str(name), entry


def _camera(entry: Mapping[str, Any], name: str, scale: float) -> tuple[Camera, bool]:
    """Return one camera with lengths times a scale, and whether its pose is known."""

    def first_given(what: str) -> Any:
        return next((entry[one] for one in _NAMES[what] if entry.get(one) is not None), None)

    K = _numbers(first_given("matrix"), "camera_matrix", (9,)).reshape(3, 3)
    size = first_given("size") or [first_given("width"), first_given("height")]
    width, height = _numbers(size, "image_width and image_height", (2,))
    focal = K[[0, 1], [0, 1]] / max(width, 1)
    if not (
        np.allclose(K[2], [0, 0, 1])
        and abs(K[1, 0]) < 1e-9
        and (min(width, height) > 0 and max(width, height) <= _MAX_SIDE_PX)
        and (focal.min() > _MIN_FOCAL and focal.max() < _MAX_FOCAL)
    ):
        raise ValueError(
            f"camera_matrix: given {format_given(K.tolist())} for {width:.6g} × {height:.6g} px, "
            f"allowed: sides up to {_MAX_SIDE_PX} px, focal lengths of {_MIN_FOCAL} to "
            f"{_MAX_FOCAL} widths, {_AXES_TEXT}"
        )
    K[:2, 2] += HALF_PIXEL
    turn, move = first_given("rotation"), first_given("translation")
    placed = turn is not None and move is not None
    R, t = np.eye(3), np.zeros(3)
    if placed:
        given = _numbers(turn, "rotation", (3, 9))
        R = given.reshape(3, 3) if given.size == 9 else np.asarray(cv2.Rodrigues(given)[0], float)
        if not np.allclose(R @ R.T, np.eye(3), atol=1e-4) or np.linalg.det(R) < 0:
            raise ValueError(
                f"rotation: given {format_given(given.tolist())}, allowed: nine or three numbers "
                f"of a rotation, {_AXES_TEXT}"
            )
        t = scale * _numbers(move, "translation", (3,))
    model = "fisheye" if first_given("fisheye") else str(first_given("model") or "").lower()
    lens = first_given("distortion")
    values = np.zeros(5) if lens is None else _numbers(lens, "distortion_coefficients", ())
    if model not in _BROWN_MODELS or values.size in (1, 2, 3) or values[5:].any():
        raise ValueError(
            f"distortion model {format_given(model)} with {values.size} coefficients, allowed: "
            "k1, k2, p1, p2, k3 (Brown)"
        )
    distortion = np.concatenate([values, np.zeros(5)])[:5]
    return Camera(name, K, distortion, R, -R.T @ t, (int(width), int(height))), placed


def _numbers(given: Any, name: str, counts: tuple[int, ...]) -> Array:
    """Return a matrix in OpenCV's form, or lists, as a flat array of finite numbers."""
    if given is None or (isinstance(given, list) and None in given):
        raise KeyError(name)
    inner = given.get("data") if isinstance(given, Mapping) else given
    try:
        values = np.ravel(np.asarray(inner, float))
    except (TypeError, ValueError, OverflowError):
        values = np.array([np.nan])
    if not np.isfinite(values).all() or (counts and values.size not in counts):
        raise ValueError(f"{name}: given {format_given(inner)}, allowed: finite numbers")
    return values


def write_cameras(path: Path, cameras: Sequence[Camera]) -> None:
    """Write cameras as YAML for ``cv2.FileStorage``, or as TOML for aniposelib and its readers.

    In YAML ``names`` lists them; the k-th has, under ``camera_k``, ``image_width``,
    ``image_height``, ``camera_matrix``, ``distortion_coefficients``, ``rvec``, ``tvec`` in m, as
    ``cv2.projectPoints`` takes them.
    """
    described = [
        {
            # Quoted as in JSON, valid in TOML and YAML: a plain null or yes is not text in YAML
            "name": json.dumps(one.name, ensure_ascii=False),
            "size": list(one.size),
            "matrix": (one.K - [[0, 0, HALF_PIXEL], [0, 0, HALF_PIXEL], [0, 0, 0]]).tolist(),
            "distortions": one.distortion.tolist(),
            "rotation": cv2.Rodrigues(one.R_camera_world)[0].ravel().tolist(),
            "translation": one.t.tolist(),
        }
        for one in cameras
    ]
    whole_text(path, templates.render(__file__, f"cameras{path.suffix}.j2", cameras=described))


# Import of a calibration that a manifest names: cameras with poses, or lenses only.


def reuse_calibration(manifest: Manifest, folder: Path) -> ReusedCameras | None:
    """Import the calibration that a manifest names, if any, with cameras in its order."""
    asked = manifest.calibration
    if asked is None:
        return None
    path = folder / asked.file
    try:
        found = read_cameras(path, asked.unit)
    except ManifestError as error:
        raise ManifestError(f"calibration: {error}") from None
    names = [one.name for one in found.cameras]
    there = [(one.name, one.size) for one in found.cameras]
    for name, size in ((camera.name, camera.size) for camera in manifest.cameras):
        if names.count(name) != 1 or (name, size) not in there:
            listed = ", ".join(f"{one} of {width} × {height} px" for one, (width, height) in there)
            raise ManifestError(
                f"calibration: {path}: has cameras {listed}, allowed: one {name} of "
                f"{size[0]} × {size[1]} px, as the manifest says"
            )
    order = [names.index(camera.name) for camera in manifest.cameras]
    if asked.poses == "kept" and not found.placed:
        raise ManifestError(
            f"calibration: {path}: does not say where all cameras are, allowed: poses: anew, with "
            "images of the board"
        )
    covariance = found.covariance
    if covariance is not None:
        rows = bundle.camera_unknowns(np.array(order), len(names))
        covariance = covariance[np.ix_(rows, rows)]
    return ReusedCameras([found.cameras[k] for k in order], found.placed, covariance)


def describe_reused(cameras: Sequence[Camera], covariance: Array | None) -> xr.Dataset:
    """Return an imported calibration as a dataset; deviations are NaN without a covariance."""
    network, lenses = bundle.without_boards(cameras), bundle.POSE_UNKNOWNS * len(cameras)
    if covariance is None:
        covariance = np.full((network.unknowns, network.unknowns), np.nan)
    centres, _ = bundle.camera_deviations(network, covariance)
    own = {name: np.array([getattr(one, name) for one in cameras]) for name in _CAMERA_VARIABLES}
    values = own | {
        "board_poses": 0,
        "shots_used": np.zeros(len(cameras), int),
        "focal_deviation": np.sqrt(np.diag(covariance)[lenses :: bundle.LENS_UNKNOWNS]),
        "centre_deviation": np.linalg.norm(centres, axis=1),
        "covariance": covariance,
    }
    names = [one.name for one in cameras]
    key = storage.key_of([names, [value.tolist() for value in own.values()]])
    attrs = {"notes": "", "key": key}
    return xr.Dataset(schema.label_values(values, CALIBRATION_VARIABLES), {"camera": names}, attrs)


def covariance_of(calibration: xr.Dataset) -> Array | None:
    """Return the covariance of the cameras; None if it is not known."""
    covariance = np.asarray(calibration["covariance"].values, float)
    return covariance if np.isfinite(covariance).all() else None


def select_reusable(calibration: xr.Dataset) -> xr.Dataset:
    """Return the variables of a calibration that another measurement can import."""
    names = [*_CAMERA_VARIABLES, *_UNCERTAINTY_VARIABLES]
    own = calibration[names].drop_attrs(deep=False).assign_attrs(title="Calibrated cameras")
    return schema.with_origin(own, f"measurement by thesis_lib {__version__}")
