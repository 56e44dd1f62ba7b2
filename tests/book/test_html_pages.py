"""Finished pages: names, folded contents, images with sizes, shared viewers, drawn intervals."""

import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from browser import open_offline
from lxml.html import document_fromstring, tostring
from matplotlib.figure import Figure
from numpy.testing import assert_allclose
from PIL import Image

from thesis_lib.book import extension, html_pages
from thesis_lib.book.html_pages import draw_intervals, index_page
from thesis_lib.plotting.style import figure_svg
from thesis_lib.web.html import static_html

SVG = '<svg xmlns="http://www.w3.org/2000/svg" {}/>'


def test_parts_of_the_contents_fold_except_for_the_one_that_is_read() -> None:
    part = '<p class="caption"><span>{}</span></p><ul class="{} nav"><li>a</li>{}</ul>'
    more = "<li>b</li>"
    parts = part.format("One", "current", more) + part.format("Two", "", more)
    page = document_fromstring(f"<nav>{parts}{part.format('Alone', '', '')}</nav>")
    html_pages.fold_contents(page)
    one, two = page.iter("details")
    assert (one.get("open"), two.get("open")) == ("", None)
    assert [part.text_content() for part in (one, two)] == ["Oneab", "Twoab"]
    assert "Alone" not in page.text_content()


def test_images_wait_with_their_size_and_panels(tmp_path: Path) -> None:
    drawing = SVG.format('data-panels="0 0 9 9" width="72pt" height="36.75pt"')
    (tmp_path / "a b.svg").write_text(drawing, encoding="utf-8")
    Image.new("L", (640, 360)).save(tmp_path / "c.webp")
    sources = ("a%20b.svg", "c.webp", "none.svg", "data:image/png;base64,a")
    page = document_fromstring("".join(f'<img src="{source}">' for source in sources))
    html_pages.load_lazily(page, tmp_path)
    found = [{**image.attrib} for image in page.iter("img")]
    lazy = {"loading": "lazy"}
    drawn = {"width": "96", "height": "49", "data-panels": "0 0 9 9"}
    assert found[0] == {"src": "a%20b.svg", **lazy, **drawn}
    assert found[1] == {"src": "c.webp", **lazy, "width": "640", "height": "360"}
    assert found[2:] == [{"src": source} for source in sources[2:]]


ESM = """function told(model) {
const state = model.get("a");
return state;
}
export default { render({ model, el }) { el.textContent = told(model); } };
"""


@pytest.mark.slow
def test_pages_share_the_programs_and_styles_of_viewers(chromium: Any, tmp_path: Path) -> None:
    """Two with other data on one page, and one on a page in a folder below."""
    css = ".tl-fragment { color: rgb(1, 2, 3); }"
    one, other = (static_html(ESM, css, {"a": text}) for text in ("one", "other"))
    (tmp_path / "below").mkdir()
    for name, fragments in {"a.html": [one, other], "below/b.html": [other]}.items():
        page = document_fromstring("<!doctype html><title>a</title>" + "".join(fragments))
        html_pages.share_viewers(page, tmp_path, "../" * name.count("/"))
        html = tostring(page, encoding="unicode", doctype="<!DOCTYPE html>")
        assert "told(" not in html
        assert "rgb" not in html
        (tmp_path / name).write_text(html, encoding="utf-8")
        with open_offline(chromium, tmp_path / name) as opened:
            shown = opened.page.locator(".tl-fragment")
            assert shown.all_inner_texts() == ["one", "other"][-len(fragments) :]
            assert shown.last.evaluate("e => getComputedStyle(e).color") == "rgb(1, 2, 3)"
            assert opened.trouble == []
    files = (tmp_path / html_pages.VIEWERS_FOLDER).iterdir()
    assert sorted(file.suffix for file in files) == [".css", ".js"]


