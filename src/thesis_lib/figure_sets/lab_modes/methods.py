"""Bending and torsion of the beam from frames that may be too few, in four ways (``lab-modes``).

*Instant* takes the frame that comes nearest to a maximum, and of the other cameras those nearest to
it. *Read* fits a harmonic at the frequency that the tracks show between 0 and half of the frame
rate. *Found* tries all frequencies that show there, and keeps the one at which the cameras agree.
*Known* is told the frequency.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import xarray as xr

from thesis_lib.arrays import Array, ComplexArray
from thesis_lib.figure_sets.lab_modes import spectra
from thesis_lib.figure_sets.lab_modes.parameters import LabModes
from thesis_lib.figure_sets.lab_modes.recordings import beam_rigs
from thesis_lib.laboratory import direct
from thesis_lib.laboratory.direct import Seen
from thesis_lib.laboratory.recordings import REST, found_in
from thesis_lib.laboratory.rig import Rig
from thesis_lib.measure.fitting import aliasing
from thesis_lib.measure.fitting.harmonics import Fitted, amplitude, deviation, mean_of
from thesis_lib.measure.fitting.reconstruction import deflection_at, height_deviation, normal_gain
from thesis_lib.vibration.motion import amplitudes
from thesis_lib.vision import lens
from thesis_lib.vision.simulation import assurance
from thesis_lib.vision.triangulation import jacobian

AS_WELL = 1.1  # times the least disagreement that are as good as it
CYCLES = (0.0, 0.1, 0.2, 0.4, 0.6, 0.8, 1.0)  # by which a known frequency is taken to be wrong


@dataclass(frozen=True)
class Recording:
    """One mode at one frame rate, and the truth about it."""

    rig: Rig  #: What was filmed
    found: list[Seen]  #: What each camera saw: frames at rest, then steady ones
    exposure: float  #: Exposure time in s

    @property
    def rate(self) -> float:
        """Frames per second."""
        return self.rig.stations[0].frame_rate

    @property
    def frequency(self) -> float:
        """True frequency in Hz."""
        return self.rig.motion.components[0].frequency

    @property
    def undistorted(self) -> list[Array]:
        """Marker centres of each camera without distortion, (frames, 2, markers), px."""
        return [
            lens.undistorted_tracks(camera, own.centres)
            for camera, own in zip(self.rig.cameras, self.found, strict=True)
        ]

    @property
    def steady(self) -> tuple[list[Array], list[Array]]:
        """Times and image coordinates (frames, series) of each camera in the steady state."""
        return [own.times[REST:] for own in self.found], [
            uv[REST:].reshape(len(uv) - REST, -1) for uv in self.undistorted
        ]

    def fit(self, frequency: float) -> Fitted:
        """Harmonics at a frequency in Hz."""
        return direct.fit_of(self.rig, self.found, 2 * np.pi * frequency, 1)

    @property
    def truth(self) -> ComplexArray:
        """Complex amplitudes of the markers, turned so that bending is real and positive, m."""
        motion, points = self.rig.motion, self.rig.markers.centres
        bending = replace(motion, components=motion.components[:1])
        tip = np.array([[motion.structure.extent[0]], [0.0]])
        phase = np.angle(amplitudes(bending, tip, self.frequency)[0])
        return amplitudes(motion, points, self.frequency) * np.exp(-1j * phase)

    @property
    def maximum(self) -> float:
        """A time at which bending is at its maximum, s."""
        part = self.rig.motion.components[0]
        return self.rig.motion.start + (0.25 - part.phase / (2 * np.pi)) / part.frequency

    @property
    def shapes(self) -> Array:
        """Bending and torsion for amplitude 1 at the markers, shape (markers, 2)."""
        return self.rig.motion.shapes(self.rig.markers.centres).T


# One way from the tracks to a shape.


def found_frequency(recording: Recording, read: float, highest: float) -> tuple[float, Array]:
    """Of the frequencies that show where `read` is, the one at which the cameras agree best, in Hz.

    The lowest, if they agree as well at several. Also how far they disagree at each, over what
    noise makes them.
    """
    every = aliasing.candidates(read, recording.rate, highest)
    misfits = np.array([spectra.misfit(recording.fit(float(f))) for f in every])
    agreed = every[misfits <= AS_WELL * misfits.min()]
    return float(agreed[0]), np.stack([every, misfits])


def instant_frames(recording: Recording, starts: Array) -> Array:
    """Times of the frames that are taken for one instant, shape (..., cameras), in s.

    The first camera's is the one nearest to any maximum, the others' are nearest to that; `starts`
    has the cameras' first steady frames, in s.
    """
    f, count = recording.frequency, len(recording.found[0].times) - REST
    own = starts[..., :1] + np.arange(count) / recording.rate
    off = (own - recording.maximum) * f
    best = np.argmin(np.abs(off - np.rint(off)), axis=-1)[..., None]
    chosen = np.take_along_axis(own, best, axis=-1)
    frames = np.rint((chosen - starts) * recording.rate)
    return np.asarray(starts + np.clip(frames, 0, count - 1) / recording.rate)


def instant_shape(recording: Recording) -> tuple[ComplexArray, Array]:
    """Deflection of the markers by one frame of each camera, and its deviation by noise, m."""
    starts = np.array([own.times[REST] for own in recording.found])
    frames = np.rint((instant_frames(recording, starts) - starts) * recording.rate).astype(int)
    fit, uv = recording.fit(recording.frequency), recording.undistorted
    rest = np.array([mean_of(own[:REST]) for own in uv])
    images = np.array([own[REST + k] for own, k in zip(uv, frames, strict=True)])
    noise = fit.sigma * np.sqrt(1 + 1 / REST)
    return (
        deflection_at(fit.P, fit.frame, rest, images).astype(complex),
        height_deviation(fit.P, fit.frame, fit.points, noise),
    )


def modal(recording: Recording, motion: ComplexArray, noise: Array) -> tuple[ComplexArray, Array]:
    """Amplitudes (..., 2) of bending and torsion in motions (..., markers), and standard errors.

    Least squares on the two shapes over the markers that are known.
    """
    known = np.isfinite(noise)
    inverse = np.linalg.pinv(recording.shapes[known])
    return motion[..., known] @ inverse.T, np.sqrt((inverse**2) @ noise[known] ** 2)


# Trials.


def turned(recording: Recording, presumed: float, starts: Array) -> tuple[Array, bool]:
    """What a fit at another frequency that shows at the same place does to the images.

    Returns
    -------
    phases : ndarray, shape (..., cameras)
        By which they are turned, for cameras that start at `starts`, rad.
    mirrored : bool
        Whether they are mirrored in time, too.
    """
    f, rate = recording.frequency, recording.rate
    steps = np.array([f - presumed, f + presumed]) / rate
    mirrored = bool(np.argmin(np.abs(steps - np.rint(steps))))
    return 2 * np.pi * np.rint(steps[int(mirrored)]) * rate * starts, mirrored


def trial_motions(
    recording: Recording, case: str, presumed: float, trials: int, seed: int, together: bool
) -> ComplexArray:
    """Motions of the markers in trials 1 …, shape (trials, markers), m.

    What is drawn are the cameras' starts, and noise of the centres as large as the tracks show,
    about where the markers truly were; the rest of the way is that of the case, to first order.
    """
    fit = recording.fit(recording.frequency)
    cameras, _, markers = fit.sigma.shape
    starts, noise = np.empty((trials, cameras)), np.empty((trials, 2, cameras, 2, markers))
    for k in range(trials):
        rng = np.random.default_rng([seed, 7, k + 1])
        starts[k] = rng.random() if together else rng.random(cameras)
        noise[k] = rng.standard_normal(noise.shape[1:])
    starts = (starts + np.ceil(recording.rig.motion.steady * recording.rate)) / recording.rate
    seen = np.asarray(np.isfinite(fit.sigma).all(axis=1))
    gains = np.nan_to_num(normal_gain(fit.P, fit.frame, fit.points, seen))
    gains[:, :, seen.sum(axis=0) < 2] = np.nan
    sigma = np.nan_to_num(fit.sigma)
    world = recording.rig.markers.world[:, :markers]
    per_metre = jacobian(fit.P, world)[:, :, 2] * seen[:, None]
    blur = np.sinc(recording.frequency * recording.exposure)
    images = blur * per_metre * recording.truth
    if case == "instant":
        turn = 2 * np.pi * recording.frequency
        at = turn * (instant_frames(recording, starts) - recording.maximum)
        moved = np.real(np.exp(1j * at)[:, :, None, None] * images)
        error = sigma * (noise[:, 0] + noise[:, 1] / np.sqrt(REST))
        return np.einsum("cim,tcim->tm", gains, moved + error).astype(complex)
    phases, mirrored = turned(recording, presumed, starts - recording.maximum)
    moved = np.exp(1j * phases)[:, :, None, None] * images
    spread = np.sqrt([0.5 * (h.covariance[1, 1] + h.covariance[2, 2]) for h in fit.harmonics])
    error = spread * sigma * (noise[:, 0] + 1j * noise[:, 1])
    seen_as = (np.conj(moved) if mirrored else moved) + error
    scale = np.sinc(presumed * recording.exposure)
    return np.asarray(np.einsum("cim,tcim->tm", gains, seen_as) / scale)


# The results of a setting.


def measured_motion(
    recording: Recording, case: str, presumed: float
) -> tuple[ComplexArray, Array, Fitted]:
    """What a way of measuring makes of a recording.

    Returns
    -------
    motion : ndarray, shape (markers,)
        Of the markers, m: of ``instant`` the deflection, else complex amplitudes.
    noise : ndarray, shape (markers,)
        Its standard deviation by the noise of the centres, m.
    fit : Fitted
        The harmonics at the frequency in Hz that is presumed.
    """
    fit = recording.fit(presumed)
    if case == "instant":
        return *instant_shape(recording), fit
    omega = 2 * np.pi * presumed
    motion = amplitude(fit, omega, recording.exposure)
    return motion, deviation(fit, omega, recording.exposure), fit


def case_results(
    recording: Recording,
    case: str,
    presumed: float,
    trials: int,
    seed: int,
    together: bool,
    again: ComplexArray | None = None,
) -> dict[str, Any]:
    """What a way of measuring makes of a recording, as rendered and in trials.

    Those are what it made of other recordings, (trials, markers) in `again`, or drawn.
    """
    reference = recording.truth
    first, noise, fit = measured_motion(recording, case, presumed)
    if again is None:
        again = trial_motions(recording, case, presumed, trials, seed, together)
    motion = np.concatenate([first[None], again])
    parts, errors = modal(recording, motion, noise)
    if case != "instant":
        motion = motion * np.exp(-1j * np.angle(parts[:, :1]))  # to the maximum of bending
    measured, true = motion.real, reference.real
    scale = 100 / np.abs(true).max()
    error = np.abs(measured - true) * scale
    frame = height_deviation(fit.P, fit.frame, fit.points, fit.sigma)
    return {
        "measured_deflection": measured,
        "quadrature_deflection": motion.imag[0] + (np.nan if case == "instant" else 0.0),
        "point_error": error[0],
        "mean_error": np.sqrt(np.nanmean(error**2, axis=-1)),
        "max_point_error": np.nanmax(error, axis=-1),
        "predicted_error": scale * np.sqrt(np.nanmean(noise**2)),
        "mac": assurance(measured, true),
        "missing": np.mean(np.isnan(measured), axis=-1),
        "centre_scatter": np.sqrt(np.nanmean(fit.sigma**2)),
        "signal_over_noise": np.abs(true).max() / np.sqrt(np.nanmean(frame**2)),
        "frequency_used": recording.frequency if case == "instant" else presumed,
        "bending_amplitude": np.abs(parts[:, 0]),
        "torsion_amplitude": np.abs(parts[:, 1]),
        "torsion_phase": np.degrees(np.angle(parts[:, 1] / parts[:, 0]))
        + (np.nan if case == "instant" else 0.0),
        "bending_standard_error": errors[0],
        "torsion_standard_error": errors[1],
    }


def detuned_errors(recording: Recording) -> Array:
    """Mean errors in % of fits at frequencies that are wrong by :data:`CYCLES` per recording."""
    count = len(recording.found[0].times) - REST
    true = recording.truth.real
    errors = []
    for cycles in CYCLES:
        frequency = recording.frequency + cycles * recording.rate / count
        motion = amplitude(recording.fit(frequency), 2 * np.pi * frequency, recording.exposure)
        parts, _ = modal(recording, motion, np.where(np.isnan(motion), np.nan, 1.0))
        shape = np.real(motion * np.exp(-1j * np.angle(parts[0])))
        errors.append(100 * np.sqrt(np.nanmean((shape - true) ** 2)) / np.abs(true).max())
    return np.array(errors)


def recordings(study: LabModes, data: xr.Dataset) -> list[list[Recording]]:
    """The recordings of a study: mode after mode, rate after rate."""
    rigs = beam_rigs(study, study.seed)
    every = [
        Recording(rig, found_in(data, number), study.exposure_ms / 1000)
        for number, rig in enumerate(rigs)
    ]
    n = len(study.frame_rates_hz)
    return [every[start : start + n] for start in range(0, len(every), n)]
