"""Bundle adjustment of cameras and board poses to all images at once (eq. 5.1, Appendix E).

A point X of the board in its pose s has, in the frame of camera c, the coordinates

    x = R_c (R_s X + t_s − C_c).

A small step turns the camera by a about its own axes, R_c ← exp([a]×) R_c, and the board by b about
the world's axes, R_s ← exp([b]×) R_s, and shifts C_c and t_s. The unknowns are the poses of all
cameras, then of all boards (six each, rotation first, in rad and m), then the lens parameters
(eight for each camera): f_x, f_y, c_x, c_y (px), k₁, k₂, p₁, p₂.

The board's tiles set the scale; the world frame is free. The normal equations are therefore
singular in six directions, known in closed form, and the steps avoid them (inner constraints, a
free network; Triggs et al. 2000, section 9). Errors and covariances therefore need a datum, the
part that is held fixed: all cameras, or one board. Baarda's S-transformation converts covariances
from one datum to the other; the rigid motion of :func:`align_cameras` does so for errors.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
import scipy

from thesis_lib.arrays import Array, IntArray, Mask
from thesis_lib.vision import pinhole
from thesis_lib.vision.pinhole import Camera

POSE_UNKNOWNS, LENS_UNKNOWNS = 6, 8  # unknowns of a pose and of a lens


class CalibrationError(ValueError):
    """Calibration images that do not determine a camera or a rig; the message gives the reason."""


@dataclass(frozen=True)
class Network:
    """Cameras and the board poses they observe."""

    cameras: tuple[Camera, ...]  #: The cameras
    rotations: Array  #: From the board to the world in each board pose, shape (poses, 3, 3)
    translations: Array  #: The board's centre in the world in each pose, m, shape (poses, 3)

    @property
    def unknowns(self) -> int:
        """Return the number of unknowns, including the lens parameters."""
        cameras, boards = len(self.cameras), len(self.rotations)
        return POSE_UNKNOWNS * (cameras + boards) + LENS_UNKNOWNS * cameras


def without_boards(cameras: Sequence[Camera]) -> Network:
    """Return a network of cameras without boards."""
    return Network(tuple(cameras), np.zeros((0, 3, 3)), np.zeros((0, 3)))


def start_network(observations: Array, points: Array, cameras: Sequence[Camera]) -> Network:
    """Return initial poses, chained from image to image; the first board is the world frame."""
    seen: Mask = np.any(np.isfinite(observations), axis=(2, 3))
    boards: dict[int, tuple[Array, Array]] = {0: (np.eye(3), np.zeros(3))}
    placed: dict[int, Camera] = {}
    views = [(int(c), int(s)) for c, s in np.argwhere(seen)]
    while pending := [(c, s) for c, s in views if (c in placed) != (s in boards)]:
        c, s = pending[0]
        R, t = planar_pose(cameras[c], points[c, s], observations[c, s])
        if s in boards:
            Rs, ts = boards[s]
            rotation = R @ Rs.T
            placed[c] = replace(cameras[c], R_camera_world=rotation, centre=ts - rotation.T @ t)
        else:
            turn = placed[c].R_camera_world.T
            boards[s] = turn @ R, turn @ t + placed[c].centre
    apart = [f"board image {s}" for s in range(seen.shape[1]) if s not in boards]
    for name in [one.name for c, one in enumerate(cameras) if c not in placed] + apart:
        raise CalibrationError(f"{name}: shares no board images, directly or not, with image 0")
    poses = zip(*(boards[s] for s in sorted(boards)), strict=True)
    return Network(tuple(placed[c] for c in sorted(placed)), *map(np.array, poses))


def spread_points(points: Array, observations: Array) -> Array:
    """Broadcast the board's points (3, n) to all images, (cameras, poses, 3, n)."""
    cameras, shots, _, count = observations.shape
    return np.broadcast_to(points, (cameras, shots, 3, count))


def planar_pose(camera: Camera, points: Array, uv: Array) -> tuple[Array, Array]:
    """Return the rotation and translation from a board to a camera, from points at the same z.

    Points whose pixels `uv` are NaN are ignored.
    """
    seen = np.isfinite(uv).all(axis=0)
    xy = pinhole.from_pixels(camera.K, uv[:, seen])
    xy = pinhole.undistort_coordinates(xy, camera.distortion)
    flat = points[:, seen] * np.array([[1.0], [1.0], [0.0]])
    _, turn, t = cv2.solvePnP(flat.T.copy(), xy.T.copy(), np.eye(3), np.zeros(4))
    R, t = np.asarray(cv2.Rodrigues(turn)[0], float), np.ravel(np.asarray(t, float))
    return R, t - R[:, 2] * points[2, 0]


