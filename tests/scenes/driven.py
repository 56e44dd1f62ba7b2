"""A beam that a recorded force drives: exact receptance, tracks, and the force as a file."""

import wave
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scenes.modes import BEAM, rig
from scipy.interpolate import CubicSpline
from scipy.signal import StateSpace, firwin, lsim, oaconvolve

from thesis_lib.arrays import Array
from thesis_lib.vibration.motion import Component

FINE = 2000.0  # Hz at which force and modes are computed
RATES = (120.0, 100.0, 119.88, 100.0)  # frames per second
PLACE = (0.5, 0.015)  # m, where the force acts
POINTS = rig().markers.centres


@dataclass(frozen=True)
class Driven:
    """Modes of the beam, each ω² (1 + …) as usual, at rest until a force comes."""

    newtons: Array  #: At FINE samples a second from time 0
    damping: tuple[float, ...] = (0.03, 0.02)
    place: tuple[float, float] = PLACE  #: m, where the force acts

    def receptance(self, frequency):
        """Σ φ(x) φ(x_F) / (m (ω_r² − ω² + 2jζω_rω)), m/N, shape (markers, lines)."""
        omega = 2 * np.pi * frequency
        total = np.zeros((POINTS.shape[1], len(omega)), complex)
        for own, zeta, (form, gain) in zip(self.omega, self.damping, self._modes, strict=True):
            total += np.outer(form, gain / (own**2 - omega**2 + 2j * zeta * own * omega))
        return total

    def at(self, times):
        """Deflection at times (..., markers), m."""
        parts = zip(self.coordinates, self._modes, strict=True)
        return sum(q(np.maximum(times, 0)) * form for q, (form, _) in parts)

    @cached_property
    def omega(self):
        """Natural frequencies, rad/s."""
        return BEAM.angular_frequencies(len(self.damping))

    @cached_property
    def _modes(self):
        """Shape at the markers, and at the force over the modal mass."""
        found = []
        for n in range(1, len(self.damping) + 1):
            part = Component("bending", n)
            mass = BEAM.mass / BEAM.shape_peak(n) ** 2
            drive = float(part.shape(BEAM, np.array(self.place)[:, None])[0])
            found.append((part.shape(BEAM, POINTS), drive / mass))
        return found

    @cached_property
    def coordinates(self):
        """Of each mode over time, m."""
        t = np.arange(len(self.newtons)) / FINE
        found = []
        for own, zeta, (_, gain) in zip(self.omega, self.damping, self._modes, strict=True):
            moves = [[0, 1], [-(own**2), -2 * zeta * own]]
            system = StateSpace(moves, [[0], [gain]], [[1, 0]], [0])
            found.append(CubicSpline(t, lsim(system, self.newtons, t)[1]))
        return found


def random_force(seconds, level=0.1):
    """Noise up to 45 Hz, of a level in N (rms)."""
    rng = np.random.default_rng(0)
    taps = firwin(2001, 45.0, fs=FINE)
    made = oaconvolve(rng.standard_normal(int(seconds * FINE) + 2000), taps, "valid")
    return level * made / made.std()


def swept_force(seconds, duration, from_hz, to_hz, level=0.1):
    """A sweep of even speed that fades in and out over half a second, then nothing."""
    t = np.arange(int(seconds * FINE)) / FINE
    phase = 2 * np.pi * (from_hz * t + (to_hz - from_hz) * t**2 / (2 * duration))
    edge = np.clip(np.minimum(t, duration - t) / 0.5, 0, 1)
    return level * np.sin(0.5 * np.pi * edge) ** 2 * np.sin(phase)


def write_wav(path, *channels, rate=2000):
    """Channels in −1…1 as a sound file of 16 bits."""
    table = np.clip(np.rint(np.stack(channels, axis=1) * 32768), -32768, 32767)
    with wave.open(str(path), "wb") as file:
        file.setnchannels(len(channels))
        file.setsampwidth(2)
        file.setframerate(rate)
        file.writeframes(table.astype("<i2").tobytes())
