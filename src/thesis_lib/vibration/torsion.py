"""Torsion of a strip that is clamped at one end: what a force beside its axis does.

Saint-Venant's torsion, GJ θ'' = ρI_p θ̈ between the clamp and the free end, has the shapes
sin((2n − 1)πx / 2L) and the natural frequencies ωₙ = (2n − 1)π / (2L) √(GJ / ρI_p).
"""

from __future__ import annotations

import numpy as np

from thesis_lib.vibration.beam import Beam

POISSON_RATIO = 0.31  # Table 3.1


def torsional_rigidity(beam: Beam, poisson: float = POISSON_RATIO) -> float:
    """Return GJ in N m², with J of a rectangle: b h³/3 (1 − 0.63 h/b (1 − h⁴ / 12b⁴)), h ≤ b."""
    b, h = beam.width, beam.thickness
    shear = beam.youngs_modulus / (2 * (1 + poisson))
    return shear * b * h**3 / 3 * (1 - 0.63 * h / b * (1 - h**4 / (12 * b**4)))


def torsional_inertia(beam: Beam) -> float:
    """Return the polar moment of inertia per length, ρbh (b² + h²) / 12, in kg m."""
    b, h = beam.width, beam.thickness
    return beam.density * b * h * (b**2 + h**2) / 12


def torsional_frequency(beam: Beam, mode: int = 1, poisson: float = POISSON_RATIO) -> float:
    """Return the natural angular frequency in rad/s of a torsional mode."""
    wave = (2 * mode - 1) * np.pi / (2 * beam.length)
    return float(wave * np.sqrt(torsional_rigidity(beam, poisson) / torsional_inertia(beam)))


def tip_twist(
    beam: Beam,
    aside: float,
    omega: float,
    force: float = 1.0,
    modes: int = 1,
    poisson: float = POISSON_RATIO,
) -> float:
    """Return the deflection in m of the tip's edges by a harmonic force beside the axis.

    Parameters
    ----------
    beam : Beam
        The strip.
    aside : float
        Distance of the force from the axis in m; along the beam it acts at its force point.
    omega : float
        Angular frequency in rad/s.
    force : float
        Its amplitude in N.
    modes : int
        Torsional modes that are summed.
    poisson : float
        Poisson's ratio.
    """
    n = np.arange(1, modes + 1)
    wn = np.array([torsional_frequency(beam, int(k), poisson) for k in n])
    drive = np.sin((2 * n - 1) * np.pi * beam.force_position / (2 * beam.length))
    tip = np.sin((2 * n - 1) * np.pi / 2)
    modal_inertia = torsional_inertia(beam) * beam.length / 2
    stiffness = wn**2 - omega**2 + 2j * beam.damping * wn * omega
    angle = np.sum(force * aside * drive * tip / (modal_inertia * stiffness))
    return float(np.abs(angle) * beam.width / 2)
