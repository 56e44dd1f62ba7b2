"""Sound radiation of a measurement, as its manifest requests, and its files."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import scipy
import xarray as xr

from thesis_lib.acoustics import estimates, surfaces
from thesis_lib.acoustics.planes import Plane
from thesis_lib.arrays import Array, Mask
from thesis_lib.measure.fitting.result import model_of, scale_error
from thesis_lib.measure.radiation import radiated
from thesis_lib.measure.recordings import manifest_parts, text_files, validation
from thesis_lib.measure.recordings.manifest import Manifest
from thesis_lib.studies import storage
from thesis_lib.studies.cubes import complex_of, iterate_slices

MAX_FLATNESS_RATIO = 0.02  # markers' distance from their plane at rest over the longer side
# Largest residual of a fitted model, over that expected from noise, at which the model is used
MAX_MODEL_CHI = 3.0
PLANE_SHAPE = (61, 41)  # points of a plane
SOUND_RATE_HZ, SOUND_LENGTH_S = 48000, 4.0  # samples per second; length of a sound file, s
FADE_S, RISE_S = 0.05, 0.005  # s; fade in and out, and fade in of decays


def sound_of(data: xr.Dataset, manifest: Manifest) -> xr.Dataset:
    """Compute the sound that the measured structure radiates, as the manifest requests.

    `data` is what :func:`thesis_lib.measure.fitting.result.shape_result` returns, or
    :func:`thesis_lib.measure.modes.identify.modes_result`, with the calibration's covariance if
    that is known. The result joins those of :func:`.radiate_sound`, in a rigid wall, and of
    :func:`.estimate_change`, without one; its attributes state the assumptions.

    Raises
    ------
    ChainError
        If too few markers were measured, or the structure is not flat.
    """
    asked, structure = manifest.radiation, manifest.structure
    assert asked is not None
    several = data
    if "mode" not in data.dims:  # the shape of one sine, in the form of several modes
        wide = max(float(np.nan_to_num(data["in_plane_excess"])), 1.0)
        several = data.assign(error_of_scatter=wide * data["error_of_scatter"]).expand_dims("mode")
    amplitude = complex_of(several, "amplitude")
    known = np.all(np.isfinite(amplitude) & np.isfinite(several["standard_error"].values), axis=0)
    _check(data, known, structure)
    markers = structure.marker_points[:, known]
    size, corners = structure.extent, asked.corners(structure)
    omegas = (2 * np.pi * several["frequency"].values).tolist()
    count = radiated.count_nodes(tuple(np.ptp(corners, axis=0)), max(omegas), asked.medium)
    surface = surfaces.Surface.from_outline(corners, count, (size[0] / 2, size[1] / 2))
    shapes = shapes_of(several, known)
    screens = [surfaces.Screen.from_outline(corners, cells) for cells in radiated.SCREEN_CELLS]
    every = surface.places, *(screen.places for screen in screens)
    both = _choose_motion(asked, structure, np.concatenate(every, axis=1), corners, markers, shapes)
    ends = np.cumsum([one.shape[1] for one in every])
    moving, *others = np.split(both.moving, ends[:-1])
    between = replace(both, moving=moving)
    half = (asked.plane_half_width_mm or 1000 * max(size)) / 1000
    low = asked.plane_bottom_mm / 1000
    high = asked.plane_top_mm / 1000 if asked.plane_top_mm else low + max(size)
    planes = [Plane(name, half, low, high, PLANE_SHAPE) for name in ("XZ", "YZ")]
    whole = omegas, shapes, asked.points, planes, asked.medium, decays_of(several)
    made = radiated.radiate_sound(surface, between, *whole)
    change = radiated.estimate_change(
        surface,
        moving,
        [*zip(screens, others, strict=True)],
        omegas,
        shapes,
        asked.medium,
        float(np.ptp(corners, axis=0).min()),
        structure.thickness_mm / 1000,
    )
    step = radiated.largest_gap(markers)
    # The flexural wave two spacings long: ω = k² √(D/m) with k = π / spacing.
    thickness, nu = structure.thickness_mm / 1000, structure.poissons_ratio
    stiffness = structure.youngs_modulus_pa * thickness**2 / (12 * (1 - nu**2))
    fastest = (np.pi / step) ** 2 * np.sqrt(stiffness / structure.density_kg_m3)
    told = {
        "between": between.kind,
        "modes": between.modes,
        "spacing": step,
        "highest": float(fastest / (2 * np.pi)),
        "outline": np.ravel(1000 * corners),
        "wall": asked.wall,
        "held": len(asked.held_edges(structure.kind)),
        "speed_of_sound": asked.speed_of_sound_m_s,
        "air_density": asked.air_density_kg_m3,
    }
    if "decay" in made:
        told["moment"] = float(data["zero"])
    return made.merge(change).assign_attrs(told)


def decays_of(data: xr.Dataset) -> Array | None:
    """Return decay rates in 1/s and their errors, as :func:`.radiate_sound` takes them.

    `data` is what :func:`thesis_lib.measure.modes.identify.modes_result` returns, or the shape of
    one sine. Return None if nothing decays.
    """
    if not data.get("damping", np.zeros(1)).any():
        return None
    rates = 2 * np.pi * data["frequency"] * data[["damping", "damping_deviation"]]
    return np.array([*rates.data_vars.values(), data["scale_deviation"]])


def _check(data: xr.Dataset, known: Mask, structure: manifest_parts.StructureSpec) -> None:
    if known.sum() < manifest_parts.MIN_SURFACE_MARKERS:
        raise validation.ChainError(
            f"radiation: {known.sum()} markers were measured, allowed: "
            f"{manifest_parts.MIN_SURFACE_MARKERS} or more; fewer do not tell how the surface "
            "between them moves"
        )
    off = 1000 * float(np.max(np.abs(data["rest_position"].sel(axis="z").values[known])))
    most = MAX_FLATNESS_RATIO * max(structure.length_mm, structure.width_mm)
    if off > most:
        raise validation.ChainError(
            f"radiation: a marker is {off:.1f} mm off the plane of the others at rest, allowed: "
            f"{most:.2g} mm; Rayleigh's integral is for flat structures, leave radiation out"
        )


def shapes_of(data: xr.Dataset, known: Mask) -> estimates.Amplitudes:
    """Return all shapes with their covariance, from each marker's errors and common errors.

    Common errors are those of the calibration, and of the scale where the grid does not fit. An
    uncertain decay rate makes a whole shape too large, or turns its phase. `data` is that of
    :func:`thesis_lib.measure.modes.identify.modes_result`, of which `known` markers are used;
    amplitudes are in m, mode after mode.
    """
    amplitude = complex_of(data, "amplitude")[:, known]
    rows = [scale_error(float(data["grid_scale"].values.flat[0])) * amplitude[None]]
    if "shared_real" in data:  # else the errors of the calibration are unknown
        shared = complex_of(data.transpose("row", "mode", "marker", ...), "shared")
        rows.append(shared[:, :, known])
    if "scale_deviation" in data:
        each = np.eye(len(amplitude))[:, :, None]
        own = each * data["scale_deviation"].values[:, None] * amplitude
        rows += [own, 1j * own]
    every = np.concatenate(rows).reshape(-1, amplitude.size)
    variance = data["error_of_scatter"].values[:, known] ** 2
    return estimates.circular_estimate(amplitude.ravel(), variance.ravel(), every)


def _choose_motion(
    asked: manifest_parts.Radiation,
    structure: manifest_parts.StructureSpec,
    places: Array,
    corners: Array,
    markers: Array,
    shapes: estimates.Amplitudes,
) -> radiated.SurfaceModel:
    """Interpolate the markers' motion to places (2, n): by a model if it fits, else a spline."""
    model = model_of(structure) if asked.outline_mm == "structure" else None
    if model is not None and asked.between != "spline":
        # Measured shapes are corrected for the size of the markers: they move as points.
        found = radiated.fit_model(model, markers, 0.0, places)
        each = np.arange(len(shapes.value)).reshape(-1, markers.shape[1])
        left = np.array([found.left(shapes.part(own)) for own in each])
        if asked.between == "model" or np.all(left[:, 0] <= MAX_MODEL_CHI * left[:, 1]):
            return found
    step = radiated.largest_gap(markers)
    held = radiated.edge_places(corners, asked.held_edges(structure.kind), step)
    return radiated.fit_spline(markers, held, places)


