"""Real cameras: each with its own intrinsics and lens distortion (Brown–Conrady).

Pixels are counted as in the rest of the library: from the sensor's top-left corner, so the centre
of the first pixel is at (0.5, 0.5). OpenCV counts from that centre; :data:`HALF_PIXEL` converts,
and nothing but the modules that call OpenCV needs it. Counted from the corner, K scales with the
resolution and nothing else.

Distortion acts on normalised coordinates (x, y) = (X/Z, Y/Z) with r² = x² + y²:

    x' = x (1 + k₁r² + k₂r⁴ + k₃r⁶) + 2p₁xy + p₂(r² + 2x²)
    y' = y (1 + k₁r² + k₂r⁴ + k₃r⁶) + p₁(r² + 2y²) + 2p₂xy

(Brown 1966, in OpenCV's order k₁, k₂, p₁, p₂, k₃).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from thesis_lib.arrays import Array

HALF_PIXEL = 0.5  # a pixel's centre in our coordinates minus that in OpenCV's, px


@dataclass(frozen=True)
class Camera:
    """One camera with lens distortion."""

    name: str  #: Its name in manifests and figures
    K: Array  #: Intrinsic matrix in px, shape (3, 3)
    distortion: Array  #: Brown–Conrady coefficients k₁, k₂, p₁, p₂, k₃, shape (5,)
    R_camera_world: Array  #: Rotation from world to camera directions, shape (3, 3)
    centre: Array  #: Centre of projection in world coordinates, m, shape (3,)
    size: tuple[int, int]  #: Width and height of the sensor in px

    @property
    def t(self) -> Array:
        """Return the translation −R C of the extrinsic matrix [R | t], shape (3,), m."""
        translation: Array = -self.R_camera_world @ self.centre
        return translation

    @property
    def P(self) -> Array:
        """Return the projection matrix K [R | t] of the undistorted camera, shape (3, 4)."""
        return self.K @ np.column_stack([self.R_camera_world, self.t])


def distort_coordinates(xy: ArrayLike, distortion: ArrayLike) -> Array:
    """Return the distorted normalised coordinates of undistorted ones, both (2, ...)."""
    x, y = np.asarray(xy, float)
    k1, k2, p1, p2, k3 = np.asarray(distortion, float)
    r2 = x * x + y * y
    radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
    return np.stack(
        [
            x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
            y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y,
        ]
    )


def distortion_jacobian(xy: ArrayLike, distortion: ArrayLike) -> Array:
    """Return the derivative of :func:`distort_coordinates`, (2, 2, ...): [i, j] = ∂x'ᵢ/∂xⱼ."""
    x, y = np.asarray(xy, float)
    k1, k2, p1, p2, k3 = np.asarray(distortion, float)
    r2 = x * x + y * y
    radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
    slope = 2 * (k1 + r2 * (2 * k2 + 3 * r2 * k3))  # ∂radial/∂x over x
    mixed = x * y * slope + 2 * (p1 * x + p2 * y)
    xx = radial + x * x * slope + 2 * p1 * y + 6 * p2 * x
    yy = radial + y * y * slope + 6 * p1 * y + 2 * p2 * x
    return np.stack([np.stack([xx, mixed]), np.stack([mixed, yy])])


def undistort_coordinates(xy: ArrayLike, distortion: ArrayLike, steps: int = 6) -> Array:
    """Undistort normalised coordinates by Newton's method, both (2, ...).

    Six steps reach rounding error for distortions that a lens for measuring has; a point beyond
    the fold of the polynomial, which has no undistorted counterpart, ends as NaN.
    """
    target = np.asarray(xy, float)
    guess = target.copy()
    if not np.any(distortion):
        return guess
    with np.errstate(all="ignore"):
        for _ in range(steps):
            (a, b), (c, d) = distortion_jacobian(guess, distortion)
            ex, ey = target - distort_coordinates(guess, distortion)
            determinant = a * d - b * c
            guess += np.stack([d * ex - b * ey, a * ey - c * ex]) / determinant
        (a, b), (c, d) = distortion_jacobian(guess, distortion)
        missed = np.abs(target - distort_coordinates(guess, distortion)).max(axis=0)
        r2 = np.sum(guess**2, axis=0)
        k1, k2, _, _, k3 = np.asarray(distortion, float)
        upright = 1 + r2 * (k1 + r2 * (k2 + r2 * k3)) > 0  # else the image is on the other side
        reached = (missed < 1e-9) & (a * d - b * c > 0) & upright
    return np.where(reached, guess, np.nan)


def to_pixels(K: ArrayLike, xy: ArrayLike) -> Array:
    """Return the pixels of normalised coordinates, both (2, ...)."""
    K, (x, y) = np.asarray(K, float), np.asarray(xy, float)
    return np.stack([K[0, 0] * x + K[0, 1] * y + K[0, 2], K[1, 1] * y + K[1, 2]])


def from_pixels(K: ArrayLike, uv: ArrayLike) -> Array:
    """Return the normalised coordinates of pixels, both (2, ...)."""
    K, (u, v) = np.asarray(K, float), np.asarray(uv, float)
    y = (v - K[1, 2]) / K[1, 1]
    return np.stack([(u - K[0, 2] - K[0, 1] * y) / K[0, 0], y])


def project_points(camera: Camera, points: ArrayLike) -> Array:
    """Project world points (3, ...) in m, (2, ...) px; NaN for points behind the camera."""
    X = np.asarray(points, float)
    x, y, z = np.tensordot(camera.R_camera_world, X, axes=1) + camera.t.reshape(
        (3,) + (1,) * (X.ndim - 1)
    )
    z = np.where(z > 0, z, np.nan)
    return to_pixels(camera.K, distort_coordinates(np.stack([x / z, y / z]), camera.distortion))


def undistort_pixels(camera: Camera, uv: ArrayLike) -> Array:
    """Return the pixels (2, ...) that a camera without distortion would see: those of P, K."""
    return to_pixels(camera.K, undistort_coordinates(from_pixels(camera.K, uv), camera.distortion))


def undistort_tracks(camera: Camera, tracks: ArrayLike) -> Array:
    """Remove the distortion of tracks: pixels (frames, 2, markers)."""
    return undistort_pixels(camera, np.asarray(tracks, float).swapaxes(0, 1)).swapaxes(0, 1)


def distort_pixels(camera: Camera, uv: ArrayLike) -> Array:
    """Return the pixels that the camera sees of those without distortion, (2, ...)."""
    return to_pixels(camera.K, distort_coordinates(from_pixels(camera.K, uv), camera.distortion))


def resize_camera(camera: Camera, size: tuple[int, int]) -> Camera:
    """Return the camera after its images are resampled to another size (section 5.2.1)."""
    scale = np.array([size[0] / camera.size[0], size[1] / camera.size[1], 1.0])
    return replace(camera, K=scale[:, None] * camera.K, size=size)


def projection_matrices(cameras: Sequence[Camera]) -> Array:
    """Return the projection matrices of several cameras, shape (cameras, 3, 4)."""
    return np.array([camera.P for camera in cameras])
