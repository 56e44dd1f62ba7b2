"""The equations of a bundle adjustment: images, their derivatives, normal equations (App. E).

A point X of the board in shot s has in camera c the coordinates

    x = R_c (R_s X + t_s − C_c).

Small changes turn the camera by a about its own axes, R_c ← exp([a]×) R_c, the board by b about the
world's, R_s ← exp([b]×) R_s, and shift C_c and t_s. The unknowns are all cameras' poses, then all
boards', six each, rotation first (rad, m), then the lenses', eight each: f_x, f_y, c_x, c_y (px),
k₁, k₂, p₁, p₂.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from thesis_lib.arrays import Array, Mask
from thesis_lib.measure.calibration.zhang import CalibrationError
from thesis_lib.vision.lens import (
    Camera,
    distort_coordinates,
    distortion_jacobian,
    from_pixels,
    to_pixels,
    undistort_coordinates,
)

POSE_UNKNOWNS, LENS_UNKNOWNS = 6, 8  # unknowns of a pose and of a lens


@dataclass(frozen=True)
class Network:
    """Cameras and the boards they see."""

    cameras: tuple[Camera, ...]  #: The cameras
    rotations: Array  #: From each shot's board to the world, shape (shots, 3, 3)
    translations: Array  #: Each board's centre in the world, m, shape (shots, 3)

    @property
    def unknowns(self) -> int:
        """Return the number of unknowns, the lenses' included."""
        return (POSE_UNKNOWNS + LENS_UNKNOWNS) * len(self.cameras) + POSE_UNKNOWNS * len(
            self.rotations
        )


def start_network(
    observations: Array, seen: Mask, points: Array, cameras: Sequence[Camera]
) -> Network:
    """Return the poses chained from image to image, the world being the first shot's board.

    Raises
    ------
    CalibrationError
        If a camera has no shot, a shot no camera, or they are not all connected.
    """
    for camera, views in zip(cameras, seen, strict=True):
        if not views.any():
            raise CalibrationError(f"{camera.name}: no image shows the board")
    for shot in np.flatnonzero(~seen.any(axis=0)):
        raise CalibrationError(f"board image {shot}: no camera sees the board")
    boards: dict[int, tuple[Array, Array]] = {0: (np.eye(3), np.zeros(3))}
    placed: dict[int, Camera] = {}
    views = [(int(c), int(s)) for c, s in np.argwhere(seen)]
    while pending := [(c, s) for c, s in views if (c in placed) != (s in boards)]:
        c, s = pending[0]
        R, t = planar_pose(cameras[c], of_pictures(points, (c, s)), observations[c, s])
        if s in boards:
            Rs, ts = boards[s]
            rotation = R @ Rs.T
            placed[c] = replace(cameras[c], R_camera_world=rotation, centre=ts - rotation.T @ t)
        else:
            turn = placed[c].R_camera_world.T
            boards[s] = turn @ R, turn @ t + placed[c].centre
    for c, camera in enumerate(cameras):
        if c not in placed:
            raise CalibrationError(
                f"{camera.name}: shares no board images, directly or not, with image 0"
            )
    shots = [boards[s] for s in range(seen.shape[1])]
    return Network(
        tuple(placed[c] for c in range(len(cameras))),
        np.array([R for R, _ in shots]),
        np.array([t for _, t in shots]),
    )


def of_pictures(points: Array, which: Any) -> Array:
    """Return the points (3, n) of all images, or of (cameras, shots, 3, n) those of some images."""
    return points if points.ndim == 2 else points[which]


def planar_pose(camera: Camera, points: Array, uv: Array) -> tuple[Array, Array]:
    """Return the rotation and translation from a board to a camera that sees points of one z of it.

    Points whose place `uv` is NaN do not count.
    """
    seen = np.isfinite(uv).all(axis=0)
    xy = undistort_coordinates(from_pixels(camera.K, uv[:, seen]), camera.distortion)
    flat = points[:, seen] * np.array([[1.0], [1.0], [0.0]])
    _, turn, t = cv2.solvePnP(flat.T.copy(), xy.T.copy(), np.eye(3), np.zeros(4))
    R, t = np.asarray(cv2.Rodrigues(turn)[0], float), np.ravel(np.asarray(t, float))
    return R, t - R[:, 2] * points[2, 0]


def board_images(network: Network, camera: Camera, points: Array) -> tuple[Array, Array]:
    """Return the images of the boards' points in a camera and their derivatives.

    Parameters
    ----------
    network : Network
        Where the boards are.
    camera : Camera
        The camera.
    points : ndarray, shape (3, points) or (shots, 3, points)
        In the boards' frame, m.

    Returns
    -------
    uv : ndarray, shape (2, shots, points)
        Images in px; NaN behind the camera.
    J : ndarray, shape (20, 2, shots, points)
        Derivatives in the camera's pose (6), the board's pose (6) and the lens (8).
    """
    which = "sij,jn->isn" if points.ndim == 2 else "sij,sjn->isn"
    on_board = np.einsum(which, network.rotations, points)
    from_centre = on_board + (network.translations - camera.centre).T[:, :, None]
    R = camera.R_camera_world
    x, y, z = np.tensordot(R, from_centre, axes=1)
    z = np.where(z > 0, z, np.nan)
    p, q = xy = np.stack([x / z, y / z])
    distorted = distort_coordinates(xy, camera.distortion)
    scale = camera.K[:2, :2]  # px per distorted coordinate
    in_xy = np.einsum("ij,jk...->ik...", scale, distortion_jacobian(xy, camera.distortion))
    in_xyz = np.stack([*in_xy.swapaxes(0, 1), -in_xy[:, 0] * p - in_xy[:, 1] * q]) / z
    in_world = np.tensordot(R.T, in_xyz, axes=1)
    r2 = p * p + q * q
    zero, one = np.zeros_like(p), np.ones_like(p)
    lens = np.array(
        [
            [r2 * p, r2 * q],
            [r2**2 * p, r2**2 * q],
            [2 * p * q, r2 + 2 * q * q],
            [r2 + 2 * p * p, 2 * p * q],
        ]
    )
    J = np.concatenate(
        [
            _cross(np.stack([x, y, z])[:, None], in_xyz),
            -in_world,
            _cross(on_board[:, None], in_world),
            in_world,
            [[distorted[0], zero], [zero, distorted[1]], [one, zero], [zero, one]],
            np.einsum("ij,kj...->ki...", scale, lens),
        ]
    )
    return to_pixels(camera.K, distorted), J