def write_sound(folder: Path, data: xr.Dataset) -> None:
    """Write the sound as netCDF, CSV and WAV files into an existing folder."""
    storage.write_netcdf(data, folder / "radiated.nc")
    text_files.write_csv(sound_table(data), folder / "radiated.csv", "%.6g")
    for number in range(data.sizes["point"]):
        samples = audible_pressure(data, number).astype(np.float32)
        scipy.io.wavfile.write(folder / f"heard-{number + 1}.wav", SOUND_RATE_HZ, samples)


def audible_pressure(data: xr.Dataset, point: int) -> Array:
    """Return the time signal of the pressure in Pa at a point, of all sines, faded in and out.

    Sines have their measured phases. Modes decay from the moment that their amplitudes refer to.
    """
    times = np.arange(int(SOUND_RATE_HZ * SOUND_LENGTH_S)) / SOUND_RATE_HZ
    pressure = complex_of(data, "pressure")[:, point]
    decay = np.maximum(data.get("decay", 0 * data["frequency"]).values, 0)
    waves = np.exp((2j * np.pi * data["frequency"].values - decay)[:, None] * times)
    rise = RISE_S if np.any(decay) else FADE_S
    fade = np.clip(np.minimum(times / rise, (SOUND_LENGTH_S - times) / FADE_S), 0, 1)
    return np.asarray(np.real(pressure @ waves) * fade)


