"""Trials: what the laboratory would have given on other days.

They cannot be filmed again: they are drawn at the level of markers, from the harmonics that were
fitted to the tracks: new starts of the cameras, new errors of their clocks, new noise of the
centres, of the size that the tracks show. A trial's draw depends on the seed and its number alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr

from thesis_lib.arrays import Array
from thesis_lib.figure_sets.experiment.methods import (
    WHOLE_FRAMES,
    Instant,
    Tracks,
    interpolation_gain,
)
from thesis_lib.figure_sets.experiment.parameters import Experiment
from thesis_lib.laboratory.film import SAMPLE_RATE
from thesis_lib.laboratory.parameters import NAMES
from thesis_lib.laboratory.rig import LATE
from thesis_lib.measure.fitting import reconstruction as rc
from thesis_lib.measure.fitting.harmonics import amplitude, unblurred
from thesis_lib.measure.synchronisation.delays import delay_deviation


@dataclass(frozen=True)
class Draws:
    """What differs from trial to trial, for all four cameras."""

    starts: Array  #: True starts, s, shape (trials, cameras)
    clocks: Array  #: Errors of the aligned clocks, s, shape (trials, cameras)
    #: Of centres at rest and in motion, with a standard deviation of one, shape
    #: (trials, 2, cameras, 2, markers)
    noise: Array
    #: From 0 to 1: which frames lend their errors of the template match, shape
    #: (trials, 2, cameras)
    picks: Array


def draw(study: Experiment, data: xr.Dataset) -> Draws:
    """What all trials draw."""
    seconds = float(data["steady"][1] - data["steady"][0])
    sigma = delay_deviation(
        study.frequency_hz, 10 ** (study.audio_noise_db / 10), int(seconds * SAMPLE_RATE)
    )
    n = len(NAMES)
    starts, clocks = np.empty((2, study.trials, n))
    noise = np.empty((study.trials, 2, n, 2, data.sizes["marker"]))
    picks = np.empty((study.trials, 2, n))
    for k in range(study.trials):
        rng = np.random.default_rng([study.seed, 5, k + 1])
        starts[k], clocks[k] = rng.uniform(0, LATE, n), sigma * rng.standard_normal(n)
        noise[k], picks[k] = rng.standard_normal(noise.shape[1:]), rng.random((2, n))
    return Draws(starts, clocks, noise, picks)


def trials(
    tracks: Tracks,
    instant: Instant,
    method: str,
    draws: Draws,
    index: Sequence[int],
    exposures: Array,
) -> Array:
    """Deflections of all markers in trials 1 …, shape (trials, markers), m."""
    P, rate, sigma = tracks.P, tracks.rate, tracks.sigma
    starts, clocks = draws.starts[:, index], draws.clocks[:, index]
    clocks = clocks - clocks[:, :1]  # errors are those against the reference
    noise = draws.noise[:, :, index]
    rest_error = sigma / np.sqrt(tracks.rest_frames) * noise[:, 0]
    if method == "harmonic":
        return _harmonic_trials(tracks, instant, clocks, noise[:, 1], exposures)
    delay = starts - starts[:, :1]
    if method in WHOLE_FRAMES:
        # The reference's frames fall as they like; the others follow in whole frames.
        _, chosen = instant.nearest(rate, starts[:, :1] * rate)
        left = (delay + clocks) * rate
        at = chosen + (left - np.rint(left)) / rate
        error = sigma * noise[:, 1]
        if tracks.match_errors is not None:
            picks = draws.picks[:, :, index]
            rest_error = _picked(tracks.match_errors.rest, picks[:, 0])
            error = _picked(tracks.match_errors.moved, picks[:, 1])
    else:
        at = instant.times[0] + clocks
        scale = np.array([interpolation_gain(f) for f in ((starts * rate) % 1).ravel()])
        error = scale.reshape(at.shape)[:, :, None, None] * sigma * noise[:, 1]
    images = np.stack(
        [own.at(instant.omega, at[:, i]) for i, own in enumerate(tracks.harmonics)], axis=1
    )
    pair = np.stack([tracks.still + rest_error, images + error])  # at rest, in motion
    both = np.isfinite(pair).all(axis=0)
    pair = np.where(both, pair, np.nan).transpose(2, 3, 0, 1, 4)
    points, _ = rc.triangulate_seen(P, pair)
    height = tracks.frame.to_beam(points)[2]
    return np.asarray(height[1] - height[0])


def _picked(pools: list[Array], picks: Array) -> Array:
    """Errors of frames of each camera, chosen by numbers (trials, cameras) from 0 to 1."""
    chosen = [
        pool[(pick * len(pool)).astype(int)] for pool, pick in zip(pools, picks.T, strict=True)
    ]
    return np.stack(chosen, axis=1)


def _harmonic_trials(
    tracks: Tracks, instant: Instant, clocks: Array, noise: Array, exposures: Array
) -> Array:
    """Trials of the harmonic fit: its first harmonic with noise, the clocks in error.

    The phase is free in the fit, so of the noise of the two coefficients only the part in phase
    with the motion counts; the mean and the second harmonic carry none of the deflection.
    """
    fitted = unblurred(tracks, instant.omega, exposures)
    base = rc.real_shape(amplitude(tracks, instant.omega, exposures), instant.phase)
    seen = np.asarray(np.isfinite(tracks.sigma).all(axis=1))
    gains = rc.normal_gain(tracks.P, tracks.frame, tracks.points, seen)
    spread = np.sqrt([0.5 * (h.covariance[1, 1] + h.covariance[2, 2]) for h in fitted])
    by_noise = np.einsum("cim,tcim->tm", gains, np.nan_to_num(spread * tracks.sigma) * noise)
    # A clock that is wrong by e turns the camera's image by ωe: cos(ωe) − 1 of it is lost.
    image = np.array([h.coefficients[1] - 1j * h.coefficients[2] for h in fitted])
    image = np.nan_to_num(np.real(image * np.exp(-1j * instant.phase)))
    by_clock = np.einsum("cim,tc,cim->tm", gains, np.cos(instant.omega * clocks) - 1, image)
    return np.asarray(base + by_noise + by_clock)
