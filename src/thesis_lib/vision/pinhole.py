"""Pinhole cameras on a hemisphere: pose, projection, pixels (thesis 2 and 3.2).

World frame: origin at the structure's centre, X along the length, Y across, Z normal. Camera
frame: x right, y down, z forward. Image frame: u right, v down, in pixels from the top-left
corner of the sensor. ``R_camera_world`` turns world directions into camera directions. Arrays put
cameras and coordinates first and points last: world points are ``(3, ...)``, images
``(cameras, 2, ...)``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from thesis_lib.arrays import Array, Mask


@dataclass(frozen=True)
class CameraArray:
    """Several pinhole cameras."""

    K: Array  #: Intrinsic matrices in px, shape (cameras, 3, 3)
    R_camera_world: Array  #: Rotations from world to camera directions, shape (cameras, 3, 3)
    centres: Array  #: Centres of projection in world coordinates, m, shape (cameras, 3)
    size: tuple[int, int]  #: Width and height of the sensor in px

    @property
    def P(self) -> Array:
        """Return the projection matrices K [R | −R C], shape (cameras, 3, 4) (eq. 3.10)."""
        t = -np.einsum("nij,nj->ni", self.R_camera_world, self.centres)
        return self.K @ np.concatenate([self.R_camera_world, t[:, :, None]], axis=2)

    def __len__(self) -> int:
        return len(self.centres)


def intrinsics(
    focal_px: float, size: tuple[int, int], skew: float = 0.0, aspect: float = 1.0
) -> Array:
    """Return intrinsic matrix of eq. 3.12 with the principal point at (W/2, H/2), shape (3, 3), px.

    Parameters
    ----------
    focal_px : float
        Focal length over pixel width.
    size : tuple of int
        Width W and height H of the sensor in px.
    skew : float
        Skew γ; the matrix holds focal_px · γ.
    aspect : float
        Ratio r of vertical to horizontal scale.
    """
    width, height = size
    return np.array(
        [
            [focal_px, focal_px * skew, width / 2],
            [0.0, focal_px * aspect, height / 2],
            [0.0, 0.0, 1.0],
        ]
    )


def hemisphere_directions(azimuth: ArrayLike, elevation: ArrayLike) -> Array:
    """Return unit vectors (cosφ sinθ, cosφ cosθ, sinφ) from the origin, shape (..., 3).

    Azimuth θ counts from +Y towards +X, elevation φ from the XY plane, both in rad.
    """
    theta, phi = np.asarray(azimuth, float), np.asarray(elevation, float)
    return np.stack(
        [np.cos(phi) * np.sin(theta), np.cos(phi) * np.cos(theta), np.sin(phi)], axis=-1
    )


def hemisphere_rotations(azimuth: ArrayLike, elevation: ArrayLike) -> Array:
    """Return rotations from world to camera for optical axes through the origin, shape (..., 3, 3).

    The rows are x right = (−cosθ, sinθ, 0), parallel to the XY plane and defined at φ = 90° too,
    y down = z × x, and z forward, towards the origin.
    """
    theta, phi = np.broadcast_arrays(np.asarray(azimuth, float), np.asarray(elevation, float))
    x = np.stack([-np.cos(theta), np.sin(theta), np.zeros_like(theta)], axis=-1)
    z = -hemisphere_directions(theta, phi)
    return np.stack([x, np.cross(z, x), z], axis=-2)


def hemisphere_cameras(
    distance: ArrayLike,
    azimuth: ArrayLike,
    elevation: ArrayLike,
    focal_px: float,
    size: tuple[int, int],
) -> CameraArray:
    """Return the equal cameras at one or several distances from the origin, all looking at it.

    Parameters
    ----------
    distance : array_like, shape () or (cameras,)
        Distance of the centres of projection from the origin in m.
    azimuth, elevation : array_like, shape (cameras,)
        Angles in rad.
    focal_px : float
        Focal length in px.
    size : tuple of int
        Sensor width and height in px.
    """
    R = hemisphere_rotations(azimuth, elevation)
    K = np.broadcast_to(intrinsics(focal_px, size), R.shape)
    centres = np.asarray(distance, float)[..., None] * hemisphere_directions(azimuth, elevation)
    return CameraArray(K, R, centres, size)


def project(P: ArrayLike, points: ArrayLike) -> Array:
    """Return image coordinates of world points (eq. 3.9, 3.20).

    Parameters
    ----------
    P : array_like, shape (cameras, 3, 4)
        Projection matrices.
    points : array_like, shape (3, ...)
        World points in m.

    Returns
    -------
    ndarray, shape (cameras, 2, ...)
        u and v in px.
    """
    P, X = np.asarray(P, float), np.asarray(points, float)
    flat = X.reshape(3, -1)
    homogeneous = P[:, :, :3] @ flat + P[:, :, 3:]
    uv: Array = homogeneous[:, :2] / homogeneous[:, 2:]
    return uv.reshape((len(P), 2) + X.shape[1:])


def pixelate(uv: ArrayLike) -> Array:
    """Round image coordinates to whole pixels, halves to even.

    A coordinate within 1e-9 px of a half counts as that half, so that symmetric setups do not
    fall to one side or the other by the noise of floating-point arithmetic.
    """
    uv = np.asarray(uv, float)
    rounded: Array = np.asarray(np.rint(uv))
    near_half = np.abs(uv - rounded) > 0.5 - 1e-9
    rounded[near_half] = np.rint(np.rint(2 * uv[near_half]) / 2)
    return rounded


def on_sensor(uv: ArrayLike, size: tuple[int, int]) -> Mask:
    """Test whether images (cameras, 2, ...) lie on the sensor, shape (cameras, ...)."""
    uv = np.asarray(uv, float)
    width, height = size
    u, v = uv[:, 0], uv[:, 1]
    return (u >= 0) & (u <= width) & (v >= 0) & (v <= height)


def ground_sample_distance(cameras: CameraArray) -> float:
    """Return the length in m of one pixel across the axis at the origin, mean of cameras."""
    distance = np.linalg.norm(cameras.centres, axis=1)
    return float(np.mean(distance / cameras.K[:, 0, 0]))
