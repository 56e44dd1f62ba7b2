"""The explorer: its draws are measurements, and it can be used in a real browser."""

import re

import numpy as np
import pytest
from browser import focused, open_offline, tab_through, write_page
from command import read_command

from thesis_lib.book.explorer import explorer_data, explorer_html
from thesis_lib.figure_sets.registry import validate_request
from thesis_lib.studies import cubes
from thesis_lib.vision.pinhole import pixelate, project
from thesis_lib.web.html import read_asset

DATA = explorer_data()
TWO = "s=beam&m=3&w=320&f=24&d=500&c=20,30;-60,40"


# --- in a browser


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    file = tmp_path_factory.mktemp("explorer") / "the explorer.html"
    return write_page(file, "<h1 id='top'>Explorer</h1>", explorer_html())


def state(opened):
    opened.page.wait_for_function(
        "() => document.querySelector('.tl-explorer').explorer.app.result?.means.length === 100"
    )
    return opened.page.evaluate("document.querySelector('.tl-explorer').explorer.app.state")


def camera(opened, number):
    return opened.page.get_by_role("slider", name=f"Camera {number}", exact=True)


# --- the model


def with_physics(opened, script, given=None):
    """What a script makes of `given`, with the physics of the pages as `model`."""
    source = re.sub(r"^import [^;]*;\n", "", read_asset("pinhole.js") + read_asset("physics.js"),
                    flags=re.MULTILINE)  # fmt: skip
    return opened.page.evaluate(
        f"""async ([source, given]) => {{
        const file = new Blob([source], {{ type: 'text/javascript' }});
        const model = await import(URL.createObjectURL(file));
        const {{ explorer }} = document.querySelector('.tl-explorer');
        {script} }}""",
        [source, given],
    )


@pytest.mark.slow
def test_draws_are_measurements(chromium, path):
    """A draw begins where the markers are: the same as from a linear start; ties are Python's."""
    noise = np.array([0, 1e-12, -1e-12, 9e-10, -9e-10, 1.1e-9, -1.1e-9, 0.2, -0.2])
    ties = (np.arange(-8, 9)[:, None] / 2 + noise).ravel()
    rounding = "return Array.from(model.pixelate(Float64Array.from(given)));"
    script = """const { result, state } = explorer.app, known = state.r === 'known';
      return result.means.slice(0, 20).map((mean, k) => [mean, model.percentErrors(
        model.measureDeflections(result.P, result.rest, result.deflected,
          model.shiftsOf(k, state.c.length, 0), known), result.reference).mean]);"""
    with open_offline(chromium, path, query="s=plate&m=3&t=2a-16&r=known") as opened:
        state(opened)
        drawn, measured = np.array(with_physics(opened, script)).T
        rounded = with_physics(opened, rounding, ties.tolist())
    np.testing.assert_allclose(drawn, measured, rtol=1e-5)
    assert np.ptp(drawn) > 0.1
    np.testing.assert_array_equal(np.asarray(rounded) + 0.0, pixelate(ties) + 0.0)


@pytest.mark.slow
def test_the_band_is_that_of_the_library(conforms, chromium, path):
    """Other draws, but the same distribution; and the numbers shown are those computed."""
    with open_offline(chromium, path, query="s=beam&m=1&t=4a-12") as opened:
        state(opened)
        means = opened.page.evaluate(
            "document.querySelector('.tl-explorer').explorer.app.result.means"
        )
        row = DATA["structures"]["beam"]["setups"]
        published = next(one for one in row if one["id"] == "4a-12")["errors"]["mean_error"][0]
        conforms.sampled(np.median(means), published[1], rtol=0.1)
        low, high = np.quantile(means, [0.05, 0.95])
        conforms.sampled(low, published[2], rtol=0.15)
        conforms.sampled(high, published[3], rtol=0.15)
        cell = opened.page.locator(".tl-ex-band").filter(has_text="%").first.inner_text()
        assert cell.replace("\u00a0", " ") == f"{np.median(means):.1f} ({low:.1f}–{high:.1f}) %"
        status = opened.page.locator(".tl-ex-status").inner_text()
        assert f"({low:.1f}–{high:.1f} % over random pixel grids)" in status


WIDE = "30,20;-50,40;110,35;-130,25"


