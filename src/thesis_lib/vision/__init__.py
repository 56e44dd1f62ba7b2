"""Camera models, pixels, triangulation, and the accuracy of triangulated points.

Start with cameras (:func:`.hemisphere_cameras`, or real ones: :class:`.Camera`), their images
(:func:`~.pinhole.project`, :func:`.pixelate`), points from images (:func:`.triangulate`, or
:func:`.interval_estimate` for rounded ones), deflections from whole pixels
(:func:`.measure_deflections`), and the law of rounding (:func:`~.rounding.deflection_variance`,
:func:`.deflection_covariance`).
"""

from thesis_lib.vision.interval import estimate_noise, interval_estimate
from thesis_lib.vision.pinhole import (
    Camera,
    CameraArray,
    ground_sample_distance,
    hemisphere_cameras,
    intrinsics,
    on_sensor,
    pixelate,
    project,
    project_points,
    undistort_pixels,
)
from thesis_lib.vision.rounding import deflection_covariance, deflection_variance, grid_shifts
from thesis_lib.vision.simulation import measure_deflections, percent_errors
from thesis_lib.vision.triangulation import point_covariance, triangulate, triangulation_gain

__all__ = ["Camera", "CameraArray", "deflection_covariance", "deflection_variance",
           "estimate_noise", "grid_shifts", "ground_sample_distance", "hemisphere_cameras",
           "interval_estimate", "intrinsics", "measure_deflections", "on_sensor", "percent_errors",
           "pixelate", "point_covariance", "project", "project_points", "triangulate",
           "triangulation_gain", "undistort_pixels"]  # fmt: skip
