"""The driven structures and their sound: true, from markers, and after an impact.

All structures are thin, as suits such cameras: the thesis's plate with another thickness, an L cut
from it, and the thesis's beam. A sine force drives each at one point, and it moves in its first
:data:`MOVING_MODES` modes (thesis, eq. 3.5).

In the impact test of the beam the markers are projected, not rendered: the same cameras, at unequal
frame rates, see them with the scatter of the centres in the recordings. The modes are identified
from the tracks, and their sound is computed like that of a measurement.
"""

from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import Any

import numpy as np

from thesis_lib.acoustics import estimates, planes, radiation, surfaces
from thesis_lib.arrays import Array, ComplexArray
from thesis_lib.facts import setups
from thesis_lib.figure_sets.lab_radiation.figure_set import LabRadiation
from thesis_lib.laboratory import tracking
from thesis_lib.laboratory.rig import Rig, camera_rig, derive_seed, shorten_rig
from thesis_lib.measure.modes.identify import ModalError, ModeRequest, identify_modes
from thesis_lib.measure.radiation import of_measurement, radiated
from thesis_lib.measure.recordings.board import Markers, rows_on
from thesis_lib.measure.recordings.validation import ChainError
from thesis_lib.studies.schema import read_variables
from thesis_lib.vibration.finite_elements import SIMPLY_SUPPORTED
from thesis_lib.vibration.motion import Component
from thesis_lib.vibration.panel import Panel
from thesis_lib.vibration.polygons import Point
from thesis_lib.vibration.structure import Beam, Plate, modal_coordinates, resonance_frequency

MOVING_MODES = 40
PLATE_THICKNESS_M = 0.003
ELEMENT_M = 0.02  # of the L
FORCE_PLACE_M = (0.22, 0.22)  # where plates are driven, away from their edges
MARKER_GRID = (7, 5)  # markers along and across the box around a plate
DENSE_GRID = (12, 8)  # the same at a frequency between modes, which excites many of them
PLATE_MARKER, DENSE_MARKER, BEAM_MARKER = 0.024, 0.018, 0.007  # diameters, m
ROW_SPACING, BEAM_COLUMNS = 0.014, 13  # of the beam's two rows
PEAK_PLACES = 41  # places along each side of the box, for the largest deflection
EDGE_PLACES = 32  # places on a marker's edge


@dataclass(frozen=True)
class Driven:
    """A structure driven by a force at one frequency."""

    structure: Beam | Plate | Panel
    markers: Markers  #: Its printed markers
    frequency: float  #: Frequency of the force, Hz
    name: str  #: Structure and mode in words

    @property
    def corners(self) -> tuple[Point, ...]:
        """Corners of the outline in m, from its box's corner."""
        if isinstance(self.structure, Panel):
            return self.structure.outline
        x, y = self.structure.extent
        return (0.0, 0.0), (x, 0.0), (x, y), (0.0, y)

    @property
    def omega(self) -> float:
        """Return the angular frequency of the force in rad/s."""
        return 2 * np.pi * self.frequency

    @cached_property
    def coordinates(self) -> ComplexArray:
        """Modal coordinates for a largest deflection of 1, shape (:data:`MOVING_MODES`,)."""
        q = modal_coordinates(self.structure, np.array(self.omega), MOVING_MODES)
        x, y = (np.linspace(0, side, PEAK_PLACES) for side in self.structure.extent)
        points = np.stack([np.tile(x, PEAK_PLACES), np.repeat(y, PEAK_PLACES)])
        return np.asarray(q / np.nanmax(np.abs(q @ self.mode_shapes(points))), complex)

    def mode_shapes(self, points: Array) -> Array:
        """Return the shapes of the moving modes at points (2, n), one per row."""
        return self.structure.mode_shapes(range(1, MOVING_MODES + 1), points)

    def show_markers(self, peak: float) -> ComplexArray:
        """Return amplitudes as means over the markers' edges, for a `peak` in m, (markers,)."""
        turn = 2 * np.pi * (np.arange(EDGE_PLACES) + 0.5) / EDGE_PLACES
        ring = self.markers.diameter / 2 * np.stack([np.cos(turn), np.sin(turn)])
        edges = (self.markers.centres[:, :, None] + ring[:, None]).reshape(2, -1)
        shape = np.asarray(self.coordinates @ self.mode_shapes(edges), complex)
        return peak * shape.reshape(-1, EDGE_PLACES).mean(axis=1)

    def components(self, peak: float) -> tuple[Component, ...]:
        """Return the modes as parts of a motion whose largest deflection is `peak` in m."""
        parts = []
        for n, q in enumerate(self.coordinates, 1):
            up = (-1) ** (n + 1) if isinstance(self.structure, Beam) else 1  # sign of `Component`
            size = peak * q * up * self.structure.shape_peak(n)
            polar = float(abs(size)), float(np.angle(size))
            parts.append(Component("bending", n, self.frequency, *polar))
        return tuple(parts)


