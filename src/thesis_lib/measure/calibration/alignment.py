"""Frames for the result of a bundle adjustment: a board's, or that of known cameras.

Where the world lies is free, so errors and covariances mean something only with respect to a datum,
what is held fixed: all cameras, or one board. Baarda's S-transformation takes the covariances from
one to the other; the rigid motion of :func:`alignment` does the same for the errors.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from thesis_lib.arrays import Array
from thesis_lib.measure.calibration import reprojection
from thesis_lib.measure.calibration.bundle_adjustment import Adjustment
from thesis_lib.measure.calibration.reprojection import POSE, Network
from thesis_lib.vision.lens import Camera


def moved(adjustment: Adjustment, rotation: Array, translation: Array) -> Adjustment:
    """The adjustment in another frame, X' = rotation X + translation, covariance included."""
    network = reprojection.transformed(adjustment, rotation, translation)
    T = np.eye(len(adjustment.covariance))
    n = len(network.cameras)
    for k in range(n + len(network.rotations)):
        a, b, c = k * POSE, k * POSE + 3, (k + 1) * POSE
        T[b:c, b:c] = rotation
        if k >= n:  # a board turns about the world's axes, a camera about its own
            T[a:b, a:b] = rotation
    return replace(
        adjustment,
        cameras=network.cameras,
        rotations=network.rotations,
        translations=network.translations,
        covariance=T @ adjustment.covariance @ T.T,
    )


def alignment(cameras: Sequence[Camera], truth: Sequence[Camera]) -> tuple[Array, Array]:
    """Rigid motion, without change of scale, that brings cameras nearest to true ones.

    Kabsch's method on the centres and the axes together: the motion minimises the sum of
    |ΔC|² + ℓ²|Δω|², ℓ being the rms distance of the true centres from their mean and Δω the angle
    between orientations.

    Returns
    -------
    rotation : ndarray, shape (3, 3)
    translation : ndarray, shape (3,)
        From the cameras' world to the true ones', m.
    """
    A, B = (np.array([c.centre for c in group]) for group in (cameras, truth))
    a, b = A.mean(axis=0), B.mean(axis=0)
    axes = sum(q.R_camera_world.T @ p.R_camera_world for p, q in zip(cameras, truth, strict=True))
    U, _, Vt = np.linalg.svd((B - b).T @ (A - a) + _lever(truth) ** 2 / 2 * axes)
    rotation = U @ np.diag([1, 1, np.linalg.det(U @ Vt)]) @ Vt
    return rotation, b - rotation @ a


def align(
    cameras: Sequence[Camera], truth: Sequence[Camera]
) -> tuple[tuple[Camera, ...], Array, Array]:
    """Cameras in the frame of the true ones, and how far they are off (:func:`alignment`).

    Parameters
    ----------
    cameras, truth : sequence of Camera
        The same cameras as found and as they are.

    Returns
    -------
    cameras : tuple of Camera
        In the true cameras' frame.
    centres : ndarray, shape (cameras, 3)
        Errors of the centres of projection, m.
    rotations : ndarray, shape (cameras, 3)
        Errors of the orientations about the cameras' axes, rad.
    """
    rotation, translation = alignment(cameras, truth)
    free = Network(tuple(cameras), np.zeros((0, 3, 3)), np.zeros((0, 3)))
    found = reprojection.transformed(free, rotation, translation).cameras
    centres = np.array([p.centre - q.centre for p, q in zip(found, truth, strict=True)])
    turns = np.array(
        [p.R_camera_world @ q.R_camera_world.T for p, q in zip(found, truth, strict=True)]
    )
    return found, centres, Rotation.from_matrix(turns).as_rotvec()


def camera_deviations(adjustment: Adjustment, shot: int | None = None) -> tuple[Array, Array]:
    """Standard deviations of the cameras' poses with respect to a datum.

    Parameters
    ----------
    adjustment : Adjustment
        A bundle adjustment.
    shot : int, optional
        The shot whose board is the datum. Without one, the cameras themselves are (a free
        network): deviations then compare with errors after :func:`align`.

    Returns
    -------
    centres : ndarray, shape (cameras, 3)
        Along the axes of the frame that the adjustment is in, m.
    rotations : ndarray, shape (cameras, 3)
        About the camera's own axes, rad.
    """
    n = len(adjustment.cameras)
    weight = np.zeros(len(adjustment.covariance))
    if shot is None:
        weight[: n * POSE] = np.tile([*[_lever(adjustment.cameras) ** 2] * 3, 1, 1, 1], n)
    else:
        weight[(n + shot) * POSE :][:POSE] = 1
    G = reprojection.gauge(adjustment)
    S = np.eye(len(weight)) - G @ np.linalg.solve(G.T @ (weight[:, None] * G), G.T * weight)
    variances = np.einsum("ij,jk,ik->i", S, adjustment.covariance, S, optimize=True)
    both = np.sqrt(np.maximum(variances[: n * POSE], 0)).reshape(n, 2, 3)
    return both[:, 1], both[:, 0]


def _lever(cameras: Sequence[Camera]) -> float:
    """Length that weighs angles against distances: rms distance of centres from their mean, m."""
    centres = np.array([camera.centre for camera in cameras])
    spread = float(np.sqrt(np.mean(np.sum((centres - centres.mean(axis=0)) ** 2, axis=1))))
    return spread or 1.0
