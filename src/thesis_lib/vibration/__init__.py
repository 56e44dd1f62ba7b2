"""Beams, plates and panels: frequencies, shapes, response, motion.

Start with a structure (:class:`.Beam`, :class:`.Plate`, :class:`.Panel`), its deflection in a mode
(:func:`.deflection_shape`), and the resulting marker positions (:func:`.world_points`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from thesis_lib import load_name
from thesis_lib.vibration.motion import Component, Motion
from thesis_lib.vibration.structure import (
    Beam,
    Plate,
    Structure,
    deflection_shape,
    full_response,
    peak_deflection,
    resonance_frequency,
    single_mode_response,
    world_points,
)

if TYPE_CHECKING:
    from thesis_lib.vibration.panel import Panel

__all__ = ["Beam", "Component", "Motion", "Panel", "Plate", "Structure", "deflection_shape",
           "full_response", "peak_deflection", "resonance_frequency", "single_mode_response",
           "world_points"]  # fmt: skip


def __getattr__(name: str) -> Any:
    """Import `Panel` on first use: it needs SciPy, which the others do not."""
    return load_name(__name__, {"panel": "Panel"}, name)
