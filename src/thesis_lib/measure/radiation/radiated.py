"""Sound radiation of measured shapes, with standard errors propagated from the shapes.

The motion of the surface is a linear function of the markers' motion. With a model of the
structure, its first modes are fitted to the markers, as many as these can distinguish. Tracking
fits the edge of a marker, so motion that is not corrected for this is compared with the mean of a
mode around that edge. Without a model, a thin plate spline (J. Duchon, 1977) goes through all
markers, and is zero on supported edges.

The structure lies in a rigid wall. Pressure and power follow by Rayleigh's integral
(:mod:`thesis_lib.acoustics.surfaces`), their errors from those of the markers and from calibration
errors, common to all markers and sines (:mod:`thesis_lib.acoustics.estimates`).

Powers of sines add up over times that are long compared with their beats. A decaying mode counts as
a sine with its amplitude at one moment: a time t later its power is W e^(−2αt), its total energy
W / 2α.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import scipy
import xarray as xr

from thesis_lib.acoustics import estimates, radiation, surfaces
from thesis_lib.acoustics.planes import Plane
from thesis_lib.arrays import Array, ArrayLike, ComplexArray, IntArray
from thesis_lib.studies.schema import label_values, read_variables, split_complex
from thesis_lib.vibration.panel import Panel
from thesis_lib.vibration.structure import Beam, Plate

Model = Beam | Plate | Panel
MARKERS_PER_WAVE = 3  # per wavelength of the shortest fitted mode
MAX_CONDITION_NUMBER = 30.0  # largest condition number of a fit
EDGE_POINTS = 12  # places on a marker's edge
MAX_TRIED_MODES = 60
OCTAVE_RATIO = 10**0.3  # base ten, as in the standard
NOMINAL_CENTRES_HZ = (16, 31.5, 63, 125, 250, 500, 1000, 2000, 4000, 8000, 16000)
ALL_TONES = "all"
MIN_SURFACE_NODES = 1600  # at least
NODES_PER_WAVELENGTH = 8  # nodes per acoustic wavelength, at least
LISTED_RADIATION_MODES = 6  # in a result
DECIBELS_PER_NEPER = 10 / np.log(10)
VARIABLES = read_variables(__file__, "sound")
#: Cells of the screen, and of a coarser one for the discretisation error: 0.1 dB or less
SCREEN_CELLS = (400, 200)
NO_WALL_VARIABLES = read_variables(__file__, "without_wall")


@dataclass(frozen=True)
class SurfaceModel:
    """Linear interpolation of the surface's motion from its markers'."""

    kind: Literal["model", "spline"]
    #: Matrix from the markers' displacements to places', (..., markers) for places (2, ...)
    moving: Array
    #: Matrix from the markers' displacements to fitted ones, (markers, markers); a spline predicts
    #: each marker from the others
    fitted: Array
    modes: int = 0  #: Number of fitted modes of a model

    def left(self, of: estimates.Amplitudes) -> tuple[float, float]:
        """Return the norm of the residuals, and its rms expected from errors alone, in m.

        A spline's residual at a marker is that of its prediction from the others.
        """
        D = np.kron(np.eye(2), np.eye(len(self.fitted)) - self.fitted)
        noise = np.sqrt(np.sum((D @ of.covariance) * D))
        return float(np.linalg.norm(of.value - self.fitted @ of.value)), float(noise)


def largest_gap(markers: Array) -> float:
    """Return the largest distance in m between neighbouring markers (2, n).

    Distances along and across the structure count separately: closely spaced rows of sparse markers
    do not resolve shorter waves along the rows.
    """
    x, y = np.abs(markers[:, :, None] - markers[:, None])
    distance = np.hypot(x, y)
    np.fill_diagonal(distance, np.inf)
    sides = [np.where(side, distance, np.inf).min(axis=1) for side in (x >= y, x < y)]
    return float(max(np.max(side, initial=0, where=np.isfinite(side)) for side in sides))


def fit_model(model: Model, markers: Array, radius: float, places: Array) -> SurfaceModel:
    """Interpolate by a model's first modes, from markers (2, n) to places (2, ...)."""
    waves = 2 * np.pi / (MARKERS_PER_WAVE * largest_gap(markers))
    turn = 2 * np.pi * (np.arange(EDGE_POINTS) + 0.5) / EDGE_POINTS
    circle = radius * np.stack([np.cos(turn), np.sin(turn)])
    edge = _inside(model, markers[:, :, None] + circle[:, None], markers)
    shown = _shapes(model, edge.reshape(2, -1), waves).reshape(-1, markers.shape[1], EDGE_POINTS)
    A = np.mean(shown, axis=2).T
    count = max(1, min(A.shape[1], len(A) // 2))  # else noise would be fitted, too
    while count > 1 and np.linalg.cond(A[:, :count]) > MAX_CONDITION_NUMBER:
        count -= 1
    fit = np.linalg.pinv(A[:, :count])
    flat = places.reshape(2, -1)
    at = _shapes(model, _inside(model, flat, flat), waves)[:count].T
    moving = (at @ fit).reshape(*places.shape[1:], markers.shape[1])
    return SurfaceModel("model", moving, A[:, :count] @ fit, count)


def _inside(model: Model, points: Array, instead: Array) -> Array:
    """Return points (2, ...), replaced by `instead` where a panel does not cover them."""
    if not isinstance(model, Panel):
        return points
    on = model.covers(points.reshape(2, -1)).reshape(points.shape[1:])
    other = instead.reshape(2, -1, *[1] * (points.ndim - instead.ndim))
    return np.where(on, points, np.broadcast_to(other, points.shape))


def _shapes(model: Model, points: Array, waves: float) -> Array:
    """Return mode shapes up to a wavenumber in rad/m at points (2, n), longest waves first."""
    numbers = np.arange(1, MAX_TRIED_MODES + 1)
    if isinstance(model, Beam):
        stiffness = model.bending_stiffness / (model.mass / model.length)
    else:
        stiffness = model.bending_stiffness / model.mass_per_area
    k = np.sqrt(model.angular_frequencies(MAX_TRIED_MODES)) / stiffness**0.25
    chosen = numbers[k <= max(waves, k[0])].tolist()
    shapes, k = model.mode_shapes(chosen, points), k[: len(chosen)]
    if isinstance(model, Beam):
        x, y = points
        turns = (2 * numbers - 1) * np.pi / (2 * model.length)
        turns = turns[turns <= waves]
        twist = np.sin(turns[:, None] * x) * (2 * y / model.width - 1)
        shapes, k = np.concatenate([shapes, twist]), np.concatenate([k, turns])
    return np.asarray(shapes[np.argsort(k, kind="stable")])


def fit_spline(markers: Array, held: Array, places: Array) -> SurfaceModel:
    """Interpolate by a thin plate spline through markers (2, n) that is zero at held (2, k)."""
    n = markers.shape[1]
    every = np.concatenate([markers, held], axis=1).T
    unit = np.eye(len(every))[:, :n]
    surface = scipy.interpolate.RBFInterpolator(every, unit, kernel="thin_plate_spline", degree=1)
    others = np.zeros((n, n))
    for i in range(n):
        left = np.delete(np.arange(len(every)), i)
        without = scipy.interpolate.RBFInterpolator(
            every[left], unit[left], kernel="thin_plate_spline", degree=1
        )
        others[i] = without(every[[i]])[0]
    moving = surface(places.reshape(2, -1).T).reshape(*places.shape[1:], n)
    return SurfaceModel("spline", moving, others)


def edge_places(corners: Array, edges: list[int], step: float) -> Array:
    """Return places (2, n) on given edges of a polygon, at most a step in m apart."""
    found = [np.empty((2, 0))]
    for edge in edges:
        a, b = corners[edge], corners[(edge + 1) % len(corners)]
        count = max(2, int(np.ceil(np.hypot(*(b - a)) / step)) + 1)
        found.append(a[:, None] + (b - a)[:, None] * np.linspace(0, 1, count))
    return np.unique(np.round(np.concatenate(found, axis=1), 9), axis=1)


def group_octaves(hertz: ArrayLike) -> dict[str, IntArray]:
    """Return the indices of the sines in each octave, by nominal centre in Hz, after those of all.

    Sines below the lowest or above the highest band are in none.

    Examples
    --------
    >>> {name: own.tolist() for name, own in group_octaves([110.0, 5.0, 130.0, 300.0]).items()}
    {'all': [0, 1, 2, 3], '125': [0, 2], '250': [3]}
    """
    f = np.asarray(hertz, float)
    number = np.rint(np.log(f / 1000) / np.log(OCTAVE_RATIO)).astype(int) + 6
    found = {
        f"{centre:g}": np.flatnonzero(number == k) for k, centre in enumerate(NOMINAL_CENTRES_HZ)
    }
    return {ALL_TONES: np.arange(len(f))} | {name: own for name, own in found.items() if len(own)}


def radiate_sound(
    surface: surfaces.Surface,
    between: SurfaceModel,
    omegas: Sequence[float],
    shapes: estimates.Amplitudes,
    points: Array,
    planes: Sequence[Plane],
    medium: radiation.Medium,
    decays: Array | None = None,
) -> xr.Dataset:
    """Compute the sound that a surface radiates at angular frequencies in rad/s.

    `shapes` are the markers' amplitudes in m, sine after sine, with their covariance; `between`
    interpolates them to the surface's nodes. The pressure is computed at `points` (3, n) in m from
    the surface's centre, the field in `planes` of equal size. `decays` (3, sines) are decay rates α
    in 1/s, e^(−αt), their standard errors, and the resulting relative errors of the amplitudes: a
    larger rate implies a larger amplitude. The result has :data:`VARIABLES`, those of decays only
    with `decays`.
    """
    n, B = len(shapes.value) // len(omegas), between.moving
    places = np.arange(len(omegas) * n).reshape(-1, n)
    shown = (len(planes), *planes[0].shape)
    ways, rows, told = [], [], []
    for omega, place in zip(omegas, places, strict=True):
        shape = shapes.part(place)
        form = surface.power_form(B, omega, medium)
        found = estimates.estimate_quadratic_form(form, shape)
        power = estimates.widen_error(found, surface.sum_std)
        found = estimates.estimate_ratio(form, surface.plane_wave_form(B, omega, medium), shape)
        efficiency = estimates.widen_error(found, surface.sum_std)
        # Radiation modes: rows whose |r·w|² add up to the power, the loudest first.
        squares, directions = np.linalg.eigh(form)
        loud = np.sqrt(np.maximum(squares, 0))[:, None] * directions.T
        ways.append(radiation.radiation_modes(loud))
        found = estimates.estimate_squares(ways[-1][:LISTED_RADIATION_MODES], shape)
        each = estimates.widen_error(found, surface.sum_std)
        rows.append(surface.pressure_matrix(B, points, omega, medium))
        here, size = rows[-1] @ shape.value, estimates.estimate_magnitude(rows[-1], shape)
        above = [
            surface.pressure_matrix(B, plane.points.reshape(3, -1), omega, medium)
            for plane in planes
        ]
        field = np.array([matrix @ shape.value for matrix in above]).reshape(shown)
        spread = np.array([estimates.estimate_magnitude(matrix, shape).error for matrix in above])
        whole = np.linalg.norm(shape.value)
        left, noise = between.left(shape)
        told.append(
            {
                "frequency": np.array(omega / (2 * np.pi)),
                **_with_error("power", power),
                **_levels("power_level", DECIBELS_PER_NEPER, radiation.REFERENCE_POWER, power),
                **_with_error("efficiency", efficiency),
                **_with_error("mode_power", each),
                **split_complex("pressure", here),
                "pressure_error": size.error,
                **_levels(
                    "level", 2 * DECIBELS_PER_NEPER, np.sqrt(2) * radiation.REFERENCE_PRESSURE, size
                ),
                **split_complex("field", field),
                "field_error": spread.reshape(shown),
                "left": np.array(left / whole),
                "left_by_noise": np.array(noise / whole),
            }
        )
    values: dict[str, Any] = {name: np.array([one[name] for one in told]) for name in told[0]}
    if decays is not None:
        values |= _of_decays(decays, values["power"], values["power_error"])
    bands = group_octaves(values["frequency"])
    within = [shapes.part(places[band].ravel()) for band in bands.values()]
    values |= _of_bands([*bands.values()], within, ways, rows, surface.sum_std)
    values |= {"place": points.T, "u": planes[0].u, "z": planes[0].z, "area": surface.area}
    values |= {"plane": [plane.name for plane in planes], "axis": list("xyz"), "band": list(bands)}
    data = xr.Dataset(label_values(values, VARIABLES))
    return data.set_coords(["frequency", "place", "u", "z"])


def _of_decays(decays: Array, power: Array, error: Array) -> dict[str, Array]:
    """Return the energies W / 2α. An overestimated α makes W too large and the time too short.

    NaN for a mode that does not decay.
    """
    decay, wrong, size = decays
    alpha = np.where(decay > 0, decay, np.nan)
    energy = power / (2 * alpha)
    square = (error / power) ** 2 - (2 * size) ** 2 + (2 * size - wrong / alpha) ** 2
    return {
        "decay": decay,
        "energy": energy,
        "energy_error": np.abs(energy) * np.sqrt(np.maximum(square, 0)),
    }


def _of_bands(
    bands: Sequence[IntArray],
    shapes: Sequence[estimates.Amplitudes],
    ways: Sequence[Array],
    at: Sequence[ComplexArray],
    sum_std: float,
) -> dict[str, Array]:
    """Sum the sines' powers and mean square pressures in each band, with correlated errors.

    `sum_std` is the relative error of a power by the sum over the surface, as for one sine.
    """
    heard = np.swapaxes(at, 0, 1)[:, :, None] / np.sqrt(2)  # (points, tones, 1, markers)
    found = []
    for band, shape in zip(bands, shapes, strict=True):
        # The rows (k, markers) of each sine as rows for the amplitudes of all sines in the band.
        each = [scipy.linalg.block_diag(*(rows[k] for k in band)) for rows in (ways, *heard)]
        sums = [estimates.estimate_sum(one, shape) for one in each]
        found.append([(one.value, one.error) for one in sums])
    value, error = np.moveaxis(np.array(found), -1, 0)  # (bands, 1 + points)
    power = estimates.widen_error(estimates.Estimate(value[:, 0], error[:, 0]), sum_std)
    square = estimates.Estimate(value[:, 1:], error[:, 1:])
    return {
        **_with_error("band_power", power),
        **_levels("band_power_level", DECIBELS_PER_NEPER, radiation.REFERENCE_POWER, power),
        **_levels("band_level", DECIBELS_PER_NEPER, radiation.REFERENCE_PRESSURE**2, square),
    }


def _with_error(name: str, known: estimates.Estimate) -> dict[str, Array]:
    return {name: known.value, f"{name}_error": known.error}


def _levels(
    name: str, scale: float, reference: float, known: estimates.Estimate
) -> dict[str, Array]:
    """Return the level in dB and its standard error; NaN where the estimate is not positive."""
    value = np.where(known.value > 0, known.value, np.nan)
    return {name: scale * np.log(value / reference), f"{name}_error": scale * known.error / value}


def count_nodes(extent: tuple[float, float], omega: float, medium: radiation.Medium) -> int:
    """Return the number of nodes that a surface of an extent in m needs."""
    wave = 2 * np.pi * medium.speed_of_sound / omega
    return max(
        MIN_SURFACE_NODES,
        int(np.ceil(np.prod([NODES_PER_WAVELENGTH * side / wave for side in extent]))),
    )


def estimate_change(
    surface: surfaces.Surface,
    moving: Array,
    screens: Sequence[tuple[surfaces.Screen, Array]],
    omegas: Sequence[float],
    shapes: estimates.Amplitudes,
    medium: radiation.Medium,
    narrow: float,
    thickness: float,
) -> xr.Dataset:
    """Estimate by how much the power of one side changes without a wall, sine by sine.

    `moving` (nodes, markers) interpolates the markers' motion to the structure in a wall; `screens`
    are the structure without a wall in fine and in coarse cells, each with its matrix (cells,
    markers). `shapes` are the markers' amplitudes in m, sine after sine. `narrow` is the smaller
    side in m, like `thickness`: an ellipse of their ratio moves more air than a thin strip, by that
    ratio, all of which counts as uncertainty. Return :data:`NO_WALL_VARIABLES`; NaN where cells are
    too coarse, or an estimate is not positive.
    """
    thick = 2 * DECIBELS_PER_NEPER * np.log1p(thickness / narrow)
    rows = []
    for number, omega in enumerate(omegas):
        n = moving.shape[1]
        shape = shapes.part(np.arange(number * n, (number + 1) * n))
        wall = surface.power_form(moving, omega, medium)
        fine, coarse = (
            estimates.estimate_ratio(screen.power_form(by, omega, medium), wall, shape)
            for screen, by in screens
        )
        square = float(estimates.estimate_ratio(*surface.wavenumber_forms(moving), shape).value)
        k = max(np.sqrt(max(square, 0.0)), np.pi / narrow)
        with np.errstate(invalid="ignore", divide="ignore"):
            level, other = (DECIBELS_PER_NEPER * np.log(one.value) for one in (fine, coarse))
            noise = DECIBELS_PER_NEPER * fine.error / fine.value
            std = np.sqrt(noise**2 + (level - other) ** 2 + thick**2)
        known = level if np.isfinite(std) else np.nan
        rows.append((known, std, k * medium.speed_of_sound / (2 * np.pi)))
    values = dict(zip(NO_WALL_VARIABLES, np.array(rows).T, strict=True))
    return xr.Dataset(label_values(values, NO_WALL_VARIABLES))