def board_images(network: Network, camera: Camera, points: Array) -> tuple[Array, Array]:
    """Project the boards' points into a camera, and return the derivatives of the projection.

    Points (poses, 3, points) are in the board's frame, m, and projections (2, poses, points) in px;
    NaN behind the camera. Derivatives (20, 2, poses, points) are with respect to the camera's pose
    (6), the board's pose (6) and the lens (8).
    """
    on_board = np.einsum("sij,sjn->isn", network.rotations, points)
    from_centre = on_board + (network.translations - camera.centre).T[:, :, None]
    R = camera.R_camera_world
    x, y, z = np.tensordot(R, from_centre, axes=1)
    z = np.where(z > 0, z, np.nan)
    p, q = xy = np.stack([x / z, y / z])
    distorted = pinhole.distort_coordinates(xy, camera.distortion)
    scale = camera.K[:2, :2]  # px per distorted coordinate
    in_xy = np.einsum("ij,jk...->ik...", scale, pinhole.distortion_jacobian(xy, camera.distortion))
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
            # If b is the derivative with respect to a, then a × b is that for a rotation of a.
            np.cross(np.stack([x, y, z])[:, None], in_xyz, axis=0),
            -in_world,
            np.cross(on_board[:, None], in_world, axis=0),
            in_world,
            [[distorted[0], zero], [zero, distorted[1]], [one, zero], [zero, one]],
            np.einsum("ij,kj...->ki...", scale, lens),
        ]
    )
    return pinhole.to_pixels(camera.K, distorted), J


def normal_equations(
    observations: Array, points: Array, network: Network
) -> tuple[Array, Array, Array]:
    """Return JᵀJ and Jᵀr of all unknowns, and the residuals r, observed minus computed.

    Points that are not visible are NaN in the observations and in the residuals
    (cameras, poses, 2, points), in px, and are ignored. Each image depends on the twenty unknowns
    of its camera and its board only; the matrix is the sum of such blocks.
    """
    seen: Mask = np.any(np.isfinite(observations), axis=(2, 3))
    n, m = seen.shape
    normal = np.zeros((network.unknowns, network.unknowns))
    right = np.zeros(network.unknowns)
    residuals = np.full(observations.shape, np.nan)
    for c, camera in enumerate(network.cameras):
        uv, J = board_images(network, camera, points[c])
        residuals[c] = observations[c] - uv.swapaxes(0, 1)
        shots = np.flatnonzero(seen[c])
        missing = np.isnan(observations[c][shots])
        A = np.where(missing[:, None], 0, J[:, :, shots].transpose(2, 0, 1, 3))
        A = A.reshape(len(shots), POSE_UNKNOWNS * 2 + LENS_UNKNOWNS, -1)
        r = np.where(missing, 0, residuals[c][shots]).reshape(len(shots), -1, 1)
        pose, lens = np.split(camera_unknowns(np.array([c]), n, m), [POSE_UNKNOWNS])
        boards = (n + shots[:, None]) * POSE_UNKNOWNS + np.arange(POSE_UNKNOWNS)
        index = np.array([[*pose, *board, *lens] for board in boards])
        np.add.at(normal, (index[:, :, None], index[:, None]), A @ A.swapaxes(1, 2))
        np.add.at(right, index, (A @ r)[..., 0])
    return normal, right, residuals


def camera_unknowns(which: IntArray, cameras: int, boards: int = 0) -> IntArray:
    """Return the indices of the unknowns of some cameras: their poses, then their lenses."""
    first = POSE_UNKNOWNS * (cameras + boards)
    poses = POSE_UNKNOWNS * which[:, None] + np.arange(POSE_UNKNOWNS)
    lenses = first + LENS_UNKNOWNS * which[:, None] + np.arange(LENS_UNKNOWNS)
    return np.concatenate([poses.ravel(), lenses.ravel()])


def gauge_directions(network: Network) -> Array:
    """Return the changes of the unknowns when the world turns and shifts, shape (unknowns, 6)."""
    poses = [(-c.R_camera_world, c.centre) for c in network.cameras]  # cameras turn the other way
    poses += [(np.eye(3), place) for place in network.translations]
    G = np.zeros((network.unknowns, POSE_UNKNOWNS))
    for k, (turn, place) in enumerate(poses):
        rows = G[k * POSE_UNKNOWNS : (k + 1) * POSE_UNKNOWNS]
        rows[:3, :3] = turn
        rows[3:, :3] = -np.cross(place, np.eye(3)).T  # w × place
        rows[3:, 3:] = np.eye(3)
    return G


