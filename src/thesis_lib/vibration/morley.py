"""Morley's element: a quadratic on a triangle, from values at corners and slopes across sides.

With barycentric coordinates λ_k, their gradients g_k and b_k = λ_k (λ_k − 1), which is 0 at all
corners and has a slope across the middle of side k (opposite to corner k) alone, the shapes are

    φ_i = λ_i + Σ_k (g_i · g_k / |g_k|²) b_k    of the value at corner i, and
    ψ_k = ± b_k / |g_k|                         of the slope across the middle of side k

(M. Wang and J. Xu, Numer. Math. 103, 2006). scikit-fem inverts the values and slopes of 1, x, y, x²
… instead, which loses the more digits the smaller a triangle is, and the farther from the origin.
"""

from typing import Any

import numpy as np
from skfem import ElementTriMorley
from skfem.element import DiscreteField

from thesis_lib.arrays import Array, IntArray

# Corners of each side: sides in scikit-fem's order, corners in cyclic order
SIDE_CORNERS = ((0, 1), (1, 2), (2, 0))
OPPOSITE_CORNERS = (2, 0, 1)


class Morley(ElementTriMorley):  # type: ignore[misc]
    """Morley's element in barycentric coordinates."""

    def gbasis(
        self, mapping: Any, X: Array, i: int, tind: IntArray | None = None
    ) -> tuple[DiscreteField]:
        """Return shape function `i` (0 to 2 corners, 3 to 5 sides) and its second derivatives.

        They are evaluated at points `X` of the reference triangle, shape (2, points) or
        (2, triangles, points), for the triangles `tind`, by default all: values
        (triangles, points), `hess` (2, 2, triangles, points).
        """
        mesh = mapping.mesh
        corners = mesh.t if tind is None else mesh.t[:, tind]
        a, b, c = mesh.p[:, corners].transpose(1, 0, 2)
        (ux, uy), (vx, vy) = b - a, c - a
        second, third = np.stack([[vy, -vx], [-uy, ux]]) / (ux * vy - uy * vx)
        g = np.stack([-second - third, second, third])  # 1/m, (3, 2, triangles)
        squares = np.sum(g**2, axis=1)
        weights = np.stack([1 - X[0] - X[1], X[0], X[1]])
        if i < 3:
            shares = np.sum(g[i] * g, axis=1) / squares  # (3, triangles)
        else:
            (start, end), side = SIDE_CORNERS[i - 3], OPPOSITE_CORNERS[i - 3]
            # the same in both triangles: to the right on the way to the corner of higher number
            outward = np.sign(corners[end] - corners[start]) * np.sign(ux * vy - uy * vx)
            shares = np.zeros_like(squares)
            shares[side] = outward / np.sqrt(squares[side])
        value = sum(shares[k][:, None] * weights[k] * (weights[k] - 1) for k in range(3))
        if i < 3:
            value = weights[i] + value
        curved = 2 * np.einsum("kt,kit,kjt->ijt", shares, g, g)
        points = np.ones(np.shape(value)[-1])
        return (DiscreteField(value=value, hess=curved[..., None] * points),)
