"""Natural frequencies and modes of thin plates of any shape, by finite elements.

The mode shapes w of a Kirchhoff plate of stiffness D and mass m per area satisfy

    ∫ ν Δw Δv + (1 − ν) ∇∇w : ∇∇v dA = λ ∫ w v dA,    ω = √(λ D / m)

for all v that are 0 on supported edges, and have no slope across clamped ones. Elements are
Morley's: a quadratic on each triangle, with values at corners and slopes across the middles of
sides; the error of λ falls with the square of the element size where w is smooth (H. Blum and
R. Rannacher, Math. Meth. Appl. Sci. 2, 1980: at a re-entrant corner it is not).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from thesis_lib.arrays import Array, IntArray

if TYPE_CHECKING:
    from scipy.sparse import csc_array
    from scipy.sparse.linalg import LinearOperator
    from skfem import MeshTri

SIMPLY_SUPPORTED, CLAMPED_EDGE, FREE_EDGE = "simply supported", "clamped", "free"
SUPPORTS = (SIMPLY_SUPPORTED, CLAMPED_EDGE, FREE_EDGE)


@dataclass(frozen=True, eq=False)
class PlateModes:
    """Modes of a plate with D = m = 1."""

    basis: Any  #: Morley's elements on the plate's triangles
    eigenvalues: Array  #: λ = ω² m / D in m⁻⁴, ascending, shape (modes,)
    #: Coefficients of shapes with a mean square of 1 over the plate, shape (coefficients, modes)
    coefficients: Array

    @property
    def peaks(self) -> Array:
        """Return largest absolute value of each shape at a corner of a triangle, shape (modes,)."""
        at_corners = self.coefficients[self.basis.nodal_dofs[0]]
        return np.max(np.abs(at_corners), axis=0)

    def at(self, points: Array) -> Array:
        """Return the shapes at points (2, n) of the plate, shape (modes, n)."""
        basis = self.basis
        cells, weights = locate_points(basis.mesh, points)
        shapes = np.zeros((points.shape[1], self.coefficients.shape[1]))
        for k, dofs in enumerate(basis.element_dofs):
            one = basis.elem.gbasis(basis.mapping, weights[1:, :, None], k, tind=cells)[0]
            shapes += np.asarray(one) * self.coefficients[dofs[cells]]
        return shapes.T


def locate_points(mesh: MeshTri, points: Array) -> tuple[IntArray, Array]:
    """Find the triangle that contains each point, and the point's barycentric coordinates.

    Triangles are tried in the order of the distance of their centres. A point that round-off puts
    outside of all, by less than a billionth of a triangle, is moved to the side of one.

    Parameters
    ----------
    mesh : skfem.MeshTri
        Triangles.
    points : ndarray, shape (2, n)
        Points on them.

    Returns
    -------
    cells : ndarray, shape (n,)
        Number of the triangle.
    weights : ndarray, shape (3, n)
        Barycentric coordinates, which are not negative and add up to 1.
    """
    from scipy.spatial import cKDTree

    a, b, c = mesh.p[:, mesh.t].transpose(1, 0, 2)  # each (2, triangles)
    tree, total = cKDTree(((a + b + c) / 3).T), mesh.t.shape[1]
    cells, weights = np.zeros(points.shape[1], np.int64), np.full((3, points.shape[1]), -np.inf)
    left, near = np.arange(points.shape[1]), 8
    while len(left):
        near = min(near, total)
        _, tried = tree.query(points[:, left].T, near)
        tried = tried.reshape(len(left), near)
        u, v, w = (b - a)[:, tried], (c - a)[:, tried], points[:, left, None] - a[:, tried]
        area = u[0] * v[1] - u[1] * v[0]
        second, third = (w[0] * v[1] - w[1] * v[0]) / area, (u[0] * w[1] - u[1] * w[0]) / area
        found = np.stack([1 - second - third, second, third])  # (3, left, near)
        best = np.argmax(found.min(axis=0), axis=1)
        row = np.arange(len(left))
        cells[left], weights[:, left] = tried[row, best], found[:, row, best]
        left = left[weights[:, left].min(axis=0) < -1e-9] if near < total else left[:0]
        near *= 4
    weights = np.maximum(weights, 0)
    return cells, weights / weights.sum(axis=0)


def plate_modes(
    mesh: MeshTri, clamped: Array, supported: Array, poisson: float, n_modes: int
) -> PlateModes:
    """Compute the first modes of a plate.

    Parameters
    ----------
    mesh : skfem.MeshTri
        Triangles, lengths in m.
    clamped, supported : ndarray of int
        Sides of triangles (facets of the mesh) along which the plate is clamped, or simply
        supported; all other edges are free.
    poisson : float
        Poisson's ratio ν.
    n_modes : int
        Number of modes.

    Returns
    -------
    PlateModes
        Each shape has the sign that makes ∫ φ e^{−3(x/Lx + y/Ly)} dA positive, with x and y from
        the lower left corner of the box around the plate: the shapes of a rectangle with simply
        supported edges then rise from that corner.
    """
    from scipy.sparse.linalg import eigsh
    from skfem import Basis, BilinearForm, LinearForm, condense

    from thesis_lib.vibration.morley import Morley

    @BilinearForm  # type: ignore[untyped-decorator]
    def inertia(u: Any, v: Any, _: Any) -> Any:
        return u * v

    low, size = mesh.p.min(axis=1), np.ptp(mesh.p, axis=1)

    @LinearForm  # type: ignore[untyped-decorator]
    def upward(v: Any, w: Any) -> Any:
        return v * np.exp(-3 * sum((w.x[i] - low[i]) / size[i] for i in range(2)))

    basis = Basis(mesh, Morley(), intorder=4)
    corners = np.unique(mesh.facets[:, np.concatenate([clamped, supported])])
    held = np.concatenate([basis.nodal_dofs[0, corners], basis.facet_dofs[0, clamped]])
    inner = np.setdiff1d(np.arange(basis.N), held)
    if n_modes >= (most := len(inner) // 2):
        allowed = f"fewer than {most} with elements of this size"
        raise ValueError(f"n_modes: given {n_modes}, allowed: {allowed}")
    M = inertia.assemble(basis)
    Mc = condense(M, I=inner, expand=False)
    start = np.ones(len(inner))  # always the same, for reproducible results
    compliance = _compliance_operator(_strain_matrix(basis, poisson)[:, inner])
    values, vectors = eigsh(Mc, n_modes, Mc, sigma=0, OPinv=compliance, v0=start)
    order = np.argsort(values)
    shapes = np.zeros((basis.N, n_modes))
    shapes[inner] = vectors[:, order]  # ∫ φ² dA = 1
    one = np.zeros(basis.N)  # coefficients of the function 1: values at corners 1, slopes 0
    one[basis.nodal_dofs[0]] = 1
    area = float(np.sum(M @ one * one))
    sign = np.where(upward.assemble(basis) @ shapes < 0, -1, 1)
    return PlateModes(basis, values[order], shapes * sign * np.sqrt(area))


def _strain_matrix(basis: Any, poisson: float) -> csc_array:
    """Return the matrix B of the bending energy wᵀBᵀBw of coefficients w.

    With the curvatures a, b, c = w_xx, w_yy, w_xy, which are constant on a triangle of area A,
    A (a² + b² + 2ν ab + 2(1 − ν) c²) = A ((1 + ν)(a + b)²/2 + (1 − ν)(a − b)²/2 + 2(1 − ν) c²).
    """
    from scipy.sparse import coo_array

    hess = np.stack([one[0].hess[..., 0] for one in basis.basis])  # (6, 2, 2, triangles)
    xx, yy, xy = hess[:, 0, 0], hess[:, 1, 1], hess[:, 0, 1]
    scale = np.sqrt([(1 + poisson) / 2, (1 - poisson) / 2, 2 * (1 - poisson)])[:, None, None]
    values = scale * np.stack([xx + yy, xx - yy, xy]) * np.sqrt(basis.dx.sum(axis=1))
    rows = np.arange(values[:, 0].size).reshape(values[:, :1].shape)  # (3, 1, triangles)
    columns = np.broadcast_to(basis.element_dofs, values.shape)
    shape = (rows.size, basis.N)
    at = (np.broadcast_to(rows, values.shape).ravel(), columns.ravel())
    return coo_array((values.ravel(), at), shape).tocsc()


def _compliance_operator(B: csc_array) -> LinearOperator:
    """Return the inverse of the stiffness BᵀB, as accurate as B allows.

    BᵀB squares the condition number of B: for small elements its factors give 7 digits, which
    differ between processors. Iterative refinement corrects this, with residuals computed from B
    instead of BᵀB.
    """
    from scipy.sparse.linalg import LinearOperator, splu

    factors = splu((B.T @ B).tocsc())

    def solve(load: Array) -> Array:
        found: Array = factors.solve(load)
        for _ in range(2):
            found = found + factors.solve(load - B.T @ (B @ found))
        return found

    return LinearOperator((B.shape[1],) * 2, solve, dtype=float)


def facets_along(mesh: MeshTri, start: Sequence[float], end: Sequence[float]) -> IntArray:
    """Return the boundary sides of triangles that lie on the segment from start to end."""
    import shapely

    facets, line = mesh.boundary_facets(), shapely.LineString([start, end])
    middles = mesh.p[:, mesh.facets[:, facets]].mean(axis=1)
    return facets[shapely.distance(line, shapely.points(*middles)) < 1e-9 * line.length]
