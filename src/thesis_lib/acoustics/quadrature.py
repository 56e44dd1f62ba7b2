"""Rayleigh's integral itself, to six digits: what the sum of a plate's pistons stands for.

Pistons at the middles of cells are a midpoint rule, whose error falls with the square of their
size. Gauss and Legendre's rule gains a digit with every few nodes, since the integrand is smooth:
a point at the height h sees its source grow to infinity only at a distance jh beside the plate, in
the complex plane, and along a half side a the error falls as e^(-2n asinh(h/a)) with the nodes n.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from thesis_lib.acoustics.radiation import rayleigh_pressure
from thesis_lib.acoustics.sources import AIR, Medium, Pistons
from thesis_lib.arrays import Array, ComplexArray
from thesis_lib.vibration.plate import Plate

_MAX_RELATIVE_ERROR = 1e-5  # at the worst place; over all nodes it is a hundredth of that
_EXTRA_NODES = 10  # nodes, for the shape and the wave


def enough_nodes(plate: Plate, height: float) -> tuple[int, int]:
    """Return nodes along and across that leave an error below 1e-6 at points so high above, in m.

    Examples
    --------
    >>> from thesis_lib.facts import setups
    >>> enough_nodes(setups.thesis_plate(), 0.0445)
    (54, 39)
    """
    rate = 2 * np.arcsinh(height / (np.array(plate.extent) / 2))
    nx, ny = np.ceil(-np.log(_MAX_RELATIVE_ERROR) / rate).astype(int) + _EXTRA_NODES
    return int(nx), int(ny)


def integrate_pressure(
    plate: Plate,
    velocity: Callable[[Array], Array],
    points: ArrayLike,
    omega: float,
    medium: Medium = AIR,
    nodes: tuple[int, int] | None = None,
) -> ComplexArray:
    """Return the pressure in Pa of a plate that moves everywhere (eq. 6.4).

    Parameters
    ----------
    plate : Plate
        The radiating plate.
    velocity : callable
        Normal velocities in m/s, (n,), of places (2, n) on the plate in its own frame, in m.
    points, omega, medium
        Where, how fast and in what, as of :func:`.rayleigh`.
    nodes : tuple of int, optional
        Nodes along and across; those of :func:`enough_nodes` by default.

    Returns
    -------
    ndarray, shape (...), complex
    """
    points = np.asarray(points, float)
    count = nodes or enough_nodes(plate, float(points[2].min()))
    extent = np.array(plate.extent)
    (x, along), (y, across) = map(np.polynomial.legendre.leggauss, count)
    places = np.stack(np.meshgrid(x, y, indexing="ij")).reshape(2, -1) * extent[:, None] / 2
    weights = np.outer(along * count[0], across * count[1]).ravel() / 4  # of equal ones: 1
    even = Pistons(places, (plate.length / count[0], plate.width / count[1]))
    moving = velocity(places + extent[:, None] / 2)
    return rayleigh_pressure(even, moving * weights, points, omega, medium)
