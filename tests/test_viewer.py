"""The viewer: safe to inline, shown with or without a kernel, and usable in a real browser."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from thesis_lib.widgets import Viewer, static_html

if TYPE_CHECKING:
    from browser import Opened
    from playwright.sync_api import Browser, Locator

pytestmark = pytest.mark.xdist_group("browser")

LENGTH = 623.0
POINTS = 25
MODES = ((1, 6.31), (2, 39.5), (3, 110.6))
ROOTS = (1.875104, 4.694091, 7.854757)
COLORS = ["#0072B2", "#E69F00", "#009E73", "#CC79A7", "#D55E00", "#56B4E9"]
ARRAY = [(7, 15), (14, 15), (27, 15), (30, 5), (47, 5), (50, 5)]
EVIL = "</script><script>alert(1)</script><!-- \u2028 <img src=x onerror=alert(2)> & ]]>"


def shape(mode: int, x: float) -> float:
    """Clamped-free bending shape, 1 at the tip."""
    k = ROOTS[mode - 1]
    ratio = (math.cosh(k) + math.cos(k)) / (math.sinh(k) + math.sin(k))
    return (math.cosh(k * x) - math.cos(k * x) - ratio * (math.sinh(k * x) - math.sin(k * x))) / 2


def setting(label: str, angles: Sequence[tuple[float, float]], size: float, in_view: float) -> Any:
    """One setting with a wave of `size` percent on every shape."""
    modes = []
    for mode, _ in MODES:
        reference = [5.5 * shape(mode, i / (POINTS - 1)) for i in range(POINTS)]
        wave = [size * mode * math.sin(7.3 * i + size) * (i > 0) for i in range(POINTS)]
        mean = math.sqrt(sum(one * one for one in wave) / POINTS)
        modes.append(
            {
                "measured_mm": [z + 0.055 * one for z, one in zip(reference, wave, strict=True)],
                "point_error": [abs(one) for one in wave],
                "mean": mean,
                "median": 1.05 * mean,
                "low": 0.7 * mean,
                "high": 1.4 * mean,
                "predicted": 1.08 * mean,
                "stated": [0.9 * mean, 0.9 * mean] if mode == 1 else [0.8 * mean, 1.2 * mean],
            }
        )
    return {
        "label": label,
        "value": float(re.sub(r"\D", "", label)),
        "cameras": [[570.0, azimuth, elevation] for azimuth, elevation in angles],
        "resolution": [320, 180],
        "in_view": in_view,
        "modes": modes,
    }


def study() -> dict[str, Any]:
    """A plausible study by formula: a case of pairs and a case of growing arrays."""
    pairs = [(16, 11.0), (60, 3.1), (110, 1.9), (160, 1.2)]
    grown = [[(s * a, e) for a, e in ARRAY[:n] for s in (1, -1)] for n in range(1, 7)]
    return {
        "structure": {"kind": "beam", "length_mm": LENGTH, "width_mm": 30},
        "parameter": {"name": "aperture_deg", "label": "aperture", "unit": "°"},
        "x_mm": [LENGTH * i / (POINTS - 1) for i in range(POINTS)],
        "modes": [
            {
                "mode": mode,
                "frequency_hz": frequency,
                "reference_mm": [5.5 * shape(mode, i / (POINTS - 1)) for i in range(POINTS)],
            }
            for mode, frequency in MODES
        ],
        "colors": COLORS,
        "cases": [
            {
                "name": "2a",
                "title": "pairs in front of the beam",
                "figures": {"1": "3.7", "2": "3.8", "3": "3.9"},
                "settings": [
                    setting(f"{a}°", [(a / 2, 10), (-a / 2, 10)], size, 0.924 if a == 160 else 1.0)
                    for a, size in pairs
                ],
            },
            {
                "name": "4a'",
                "title": "growing arrays in front of the beam",
                "figures": {"1": "3.25"},
                "settings": [
                    setting(str(len(angles)), angles, 9 / math.sqrt(len(angles)), 1.0)
                    for angles in grown
                ],
            },
        ],
    }


def page(*fragments: str) -> str:
    head = '<meta charset="utf-8"><meta name="viewport" content="width=device-width">'
    return f"<!doctype html><html><head>{head}</head><body>{''.join(fragments)}</body></html>"


def test_state_cannot_break_out_of_its_script() -> None:
    state = {"data": {"title": EVIL, EVIL: [EVIL]}}
    text = static_html("export default { render() {} };", ".a {}", state)
    assert text.count("<script") == text.count("</script>") == 1
    assert "<!--" not in text
    assert "\u2028" not in text
    literal = re.search(r"^const state = (.*);$", text, re.MULTILINE)
    assert literal is not None
    assert json.loads(literal[1]) == state


def test_fragment_is_a_function_of_its_arguments() -> None:
    esm = "export default { render() {} };"
    one = static_html(esm, "", {"a": 1.23456789, "b": [math.nan, -math.inf]})
    assert one == static_html(esm, "", {"a": 1.23456789, "b": [math.nan, -math.inf]})
    assert one != static_html(esm, "", {"a": 2, "b": []})
    assert '{"a":1.23457,"b":[null,null]}' in one


@pytest.mark.parametrize(
    ("esm", "css"),
    [
        ("const a = 1;", ""),
        ("export default {};\nexport default {};", ""),
        ("// </script>\nexport default {};", ""),
        ("export default {};", "</style>"),
    ],
)
def test_unsafe_sources_are_refused(esm: str, css: str) -> None:
    with pytest.raises(ValueError, match="esm"):
        static_html(esm, css, {})


def test_bundle_has_view_page_and_line() -> None:
    viewer = Viewer(data=study(), case="2a", mode=2)
    data, _ = viewer._repr_mimebundle_()
    assert set(data) == {"application/vnd.jupyter.widget-view+json", "text/html", "text/plain"}
    assert data["text/plain"] == ("Viewer(varied: aperture; cases: 2a, 4a'; shown: 2a, mode 2)")
    assert "export default" not in data["text/html"]
    assert data["text/html"] == Viewer(data=study(), case="2a", mode=2)._repr_mimebundle_()[0]["text/html"]  # fmt: skip  # noqa: E501


def test_numbers_that_do_not_exist_travel_as_null() -> None:
    assert Viewer(data={"x": [1.0, math.nan, math.inf]}).data == {"x": [1.0, None, None]}


def test_a_page_is_small() -> None:
    data = study()
    case = data["cases"][1]
    data["cases"] = [{**case, "name": f"4{i}"} for i in range(6)]
    assert len(Viewer(data=data)._repr_mimebundle_()[0]["text/html"]) < 160_000


# --- in a browser

PATHS = """e => [...e.querySelectorAll('path, rect')].map(p => ['d', 'x', 'y', 'width', 'height']
    .map(name => p.getAttribute(name)).join()).join('\\n')"""


@pytest.fixture(scope="module")
def chromium() -> Iterator[Browser]:
    pytest.importorskip("playwright", reason="the browser tests need the playwright package")
    from browser import browser, find_browser

    if find_browser() is None:
        pytest.skip("no Chromium or Chrome on this machine")
    with browser() as running:
        yield running


def open_offline(*arguments: Any, **options: Any) -> AbstractContextManager[Opened]:
    from browser import open_offline

    return open_offline(*arguments, **options)


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A page with two viewers of the same state, and one whose words try to break it."""
    file = tmp_path_factory.mktemp("viewer") / "two viewers.html"
    same = Viewer(data=study(), case="2a", mode=1)._repr_mimebundle_()[0]["text/html"]
    data = study()
    data["cases"] = data["cases"][:1]
    data["cases"][0]["title"] = data["cases"][0]["settings"][0]["label"] = EVIL
    hostile = Viewer(data=data)._repr_mimebundle_()[0]["text/html"]
    file.write_text(page(same, same, hostile), encoding="utf-8")
    return file


