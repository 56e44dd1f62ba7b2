"""Equal pixels per second with noise before rounding: what each estimator makes of them.

The cameras are those of :mod:`thesis_lib.figure_sets.design_law.shares` at the lowest frame rate.
Noise is the same number of pixels for coarse and sharp cameras, so by least squares their number
makes no difference, however much there is. The same cameras show what wrong noise costs.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from thesis_lib.arrays import Array
from thesis_lib.figure_sets.design_law.parameters import DesignLaw
from thesis_lib.vision import estimators, rounding
from thesis_lib.vision.analytic_centre import analytic_centre
from thesis_lib.vision.interval import interval
from thesis_lib.vision.pinhole import project
from thesis_lib.vision.pixel_noise import least_covariance
from thesis_lib.vision.triangulation import triangulate

APPROACHES = {
    "least squares": "least-squares",
    "analytic centre": "analytic-centre",
    "interval": "interval",
}
NOISES = (0.0, 0.01, 0.02, 0.05, 0.1, 0.2, 0.3, 0.5)  # px
# What `interval` may not know: the noise in px, the noise in px that it is told, and the share of
# image coordinates that lie OUTLIER_PX to one side.
MISTAKES = {
    "0.2 px, told 0.05 px": (0.2, 0.05, 0.0),
    "none, told 0.1 px": (0.0, 0.1, 0.0),
    "0.05 px, and 2 % outliers": (0.05, 0.05, 0.02),
}
OUTLIER_PX = 2.0  # pixels next to the right one, which no noise of MISTAKES explains
DRAWS, MOST_DRAWS = 5, 1000  # markers for each trial, and altogether
_GAIN = 0.02  # share of the error: what gains less has nothing to lose


def noisy_shares(study: DesignLaw) -> dict[str, ArrayLike]:
    """Return deflection errors of every number of cameras, with every noise and mistake."""
    slowest = int(np.argmin(study.frame_rates_hz))
    settings = study.settings()[slowest :: len(study.frame_rates_hz)]
    shape = len(settings), len(NOISES)
    drawn, drawn_std = np.empty((2, *shape, len(APPROACHES)))
    least = np.zeros(shape)
    mistaken, mistaken_std = np.empty((2, len(settings), len(MISTAKES), len(APPROACHES)))
    agreeing = np.empty((len(settings), len(MISTAKES)))
    for i, setting in enumerate(settings):
        rig = setting.cameras(study.focal_length_mm, study.sensor_width_mm)
        random = np.random.default_rng([study.seed, len(rig)])
        points = estimators.moved_markers(random, min(DRAWS * study.trials, MOST_DRAWS))
        shifts = rounding.grid_shifts(study.seed, points.shape[2], len(rig))[1:]
        shift = np.moveaxis(shifts, 0, 2)[:, :, None]
        images = project(rig.P, points) + shift
        noise = random.standard_normal(images.shape)
        for k, sigma in enumerate(NOISES):
            pixels = np.rint(images + sigma * noise) - shift
            z = estimators.estimates(rig.P, pixels, list(APPROACHES.values()), sigma)[:, 2]
            wrong = z[:, 1] - z[:, 0] - (points[2, 1] - points[2, 0])
            drawn[i, k], drawn_std[i, k] = estimators.rms_with_std(wrong.T)
            if sigma:
                variance = least_covariance(rig.P, points, sigma)[2, 2].sum(axis=0)
                least[i, k] = np.sqrt(np.mean(variance))
        lottery = random.random(
            images.shape
        )  # below half the share to one side, above to the other
        for k, (sigma, told, share) in enumerate(MISTAKES.values()):
            aside = (lottery < share / 2).astype(float) - (lottery > 1 - share / 2)
            pixels = np.rint(images + sigma * noise + OUTLIER_PX * aside) - shift
            found = interval(rig.P, pixels, told)
            centre = analytic_centre(rig.P, pixels).points
            z = np.stack([triangulate(rig.P, pixels)[2], centre[2], found.points[2]])
            wrong = z[:, 1] - z[:, 0] - (points[2, 1] - points[2, 0])
            mistaken[i, k], mistaken_std[i, k] = estimators.rms_with_std(wrong.T)
            agreeing[i, k] = np.mean(found.feasible)
    gains = 1 - drawn / drawn[..., :1]
    return {
        "noisy_share_error": drawn,
        "noisy_share_error_std": drawn_std,
        "least_share_error": least,
        "share_tolerance": [[halved(of) for of in gain.T] for gain in gains],
        "mistaken_error": mistaken,
        "mistaken_error_std": mistaken_std,
        "feasible_fraction": agreeing,
    }


def halved(gains: Array) -> float:
    """Noise in px at which gains at `NOISES` have fallen to half of the first; NaN without one."""
    below = np.flatnonzero(gains < gains[0] / 2)
    if gains[0] < _GAIN or not below.size:
        return float("nan")
    pair = slice(below[0] - 1, below[0] + 1)
    return float(np.interp(-gains[0] / 2, -gains[pair], NOISES[pair]))
