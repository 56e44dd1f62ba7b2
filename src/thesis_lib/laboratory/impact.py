"""The impact test: a structure that is tapped and rings, and tracks of its free decay."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from thesis_lib.arrays import Array, ComplexArray
from thesis_lib.laboratory.rig import Rig
from thesis_lib.laboratory.tracking import TrackedCentres
from thesis_lib.measure.fitting.harmonics import mean_of
from thesis_lib.measure.fitting.reconstruction import check_frame, triangulate_seen
from thesis_lib.measure.modes.shapes import Rest, Track
from thesis_lib.vibration.motion import Component, Motion
from thesis_lib.vibration.structure import Structure
from thesis_lib.vision import lens


@dataclass(frozen=True)
class ImpactMotion(Motion):
    """A structure at rest that is tapped once, and rings in its modes.

    The tap is a half sine of `impulse`, from `start` and `ramp` long, at `point`. Every mode of
    angular frequency ω and damping ratio ζ answers as q̈ + 2ζω q̇ + ω² q = φ(point) F / m.
    """

    impulse: float = 0.01  #: N s
    point: tuple[float, float] = (0.0, 0.0)  #: Where it is tapped, m
    damping: tuple[float, ...] = ()  #: Damping ratio of each component

    @property
    def poles(self) -> ComplexArray:
        """Return λ = ω (−ζ + j √(1 − ζ²)) of every mode, 1/s, shape (components,)."""
        omega = 2 * np.pi * np.array([part.frequency for part in self.components])
        zeta = np.array(self.damping)
        return np.asarray(omega * (1j * np.sqrt(1 - zeta**2) - zeta), complex)

    def coordinates(self, times: ArrayLike) -> Array:
        """Return displacement of each mode where its shape is 1, shape (components, ...), m."""
        t = np.asarray(times, float) - self.start
        return np.stack(
            [gain * _integrate_pulse(pole, t, self.ramp).imag for pole, gain in self._gains()]
        )

    def force(self, times: ArrayLike) -> Array:
        """Return force of the tap in N."""
        t = np.asarray(times, float) - self.start
        inside = (t >= 0) & (t <= self.ramp)
        return np.where(inside, self._peak * np.sin(np.pi * t / self.ramp), 0.0)

    def amplitudes(self, points: ArrayLike, at: float) -> ComplexArray:
        """Return complex shapes (modes, n) of the free modes e^{λ (t − at)} at points (2, n), m."""
        shapes, since = self.shapes(points), at - self.start
        size = [
            -1j * gain * _integrate_pulse(pole, np.array(since), self.ramp)
            for pole, gain in self._gains()
        ]
        return np.asarray(np.array(size)[:, None] * shapes, complex)

    @property
    def _peak(self) -> float:
        return self.impulse * np.pi / (2 * self.ramp)

    def _gains(self) -> list[tuple[complex, float]]:
        """Return the pole of each mode, and its exponential's imaginary part by a force of 1 N."""
        place, found = np.array(self.point)[:, None], []
        for part, pole in zip(self.components, self.poles, strict=True):
            drive = float(part.shape(self.structure, place)[0])
            mass = self.structure.mass / self.structure.shape_peak(part.mode) ** 2
            found.append((complex(pole), self._peak * drive / (mass * pole.imag)))
        return found


def _integrate_pulse(pole: complex, t: Array, length: float) -> ComplexArray:
    """Integrate sin(πs/T) e^{λ(t − s)} over the part of a pulse of length T that is past."""
    kappa, until = np.pi / length, np.clip(t, 0, length)
    past = -(pole * np.sin(kappa * until) + kappa * np.cos(kappa * until)) * np.exp(
        pole * (np.maximum(t, 0) - until)
    )
    return np.asarray((past + kappa * np.exp(pole * np.maximum(t, 0))) / (pole**2 + kappa**2))


def tap_structure(
    rig: Rig,
    damping: tuple[float, ...],
    point: tuple[float, float],
    *,
    rest: float = 0.3,
    seconds: float = 2.0,
    rates: tuple[float, ...] = (),
    impulse: float = 0.01,
    pulse: float = 0.002,
) -> Rig:
    """Let the structure be tapped after some rest, and render some seconds in all.

    Parameters
    ----------
    rig : Rig
        Cameras, structure and markers.
    damping : tuple of float
        Damping ratio of each of the structure's first modes, which ring.
    point : tuple of float
        Where it is tapped, m.
    rest, seconds : float
        When the tap begins after the last camera's start, and the length of the recordings, s.
    rates : tuple of float
        Frames per second of each camera; those of the rig if there are none.
    impulse, pulse : float
        Of the tap in N s, and its length in s.
    """
    structure: Structure = rig.motion.structure
    hertz = structure.angular_frequencies(len(damping)) / (2 * np.pi)
    parts = tuple(Component("bending", n, frequency=float(f)) for n, f in enumerate(hertz, 1))
    given = rates or tuple(station.frame_rate for station in rig.stations)
    stations = tuple(
        replace(station, frame_rate=rate) for station, rate in zip(rig.stations, given, strict=True)
    )
    begin = max(station.start for station in stations) + rest
    motion = ImpactMotion(structure, parts, begin, pulse, impulse, point, damping)
    return replace(rig, stations=stations, motion=motion, duration=seconds)


def select_free_decay(rig: Rig, found: list[TrackedCentres]) -> tuple[list[Track], Rest]:
    """Select tracks of the free vibration after the tap, and the markers at rest before it."""
    tracks, still = [], []
    for station, own in zip(rig.stations, found, strict=True):
        uv, exposure = lens.undistort_tracks(station.camera, own.centres), station.sensor.exposure
        still.append(mean_of(uv[own.times < rig.motion.start]))
        ring = own.times > rig.motion.steady + exposure
        own_v = own.centres[ring, 1]
        tracks.append(Track(station.camera, own.times[ring], uv[ring], exposure, 0.0, own_v))
    images = np.array(still)
    frame = check_frame(rig.cameras, images, rig.markers)
    points, _ = triangulate_seen(lens.projection_matrices(rig.cameras), images)
    thick = float(getattr(rig.motion.structure, "thickness", 0.0))
    return tracks, Rest(images, frame, points, rig.markers.centres, thick)
