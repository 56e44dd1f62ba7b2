"""What is measured of the plate: deflections at the maximum of its vibration."""

from __future__ import annotations

import numpy as np

from thesis_lib.arrays import Array, ComplexArray
from thesis_lib.vibration.plate import Plate
from thesis_lib.vibration.structure import deflection_shape


def at_maximum(plate: Plate, mode: int, motion: ComplexArray) -> Array:
    """Deflections at their maximum, from complex amplitudes (..., markers), m.

    The common phase is that of their product with the shape of the mode.
    """
    shape = deflection_shape(plate, mode, plate.markers, 1.0)
    phase = np.angle(np.nansum(motion * shape, axis=-1, keepdims=True))
    return np.asarray(np.real(motion * np.exp(-1j * phase)))
