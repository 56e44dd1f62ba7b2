"""Bundle adjustment: cameras and boards that fit all images at once (eq. 5.1, Appendix E).

A point X of the board in shot s has in camera c the coordinates

    x = R_c (R_s X + t_s − C_c).

Small changes turn the camera by a about its own axes, R_c ← exp([a]×) R_c, the board by b about the
world's, R_s ← exp([b]×) R_s, and shift C_c and t_s. The unknowns are all cameras' poses, then all
boards', six each, rotation first (rad, m), then the lenses', eight each: f_x, f_y, c_x, c_y (px),
k₁, k₂, p₁, p₂.

The board's tiles give the scale; where the world lies is free. The normal equations are therefore
singular in six directions, known in closed form, and the steps keep clear of them (inner
constraints, a free network; Triggs et al. 2000, section 9). So errors and covariances mean
something only with respect to a datum, what is held fixed: all cameras, or one board. Baarda's
S-transformation takes the covariances from one to the other; the rigid motion of
:func:`align_cameras` does the same for the errors.
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
    """Shots that do not determine a camera or a rig; the message says which and why."""


@dataclass(frozen=True)
class Network:
    """Cameras and the boards they see."""

    cameras: tuple[Camera, ...]  #: The cameras
    rotations: Array  #: From each shot's board to the world, shape (shots, 3, 3)
    translations: Array  #: Each board's centre in the world, m, shape (shots, 3)

    @property
    def unknowns(self) -> int:
        """Return the number of unknowns, the lenses' included."""
        cameras, boards = len(self.cameras), len(self.rotations)
        return POSE_UNKNOWNS * (cameras + boards) + LENS_UNKNOWNS * cameras


def without_boards(cameras: Sequence[Camera]) -> Network:
    """Return a network of cameras alone."""
    return Network(tuple(cameras), np.zeros((0, 3, 3)), np.zeros((0, 3)))


def start_network(observations: Array, points: Array, cameras: Sequence[Camera]) -> Network:
    """Return the poses chained from image to image, the world being the first shot's board."""
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
    """Return the points (3, n) of all images as those of each, (cameras, shots, 3, n)."""
    cameras, shots, _, count = observations.shape
    return np.broadcast_to(points, (cameras, shots, 3, count))


def planar_pose(camera: Camera, points: Array, uv: Array) -> tuple[Array, Array]:
    """Return the rotation and translation from a board to a camera that sees points of one z of it.

    Points whose place `uv` is NaN do not count.
    """
    seen = np.isfinite(uv).all(axis=0)
    xy = pinhole.from_pixels(camera.K, uv[:, seen])
    xy = pinhole.undistort_coordinates(xy, camera.distortion)
    flat = points[:, seen] * np.array([[1.0], [1.0], [0.0]])
    _, turn, t = cv2.solvePnP(flat.T.copy(), xy.T.copy(), np.eye(3), np.zeros(4))
    R, t = np.asarray(cv2.Rodrigues(turn)[0], float), np.ravel(np.asarray(t, float))
    return R, t - R[:, 2] * points[2, 0]


def board_images(network: Network, camera: Camera, points: Array) -> tuple[Array, Array]:
    """Return the images of the boards' points in a camera, and their derivatives.

    Points (shots, 3, points) are in the boards' frame, m, and images (2, shots, points) in px; NaN
    behind the camera. Derivatives (20, 2, shots, points) are in the camera's pose (6), the board's
    pose (6) and the lens (8).
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
            # The derivative in a rotation of a is a × b if b is the one in a.
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
    """Return JᵀJ and Jᵀr of all unknowns, and the residuals r, as seen minus computed.

    Points that an image does not show are NaN in the observations and in the residuals
    (cameras, shots, 2, points) in px, and count for nothing. Each image touches the twenty unknowns
    of its camera and its board only; the matrix is gathered from such blocks.
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
    """Return the numbers of the unknowns of some of the cameras: their poses, then their lenses."""
    first = POSE_UNKNOWNS * (cameras + boards)
    poses = POSE_UNKNOWNS * which[:, None] + np.arange(POSE_UNKNOWNS)
    lenses = first + LENS_UNKNOWNS * which[:, None] + np.arange(LENS_UNKNOWNS)
    return np.concatenate([poses.ravel(), lenses.ravel()])


