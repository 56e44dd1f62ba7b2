"""Clocks by the pictures, whatever the motion: starts that are off, and clocks that drift apart.

Along the normal every camera sees the same motion. Where one's times are wrong by δ, the
cross-spectrum of what it and the first one see has the phase ωδ: it tells δ in each of some
windows, and a line through these how much faster a clock runs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from thesis_lib.arrays import Array, ComplexArray
from thesis_lib.measure.fitting.clocks import CERTAIN, LEAST_TURN
from thesis_lib.measure.modes.shapes import Rest
from thesis_lib.measure.response.motion import images
from thesis_lib.measure.tracking.tracks import Recording
from thesis_lib.vision.lens import projection_matrices
from thesis_lib.vision.triangulation import jacobian

WINDOWS = 8  # at most, over the recording
SHORT, LONG = 2.0, 16.0  # s that a window has at least, and at most
MOST = 0.1  # s that a camera's times may be off
LIKE = 1.5  # lines of a Hann window that tell as much as one
GRID = 8  # trial delays in a period of the highest frequency


@dataclass(frozen=True)
class Steps:
    """By how much the cameras' clocks were off."""

    lag: Array  #: How much later than was thought each camera started, s; 0 where not certain
    pace: Array  #: How much faster than the first camera's each clock runs; 0 where not certain


def in_step(
    recordings: Sequence[Recording],
    rest: Rest,
    span: tuple[float, float],
    band: tuple[float, float],
) -> tuple[list[Recording], Steps]:
    """The recordings with the first camera's clock, and what was corrected.

    Parameters
    ----------
    recordings : sequence of Recording
        The cameras and their tracks.
    rest : Rest
        The markers at rest.
    span : tuple of float
        From when to when all of them recorded, s.
    band : tuple of float
        The frequencies that are looked at, Hz.
    """
    rate, seconds = max(own.rate for own in recordings), span[1] - span[0]
    count = int(np.clip(seconds / SHORT, 1, WINDOWS))
    length = min(seconds / count, LONG)
    middles = span[0] + (np.arange(count) + 0.5) * seconds / count
    late, error, when = np.zeros((3, len(recordings), count))
    for k, middle in enumerate(middles):
        at = middle + np.arange(-int(length * rate / 2), int(length * rate / 2)) / rate
        seen = _heights(recordings, rest, at)
        for c in range(1, len(seen)):
            late[c, k], error[c, k], where = _late(seen[0], seen[c], rate, band)
            when[c, k] = at[0] + where
    centre, found = 0.5 * (span[0] + span[1]), [recordings[0]]
    lag, pace = np.zeros((2, len(recordings)))
    for c, own in enumerate(recordings[1:], 1):
        lag[c], slope = _line(when[c] - centre, late[c], error[c], seconds, band[1])
        moved = own.paced(1 + slope, centre)
        found.append(replace(moved, delay=moved.delay + lag[c]))
        pace[c] = 1 / (1 + slope) - 1
    return found, Steps(lag, pace)


def _heights(recordings: Sequence[Recording], rest: Rest, at: Array) -> list[Array]:
    """Deflections along the normal by each camera alone, m, (times, markers)."""
    P = projection_matrices([own.camera for own in recordings])
    slopes = np.einsum("cikn,k->cin", jacobian(P, rest.points), rest.frame.R[2])
    found = []
    for own, still, slope in zip(recordings, rest.images, slopes, strict=True):
        moved = images(own, still, at) - still[:, None]
        found.append(np.einsum("itn,in->tn", moved, slope / np.sum(slope**2, axis=0)))
    return found


def _late(
    one: Array, other: Array, rate: float, band: tuple[float, float]
) -> tuple[float, float, float]:
    """By how much another camera's times are too early, the standard error, and when, s."""
    known = np.isfinite(one).all(axis=0) & np.isfinite(other).all(axis=0)
    window = np.hanning(len(one))[:, None]
    parts = [window * (own - own.mean(axis=0))[:, known] for own in (one, other)]
    spectra = [np.fft.rfft(part, axis=0) for part in parts]
    omega = 2 * np.pi * np.fft.rfftfreq(len(one), 1 / rate)
    inside = (omega >= 2 * np.pi * band[0]) & (omega <= 2 * np.pi * band[1])
    cross = np.sum(spectra[0].conj() * spectra[1], axis=1)[inside]
    omega = omega[inside]
    if not known.any() or len(omega) < 2:
        return 0.0, np.inf, 0.0
    trials = np.arange(-MOST, MOST, 1 / (GRID * band[1]))
    found = float(trials[np.argmax(np.real(np.exp(-1j * np.outer(trials, omega)) @ cross))])
    for _ in range(3):
        turned: ComplexArray = cross * np.exp(-1j * omega * found)
        weight = float(np.sum(omega**2 * turned.real))
        found += float(np.sum(omega * turned.imag)) / weight
    left = cross * np.exp(-1j * omega * found)
    error = np.sqrt(LIKE * np.sum(omega**2 * left.imag**2)) / weight
    power = np.sum(parts[0] ** 2, axis=1)
    when = float(np.sum(power * np.arange(len(one))) / np.sum(power)) / rate
    return found, float(error) if weight > 0 else np.inf, when


def _line(
    times: Array, late: Array, error: Array, seconds: float, highest: float
) -> tuple[float, float]:
    """Where a line through some delays is at 0 s, and its slope; 0 where that is not certain."""
    there = np.isfinite(error) & (error > 0)
    fit, found = times[there], (0.0, 0.0)
    for order in (0, 1):
        if len(fit) < 2 * order + 1:
            break
        A = np.vander(fit, order + 1, increasing=True) / error[there][:, None]
        values, squares, *_ = np.linalg.lstsq(A, late[there] / error[there], rcond=None)
        spread = max(float(np.sum(squares)) / max(len(fit) - order - 1, 1), 1.0)
        deviation = np.sqrt(spread * np.diag(np.linalg.inv(A.T @ A)))
        least = LEAST_TURN / (2 * np.pi * highest) / np.array([1, seconds / 2])[: order + 1]
        certain = np.abs(values) > np.maximum(CERTAIN * deviation, least)
        if order == 0 or certain[1]:
            sure = np.where(certain, values, 0.0)
            found = float(sure[0]), float(sure[1]) if order else 0.0
    return found
