"""The viewer: safe to inline, shown with or without a kernel, and usable in a real browser."""

import base64
import copy
import json
import math
import re
from functools import cache

import numpy as np
import pytest
from browser import open_offline, write_page

from thesis_lib.figure_sets.cube_file import cube_of
from thesis_lib.figure_sets.registry import validate_request
from thesis_lib.notebook import show
from thesis_lib.web.html import static_html
from thesis_lib.web.viewer import Viewer

EVIL = "</script><script>alert(1)</script><!-- \u2028 <img src=x onerror=alert(2)> & ]]>"
PAIRS = {"cases": ["2a", "2c"], "half_apertures_deg": [8, 30, 55, 80], "trials": 3}
NODAL = "nodal plane: no reference pressure"


@cache
def computed(kind):
    few = {"plane_shape": [15, 10], "modes": [1, 2], "cases": ["2a"], "half_apertures_deg": [8, 80]}
    more = few if kind == "sound" else {}
    return show.viewer(cube_of(validate_request(f"{kind}-aperture", PAIRS | more))).data


def study(kind):
    """What the viewer of a figure set gets, of which a test may change what it likes."""
    return copy.deepcopy(computed(kind))


def make_viewer(data):
    return Viewer(data=data, case="2a", mode=1)


def test_state_cannot_break_out_of_its_script():
    state = {"data": {"title": EVIL, EVIL: [EVIL]}}
    text = static_html("export default { render() {} };", ".a {}", state)
    assert text.count("<script") == text.count("</script>") == 1
    assert "<!--" not in text
    assert "\u2028" not in text
    literal = re.search(r"^const state = (.*);$", text, re.MULTILINE)
    assert json.loads(literal[1]) == state


def test_fragment_is_a_function_of_its_arguments_without_numbers_that_do_not_exist():
    esm, state = "export default { render() {} };", {"a": 1.23456789, "b": [math.nan, -math.inf]}
    one = static_html(esm, "", state)
    assert one == static_html(esm, "", dict(state)) != static_html(esm, "", {"a": 2, "b": []})
    assert '{"a":1.23457,"b":[null,null]}' in one
    assert Viewer(data={"x": [1.0, math.nan, math.inf]}).data == {"x": [1.0, None, None]}


# --- in a browser

PATHS = """e => [...e.querySelectorAll('path, rect')].map(p => ['d', 'x', 'y', 'width', 'height']
    .map(name => p.getAttribute(name)).join()).join('\\n')"""


@pytest.fixture(scope="module")
def beams(tmp_path_factory):
    """A page with two viewers of the same state, and one whose words try to break it."""
    data, hostile = study("beam"), study("beam")
    data["cases"][0]["settings"][3]["in_view"] = 0.924
    hostile["cases"] = hostile["cases"][:1]
    hostile["cases"][0]["title"] = hostile["cases"][0]["settings"][0]["label"] = EVIL
    file = tmp_path_factory.mktemp("viewer") / "two viewers.html"
    return write_page(file, make_viewer(data), make_viewer(data), make_viewer(hostile))


@pytest.fixture(scope="module")
def plates(tmp_path_factory):
    """A page with two plates, the second one much smaller and without the errors of its markers."""
    data = study("plate")
    for setting in data["cases"][0]["settings"]:
        for one in setting["modes"]:
            del one["point_error"]
            one["measured_mm"] = [z * 1e-6 for z in one["measured_mm"]]
    for one in data["modes"]:
        one["reference_mm"] = [z * 1e-6 for z in one["reference_mm"]]
    file = tmp_path_factory.mktemp("viewer") / "plates.html"
    return write_page(file, make_viewer(study("plate")), make_viewer(data))


@pytest.fixture(scope="module")
def sounds(tmp_path_factory):
    file = tmp_path_factory.mktemp("viewer") / "sounds.html"
    return write_page(file, *[make_viewer(study("sound"))] * 2)


def viewers(opened):
    found = opened.page.get_by_test_id("viewer")
    found.last.locator(".tl-bar").first.wait_for()
    return [found.nth(i) for i in range(found.count())]


def drawn(viewer, letter):
    return viewer.get_by_test_id(f"panel-{letter}").evaluate(PATHS)


def words(viewer):
    return viewer.get_by_test_id("summary").inner_text()


@pytest.mark.slow
def test_choosing_with_keyboard_and_mouse(chromium, beams):
    with open_offline(chromium, beams, width=1100) as opened:
        first, second, hostile = viewers(opened)
        before = {letter: drawn(first, letter) for letter in "abcd"}
        assert words(first).startswith("Mode 1, case 2a: mean error from ")
        assert "Markers leave the image in 1 of 4 settings" in words(first)

        first.get_by_test_id("mode-1").focus()  # keyboard: the next radio button
        opened.page.keyboard.press("ArrowRight")
        assert words(first).startswith("Mode 2, case 2a")
        assert all(drawn(first, letter) != before[letter] for letter in "bcd")
        first.get_by_test_id("case").focus()
        opened.page.keyboard.press("ArrowDown")
        assert words(first).startswith("Mode 2, case 2c")
        assert drawn(first, "a") != before["a"]
        first.get_by_test_id("case").select_option("2a")
        first.get_by_test_id("mode-1").click()  # mouse
        assert {letter: drawn(first, letter) for letter in "abcd"} == before
        first.get_by_test_id("panel-a").focus()
        opened.page.keyboard.press("ArrowUp")  # turns the cameras
        assert drawn(first, "a") != before["a"]

        # its twin and its neighbour on the page stay as they were
        assert {letter: drawn(second, letter) for letter in "abcd"} == before
        assert hostile.get_by_test_id("case").count() == 0
        assert "</script>" in words(hostile)
        assert hostile.locator("img").count() == 0