def sound_table(data: xr.Dataset) -> pd.DataFrame:
    """Return a table of all quantities with their standard errors, one quantity a row."""
    rows: list[tuple[object, ...]] = []

    def add_rows(of: object, one: xr.Dataset, names: Sequence[str], what: object = "") -> None:
        for name in names:
            errors = [one[own] for own in (f"{name}_error", f"{name}_std") if own in one]
            error = float(errors[0]) if errors else np.nan
            rows.append((of, name, what, float(one[name]), error, one[name].units))

    for one in iterate_slices(data, "tone"):
        hertz = f"{float(one['frequency']):.6g}"
        names = ["power", "power_level", "efficiency", *(["energy"] if "energy" in one else [])]
        add_rows(hertz, one, [*names, "no_wall_change", "no_wall_below"])
        for number, mode in enumerate(iterate_slices(one, "mode"), 1):
            add_rows(hertz, mode, ["mode_power"], number)
        for here in iterate_slices(one, "point"):
            pressure = here.assign(pressure=absolute_pressure(here))
            add_rows(hertz, pressure, ["pressure", "level"], format_point(here))
    for band in data["band"].values if data.sizes["tone"] > 1 else ():
        one = data.sel(band=band)
        add_rows(band, one, ["band_power", "band_power_level"])
        for here in iterate_slices(one, "point"):
            add_rows(band, here, ["band_level"], format_point(here))
    names = ["frequency_hz", "quantity", "mode_or_point_mm", "value", "standard_error", "unit"]
    return pd.DataFrame(rows, columns=names)


def format_point(one: xr.Dataset) -> str:
    """Format the position of a point, in mm."""
    return " ".join(f"{1000 * x:g}" for x in one["place"].values)


def absolute_pressure(one: xr.Dataset) -> xr.DataArray:
    """Return the absolute value of a pressure."""
    return abs(one["pressure_real"] + 1j * one["pressure_imag"]).assign_attrs(units="Pa")
