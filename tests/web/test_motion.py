"""What vibrates moves, pauses and stands still; a camera's image is the library's."""

from contextlib import contextmanager

import numpy as np
import pytest
from browser import open_offline, write_page

from thesis_lib.book.explorer import explorer_html
from thesis_lib.figure_sets.cube_file import cube_of
from thesis_lib.figure_sets.registry import validate_request
from thesis_lib.notebook.show import viewer
from thesis_lib.studies import schema
from thesis_lib.vision.pinhole import hemisphere_cameras, pixelate, project

KINDS = {
    "beam": ("beam-arrays", {"cases": ["4a", "4e"]}),
    "plate": ("plate-aperture", {"cases": ["2a"]}),
    "holes": ("shape-holes", {"cases": ["4c"]}),
}


@pytest.fixture(scope="module")
def cubes():
    return {
        kind: cube_of(validate_request(name, {"trials": 3, **asked}), "")
        for kind, (name, asked) in KINDS.items()
    }


@pytest.fixture
def show(chromium, cubes, tmp_path):
    def fragment(kind):
        if kind == "explorer":
            return explorer_html()
        made = viewer(cubes[kind])
        made.form = {}  # which would push what moves out of sight
        return made

    @contextmanager
    def opened(kind, query="", still=False):
        file = write_page(tmp_path / f"{kind}.html", fragment(kind))
        with open_offline(chromium, file, 900, query=query, still=still) as page:
            yield page
            assert page.sideways_px() <= 0

    return opened


def mesh(opened):
    return opened.page.locator(".tl-mesh").first.get_attribute("d")


def later(opened):
    """Whether anything has moved a quarter of a second later."""
    before = mesh(opened), opened.page.get_by_test_id("phase").input_value()
    opened.page.wait_for_timeout(250)
    return (mesh(opened), opened.page.get_by_test_id("phase").input_value()) != before


def moves(opened):
    """Whether anything moves; a busy machine may draw nothing for a while."""
    return any(later(opened) for _ in range(40))


@pytest.mark.few(1)
@pytest.mark.slow
@pytest.mark.parametrize("kind", [*KINDS, "explorer"])
def test_it_moves_pauses_and_rests_for_readers_who_want_no_movement(show, kind):
    with show(kind) as opened:
        button = opened.page.get_by_test_id("play")
        slider = opened.page.get_by_role("slider", name="phase ωt")
        opened.page.wait_for_timeout(700)
        assert button.inner_text() == "Pause"
        assert moves(opened)
        button.focus()
        opened.page.keyboard.press("Enter")
        assert button.inner_text() == "Play"
        assert not later(opened)
        slider.focus()
        opened.page.keyboard.press("Home")
        assert slider.get_attribute("aria-valuetext") == "0°"
        most = mesh(opened)
        for key in ("PageUp", "PageUp", "ArrowRight"):
            opened.page.keyboard.press(key)
        assert slider.get_attribute("aria-valuetext") == "73°"
        assert mesh(opened) != most
        button.press(" ")
        assert moves(opened)
        opened.page.emulate_media(reduced_motion="reduce")  # stops what moves
        opened.page.wait_for_timeout(50)
        assert not later(opened)
        opened.page.reload()
        opened.page.wait_for_timeout(300)
        assert button.inner_text() == "Play"
        assert not later(opened)
        button.click()
        assert moves(opened)


SEEN = """([angle, camera]) => {
  const { motion, image } = document.querySelector('.tl-viewer').moving;
  const box = document.querySelector('[data-testid=camera]');
  box.value = camera;
  box.dispatchEvent(new Event('change'));
  motion.put(angle);
  const canvas = document.querySelector('.tl-panel-m canvas');
  const { data } = canvas.getContext('2d').getImageData(0, 0, 320, 180);
  const lit = (u, v) => u < 0 || v < 0 || u > 319 || v > 179 || data[4 * (320 * v + u)] > 200;
  const pixels = image.pixels(), n = pixels.length / 2;
  return [pixels, pixels.slice(0, n).every((u, i) => lit(u, pixels[n + i])), box.length]; }"""


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_the_image_is_the_librarys_in_whole_pixels(show, cubes, kind):
    cube = cubes[kind]
    with show(kind, query="setting=2", still=True) as opened:
        for mode, angle, camera in ((1, 0, 0), (1, 60, 1), (3, 0, 0), (3, 200, 1)):
            opened.page.get_by_test_id(f"mode-{mode}").check(force=True)
            opened.page.locator(".tl-bar").nth(1).focus()
            pixels, lit, count = opened.page.evaluate(SEEN, [angle, camera])
            assert lit
            one = cube.isel(setting=1).sel(mode=mode)
            assert count == int(one["n_cameras"])
            azimuth, elevation = (
                np.radians(one[f"camera_{a}"][camera]) for a in ("azimuth", "elevation")
            )
            distance, size = float(one["camera_distance"][camera]), (320, 180)
            rig = hemisphere_cameras(distance, [azimuth], [elevation], 24 / 36 * 320, size)
            length, width = schema.structure_extent(cube)
            z = one["reference_deflection"] * np.cos(np.radians(angle))
            points = np.stack([cube["x"] - length / 2, cube["y"] - width / 2, z])
            exact = project(rig.P, points)[0]
            clear = np.abs(exact % 1 - 0.5) > 1e-4  # data have six digits
            here = pixelate(exact)
            there = np.array(pixels).reshape(2, -1)
            if kind == "holes":  # the page goes by the box's cells
                order, other = (np.lexsort(a) for a in (here, there))
                here, there, clear = here[:, order], there[:, other], clear[:, order]
            np.testing.assert_array_equal(here[clear], there[clear])
