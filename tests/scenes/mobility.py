"""Velocity over force where a structure is driven."""

import numpy as np

from thesis_lib.vibration.structure import modal_coordinates


def drive_point_mobility(structure, omega, n_modes):
    """jω Σ qₙ φₙ(x_F) / F in m/(N s), of the first modes."""
    drive = structure.mode_shapes(range(1, n_modes + 1), structure.force_point)[:, 0]
    return 1j * omega * np.tensordot(drive, modal_coordinates(structure, omega, n_modes), axes=1)