def _cross(a: Array, b: Array) -> Array:
    """Return the product a × b: the derivative in a rotation of a if b is the one in a."""
    return np.stack(
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    )


def normal_equations(
    observations: Array, seen: Mask, points: Array, network: Network
) -> tuple[Array, Array, Array]:
    """Return JᵀJ and Jᵀr of all unknowns, and the residuals r, as seen minus computed.

    Points that an image does not show are NaN in the observations and count for nothing. Each
    image touches the twenty unknowns of its camera and its board only; the matrix is gathered
    from such blocks.

    Returns
    -------
    normal : ndarray, shape (unknowns, unknowns)
    right : ndarray, shape (unknowns,)
    residuals : ndarray, shape (cameras, shots, 2, points)
        In px; NaN where absent.
    """
    n, m = seen.shape
    normal = np.zeros((network.unknowns, network.unknowns))
    right = np.zeros(network.unknowns)
    residuals = np.full(observations.shape, np.nan)
    for c, camera in enumerate(network.cameras):
        uv, J = board_images(network, camera, of_pictures(points, c))
        residuals[c] = observations[c] - uv.swapaxes(0, 1)
        shots = np.flatnonzero(seen[c])
        missing = np.isnan(observations[c][shots])
        A = np.where(missing[:, None], 0, J[:, :, shots].transpose(2, 0, 1, 3))
        A = A.reshape(len(shots), POSE_UNKNOWNS * 2 + LENS_UNKNOWNS, -1)
        r = np.where(missing, 0, residuals[c][shots]).reshape(len(shots), -1, 1)
        index = np.empty((len(shots), A.shape[1]), int)
        index[:, :POSE_UNKNOWNS] = c * POSE_UNKNOWNS + np.arange(POSE_UNKNOWNS)
        index[:, POSE_UNKNOWNS : 2 * POSE_UNKNOWNS] = (
            n + shots[:, None]
        ) * POSE_UNKNOWNS + np.arange(POSE_UNKNOWNS)
        index[:, 2 * POSE_UNKNOWNS :] = (
            (n + m) * POSE_UNKNOWNS + c * LENS_UNKNOWNS + np.arange(LENS_UNKNOWNS)
        )
        np.add.at(normal, (index[:, :, None], index[:, None]), A @ A.swapaxes(1, 2))
        np.add.at(right, index, (A @ r)[..., 0])
    return normal, right, residuals


def gauge_directions(network: Network) -> Array:
    """Return the change of the unknowns when the world turns and shifts, shape (unknowns, 6)."""
    boards = range(len(network.rotations))
    poses = [(-c.R_camera_world, c.centre) for c in network.cameras]  # a camera turns the other way
    poses += [(np.eye(3), network.translations[s]) for s in boards]
    G = np.zeros((network.unknowns, POSE_UNKNOWNS))
    for k, (turn, place) in enumerate(poses):
        rows = G[k * POSE_UNKNOWNS : (k + 1) * POSE_UNKNOWNS]
        rows[:3, :3] = turn
        rows[3:, :3] = -np.cross(place, np.eye(3)).T  # w × place
        rows[3:, 3:] = np.eye(3)
    return G


def step_network(network: Network, step: Array) -> Network:
    """Return the network after changes of its unknowns."""
    n, m = len(network.cameras), len(network.rotations)
    poses = step[: (n + m) * POSE_UNKNOWNS].reshape(-1, 2, 3)
    turns = Rotation.from_rotvec(poses[:, 0]).as_matrix()
    lenses = step[(n + m) * POSE_UNKNOWNS :].reshape(n, LENS_UNKNOWNS)
    cameras = []
    for camera, turn, shift, d in zip(network.cameras, turns, poses[:, 1], lenses, strict=False):
        cameras.append(
            replace(
                camera,
                K=camera.K + np.array([[d[0], 0, d[2]], [0, d[1], d[3]], [0, 0, 0]]),
                distortion=camera.distortion + np.array([*d[4:], 0]),
                R_camera_world=turn @ camera.R_camera_world,
                centre=camera.centre + shift,
            )
        )
    return Network(
        tuple(cameras), turns[n:] @ network.rotations, network.translations + poses[n:, 1]
    )


def transform_network(network: Network, rotation: Array, translation: Array) -> Network:
    """Return the network in another frame, X' = rotation X + translation."""
    cameras = tuple(
        replace(
            camera,
            R_camera_world=camera.R_camera_world @ rotation.T,
            centre=rotation @ camera.centre + translation,
        )
        for camera in network.cameras
    )
    places = network.translations @ rotation.T + translation
    return Network(cameras, rotation @ network.rotations, places)


def to_board(network: Network, shot: int) -> tuple[Array, Array]:
    """Return the rotation and translation from the world to the frame of a shot's board."""
    R, t = network.rotations[shot], network.translations[shot]
    return R.T, -R.T @ t
