"""Triangulation of very many points, compiled: ``pip install thesis-lib[fast]``.

The estimate of :mod:`thesis_lib.vision.triangulation`, linear start and Gauss–Newton steps, up to
rounding. What differs is the order of the work: a block of points goes through all steps while it
is in the nearest caches, and one instruction does the same for several neighbouring points. For
that u and v lie in planes of their own, and so do the entries of points and normal equations.

Only this module imports numba, and only :func:`thesis_lib.vision.triangulation.triangulate` imports
this module, for very many points: the first call compiles for seconds, later processes read the
result from disk. It runs on one thread and releases the interpreter's lock, so threads that take a
part of the points each run side by side.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from numba import njit

from thesis_lib.arrays import Array

Numbers = tuple[float, float, float, float]

# Points: their normal equations and images in 12 cameras fill a first or second cache
BLOCK_POINTS = 256
# Where rows of BLOCK numbers begin in a block's memory: points (x y z); matrices, upper triangles
# (xx xy xz yy yz zz); right sides; inverse depths.
_MATRIX_AT, _RIGHT_AT, _INVERSE_AT, _WORK_SIZE = (
    3 * BLOCK_POINTS,
    9 * BLOCK_POINTS,
    12 * BLOCK_POINTS,
    13 * BLOCK_POINTS,
)


def _compile_kernel(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile on the first call, and cache on disk for later processes where possible.

    A product and a sum may be rounded at once; nothing else may be rearranged, so that NaN and
    infinity go where they go in NumPy.
    """
    options: dict[str, Any] = {"nogil": True, "error_model": "numpy", "fastmath": {"contract"}}
    try:
        return njit(cache=True, **options)(function)
    except RuntimeError:  # no folder that one may write to
        return njit(**options)(function)


@_compile_kernel
def solve_points(P: Array, middle: Array, pixels: Array, steps: int, points: Array) -> None:
    """Find the points (3, m) in m that fit their images best, and write them into `points`.

    From projection matrices `P` (cameras, 3, 4) for `pixels` (cameras, 2, m) counted from the
    principal points `middle` (2, cameras, 1), all contiguous, by so many Gauss–Newton steps.
    """
    n, m = pixels.shape[0], pixels.shape[2]
    images = np.zeros(2 * n * BLOCK_POINTS)
    block = np.zeros(_WORK_SIZE)
    for start in range(0, m, BLOCK_POINTS):
        size = min(BLOCK_POINTS, m - start)  # beyond it the last block computes what nobody reads
        block[:] = 0
        _add_linear(P, middle, pixels[:, :, start : start + size], images, block)
        _add_solution(block)
        for _ in range(steps):
            block[_MATRIX_AT:] = 0
            _add_reprojection(P, images, block)
            _add_solution(block)
        for k in range(3):
            points[k, start : start + size] = block[k * BLOCK_POINTS : k * BLOCK_POINTS + size]


@_compile_kernel
def _add_linear(P: Array, middle: Array, pixels: Array, images: Array, block: Array) -> None:
    """Take the images, and add the equations (a₁ − u a₃)·X = u b₃ − b₁ and the same for v.

    Rows are written as multiples of BLOCK, which the compiler then knows not to be negative: with a
    row as an argument it reads points one by one, at half the speed.
    """
    for c in range(P.shape[0]):
        row, u0, v0 = 2 * c * BLOCK_POINTS, middle[0, c, 0], middle[1, c, 0]
        for i in range(pixels.shape[2]):
            images[row + i] = pixels[c, 0, i] - u0
            images[row + BLOCK_POINTS + i] = pixels[c, 1, i] - v0
        (ax, ay, az, ab), (bx, by, bz, bb), (cx, cy, cz, cb) = _rows(P[c])
        for i in range(BLOCK_POINTS):
            u, v = images[row + i], images[row + BLOCK_POINTS + i]
            of_u = ax - u * cx, ay - u * cy, az - u * cz, u * cb - ab
            of_v = bx - v * cx, by - v * cy, bz - v * cz, v * cb - bb
            _add_equations(block, i, of_u, of_v)


