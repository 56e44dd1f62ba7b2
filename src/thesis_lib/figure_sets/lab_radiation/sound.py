"""What a driven structure radiates: as it moves in truth, and by what its markers tell."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from thesis_lib.acoustics import estimates
from thesis_lib.acoustics.estimates import Amplitudes, Estimate, stacked_matrix
from thesis_lib.acoustics.planes import Plane
from thesis_lib.acoustics.sources import Medium
from thesis_lib.acoustics.surfaces import Surface
from thesis_lib.arrays import Array, ComplexArray
from thesis_lib.figure_sets.lab_radiation.structures import MODES, Driven
from thesis_lib.measure.radiation.between import Between, by_model
from thesis_lib.measure.radiation.radiated import count_nodes
from thesis_lib.measure.recordings.markers import Markers
from thesis_lib.vibration.plate import Plate

TRUE_NODES = 3600  # of the true surface
ROUND = 32  # places on a marker's edge
PLANE = Plane("XZ", 0.4, 0.05, 0.55, (41, 26))


@dataclass(frozen=True)
class Truth:
    """What a structure radiates as it moves."""

    power: float  #: In W
    efficiency: float
    field: ComplexArray  #: Pressure on :data:`PLANE` in Pa, shape (places,)


def truth(own: Driven, peak: float, medium: Medium) -> Truth:
    """The sound of the true motion, whose largest deflection is `peak` in m, on a fine grid.

    Its nodes are more than twice as many as those of a measurement, which leaves a fifth of the
    error of their sum.
    """
    surface, omega = _surface(own, TRUE_NODES), 2 * np.pi * own.frequency
    shapes = own.structure.mode_shapes(range(1, MODES + 1), surface.places)
    moving, q = shapes.T, peak * own.coordinates
    power = _of(surface.power_form(moving, omega, medium), q)
    plain = _of(surface.plane_wave_form(moving, omega, medium), q)
    matrix = surface.pressure_matrix(moving, PLANE.points.reshape(3, -1), omega, medium)
    return Truth(power, power / plain, matrix @ q)


@dataclass(frozen=True)
class Heard:
    """What the markers of a structure tell of its sound."""

    own: Driven
    medium: Medium

    @cached_property
    def between(self) -> Between:
        """How the surface moves by its markers: by the first modes of its model."""
        markers = self.own.markers
        return by_model(
            self.own.structure, markers.centres, markers.diameter / 2, self._surface.places
        )

    @cached_property
    def _surface(self) -> Surface:
        extent = self.own.structure.extent
        return _surface(self.own, count_nodes(extent, self._omega, self.medium))

    @property
    def _omega(self) -> float:
        return 2 * np.pi * self.own.frequency

    @cached_property
    def power_form(self) -> Array:
        """Form of the power, shape (markers, markers)."""
        return self._surface.power_form(self.between.moving, self._omega, self.medium)

    @cached_property
    def plain_form(self) -> Array:
        """Form of the power of a plane wave of the same motion."""
        return self._surface.plane_wave_form(self.between.moving, self._omega, self.medium)

    @cached_property
    def matrix(self) -> ComplexArray:
        """Pressure on :data:`PLANE`, shape (places, markers)."""
        points = PLANE.points.reshape(3, -1)
        return self._surface.pressure_matrix(self.between.moving, points, self._omega, self.medium)

    @cached_property
    def _squares(self) -> Array:
        """Form of the mean square of a pressure on the plane, of stacked amplitudes."""
        stacked = stacked_matrix(self.matrix)
        return np.asarray(stacked.T @ stacked / len(self.matrix))

    def power(self, shape: Amplitudes) -> Estimate:
        """Sound power in W."""
        return self._widened(estimates.quadratic(self.power_form, shape))

    def efficiency(self, shape: Amplitudes) -> Estimate:
        """Radiation efficiency."""
        return self._widened(estimates.ratio(self.power_form, self.plain_form, shape))

    def _widened(self, of: Estimate) -> Estimate:
        return estimates.widened(of, self._surface.sum_std)

    def field_error(self, shape: Amplitudes) -> float:
        """Stated rms error of the pressure over the plane, in Pa."""
        return float(np.sqrt(np.sum(self._squares * shape.covariance)))

    def without_noise(self, peak: float) -> ComplexArray:
        """What markers show of the true motion, by their edges, shape (markers,)."""
        turn = 2 * np.pi * (np.arange(ROUND) + 0.5) / ROUND
        ring = self.own.markers.diameter / 2 * np.stack([np.cos(turn), np.sin(turn)])
        edges = (self.own.markers.centres[:, :, None] + ring[:, None]).reshape(2, -1)
        return peak * self.own.shape(edges).reshape(-1, ROUND).mean(axis=1)


def with_grid(own: Driven, grid: tuple[int, int]) -> Driven:
    """A plate with other markers, at most as large as its own and half as wide as their cells."""
    assert isinstance(own.structure, Plate)
    cells = np.array(own.structure.extent) / grid
    structure = replace(own.structure, grid=grid)
    diameter = min(own.markers.diameter, 0.5 * float(cells.min()))
    markers = Markers(structure.extent, structure.markers, diameter)
    return replace(own, structure=structure, markers=markers)


def _surface(own: Driven, nodes: int) -> Surface:
    x, y = own.structure.extent
    return Surface.of(np.array(own.corners), nodes, (x / 2, y / 2))


def _of(form: Array, amplitudes: ComplexArray) -> float:
    return float(np.real(np.conj(amplitudes) @ form @ amplitudes))
