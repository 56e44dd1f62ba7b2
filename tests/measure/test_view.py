"""The measured shape that moves in a report: what it shows is what was measured."""

import re
from contextlib import contextmanager

import numpy as np
import pytest
import xarray as xr
from browser import open_offline

from thesis_lib.measure.report.build import view_shape

LENGTH, WIDTH = 0.4, 0.2  # m
HEAD = '<!doctype html><meta charset="utf-8"><meta name="viewport" content="width=device-width">'


@pytest.fixture
def plate():
    """Eighteen markers in rows; two have no result, and one lags by a quarter of a period."""
    y, x = (one.ravel() for one in np.mgrid[0:WIDTH:3j, 0:LENGTH:6j])
    deflection = 1e-3 * np.cos(np.pi * x / LENGTH)
    deflection[[4, 9]] = np.nan
    quadrature = np.where(np.isnan(deflection), np.nan, 0.0)
    deflection[13], quadrature[13] = 0.0, 5e-4
    return xr.Dataset(
        {
            "deflection": ("marker", deflection),
            "quadrature": ("marker", quadrature),
            "standard_error": ("marker", np.full(x.size, 1e-4)),
            "frequency": 24.0,
        },
        coords={"x": ("marker", x), "y": ("marker", y)},
    )


@pytest.fixture
def show(chromium, plate, tmp_path):
    @contextmanager
    def opened(**how):
        file = tmp_path / "view.html"
        shown = f"{HEAD}<body>{view_shape(plate, (LENGTH, WIDTH))}"
        file.write_text(shown, encoding="utf-8")
        with open_offline(chromium, file, **how) as seen:
            yield seen
            assert seen.trouble == []
            assert seen.sideways_px() <= 0

    return opened


def dots(opened):
    """Where markers are drawn, (markers, 2) in px."""
    places = "all => all.map(one => ['cx', 'cy'].map(name => Number(one.getAttribute(name))))"
    return np.array(opened.page.locator(".tl-dot").evaluate_all(places))


def put(opened, name, value):
    opened.page.get_by_test_id(name).evaluate(
        "(one, value) => { one.value = value; one.dispatchEvent(new Event('input')); }", value
    )


@pytest.mark.slow
def test_markers_stand_and_move_as_they_were_measured(show, plate):
    known = np.flatnonzero(np.isfinite(plate["deflection"]))
    turned = (plate["deflection"] + 1j * plate["quadrature"]).values[known]
    with show() as opened:
        first = opened.page.locator(".tl-whisker").first
        drawn = re.match(r"M\S+ ([\d.]+)V([\d.]+)M", first.get_attribute("d"))
        low, high = map(float, drawn.groups())
        put(opened, "strength", 0)
        rest = dots(opened)
        assert len(rest) == known.size == 16
        on_grid = np.column_stack([plate["x"], plate["y"], np.ones(plate.sizes["marker"])])[known]
        residual = np.linalg.lstsq(on_grid, rest)[0]
        np.testing.assert_allclose(on_grid @ residual, rest, atol=0.1)  # seen from far away
        put(opened, "strength", 1)
        rise = rest[0, 1] - dots(opened)[0, 1]  # of 1 mm; the whisker is ± 2 standard errors
        assert low - high == pytest.approx(0.4 * rise, abs=0.25)
        put(opened, "strength", 2)
        for degrees in (0, 90, 250):
            put(opened, "phase", degrees)
            rise = rest - dots(opened)
            np.testing.assert_allclose(rise[:, 0], 0, atol=0.11)
            true = (turned * np.exp(1j * np.radians(degrees))).real
            scale = (rise[:, 1] @ true) / (true @ true)
            assert scale > 0
            np.testing.assert_allclose(rise[:, 1], scale * true, atol=0.15)


@pytest.mark.slow
def test_it_turns_by_keys_and_by_dragging_and_follows_the_width(show):
    with show() as opened:
        canvas, first = opened.page.get_by_test_id("panel-a"), dots(opened)
        opened.page.wait_for_timeout(300)  # it moves, unless no movement is wanted
        np.testing.assert_array_equal(dots(opened), first)
        canvas.focus()
        opened.page.keyboard.press("ArrowRight")
        assert np.abs(dots(opened) - first).max() > 2
        opened.page.keyboard.press("ArrowLeft")
        np.testing.assert_allclose(dots(opened), first, atol=0.11)
        box = canvas.bounding_box()
        x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
        opened.page.mouse.move(x, y)
        opened.page.mouse.down()
        opened.page.mouse.move(x + 60, y + 20)
        opened.page.mouse.up()
        assert np.abs(dots(opened) - first).max() > 10
        opened.page.set_viewport_size({"width": 390, "height": 800})
        opened.page.wait_for_function(
            "() => document.querySelector('[data-testid=panel-a]').viewBox.baseVal.width < 400"
        )
        assert np.ptp(dots(opened)[:, 0]) < 390


def test_it_moves_where_movement_is_wanted(show):
    moved = "before => document.querySelector('.tl-dot').getAttribute('cy') !== before"
    with show(still=False) as opened:
        before = opened.page.locator(".tl-dot").first.get_attribute("cy")
        opened.page.wait_for_function(moved, arg=before, timeout=10_000)
