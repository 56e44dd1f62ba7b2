"""Camera layouts for the plate's sound: its field on planes, pressure at a point, or power.

The field's mean square error is ω²tr(QΣ) (:mod:`thesis_lib.acoustics.radiation`), so correlations
between markers count as well as their variances: a camera square to the plate rounds a row of
markers alike, and such errors radiate. The same holds for the power of a deflection w, whose
relative error is 2 wᵀRe / wᵀRw for small errors e. The search starts from the best layout for the
shape, and moves its cameras by some degrees while the error falls.
"""

from collections.abc import Sequence
from functools import lru_cache
from typing import Literal

import numpy as np

from thesis_lib.acoustics import radiation
from thesis_lib.acoustics.planes import MAX_NODAL_PRESSURE_RATIO, PlateSound, plate_pistons
from thesis_lib.arrays import Array
from thesis_lib.facts import setups
from thesis_lib.planning import positions
from thesis_lib.studies.fields import refuse_value
from thesis_lib.studies.request import SoundPlanes
from thesis_lib.vibration.structure import deflection_shape, resonance_frequency
from thesis_lib.vision import rounding

Sounds = Sequence[PlateSound]
Goal = Literal["sound", "sound-plane", "sound-point", "sound-power"]

# Finer steps would fit one position of the pixel grid, not the arrangement of markers
SOUND_STEPS_RAD = np.radians([8, 4, 2])
# Rotations of the whole layout, over which costs are averaged
AVERAGED_TURNS_RAD = np.radians([-0.5, 0, 0.5])
_MIN_IMPROVEMENT = 1e-3  # relative: smaller improvements are ignored
_MAX_ROUNDS = 4
_SEARCH_DIRECTIONS = np.array([(a, b) for a in (-1, 0, 1) for b in (-1, 0, 1) if a or b])


@lru_cache(maxsize=4)
def compute_sounds(
    modes: tuple[int, ...],
    peaks: tuple[float, ...],
    goal: Goal = "sound",
    plane: str = "XZ",
    point_mm: tuple[float, float, float] | None = None,
) -> tuple[PlateSound, ...]:
    """Compute the plate's sound in modes with peaks in m, on the planes of chapter 6.

    Raises
    ------
    PydanticCustomError
        If a mode is silent for the goal, or too high for the plate's pistons; or if the point is
        nearer than their size, where the sum over pistons does not hold.
    """
    plate = setups.thesis_plate()
    field = SoundPlanes.model_construct(grid=plate.grid)
    planes = tuple(one for one in field.planes if goal != "sound-plane" or one.name == plane)
    nearest = 1000 * max(plate_pistons(plate).size)
    if point_mm is not None and point_mm[2] < nearest:
        least = f"Z of {nearest:.4g} or more, the size of a piston of the plate"
        refuse_value("point_mm", list(point_mm), f"allowed: {least}")
    found = []
    for mode, peak in zip(modes, peaks, strict=True):
        shape = deflection_shape(plate, mode, plate.markers, peak)
        try:
            omega = resonance_frequency(plate, mode)
            if point_mm is None:
                one = PlateSound.from_shape(plate, planes, field.medium, omega, shape)
            else:
                place = np.array(point_mm) / 1000
                one = _point_sound(plate_pistons(plate), place, field.medium, omega, shape)
        except ValueError as error:
            refuse_value("modes", mode, str(error).replace(radiation.FINER_PISTONS, "a lower mode"))
        if goal != "sound-power" and np.isnan(one.largest).all():
            where = "at point_mm" if point_mm else f"on {' or '.join(one.name for one in planes)}"
            refuse_value("modes", mode, f'allowed: modes heard {where}, with goal "{goal}"')
        found.append(one)
    return tuple(found)


def _point_sound(
    parts: radiation.Pistons, point: Array, medium: radiation.Medium, omega: float, reference: Array
) -> PlateSound:
    """Compute the sound at one point (3,) in m, treated as a plane of one point."""
    row = radiation.transfer_pressure(parts, point, omega, medium)
    own, disordered = omega * np.abs(reference @ row), omega * np.linalg.norm(row * reference)
    largest = np.array([np.nan if own <= MAX_NODAL_PRESSURE_RATIO * disordered else own])
    resistance = radiation.radiation_matrix(parts, omega, medium)
    factor = np.stack([row.real, row.imag])
    return PlateSound(omega, reference, (), (factor,), largest, resistance)


