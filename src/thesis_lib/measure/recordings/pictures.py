"""Pictures as files, gray: PNG, JPEG and what else OpenCV reads, and HEIC."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from thesis_lib.arrays import Image
from thesis_lib.files import whole_file
from thesis_lib.measure.recordings.media_info import MediaError, depth_for


def write_png(path: Path, image: Image) -> None:
    """Write a gray picture, uint8 of shape (height, width), whole or not at all.

    Raises
    ------
    MediaError
        If the picture is of another kind.
    """
    if image.dtype != np.uint8 or image.ndim != 2 or not image.size:
        raise MediaError(f"{path}: {image.dtype} of shape {image.shape}, allowed: gray uint8")
    _, data = cv2.imencode(".png", image)
    whole_file(path, lambda part: part.write_bytes(data.tobytes()))


def read_png(path: Path, depth: int | None = None) -> Image:
    """Read a picture as gray, uint8 of shape (height, width).

    Parameters
    ----------
    path : Path
        The file.
    depth : int, optional
        Bits that hold the grey levels of a picture of 16; else as many as its brightest pixel has.

    Raises
    ------
    MediaError
        If there is no such file, it is not a picture, or cut off.
    """
    levels = _levels(path)
    if levels.dtype == np.uint8:
        return np.asarray(levels, np.uint8)
    used = depth_for(int(levels.max())) if depth is None else depth
    return np.asarray(np.minimum(levels >> (used - 8), 255), np.uint8)


def depth_of(path: Path) -> int:
    """Return how many bits hold the grey levels of a picture: 8, or of 16 as many as are used.

    Raises
    ------
    MediaError
        As :func:`read_png`.
    """
    levels = _levels(path)
    return 8 if levels.dtype == np.uint8 else depth_for(int(levels.max()))


def _levels(path: Path) -> NDArray[np.uint8] | NDArray[np.uint16]:
    """Grey levels of a picture, of eight bits or of sixteen."""
    if not path.is_file():
        raise MediaError(f"{path}: {'a folder, not a file' if path.is_dir() else 'no such file'}")
    data = path.read_bytes()
    png = data.startswith(b"\x89PNG")
    whole = not png or b"IEND" in data[-12:]  # OpenCV fills what is cut off
    if data[4:8] == b"ftyp":
        return _read_heic(path)
    code, flags = np.frombuffer(data, np.uint8), cv2.IMREAD_GRAYSCALE
    image = cv2.imdecode(code, flags | cv2.IMREAD_ANYDEPTH) if data else None
    if image is not None and image.dtype not in (np.uint8, np.uint16):  # numbers with a point
        image = cv2.imdecode(code, flags)
    if image is None or not whole:
        raise MediaError(f"{path}: not a readable picture, or cut off")
    return image.astype(np.uint16) if image.dtype == np.uint16 else image.astype(np.uint8)


def _read_heic(path: Path) -> Image:
    """A picture as telephones store it, turned as it is to be shown."""
    try:
        import pillow_heif
    except ImportError:
        raise MediaError(
            f"{path}: HEIC needs pillow-heif: pip install thesis-lib[heic], or save JPEG"
        ) from None
    try:
        picture = np.asarray(pillow_heif.open_heif(path, convert_hdr_to_8bit=True))
    except (ValueError, OSError, EOFError, SyntaxError):
        raise MediaError(f"{path}: not a readable picture, or cut off") from None
    to_grey = {3: cv2.COLOR_RGB2GRAY, 4: cv2.COLOR_RGBA2GRAY}
    if picture.ndim == 3:
        picture = cv2.cvtColor(picture, to_grey[picture.shape[2]])
    return np.ascontiguousarray(picture, np.uint8)