def test_highlighting_a_setting(chromium, beams):
    with open_offline(chromium, beams, width=1100) as opened:
        viewer = viewers(opened)[0]
        bars = viewer.locator(".tl-bar")
        shown = viewer.locator("[data-testid=panel-b] .tl-series:visible")
        assert shown.count() == 2  # best and worst
        resting = words(viewer)
        bars.nth(1).hover()
        error = computed("beam")["cases"][0]["settings"][1]["modes"][0]
        band = rf"band {error['low']:.1f}–{error['high']:.1f} %\), predicted "
        told = words(viewer).replace("\u00a0", " ")
        assert re.match(rf"Mode 1, case 2a, 60°: mean error [\d.]+ % \(5–95 % {band}", told)
        opened.page.mouse.move(2, 2)
        assert words(viewer) == resting

        bars.nth(0).focus()
        opened.page.keyboard.press("ArrowLeft")  # round to the last one
        assert "160°" in words(viewer)
        assert "92.4 % of marker images on the sensor" in words(viewer)
        opened.page.keyboard.press("Enter")
        assert bars.nth(3).get_attribute("aria-pressed") == "true"
        bars.nth(3).blur()
        viewer.get_by_test_id("mode-2").click()  # a pin outlives the mode
        assert words(viewer).startswith("Pinned: Mode 2, case 2a, 160°")
        bars.nth(3).click()
        opened.page.mouse.move(2, 2)
        assert words(viewer).startswith("Mode 2, case 2a: mean error from")
        viewer.get_by_label("Compare").select_option("all")
        assert shown.count() == 4


def test_bars_stand_at_their_errors_and_best_and_worst_go_by_the_median(chromium, tmp_path):
    """On a logarithmic axis where they are far apart."""

    def tops(factor):
        data = study("beam")
        for power, setting in zip((2, 0, 3, 1), data["cases"][0]["settings"], strict=True):
            for name in ("mean", "median", "low", "high", "predicted"):
                setting["modes"][0][name] = factor**power
            setting["modes"][0]["stated"] = None
        data["cases"][0]["settings"][1]["modes"][0]["mean"] = factor**3  # of the run alone
        file = write_page(tmp_path / "page.html", make_viewer(data))
        with open_offline(chromium, file, width=1100) as opened:
            (viewer,) = viewers(opened)
            assert re.search(r"\(best, 60°\) .* \(worst, 110°\), by the median", words(viewer))
            boxes = viewer.locator(".tl-bar .tl-box")
            return [float(boxes.nth(i).get_attribute("y") or "nan") for i in (3, 0, 2)]

    near, far = np.diff(tops(2.0)), np.diff(tops(10.0))
    np.testing.assert_allclose(near, near[0] * np.array([1, 2]), rtol=1e-6)
    np.testing.assert_allclose(far, far[0], rtol=1e-6)


def colours(viewer, testid):
    """Fill of each cell of a map, the first row of markers first."""
    script = "e => [...e.querySelectorAll('.tl-cells rect')].map(c => getComputedStyle(c).fill)"
    return viewer.get_by_test_id(testid).evaluate(script)


def test_a_plate_as_maps_whose_cells_are_read(chromium, plates):
    with open_offline(chromium, plates, width=1100) as opened:
        viewer, other = viewers(opened)
        ideal, best, worst = (colours(viewer, f"map-{one}") for one in ("ideal", 0, 1))
        assert len(ideal) == len(best) == len(worst) == 150
        assert len({tuple(ideal), tuple(best), tuple(worst)}) == 3
        cells = viewer.locator("[data-testid=map-ideal] .tl-cells rect")
        box, corner = cells.nth(0).bounding_box(), cells.nth(149).bounding_box()
        assert corner["x"] > box["x"]  # Y points up
        assert corner["y"] < box["y"]
        assert colours(other, "map-ideal") == ideal  # its scale follows its values
        assert "× 10⁻⁶ mm" in other.locator(".tl-panel-b").inner_text()

        readout = viewer.get_by_test_id("readout")
        cells.nth(64).hover()
        data = computed("plate")
        measured = [one["modes"][0] for one in data["cases"][0]["settings"]]
        said = readout.inner_text().replace("\u00a0", " ")
        assert f"reference {data['modes'][0]['reference_mm'][64]:.2f} mm; " in said
        assert f"16°: {measured[0]['measured_mm'][64]:.2f} mm, error " in said
        opened.page.mouse.move(2, 2)
        viewer.get_by_test_id("panel-c").focus()
        for key in ("ArrowRight", "ArrowRight", "ArrowUp", "ArrowLeft", "ArrowLeft", "ArrowLeft"):
            opened.page.keyboard.press(key)
        assert readout.inner_text().startswith("X 22 mm, Y 66 mm")

        viewer.get_by_test_id("mode-2").click()
        second = colours(viewer, "map-ideal")
        z = np.array(data["modes"][1]["reference_mm"])
        for cell, sign in ((z.argmax(), 1), (z.argmin(), -1)):
            red, _, blue = (int(one) for one in re.findall(r"\d+", second[cell]))
            assert np.sign(red - blue) == sign  # up is red, down is blue
        resting = colours(viewer, "map-1")
        viewer.locator(".tl-bar").nth(1).click()
        opened.page.mouse.move(2, 2)
        assert colours(viewer, "map-1") != resting
        viewer.get_by_label("Compare").select_option("all")
        assert viewer.locator("[data-testid=panel-c] .tl-map").count() == 4


