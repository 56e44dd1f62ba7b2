"""Where the calibration board is held: twelve poses that all four cameras can share.

Cameras that face each other at 22° elevation have no good view of one printed face in common: a
board that lies flat is seen at 68° from its normal. The board therefore carries the pattern on
both faces and stands upright between them: tilted towards one pair it turns away from the other,
whose incidence grows by the tilt. Tilts up to 42° keep every view below 70°.

Parallel boards determine no focal length (Zhang 2000, section 4), and tilts about one axis only
leave the aspect ratio weak, so the board is tilted, turned and rolled, and it is moved through the
volume that the beam takes up, as far as its corners stay in the images.
"""

from __future__ import annotations

import numpy as np

from thesis_lib.arrays import Array

# Columns of the upright board's rotation: its x is −X, its y is Z, its normal Y.
_UPRIGHT = np.array([[-1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]])

# Tilt back from the vertical, turn about the vertical, roll about the normal, all in degrees, and
# the position of the board's centre (X, Y, Z) in mm.
_POSES = np.array(
    [
        [0, 0, 0, 0, 0, -13],
        [25, 0, 3, 0, -38, 0],
        [-25, 0, -3, 0, 38, 0],
        [42, 15, 0, -29, -39, 39],
        [-42, 15, 0, 29, 39, 39],
        [42, -25, 0, 35, -38, 45],
        [-42, -25, 0, -35, 38, 45],
        [15, 25, 0, -79, -29, 16],
        [-15, 25, 0, 79, 29, 16],
        [25, -25, 20, -37, -35, -25],
        [-25, -25, -20, 37, 35, -25],
        [35, 35, 0, -49, -39, 43],
    ]
)


def default_poses() -> tuple[Array, Array]:
    """Twelve poses of a two-sided board for cameras at ±22° elevation on both sides of XZ.

    Returns
    -------
    rotations : ndarray, shape (12, 3, 3)
        Turn directions in the board's frame into directions in the world.
    translations : ndarray, shape (12, 3)
        The board's centre in the world, m.
    """
    tilt, turn, roll = np.radians(_POSES[:, :3]).T
    rotations = _about(2, turn) @ _about(0, tilt) @ _UPRIGHT @ _about(2, roll)
    return rotations, _POSES[:, 3:] * 1e-3


def _about(axis: int, angle: Array) -> Array:
    """Rotations (n, 3, 3) about a coordinate axis by angles (n,) in rad."""
    i, j = (axis + 1) % 3, (axis + 2) % 3
    R = np.zeros((len(angle), 3, 3))
    R[:, axis, axis] = 1
    R[:, i, i] = R[:, j, j] = np.cos(angle)
    R[:, j, i] = np.sin(angle)
    R[:, i, j] = -np.sin(angle)
    return R
