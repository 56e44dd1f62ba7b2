"""Parts (d) to (f) of ``design-law``: cameras at equal pixels per second, estimators, dither.

The thesis asks whether several cameras with few pixels can replace two with many. In part (d) N
cameras on a cone share a number of pixels per second: N × width × height × frames per second is the
same for all. One frame is judged by the error of the beam's markers, all frames together by the
error of an amplitude that is fitted to the motion of the centre.
"""

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np

from thesis_lib.arrays import Array, ArrayLike, IntArray
from thesis_lib.facts import setups
from thesis_lib.figure_sets.design_law.figure_set import DesignLaw
from thesis_lib.figure_sets.design_law.sweeps import exact_rms, mode_shapes, with_std
from thesis_lib.vision import cone_law, dither, interval, rounding, simulation, triangulation
from thesis_lib.vision.analytic_centre import analytic_centre
from thesis_lib.vision.pinhole import CameraArray, on_sensor, pixelate, project

ESTIMATORS = ("least squares", "analytic centre", "interval")  # of all simulations
_RULES = [name.replace(" ", "-") for name in ESTIMATORS]  # as `simulation` names them

MARKER_DIAMETER_M = 0.005  # in chapter 5
# Least height of a marker's image at which the laboratory's tracker follows all markers: in
# `lab-elevation` it loses some, or all, at 1.4 px and below, and none at 1.6 px.
MIN_TRACKED_HEIGHT_PX = 1.5
MAX_FITTED_TRIALS = 100  # of fits to all frames, which take longest
MAX_FRAME_TRIALS = 50  # of one frame: 75 motions each, which give an rms to some percent
_FILM_VALUES = 50_000  # camera × point values at a time, which fit the processor's cache


def equal_pixels(study: DesignLaw) -> dict[str, ArrayLike]:
    """Predict and simulate errors of cameras on a cone around the beam, at equal pixel rates."""
    widths, heights, frame_rate = study.shared
    focal = study.focal_length_mm / study.sensor_width_mm * widths
    angle, distance = np.radians(study.cone_deg), study.cone_distance_mm / 1000
    peak, beam = study.amplitude_mm / 1000, setups.thesis_beam()
    points = mode_shapes(beam, peak)
    law, view, fit = (np.empty(widths.shape) for _ in range(3))
    drawn, drawn_fit = np.empty((2, 2, len(ESTIMATORS), *widths.shape))  # rms and standard error
    for at, setting in zip(np.ndindex(widths.shape), study.settings(), strict=True):
        rig = setting.cameras(study.focal_length_mm, study.sensor_width_mm)
        filmed, peaks, inverse = sample_vibration(float(frame_rate[at]), study)
        images, number = round_images(rig, filmed, study.seed)
        law[at] = exact_rms(rig, points)
        fit[at] = predict_amplitude_error(rig, filmed, inverse)
        view[at] = np.mean(on_sensor(project(rig.P, points[:, 1:]), rig.size))
        frames = one_frame(rig, points, study)
        for e, rule in enumerate(_RULES):
            drawn[:, e, *at] = simulation.rms_with_std(frames[e])
            (found,) = simulation.estimate_points(rig.P, images, [rule])
            height = found[2][number]
            waves = (inverse[:, :2] @ height[..., None])[..., 0]
            wrong = np.linalg.norm(waves, axis=1) - peaks
            drawn_fit[:, e, *at] = simulation.rms_with_std(wrong)
    percent = 100 / peak
    counts = np.array(study.counts)[:, None]
    centre = percent * cone_law.cone_deflection_error(distance, focal, counts, angle)
    motion = peak * np.sin(angle) * focal / distance
    return {
        "width_px": widths,
        "height_px": heights,
        "frame_rate": frame_rate,
        "pixel_size": distance / focal,
        "marker_spacing": beam.marker_spacing * focal / distance,
        "marker_height": MARKER_DIAMETER_M * np.cos(angle) * focal / distance,
        "motion_px": motion,
        "in_view": view,
        "average_error": centre,
        "frame_error": percent * law,
        **with_std("drawn_frame_error", percent * drawn),
        # One frame has the errors of two roundings; an amplitude has 2/n of the variance of one.
        "independent_fit_error": centre / np.sqrt(frame_rate * study.duration_s),
        "useful_frames": dither.useful_frames(
            motion[..., None] * spread_factors(MAX_FITTED_TRIALS)
        ),
        "fit_error": percent * fit,
        **with_std("drawn_fit_error", percent * drawn_fit),
    }


