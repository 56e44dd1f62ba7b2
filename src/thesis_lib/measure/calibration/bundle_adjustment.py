"""Bundle adjustment: cameras and boards that fit all images at once (eq. 5.1, Appendix E).

The unknowns are each camera's pose and, if wanted, its intrinsics and distortion, and each board's
pose (:mod:`~thesis_lib.measure.calibration.reprojection`). The board's tiles give the scale; where
the world lies is free. The normal equations are therefore singular in six directions, known in
closed form, and the steps keep clear of them (inner constraints, a free network; Triggs et al.
2000, section 9). The result is expressed in
other frames.

Where the world lies is free, so errors and covariances mean something only with respect to a datum,
what is held fixed: all cameras, or one board. Baarda's S-transformation takes the covariances from
one to the other; the rigid motion of :func:`fit_alignment` does the same for the errors.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from thesis_lib.arrays import Array, Mask
from thesis_lib.measure.calibration import reprojection
from thesis_lib.measure.calibration.reprojection import LENS_UNKNOWNS, POSE_UNKNOWNS, Network
from thesis_lib.measure.calibration.zhang import CalibrationError
from thesis_lib.vision.lens import Camera

_MIN_EIGENVALUE = 1e-11  # least eigenvalue of the normal equations, scaled to a unit diagonal


@dataclass(frozen=True)
class Adjustment(Network):
    """Cameras and boards after a bundle adjustment."""

    #: Seen minus computed, px; NaN where absent, shape (cameras, shots, 2, points)
    residuals: Array
    rms: float  #: Root mean square residual per coordinate, px
    #: Standard deviation of a coordinate that the residuals speak of, px: as the rms, but over the
    #: degrees of freedom
    sigma: float
    #: Standard deviations of f_x, f_y, c_x, c_y (px), k₁, k₂, p₁, p₂; 0 where held fixed, shape
    #: (cameras, 8)
    deviations: Array
    #: Of all cameras' poses, then all boards' (rotation, position; rad, m), then the lenses', up to
    #: the choice of a datum, shape (unknowns, unknowns); see
    #: :func:`~thesis_lib.measure.calibration.bundle_adjustment.camera_deviations`
    covariance: Array
    iterations: int  #: Steps taken


def adjust_bundle(
    observations: Array,
    points: Array,
    cameras: Sequence[Camera],
    intrinsics: bool = True,
    distortion: bool = True,
    steps: int = 100,
) -> Adjustment:
    """Return the cameras and board poses of least squared reprojection error (eq. 5.1).

    Parameters
    ----------
    observations : ndarray, shape (cameras, shots, 2, points)
        Pixels, in one order of the points for all images; NaN where a point is not seen.
    points : ndarray, shape (3, points) or (cameras, shots, 3, points)
        The board's corners in its own frame, m; where its sides differ, those of each image.
    cameras : sequence of Camera
        Names, sizes, and intrinsics and distortion to start from or to keep. Where the cameras
        stand is found from the observations.
    intrinsics : bool
        Whether f_x, f_y, c_x, c_y of each camera are adjusted.
    distortion : bool
        Whether k₁, k₂, p₁, p₂ of each camera are adjusted.
    steps : int
        Most Levenberg–Marquardt steps.

    Returns
    -------
    Adjustment
        In the frame of the first shot's board.

    Raises
    ------
    ValueError
        If the shapes do not match.
    CalibrationError
        If a camera has no shot, a shot no camera, if either is not connected with the rest by
        common images, or if the steps do not converge.
    """
    observations, points = np.asarray(observations, float), np.asarray(points, float)
    expected = (len(cameras), 2, points.shape[-1])
    given = observations.shape
    if observations.ndim != 4 or (given[0], given[2], given[3]) != expected:
        raise ValueError(
            f"observations: given shape {given}, "
            f"needs ({expected[0]}, board images, 2, {expected[2]})"
        )
    seen: Mask = np.any(np.isfinite(observations), axis=(2, 3))
    network = reprojection.start_network(observations, seen, points, cameras)
    free = _free(network, intrinsics, distortion)
    network, iterations = _minimise(observations, seen, points, network, free, steps)
    network = reprojection.transform_network(network, *reprojection.to_board(network, 0))
    return _result(observations, seen, points, network, free, iterations)


def _free(network: Network, intrinsics: bool, distortion: bool) -> Mask:
    """Return which unknowns are adjusted."""
    poses = POSE_UNKNOWNS * (len(network.cameras) + len(network.rotations))
    lens = [intrinsics] * 4 + [distortion] * 4
    return np.array([True] * poses + lens * len(network.cameras))


def _minimise(
    observations: Array,
    seen: Mask,
    points: Array,
    network: Network,
    free: Mask,
    steps: int,
) -> tuple[Network, int]:
    """Minimise by Levenberg–Marquardt; return the network and the number of steps."""
    normal, right, residuals = reprojection.normal_equations(observations, seen, points, network)
    observed = np.isfinite(observations)
    cost, damping = np.nansum(residuals**2), 0.0
    for step in range(1, steps + 1):
        inverse, _ = _inverse(normal, network, free, damping)
        change = inverse @ right
        hoped = float(change @ right)  # twice what the cost would fall, were it a parabola
        if hoped <= 1e-12 * cost or hoped < 1e-18:
            return reprojection.step_network(network, change), step
        trial = reprojection.step_network(network, change)
        new = reprojection.normal_equations(observations, seen, points, trial)
        new_cost = np.sum(new[2][observed] ** 2)  # NaN if a board came to lie behind a camera
        if new_cost < cost:
            network, (normal, right, _), cost = trial, new, new_cost
            damping = damping / 2 if damping > 1e-8 else 0.0  # boards of few corners turn slowly
        else:
            damping = max(10 * damping, 1e-6)
    raise CalibrationError(f"adjustment: not converged after {steps} steps")


def _inverse(
    normal: Array, network: Network, free: Mask, damping: float = 0.0
) -> tuple[Array, float]:
    """Invert the normal equations without the gauge; return their least eigenvalue, too.

    Scaled to a unit diagonal, the matrix becomes regular when the projector on its null space, the
    gauge, is added; without it again the inverse has that null space.
    """
    scale = 1 / np.sqrt(np.diag(normal)[free])
    Q, _ = np.linalg.qr(reprojection.gauge_directions(network)[free] / scale[:, None])
    scaled = normal[np.ix_(free, free)] * scale[:, None] * scale
    values, vectors = np.linalg.eigh(scaled + Q @ Q.T + damping * np.eye(len(scale)))
    part = (vectors / np.maximum(values, 1e-15)) @ vectors.T - Q @ Q.T / (1 + damping)
    inverse = np.zeros_like(normal)
    inverse[np.ix_(free, free)] = part * scale[:, None] * scale
    return inverse, float(values[0])


def _result(
    observations: Array,
    seen: Mask,
    points: Array,
    network: Network,
    free: Mask,
    iterations: int,
) -> Adjustment:
    normal, _, residuals = reprojection.normal_equations(observations, seen, points, network)
    inverse, least = _inverse(normal, network, free)
    if least < _MIN_EIGENVALUE:
        raise CalibrationError("adjustment: the board images do not determine all unknowns")
    squares, count = float(np.nansum(residuals**2)), int(np.isfinite(observations).sum())
    freedom = count - (int(free.sum()) - POSE_UNKNOWNS)
    sigma = float(np.sqrt(squares / freedom))
    covariance = sigma**2 * inverse
    lenses = np.diag(covariance)[-LENS_UNKNOWNS * len(network.cameras) :]
    return Adjustment(
        network.cameras,
        network.rotations,
        network.translations,
        residuals,
        float(np.sqrt(squares / count)),
        sigma,
        np.sqrt(lenses).reshape(-1, LENS_UNKNOWNS),
        covariance,
        iterations,
    )


def transform_adjustment(adjustment: Adjustment, rotation: Array, translation: Array) -> Adjustment:
    """Transform the adjustment and its covariance to X' = rotation X + translation."""
    network = reprojection.transform_network(adjustment, rotation, translation)
    T = np.eye(len(adjustment.covariance))
    n = len(network.cameras)
    for k in range(n + len(network.rotations)):
        a, b, c = k * POSE_UNKNOWNS, k * POSE_UNKNOWNS + 3, (k + 1) * POSE_UNKNOWNS
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


