"""The viewer: safe to inline, shown with or without a kernel, and usable in a real browser."""

from __future__ import annotations

import base64
import json
import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from browser import CONTRAST, Opened, open_offline, write_page

from thesis_lib.web import html as widgets
from thesis_lib.web.html import static_html
from thesis_lib.web.viewer import Viewer

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Locator

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
        "words": {"draws": "pixel-grid shifts", "predicts": "law of rounding"},
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


GRID = (15, 10)
PLATE = (668.0, 443.0)
PLATE_MODES = ((1, 1), (2, 1), (1, 2))
ENDS = ((5, 48, 97), (67, 147, 195), (247, 247, 247), (214, 96, 77), (103, 0, 31))
X_MM, Y_MM = (
    (size * (np.arange(n) + 0.5) / n).tolist() for size, n in zip(PLATE, GRID, strict=True)
)


def colormap(count: int = 65) -> list[str]:
    """Blue, white, red."""
    at = np.linspace(0, len(ENDS) - 1, count)
    columns = [np.interp(at, range(len(ENDS)), [one[c] for one in ENDS]) for c in range(3)]
    return ["#" + "".join(f"{round(v):02x}" for v in row) for row in zip(*columns, strict=True)]


def plate_shape(mode: int, wave: float = 0.0) -> Any:
    """Deflection of a plate's markers in mm, at most 10, with a wave of `wave` percent on it."""
    m, n = PLATE_MODES[mode - 1]
    along, across = (
        np.sin(m * np.pi * np.array(X_MM) / PLATE[0]),
        np.sin(n * np.pi * np.array(Y_MM) / PLATE[1]),
    )
    ripple = np.sin(7.3 * np.arange(150) + wave) * wave * 0.1
    return (10 * across[:, None] * along).ravel() + ripple


def error_of(size: float) -> dict[str, Any]:
    return {
        "mean": size, "median": 1.05 * size, "low": 0.7 * size, "high": 1.4 * size,
        "predicted": 1.08 * size, "stated": [0.9 * size, 0.9 * size],
    }  # fmt: skip


def plate_study() -> dict[str, Any]:
    """The study of a plate: pairs of cameras in one case, growing arrays in the other."""
    data = study()
    del data["x_mm"]
    data |= {
        "structure": {"kind": "plate", "length_mm": PLATE[0], "width_mm": PLATE[1]},
        "grid": list(GRID), "x_mm": X_MM, "y_mm": Y_MM, "colormap": colormap(),
    }  # fmt: skip
    for one in data["modes"]:
        one["reference_mm"] = plate_shape(one["mode"]).tolist()
    for case in data["cases"]:
        case["title"] = case["title"].replace("beam", "plate")
        for i, setting in enumerate(case["settings"]):
            for mode in range(1, 4):
                size = 6.0 * mode / (i + 1)
                z = plate_shape(mode, 1.5 * size)
                error = (abs(z - plate_shape(mode)) * 10).tolist()
                setting["modes"][mode - 1] = {
                    "measured_mm": z.tolist(), "point_error": error, **error_of(size)
                }  # fmt: skip
    return data


PLANES = [
    {"name": "XZ", "u_mm": [-334, 334], "z_mm": [44.5, 443], "shape": [75, 50]},
    {"name": "YZ", "u_mm": [-334, 334], "z_mm": [44.5, 443], "shape": [75, 50]},
]
NODAL = {(2, "YZ"), (3, "XZ")}
NOTE = (
    "this plane is a nodal plane of the mode: its reference pressure is zero, so no error is given"
)


