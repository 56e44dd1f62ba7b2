"""Cameras at unequal distances, markers before them, whole pixels, and the slabs these leave."""

import numpy as np

from thesis_lib.vision import pinhole

SIZE = (320, 180)


def rig(n, seed=0):
    """Cameras all around at unequal distances and focal lengths."""
    rng = np.random.default_rng([seed, n])
    azimuth = 2 * np.pi * np.arange(n) / n + rng.uniform(0, 0.5, n)
    elevation = rng.uniform(0.2, 1.3, n)
    K = np.stack([pinhole.intrinsics(f, SIZE) for f in rng.uniform(150, 500, n)])
    centres = rng.uniform(0.5, 2, (n, 1)) * pinhole.hemisphere_directions(azimuth, elevation)
    return pinhole.CameraArray(K, pinhole.hemisphere_rotations(azimuth, elevation), centres, SIZE)


def box(n=30, seed=0):
    limits = np.array([0.3, 0.1, 0.01])[:, None]
    return np.random.default_rng(seed).uniform(-limits, limits, (3, n))


def moved_world(seed):
    """A random rotation and shift of the world, and the (4, 4) matrix that takes both back."""
    rng = np.random.default_rng(seed)
    R = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    R *= np.linalg.det(R)
    t = rng.uniform(-1, 1, 3)
    return R, t, np.block([[R.T, -R.T @ t[:, None]], [np.zeros((1, 3)), 1]])


def rounded(P, points, noise=0.0, seed=1):
    uv = pinhole.project(P, points)
    return np.rint(uv + np.random.default_rng(seed).normal(0, noise or 1e-300, uv.shape))


def faces(P, uv, half=0.5):
    """Rows (a, b) of a·X + b ≥ 0 for one point's images, written out slab by slab."""
    rows = []
    for camera, image in zip(P, uv, strict=True):
        for axis in range(2):
            rows.append(camera[axis] - (image[axis] - half) * camera[2])
            rows.append((image[axis] + half) * camera[2] - camera[axis])
    return np.array(rows)
