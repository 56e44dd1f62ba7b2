"""The image of a plan that can be turned: what it shows is where the cameras are."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import unquote

import numpy as np
import pytest
import xarray as xr
from browser import Opened, drag, open_offline

from thesis_lib.planning.report import write_plan
from thesis_lib.planning.request import plan_request

if TYPE_CHECKING:
    from playwright.sync_api import Browser

QUICK = {"counts": [2, 5], "starts": 1, "step_deg": 15, "trials": 20, "target_percent": 12}
TIPS = """root => [...root.querySelectorAll('.tl-camera')].map(one => {
  const number = Number(one.querySelector('text').textContent);
  const tip = one.querySelector('path:not(.tl-base)').getAttribute('d').slice(1).split('L')[0];
  return [number, ...tip.split(' ').map(Number)];
}).sort((a, b) => a[0] - b[0])"""


@pytest.fixture(scope="module")
def planned(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("plan")
    write_plan(plan_request(QUICK), folder)
    return folder


def tips(opened: Opened) -> np.ndarray[Any, Any]:
    """Numbers and places of the drawn centres of projection, (cameras, 3) in px."""
    return np.array(opened.page.locator("[data-testid=layouts]").evaluate(TIPS))


@pytest.mark.slow
def test_every_option_shows_its_cameras_where_they_are(chromium: Browser, planned: Path) -> None:
    """Seen from above, distances in the image are those on the ground, in one scale for all."""
    with (
        xr.open_dataset(planned / "plan.nc") as cube,
        open_offline(chromium, planned / "plan.html") as opened,
    ):
        page, scales = opened.page, []
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
            assert page.locator(".tl-summary").inner_text().startswith(f"{n} of ")
            ground = one["camera_position"].values[:n, :2]
            true, seen = (
                np.linalg.norm(where[:, None] - where, axis=-1)[np.triu_indices(n, 1)]
                for where in (ground, drawn[:, 1:])
            )
            scales += (seen / true).tolist()
            assert np.ptp(seen / true) < 0.01 * np.max(seen / true)
        assert np.ptp(scales) < 0.01 * np.max(scales)
        assert opened.trouble == []


def test_arrow_keys_and_dragging_turn_it(chromium: Browser, planned: Path) -> None:
    with open_offline(chromium, planned / "plan.html") as opened:
        canvas = opened.page.locator("[data-testid=panel-a]")
        first = tips(opened)
        canvas.focus()
        opened.page.keyboard.press("ArrowRight")
        turned = tips(opened)
        opened.page.keyboard.press("ArrowLeft")
        assert np.abs(turned - first).max() > 2
        np.testing.assert_allclose(tips(opened), first, atol=0.11)
        drag(opened, "panel-a", 60)
        assert np.abs(tips(opened) - first).max() > 10
        for _ in range(25):  # from below, too, and no farther
            opened.page.keyboard.press("ArrowDown")
        below = tips(opened)
        opened.page.keyboard.press("ArrowDown")
        np.testing.assert_array_equal(tips(opened), below)


@pytest.mark.parametrize(("width", "dark"), [(1280, False), (1280, True), (390, False)])
def test_page_is_for_everybody(chromium: Browser, planned: Path, width: int, dark: bool) -> None:
    """Nothing beyond the picture's box, nothing wrong for those who do not see it."""
    import axe

    with open_offline(chromium, planned / "plan.html", width=width, dark=dark) as opened:
        assert opened.sideways_px() == 0
        canvas = opened.page.locator("[data-testid=panel-a]").bounding_box()
        assert canvas is not None
        assert canvas["width"] > 0.8 * min(width, 700) - 60
        size = opened.page.locator("[data-testid=panel-a]").get_attribute("viewBox")
        assert size is not None
        _, _, w, h = map(float, size.split())
        drawn = tips(opened)[:, 1:]
        assert np.all((drawn > 0) & (drawn < [w, h]))
        try:
            axe.source()
        except Exception as error:
            pytest.skip(f"no axe-core: {error}")
        assert axe.findings(opened.page) == []


def test_the_table_tells_the_cameras_and_is_the_plans_csv(chromium: Browser, planned: Path) -> None:
    with (
        xr.open_dataset(planned / "plan.nc") as cube,
        open_offline(chromium, planned / "plan.html") as opened,
    ):
        link, table = opened.page.get_by_test_id("csv"), opened.page.locator(".tl-cameras")
        head, text = str(link.get_attribute("href")).split(",", 1)
        assert head.startswith("data:text/csv")
        assert unquote(text) == (planned / "plan.csv").read_text(encoding="utf-8")
        for i in range(cube.sizes["option"]):
            opened.page.get_by_test_id("option").select_option(str(i))
            one = cube.isel(option=i)
            rows = table.locator("tbody tr").all_inner_texts()
            assert len(rows) == int(one["n_cameras"])
            for row, camera in zip(rows, range(len(rows)), strict=True):
                number, *words, pixels = row.split("\t")
                shown = [float(word.rstrip("°m ")) for word in words]
                true = [float(one[f"camera_{a}"][camera]) for a in ("azimuth", "elevation")]
                lengths = [one["camera_distance"][camera], one["focal_length"][camera]]
                true += [1000 * float(length) for length in lengths]
                assert number == str(camera + 1)
                np.testing.assert_allclose(shown, true, atol=1e-3)
                assert pixels == f"{int(one['width_px'])} × {int(one['height_px'])}"
        assert opened.trouble == []


@pytest.mark.slow
def test_the_address_keeps_the_option_and_bears_rubbish(chromium: Browser, planned: Path) -> None:
    rubbish = [
        "option=0", "option=-1", "option=1e9", "option=NaN", "option=1.5", "plan=0&option=x",
        "plan=__proto__&option=constructor", "option=%3Cb%3E", "%FF=%FF&option=%E0%A4%A", "option",
    ]  # fmt: skip
    with open_offline(chromium, planned / "plan.html") as opened:
        said = opened.page.locator(".tl-summary")
        address, words = opened.page.url, said.inner_text()
        for query in rubbish:
            for mark in "?#":
                opened.page.goto("about:blank")
                opened.page.goto(f"{address}{mark}{query}")
                assert said.inner_text() == words, query
        opened.page.goto(address)
        opened.page.get_by_test_id("option").select_option("1")
        assert opened.page.url == f"{address}?plan=1&option=2"
        words = said.inner_text()
        opened.page.reload()
        assert said.inner_text() == words
        assert opened.page.get_by_test_id("option").input_value() == "1"
        assert opened.trouble == []