def sound_field(mode: int, plane: str, wave: float) -> dict[str, Any]:
    """Rayleigh sum over the markers of a plate, as the viewer wants it."""
    k, spacing = 2 * np.pi * (0.4 + 0.9 * mode) / 668, 668 / 74
    u, z = np.meshgrid(-334 + spacing * np.arange(75), np.linspace(44.5, 443, 50), indexing="ij")
    x, y = (u, 0) if plane == "XZ" else (0, u)
    p = np.zeros((75, 50), complex)
    for n, w in enumerate(plate_shape(mode, wave)):
        i, j = n % 15, n // 15
        r = np.sqrt((x - X_MM[i] + 334) ** 2 + (y - Y_MM[j] + 221.5) ** 2 + z**2)
        p += w * np.exp(-1j * k * r) / r
    scale = max(abs(p.real).max(), abs(p.imag).max())
    code = [np.rint(127 * part / scale).astype(np.int8).tobytes() for part in (p.real, p.imag)]
    re_, im = (base64.b64encode(one).decode() for one in code)
    return {"scale": float(scale), "re": re_, "im": im}


def sound_study() -> dict[str, Any]:
    """The sound of the plate, nodal on YZ in mode 2 and on XZ in mode 3."""
    data = plate_study()
    for key in ("grid", "x_mm", "y_mm"):
        del data[key]
    data |= {
        "structure": {**data["structure"], "kind": "sound"}, "planes": PLANES,
        "pressure_unit": "Pa per mm at the antinode", "nodal_note": NOTE,
    }  # fmt: skip

    def fields(mode: int, wave: float) -> dict[str, Any]:
        return {plane["name"]: sound_field(mode, str(plane["name"]), wave) for plane in PLANES}

    for one in data["modes"]:
        del one["reference_mm"]
        one["fields"] = fields(one["mode"], 0.0)
    for case in data["cases"]:
        last = len(case["settings"]) - 1
        case["extremes"] = {
            str(mode): {
                "best": {"index": last, "fields": fields(mode, 4.0)},
                "worst": {"index": 0, "fields": fields(mode, 40.0)},
            }
            for mode in range(1, 4)
        }
        for i, setting in enumerate(case["settings"]):
            for mode in range(1, 4):
                planes = {
                    name: None if (mode, name) in NODAL else error_of(size * mode / (i + 1))
                    for name, size in (("XZ", 8.0), ("YZ", 11.0))
                }
                mean = {"mean": 6.0 * mode / (i + 1)}
                setting["modes"][mode - 1] = {"planes": planes, "deflection": mean}
    return data


def html_of(data: dict[str, Any], **asked: Any) -> str:
    """The page's part of a viewer."""
    return str(Viewer(data=data, **asked)._repr_mimebundle_()[0]["text/html"])


def test_state_cannot_break_out_of_its_script() -> None:
    state = {"data": {"title": EVIL, EVIL: [EVIL]}}
    text = static_html("export default { render() {} };", ".a {}", state)
    assert text.count("<script") == text.count("</script>") == 1
    assert "<!--" not in text
    assert "\u2028" not in text
    literal = re.search(r"^const state = (.*);$", text, re.MULTILINE)
    assert literal is not None
    assert json.loads(literal[1]) == state


def test_fragment_is_a_function_of_its_arguments_without_numbers_that_do_not_exist() -> None:
    esm, state = "export default { render() {} };", {"a": 1.23456789, "b": [math.nan, -math.inf]}
    one = static_html(esm, "", state)
    assert one == static_html(esm, "", dict(state)) != static_html(esm, "", {"a": 2, "b": []})
    assert '{"a":1.23457,"b":[null,null]}' in one
    assert Viewer(data={"x": [1.0, math.nan, math.inf]}).data == {"x": [1.0, None, None]}


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
    assert data["text/html"] == html_of(study(), case="2a", mode=2)


ASSETS = Path(widgets.__file__).parent / "assets"
MODULES = {file.stem: file.read_text(encoding="utf-8") for file in ASSETS.glob("*.js")}
IMPORT = re.compile(r'^import (?:\{([^}]*)\} from |\w+ from )?"\./(\w+)\.js";$', re.MULTILINE)
TOP = re.compile(r"^(export )?(?:const|let|function|class) (\w+)", re.MULTILINE)


