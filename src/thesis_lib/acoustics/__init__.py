"""What a vibrating plate radiates, and what errors of its deflection do to that.

To start from: a plate as pistons (:func:`pistons`), the pressure that they make on a plane
(:class:`Plane`, :func:`operator`) or anywhere (:func:`rayleigh`), and their :func:`sound_power`.
"""

from thesis_lib.acoustics.planes import Plane, operator, pistons
from thesis_lib.acoustics.radiation import power_level, pressure_level, rayleigh, sound_power
from thesis_lib.acoustics.sources import AIR, Medium, Pistons

__all__ = ["AIR", "Medium", "Pistons", "Plane", "operator", "pistons", "power_level",
           "pressure_level", "rayleigh", "sound_power"]  # fmt: skip
