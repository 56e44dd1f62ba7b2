"""Cameras: pinholes on a hemisphere (thesis 2 and 3.2), and real ones with lens distortion.

World frame: origin at the structure's centre, X along the length, Y across, Z normal. Camera
frame: x right, y down, z forward. Image frame: u right, v down, in pixels from the top-left
corner of the sensor. ``R_camera_world`` turns world directions into camera directions. Arrays put
cameras and coordinates first and points last: world points are ``(3, ...)``, images
``(cameras, 2, ...)``.

Each real camera has its own intrinsics and distortion (Brown–Conrady).
Pixels are counted as in the rest of the library: from the sensor's top-left corner, so the centre
of the first pixel is at (0.5, 0.5). OpenCV counts from that centre; :data:`HALF_PIXEL` converts,
and only the modules that call OpenCV need it. Counted from the corner, K simply scales with the
resolution.

Distortion acts on normalised coordinates (x, y) = (X/Z, Y/Z) with r² = x² + y²:

    x' = x (1 + k₁r² + k₂r⁴ + k₃r⁶) + 2p₁xy + p₂(r² + 2x²)
    y' = y (1 + k₁r² + k₂r⁴ + k₃r⁶) + p₁(r² + 2y²) + 2p₂xy

(Brown 1966, in OpenCV's order k₁, k₂, p₁, p₂, k₃).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from thesis_lib.arrays import Array, ArrayLike, Mask


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
    """Return equal cameras at one or several distances from the origin, all looking at it.

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
    homogeneous = P[:, :, :3] @ X.reshape(3, -1) + P[:, :, 3:]
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
        return -self.R_camera_world @ self.centre

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

    Six steps reach round-off for the distortions of measuring lenses; a point beyond the fold of
    the polynomial, which has no undistorted counterpart, becomes NaN.
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
    t = camera.t.reshape((3,) + (1,) * (X.ndim - 1))
    x, y, z = np.tensordot(camera.R_camera_world, X, axes=1) + t
    z = np.where(z > 0, z, np.nan)
    return to_pixels(camera.K, distort_coordinates(np.stack([x / z, y / z]), camera.distortion))


def undistort_pixels(camera: Camera, uv: ArrayLike) -> Array:
    """Return the pixels (2, ...) without distortion, for which P and K hold."""
    return to_pixels(camera.K, undistort_coordinates(from_pixels(camera.K, uv), camera.distortion))


_BLOCK_FRAMES = 512  # frames of tracks that are undistorted at once


def undistort_tracks(camera: Camera, tracks: ArrayLike) -> Array:
    """Remove the distortion of tracks: pixels (frames, 2, markers).

    Frames are processed in blocks, as each step needs a dozen arrays of the size of its input.
    """
    images = np.asarray(tracks, float).swapaxes(0, 1)
    found = np.empty(images.shape)
    for start in range(0, images.shape[1], _BLOCK_FRAMES):
        part = slice(start, start + _BLOCK_FRAMES)
        found[:, part] = undistort_pixels(camera, images[:, part])
    return found.swapaxes(0, 1)


def distort_pixels(camera: Camera, uv: ArrayLike) -> Array:
    """Return the distorted pixels of undistorted ones, both (2, ...)."""
    return to_pixels(camera.K, distort_coordinates(from_pixels(camera.K, uv), camera.distortion))


def resize_camera(camera: Camera, size: tuple[int, int]) -> Camera:
    """Return the camera after its images are resampled to another size (section 5.2.1)."""
    scale = np.array([size[0] / camera.size[0], size[1] / camera.size[1], 1.0])
    return replace(camera, K=scale[:, None] * camera.K, size=size)


def projection_matrices(cameras: Sequence[Camera]) -> Array:
    """Return the projection matrices of several cameras, shape (cameras, 3, 4)."""
    return np.array([camera.P for camera in cameras])