def step_network(network: Network, step: Array) -> Network:
    """Return the network after a step of its unknowns."""
    n, m = len(network.cameras), len(network.rotations)
    poses = step[: (n + m) * POSE_UNKNOWNS].reshape(-1, 2, 3)
    turns = scipy.spatial.transform.Rotation.from_rotvec(poses[:, 0]).as_matrix()
    lenses = step[(n + m) * POSE_UNKNOWNS :].reshape(n, LENS_UNKNOWNS)
    cameras = tuple(
        replace(
            camera,
            K=camera.K + np.array([[d[0], 0, d[2]], [0, d[1], d[3]], [0, 0, 0]]),
            distortion=camera.distortion + np.array([*d[4:], 0]),
            R_camera_world=turn @ camera.R_camera_world,
            centre=camera.centre + shift,
        )
        for camera, turn, shift, d in zip(network.cameras, turns, poses[:, 1], lenses, strict=False)
    )
    return Network(cameras, turns[n:] @ network.rotations, network.translations + poses[n:, 1])


def transform_network(network: Network, rotation: Array, translation: Array) -> Network:
    """Transform the network to another frame, X' = rotation X + translation."""
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


MAX_STEPS = 100  # Levenberg–Marquardt steps of an adjustment
MIN_EIGENVALUE = 1e-11  # of the normal equations, scaled to a unit diagonal


@dataclass(frozen=True)
class Adjustment(Network):
    """Cameras and boards after a bundle adjustment."""

    #: Observed minus computed, px; NaN where absent, shape (cameras, poses, 2, points)
    residuals: Array
    rms: float  #: Root mean square residual per coordinate, px
    sigma: float  #: Root of the sum of squared residuals over the degrees of freedom, px
    #: Standard deviations of f_x, f_y, c_x, c_y (px), k₁, k₂, p₁, p₂; 0 where held fixed, shape
    #: (cameras, 8)
    deviations: Array
    #: Covariance of all unknowns, up to the choice of a datum, shape (unknowns, unknowns); see
    #: :func:`camera_deviations`
    covariance: Array


def adjust_bundle(
    observations: Array, points: Array, cameras: Sequence[Camera], lenses: bool = True
) -> Adjustment:
    """Adjust cameras and board poses to the least squared reprojection error (eq. 5.1).

    Parameters
    ----------
    observations : ndarray, shape (cameras, poses, 2, points)
        Pixels, with the points in the same order in all images; NaN where a point is not visible.
    points : ndarray, shape (3, points) or (cameras, poses, 3, points)
        The board's corners in its own frame, m; for each image if the board has two sides.
    cameras : sequence of Camera
        Names, sizes, and initial or fixed intrinsics and distortion. The cameras' poses are
        estimated from the observations.
    lenses : bool
        Whether f_x, f_y, c_x, c_y, k₁, k₂, p₁, p₂ of each camera are adjusted.

    Returns
    -------
    Adjustment
        In the frame of the board in its first pose.

    Raises
    ------
    CalibrationError
        If cameras or board poses are not connected by common images, if the steps do not converge,
        or if the images do not determine all unknowns.
    """
    points = spread_points(points, observations)
    network = start_network(observations, points, cameras)
    free = np.full(network.unknowns, lenses)
    free[: POSE_UNKNOWNS * (len(cameras) + len(network.rotations))] = True
    network = _minimise_cost(observations, points, network, free)
    R, t = network.rotations[0], network.translations[0]
    network = transform_network(network, R.T, -R.T @ t)
    normal, _, residuals = normal_equations(observations, points, network)
    inverse, least = _invert_normal(normal, network, free)
    if least < MIN_EIGENVALUE:
        raise CalibrationError("adjustment: the board images do not determine all unknowns")
    squares, count = float(np.nansum(residuals**2)), int(np.isfinite(observations).sum())
    freedom = count - (int(free.sum()) - POSE_UNKNOWNS)
    sigma = float(np.sqrt(squares / freedom))
    covariance = sigma**2 * inverse
    variances = np.diag(covariance)[-LENS_UNKNOWNS * len(cameras) :]
    deviations, rms = np.sqrt(variances).reshape(-1, LENS_UNKNOWNS), float(np.sqrt(squares / count))
    return Adjustment(**vars(network), residuals=residuals, rms=rms, sigma=sigma,
                      deviations=deviations, covariance=covariance)  # fmt: skip


def _minimise_cost(observations: Array, points: Array, network: Network, free: Mask) -> Network:
    """Minimise the squared reprojection error by Levenberg–Marquardt."""
    normal, right, residuals = normal_equations(observations, points, network)
    observed = np.isfinite(observations)
    cost, damping = np.nansum(residuals**2), 0.0
    for _ in range(MAX_STEPS):
        change = _invert_normal(normal, network, free, damping)[0] @ right
        decrease = float(change @ right)  # of the cost, predicted for linear residuals, undamped
        if decrease <= 1e-12 * cost or decrease < 1e-18:
            return step_network(network, change)
        trial = step_network(network, change)
        new = normal_equations(observations, points, trial)
        new_cost = np.sum(new[2][observed] ** 2)  # NaN if a board is behind a camera now
        if new_cost < cost:
            network, (normal, right, _), cost = trial, new, new_cost
            damping = damping / 2 if damping > 1e-8 else 0.0  # boards with few corners turn slowly
        else:
            damping = max(10 * damping, 1e-6)
    raise CalibrationError(f"adjustment: not converged after {MAX_STEPS} steps")