def test_the_parts_import_what_they_use() -> None:
    exported = {
        name: part for part, text in MODULES.items() for export, name in TOP.findall(text) if export
    }
    for part, text in MODULES.items():
        imported = {
            name.strip(): source
            for found, source in IMPORT.findall(text)
            for name in found.split(",")
            if name.strip()
        }
        body = IMPORT.sub("", text)
        own = set(re.findall(r"(?:const|let|function) (\w+)|, (\w+) = ", body))
        own = {name for pair in own for name in pair}
        for name, source in imported.items():
            assert exported[name] == source, f"{part} imports {name} from {source}"
            assert re.search(rf"\b{name}\b", body), f"{part} does not use {name}"
        used = {name for name in exported if re.search(rf"(?<![\w.\"-]){name}\(", body)}
        assert used <= imported.keys() | own, f"{part}: {used - imported.keys() - own}"


@pytest.mark.parametrize("kind", ["beam", "plate", "sound"])
def test_a_page_carries_the_panels_of_its_kind_only(kind: str) -> None:
    data = {"structure": {"kind": kind}, "cases": []}
    text = html_of(data)
    assert re.findall(r"^KINDS\.(\w+) = ", text, re.MULTILINE) == [kind]
    assert len(text) < 70_000
    assert len(re.findall(r"^KINDS\.\w+ = ", Viewer._esm, re.MULTILINE)) == 3


# --- in a browser

PATHS = """e => [...e.querySelectorAll('path, rect')].map(p => ['d', 'x', 'y', 'width', 'height']
    .map(name => p.getAttribute(name)).join()).join('\\n')"""


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A page with two viewers of the same state, and one whose words try to break it."""
    same = html_of(study(), case="2a", mode=1)
    data = study()
    data["cases"] = data["cases"][:1]
    data["cases"][0]["title"] = data["cases"][0]["settings"][0]["label"] = EVIL
    file = tmp_path_factory.mktemp("viewer") / "two viewers.html"
    return write_page(file, same, same, html_of(data))


def viewers(opened: Opened) -> list[Locator]:
    found = opened.page.get_by_test_id("viewer")
    found.nth(2).locator(".tl-bar").first.wait_for()
    return [found.nth(i) for i in range(found.count())]


def drawn(viewer: Locator, letter: str) -> str:
    return str(viewer.get_by_test_id(f"panel-{letter}").evaluate(PATHS))


def words(viewer: Locator) -> str:
    return viewer.get_by_test_id("summary").inner_text()


TOUCHING = """() => {
    const all = [...document.querySelectorAll('.tl-value text')].map((one) => one.getBBox());
    return [all.length, all.filter((a, i) => all.slice(i + 1).some((b) =>
      a.x < b.x + b.width && b.x < a.x + a.width && a.y < b.y + 9 && b.y < a.y + 9)).length]; }"""


@pytest.mark.slow
def test_numbers_of_bars_do_not_touch(chromium: Browser, tmp_path: Path) -> None:
    """Twelve bars of one height, with three digits behind the point, on a phone."""
    data = study()
    many = [setting(f"{a}°", [(a / 2, 10), (-a / 2, 10)], 0.012, 1.0) for a in range(10, 130, 10)]
    data["cases"] = [{**data["cases"][0], "settings": many}]
    file = write_page(tmp_path / "many.html", html_of(data))
    with open_offline(chromium, file, width=390) as opened:
        opened.page.locator(".tl-bar").first.wait_for()
        assert opened.page.evaluate(TOUCHING) == [12, 0]


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
        assert "92.4 % of marker images" in str(bars.nth(3).get_attribute("aria-label"))
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


def test_best_and_worst_go_by_the_median(chromium: Browser, tmp_path: Path) -> None:
    data = study()
    shown = [one["modes"][0] for one in data["cases"][0]["settings"]]
    for one, median in zip(shown, (5.0, 1.0, 9.0, 3.0), strict=True):
        one["median"] = median  # by the run alone the first would be worst, the last best
    file = write_page(tmp_path / "page.html", html_of(data))
    with open_offline(chromium, file, width=1100) as opened:
        viewer = opened.page.get_by_test_id("viewer")
        assert words(viewer).startswith(
            "Mode 1, case 2a: mean error from 1.0 % (best, 60°) to 9.0 % (worst, 110°), "
            "by the median over the trials. "
        )
        assert opened.trouble == []


def test_errors_far_apart_stand_on_a_logarithmic_axis(chromium: Browser, tmp_path: Path) -> None:
    def tops(factor: float) -> list[float]:
        data = study()
        size = 1.0
        for one in data["cases"][0]["settings"]:
            for name in ("mean", "median", "low", "high", "predicted"):
                one["modes"][0][name] = size
            one["modes"][0]["stated"] = None
            size *= factor
        file = write_page(tmp_path / "page.html", html_of(data))
        with open_offline(chromium, file, width=1100) as opened:
            boxes = opened.page.locator(".tl-bar .tl-box")
            boxes.last.wait_for()
            return [float(boxes.nth(i).get_attribute("y") or "nan") for i in range(4)]

    near, far = np.diff(tops(2.0)), np.diff(tops(10.0))
    np.testing.assert_allclose(near, near[0] * np.array([1, 2, 4]), rtol=1e-6)
    np.testing.assert_allclose(far, far[0], rtol=1e-6)


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


@pytest.fixture(scope="module")
def plates(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A page with two plates, the second one without the errors of its markers."""
    data = plate_study()
    for setting in data["cases"][0]["settings"]:
        for one in setting["modes"]:
            del one["point_error"]
            one["measured_mm"] = [z * 1e-6 for z in one["measured_mm"]]
    for one in data["modes"]:
        one["reference_mm"] = [z * 1e-6 for z in one["reference_mm"]]
    pair = (html_of(one, case="2a", mode=1) for one in (plate_study(), data))
    return write_page(tmp_path_factory.mktemp("viewer") / "plates.html", *pair)


