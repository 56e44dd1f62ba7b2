"""The report on the shipped example that the book shows: as measured, and as users get theirs."""

import axe
import numpy as np
import pytest
from browser import open_offline

from thesis_lib.book.pieces import manifest as sample
from thesis_lib.figure_sets import record as example
from thesis_lib.measure.messages import ALL_MESSAGES
from thesis_lib.measure.report.warnings import check_shape


@pytest.fixture(scope="module")
def data():
    return example.read_example()


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    folder = tmp_path_factory.mktemp("sample")
    sample.write_sample(folder)
    return folder / sample.SAMPLE_PAGE


def test_it_is_small_and_its_files_are_those_that_the_step_names(page):
    assert page.stat().st_size < 1.5e6
    assert {file.name for file in page.parent.iterdir()} == {*sample.SAMPLE_FILES}


@pytest.mark.slow
def test_it_opens_offline_without_an_error(chromium, page):
    with open_offline(chromium, page, width=390, dark=True, fresh=True) as opened:
        opened.page.mouse.wheel(0, 20_000)
        pictures = "all => all.map(one => [one.naturalWidth, one.alt])"
        shown = opened.page.locator("figure img").evaluate_all(pictures)
        assert len(shown) == 8
        assert all(wide > 0 and words.strip() for wide, words in shown)
        assert opened.page.locator(".tl-dot").count() == 75
        for width in (390, 1280):
            opened.page.set_viewport_size({"width": width, "height": 900})
            assert opened.sideways_px() <= 0
        assert opened.said == []
        assert axe.light_and_dark(opened.page) == []


def test_every_note_unfolds_into_its_meaning(chromium, page, data):
    said = check_shape(data)
    assert said
    with open_offline(chromium, page) as opened:
        items = opened.page.locator("aside > ul > li")
        assert items.count() == len(said)
        for item, note in zip(items.all(), said, strict=True):
            assert note.text in item.inner_text()
            words = item.locator("details p").first
            assert not words.is_visible()
            item.locator("summary").click()
            assert words.is_visible()
            assert words.inner_text() == ALL_MESSAGES[note.code].meaning.replace("`", "")


def test_the_measured_tip_is_the_true_one(data):
    tip = np.abs(data["deflection"].values).max()
    error = data["standard_error"].values[np.abs(data["deflection"].values).argmax()]
    truth = example.example_rig().motion.components[0]
    shape = truth.shape(example.example_rig().motion.structure, [[data["x"].max()], [0.0]])
    assert tip == pytest.approx(truth.amplitude * abs(float(shape[0])), abs=3 * error)