def _predict_modes(sounds: Sounds, covariances: Sequence[Array], goal: Goal) -> Array:
    """Predict the modes' errors in %: of the power, or of the field on the worst plane."""
    pairs = zip(sounds, covariances, strict=True)
    if goal == "sound-power":
        return np.array([sound.expected_power_error(C) for sound, C in pairs])
    return np.array([np.nanmax(sound.expected_plane_errors(C)) for sound, C in pairs])


def average_sound_error(
    sounds: Sounds, scene: positions.Scene, layout: Array, width: int, goal: Goal = "sound"
) -> Array:
    """Average the sound errors of modes in % over amplitudes and small rotations of the layout.

    Averaged over amplitudes, both images of a marker are rounded independently; correlations
    between markers are computed from their rest positions.
    """
    squares, rest = [], scene.body.points
    for turn in AVERAGED_TURNS_RAD:
        P = positions.place_cameras(scene, layout + [turn, 0, 0, 0], width).P
        C = 2 * rounding.deflection_covariance(P, rest, rest, rest_is_known=True)
        squares.append(_predict_modes(sounds, [C] * len(sounds), goal) ** 2)
    return np.asarray(np.sqrt(np.mean(squares, axis=0)))


def predict_sound_errors(
    sounds: Sounds, scene: positions.Scene, layout: Array, width: int, goal: Goal = "sound"
) -> Array:
    """Return sound errors of the modes in % by the law of rounding, at the requested amplitude."""
    P, rest = positions.place_cameras(scene, layout, width).P, scene.body.points
    moved = np.moveaxis(scene.body.deflected(scene.peaks), 1, 0)
    covariances = [rounding.deflection_covariance(P, rest, one) for one in moved]
    return _predict_modes(sounds, covariances, goal)


def simulate_sound_errors(
    sounds: Sounds, wrong: Array, goal: Goal = "sound"
) -> tuple[Array, Array]:
    """Return the sound errors in % of drawn deflection errors (modes, trials, markers) in m.

    Returns
    -------
    tuple of ndarray
        Rms over the trials, on the worst plane, (modes,), and the 5 and 95 % quantiles of its
        absolute value, (2, modes).
    """
    rms, band = [], []
    for sound, error in zip(sounds, wrong, strict=True):
        found = sound.reference + error
        powers = goal == "sound-power"
        drawn = np.abs(sound.power_errors(found))[:, None] if powers else sound.plane_errors(found)
        over_trials = np.sqrt(np.mean(drawn**2, axis=0))
        worst = int(np.nanargmax(over_trials))
        rms.append(over_trials[worst])
        band.append(np.quantile(drawn[:, worst], [0.05, 0.95]))
    return np.array(rms), np.array(band).T


def move_cameras(
    sounds: Sounds, scene: positions.Scene, layout: Array, width: int, goal: Goal = "sound"
) -> Array:
    """Move the cameras, one by one, in decreasing steps while the sound error falls.

    A camera moves to one of the eight directions about its own, as near as it sees enough markers.
    The original layout is returned if the error predicted at the requested amplitude does not fall.
    """
    asked, rules, found = (width, goal), scene.rules, layout
    best = float(average_sound_error(sounds, scene, found, *asked).max())
    for step in SOUND_STEPS_RAD:
        still = 0  # cameras since the last move
        for which in _MAX_ROUNDS * list(range(len(layout))):
            if still == len(layout):
                break
            still += 1
            azimuth, elevation, _, focal = found[which]
            aside = azimuth + step / max(np.cos(elevation), step) * _SEARCH_DIRECTIONS[:, 0]
            up = positions.angles(elevation + step * _SEARCH_DIRECTIONS[:, 1], rules.elevations)
            grid = np.column_stack([positions.azimuths(aside, rules.azimuths), up])
            near = positions.nearest_distances(scene, grid, focal)
            places = positions.combine_positions(grid, near, focal)
            places = places[positions.are_permitted(scene, places)]
            others = np.delete(found, which, axis=0)
            places = places[~positions.too_near(scene, places, others).any(axis=1)]
            tried = [np.insert(others, which, place, axis=0) for place in places]
            costs = np.array(
                [average_sound_error(sounds, scene, one, *asked).max() for one in tried]
            )
            if len(costs) and costs.min() < best * (1 - _MIN_IMPROVEMENT):
                least = positions.first_least(costs)
                found, best, still = tried[least], float(costs[least]), 0
    now, before = (
        predict_sound_errors(sounds, scene, one, *asked).max() for one in (found, layout)
    )
    return found if now < before * (1 - positions.MAX_TIE_RATIO) else layout