def fit_alignment(cameras: Sequence[Camera], truth: Sequence[Camera]) -> tuple[Array, Array]:
    """Return the rigid motion, without change of scale, that brings cameras nearest to true ones.

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


def align_cameras(
    cameras: Sequence[Camera], truth: Sequence[Camera]
) -> tuple[tuple[Camera, ...], Array, Array]:
    """Return cameras in the true ones' frame, and how far they are off (:func:`fit_alignment`).

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
    rotation, translation = fit_alignment(cameras, truth)
    free = Network(tuple(cameras), np.zeros((0, 3, 3)), np.zeros((0, 3)))
    found = reprojection.transform_network(free, rotation, translation).cameras
    centres = np.array([p.centre - q.centre for p, q in zip(found, truth, strict=True)])
    turns = np.array(
        [p.R_camera_world @ q.R_camera_world.T for p, q in zip(found, truth, strict=True)]
    )
    return found, centres, Rotation.from_matrix(turns).as_rotvec()


def camera_deviations(adjustment: Adjustment, shot: int | None = None) -> tuple[Array, Array]:
    """Compute standard deviations of the cameras' poses with respect to a datum.

    Parameters
    ----------
    adjustment : Adjustment
        A bundle adjustment.
    shot : int, optional
        The shot whose board is the datum. Without one, the cameras themselves are (a free
        network): deviations then compare with errors after :func:`align_cameras`.

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
        weight[: n * POSE_UNKNOWNS] = np.tile([*[_lever(adjustment.cameras) ** 2] * 3, 1, 1, 1], n)
    else:
        weight[(n + shot) * POSE_UNKNOWNS :][:POSE_UNKNOWNS] = 1
    G = reprojection.gauge_directions(adjustment)
    S = np.eye(len(weight)) - G @ np.linalg.solve(G.T @ (weight[:, None] * G), G.T * weight)
    variances = np.einsum("ij,jk,ik->i", S, adjustment.covariance, S, optimize=True)
    both = np.sqrt(np.maximum(variances[: n * POSE_UNKNOWNS], 0)).reshape(n, 2, 3)
    return both[:, 1], both[:, 0]


def _lever(cameras: Sequence[Camera]) -> float:
    """Return the length that weighs angles against distances: rms of centres about the mean, m."""
    centres = np.array([camera.centre for camera in cameras])
    spread = float(np.sqrt(np.mean(np.sum((centres - centres.mean(axis=0)) ** 2, axis=1))))
    return spread or 1.0