def _invert_normal(
    normal: Array, network: Network, free: Mask, damping: float = 0.0
) -> tuple[Array, float]:
    """Return the pseudo-inverse of the normal equations, and their least eigenvalue.

    The matrix, scaled to a unit diagonal, is regular after adding the projector on its null space,
    the gauge. Subtracting the projector restores the null space in the inverse.
    """
    scale = 1 / np.sqrt(np.diag(normal)[free])
    Q, _ = np.linalg.qr(gauge_directions(network)[free] / scale[:, None])
    scaled = normal[np.ix_(free, free)] * scale[:, None] * scale
    values, vectors = np.linalg.eigh(scaled + Q @ Q.T + damping * np.eye(len(scale)))
    part = (vectors / np.maximum(values, 1e-15)) @ vectors.T - Q @ Q.T / (1 + damping)
    inverse = np.zeros_like(normal)
    inverse[np.ix_(free, free)] = part * scale[:, None] * scale
    return inverse, float(values[0])


def align_cameras(
    cameras: Sequence[Camera], truth: Sequence[Camera]
) -> tuple[tuple[Camera, ...], Array, Array]:
    """Align cameras with the true cameras, and return their errors.

    Kabsch's method, for centres and axes together, gives the rigid motion (without change of scale)
    that minimises the sum of |ΔC|² + ℓ²|Δω|². ℓ is the rms distance of the true centres from their
    mean, and Δω the angle between orientations.

    Parameters
    ----------
    cameras, truth : sequence of Camera
        The estimated cameras, and the true cameras in the same order.

    Returns
    -------
    cameras : tuple of Camera
        In the true cameras' frame.
    centres, rotations : ndarray, shape (cameras, 3)
        Errors of the centres of projection, m, and of orientations about the cameras' axes, rad.
    """
    A, B = (np.array([c.centre for c in group]) for group in (cameras, truth))
    a, b = A.mean(axis=0), B.mean(axis=0)
    axes = sum(q.R_camera_world.T @ p.R_camera_world for p, q in zip(cameras, truth, strict=True))
    U, _, Vt = np.linalg.svd((B - b).T @ (A - a) + _lever_length(truth) ** 2 / 2 * axes)
    rotation = U @ np.diag([1, 1, np.linalg.det(U @ Vt)]) @ Vt
    found = transform_network(without_boards(cameras), rotation, b - rotation @ a).cameras
    centres = np.array([p.centre - q.centre for p, q in zip(found, truth, strict=True)])
    turns = [p.R_camera_world @ q.R_camera_world.T for p, q in zip(found, truth, strict=True)]
    return found, centres, scipy.spatial.transform.Rotation.from_matrix(turns).as_rotvec()


def camera_deviations(network: Network, covariance: Array) -> tuple[Array, Array]:
    """Compute standard deviations of the cameras' poses, with all cameras as the datum.

    These standard deviations are comparable with the errors from :func:`align_cameras`.

    Parameters
    ----------
    network : Network
        The cameras, and the boards if the covariance includes them.
    covariance : ndarray, shape (unknowns, unknowns)
        Covariance of the network's unknowns, up to the choice of a datum.

    Returns
    -------
    centres, rotations : ndarray, shape (cameras, 3)
        Along the axes of the network's frame, m, and about each camera's own axes, rad.
    """
    n = len(network.cameras)
    weight = np.zeros(network.unknowns)
    lever = _lever_length(network.cameras)
    weight[: n * POSE_UNKNOWNS] = np.tile([lever**2] * 3 + [1, 1, 1], n)
    G = gauge_directions(network)
    S = np.eye(len(weight)) - G @ np.linalg.solve(G.T @ (weight[:, None] * G), G.T * weight)
    variances = np.einsum("ij,jk,ik->i", S, covariance, S, optimize=True)
    both = np.sqrt(np.maximum(variances[: n * POSE_UNKNOWNS], 0)).reshape(n, 2, 3)
    return both[:, 1], both[:, 0]


def _lever_length(cameras: Sequence[Camera]) -> float:
    """Return the rms distance of the centres from their mean, m, by which angles are weighted."""
    centres = np.array([camera.centre for camera in cameras])
    spread = float(np.sqrt(np.mean(np.sum((centres - centres.mean(axis=0)) ** 2, axis=1))))
    return spread or 1.0