@cache
def drive_structure(case: str) -> Driven:
    """Return the structure of a case, with the frequency of its force."""
    if case == "beam":
        beam = setups.thesis_beam()
        row = replace(beam, n_markers=BEAM_COLUMNS, marker_spacing=beam.length / BEAM_COLUMNS)
        markers = rows_on(row, 2, ROW_SPACING, BEAM_MARKER, None)
        return _drive_at_mode(beam, markers, 3, "beam, third mode")
    plate = setups.thesis_plate(MARKER_GRID)
    flat = replace(plate, thickness=PLATE_THICKNESS_M, force_position=FORCE_PLACE_M)
    if case == "l":
        outline = setups.setup_table("shape", "l")["outline_mm"]
        corners = tuple((x / 1000, y / 1000) for x, y in outline)
        material = flat.thickness, flat.density, flat.youngs_modulus, flat.poisson, flat.damping
        edges = (SIMPLY_SUPPORTED,) * len(corners)
        panel = Panel(corners, edges, (), *material, flat.force_position, MARKER_GRID, ELEMENT_M)
        # Markers that are a diameter away from its edges
        turn = np.linspace(0, 2 * np.pi, 16, endpoint=False)
        ring = PLATE_MARKER * np.stack([np.cos(turn), np.sin(turn)])
        around = panel.markers[:, :, None] + ring[:, None]
        clear = panel.covers(around.reshape(2, -1)).reshape(around.shape[1:]).all(axis=1)
        markers = Markers(panel.extent, panel.markers[:, clear], PLATE_MARKER)
        return _drive_at_mode(panel, markers, 1, "L-shaped plate, first mode")
    markers = Markers(flat.extent, flat.markers, PLATE_MARKER)
    own = _drive_at_mode(flat, markers, 1, "plate, first mode")
    if case == "plate":
        return own
    second = resonance_frequency(flat, 2) / (2 * np.pi)
    between, many = float(np.sqrt(own.frequency * second)), replace(flat, grid=DENSE_GRID)
    dense = Markers(many.extent, many.markers, DENSE_MARKER)
    return Driven(many, dense, between, "plate, between two modes")


def _drive_at_mode(structure: Any, markers: Markers, mode: int, name: str) -> Driven:
    """Drive a structure at the resonance of a mode."""
    return Driven(structure, markers, resonance_frequency(structure, mode) / (2 * np.pi), name)


def rig_of(study: LabRadiation, case: str, replicate: int) -> Rig:
    """Return the rig of one recording: cameras, the board's poses, the driven structure."""
    own = drive_structure(case)
    seed = derive_seed(study.seed, case, replicate)
    draw = np.random.default_rng([seed, 7])
    parts = own.components(study.amplitude_mm / 1000)
    setting = study.setting(case)
    rig = camera_rig(study, own.structure, setting, study.frame_rate_hz, parts, seed, own.markers)
    rig = tracking.aim_cameras(rig, setting.distance_mm / 1000, draw)
    return shorten_rig(rig, draw.random(len(study.azimuths_deg)).tolist(), study.frames)