def viewers(opened: Opened) -> list[Locator]:
    found = opened.page.get_by_test_id("viewer")
    found.nth(2).locator(".tl-bar").first.wait_for()
    return [found.nth(i) for i in range(found.count())]


def drawn(viewer: Locator, letter: str) -> str:
    return str(viewer.get_by_test_id(f"panel-{letter}").evaluate(PATHS))


def words(viewer: Locator) -> str:
    return viewer.get_by_test_id("summary").inner_text()


def test_choosing_with_keyboard_and_mouse(chromium: Browser, path: Path) -> None:
    with open_offline(chromium, path, width=1100) as opened:
        first, second, hostile = viewers(opened)
        before = {letter: drawn(first, letter) for letter in "abcd"}
        assert words(first).startswith("Mode 1, case 2a: mean error from ")
        assert "Markers leave the image in 1 of 4 settings" in words(first)

        first.get_by_test_id("mode-1").focus()  # keyboard: the next radio button
        opened.page.keyboard.press("ArrowRight")
        assert words(first).startswith("Mode 2, case 2a")
        second_mode = {letter: drawn(first, letter) for letter in "bcd"}
        assert all(second_mode[letter] != before[letter] for letter in "bcd")
        first.get_by_test_id("mode-3").click()  # mouse
        assert words(first).startswith("Mode 3, case 2a")
        assert drawn(first, "b") != second_mode["b"]

        first.get_by_test_id("case").focus()
        opened.page.keyboard.press("4")  # typing chooses the option that begins so
        assert words(first).startswith("Mode 3, case 4a'")
        assert first.locator(".tl-bar").count() == 6
        assert drawn(first, "a") != before["a"]
        first.get_by_test_id("case").select_option("2a")
        first.get_by_test_id("mode-1").click()
        assert {letter: drawn(first, letter) for letter in "abcd"} == before

        # its twin and its neighbour on the page stay as they were
        assert words(second).startswith("Mode 1, case 2a")
        assert {letter: drawn(second, letter) for letter in "abcd"} == before
        assert hostile.get_by_test_id("case").count() == 0
        assert "</script>" in words(hostile)
        assert hostile.locator("img").count() == 0
        assert opened.trouble == []


