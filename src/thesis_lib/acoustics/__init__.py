"""Sound radiation of vibrating plates, and its errors due to deflection errors.

Start with a plate as pistons (:func:`.plate_pistons`), their pressure on a plane
(:class:`.Plane`, :func:`.plane_operator`) or anywhere (:func:`.rayleigh_pressure`), their
:func:`.sound_power`, the errors of both due to deflection errors (:class:`.PlateSound`), the errors
that radiate most (:func:`.radiation_modes`), and radiators of any outline, in a wall
(:class:`.Surface`) or without one (:class:`.Screen`).
"""

from thesis_lib.acoustics.planes import Plane, PlateSound, plane_operator, plate_pistons
from thesis_lib.acoustics.radiation import (
    AIR,
    Medium,
    Pistons,
    power_level,
    pressure_level,
    radiation_modes,
    rayleigh_pressure,
    sound_power,
)
from thesis_lib.acoustics.surfaces import Screen, Surface

__all__ = ["AIR", "Medium", "Pistons", "Plane", "PlateSound", "Screen", "Surface", "plane_operator",
           "plate_pistons", "power_level", "pressure_level", "radiation_modes", "rayleigh_pressure",
           "sound_power"]  # fmt: skip
