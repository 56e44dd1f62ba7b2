"""What is to be measured: markers, the normals along which they move, and mode shapes.

A *body* is a beam, a plate, or markers on anything else that bends: points in space, each of which
moves along its own normal. Everything is in metres, in the frame in which the body was given.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from thesis_lib.arrays import Array
from thesis_lib.vibration.structure import Structure, deflection_shape


@dataclass(frozen=True)
class Body:
    """Markers that vibrate along their normals."""

    name: str  #: What it is called
    points: Array  #: Markers at rest in m, shape (3, markers)
    #: Unit vectors along which they move, and towards which they face, shape (3, markers)
    normals: Array
    #: Deflections along the normals where the peak over the structure is 1, shape (modes, markers)
    shapes: Array
    frequencies: Array  #: In Hz, shape (modes,)
    modes: tuple[int, ...]  #: Their numbers
    #: What is drawn of the structure; empty if only its markers are known, shape (3, corners)
    outline: Array

    @cached_property
    def centre(self) -> Array:
        """Middle of the box around the markers, shape (3,): what all cameras look at."""
        return (self.points.max(axis=1) + self.points.min(axis=1)) / 2

    @property
    def reach(self) -> float:
        """Largest distance of a marker from the centre in m."""
        return float(np.max(np.linalg.norm(self.points - self.centre[:, None], axis=0)))

    def deflected(self, peaks: Sequence[float]) -> Array:
        """Markers at the peaks (m) of the modes, shape (3, modes, markers)."""
        moved = np.asarray(peaks)[:, None] * self.shapes
        return self.points[:, None] + self.normals[:, None] * moved

    def extremes(self, peaks: Sequence[float]) -> Array:
        """Markers at both ends of their largest motion, shape (3, 2, markers).

        What sees both ends sees the whole motion of any of the modes, since images of straight
        lines are straight.
        """
        largest = np.max(np.abs(np.asarray(peaks)[:, None] * self.shapes), axis=0)
        return self.points[:, None] + self.normals[:, None] * np.stack([largest, -largest])


def body_of(structure: Structure, name: str, modes: Sequence[int]) -> Body:
    """A beam or plate as a body in the world frame: its centre is the origin, its normals are +Z.

    Parameters
    ----------
    structure : Structure
        Beam or plate.
    name : str
        What it is called.
    modes : sequence of int
        Numbers of the modes, from 1.
    """
    markers = structure.markers
    half = np.array(structure.extent) / 2
    flat = np.zeros((1, markers.shape[1]))
    corners = np.array([[-1, 1, 1, -1], [-1, -1, 1, 1]]) * half[:, None]
    shapes = [deflection_shape(structure, mode, markers, peak=1.0) for mode in modes]
    hertz = structure.angular_frequencies(max(modes)) / (2 * np.pi)
    return Body(
        name,
        np.concatenate([markers - half[:, None], flat]),
        np.concatenate([flat, flat, flat + 1]),
        np.array(shapes),
        hertz[np.array(modes) - 1],
        tuple(modes),
        np.concatenate([corners, np.zeros((1, 4))]),
    )