def test_highlighting_a_setting(chromium: Browser, path: Path) -> None:
    with open_offline(chromium, path, width=1100) as opened:
        viewer = viewers(opened)[0]
        bars = viewer.locator(".tl-bar")
        shown = viewer.locator("[data-testid=panel-b] .tl-series:visible")
        assert shown.count() == 2  # best and worst
        resting, cameras = words(viewer), drawn(viewer, "a")

        bars.nth(1).hover()
        assert re.match(
            r"Mode 1, case 2a, 60°: mean error [\d.]+ % \(5–95 % band [\d.]+–[\d.]+ %\), "
            r"predicted [\d.]+ %, stated in the thesis [\d.]+ %, all markers in view\.",
            words(viewer),
        )
        assert shown.count() == 3
        assert drawn(viewer, "a") != cameras
        opened.page.mouse.move(2, 2)
        assert words(viewer) == resting

        bars.nth(0).focus()
        opened.page.keyboard.press("ArrowLeft")  # round to the last one
        assert "160°" in words(viewer)
        assert "92.4 % of marker images on the sensor" in words(viewer)
        assert "92.4 %" in bars.nth(3).locator("title").inner_html()
        opened.page.keyboard.press("Enter")
        assert bars.nth(3).get_attribute("aria-pressed") == "true"
        bars.nth(3).blur()
        assert words(viewer).startswith("Pinned: ")
        viewer.get_by_test_id("mode-2").click()  # a pin outlives the mode
        assert words(viewer).startswith("Pinned: Mode 2, case 2a, 160°")
        bars.nth(3).click()
        opened.page.mouse.move(2, 2)
        assert words(viewer).startswith("Mode 2, case 2a: mean error from")

        viewer.get_by_label("Compare").select_option("all")
        assert shown.count() == 4
        assert opened.trouble == []