def one_frame(rig: CameraArray, points: Array, study: DesignLaw) -> Array:
    """Return rms deflection errors (estimators, trials) in m of markers (3, 1 + modes, m)."""
    trials = min(study.trials, MAX_FRAME_TRIALS)
    shifts = rounding.grid_shifts(study.seed, trials, len(rig))[1:]
    measured = [
        simulation.measure_deflections(rig, points, shifts, estimator=rule) for rule in _RULES
    ]
    error = np.stack(measured) - points[2, 1:, None]
    return np.asarray(np.sqrt(np.mean(error**2, axis=(1, 3))))  # modes and markers share a grid


def spread_factors(n: int) -> Array:
    """Return `n` factors between 0.5 and 1.5 whose mean is 1."""
    return 0.5 + (np.arange(n) + 0.5) / n


def sample_vibration(frame_rate: float, study: DesignLaw) -> tuple[Array, Array, Array]:
    """Sample a vibration of the centre along Z as a camera does, with random phases.

    Returns the positions of the point in m, shape (3, trials, frames), its amplitudes in m, shape
    (trials,), and the pseudo-inverse of their fit: rows for cosine, sine and constant, shape
    (trials, 3, frames). Amplitudes differ, so that effects of their fraction of a pixel average
    out.
    """
    trials, n_frames = min(study.trials, MAX_FITTED_TRIALS), round(frame_rate * study.duration_s)
    random = np.random.default_rng(study.seed)
    peaks = study.amplitude_mm / 1000 * spread_factors(trials)
    start = random.uniform(0, 2 * np.pi, (trials, 1))
    turn = 2 * np.pi * study.frequency_hz * np.arange(n_frames) / frame_rate + start
    points = np.zeros((3, trials, n_frames))
    points[2] = peaks[:, None] * np.cos(turn)
    basis = np.stack([np.cos(turn), np.sin(turn), np.ones_like(turn)], axis=2)
    return points, peaks, np.linalg.pinv(basis)


