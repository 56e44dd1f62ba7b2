"""Shapes of the structure's model that a measured shape may be one of."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from thesis_lib.arrays import Array
from thesis_lib.measure.recordings.manifest_parts import StructureSpec
from thesis_lib.vibration.motion import Component
from thesis_lib.vibration.structure import Beam, Plate, resonance_frequency
from thesis_lib.vision.simulation import assurance_criterion

BENDING_MODES, TORSION_MODES, PLATE_MODES = 6, 3, 12  # modes of each kind that are tried


@dataclass(frozen=True)
class Candidate:
    """A mode of the model."""

    name: str  #: What it is called, as ``bending 1``
    #: Frequency in Hz of its displacement resonance by the model; NaN where the model has none
    frequency: float
    shape: Array  #: Its deflection at the markers, of any size, shape (markers,)


def model_of(structure: StructureSpec) -> Beam | Plate | None:
    """Return the clamped beam or simply supported plate of a structure; None without a model."""
    own = {
        "length": structure.length_mm / 1000,
        "width": structure.width_mm / 1000,
        "thickness": structure.thickness_mm / 1000,
        "density": structure.density_kg_m3,
        "youngs_modulus": structure.youngs_modulus_pa,
        "damping": structure.damping,
    }
    along, markers = structure.force_position_mm / 1000, structure.markers
    if structure.kind == "beam":
        spacing = markers.spacing_mm / 1000
        return Beam(**own, force_position=along, n_markers=markers.columns, marker_spacing=spacing)
    if structure.kind == "plate":
        across = (structure.force_across_mm or structure.width_mm / 2) / 1000
        return Plate(
            **own,
            poisson=structure.poissons_ratio,
            force_position=(along, across),
            grid=(markers.columns, markers.rows),
        )
    return None


def candidate_modes(structure: StructureSpec) -> list[Candidate]:
    """Return the modes to compare a measured shape with; none without a model."""
    points, model = structure.marker_points, model_of(structure)
    found = []
    if isinstance(model, Beam):
        kinds = [("bending", n) for n in range(1, BENDING_MODES + 1)]
        kinds += [("torsion", n) for n in range(1, TORSION_MODES + 1)]
        found = [
            Candidate(
                f"{kind} {n}",
                resonance_frequency(model, n) / (2 * np.pi) if kind == "bending" else np.nan,
                Component(kind, n).shape(model, points),
            )
            for kind, n in kinds
        ]
    elif model is not None:
        found = [
            Candidate(
                f"mode ({pair[0]}, {pair[1]})",
                resonance_frequency(model, n) / (2 * np.pi),
                Component("bending", n).shape(model, points),
            )
            for n, pair in enumerate(model.mode_indices(PLATE_MODES), 1)
        ]
    # Markers on a line of no motion, as those of one row in torsion, see nothing of a mode.
    return [one for one in found if np.abs(one.shape).max() > 1e-9]


def scale_model(measured: Array, shape: Array) -> Array:
    """Scale the model's shape to fit the measured one best, shape (markers,), m."""
    known = np.isfinite(measured)
    w, phi = measured[known], shape[known]
    return np.asarray(shape * float(np.sum(w * phi) / np.sum(phi * phi)), float)


def compare_modes(shape: Array, modes: list[Candidate]) -> tuple[dict[str, Any], str]:
    """Compare a measured shape (markers,) in m with the model's modes.

    Returns
    -------
    dict
        What of the result tells of it, by the names of variables.
    str
        Name of the most similar mode; empty without a model.
    """
    mac = np.array([assurance_criterion(shape, mode.shape) for mode in modes])
    best = modes[int(np.nanargmax(mac))] if np.isfinite(mac).any() else None
    reference = scale_model(shape, best.shape) if best else np.full_like(shape, np.nan)
    with np.errstate(invalid="ignore", divide="ignore"):
        error = 100 * np.abs(shape - reference) / np.abs(reference).max()
    values = {
        "mac": mac,
        "model_frequency": [mode.frequency for mode in modes],
        "reference_deflection": reference,
        "point_error": error,
        "mean_error": known_rms(error),
    }
    return values, best.name if best else ""


def known_rms(values: Array) -> float:
    """Return the root mean square of what is known; NaN if nothing is."""
    known = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(known**2))) if known.size else np.nan