def test_turning_the_cameras(chromium: Browser, path: Path) -> None:
    with open_offline(chromium, path, width=1100) as opened:
        first, second, _ = viewers(opened)
        before = drawn(first, "a")
        box = first.get_by_test_id("panel-a").bounding_box()
        assert box is not None
        opened.page.mouse.move(box["x"] + 200, box["y"] + 100)
        opened.page.mouse.down()
        opened.page.mouse.move(box["x"] + 260, box["y"] + 130, steps=3)
        opened.page.mouse.up()
        dragged = drawn(first, "a")
        assert dragged != before
        opened.page.mouse.move(box["x"] + 100, box["y"] + 60)
        assert drawn(first, "a") == dragged  # released
        first.get_by_test_id("panel-a").focus()
        opened.page.keyboard.press("ArrowUp")
        assert drawn(first, "a") != dragged
        assert drawn(second, "a") == before
        assert opened.trouble == []


def test_a_phone_does_not_scroll_sideways(chromium: Browser, path: Path) -> None:
    with open_offline(chromium, path, width=390) as opened:
        viewer = viewers(opened)[0]
        for case, mode in (("2a", 1), ("4a'", 3)):
            viewer.get_by_test_id("case").select_option(case)
            viewer.get_by_test_id(f"mode-{mode}").click()
            assert opened.sideways_px() <= 0
        left = {viewer.get_by_test_id(f"panel-{one}").bounding_box()["x"] for one in "abcd"}  # type: ignore[index]
        assert len(left) == 1  # one column
        viewer.locator(".tl-bar").nth(2).tap()
        assert words(viewer).startswith("Pinned: Mode 3, case 4a', aperture = 6")
        opened.page.set_viewport_size({"width": 700, "height": 800})
        opened.page.wait_for_function("document.querySelector('.tl-wide')")
        assert words(viewer).startswith("Pinned: ")
        compare = viewer.get_by_test_id("compare").bounding_box()
        assert compare is not None
        assert compare["x"] + compare["width"] <= 700
        assert opened.trouble == []


@pytest.mark.parametrize("dark", [False, True])
def test_text_has_contrast_in_every_theme(chromium: Browser, path: Path, dark: bool) -> None:
    script = """e => { const rgb = c => c.match(/[\\d.]+/g).slice(0, 3).map(v => {
        v /= 255; return v <= 0.03928 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4; });
      const light = c => { const [r, g, b] = rgb(c); return 0.2126 * r + 0.7152 * g + 0.0722 * b; };
      const ground = light(getComputedStyle(e).backgroundColor);
      const ratio = c => { const [a, b] = [light(c), ground].sort((x, y) => y - x);
        return (a + 0.05) / (b + 0.05); };
      const all = (css, name) => [...e.querySelectorAll(css)].map(
        t => ratio(getComputedStyle(t)[name]));
      return [ground, ...all('svg text', 'fill'),
        ...all('p, p span, .tl-foot, .tl-key span, .tl-key em, legend, select', 'color')]; }"""
    with open_offline(chromium, path, width=1100, dark=dark) as opened:
        viewer = viewers(opened)[0]
        for attribute, expected in ((None, dark), ("dark", True), ("light", False)):
            if attribute:
                opened.page.evaluate(
                    "theme => { document.documentElement.dataset.theme = theme; }", attribute
                )
            ground, *ratios = viewer.evaluate(script)
            assert (ground < 0.1) is expected
            assert min(ratios) >= 4.5
        opened.page.evaluate("() => { delete document.documentElement.dataset.theme; }")
        for attribute in ("true", "false"):
            opened.page.evaluate(
                "light => { document.body.dataset.jpThemeLight = light; }", attribute
            )
            assert (viewer.evaluate(script)[0] < 0.1) is (attribute == "false")
