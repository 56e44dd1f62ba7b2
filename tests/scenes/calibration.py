"""A rig of four cameras about a two-sided board, and pictures of it made by counting samples."""

import cv2
import numpy as np
from scipy.special import ndtr

from thesis_lib.laboratory.rig import default_poses
from thesis_lib.measure.recordings.board import Board
from thesis_lib.vision import pinhole
from thesis_lib.vision.pinhole import hemisphere_directions, hemisphere_rotations

SIZE = (1920, 1080)
BOARD = Board()
CELLS = 20  # of a printed tile, along each side: a mark of 0.7 then has two for each of its bits


def rig():
    """Cameras like those of the thesis, each with its own lens."""
    azimuth, elevation = np.radians([10, -10, 190, 170]), np.radians([22.0] * 4)
    R = hemisphere_rotations(azimuth, elevation)
    centres = 0.57 * hemisphere_directions(azimuth, elevation)
    return [
        pinhole.Camera(
            "ABCD"[i],
            np.array([[1275.0 + 6 * i, 0, 955 + 4 * i], [0, 1278 + 5 * i, 546 - 4 * i], [0, 0, 1]]),
            np.array([-0.05 - 0.015 * i, 0.02 * i - 0.02, 5e-4 * (i - 1), -4e-4 * (i - 2), 0]),
            R[i],
            centres[i],
            SIZE,
        )
        for i in range(4)
    ]


def exact_images(cameras, rotations, translations, points=BOARD.corners):
    """Images (cameras, shots, 2, points) of the board's points."""
    world = rotations @ points + translations[:, :, None]
    return np.array([[pinhole.project_points(c, X) for X in world] for c in cameras])


def observations(sigma=0.0, seed=0, cameras=None):
    """Images of the corners in the default poses, with normal errors of sigma px."""
    uv = exact_images(cameras or rig(), *default_poses())
    return uv + np.random.default_rng(seed).normal(0, 1, uv.shape) * sigma


def as_found(uv, seed=0):
    """Corners as a finder orders them: front view, any of the alike corners first."""
    rng, nx = np.random.default_rng(seed), BOARD.shape[0]
    shots = []
    for views in uv:
        grids = [np.rot90(v.reshape(2, nx, nx), rng.integers(4), (1, 2)) for v in views]
        shots.append([front(grid).reshape(2, -1) for grid in grids])
    return shots


def front(grid):
    """The grid (2, ny, nx), its rows reversed if y is not to the left of x in the picture."""
    along_x, along_y = grid[:, 0, -1] - grid[:, 0, 0], grid[:, -1, 0] - grid[:, 0, 0]
    return grid if along_x[0] * along_y[1] < along_x[1] * along_y[0] else grid[:, ::-1]


def picture(camera, rotation, translation, board=BOARD, samples=128, blur=0.6, legacy=False):
    """Grey levels (h, w) of a white board with dark tiles before a grey background.

    Every pixel counts samples spread over its square and the Gaussian blur, symmetric about its
    centre and with different projections on the axes; the map from
    pixel to board is linear in their reach.
    """
    width, height = camera.size
    u, v = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    bent = pinhole.from_pixels(camera.K, np.stack([u, v]))
    xy = pinhole.undistort_coordinates(bent, camera.distortion)
    rays = np.tensordot((camera.R_camera_world @ rotation).T, np.stack([*xy, np.ones_like(u)]), 1)
    origin = rotation.T @ (camera.centre - translation)
    depth = -origin[2] / rays[2]
    places = (origin[:2, None, None] + depth * rays[:2]) / board.tile
    slopes = [np.gradient(place) for place in places]
    last = np.array([board.columns, board.rows]) / 2
    rim = last + board.margin / board.tile
    texture = printed(board, legacy) if board.mark else None
    total = np.zeros(u.shape)
    k = np.arange(samples // 2)
    shares = np.stack([(2 * k + 1) / samples, (k * 0.6180339887 + 0.25) % 1])
    spread = quantile(np.concatenate([shares, 1 - shares], axis=1), blur)
    for dv, du in spread.T:
        x, y = (p + dv * rows + du * cols for p, (rows, cols) in zip(places, slopes, strict=True))
        tiles = (abs(x) < last[0]) & (abs(y) < last[1])
        if board.mark:  # rows of the print run down
            cells = np.floor([(last[1] - y) * CELLS, (x + last[0]) * CELLS]).astype(int)
            dark = tiles & texture[tuple(np.where(tiles, cells, 0))]
        else:
            dark = tiles & ((np.floor(x + last[0]) + np.floor(y + last[1])) % 2 == 0)
        total += np.where(dark, 30.0, np.where((abs(x) < rim[0]) & (abs(y) < rim[1]), 200.0, 90.0))
    return total / samples


def printed(board, legacy=False):
    """Whether OpenCV prints a ChArUco board dark, shape (rows * CELLS, columns * CELLS)."""
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, board.dictionary))
    size = board.columns, board.rows
    layout = cv2.aruco.CharucoBoard(size, 1.0, board.mark / board.tile, dictionary)
    layout.setLegacyPattern(legacy)
    return layout.generateImage((size[0] * CELLS, size[1] * CELLS)) < 128


def quantile(share, blur):
    """Where a uniform distribution over a pixel, blurred by a Gaussian, reaches a share."""
    x = np.linspace(-0.5 - 5 * blur, 0.5 + 5 * blur, 4001)
    density = ndtr((x + 0.5) / blur) - ndtr((x - 0.5) / blur)
    reached = np.cumsum(density)
    return np.interp(share, (reached - density / 2) / reached[-1], x)


def photograph(clean, seed=None):
    """The picture in 8 bit, with the noise of photons and of reading unless the seed is None."""
    if seed is not None:
        noise = np.random.default_rng(seed).normal(size=clean.shape)
        clean = clean + noise * np.sqrt(0.05 * clean + 1)
    return np.clip(np.rint(clean), 0, 255).astype(np.uint8)


def nearest_order(found, exact):
    """The errors (2, corners) of found corners in whichever order of the grid is nearest."""
    nx = BOARD.shape[0]
    grid = exact.reshape(2, nx, nx)
    turned = [np.rot90(side, k, (1, 2)) for side in (grid, grid[:, ::-1]) for k in range(4)]
    off = [found - order.reshape(2, -1) for order in turned]
    return min(off, key=lambda error: np.abs(error).sum())
