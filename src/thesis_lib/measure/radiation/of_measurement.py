"""The sound of a measurement: its shape, its errors, and what the manifest asks for."""

from __future__ import annotations

import numpy as np
import xarray as xr

from thesis_lib.acoustics import estimates
from thesis_lib.acoustics.planes import Plane
from thesis_lib.acoustics.surfaces import Surface
from thesis_lib.arrays import Array, ComplexArray
from thesis_lib.measure.fitting.models import model_of
from thesis_lib.measure.fitting.result import size_off
from thesis_lib.measure.radiation import between as interpolation
from thesis_lib.measure.radiation.between import Between
from thesis_lib.measure.radiation.radiated import Tone, cells_for, complex_of, radiated
from thesis_lib.measure.recordings.check import ChainError
from thesis_lib.measure.recordings.manifest_model import Manifest, Structure
from thesis_lib.measure.recordings.radiation_fields import FEWEST, Radiation

FLAT = 0.02  # of the longer side that markers may be off their plane at rest
FITS = 3.0  # times what noise explains, up to which a model's modes are taken for the shape
SHAPE = (61, 41)  # points of a plane


def sound_of(data: xr.Dataset, manifest: Manifest) -> xr.Dataset:
    """What the measured structure radiates.

    Parameters
    ----------
    data : xarray.Dataset
        What :func:`~thesis_lib.measure.fitting.result.result` returns, if it is known with the
        calibration's covariance.
    manifest : Manifest
        With ``radiation``.

    Returns
    -------
    xarray.Dataset
        As of :func:`.radiated`; its attributes tell what was assumed.

    Raises
    ------
    ChainError
        If too few markers were measured, or the structure is not flat.
    """
    asked, structure = manifest.radiation, manifest.structure
    assert asked is not None
    amplitude = complex_of(data, "amplitude")
    known = np.isfinite(amplitude) & np.isfinite(data["standard_error"].values)
    _check(data, known, structure)
    markers = structure.marker_points[:, known]
    size = structure.length_mm / 1000, structure.width_mm / 1000
    diameter = structure.markers.diameter_mm / 1000
    corners = asked.corners(size, structure.marker_points, diameter)
    omega = 2 * np.pi * float(data["frequency"])
    count = cells_for(tuple(np.ptp(corners, axis=0)), omega, asked.medium)
    surface = Surface.of(corners, count, (size[0] / 2, size[1] / 2))
    none = np.zeros((0, amplitude.size), complex)  # of a calibration whose errors are unknown
    common = complex_of(data, "shared") if "shared_real" in data else none
    shape = _amplitudes(data, amplitude, known, common)
    between = _chosen(asked, structure, surface, corners, markers, shape)
    made = radiated(
        surface, between, [Tone(omega, shape)], asked.points, _planes(asked, size), asked.medium
    )
    step = interpolation.spacing(markers)
    told = {
        "between": between.kind,
        "modes": between.modes,
        "spacing": step,
        "highest": _highest(structure, step),
        "outline": np.ravel(1000 * corners),
        "held": len(asked.held(structure.kind, len(corners))),
        "speed_of_sound": asked.speed_of_sound_m_s,
        "air_density": asked.air_density_kg_m3,
    }
    return made.assign_attrs(told)


def _check(data: xr.Dataset, known: Array, structure: Structure) -> None:
    if known.sum() < FEWEST:
        raise ChainError(
            f"radiation: {known.sum()} markers were measured, allowed: {FEWEST} or more; fewer do "
            "not tell how the surface between them moves"
        )
    off = 1000 * float(np.max(np.abs(data["rest_position"].sel(axis="z").values[known])))
    most = FLAT * max(structure.length_mm, structure.width_mm)
    if off > most:
        raise ChainError(
            f"radiation: a marker is {off:.1f} mm off the plane of the others at rest, allowed: "
            f"{most:.2g} mm; Rayleigh's integral is for flat structures, leave radiation out"
        )


def _amplitudes(
    data: xr.Dataset, amplitude: ComplexArray, known: Array, common: ComplexArray
) -> estimates.Amplitudes:
    """The shape with the covariance of its errors: each marker's own, and what they share.

    An error of size, where the grid does not fit, is shared.
    """
    scatter = data["error_of_scatter"].values[known]
    wide = max(float(np.nan_to_num(data["in_plane_excess"])), 1.0)
    size = size_off(float(data["grid_scale"])) * amplitude[known]
    rows = np.concatenate([common[:, known], size[None]])
    return estimates.circular(amplitude[known], (wide * scatter) ** 2, rows)


def _chosen(
    asked: Radiation,
    structure: Structure,
    surface: Surface,
    corners: Array,
    markers: Array,
    shape: estimates.Amplitudes,
) -> Between:
    """How the surface moves between markers: by the model if that fits, else by a spline."""
    model = model_of(structure) if asked.outline_mm == "structure" else None
    if model is not None and asked.between != "spline":
        radius = structure.markers.diameter_mm / 2000
        found = interpolation.by_model(model, markers, radius, surface.spots)
        left, noise = found.left(shape)
        if asked.between == "model" or left <= FITS * noise:
            return found
    step = interpolation.spacing(markers)
    held = interpolation.along(corners, asked.held(structure.kind, len(corners)), step)
    return interpolation.by_spline(markers, held, surface.spots)


def _planes(asked: Radiation, size: tuple[float, float]) -> tuple[Plane, Plane]:
    half = (asked.plane_half_width_mm or 1000 * max(size)) / 1000
    low = asked.plane_bottom_mm / 1000
    high = asked.plane_top_mm / 1000 if asked.plane_top_mm else low + max(size)
    return Plane("XZ", half, low, high, SHAPE), Plane("YZ", half, low, high, SHAPE)


def _highest(structure: Structure, step: float) -> float:
    """Frequency in Hz of the flexural wave that is two spacings long, by the manifest's material.

    ω = k² √(D/m) with k = π over the spacing.
    """
    thickness, nu = structure.thickness_mm / 1000, structure.poissons_ratio
    stiffness = structure.youngs_modulus_pa * thickness**2 / (12 * (1 - nu**2))
    ratio = np.sqrt(stiffness / structure.density_kg_m3)
    return float((np.pi / step) ** 2 * ratio / (2 * np.pi))