def test_cells_of_five_numbers_are_drawn_on_one_scale() -> None:
    cells = ("12.5 · 10.0 (5.0–20.0) · 15.0", "5.0 · 5.0 (2.5–7.5) · 5.0", "nodal [1.4]")
    page = document_fromstring(
        f"<table><tr>{''.join(f'<td><p>{one}</p></td>' for one in cells)}</tr></table>"
        "<p>Each cell: nominal run · median (5–95 %) of the trials · law of rounding, in % of "
        'the peak.</p><a href="../data/beam-arrays.csv">all</a>'
    )
    draw_intervals(page)
    text = tostring(page, encoding="unicode")
    found = r'd="M(\S+) 7H(\S+)".*?d="M(\S+) 1v12".*?cx="(\S+)".*?d="M(\S+) 3l'
    marks = [[*map(float, one)] for one in re.findall(found, text, re.DOTALL)][:2]
    assert marks == [[25.0, 85.0, 65.0, 45.0, 55.0], [15.0, 35.0, 25.0, 25.0, 25.0]]
    assert "nodal [1.4]" in text
    assert "drawn from 0 to 20 %:" in text
    assert "law of rounding; in % of the peak." in text
    assert 'href="../data/beam-arrays.csv">All numbers' in text
    assert "nominal run 12.5, median 10.0, 5–95 % of the trials 5.0 to 20.0" in text


@pytest.mark.parametrize("colour", ["#0072b2", "#b22222", "#009e73", "#cc79a7", "#1d3557"])
def test_colours_in_the_dark_have_the_contrast_of_text(colour: str) -> None:
    dark = [int(html_pages.find_dark_colour(colour)[i : i + 2], 16) for i in (1, 3, 5)]
    ground = html_pages.compute_luminance(html_pages.DARK_GROUND)
    assert (html_pages.compute_luminance(dark) + 0.05) / (ground + 0.05) >= 4.4


def test_panels_of_a_figure_are_where_matplotlib_draws_them() -> None:
    """Four panels, of which the last has a colour scale; a single column has none."""
    figure = Figure(figsize=(7.6, 5.4), layout="constrained")
    axes = figure.subplots(2, 2)
    axes[0, 0].plot([0, 1], [0, 1e4])
    axes[0, 0].set(ylim=(0, 10), ylabel="deflection, mm", title="(a) shape")
    figure.colorbar(axes[1, 1].imshow(np.eye(3)), ax=axes[1, 1], label="w, mm")
    told = re.findall('data-panels="([^"]*)"', figure_svg(figure))[0]
    boxes = [[float(one) for one in box.split()] for box in told.split(";")]
    assert len(boxes) == 4
    width, height = 72 * figure.get_size_inches()
    extent = figure.axes[0].get_tightbbox()
    expected = [100 * extent.x0 / width, 100 - 100 * extent.y1 / height, 100 * extent.width / width]
    assert_allclose(boxes[0][:3], expected, atol=2)
    assert boxes[3][0] + boxes[3][2] > 95  # with its scale
    column = Figure(figsize=(5, 5), layout="constrained")
    column.subplots(3)
    assert "data-panels" not in figure_svg(column)


@pytest.mark.parametrize(
    ("address", "branch", "expected"),
    [
        ("https://github.com/a/b.git/", "", "/v2/gh/a/b/main?urlpath=lab/tree/notebooks/beam-"),
        ("https://git.example/a", "x", "/v2/git/https%3A%2F%2Fgit.example%2Fa/x?"),
        ("", "", None),
    ],
)  # fmt: skip
def test_a_configured_repository_gives_a_binder_button(
    address: str, branch: str, expected: str | None
) -> None:
    options = {"repository_url": address, "repository_branch": branch}
    app = SimpleNamespace(config=SimpleNamespace(html_theme_options=options))
    for page in ("executed/beam-distance", "intro"):
        context: dict[str, Any] = {}
        extension._add_binder_button(app, page, "", context, None)
        buttons = context.get("header_buttons", [])
        assert len(buttons) == (expected is not None and page != "intro")
        assert not buttons or expected in buttons[0]["url"]


def test_a_warning_is_found_by_its_name() -> None:
    page = document_fromstring(
        "<article class='bd-article'><section id='a'><h1>Warnings</h1><dl><dt><span id='in-plane'>"
        "<code>in-plane</code></span> · Markers move.</dt><dd>What it means.</dd></dl></section>"
    )
    _, warning = index_page(page)
    assert (warning.kind, warning.title, warning.places) == ("term", "in-plane", ["in-plane"])
    assert warning.text == "in-plane · Markers move. What it means."
