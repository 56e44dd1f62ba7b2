"""The image of a plan that can be turned: what it shows is where the cameras are."""

from urllib.parse import unquote

import axe
import numpy as np
import pytest
import xarray as xr
from browser import open_offline
from scipy.spatial.distance import pdist

from thesis_lib.planning.report import write_plan
from thesis_lib.planning.request import plan_request

QUICK = {"counts": [2, 5], "starts": 1, "step_deg": 15, "trials": 20, "target_percent": 12}
TIPS = """root => [...root.querySelectorAll('.tl-camera')].map(one => {
  const number = Number(one.querySelector('text').textContent);
  const tip = one.querySelector('path:not(.tl-base)').getAttribute('d').slice(1).split('L')[0];
  return [number, ...tip.split(' ').map(Number)];
}).sort((a, b) => a[0] - b[0])"""


@pytest.fixture(scope="module")
def planned(tmp_path_factory):
    folder = tmp_path_factory.mktemp("plan")
    write_plan(plan_request(QUICK), folder)
    return folder


def tips(opened):
    """Numbers and places of the drawn centres of projection, (cameras, 3) in px."""
    return np.array(opened.page.locator("[data-testid=layouts]").evaluate(TIPS))


@pytest.mark.slow
def test_every_option_shows_and_tells_where_its_cameras_are(chromium, planned):
    """Seen from above, distances in the image are those on the ground, in one scale for all."""
    with (
        xr.open_dataset(planned / "plan.nc") as cube,
        open_offline(chromium, planned / "plan.html") as opened,
    ):
        page, scales = opened.page, []
        head, text = page.get_by_test_id("csv").get_attribute("href").split(",", 1)
        assert head.startswith("data:text/csv")
        assert unquote(text) == (planned / "plan.csv").read_text(encoding="utf-8")
        page.locator("[data-testid=panel-a]").focus()
        for _ in range(12):  # to the top, and beyond
            page.keyboard.press("ArrowUp")
        chooser = page.locator("[data-testid=option]")
        assert chooser.input_value() == str(int(cube["chosen"]))
        for i in range(cube.sizes["option"]):
            chooser.select_option(str(i))
            one, drawn = cube.isel(option=i), tips(opened)
            n = int(one["n_cameras"])
            assert drawn[:, 0].tolist() == list(range(1, n + 1))
            ground = one["camera_position"].values[:n, :2]
            scales += (pdist(drawn[:, 1:]) / pdist(ground)).tolist()
            rows = page.locator(".tl-cameras tbody tr").all_inner_texts()
            shown = [[float(text.rstrip("°m ")) for text in row.split("\t")[1:-1]] for row in rows]
            lengths = 1000 * one["camera_distance"], 1000 * one["focal_length"]
            wanted = np.transpose([one["camera_azimuth"], one["camera_elevation"], *lengths])
            np.testing.assert_allclose(shown, wanted[:n], atol=1e-3)
        assert np.ptp(scales) < 0.01 * np.max(scales)


@pytest.mark.slow
@pytest.mark.parametrize(("width", "dark"), [(1280, True), (390, False)])
def test_page_is_for_everybody(chromium, planned, width, dark):
    """Nothing beyond the picture's box, nothing wrong for those who do not see it."""
    with open_offline(chromium, planned / "plan.html", width=width, dark=dark) as opened:
        assert opened.sideways_px() == 0
        size = opened.page.locator("[data-testid=panel-a]").get_attribute("viewBox")
        _, _, w, h = map(float, size.split())
        drawn = tips(opened)[:, 1:]
        assert np.all((drawn > 0) & (drawn < [w, h]))
        assert axe.findings(opened.page) == []


@pytest.mark.slow
def test_the_address_keeps_the_option_and_bears_rubbish(chromium, planned):
    with open_offline(chromium, planned / "plan.html") as opened:
        said = opened.page.locator(".tl-summary")
        address, words = opened.page.url, said.inner_text()
        for query in ("option=1e9", "option=NaN", "plan=__proto__&option=%3Cb%3E", "%FF=%E0%A4%A"):
            opened.page.goto("about:blank")
            opened.page.goto(f"{address}?{query}")
            assert said.inner_text() == words, query
        opened.page.goto(address)
        opened.page.get_by_test_id("option").select_option("1")
        assert opened.page.url == f"{address}?plan=1&option=2"
        words = said.inner_text()
        opened.page.reload()
        assert said.inner_text() == words
        assert opened.page.get_by_test_id("option").input_value() == "1"
