"""What is rendered: plate, beam and L-shaped plate, driven by a steady tone at one place.

All are as thin as what such cameras are for: the thesis's plate with another thickness, an L cut
from it, and the thesis's beam. A structure moves in its first :data:`MOVING_MODES` modes, each as
the force drives it (thesis, eq. 3.5).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache, cached_property

import numpy as np

from thesis_lib.arrays import Array, ComplexArray
from thesis_lib.facts import setups
from thesis_lib.figure_sets.lab_radiation.figure_set import LabRadiation
from thesis_lib.laboratory import tracking
from thesis_lib.laboratory.rig import Rig, camera_rig, derive_seed, settle_rig
from thesis_lib.measure.recordings.board import Markers, rows_on
from thesis_lib.vibration.finite_elements import SIMPLY_SUPPORTED
from thesis_lib.vibration.motion import Component
from thesis_lib.vibration.panel import Panel
from thesis_lib.vibration.polygons import Point
from thesis_lib.vibration.structure import Beam, Plate, modal_coordinates, resonance_frequency

MOVING_MODES = 40  # that move
PLATE_THICKNESS_M = 0.003  # m, of the plates
ELEMENT_M = 0.02  # m, of the L
FORCE_PLACE_M = (0.22, 0.22)  # m, where plates are driven: some way from their edges
MARKER_GRID = (7, 5)  # markers along and across the box around a plate
DENSE_GRID = (12, 8)  # the same where a tone between modes moves many of them
PLATE_MARKER, DENSE_MARKER, BEAM_MARKER = 0.024, 0.018, 0.007  # diameters, m
ROW_SPACING, BEAM_COLUMNS = 0.014, 13  # of the beam's two rows
PEAK_PLACES = 41  # places along each side of the box, for the largest deflection


@dataclass(frozen=True)
class Driven:
    """A structure that a force makes vibrate at one frequency."""

    structure: Beam | Plate | Panel
    markers: Markers  #: What is printed on it
    corners: tuple[Point, ...]  #: Of its outline in m, from its box's corner
    frequency: float  #: Of the force, Hz
    name: str  #: What moves

    @cached_property
    def coordinates(self) -> ComplexArray:
        """Of the first modes, for a largest deflection of 1, shape (:data:`MOVING_MODES`,)."""
        q = modal_coordinates(self.structure, np.array(2 * np.pi * self.frequency), MOVING_MODES)
        x, y = (np.linspace(0, side, PEAK_PLACES) for side in self.structure.extent)
        points = np.stack([np.tile(x, PEAK_PLACES), np.repeat(y, PEAK_PLACES)])
        shapes = self.structure.mode_shapes(range(1, MOVING_MODES + 1), points)
        return np.asarray(q / np.nanmax(np.abs(q @ shapes)), complex)

    def shape(self, points: Array) -> ComplexArray:
        """Return complex deflection at points (2, n) for a largest one of 1, against the force."""
        shapes = self.structure.mode_shapes(range(1, MOVING_MODES + 1), points)
        return np.asarray(self.coordinates @ shapes, complex)

    def components(self, peak: float) -> tuple[Component, ...]:
        """Return the modes as parts of a motion whose largest deflection is `peak` in m."""
        parts = []
        for n, q in enumerate(self.coordinates, 1):
            up = (-1) ** (n + 1) if isinstance(self.structure, Beam) else 1  # as a part has it
            size = peak * q * up * self.structure.shape_peak(n)
            at = float(abs(size)), float(np.angle(size))
            parts.append(Component("bending", n, self.frequency, *at))
        return tuple(parts)


def thin_plate(grid: tuple[int, int] = MARKER_GRID) -> Plate:
    """Return the thesis's plate, but thin."""
    return replace(
        setups.thesis_plate(grid), thickness=PLATE_THICKNESS_M, force_position=FORCE_PLACE_M
    )


@cache
def drive_structure(case: str) -> Driven:
    """Return the structure of a case, with its tone."""
    if case == "beam":
        beam = setups.thesis_beam()
        row = replace(beam, n_markers=BEAM_COLUMNS, marker_spacing=beam.length / BEAM_COLUMNS)
        markers = rows_on(row, 2, ROW_SPACING, BEAM_MARKER, None)
        return _drive_at_mode(beam, markers, _box_corners(beam.extent), 3, "beam, third mode")
    flat = thin_plate()
    if case == "l":
        outline = setups.setup_table("shape", "l")["outline_mm"]
        corners = tuple((x / 1000, y / 1000) for x, y in outline)
        material = flat.thickness, flat.density, flat.youngs_modulus, flat.poisson, flat.damping
        edges = (SIMPLY_SUPPORTED,) * len(corners)
        panel = Panel(corners, edges, (), *material, flat.force_position, MARKER_GRID, ELEMENT_M)
        markers = Markers(panel.extent, _select_clear(panel), PLATE_MARKER)
        return _drive_at_mode(panel, markers, corners, 1, "L-shaped plate, first mode")
    markers = Markers(flat.extent, flat.markers, PLATE_MARKER)
    own = _drive_at_mode(flat, markers, _box_corners(flat.extent), 1, "plate, first mode")
    if case == "plate":
        return own
    second = resonance_frequency(flat, 2) / (2 * np.pi)
    between, many = float(np.sqrt(own.frequency * second)), thin_plate(DENSE_GRID)
    dense = Markers(many.extent, many.markers, DENSE_MARKER)
    return Driven(many, dense, own.corners, between, "plate, between two modes")


def _drive_at_mode(
    structure: Beam | Plate | Panel,
    markers: Markers,
    corners: tuple[Point, ...],
    mode: int,
    name: str,
) -> Driven:
    """Drive a structure at the resonance of a mode."""
    hertz = resonance_frequency(structure, mode) / (2 * np.pi)
    return Driven(structure, markers, corners, hertz, name)


def _box_corners(extent: tuple[float, float]) -> tuple[Point, ...]:
    x, y = extent
    return (0.0, 0.0), (x, 0.0), (x, y), (0.0, y)


def _select_clear(panel: Panel) -> Array:
    """Select markers of a panel that are a diameter away from its edges, shape (2, n)."""
    turn = np.linspace(0, 2 * np.pi, 16, endpoint=False)
    ring = PLATE_MARKER * np.stack([np.cos(turn), np.sin(turn)])
    around = panel.markers[:, :, None] + ring[:, None]
    on = panel.covers(around.reshape(2, -1)).reshape(around.shape[1:]).all(axis=1)
    return np.asarray(panel.markers[:, on], float)


def rig_of(study: LabRadiation, case: str, replicate: int) -> Rig:
    """Return what sees one recording: cameras, the board's poses, the structure with its tone."""
    own = drive_structure(case)
    seed = derive_seed(study.seed, case, replicate)
    draw = np.random.default_rng([seed, 7])
    parts = own.components(study.amplitude_mm / 1000)
    rig = camera_rig(
        study, own.structure, study.setting(case), study.frame_rate_hz, parts, seed, own.markers
    )
    rig = tracking.aim_cameras(rig, study.distance_mm(case) / 1000, draw)
    return settle_rig(rig, draw.random(len(study.azimuths_deg)).tolist(), study.frames)
