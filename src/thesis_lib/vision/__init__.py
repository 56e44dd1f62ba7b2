"""Cameras, lenses, pixels; points from images, and how exact they are.

To start from: cameras (:func:`.hemisphere_cameras`), what they see (:func:`~.pinhole.project`,
:func:`.pixelate`), points from their images (:func:`.triangulate`), and the law of rounding
(:func:`~.rounding.deflection_variance`, :func:`.deflection_covariance`).
"""

from thesis_lib.vision.pinhole import (
    CameraArray,
    ground_sample_distance,
    hemisphere_cameras,
    intrinsics,
    on_sensor,
    pixelate,
    project,
)
from thesis_lib.vision.rounding import deflection_covariance, deflection_variance, grid_shifts
from thesis_lib.vision.triangulation import point_covariance, triangulate, triangulation_gain

__all__ = [
    "CameraArray",
    "deflection_covariance",
    "deflection_variance",
    "grid_shifts",
    "ground_sample_distance",
    "hemisphere_cameras",
    "intrinsics",
    "on_sensor",
    "pixelate",
    "point_covariance",
    "project",
    "triangulate",
    "triangulation_gain",
]  # fmt: skip
