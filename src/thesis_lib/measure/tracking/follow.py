"""Markers followed through a video, frame by frame, at several widths at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from thesis_lib.arrays import Array, Image
from thesis_lib.measure.recordings import media
from thesis_lib.measure.recordings.markers import Markers
from thesis_lib.measure.tracking.homography import (
    TrackingError,
    View,
    as_dark,
    find_view,
    view_of,
)
from thesis_lib.measure.tracking.tracker import Tracker, sharpen
from thesis_lib.vision.lens import Camera, resized, undistorted


def follow(
    video: Path,
    camera: Camera,
    markers: Markers,
    widths: Sequence[int],
    corners_px: Sequence[tuple[float, float]] | None = None,
    turn: float = 0.0,
) -> tuple[Array, Array, list[str]]:
    """Centres of the markers in every frame of a video, reduced to several widths.

    The video is read once, frame by frame. At each width the markers are looked for anew, but the
    four corners are those of the full frames.

    Parameters
    ----------
    video : Path
        The video.
    camera : Camera
        Its intrinsics and distortion at full size.
    markers : Markers
        What is printed on the structure; bright ones are tracked in the negative.
    widths : sequence of int
        Widths in px; heights follow.
    corners_px : sequence of tuple, optional
        The beam's corners in the picture, lens distortion included, in the order of
        :func:`~thesis_lib.measure.tracking.homography.view_of`.
    turn : float
        Angle of the vibration from frame to frame in rad, as
        :class:`~thesis_lib.measure.tracking.tracker.Tracker` takes it.

    Returns
    -------
    centres : ndarray, shape (widths, frames, 2, markers)
        In px of each width, lens distortion included; NaN where missing.
    matched : ndarray, shape (widths, frames, 2, markers)
        The same as the template match alone has them, where Appendix F stops.
    notes : list of str
        What went wrong on the way.

    Raises
    ------
    MediaError
        If the video cannot be read.
    TrackingError
        If the beam is not found in the first frame.
    """
    trackers: list[Tracker] = []
    rows, matched, notes = [], [], []
    for picture in media.read_frames(video):
        image = as_dark(picture, markers)
        pictures = [reduced(image, width) for width in widths]
        if not trackers:
            try:
                view = first_view(image, camera, markers, corners_px)
            except TrackingError as error:
                raise TrackingError(f"{video}: frame 0: {error}") from None
            for picture in pictures:
                own = _resized(view, picture.shape[1], picture.shape[0])
                try:
                    own = sharpen(picture, own)
                except TrackingError as error:
                    notes.append(f"{picture.shape[1]} px: {error}")
                trackers.append(Tracker(own, turn))
        rows.append([t.centres(p) for t, p in zip(trackers, pictures, strict=True)])
        matched.append([t.matched for t in trackers])
    return np.array(rows).swapaxes(0, 1), np.array(matched).swapaxes(0, 1), notes


def reduced(image: Image, width: int) -> Image:
    """A frame at a smaller width (section 5.2.1), by the mean over areas.

    By a factor such as 3 : 2 that mean moves every other pixel by 0.06 px; the frame is then
    enlarged to twice its size first, by linear interpolation.
    """
    height = round(width * image.shape[0] / image.shape[1])
    factor = image.shape[1] / width
    if factor <= 1:
        return image
    if factor != int(factor):
        image = np.asarray(cv2.resize(image, None, fx=2, fy=2, interpolation=cv2.INTER_LINEAR))
    return np.asarray(cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA))


def first_view(
    image: Image,
    camera: Camera,
    markers: Markers,
    corners_px: Sequence[tuple[float, float]] | None,
) -> View:
    """How the camera sees the structure in its first frame, from its corners and its markers.

    Raises
    ------
    TrackingError
        If either are not found.
    """
    if corners_px is None:
        return sharpen(image, find_view(image, camera, markers))
    corners = undistorted(camera, np.array(corners_px, float).T)
    return sharpen(image, view_of(camera, markers, corners))


def _resized(view: View, width: int, height: int) -> View:
    scale = width / view.camera.size[0]
    H = np.diag([scale, height / view.camera.size[1], 1.0]) @ view.H_image_plane
    camera = resized(view.camera, (width, height))
    return replace(view, camera=camera, H_image_plane=H)
