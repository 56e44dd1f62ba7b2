"""Calibrated cameras from files of other programs, and of earlier measurements.

YAML is that of ``cv2.FileStorage`` and of ROS, TOML that of aniposelib and of caliscope. All of
them count pixels from the middle of the first one, half a pixel less than we do.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from thesis_lib.arrays import Array
from thesis_lib.measure.calibration.rig import cameras_in
from thesis_lib.measure.recordings.manifest import ManifestError
from thesis_lib.measure.recordings.text_files import (
    TextFileError,
    parse_toml,
    parse_yaml,
    read_text,
)
from thesis_lib.studies import storage
from thesis_lib.studies.refusals import shown
from thesis_lib.vision.lens import HALF, Camera

OWN = "calibration.nc"
ENDINGS = (".yaml", ".yml", ".toml", ".nc")
FAR = 100.0  # m between cameras, from which on lengths are taken for millimetres
_MODELS = {"", "plumb_bob", "opencv", "pinhole", "brown", "radtan"}  # all the same one
_OTHERS = {8: "rational", 12: "thin prism", 14: "tilted"}  # by their number of coefficients


@dataclass(frozen=True)
class Found:
    """Cameras of a file."""

    cameras: list[Camera]  #: In one frame, m
    placed: bool  #: Whether the file says where they are
    #: Of their poses, then lenses, see :func:`~thesis_lib.measure.calibration.jackknife.jackknife`
    covariance: Array | None = None


def read_cameras(path: Path, unit: str | None = None) -> Found:
    """Cameras of a calibration in a file or folder.

    Parameters
    ----------
    path : Path
        A file; the folder of a measurement; or one that has a file for each camera.
    unit : str, optional
        "m" or "mm", of the file's lengths; else what the file says, or m.

    Raises
    ------
    ManifestError
        If it cannot be read, or has cameras that cannot be used, in one line.
    """
    if path.is_dir():
        if (path / OWN).is_file():
            return read_cameras(path / OWN)
        files = sorted(one for one in path.iterdir() if one.suffix.lower() in ENDINGS[:3])
    else:
        files = [path]
    if not files or not all(map(Path.is_file, files)):
        raise ManifestError(f"{path}: no calibration there, allowed: {', '.join(ENDINGS)}")
    if files[0].suffix.lower() == ".nc":
        return _own(files[0])
    cameras, placed = [], []
    for file in files:
        values = _values(file)
        said = values.get("metadata")
        scale = unit or (said.get("units") if isinstance(said, Mapping) else None) or "m"
        if scale not in ("m", "mm"):
            raise ManifestError(f"{file}: lengths in {shown(scale)}, allowed: m or mm")
        for name, entry in _entries(values, file.stem):
            try:
                camera, at = _camera(entry, name, 1e-3 if scale == "mm" else 1.0)
            except (KeyError, TypeError, ValueError) as error:
                why = f"no {error.args[0]}" if isinstance(error, KeyError) else error
                raise ManifestError(f"{file}: camera {name}: {why}") from None
            cameras.append(camera)
            placed.append(at)
    if not cameras:
        raise ManifestError(f"{path}: no camera in it, allowed: those with a camera_matrix")
    centres = np.array([one.centre for one in cameras])
    apart = float(np.linalg.norm(np.ptp(centres, axis=0)))
    if apart > FAR:
        raise ManifestError(
            f"{path}: cameras {apart:.4g} m apart, allowed: {FAR:g} m; if its lengths are in mm, "
            "give calibration.unit: mm"
        )
    return Found(cameras, all(placed))


def _own(path: Path) -> Found:
    try:
        data = storage.opened(path)
        covariance = np.asarray(data["covariance"].values, float)
        known = bool(np.isfinite(covariance).all())
        return Found(cameras_in(data), True, covariance if known else None)
    except (storage.CubeError, KeyError):
        raise ManifestError(f"{path}: no calibration, allowed: one that was measured") from None


def _values(path: Path) -> dict[str, Any]:
    """What a text file holds, by names."""
    try:
        text = read_text(path)
        values = parse_toml(text) if path.suffix.lower() == ".toml" else parse_yaml(text)
    except (OSError, TextFileError) as error:
        why = error if isinstance(error, TextFileError) else error.strerror
        raise ManifestError(
            f"{path}: not a calibration that can be read ({why}), allowed: YAML of OpenCV, TOML of "
            "aniposelib or caliscope, calibration.nc"
        ) from None
    return values if isinstance(values, dict) else {}


def _entries(values: Mapping[str, Any], stem: str) -> Iterator[tuple[str, dict[str, Any]]]:
    """Names and values of each camera, whether a file has one, or several one below the other."""
    own = {str(key).lower(): value for key, value in values.items()}
    if "camera_matrix" in own or "matrix" in own:
        name = next(
            (own[key] for key in ("name", "camera_name", "cam_id", "port") if key in own), stem
        )
        yield str(name), own
        return
    for key, value in values.items():
        if isinstance(value, Mapping):
            yield from _entries(value, str(key))


def _camera(entry: Mapping[str, Any], name: str, scale: float) -> tuple[Camera, bool]:
    """One camera with lengths times a scale, and whether its place is known."""

    def of(*names: str) -> Any:
        return next((entry[one] for one in names if entry.get(one) is not None), None)

    K = _numbers(of("camera_matrix", "matrix"), "camera_matrix", (9,)).reshape(3, 3)
    if K[0, 0] < 0 or K[1, 1] < 0:
        raise ValueError("mirrored axes (a negative focal length), allowed: x right, y down")
    if not (K[0, 0] and K[1, 1] and np.allclose(K[2], [0, 0, 1]) and abs(K[1, 0]) < 1e-9):
        raise ValueError(f"camera_matrix: given {shown(K.tolist())}, allowed: an intrinsic matrix")
    K[:2, 2] += HALF
    size = of("size") or [of("image_width"), of("image_height")]
    width, height = (int(side) for side in _numbers(size, "image_width and image_height", (2,)))
    turn, move = of("rvec", "rotation", "r"), of("tvec", "translation", "t")
    R, t = np.eye(3), np.zeros(3)
    if turn is not None and move is not None:
        R = _rotation(_numbers(turn, "rotation", (3, 9)))
        t = scale * _numbers(move, "translation", (3,))
    camera = Camera(name, K, _distortion(entry, of), R, -R.T @ t, (width, height))
    return camera, turn is not None and move is not None


def _rotation(given: Array) -> Array:
    """Rotation matrix of nine or three numbers."""
    R = given.reshape(3, 3) if given.size == 9 else np.asarray(cv2.Rodrigues(given)[0], float)
    if not np.allclose(R @ R.T, np.eye(3), atol=1e-4):
        raise ValueError("rotation: no rotation matrix, allowed: nine or three numbers of one")
    if np.linalg.det(R) < 0:
        raise ValueError("mirrored axes (a rotation of determinant -1), allowed: x right, y down")
    return R


def _distortion(entry: Mapping[str, Any], of: Any) -> Array:
    """Coefficients k₁, k₂, p₁, p₂, k₃, or a refusal of another model by its name."""
    allowed = "allowed: k1, k2, p1, p2, k3 (Brown)"
    model = str(of("distortion_model", "camera_model", "model") or "").lower()
    if of("fisheye", "fisheye_model"):
        model = "fisheye"
    given = of("distortion_coefficients", "distortions", "dist_coeffs")
    values = np.zeros(5) if given is None else _numbers(given, "distortion_coefficients", ())
    count, extra = values.size, bool(values[5:].any())
    if model not in _MODELS and (model != "rational_polynomial" or extra):
        raise ValueError(f"distortion model {shown(model)}, {allowed}")
    if extra or count not in (0, 4, 5, *_OTHERS):
        named = f" ({_OTHERS[count]} model)" if count in _OTHERS else ""
        raise ValueError(f"{count} coefficients of distortion{named}, {allowed}")
    return np.concatenate([values, np.zeros(5)])[:5]


def _numbers(given: Any, name: str, counts: tuple[int, ...]) -> Array:
    """Finite numbers in a row, of a matrix in OpenCV's form or of lists."""
    if given is None or (isinstance(given, list) and None in given):
        raise KeyError(name)
    inner = given.get("data") if isinstance(given, Mapping) else given
    try:
        values = np.ravel(np.asarray(inner, float))
    except (TypeError, ValueError):
        values = np.array([np.nan])
    if not np.isfinite(values).all() or (counts and values.size not in counts):
        raise ValueError(f"{name}: given {shown(inner)}, allowed: finite numbers")
    return values