def test_what_is_said_of_the_images_is_true_of_them(chromium, path):
    """Markers in view are not rounded up; the largest motion is that in u and v together."""
    script = """const { P, rest, deflected, moved, inView } = explorer.app.result;
      return [inView, moved, ...[P, rest, deflected].map(one => Array.from(one))];"""
    with open_offline(chromium, path, query=f"s=plate&w=320&f=22&d=750&c={WIDE}") as opened:
        share, moved, P, *points = with_physics(opened, script)
        facts = opened.page.locator(".tl-ex-facts").inner_text().replace("\u00a0", " ")
        status = opened.page.locator(".tl-ex-status").inner_text().replace("\u00a0", " ")
    assert 0.995 < share < 1
    seen = f"{np.floor(1000 * share) / 10:.1f} %"
    assert f"markers in view {seen}" in facts
    assert f"Only {seen} of marker images" in status
    images = [project(np.reshape(P, (-1, 3, 4)), np.reshape(one, (-1, 3)).T) for one in points]
    assert moved == pytest.approx(np.linalg.norm(images[1] - images[0], axis=1).max(), rel=1e-9)


# --- using it


@pytest.mark.slow
def test_the_nearest_camera_follows_the_finger_and_the_curve_is_in_sight(chromium, path):
    def place(i):
        box = camera(opened, i + 1).locator("circle").bounding_box()
        return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2

    with open_offline(chromium, path, 390, 844, query="s=beam&m=3&t=4a-4") as opened:
        for i in range(4):  # their circles lie on each other
            before = state(opened)["c"]
            opened.page.locator(".tl-ex-view").scroll_into_view_if_needed()
            curve = opened.page.get_by_role("img", name="Deflection of the beam").bounding_box()
            assert 0 <= curve["y"] <= 844 - curve["height"]
            x, y = place(i)
            touch(opened, [(x + k, y - 2 * k) for k in range(11)])
            after = state(opened)["c"]
            assert [n for n in range(4) if after[n] != before[n]] == [i]
            assert np.subtract(place(i), (x, y)) == pytest.approx((10, -20), abs=4)
        azimuth, elevation = after[3]
        label = f"azimuth {azimuth:g}°, elevation {elevation:g}°"
        assert camera(opened, 4).get_attribute("aria-valuetext") == label
        opened.page.wait_for_timeout(400)
        assert f";{azimuth:g},{elevation:g}" in opened.page.url


def touch(opened, places):
    session = opened.page.context.new_cdp_session(opened.page)
    for kind, one in [("touchStart", places[0]), *(("touchMove", p) for p in places[1:])]:
        point = {"x": one[0], "y": one[1]}
        session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": [point]})
        opened.page.wait_for_timeout(20)
    session.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})


def test_everything_by_keyboard(chromium, path):
    with open_offline(chromium, path, query=TWO) as opened:
        state(opened)
        seen = tab_through(opened, 21)
        assert {"Structure", "Distance (mm)", "Camera 2", "Play", "Copy command"} < {*seen}
        assert "no outline" not in seen
        camera(opened, 1).focus()
        for key in ("ArrowRight", "ArrowUp", "ArrowUp", "Shift+ArrowLeft"):
            opened.page.keyboard.press(key)
        assert state(opened)["c"] == [[11, 32], [-60, 40]]
        opened.page.keyboard.press("Delete")
        assert len(state(opened)["c"]) == 2  # two are the least
        opened.page.get_by_role("button", name="Add a camera").press("Enter")
        assert len(state(opened)["c"]) == 3
        assert focused(opened) == "Add a camera"
        camera(opened, 3).press("Delete")
        assert state(opened)["c"] == [[11, 32], [-60, 40]]
        assert opened.page.evaluate("document.activeElement.dataset.camera") == "1"
        elevation = opened.page.get_by_label("Elevation of camera 2 in degrees")
        elevation.fill("52.5")
        assert state(opened)["c"] == [[11, 32], [-60, 52.5]]
        elevation.fill("95")
        assert elevation.evaluate("box => box.matches(':invalid')")
        opened.page.keyboard.press("Tab")
        assert state(opened)["c"] == [[11, 32], [-60, 52.5]]
        assert elevation.input_value() == "52.5"
        alert = opened.page.locator(".tl-ex-refused")
        assert alert.inner_text().endswith("camera 2 in degrees: given 95, allowed: 0.5 to 90")
        opened.page.get_by_label("Focal length (mm)").fill("35")
        assert alert.text_content() == ""


# --- the address


