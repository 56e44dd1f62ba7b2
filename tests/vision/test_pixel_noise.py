"""Information of noisy, rounded pixels against differences, draws and limits; noise found again."""

import numpy as np
import pytest
from scenes.slabs import box, rig, rounded
from scipy.special import ndtr

from thesis_lib.vision.interval import estimate_noise, least_covariance, pixel_information
from thesis_lib.vision.triangulation import point_covariance


@pytest.mark.parametrize("sigma", [0.05, 0.3, 1.0])
def test_information_is_that_of_all_pixels_averaged_over_places(conforms, sigma):
    place, h = np.linspace(-0.5, 0.5, 2001)[:-1, None] + 0.00025, 1e-4
    m = np.arange(-8, 9)

    def chance(u):
        return ndtr((m + 0.5 - u) / sigma) - ndtr((m - 0.5 - u) / sigma)

    slope = (chance(place + h) - chance(place - h)) / (2 * h)
    p = chance(place)
    each = np.where(p > 1e-250, slope**2 / np.maximum(p, 1e-250), 0)
    conforms.independent(np.mean(each.sum(axis=1)), pixel_information(sigma), rtol=1e-3)


def test_information_has_its_limits(conforms):
    wide = np.array([1.0, 3.0])
    conforms.closed_form([pixel_information(s) * (s**2 + 1 / 12) for s in wide], 1, atol=1e-3)
    narrow = np.array([1e-4, 1e-3, 1e-2])
    scaled = [pixel_information(s) * s for s in narrow]
    conforms.invariance(scaled, scaled[0], rtol=1e-6)
    third = pixel_information(0.3) * (0.3**2 + 1 / 12)
    conforms.closed_form(third, above=1.0, below=1.025)


def test_least_covariance_is_that_of_least_squares_for_much_noise(conforms):
    P, points = rig(5).P, box(4)
    expected = point_covariance(P, points, np.sqrt(4 + 1 / 12))
    conforms.closed_form(least_covariance(P, points, 2.0), expected, rtol=1e-4)


@pytest.mark.few(2)
@pytest.mark.parametrize(("n", "sigma"), [(3, 0.3), (4, 0.1), (12, 0.02), (12, 0.1), (12, 0.4)])
def test_noise_is_found_again(conforms, n, sigma):
    P = rig(n).P
    within = 0
    for seed in range(5):
        found = estimate_noise(P, rounded(P, box(400, seed), sigma, seed))
        assert found.least <= found.best <= found.most
        conforms.sampled(found.best, sigma, atol=0.01 + 0.08 * sigma)
        within += found.least <= sigma <= found.most
    if sigma >= 0.1:
        assert within >= 3  # 95 % of the intervals are meant to hold it


def test_what_pixels_cannot_tell_is_said():
    P = rig(2).P
    few = estimate_noise(P, rounded(P, box(3), 0.1))
    assert few.least == 0
    assert few.most > 0.2
    clean = estimate_noise(P, rounded(P, box(300)))
    assert clean.least == 0


def test_points_that_are_not_seen_are_left_out_and_without_any_it_is_refused(conforms):
    P = rig(6).P
    uv = rounded(P, box(60), 0.1)
    holed = np.concatenate([uv, np.full((6, 2, 9), np.nan)], axis=2)
    one, other = estimate_noise(P, uv), estimate_noise(P, holed)
    conforms.invariance(one.best, other.best, atol=0)
    with pytest.raises(ValueError, match="uv: given no point"):
        estimate_noise(P, holed[..., 60:])
    for sigma in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(ValueError, match="sigma_px: given"):
            pixel_information(sigma)
