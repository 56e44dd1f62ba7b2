"""Calibrated cameras as other programs read them: OpenCV's YAML, and the TOML of aniposelib.

Both put the world where the structure is at rest: origin at its centre, X along its length, Z along
its normal, in m. Both count pixels from the middle of the first one, half a pixel less than we do.
"""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import xarray as xr

from thesis_lib.arrays import Array
from thesis_lib.files import whole_text
from thesis_lib.vision.lens import HALF_PIXEL, Camera


def in_structure_axes(cameras: Sequence[Camera], data: xr.Dataset) -> list[Camera]:
    """Return the cameras of the calibration's frame in that of the structure.

    `data` is what :func:`~thesis_lib.measure.fitting.result.shape_result` returns.
    """
    R, origin = data["frame_rotation"].values, data["frame_origin"].values
    return [
        replace(one, R_camera_world=one.R_camera_world @ R.T, centre=R @ (one.centre - origin))
        for one in cameras
    ]


def _opencv(camera: Camera) -> tuple[Array, Array, Array, Array]:
    """Return intrinsic matrix, k₁, k₂, p₁, p₂, k₃, rotation vector and translation in m."""
    K = camera.K.copy()
    K[:2, 2] -= HALF_PIXEL
    rotation = cv2.Rodrigues(camera.R_camera_world)[0].ravel()
    return K, camera.distortion, np.asarray(rotation, float), camera.t


def write_opencv(path: Path, cameras: Sequence[Camera]) -> None:
    """Write cameras as YAML for ``cv2.FileStorage``.

    ``names`` lists them; the k-th has, under ``camera_k``, ``image_width``, ``image_height``,
    ``camera_matrix``, ``distortion_coefficients``, ``rvec``, ``tvec`` in m, as
    ``cv2.projectPoints`` takes them.
    """
    file = cv2.FileStorage(
        ".yaml", cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_MEMORY | cv2.FILE_STORAGE_FORMAT_YAML
    )
    # Names are put in afterwards, in quotes: plain ones such as null or yes would be no texts.
    file.write("names", [f"name_of_{k}" for k in range(len(cameras))])
    for k, camera in enumerate(cameras):
        K, distortion, rotation, translation = _opencv(camera)
        file.startWriteStruct(f"camera_{k}", cv2.FileNode_MAP)
        file.write("name", f"name_of_{k}")
        file.write("image_width", camera.size[0])
        file.write("image_height", camera.size[1])
        file.write("camera_matrix", K)
        file.write("distortion_coefficients", distortion[None])
        file.write("rvec", rotation[:, None])
        file.write("tvec", translation[:, None])
        file.endWriteStruct()
    names = [_toml(camera.name) for camera in cameras]
    text = re.sub(r'"?\bname_of_(\d+)\b"?', lambda k: names[int(k[1])], file.releaseAndGetString())
    whole_text(path, text)


def write_aniposelib(path: Path, cameras: Sequence[Camera]) -> None:
    """Write cameras as TOML for aniposelib, and for what reads its files, in m."""
    lines = []
    for k, camera in enumerate(cameras):
        K, distortion, rotation, translation = _opencv(camera)
        values = {
            "name": camera.name,
            "size": list(camera.size),
            "matrix": K.tolist(),
            "distortions": distortion.tolist(),
            "rotation": rotation.tolist(),
            "translation": translation.tolist(),
        }
        lines += [f"[cam_{k}]", *(f"{key} = {_toml(value)}" for key, value in values.items()), ""]
    whole_text(path, "\n".join([*lines, "[metadata]", 'units = "m"', ""]))


def _toml(value: object) -> str:
    """Write texts, numbers and lists in TOML, and texts in YAML, as in JSON."""
    return json.dumps(value, ensure_ascii=False, allow_nan=False)
