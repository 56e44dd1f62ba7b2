"""Shapes of the structure's model that a measured shape may be one of."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from thesis_lib.arrays import Array
from thesis_lib.measure.recordings.manifest_model import Structure
from thesis_lib.vibration.motion import Component
from thesis_lib.vibration.structure import resonance

BENDING, TORSION, PLATE = 6, 3, 12  # modes of each kind that are tried


@dataclass(frozen=True)
class Candidate:
    """A mode of the model."""

    name: str  #: What it is called, as ``bending 1``
    #: Frequency in Hz of its displacement resonance by the model; NaN where the model has none
    frequency: float
    shape: Array  #: Its deflection at the markers, of any size, shape (markers,)


def candidates(structure: Structure) -> list[Candidate]:
    """The modes that a measured shape is compared with; none for a flat structure without model."""
    points = structure.marker_points
    if structure.kind == "beam":
        beam = structure.beam
        kinds = [("bending", n) for n in range(1, BENDING + 1)]
        kinds += [("torsion", n) for n in range(1, TORSION + 1)]
        found = [
            Candidate(
                f"{kind} {n}",
                resonance(beam, n) / (2 * np.pi) if kind == "bending" else np.nan,
                Component(kind, n).shape(beam, points),
            )
            for kind, n in kinds
        ]
    elif structure.kind == "plate":
        plate = structure.plate
        pairs = plate.mode_indices(PLATE)
        found = [
            Candidate(
                f"mode ({pair[0]}, {pair[1]})",
                resonance(plate, n) / (2 * np.pi),
                Component("bending", n).shape(plate, points),
            )
            for n, pair in enumerate(pairs, 1)
        ]
    else:
        found = []
    # Markers on a line of no motion, as those of one row in torsion, see nothing of a mode.
    return [one for one in found if np.abs(one.shape).max() > 1e-9]


def scaled(measured: Array, shape: Array) -> Array:
    """The model's shape in the size that fits the measured one best, shape (markers,), m."""
    known = np.isfinite(measured)
    w, phi = measured[known], shape[known]
    return np.asarray(shape * float(np.sum(w * phi) / np.sum(phi * phi)), float)