@_compile_kernel
def _add_reprojection(P: Array, images: Array, block: Array) -> None:
    """Add JᵀJ and Jᵀr (eq. 3.19); the rows of J are w (a₁ − h a₃) and w (a₂ − g a₃).

    The divisions of all points come first, so that nothing waits for them.
    """
    for c in range(P.shape[0]):
        row = 2 * c * BLOCK_POINTS
        (ax, ay, az, ab), (bx, by, bz, bb), (cx, cy, cz, cb) = _rows(P[c])
        for i in range(BLOCK_POINTS):
            x, y, z = block[i], block[BLOCK_POINTS + i], block[2 * BLOCK_POINTS + i]
            block[_INVERSE_AT + i] = 1 / (cb + cx * x + cy * y + cz * z)
        for i in range(BLOCK_POINTS):
            x, y, z, w = (
                block[i],
                block[BLOCK_POINTS + i],
                block[2 * BLOCK_POINTS + i],
                block[_INVERSE_AT + i],
            )
            h = w * (ab + ax * x + ay * y + az * z)
            g = w * (bb + bx * x + by * y + bz * z)
            u, v = images[row + i], images[row + BLOCK_POINTS + i]
            of_u = w * (ax - h * cx), w * (ay - h * cy), w * (az - h * cz), u - h
            of_v = w * (bx - g * cx), w * (by - g * cy), w * (bz - g * cz), v - g
            _add_equations(block, i, of_u, of_v)


@_compile_kernel
def _rows(P: Array) -> tuple[Numbers, Numbers, Numbers]:
    return (
        (P[0, 0], P[0, 1], P[0, 2], P[0, 3]),
        (P[1, 0], P[1, 1], P[1, 2], P[1, 3]),
        (P[2, 0], P[2, 1], P[2, 2], P[2, 3]),
    )


@_compile_kernel
def _add_equations(block: Array, i: int, of_u: Numbers, of_v: Numbers) -> None:
    """Add two equations (x, y, z)·X = right to the normal equations of point i."""
    (ux, uy, uz, ur), (vx, vy, vz, vr) = of_u, of_v  # sums from the left: one instruction a product
    block[_MATRIX_AT + i] = block[_MATRIX_AT + i] + ux * ux + vx * vx
    block[_MATRIX_AT + BLOCK_POINTS + i] = block[_MATRIX_AT + BLOCK_POINTS + i] + ux * uy + vx * vy
    block[_MATRIX_AT + 2 * BLOCK_POINTS + i] = (
        block[_MATRIX_AT + 2 * BLOCK_POINTS + i] + ux * uz + vx * vz
    )
    block[_MATRIX_AT + 3 * BLOCK_POINTS + i] = (
        block[_MATRIX_AT + 3 * BLOCK_POINTS + i] + uy * uy + vy * vy
    )
    block[_MATRIX_AT + 4 * BLOCK_POINTS + i] = (
        block[_MATRIX_AT + 4 * BLOCK_POINTS + i] + uy * uz + vy * vz
    )
    block[_MATRIX_AT + 5 * BLOCK_POINTS + i] = (
        block[_MATRIX_AT + 5 * BLOCK_POINTS + i] + uz * uz + vz * vz
    )
    block[_RIGHT_AT + i] = block[_RIGHT_AT + i] + ux * ur + vx * vr
    block[_RIGHT_AT + BLOCK_POINTS + i] = block[_RIGHT_AT + BLOCK_POINTS + i] + uy * ur + vy * vr
    block[_RIGHT_AT + 2 * BLOCK_POINTS + i] = (
        block[_RIGHT_AT + 2 * BLOCK_POINTS + i] + uz * ur + vz * vr
    )


@_compile_kernel
def _add_solution(block: Array) -> None:
    """Add the solutions of the 3×3 systems, by LDLᵀ, to the points.

    With three divisions, each of which takes as long as ten products.
    """
    for i in range(BLOCK_POINTS):
        xy, xz = (
            block[_MATRIX_AT + BLOCK_POINTS + i],
            block[_MATRIX_AT + 2 * BLOCK_POINTS + i],
        )
        yy, yz = (
            block[_MATRIX_AT + 3 * BLOCK_POINTS + i],
            block[_MATRIX_AT + 4 * BLOCK_POINTS + i],
        )
        by_x = 1 / block[_MATRIX_AT + i]
        yx, zx = xy * by_x, xz * by_x
        by_y = 1 / (yy - yx * xy)
        rest = yz - yx * xz
        zy = rest * by_y
        by_z = 1 / (block[_MATRIX_AT + 5 * BLOCK_POINTS + i] - zx * xz - zy * rest)
        x = block[_RIGHT_AT + i]
        y = block[_RIGHT_AT + BLOCK_POINTS + i] - yx * x
        z = (block[_RIGHT_AT + 2 * BLOCK_POINTS + i] - zx * x - zy * y) * by_z
        y = y * by_y - zy * z
        x = x * by_x - yx * y - zx * z
        block[i] += x
        block[BLOCK_POINTS + i] += y
        block[2 * BLOCK_POINTS + i] += z