# Of the true surface: more than twice those of a measurement, with a fifth of their sum's error
TRUE_NODES = 3600
PRESSURE_PLANE = planes.Plane("XZ", 0.4, 0.05, 0.55, (41, 26))


def true_sound(
    own: Driven, peak: float, medium: radiation.Medium
) -> tuple[float, float, ComplexArray]:
    """Compute the sound of the true motion with a largest deflection `peak` in m.

    Returns the power in W, the efficiency, and the pressure on :data:`PRESSURE_PLANE` in Pa.
    """
    surface, q = _surface(own, TRUE_NODES), peak * own.coordinates
    of: Any = own.mode_shapes(surface.places).T, own.omega, medium
    power, plain = (
        float(np.real(np.conj(q) @ form @ q))
        for form in (surface.power_form(*of), surface.plane_wave_form(*of))
    )
    return power, power / plain, _pressure_matrix(surface, *of) @ q


def _pressure_matrix(surface: surfaces.Surface, moving: Array, *of: Any) -> ComplexArray:
    """Return the pressure on :data:`PRESSURE_PLANE` by each column of `moving`."""
    return surface.pressure_matrix(moving, PRESSURE_PLANE.points.reshape(3, -1), *of)


class MarkerSound:
    """The sound of a structure, computed from the motion of its markers."""

    def __init__(self, own: Driven, medium: radiation.Medium) -> None:
        markers, nodes = own.markers, radiated.count_nodes(own.structure.extent, own.omega, medium)
        self._surface = surface = _surface(own, nodes)
        radius, places = markers.diameter / 2, surface.places
        #: Interpolation of the surface's motion between markers, by the first modes of its model
        self.between = radiated.fit_model(own.structure, markers.centres, radius, places)
        self._of: Any = self.between.moving, own.omega, medium
        self._power_form = surface.power_form(*self._of)
        self._plain_form = surface.plane_wave_form(*self._of)

    @cached_property
    def matrix(self) -> ComplexArray:
        """Pressure on :data:`PRESSURE_PLANE` by unit marker amplitudes, (places, markers)."""
        return _pressure_matrix(self._surface, *self._of)

    @cached_property
    def _squares(self) -> Array:
        """Quadratic form of the mean square pressure on the plane, in stacked amplitudes."""
        stacked = estimates.stack_matrix(self.matrix)
        return np.asarray(stacked.T @ stacked / len(self.matrix))

    def power(self, shape: estimates.Amplitudes) -> estimates.Estimate:
        """Return the sound power in W."""
        power = estimates.estimate_quadratic_form(self._power_form, shape)
        return estimates.widen_error(power, self._surface.sum_std)

    def efficiency(self, shape: estimates.Amplitudes) -> estimates.Estimate:
        """Return the radiation efficiency."""
        ratio = estimates.estimate_ratio(self._power_form, self._plain_form, shape)
        return estimates.widen_error(ratio, self._surface.sum_std)

    def field_error(self, shape: estimates.Amplitudes) -> float:
        """Return the rms standard error of the pressure over the plane, in Pa."""
        return float(np.sqrt(np.sum(self._squares * shape.covariance)))


def _surface(own: Driven, nodes: int) -> surfaces.Surface:
    x, y = own.structure.extent
    return surfaces.Surface.from_outline(np.array(own.corners), nodes, (x / 2, y / 2))


TAP_DAMPING = (0.010, 0.006, 0.004)  # of the excited modes
TAP_RATES_HZ = (50.0, 60.0, 30.0)  # frames per second; unequal rates distinguish the modes
TAP_PLACE, TAP_IMPULSE_NS, TAP_SECONDS = 0.3, 0.05, 3.0  # place over the length; N s; s
TAP_BAND_HZ = (2.0, 130.0)  # searched for modes
LISTENER_M = np.array([[0.0], [0.0], [1.0]])  # position of the listener
HEARD_SECONDS, HEARD_STEP = 0.5, 24  # s of the stored pressure; its step in samples
TAP_VARIABLES = read_variables(__file__, "tap")