def round_images(rig: CameraArray, filmed: Array, seed: int) -> tuple[Array, IntArray]:
    """Round the images of a moving point; return distinct ones (cameras, 2, m) and their indices.

    The indices have the shape (trials, frames). All frames of a camera share one pixel grid, so
    frames of a trial have the same pixels where the point moves too little to change them. Sorted
    by the height of the point, such frames are neighbours.
    """
    trials, n_frames = filmed.shape[1:]
    shifts = np.moveaxis(rounding.grid_shifts(seed, trials, len(rig))[1:], 0, 2)[..., None]
    order = np.argsort(filmed[2], axis=1)
    points = np.take_along_axis(filmed, order[None], axis=2)
    images, number = [], np.empty(order.shape, np.int64)
    at_once = max(1, _FILM_VALUES // (len(rig) * n_frames))
    before = 0
    for first in range(0, trials, at_once):
        part = slice(first, first + at_once)
        shift = shifts[:, :, part]
        pixels = pixelate(project(rig.P, points[:, part]) + shift) - shift
        other = np.ones(pixels.shape[2:], bool)
        other[:, 1:] = (pixels[..., 1:] != pixels[..., :-1]).any(axis=(0, 1))
        counted = before + np.cumsum(other).reshape(other.shape) - 1
        np.put_along_axis(number[part], order[part], counted, axis=1)
        images.append(pixels[..., other])
        before += images[-1].shape[2]
    return np.concatenate(images, axis=2), number


def predict_amplitude_error(rig: CameraArray, filmed: Array, inverse: Array) -> float:
    """Return the rms amplitude error in m by the law, to first order.

    All frames share one pixel grid. On a cone all cameras see the same motion, only in v.
    """
    v = project(rig.P[:1], filmed)[0, 1]
    each = cone_law.error_of_sum(v, inverse[:, 0])
    g = triangulation.triangulation_gain(rig.P, np.zeros(3))[2]
    return float(np.sqrt(np.mean(each**2) * np.sum(g**2)))


NOISES_PX = (0.0, 0.01, 0.02, 0.05, 0.1, 0.2, 0.3, 0.5)
# Wrong assumptions of `interval`: the true noise in px, the assumed noise in px, and the share of
# image coordinates that are outliers by OUTLIER_PX.
ASSUMED_MISTAKES = {
    "0.2 px, told 0.05 px": (0.2, 0.05, 0.0),
    "none, told 0.1 px": (0.0, 0.1, 0.0),
    "0.05 px, and 2 % outliers": (0.05, 0.05, 0.02),
}
OUTLIER_PX = 2.0  # px from the right pixel, more than the noise of ASSUMED_MISTAKES explains
DRAWS_PER_TRIAL, MAX_DRAWS = 5, 1000  # markers per trial, and markers in all
_MIN_GAIN = 0.02  # share of the error; smaller gains count as none


def noisy_shares(study: DesignLaw) -> dict[str, ArrayLike]:
    """Simulate deflection errors of every number of cameras, with every noise and mistake."""
    slowest = int(np.argmin(study.frame_rates_hz))
    settings = study.settings()[slowest :: len(study.frame_rates_hz)]
    shape = (len(settings), len(NOISES_PX))
    drawn = np.empty((2, *shape, len(ESTIMATORS)))  # rms and standard error
    least = np.zeros(shape)
    agreeing = np.empty((len(settings), len(ASSUMED_MISTAKES)))
    mistaken = np.empty((2, *agreeing.shape, len(ESTIMATORS)))
    for i, setting in enumerate(settings):
        rig = setting.cameras(study.focal_length_mm, study.sensor_width_mm)
        random = np.random.default_rng([study.seed, len(rig)])
        points = simulation.move_markers(random, min(DRAWS_PER_TRIAL * study.trials, MAX_DRAWS))
        shifts = rounding.grid_shifts(study.seed, points.shape[2], len(rig))[1:]
        shift = np.moveaxis(shifts, 0, 2)[:, :, None]
        images = project(rig.P, points) + shift
        noise = random.standard_normal(images.shape)
        moved = points[2, 1] - points[2, 0]
        for k, sigma in enumerate(NOISES_PX):
            pixels = np.rint(images + sigma * noise) - shift
            z = simulation.estimate_points(rig.P, pixels, _RULES, sigma)[:, 2]
            wrong = z[:, 1] - z[:, 0] - moved
            drawn[:, i, k] = simulation.rms_with_std(wrong.T)
            if sigma:
                variance = interval.least_covariance(rig.P, points, sigma)[2, 2].sum(axis=0)
                least[i, k] = np.sqrt(np.mean(variance))
        # Half of the outliers lie to each side
        lottery = random.random(images.shape)
        for k, (sigma, told, share) in enumerate(ASSUMED_MISTAKES.values()):
            aside = (lottery < share / 2).astype(float) - (lottery > 1 - share / 2)
            pixels = np.rint(images + sigma * noise + OUTLIER_PX * aside) - shift
            found = interval.interval_estimate(rig.P, pixels, told)
            centre = analytic_centre(rig.P, pixels).points
            z = np.stack([triangulation.triangulate(rig.P, pixels)[2], centre[2], found.points[2]])
            wrong = z[:, 1] - z[:, 0] - moved
            mistaken[:, i, k] = simulation.rms_with_std(wrong.T)
            agreeing[i, k] = np.mean(found.feasible)
    gains = 1 - drawn[0] / drawn[0, ..., :1]
    return {
        **with_std("noisy_share_error", drawn),
        "least_share_error": least,
        "equal_pixels_tolerated_noise": [[half_gain_noise(of) for of in gain.T] for gain in gains],
        **with_std("mistaken_error", mistaken),
        "feasible_fraction": agreeing,
    }


def half_gain_noise(gains: Array, noises: Sequence[float] = NOISES_PX) -> float:
    """Return the noise in px that halves the first of the gains at `noises`, NaN if none does."""
    below = np.flatnonzero(gains < gains[0] / 2)
    if gains[0] < _MIN_GAIN or not below.size:
        return float("nan")
    pair = slice(below[0] - 1, below[0] + 1)
    return float(np.interp(-gains[0] / 2, -gains[pair], noises[pair]))


# (e) Estimators for whole pixels, and (f) dither.

EQUIDISTANT_COUNTS = (4, 8, 12, 16, 32, 64)  # cameras at CROWD_DISTANCE_M
CROWD_DISTANCE_M = 0.75
RIG_NOISES_PX = (0.0, 0.05, 0.1, 0.15, 0.2, 0.3)  # of NOISY_CAMERAS
NOISY_CAMERAS = 12
SEARCHED_NOISES_PX = (0.0, 0.01, 0.02, 0.03, 0.05, 0.1, 0.15, 0.2)  # px, searched for a tolerance
NOISY_LAYOUTS, NOISY_LAYOUT_CAMERAS = 150, 640  # limits there: layouts, and cameras in all layouts
COMPARED_ESTIMATORS = ("least-squares", "analytic-centre")
UNEQUAL_DISTANCES_M = ((0.75,) * 4, (0.5, 1.5, 1.5, 3.0), (0.3, 0.3, 3.0, 3.0))
SHARP_SIZE_PX, SHARP_FOCAL_PX = (1920, 1080), 1280.0  # where distances differ
MAX_LAYOUTS, MAX_MARKERS = 30, 100
FITTED_AMPLITUDES_PX = np.round(np.geomspace(0.05, 10, 47), 4)
SHAKES_PX = np.round(np.linspace(0, 1, 21), 9)  # standard deviations
DISC_DIAMETERS_PX = np.arange(2.0, 13.0)
SHAKE_FRAMES = 100  # of a shaking camera
SINUSOID_FRAMES = 997  # frames of a sinusoid, for all phases


def simulate_estimators(study: DesignLaw) -> dict[str, ArrayLike]:
    """Simulate deflection errors over random layouts by cameras, pixel noise and distances."""
    layouts = min(MAX_LAYOUTS, study.trials)

    def errors(stand: tuple[float, ...], **how: Any) -> Array:
        return simulation.deflection_errors(stand, layouts, MAX_MARKERS, seed=study.seed, **how)

    lens = {"focal_px": SHARP_FOCAL_PX, "size": SHARP_SIZE_PX}
    sharp = [errors(stand, **lens) for stand in UNEQUAL_DISTANCES_M]
    # each rig is simulated once: those without noise are in `clean`
    clean = {n: errors((CROWD_DISTANCE_M,) * n) for n in EQUIDISTANT_COUNTS}
    crowd = (CROWD_DISTANCE_M,) * NOISY_CAMERAS
    noisy = [errors(crowd, noise_px=n) if n else clean[NOISY_CAMERAS] for n in RIG_NOISES_PX]
    few = min(NOISY_LAYOUTS, study.trials)
    return {
        "tolerated_noise": [
            noise_tolerance(n, min(few, NOISY_LAYOUT_CAMERAS // n), study.seed) for n in clean
        ],
        **_name_errors("equidistant_rig_error", clean.values()),
        **_name_errors("noise_error", noisy),
        "unequal_distance_error": np.median(sharp, axis=1),  # some layouts have huge errors
    }


def _name_errors(name: str, drawn: Iterable[Array]) -> dict[str, ArrayLike]:
    """Return the rms of drawn errors as a variable and their standard errors as another."""
    return with_std(name, zip(*map(simulation.rms_with_std, drawn), strict=True))


def noise_tolerance(n_cameras: int, layouts: int, seed: int) -> float:
    """Return the noise in px before rounding that halves the gain of the analytic centre.

    The gain is the relative reduction of the error compared with least squares. NaN if it is too
    small, as for few layouts; infinite if no noise halves it.
    """
    stand, gains = (CROWD_DISTANCE_M,) * n_cameras, np.empty(0)
    how: Any = {"seed": seed, "rules": COMPARED_ESTIMATORS}
    for noise in SEARCHED_NOISES_PX:
        errors = simulation.deflection_errors(stand, layouts, MAX_MARKERS, noise, **how)
        least, centre = simulation.rms_over_layouts(errors)
        gains = np.append(gains, 1 - centre / least)
        if gains[0] < _MIN_GAIN:
            return float("nan")
        if gains[-1] < gains[0] / 2:
            return half_gain_noise(gains, SEARCHED_NOISES_PX)
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
        return _name_errors(f"drawn_{of.__name__}_error", map(of, np.asarray(values).tolist()))

    return {
        "fitted_amplitude_error": np.sqrt(dither.amplitude_variance(FITTED_AMPLITUDES_PX)),
        **simulate_each(fitted_amplitude, FITTED_AMPLITUDES_PX),
        "shake_error": np.sqrt(dither.shaken_variance(SHAKE_FRAMES, SHAKES_PX)),
        "endless_shake_error": np.sqrt(dither.mean_variance(0.0, SHAKES_PX)),
        **simulate_each(shake, SHAKES_PX),
        "disc_error": [dither.disc_variance(one) ** 0.5 for one in DISC_DIAMETERS_PX],
        **simulate_each(disc, DISC_DIAMETERS_PX),
    }
