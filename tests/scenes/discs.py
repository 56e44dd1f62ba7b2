"""A camera that looks at markers, and where their discs lie in its pictures."""

import numpy as np

from thesis_lib.measure.recordings.board import on_surface
from thesis_lib.vision import pinhole
from thesis_lib.vision.pinhole import (
    Camera,
    hemisphere_directions,
    hemisphere_rotations,
    intrinsics,
)


def camera(azimuth=-10.0, elevation=22.0, size=(1920, 1080), k1=-0.1):
    angles = np.radians([azimuth, elevation])
    K = intrinsics(24 / 36 * size[0], size)
    return Camera("A", K, np.array([k1, 0.015, 5e-4, -4e-4, 0]), hemisphere_rotations(*angles),
                  0.57 * hemisphere_directions(*angles), size)  # fmt: skip


def disc_centroids(at, markers, deflection, which=slice(None), n=2000):
    """Centroids of the images of discs on the deflected surface, by their outlines."""
    turn = 2 * np.pi * np.arange(n) / n
    circle = markers.diameter / 2 * np.stack([np.cos(turn), np.sin(turn)])
    ring = markers.positions[:, which, None] + circle[:, None]
    x, y = pinhole.project_points(at, on_surface(markers.extent, ring, deflection(ring)))
    cross = x * np.roll(y, -1, 1) - y * np.roll(x, -1, 1)
    return np.array(
        [np.sum((c + np.roll(c, -1, 1)) * cross, axis=1) / (3 * cross.sum(1)) for c in (x, y)]
    )
