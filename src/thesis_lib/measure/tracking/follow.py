"""How a video's markers are followed: from its first frame on, in full or at several widths.

A marker detector is a function from a camera's view, the vibration's angle from frame to frame and
the first frame to a :class:`Detector`, and a line in :data:`DETECTORS`, by the name that
``structure.markers.detector`` of a manifest gives.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Protocol

import cv2
import numpy as np

from thesis_lib.arrays import Array, Image
from thesis_lib.measure.recordings.board import Markers
from thesis_lib.measure.tracking.evening import even_light
from thesis_lib.measure.tracking.homography import (
    TrackingError,
    View,
    find_view,
    view_of,
)
from thesis_lib.measure.tracking.tabulated import Follower
from thesis_lib.measure.tracking.tracker import Tracker, sharpen_view
from thesis_lib.vision.lens import Camera, resize_camera, undistort_pixels


class Detector(Protocol):
    """Finds the markers of one camera, frame after frame.

    A measurement that was stopped goes on from `moved` and `before`, displacements in px in the
    last frame and in the one before it.
    """

    moved: Array
    before: Array

    def centres(self, image: Image) -> Array:
        """Return the markers' centres in px, (2, markers), NaN where missing; frames in order."""


DETECTORS: dict[str, Callable[[View, float, Image], Detector]] = {
    "disc": lambda view, turn, image: Follower(Tracker(view, turn), image),
}
"""Marker detectors by name."""


def trackers_of(
    image: Image,
    camera: Camera,
    markers: Markers,
    corners_px: Sequence[tuple[float, float]] | None,
    turn: float,
    shares: Sequence[float] = (),
) -> tuple[list[Detector], list[str]]:
    """Return the trackers of a video's markers, from its first frame.

    Parameters
    ----------
    image : ndarray, shape (height, width)
        The frame, with dark markers.
    camera : Camera
        Its intrinsics and distortion at full size.
    markers : Markers
        What is printed on the structure.
    corners_px : sequence of tuple, optional
        The structure's corners in the image, lens distortion included, in the order of
        :func:`~thesis_lib.measure.tracking.homography.view_of`.
    turn : float
        Angle of the vibration from frame to frame in rad; 0 if it is not known.
    shares : sequence of float
        Of the frames' width, to which they are reduced. At each the markers are looked for again,
        but the corners are those of the full frames. Without any the full frames serve.

    Returns
    -------
    trackers : list of Detector
        A tracker for each share; without any the detector of the markers, in the full frames.
    notes : list of str
        At which width the markers are not found as they should be, and why.

    Raises
    ------
    TrackingError
        If the structure or its markers are not found in the full frame.
    """
    view, notes = first_view(image, camera, markers, corners_px), []
    if not shares:
        return [DETECTORS[markers.detector](view, turn, image)], []
    trackers: list[Detector] = []
    for picture in pictures_of(image, shares):
        own = _resize(view, picture.shape[1], picture.shape[0])
        try:
            own = sharpen_view(picture, own)
        except TrackingError as error:
            notes.append(f"{picture.shape[1]} px: {error}")
        trackers.append(Tracker(own, turn))
    return trackers, notes


def pictures_of(image: Image, shares: Sequence[float]) -> list[Image]:
    """Return a frame as each tracker takes it: reduced to shares of its width, or as it is."""
    return [reduce_frame(image, round(share * image.shape[1])) for share in shares] or [image]


def reduce_frame(image: Image, width: int) -> Image:
    """Reduce a frame to a smaller width (section 5.2.1), by the mean over areas.

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
    """Estimate the camera's view of the structure in its first frame, from corners and markers.

    Raises
    ------
    TrackingError
        If either are not found.
    """
    if corners_px is None:
        return _find_view(image, camera, markers)
    corners = undistort_pixels(camera, np.array(corners_px, float).T)
    return sharpen_view(image, view_of(camera, markers, corners))


def _find_view(image: Image, camera: Camera, markers: Markers) -> View:
    """Return the view by corners found in the frame, as it is or with even light."""
    failures: list[TrackingError] = []
    for even in even_light(image):
        try:
            return sharpen_view(image, find_view(even, camera, markers))
        except TrackingError as error:
            failures.append(error)
        if markers.hole is None:  # nothing tells the ends apart in any light
            break
    raise failures[0]


def _resize(view: View, width: int, height: int) -> View:
    scale = width / view.camera.size[0]
    H = np.diag([scale, height / view.camera.size[1], 1.0]) @ view.H_image_plane
    camera = resize_camera(view.camera, (width, height))
    return replace(view, camera=camera, H_image_plane=H)