def measure_tap(study: LabRadiation, scatter: float, medium: radiation.Medium) -> dict[str, Any]:
    """Measure :data:`TAP_VARIABLES` if centres scatter by `scatter` px; NaN if modes are hidden."""
    rig = rig_of(study, "beam", 0)
    x, y = rig.markers.extent
    rates = np.resize(TAP_RATES_HZ, len(rig.stations)).tolist()
    how: Any = {"seconds": TAP_SECONDS, "rates": tuple(rates), "impulse": TAP_IMPULSE_NS}
    rig = tracking.add_impact(rig, TAP_DAMPING, (TAP_PLACE * x, y / 2), **how)
    assert isinstance(rig.motion, tracking.ImpactMotion)
    hertz = np.abs(rig.motion.poles) / (2 * np.pi)
    times = np.arange(0, HEARD_SECONDS, HEARD_STEP / of_measurement.SOUND_RATE_HZ)
    sizes = {"ringing": len(hertz), "tap_time": len(times)}
    values: dict[str, Any] = {
        name: np.full([sizes[dim] for dim in one.dims], np.nan)
        for name, one in TAP_VARIABLES.items()
    }
    values |= {"tap_frequency": hertz, "tap_time": times}
    try:
        asked = ModeRequest(TAP_BAND_HZ, len(hertz), given=tuple(hertz))
        decay = tracking.select_free_decay(rig, _project_tracks(rig, scatter))
        found, _ = identify_modes(*decay, asked)
    except (ChainError, ModalError):
        return values
    own = drive_structure("beam")
    surface = _surface(own, radiated.MIN_SURFACE_NODES)
    markers = rig.markers.centres  # seen as points, not by their edges
    between = radiated.fit_model(own.structure, markers, 0.0, surface.places)
    plane = planes.Plane("XZ", x, float(LISTENER_M[2, 0]), float(LISTENER_M[2, 0]), (2, 1))
    data = found.assign(grid_scale=1.0)  # cameras and grid have no errors
    shapes = of_measurement.shapes_of(data, np.ones(len(markers[0]), bool))
    rung = (2 * np.pi * data["frequency"].values).tolist()
    decays = of_measurement.decays_of(data)
    made = radiated.radiate_sound(
        surface, between, rung, shapes, LISTENER_M, [plane], medium, decays
    )
    powers = []  # of each mode of the true motion at that moment, W
    shapes_then = rig.motion.amplitudes(surface.places, float(found["zero"]))
    for w, shape in zip(np.abs(rig.motion.poles), shapes_then, strict=True):
        real = np.abs(shape) * np.sign((shape / shape[np.argmax(np.abs(shape))]).real)
        powers.append(float(surface.power_form(real[:, None], float(w), medium)[0, 0]))
    power = np.array(powers)
    tones = (made.isel(tone=[k]) for k in range(made.sizes["tone"]))
    each = [of_measurement.audible_pressure(tone, 0)[::HEARD_STEP] for tone in tones]
    whole = made.sel(band=radiated.ALL_TONES)
    of_modes = ("frequency", "power", "power_error", "energy", "energy_error")
    return {
        **values,
        **{f"tap_{name}": made[name].values for name in of_modes},
        "tap_true_power": power,
        "tap_true_energy": power / (-2 * rig.motion.poles.real),
        "tap_all": whole["band_power"].values,
        "tap_all_error": whole["band_power_error"].values,
        "tap_pressure": np.array(each, "float32")[:, : len(times)],
    }


def _project_tracks(rig: Rig, scatter: float) -> list[tracking.TrackedCentres]:
    """Project the markers into each camera, averaged over the exposure, and add scatter in px."""
    found, samples = [], 4
    for index, station in enumerate(rig.stations):
        times = tracking.frame_times(rig, station)
        within = ((np.arange(samples) + 0.5) / samples - 0.5) * station.sensor.exposure
        uv = tracking.true_centres(rig, station, times[:, None] + within).mean(axis=2)
        noise = rig.generator(3, index, 0).standard_normal(uv.shape)
        found.append(tracking.TrackedCentres(times, uv + scatter * noise))
    return found