@pytest.fixture(scope="module")
def sounds(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A page with two viewers of a sound study."""
    file = tmp_path_factory.mktemp("viewer") / "sounds.html"
    return write_page(file, *[html_of(sound_study(), case="2a", mode=1)] * 2)


def two(opened: Opened) -> list[Locator]:
    found = opened.page.get_by_test_id("viewer")
    found.nth(1).locator(".tl-bar").first.wait_for()
    return [found.nth(0), found.nth(1)]


def colours(viewer: Locator, testid: str) -> list[str]:
    """Fill of each cell of a map, the first row of markers first."""
    script = "e => [...e.querySelectorAll('.tl-cells rect')].map(c => c.getAttribute('fill'))"
    return list(viewer.get_by_test_id(testid).evaluate(script))


def test_a_plate_as_maps(chromium: Browser, plates: Path) -> None:
    with open_offline(chromium, plates, width=1100) as opened:
        viewer, other = two(opened)
        ideal, best, worst = (colours(viewer, f"map-{one}") for one in ("ideal", 0, 1))
        assert len(ideal) == len(best) == len(worst) == 150
        assert len({tuple(ideal), tuple(best), tuple(worst)}) == 3
        assert ideal[67] == ideal[82]  # the same deflection, the same colour
        cells = viewer.locator("[data-testid=map-ideal] .tl-cells rect")
        box, corner = cells.nth(0).bounding_box(), cells.nth(149).bounding_box()
        assert box is not None
        assert corner is not None
        assert box["width"] / box["height"] == pytest.approx(668 / 15 * 10 / 443, rel=1e-3)
        assert corner["x"] > box["x"]  # Y points up
        assert corner["y"] < box["y"]
        assert "deflection (mm)" in viewer.locator(".tl-panel-b").inner_text()

        viewer.get_by_test_id("mode-2").click()
        second = colours(viewer, "map-ideal")
        assert second != ideal
        red, _, blue = (int(one) for one in re.findall(r"\d+", second[63]))
        assert red > blue  # up is red, down is blue
        red, _, blue = (int(one) for one in re.findall(r"\d+", second[71]))
        assert red < blue

        resting = colours(viewer, "map-1")
        viewer.locator(".tl-bar").nth(1).hover()
        hovered = colours(viewer, "map-1")
        assert hovered != resting
        assert viewer.get_by_test_id("map-1").inner_text().startswith("60°")
        viewer.locator(".tl-bar").nth(1).click()
        opened.page.mouse.move(2, 2)
        assert colours(viewer, "map-1") == hovered
        assert "pinned" in viewer.get_by_test_id("map-1").inner_text()
        viewer.locator(".tl-bar").nth(1).click()
        opened.page.mouse.move(2, 2)
        assert colours(viewer, "map-1") == resting
        viewer.get_by_label("Compare").select_option("all")
        assert viewer.locator("[data-testid=panel-c] .tl-map").count() == 4

        assert colours(other, "map-ideal") == ideal  # its scale follows its values
        assert "× 10⁻⁶ mm" in other.locator(".tl-panel-b").inner_text()
        assert opened.trouble == []


def test_reading_a_cell(chromium: Browser, plates: Path) -> None:
    with open_offline(chromium, plates, width=1100) as opened:
        viewer, other = two(opened)
        readout = viewer.get_by_test_id("readout-c")
        viewer.locator("[data-testid=map-ideal] .tl-cells rect").nth(64).hover()
        measured = [one["modes"][0] for one in plate_study()["cases"][0]["settings"]]
        expected = "X 200 mm, Y 199 mm: reference 7.99 mm; " + "; ".join(
            f"{name}: {one['measured_mm'][64]:.2f} mm, error {one['point_error'][64]:.{digits}f} %"
            for name, one, digits in (("160°", measured[3], 1), ("16°", measured[0], 1))
        )
        assert readout.inner_text().replace("\u00a0", " ") == expected
        assert viewer.locator(".tl-cursor[visibility=visible]").count() == 3
        opened.page.mouse.move(2, 2)
        assert "In (d)" in readout.inner_text()

        viewer.get_by_test_id("panel-c").focus()
        for key in ("ArrowRight", "ArrowRight", "ArrowUp", "ArrowLeft", "ArrowLeft", "ArrowLeft"):
            opened.page.keyboard.press(key)
        assert readout.inner_text().startswith("X 22 mm, Y 66 mm")
        opened.page.keyboard.press("Escape")
        assert "In (d)" in readout.inner_text()

        other.locator("[data-testid=map-0] .tl-cells rect").nth(64).hover()
        words = other.get_by_test_id("readout-c").inner_text().replace("\u00a0", " ")
        assert "reference 7.99 × 10⁻⁶ mm" in words
        assert "error" not in words
        assert opened.trouble == []


FIELDS = [
    f"field-{plane}-{one}" for plane in ("XZ", "YZ") for one in ("ideal", "best", "worst")
]  # fmt: skip


def pixels(viewer: Locator, testid: str) -> str:
    return str(viewer.get_by_test_id(testid).evaluate("e => e.toDataURL()"))


COLOURS = """e => { const copy = document.createElement('canvas').getContext('2d', {
  willReadFrequently: true }); copy.drawImage(e, 0, 0);
  return [...copy.getImageData(0, 0, 75, 50).data]; }"""  # a canvas read twice would be told of


@pytest.mark.slow
def test_the_sound_of_a_plate(chromium: Browser, sounds: Path) -> None:
    with open_offline(chromium, sounds, width=1100) as opened:
        viewer, other = two(opened)
        assert viewer.locator("canvas").count() == 6
        first = {name: pixels(viewer, name) for name in FIELDS}
        assert len(set(first.values())) == 6
        assert first == {name: pixels(other, name) for name in FIELDS}
        assert viewer.locator(".tl-scale").count() == 4
        assert "pressure (Pa per mm at the antinode)" in viewer.locator(".tl-panel-b").inner_text()

        # the colours are those of Re(p exp(jωt)) on the ideal field's scale
        ideal = sound_field(1, "XZ", 0.0)
        parts = [
            np.frombuffer(base64.b64decode(ideal[part]), np.int8).reshape(75, 50)
            for part in ("re", "im")
        ]
        most = np.hypot(*parts).max()
        slider = viewer.get_by_test_id("phase")
        slider.focus()
        for key, phase in (("Home", 0), ("PageUp", 36)):
            opened.page.keyboard.press(key)
            assert slider.input_value() == str(phase)
            got = viewer.get_by_test_id("field-XZ-ideal").evaluate(COLOURS)
            turn = np.deg2rad(phase)
            field = (parts[0] * np.cos(turn) - parts[1] * np.sin(turn)) / most
            image = np.array(got).reshape(50, 75, 4)[::-1].transpose(1, 0, 2)
            for c in range(3):
                expected = np.interp(field, np.linspace(-1, 1, 5), [one[c] for one in ENDS])
                assert abs(image[..., c] - expected).max() < 4
        assert pixels(viewer, "field-XZ-ideal") != first["field-XZ-ideal"]
        opened.page.keyboard.press("End")
        assert {name: pixels(viewer, name) for name in FIELDS} == first  # a whole period
        assert {name: pixels(other, name) for name in FIELDS} == first

        viewer.get_by_test_id("mode-2").click()
        assert pixels(viewer, "field-XZ-ideal") != first["field-XZ-ideal"]
        assert opened.trouble == []


@pytest.mark.parametrize("motion", ["no-preference", "reduce"])
def test_sound_plays_when_asked_to(chromium: Browser, sounds: Path, motion: Any) -> None:
    with open_offline(chromium, sounds, width=1100) as opened:
        opened.page.emulate_media(reduced_motion=motion)
        opened.page.reload()
        viewer, other = two(opened)
        button, slider = viewer.get_by_test_id("play"), viewer.get_by_test_id("phase")
        before = pixels(viewer, "field-XZ-worst")
        opened.page.wait_for_timeout(200)
        assert pixels(viewer, "field-XZ-worst") == before  # never by itself
        assert button.inner_text() == "Play"
        button.focus()
        opened.page.keyboard.press("Enter")
        assert button.inner_text() == "Pause"
        opened.page.wait_for_timeout(300)
        moving, phase = pixels(viewer, "field-XZ-worst"), slider.input_value()
        assert moving != before
        viewer.get_by_test_id("mode-2").click()  # goes on
        opened.page.wait_for_timeout(200)
        assert slider.input_value() != phase
        button.click()
        stopped, phase = pixels(viewer, "field-XZ-worst"), slider.input_value()
        opened.page.wait_for_timeout(200)
        assert (pixels(viewer, "field-XZ-worst"), slider.input_value()) == (stopped, phase)
        button.click()
        slider.focus()
        opened.page.keyboard.press("ArrowRight")  # taking the slider pauses
        assert button.inner_text() == "Play"
        assert other.get_by_test_id("phase").input_value() == "0"
        assert opened.trouble == []


def test_bars_and_nodal_planes_of_sound(chromium: Browser, sounds: Path) -> None:
    with open_offline(chromium, sounds, width=1100) as opened:
        viewer = two(opened)[0]
        bars = viewer.locator(".tl-bar")
        assert [bars.nth(i).locator(".tl-box").count() for i in range(4)] == [2, 2, 2, 2]
        assert bars.nth(0).locator(".tl-median").count() == 2
        assert words(viewer).startswith(
            "Mode 1, case 2a: mean error XZ 2.1 % (best shape, 160°), 8.4 % (worst shape, 16°); YZ "
            "2.9 % (best shape, 160°), 11.6 % (worst shape, 16°), by the median over the trials. "
        )
        assert viewer.locator(".tl-nodal").count() == 0

        viewer.get_by_test_id("mode-2").click()
        assert bars.nth(0).locator(".tl-box").count() == 1
        assert bars.nth(0).locator(".tl-nodal title").text_content() == f"YZ: {NOTE}"
        assert f"YZ: {NOTE}" in words(viewer)
        assert viewer.get_by_test_id("field-YZ-ideal").inner_text() == NOTE
        assert viewer.locator("canvas").count() == 5
        bars.nth(1).hover()
        assert re.search(
            rf"60°: XZ: mean error [\d.]+ % .*, YZ: {NOTE}, deflection: mean error 6.0 %, ",
            words(viewer),
        )
        viewer.get_by_test_id("mode-3").click()
        assert viewer.get_by_test_id("field-XZ-ideal").inner_text() == NOTE
        assert opened.trouble == []


def test_one_live_viewer_takes_any_kind(chromium: Browser, path: Path) -> None:
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
        found.push([...el.querySelectorAll('figure b')].map(e => e.textContent).join(' '));
      }
      close();
      return found; }"""
    with open_offline(chromium, path, width=1100) as opened:
        data = [study(), plate_study(), sound_study(), {}]
        data = [Viewer(data=one).data for one in data]
        found = opened.page.evaluate(script, [Viewer._esm, data])
        assert found == ["a b c d", "a b c d", "a b, c d", ""]
        opened.page.wait_for_timeout(100)
        assert opened.trouble == []


@pytest.mark.parametrize("pages", ["path", "plates", "sounds"])
def test_it_fits_a_phone(chromium: Browser, request: pytest.FixtureRequest, pages: str) -> None:
    with open_offline(chromium, request.getfixturevalue(pages), width=390) as opened:
        viewer = two(opened)[0]
        for case, mode in (("2a", 1), ("4a'", 3)):
            viewer.get_by_test_id("case").select_option(case)
            viewer.get_by_test_id(f"mode-{mode}").click()
            assert opened.sideways_px() <= 0
        left = {one.bounding_box()["x"] for one in viewer.locator(".tl-grid > figure").all()}  # type: ignore[index]
        assert len(left) == 1  # one column
        for node in viewer.locator("figure svg, figure canvas, figure button, figure input").all():
            box = node.bounding_box()
            assert box is not None
            assert box["x"] >= 0
            assert box["x"] + box["width"] <= 390
        for note in viewer.locator(".tl-nodal-note").all():
            assert note.evaluate("e => e.scrollHeight <= e.clientHeight")
        if pages == "plates":
            viewer.locator("[data-testid=map-1] .tl-cells rect").nth(80).tap()
            assert "reference" in viewer.get_by_test_id("readout-c").inner_text()
        viewer.locator(".tl-bar").nth(2).tap()
        assert words(viewer).startswith("Pinned: Mode 3, case 4a', aperture = 6")
        opened.page.set_viewport_size({"width": 700, "height": 800})
        opened.page.wait_for_function("document.querySelector('.tl-wide')")
        assert words(viewer).startswith("Pinned: ")
        compare = viewer.get_by_test_id("compare").bounding_box()
        assert compare is not None
        assert compare["x"] + compare["width"] <= 700
        assert opened.sideways_px() <= 0
        assert opened.trouble == []


@pytest.mark.parametrize("pages", ["path", "plates", "sounds"])
def test_text_has_contrast_in_every_theme(
    chromium: Browser, request: pytest.FixtureRequest, pages: str
) -> None:
    plain = (
        "p, p span, p em, legend, select, button, .tl-foot, .tl-key :is(span, em), "
        ".tl-phase :is(label, span), .tl-scale span, .tl-nodal-note"
    )
    script = f"""{CONTRAST}
      return [ground(e), ...ratios('svg text', 'fill'), ...ratios('{plain}', 'color')]; }}"""
    put = """([theme, light]) => {
      document.documentElement.dataset.theme = theme;
      document.body.dataset.jpThemeLight = light; }"""
    with open_offline(chromium, request.getfixturevalue(pages), width=1100) as opened:
        viewer = opened.page.get_by_test_id("viewer").first
        viewer.get_by_test_id("mode-2").click()  # nodal on one plane
        for system, theme, light, dark in (
            ("light", "", "", False), ("dark", "", "", True), ("light", "dark", "", True),
            ("dark", "light", "", False), ("dark", "", "true", False), ("light", "", "false", True),
        ):  # fmt: skip
            opened.page.emulate_media(color_scheme=system)  # type: ignore[arg-type]
            opened.page.evaluate(put, [theme, light])
            ground, *ratios = viewer.evaluate(script)
            assert (ground < 0.1) is dark
            assert min(ratios) >= 4.5
