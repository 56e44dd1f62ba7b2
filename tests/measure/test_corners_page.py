"""The page on which corners are clicked: what is clicked is what the manifest gets."""

import re

import numpy as np
import pytest
import yaml
from browser import open_offline

from thesis_lib.measure.recordings.manifest import read_manifest
from thesis_lib.measure.recordings.media import write_video
from thesis_lib.measure.recordings.template import corners_page

NAMES = ['<b>"left"</b>', "right & 'far'"]
CORNERS = np.array([[120.0, 90], [520, 130], [470, 250], [90, 200]])
SIZE = (640, 360)


@pytest.fixture
def manifest(tmp_path):
    image = np.full(SIZE[::-1], 40, np.uint8)
    image[100:200, 120:480] = 200
    cameras = []
    for k, name in enumerate(NAMES):
        write_video(tmp_path / f"{k}.mkv", [image] * 3, 30, None)
        cameras.append({"name": name, "video": f"{k}.mkv", "width_px": SIZE[0],
                        "height_px": SIZE[1], "frame_rate_hz": 30, "exposure_s": 0.001,
                        "board_images": f"board/{k}"})  # fmt: skip
    path = tmp_path / "manifest.yaml"
    path.write_text(yaml.safe_dump({"cameras": cameras}), encoding="utf-8")
    page = corners_page(read_manifest(path, check_files=False), tmp_path)
    (tmp_path / "corners.html").write_text(page, encoding="utf-8")
    return path


def screen(opened, name, point):
    """Where on the screen a pixel of a frame is."""
    frame = opened.page.get_by_test_id(f"{name}-frame")
    frame.scroll_into_view_if_needed()
    box = frame.bounding_box()
    unit = box["width"] / SIZE[0]
    return box["x"] + point[0] * unit, box["y"] + point[1] * unit


def lines(opened):
    return opened.page.get_by_test_id("lines").inner_text().splitlines()


@pytest.mark.slow
@pytest.mark.parametrize("width", [1280, 390])
def test_what_is_clicked_is_accepted_by_the_manifest(chromium, manifest, width):
    with open_offline(chromium, manifest.with_name("corners.html"), width=width) as opened:
        page, touch = opened.page, width < 600
        for name in NAMES:
            for point in CORNERS:
                tap = page.touchscreen.tap if touch else page.mouse.click
                tap(*screen(opened, name, point))
        assert opened.sideways_px() <= 0
        found = lines(opened)
    assert len(found) == len(NAMES)
    text, places = manifest.read_text(encoding="utf-8"), iter(found)
    text = re.sub(r"^  video: ", lambda one: f"{next(places)[2:]}\n{one[0]}", text, flags=re.M)
    manifest.write_text(text, encoding="utf-8")
    for camera in read_manifest(manifest, check_files=False).cameras:
        # Clicks land on whole pixels of the screen.
        assert np.abs(np.array(camera.corners_px) - CORNERS).max() <= max(1, SIZE[0] / width)


@pytest.mark.slow
def test_corners_are_corrected_by_keys_and_by_dragging(chromium, manifest):
    """Those of the manifest are there; those of the other camera are put by keys alone."""
    given = read_manifest(manifest, check_files=False)
    first = given.cameras[0].model_copy(update={"corners_px": tuple(map(tuple, CORNERS))})
    of_both = given.model_copy(update={"cameras": (first, given.cameras[1])})
    file = manifest.with_name("corners.html")
    file.write_text(corners_page(of_both, manifest.parent), encoding="utf-8")
    with open_offline(chromium, file, dark=True) as opened:
        page, name = opened.page, NAMES[0]

        def now():
            (line,) = lines(opened)
            return np.array(yaml.safe_load(line)["corners_px"])

        np.testing.assert_allclose(now(), CORNERS)
        page.get_by_role("button", name="Begin again").first.click()
        for point in CORNERS[[0, 2, 1, 3]]:  # out of order
            page.mouse.click(*screen(opened, name, point))
        assert "cross" in page.get_by_role("status").first.inner_text()
        assert lines(opened) == []
        page.get_by_role("button", name="Begin again").first.click()
        for point in CORNERS:
            page.mouse.click(*screen(opened, name, point))
        before = now()
        page.get_by_test_id(f"{name}-1").focus()
        for key in ("ArrowRight", "Shift+ArrowUp", "Alt+ArrowLeft"):
            page.keyboard.press(key)
        np.testing.assert_allclose(now() - before, [[0.9, -10], [0, 0], [0, 0], [0, 0]], atol=0.11)
        start = now()
        page.mouse.move(*screen(opened, name, start[2]))
        page.mouse.down()
        page.mouse.move(*screen(opened, name, start[2] + [40, 30]), steps=4)
        page.mouse.up()
        np.testing.assert_allclose(now() - start, [[0, 0], [0, 0], [40, 30], [0, 0]], atol=1)
        box = page.get_by_test_id(f"{name}-lens").bounding_box()
        start = now()  # in the magnified part eight px of the screen are one of the frame
        page.mouse.click(box["x"] + box["width"] / 2 + 16, box["y"] + box["height"] / 2 - 24)
        np.testing.assert_allclose(now()[2] - start[2], [2, -3], atol=0.25)
        add = page.get_by_role("button", name="Put the next corner").nth(1)
        for keys in ("Left Up", "Right Up", "Right Down", "Left Down"):
            add.press("Enter")
            for key in keys.split():
                page.keyboard.press(f"Shift+Arrow{key}")
        other = np.array(yaml.safe_load(lines(opened)[1])["corners_px"])
        away = [[-10, -10], [10, -10], [10, 10], [-10, 10]]
        np.testing.assert_allclose(other - np.array(SIZE) / 2, away)