LINKS = [
    "s=beam&m=3&w=320&f=24&d=500&c=7.5,15;-7,15",
    "s=plate&m=2&w=400x300&f=35.5&d=900&a=2.5&r=known&c=0,90;90,5;-90,45",
    "s=beam&m=2&t=4a%27-6",
]
DEFAULT = {
    "s": "beam", "m": 1, "d": 500, "w": [320, 180], "f": 24, "a": 5.5, "r": "rebuilt",
    "c": [[7, 15], [-7, 15], [14, 15], [-14, 15]], "t": "4a-4",
}  # fmt: skip
SILLY = {
    "": {},
    "s=cube&m=4&w=1e9&f=-3&d=12&a=x&r=maybe&t=9z-1&c=1,2": {},
    "c=7,15;7,15": {},  # one place
    "c=NaN,15;Infinity,15": {},
    "c=" + ";".join(f"{i},20" for i in range(40)): {},  # too many
    "d=320&a=50&c=%3Cb%3E": {"a": 50},  # it bends farther than that distance
    "w=640&m=2&%FF=%FF": {"w": [640, 360], "m": 2},
}


@pytest.mark.slow
def test_a_link_shows_what_it_says_and_a_silly_one_is_ignored(chromium, path):
    with open_offline(chromium, path) as opened:
        for query in LINKS:
            address = f"{path.as_uri()}?{query}&other=1#top"
            opened.page.goto(address)
            first = state(opened)
            opened.page.wait_for_timeout(400)
            assert opened.page.url == address
            opened.page.reload()
            assert state(opened) == first
        for query, expected in SILLY.items():
            opened.page.goto(f"{path.as_uri()}?{query}")
            assert state(opened) == {**DEFAULT, **expected}, query


# --- the thesis


def test_a_setup_of_the_thesis_shows_its_published_errors(chromium, path):
    def texts(kind):
        return [
            one.replace("\u00a0", " ")
            for one in opened.page.locator(f"td.tl-ex-{kind}").all_inner_texts()
        ]

    table = cubes.read_published("plate-aperture")
    with open_offline(chromium, path) as opened:
        state(opened)
        opened.page.get_by_role("radio", name="Plate").check()
        opened.page.get_by_role("radio", name="2 585 Hz").check()
        opened.page.get_by_label("Setup of the thesis").select_option("2b-60")
        shown = state(opened)
        assert (shown["s"], shown["m"], shown["d"], shown["c"]) == (
            "plate", 2, 750, [[90, 60], [-90, 60]],
        )  # fmt: skip
        rows = table[(table["case"] == "2b") & (table["value"] == 60) & (table["mode"] == 2)]
        for i, error in enumerate(("mean_error", "max_point_error")):
            [row] = rows[rows["error"] == error].to_dict("records")
            assert texts("published")[i] == texts("literal")[i] == f"{row['trial_0']:.1f} %"
            spread = f"{row['median']:.1f} ({row['low']:.1f}–{row['high']:.1f}) %"
            assert texts("spread")[i] == spread
        assert texts("stated")[0] == "21 % (figure 4.9 d)"
        opened.page.get_by_label("Distance (mm)").fill("800")
        state(opened)
        assert opened.page.get_by_label("Setup of the thesis").input_value() == ""
        assert texts("published") == texts("spread") == texts("stated") == ["–", "–"]


# --- the command


def test_the_command_runs_the_layout(chromium, path):
    with open_offline(chromium, path) as opened:
        opened.page.context.grant_permissions(["clipboard-read", "clipboard-write"])
        for query in (*LINKS[:2], "s=beam&m=1&t=4a-12"):
            opened.page.goto(f"{path.as_uri()}?{query}")
            shown = state(opened)
            opened.page.get_by_role("button", name="Copy command").click()
            opened.page.get_by_role("button", name="Copied").wait_for()
            copied = opened.page.evaluate("() => navigator.clipboard.readText()")
            assert copied == opened.page.locator(".tl-ex-export code").inner_text()
            study = validate_request(*read_command(copied))
            assert study.name == f"{shown['s']}-arrays"
            [setting] = study.settings()
            assert setting.distance_mm == shown["d"]
            assert list(setting.resolution_px) == shown["w"]
            assert [list(pair) for pair in setting.directions_deg] == shown["c"]
            assert study.focal_length_mm == shown["f"]
            assert study.rest == shown["r"]
            assert study.peaks_m == [shown["a"] / 1000] * 3
