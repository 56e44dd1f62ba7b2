"""Transfer from a plate's pistons to a plane's points, by the library and by what others wrote."""

from __future__ import annotations

import statistics
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.limits import processor_seconds
from benchmarks.peers import missing
from benchmarks.reference import distances
from thesis_lib.acoustics.planes import Plane, plane_operator, plate_pistons
from thesis_lib.acoustics.radiation import AIR, transfer_pressure
from thesis_lib.facts import setups
from thesis_lib.vibration.structure import resonance_frequency


@dataclass(frozen=True)
class Transfer:
    """Rates in million pairs of piston and point a second, one a round.

    The difference is that from the direct expression, relative to its largest value.
    """

    name: str
    rates: list[float]
    difference: float

    @property
    def rate(self) -> float:
        """The median."""
        return statistics.median(self.rates)


def compare(
    repetitions: int = 7, shape: tuple[int, int] = (149, 99), absent: tuple[str, ...] | None = None
) -> list[Transfer]:
    """Direct NumPy, the library, its operator by symmetry, and Acoular where it is installed."""
    absent = tuple(missing()) if absent is None else absent
    plate = setups.thesis_plate()
    plane = Plane("XZ", 0.334, 0.0445, 0.443, shape)
    omega, parts, points = resonance_frequency(plate, 1), plate_pistons(plate), plane.points
    k = omega / AIR.speed_of_sound
    v = np.ones(parts.centres.shape[1])

    def direct() -> Any:
        R = distances(parts, points)
        return np.exp(-1j * k * R) / R

    calls: dict[str, Callable[[], Any]] = {
        "NumPy, exp(-1j*k*R)/R": direct,
        "thesis_lib, transfer": lambda: transfer_pressure(parts, points, omega),
        "thesis_lib, operator of a plane": lambda: plane_operator(plate, plane, omega),
    }
    exact = direct().reshape(-1, len(v))
    scale = 1j * omega * AIR.density * parts.area / (2 * np.pi)

    def apart(found: Any, expected: Any) -> float:
        return float(np.max(np.abs(found - expected)) / np.max(np.abs(expected)))

    found = transfer_pressure(parts, points, omega).reshape(exact.shape)
    field = plane_operator(plate, plane, omega).field(v)
    differences = [
        0.0, apart(found / scale, exact), apart(field.ravel() / scale, (exact @ v).ravel())
    ]  # fmt: skip
    if "Acoular" not in absent:
        vector = _steering(points.reshape(3, -1), parts.centres, AIR.speed_of_sound)
        frequency = omega / (2 * np.pi)
        calls["Acoular, SteeringVector.transfer"] = lambda: vector.transfer(frequency)
        # Relative to the array's centre, whose distance is r0.
        waves = vector.transfer(frequency) * np.exp(-1j * k * vector.r0)[:, None]
        differences.append(apart(waves / vector.r0[:, None], exact))
    rates: dict[str, list[float]] = {name: [] for name in calls}
    for _ in range(repetitions):
        for name, call in calls.items():
            time = statistics.median(processor_seconds(call) for _ in range(3))
            rates[name].append(exact.size / time / 1e6)
    return [
        Transfer(name, rate, difference)
        for (name, rate), difference in zip(rates.items(), differences, strict=True)
    ]


def _steering(points: Any, centres: Any, speed: float) -> Any:
    """Acoular's steering vector, with distances known, as it keeps them."""
    import acoular

    positions = np.vstack([centres, np.zeros(centres.shape[1])])
    vector = acoular.SteeringVector(
        grid=acoular.ImportGrid(pos=np.ascontiguousarray(points)),
        mics=acoular.MicGeom(pos_total=positions),
        steer_type="classic",
        env=acoular.Environment(c=speed),
    )
    _ = vector.r0, vector.rm
    return vector
