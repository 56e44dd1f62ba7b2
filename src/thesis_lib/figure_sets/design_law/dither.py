"""Parts (e) and (f) of ``design-law``: estimators for whole pixels, and dither."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from thesis_lib.arrays import Array
from thesis_lib.figure_sets.design_law.parameters import DesignLaw
from thesis_lib.vision import dither, simulation
from thesis_lib.vision.pinhole import pixelate
from thesis_lib.vision.simulation import rms_with_std

EQUIDISTANT_COUNTS = (4, 8, 12, 16, 32, 64)  # cameras at DISTANCE
CROWD_DISTANCE_M = 0.75  # m
NOISES_PX = (0.0, 0.05, 0.1, 0.15, 0.2, 0.3)  # px, of NOISY cameras
NOISY_CAMERAS = 12
WITH_NOISE = (0.0, 0.01, 0.02, 0.03, 0.05, 0.1, 0.15, 0.2)  # px, where a tolerance is looked for
NOISY_LAYOUTS = 10  # layouts there
COMPARED_ESTIMATORS = ("least-squares", "analytic-centre")
UNEQUAL_DISTANCES_M = ((0.75,) * 4, (0.5, 1.5, 1.5, 3.0), (0.3, 0.3, 3.0, 3.0))  # m
SHARP_SIZE_PX, SHARP_FOCAL_PX = (1920, 1080), 1280.0  # where distances differ
MAX_LAYOUTS, MAX_MARKERS = 30, 100  # at most
FITTED_AMPLITUDES_PX = np.round(np.geomspace(0.05, 10, 47), 4)  # px, amplitudes
SHAKES_PX = np.round(np.linspace(0, 1, 21), 9)  # px, standard deviations
DISC_DIAMETERS_PX = np.arange(2.0, 13.0)  # px, diameters
SHAKE_FRAMES = 100  # of a shaking camera
SINUSOID_FRAMES = 997  # frames of a sinusoid, for all phases
DRAWS_PER_TRIAL = 5  # for each trial


def simulate_estimators(study: DesignLaw) -> dict[str, ArrayLike]:
    """Simulate deflection errors over random layouts by cameras, pixel noise and distances."""
    layouts = min(MAX_LAYOUTS, study.trials)

    def crowded(n_cameras: int, noise_px: float) -> Array:
        stand = (CROWD_DISTANCE_M,) * n_cameras
        return simulation.deflection_errors(stand, layouts, MAX_MARKERS, noise_px, seed=study.seed)

    def sharp_errors(stand: tuple[float, ...]) -> Array:
        errors = simulation.deflection_errors(
            stand, layouts, MAX_MARKERS, 0.0, SHARP_FOCAL_PX, SHARP_SIZE_PX, study.seed
        )
        return np.asarray(np.median(errors, axis=0))  # some layouts are hopeless

    # what is asked for several times is drawn once: fewer layouts are the first of more
    clean = {n: crowded(n, 0.0) for n in EQUIDISTANT_COUNTS}
    noisy = [
        crowded(NOISY_CAMERAS, noise) if noise else clean[NOISY_CAMERAS] for noise in NOISES_PX
    ]
    compared = [simulation.ESTIMATORS.index(rule) for rule in COMPARED_ESTIMATORS]
    return {
        "tolerated_noise": [
            noise_tolerance(
                n,
                min(NOISY_LAYOUTS, layouts),
                study.seed,
                errors[:NOISY_LAYOUTS].take(compared, axis=1),
            )
            for n, errors in clean.items()
        ],
        **_name_errors(
            "equidistant_rig_error", [rms_with_std(errors) for errors in clean.values()]
        ),
        **_name_errors("noise_error", [rms_with_std(errors) for errors in noisy]),
        "unequal_distance_error": [sharp_errors(stand) for stand in UNEQUAL_DISTANCES_M],
    }


def _name_errors(name: str, found: list[tuple[Array, Array]]) -> dict[str, ArrayLike]:
    """Return drawn errors as a variable and their standard errors as another."""
    errors, stds = zip(*found, strict=True)
    return {name: np.array(errors), f"{name}_std": np.array(stds)}


def noise_tolerance(n_cameras: int, layouts: int, seed: int, clean: Array | None = None) -> float:
    """Return the noise in px before the rounding that leaves the analytic centre half of its gain.

    The gain is how much less than that of least squares its error is, relative to it. Errors
    (layouts, 2) without noise are drawn unless they are given.
    """
    gains = []
    for noise in WITH_NOISE:
        errors = clean
        if noise or errors is None:
            errors = simulation.deflection_errors(
                (CROWD_DISTANCE_M,) * n_cameras,
                layouts,
                MAX_MARKERS,
                noise,
                seed=seed,
                rules=COMPARED_ESTIMATORS,
            )
        least, centre = simulation.over_layouts(errors)
        gains.append(1 - centre / least)
        if gains[-1] < gains[0] / 2:
            return float(
                np.interp(
                    -gains[0] / 2, -np.array(gains[-2:]), WITH_NOISE[len(gains) - 2 : len(gains)]
                )
            )
    return float("inf")


def simulate_dither(study: DesignLaw) -> dict[str, ArrayLike]:
    """Compute the residual rounding error by motion, shake and size: closed forms, and drawn."""
    random = np.random.default_rng([study.seed, 1])
    draws = DRAWS_PER_TRIAL * study.trials
    theta = 2 * np.pi * (np.arange(SINUSOID_FRAMES) + 0.5) / SINUSOID_FRAMES
    place = random.uniform(-0.5, 0.5, (draws, 1))

    def fitted_amplitude(a: float) -> Array:
        seen = pixelate(place + a * np.cos(theta))
        return np.asarray(2 * np.mean(seen * np.cos(theta), axis=1) - a)

    def shake(s: float) -> Array:
        seen = pixelate(place + s * random.standard_normal((draws, SHAKE_FRAMES)))
        return np.asarray(np.mean(seen, axis=1) - place[:, 0])

    def disc(diameter: float) -> Array:
        reach = np.arange(-np.ceil(diameter), np.ceil(diameter) + 1)
        x, y = random.uniform(-0.5, 0.5, (2, draws, 1, 1))
        black = (reach - x) ** 2 + (reach[:, None] - y) ** 2 <= diameter**2 / 4
        return np.asarray((black * reach).sum(axis=(1, 2)) / black.sum(axis=(1, 2)) - x[:, 0, 0])

    def simulate_each(of: Callable[[float], Array], values: ArrayLike) -> dict[str, ArrayLike]:
        found = [rms_with_std(of(float(one))) for one in np.asarray(values)]
        return _name_errors(f"drawn_{of.__name__}_error", found)

    return {
        "fitted_amplitude_error": np.sqrt(dither.amplitude_variance(FITTED_AMPLITUDES_PX)),
        **simulate_each(fitted_amplitude, FITTED_AMPLITUDES_PX),
        "shake_error": np.sqrt(dither.shaken_variance(SHAKE_FRAMES, SHAKES_PX)),
        "endless_shake_error": np.sqrt(dither.mean_variance(0.0, SHAKES_PX)),
        **simulate_each(shake, SHAKES_PX),
        "disc_error": [dither.disc_variance(one) ** 0.5 for one in DISC_DIAMETERS_PX],
        **simulate_each(disc, DISC_DIAMETERS_PX),
    }