def pixels(viewer, testid):
    return viewer.get_by_test_id(testid).evaluate("e => e.toDataURL()")


COLOURS = """e => { const copy = document.createElement('canvas').getContext('2d', {
  willReadFrequently: true }); copy.drawImage(e, 0, 0);
  return [e.width, e.height, ...copy.getImageData(0, 0, e.width, e.height).data]; }"""


@pytest.mark.slow
def test_the_sound_of_a_plate_is_drawn_and_plays_when_asked_to(chromium, sounds):
    data = computed("sound")
    with open_offline(chromium, sounds, width=1100) as opened:
        viewer, other = viewers(opened)
        before = pixels(viewer, "field-XZ-worst")
        opened.page.wait_for_timeout(200)
        assert pixels(viewer, "field-XZ-worst") == before  # never moves by itself

        # the colours are those of Re(p exp(jωt)) on the ideal field's scale
        shape = data["planes"][0]["shape"]
        scale = np.array([[int(c[i : i + 2], 16) for i in (1, 3, 5)] for c in data["colormap"]])
        field = data["modes"][0]["fields"]["XZ"]
        parts = [
            np.frombuffer(base64.b64decode(field[part]), np.int8).reshape(shape)
            for part in ("re", "im")
        ]
        slider = viewer.get_by_test_id("phase")
        slider.focus()
        for key, phase in (("Home", 0), ("PageUp", 36)):
            opened.page.keyboard.press(key)
            assert slider.input_value() == str(phase)
            width, height, *got = viewer.get_by_test_id("field-XZ-ideal").evaluate(COLOURS)
            assert [width, height] == shape
            turn = np.deg2rad(phase)
            p = (parts[0] * np.cos(turn) - parts[1] * np.sin(turn)) / np.hypot(*parts).max()
            image = np.array(got).reshape(height, width, 4)[::-1].transpose(1, 0, 2)
            for c in range(3):
                expected = np.interp(p, np.linspace(-1, 1, len(scale)), scale[:, c])
                assert abs(image[..., c] - expected).max() < 8

        button = viewer.get_by_test_id("play")
        button.focus()
        opened.page.keyboard.press("Enter")
        moving = pixels(viewer, "field-XZ-worst")
        opened.page.wait_for_function(
            "before => document.querySelector('[data-testid=phase]').value !== before",
            arg=slider.input_value(),
        )
        assert pixels(viewer, "field-XZ-worst") != moving
        slider.focus()
        opened.page.keyboard.press("ArrowRight")  # taking the slider pauses
        assert button.inner_text() == "Play"
        assert other.get_by_test_id("phase").input_value() == "0"

        viewer.get_by_test_id("mode-2").click()
        bars = viewer.locator(".tl-bar")
        assert bars.nth(0).locator(".tl-nodal title").text_content() == f"YZ: {NODAL}"
        assert f"YZ: {NODAL}" in words(viewer)
        assert viewer.get_by_test_id("field-YZ-ideal").inner_text() == NODAL


@pytest.mark.slow
def test_one_live_viewer_takes_any_kind(chromium, beams):
    """The module of a live notebook has all kinds, and stops what it showed before."""
    script = """async ([esm, studies]) => {
      const file = new Blob([esm], { type: 'text/javascript' });
      const widget = await import(URL.createObjectURL(file));
      const values = { data: studies[0], case: '2a', mode: 1 }, handlers = {};
      const model = { get: name => values[name], off() {}, save_changes() {},
        on: (name, handler) => { handlers[name] = handler; }, set() {} };
      const el = document.createElement('div'), found = [];
      document.body.prepend(el);
      const close = widget.default.render({ model, el });
      for (const study of studies) {
        values.data = study;
        handlers['change:data']();
        el.querySelector('[data-testid=play]')?.click();
        found.push(el.querySelectorAll('figure b').length);
      }
      close();
      return found; }"""
    with open_offline(chromium, beams, width=1100) as opened:
        data = [*map(computed, ("beam", "plate", "sound")), {}]
        found = opened.page.evaluate(script, [Viewer._esm, data])
        assert min(found[:3]) >= 3
        assert found[3] == 0
        opened.page.wait_for_timeout(100)
