"""The measurement of estimators: refinement at equal and unequal distances, repeatability."""

import numpy as np
import pytest

from thesis_lib.vision.simulation import (
    CHECK_SIZE_PX,
    ESTIMATORS,
    deflection_errors,
    rms_over_layouts,
)

LINEAR, REFINED = (ESTIMATORS.index(name) for name in ("linear", "least-squares"))


# Micrometres of an independent prototype: linear, refined; nothing at equal distances. It did not
# state its pixels; those of 1920×1080 px give its figures, as medians over the layouts.
@pytest.mark.slow
def test_refinement_pays_where_distances_differ(conforms):
    linear, refined = 369, 89.5
    errors = deflection_errors([0.3, 0.3, 3, 3], 200, focal_px=1280, size=(1920, 1080))
    found = 1e6 * np.median(errors, axis=0)
    conforms.independent(found[LINEAR], linear, rtol=0.15)
    conforms.independent(found[REFINED], refined, rtol=0.15)
    conforms.independent(found[REFINED] / found[LINEAR], refined / linear, atol=0.08)


@pytest.mark.nightly
def test_refinement_gains_nothing_at_equal_distances(conforms):
    errors = np.median(deflection_errors([0.75] * 4, layouts=200), axis=0)
    conforms.sampled(errors[REFINED] / errors[LINEAR], 1, atol=0.01)


def test_layouts_do_not_depend_on_how_many_there_are_or_on_noise(conforms):
    few, many = deflection_errors([0.75] * 4, 2), deflection_errors([0.75] * 4, 5)
    conforms.invariance(few, many[:2], atol=0)
    conforms.invariance(few, deflection_errors([0.75] * 4, 2, noise_px=1e-12), atol=0)
    assert not np.allclose(few, deflection_errors([0.75] * 4, 2, seed=1))


def test_errors_shrink_with_the_pixels(conforms):
    coarse = rms_over_layouts(deflection_errors([0.75] * 8, 40))
    size = (4 * CHECK_SIZE_PX[0], 4 * CHECK_SIZE_PX[1])
    fine = rms_over_layouts(
        deflection_errors([0.75] * 8, 40, focal_px=4 * 24 / 36 * 320, size=size)
    )
    conforms.order(coarse / fine, 4, rtol=0.1)
