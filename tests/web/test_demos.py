"""The experiments on the law of rounding draw the library's law, and can be used."""

from contextlib import contextmanager

import numpy as np
import pytest
from browser import open_offline, write_page

from thesis_lib.book import explorer
from thesis_lib.facts import setups
from thesis_lib.vibration.structure import deflection_shape, world_points
from thesis_lib.vision.pinhole import hemisphere_cameras
from thesis_lib.vision.rounding import deflection_variance, difference_variance


@pytest.fixture
def show(chromium, tmp_path):
    @contextmanager
    def opened(name, width=900, query=""):
        file = write_page(tmp_path / f"{name}.html", explorer.write_experiment(name))
        with open_offline(chromium, file, width, query=query) as page:
            yield page
            assert page.sideways_px() == 0

    return opened


def run(opened, script):
    """A script in which `demo` is what the experiment offers to tests."""
    return opened.page.evaluate(
        f"() => {{ const {{ demo }} = document.querySelector('.tl-demo'); {script} }}"
    )


def press(opened, name):
    opened.page.get_by_role("button", name=name).click()


def put(opened, label, value):
    opened.page.get_by_role("slider", name=label).fill(str(value))


@pytest.mark.slow
def test_a_marker_is_drawn_as_the_library_draws_it(show):
    motions = [0.0, 0.05, 0.5, 1.0, 1.3, 2.75]
    with show("rounding_marker") as opened:
        law = run(opened, f"return {motions}.map(demo.law)")
        np.testing.assert_allclose(law, np.sqrt(difference_variance(motions)), atol=1e-12)
        put(opened, "Motion", 0.4)
        for _ in range(10):
            press(opened, "200 random grids")
        opened.page.wait_for_function(
            "() => document.querySelector('.tl-demo').demo.found.get(0.4)?.length === 2000"
        )
        errors = np.array(run(opened, "return demo.found.get(0.4)"))
        np.testing.assert_allclose(np.sort(np.unique(errors.round(9))), [-0.4, 0.6])
        assert np.mean(errors > 0) == pytest.approx(0.4, abs=4 * np.sqrt(0.24 / 2000))
        opened.page.locator(".tl-summary", has_text="Of 2000 draws").wait_for()
        put(opened, "Motion", 2)
        opened.page.wait_for_timeout(100)
        told = opened.page.locator(".tl-summary").inner_text()
        assert told == "A motion of 2 px is measured without error on every grid."


@pytest.mark.slow
def test_two_cameras_have_the_law_of_the_library(show):
    angles = np.radians([[90, 40], [-90, 40]])
    cameras = hemisphere_cameras(0.5, *angles.T, 24 / 36 * 320, (320, 180))
    law = 1e3 * np.sqrt(deflection_variance(cameras.P, [0, 0, 0], [0, 0, 2e-3]))
    with show("rounding_point") as opened:
        put(opened, "Elevation", 40)
        put(opened, "Deflection", 2)
        press(opened, "400 random pairs")
        opened.page.locator(".tl-summary", has_text="400 draws").wait_for()
        assert run(opened, "return demo.law(demo.state).sigma") == pytest.approx(law, rel=0.02)
        errors = np.array(run(opened, "return demo.errors()"))
        assert np.sqrt(np.mean(errors**2)) == pytest.approx(law, rel=0.15)


def test_a_beam_has_the_law_of_the_library(show):
    beam = setups.thesis_beam()
    shape = deflection_shape(beam, 2, beam.markers, 5.5e-3)
    azimuths = (np.arange(6) + 0.3) * 2 * np.pi / 6
    cameras = hemisphere_cameras(
        0.5, azimuths, np.full(6, np.radians(35)), 24 / 36 * 320, (320, 180)
    )
    law = deflection_variance(cameras.P, *(world_points(beam, w) for w in (0 * shape, shape)))
    with show("rounding_beam") as opened:
        put(opened, "Cameras", 6)
        put(opened, "Mode", 2)
        opened.page.wait_for_function(
            "() => document.querySelector('.tl-demo').demo.scene()?.draws === 400"
        )
        found = run(opened, "return Array.from(demo.scene().variance)")
        np.testing.assert_allclose(found, law, rtol=1e-9)
        drawn = np.array(run(opened, "return demo.scene().squares")) / 400
        assert np.mean(drawn) == pytest.approx(np.mean(law), rel=0.1)
        opened.page.locator(".tl-summary", has_text="400 draws").wait_for()


def test_an_address_sets_sliders_within_their_range_and_steps(show):
    query = "beam-mode=1.5&beam-cameras=6.5&beam-elevation=40&beam-amplitude=0.7"
    with show("rounding_beam", query=query) as opened:
        given = {"mode": 2, "cameras": 7, "elevation": 40, "amplitude": 0.5}
        assert run(opened, "return demo.state") == given
        assert np.all(np.isfinite(run(opened, "return Array.from(demo.scene().variance)")))