def gauge_directions(network: Network) -> Array:
    """Return the change of the unknowns when the world turns and shifts, shape (unknowns, 6)."""
    poses = [(-c.R_camera_world, c.centre) for c in network.cameras]  # a camera turns the other way
    poses += [(np.eye(3), place) for place in network.translations]
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


MAX_STEPS = 100  # Levenberg–Marquardt steps of an adjustment
MIN_EIGENVALUE = 1e-11  # least eigenvalue of the normal equations, scaled to a unit diagonal


@dataclass(frozen=True)
class Adjustment(Network):
    """Cameras and boards after a bundle adjustment."""

    #: Seen minus computed, px; NaN where absent, shape (cameras, shots, 2, points)
    residuals: Array
    rms: float  #: Root mean square residual per coordinate, px
    sigma: float  #: The same over the degrees of freedom, px
    #: Standard deviations of f_x, f_y, c_x, c_y (px), k₁, k₂, p₁, p₂; 0 where held fixed, shape
    #: (cameras, 8)
    deviations: Array
    #: Of all unknowns, up to the choice of a datum, shape (unknowns, unknowns); see
    #: :func:`camera_deviations`
    covariance: Array


def adjust_bundle(
    observations: Array, points: Array, cameras: Sequence[Camera], lenses: bool = True
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
    lenses : bool
        Whether f_x, f_y, c_x, c_y, k₁, k₂, p₁, p₂ of each camera are adjusted.

    Returns
    -------
    Adjustment
        In the frame of the first shot's board.

    Raises
    ------
    CalibrationError
        If cameras or shots are not connected by common images, or if the steps do not converge.
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
    """Return the network of least squares, by Levenberg–Marquardt."""
    normal, right, residuals = normal_equations(observations, points, network)
    observed = np.isfinite(observations)
    cost, damping = np.nansum(residuals**2), 0.0
    for _ in range(MAX_STEPS):
        change = _invert_normal(normal, network, free, damping)[0] @ right
        hoped = float(change @ right)  # twice what the cost would fall, were it a parabola
        if hoped <= 1e-12 * cost or hoped < 1e-18:
            return step_network(network, change)
        trial = step_network(network, change)
        new = normal_equations(observations, points, trial)
        new_cost = np.sum(new[2][observed] ** 2)  # NaN if a board came to lie behind a camera
        if new_cost < cost:
            network, (normal, right, _), cost = trial, new, new_cost
            damping = damping / 2 if damping > 1e-8 else 0.0  # boards of few corners turn slowly
        else:
            damping = max(10 * damping, 1e-6)
    raise CalibrationError(f"adjustment: not converged after {MAX_STEPS} steps")


def _invert_normal(
    normal: Array, network: Network, free: Mask, damping: float = 0.0
) -> tuple[Array, float]:
    """Invert the normal equations without the gauge; return their least eigenvalue, too.

    Scaled to a unit diagonal, the matrix becomes regular when the projector on its null space, the
    gauge, is added; without it again the inverse has that null space.
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
    """Return cameras in the true ones' frame, and how far they are off.

    Kabsch's method on the centres and the axes together: the rigid motion, without change of scale,
    minimises the sum of |ΔC|² + ℓ²|Δω|², ℓ being the rms distance of the true centres from their
    mean and Δω the angle between orientations.

    Parameters
    ----------
    cameras, truth : sequence of Camera
        The same cameras as found and as they are.

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
    """Compute standard deviations of the cameras' poses with respect to the cameras themselves.

    Of such a free network deviations compare with errors after :func:`align_cameras`.

    Parameters
    ----------
    network : Network
        The cameras, and boards if the covariance is of these, too.
    covariance : ndarray, shape (unknowns, unknowns)
        Of the network's unknowns, up to the choice of a datum.

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
    """Return the length that weighs angles against distances: rms of centres about the mean, m."""
    centres = np.array([camera.centre for camera in cameras])
    spread = float(np.sqrt(np.mean(np.sum((centres - centres.mean(axis=0)) ** 2, axis=1))))
    return spread or 1.0
