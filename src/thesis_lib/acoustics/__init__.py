"""What a vibrating plate radiates, and what errors of its deflection do to that.

To start from: a plate as pistons (:func:`.pistons`), the pressure that they make on a plane
(:class:`.Plane`, :func:`.operator`) or anywhere (:func:`.rayleigh`), their :func:`.sound_power`,
what errors of the deflection do to both (:class:`.PlateSound`), and which errors are heard
(:func:`.radiation_modes`).
"""

from thesis_lib.acoustics.planes import Plane, PlateSound, plane_operator, plate_pistons
from thesis_lib.acoustics.radiation import (
    power_level,
    pressure_level,
    rayleigh_pressure,
    sound_power,
)
from thesis_lib.acoustics.sources import AIR, Medium, Pistons

__all__ = ["AIR", "Medium", "Pistons", "Plane", "PlateSound", "plane_operator", "plate_pistons",
           "power_level", "pressure_level", "rayleigh_pressure", "sound_power"]  # fmt: skip
