"""The sound of a measured shape, with standard errors that come from the shape's.

The structure lies in a rigid baffle. What its markers do, its surface does
(:mod:`thesis_lib.measure.radiation.between`); pressure and power follow by Rayleigh's integral
(:mod:`thesis_lib.acoustics.surfaces`), their errors from the markers' and from what errors of the
calibration do to all markers together (:mod:`thesis_lib.acoustics.estimates`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr

from thesis_lib.acoustics import estimates
from thesis_lib.acoustics.planes import Plane
from thesis_lib.acoustics.radiating import radiation_modes
from thesis_lib.acoustics.radiation import REFERENCE_POWER, REFERENCE_PRESSURE
from thesis_lib.acoustics.sources import Medium
from thesis_lib.acoustics.surfaces import Surface
from thesis_lib.arrays import Array, ComplexArray
from thesis_lib.measure.radiation.between import Between
from thesis_lib.studies.variables import declared, labelled

CELLS = 1600  # of the surface
PER_WAVE = 8  # cells to the length of a sound wave, at least
MODES = 6  # radiation modes that are told
DECIBEL = 10 / np.log(10)
VARIABLES = declared("""
    frequency(tone) [Hz] frequency
    power(tone) [W] radiated sound power
    power_error(tone) [W] its standard error
    power_level(tone) [dB] sound power level re 1 pW
    power_level_error(tone) [dB] its standard error
    efficiency(tone) [1] power over that of a plane wave of the same area and mean square velocity
    efficiency_error(tone) [1] its standard error
    mode_power(tone, mode) [W] power of a way of moving that radiates without interference, the
        loudest first
    mode_power_error(tone, mode) [W] its standard error
    pressure_real(tone, point) [Pa] complex amplitude of the pressure, exp(+jωt), real part
    pressure_imag(tone, point) [Pa] the same, imaginary part
    pressure_error(tone, point) [Pa] standard error of its absolute value
    level(tone, point) [dB] sound pressure level re 20 µPa
    level_error(tone, point) [dB] its standard error
    field_real(tone, plane, u, z) [Pa] complex amplitude on a plane, real part
    field_imag(tone, plane, u, z) [Pa] the same, imaginary part
    field_error(tone, plane, u, z) [Pa] standard error of its absolute value
    left(tone) [1] rms of what the surface leaves of the markers' amplitudes, over their rms
    left_by_noise(tone) [1] the same by the markers' errors alone
    place(point, axis) [m] where the pressure is, from the structure's centre
    u(u) [m] X on plane XZ, Y on plane YZ
    z(z) [m] height above the structure
    area() [m2] area that radiates
""")


@dataclass(frozen=True)
class Tone:
    """A vibration of one frequency."""

    omega: float  #: In rad/s
    shape: estimates.Amplitudes  #: Of the markers, in m


def radiated(
    surface: Surface,
    between: Between,
    tones: Sequence[Tone],
    points: Array,
    planes: Sequence[Plane],
    medium: Medium,
) -> xr.Dataset:
    """What a surface radiates at some frequencies.

    Parameters
    ----------
    surface : Surface
        What moves, as cells.
    between : Between
        How the cells, or their spots, move by the markers.
    tones : sequence of Tone
        Frequencies and shapes.
    points : ndarray, shape (3, n)
        Where the pressure is wanted, in m from the surface's centre.
    planes : sequence of Plane
        Where the field is wanted; all of one size.
    medium : Medium
        The air.

    Returns
    -------
    xarray.Dataset
        :data:`VARIABLES`.
    """
    every = [_of_tone(surface, between, tone, points, planes, medium) for tone in tones]
    values = {name: np.array([one[name] for one in every]) for name in every[0]}
    values |= {
        "place": points.T,
        "u": planes[0].u,
        "z": planes[0].z,
        "area": np.array(surface.area),
    }
    coords = {
        "plane": ("plane", [plane.name for plane in planes], {"long_name": "plane"}),
        "axis": ("axis", ["x", "y", "z"], {"long_name": "axis of the structure"}),
    }
    own = {name: one for name, one in VARIABLES.items() if name in values}
    return xr.Dataset(labelled(values, own), coords).set_coords(["frequency", "place", "u", "z"])


def _of_tone(
    surface: Surface,
    between: Between,
    tone: Tone,
    points: Array,
    planes: Sequence[Plane],
    medium: Medium,
) -> dict[str, Array]:
    B, omega, shape = between.moving, tone.omega, tone.shape
    form = surface.power_form(B, omega, medium)
    plain = surface.plane_wave_form(B, omega, medium)
    power, efficiency = estimates.quadratic(form, shape), estimates.ratio(form, plain, shape)
    # ‖F w‖² is the power: rows of its radiation modes add up without interference
    values, ways = np.linalg.eigh(form)
    modes = radiation_modes(np.sqrt(np.maximum(values, 0))[:, None] * ways.T)[:MODES]
    each = estimates.factored(modes, shape)
    at = surface.pressure_matrix(B, points, omega, medium)
    here, size = at @ shape.value, estimates.magnitude(at, shape)
    above = [
        surface.pressure_matrix(B, plane.points.reshape(3, -1), omega, medium) for plane in planes
    ]
    shown = (len(planes), *planes[0].shape)
    field = np.array([matrix @ shape.value for matrix in above]).reshape(shown)
    spread = np.array([estimates.magnitude(matrix, shape).error for matrix in above])
    whole = np.linalg.norm(shape.value)
    left, noise = between.left(shape)
    return {
        "frequency": np.array(omega / (2 * np.pi)),
        "power": power.value,
        "power_error": power.error,
        **_levels("power_level", DECIBEL, REFERENCE_POWER, power),
        "efficiency": efficiency.value,
        "efficiency_error": efficiency.error,
        "mode_power": each.value,
        "mode_power_error": each.error,
        "pressure_real": here.real,
        "pressure_imag": here.imag,
        "pressure_error": size.error,
        **_levels("level", 2 * DECIBEL, np.sqrt(2) * REFERENCE_PRESSURE, size),
        "field_real": field.real,
        "field_imag": field.imag,
        "field_error": spread.reshape(shown),
        "left": np.array(left / whole),
        "left_by_noise": np.array(noise / whole),
    }


def _levels(
    name: str, scale: float, reference: float, known: estimates.Estimate
) -> dict[str, Array]:
    """Level in dB and its standard error; NaN where errors are all there is."""
    value = np.where(known.value > 0, known.value, np.nan)
    return {name: scale * np.log(value / reference), f"{name}_error": scale * known.error / value}


def cells_for(extent: tuple[float, float], omega: float, medium: Medium) -> int:
    """How many cells a surface of an extent in m needs."""
    wave = 2 * np.pi * medium.speed_of_sound / omega
    return max(CELLS, int(np.ceil(np.prod([PER_WAVE * side / wave for side in extent]))))


def complex_of(data: xr.Dataset, name: str) -> ComplexArray:
    """Complex values of a variable's two parts."""
    return np.asarray(data[f"{name}_real"].values + 1j * data[f"{name}_imag"].values)
