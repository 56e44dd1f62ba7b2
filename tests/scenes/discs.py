"""A camera that looks at markers, and where their discs lie in its pictures."""

import numpy as np

from thesis_lib.measure.recordings.board import on_surface
from thesis_lib.vision import pinhole


def camera(azimuth=-10.0, elevation=22.0, size=(1920, 1080), k1=-0.1):
    angles = np.radians([azimuth, elevation])
    K = pinhole.intrinsics(24 / 36 * size[0], size)
    R, direction = pinhole.hemisphere_rotations(*angles), pinhole.hemisphere_directions(*angles)
    lens = np.array([k1, 0.015, 5e-4, -4e-4, 0])
    return pinhole.Camera("A", K, lens, R, 0.57 * direction, size)


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
