"""The book as one PDF: nothing is missing that its pages have."""

import html
import re
import unicodedata
from pathlib import Path

import nbformat
import pytest
import xarray as xr
from book.test_thesis_index import documents

from thesis_lib.book import rendering as printing
from thesis_lib.figure_sets.display import list_captions
from thesis_lib.figure_sets.registry import STUDIES
from thesis_lib.web import html as widgets

ROOT = Path(__file__).parents[2]
WITHOUT_VIEWER = ("cameras", "planner", "claims", "lab-radiation")
PDF = ROOT / "build" / "vibration-by-many-cameras.pdf"
ESM = "export default { render({ el }) { el.textContent = 'alive'; } };"


def needs_pdf(test):
    """Mark a test that reads the printed book, which takes minutes to make."""
    printed = pytest.mark.skipif(not PDF.is_file(), reason="no PDF in build: `make pdf` first")
    return pytest.mark.nightly(printed(test))


def test_widgets_give_way_to_a_line_that_says_where_they_are():
    one, two = (widgets.static_html(ESM, "p { margin: 0 }", {"n": n}) for n in (1, 2))
    stays = widgets.static_html(ESM, "", {"n": 3}, prints=True)
    printed = printing.prepare_page(
        f'<span id="document-how-to"></span><p>first</p>{one}<p>between</p>{stays}'
        f'<span id="document-executed/beam-distance"></span>{two}<p>last</p>'
        "<details>more</details>"
    )
    assert printed.count("<script") == 1
    assert printed.count("data-tl-print") == 1
    where = re.findall(r"Interactive, in the book: ([\w/.-]+)<", printed)
    assert where == ["how-to.html", "executed/beam-distance.html"]
    assert re.findall(r"<p>(\w+)</p>", printed) == ["first", "between", "last"]
    assert '<details open=""' in printed


def plain(text):
    """Letters and digits alone: a PDF breaks lines and joins letters as it likes."""
    return re.sub(r"\W+", "", unicodedata.normalize("NFKC", text)).lower()


@pytest.fixture(scope="module")
def printed():
    pypdf = pytest.importorskip("pypdf", reason="the PDF is read with pypdf")
    return pypdf.PdfReader(PDF)


@pytest.fixture(scope="module")
def words():
    pdfium = pytest.importorskip("pypdfium2", reason="words are read with pypdfium2, at once")
    with pdfium.PdfDocument(PDF) as document:
        return plain("".join(page.get_textpage().get_text_bounded() for page in document))


@needs_pdf
def test_titles_of_all_pages_are_printed(words):
    missing = []
    for name in documents():
        text = (ROOT / "build" / "html" / f"{name}.html").read_text(encoding="utf-8")
        title = re.search(r"<h1>((?:(?!<h1>).)*?)<a class=\"headerlink", text, re.DOTALL)
        heading = html.unescape(re.sub(r"<[^>]+>", "", title[1]))
        missing += [heading] if plain(heading) not in words else []
    assert missing == []


@needs_pdf
def test_captions_of_all_figures_are_printed(words):
    number, missing = 0, []
    for name in STUDIES:
        document = nbformat.read(ROOT / "notebooks" / f"{name}.ipynb", as_version=4)
        for cell in document.cells:
            for caption in list_captions(STUDIES[name](), cell.source):
                number += 1
                missing += [caption] if plain(caption.text) not in words else []
    assert number > 130
    assert missing == []


@needs_pdf
def test_pdf_has_the_explorer_and_every_row_of_the_ledger(printed, words):
    key = "measured, pixels as in the thesis expected: ± 2 σ by the law of rounding"
    assert words.count(plain(key)) == 2  # at home and on the explorer's page
    cube = xr.open_dataset(ROOT / "data" / "results" / "claims.nc")
    rows = cube["claim"].size
    assert rows > 400
    found = sum(words.count(plain(f" {v} ")) for v in ("agrees", "within scatter", "differs"))
    assert found >= rows


def outline(items):
    """Titles of an outline, to all depths."""
    for one in items:
        yield from outline(one) if isinstance(one, list) else [one.title]


@needs_pdf
def test_pdf_has_an_outline_and_every_widget_is_named(printed, words):
    titles = list(outline(printed.outline))
    assert len(titles) > 200
    assert not [title for title in titles if len(title) > 3 and re.fullmatch(r"(.+)\1", title)]
    assert plain("Interactive, in the book: executed/beam-distance.html") in words
    viewers = [name for name in STUDIES if name not in WITHOUT_VIEWER]
    assert words.count(plain("Interactive, in the book")) >= len(viewers)
    assert "/StructTreeRoot" in printed.trailer["/Root"]
    assert "file:" not in "".join(
        str(note.get_object().get("/A", {}).get("/URI", ""))
        for page in printed.pages
        for note in page.get("/Annots") or []
    )
