"""Names that readers give are text in every page: never markup, never a script, never a link."""

import tempfile
from functools import cache
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import quote

import nbformat
import pytest
from notebook_pages import add_provenance, build_figures_cell, display_figures

from thesis_lib.figure_sets.cube_file import cube_of
from thesis_lib.figure_sets.parametric.figure_set import camera_study
from thesis_lib.figure_sets.parametric.figures import claims_table, error_table
from thesis_lib.notebook import show as notebook
from thesis_lib.runs import postprocess
from thesis_lib.web import page as pages

NAMES = {
    "an end of the script": "</script><script>hit()</script>",
    "an end and an image": "x'\"><img src=x onerror=hit()>",
    "an equation that is a link": r"$\href{javascript:hit()}{x}$",
    "an equation without dollars": r"\(\href{javascript:hit()}{x}\)",
    "a link": "[x](javascript:hit())",
    "an image": "![x](data:text/html,hit)",
    "a role": "{math}`\\href{javascript:hit()}`",
    "a table": "a | b <b>c</b> | d",
    "a template": "${hit()} {{hit()}} {% x %}",
    "a comment": "<!-- --!><script>hit()",
    "a figure": ":::{figure} javascript:hit()",
}
PLAIN = "plain"
INERT = ("alt", "aria-label", "data-case")  # attributes that are read, not followed


class Tags(HTMLParser):
    """The tags of a page with their attributes, its scripts' beginnings and its text."""

    def __init__(self, page):
        super().__init__()
        self.tags, self.text = [], ""
        self.feed(page)

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, *(name for name, _ in attrs)))
        for name, value in attrs:
            assert not name.startswith("on") or tag == "a", (tag, attrs)
            assert "hit()" not in (value or "") or name in INERT, (tag, attrs)

    def handle_data(self, data):
        self.text += data


def asked(name):
    layouts = {name: [[[60, 30], [-60, 30]]]}
    given = {"trials": 1, "modes": [1], "cases": [], "layouts": layouts, "amplitude_mm": 300,
             "distance_mm": 700}  # fmt: skip
    return camera_study("beam-arrays", given)


@cache
def page_of(name):
    """A page with all that a notebook shows of a cube with this layout."""
    request = asked(name)
    cube = cube_of(request)
    assert float(cube["in_view"].min()) < 1  # so that the note under the table names the layout
    shown = display_figures(cube)
    outputs = [{"text/markdown": made.data} for made in (error_table(cube), claims_table(cube))]
    outputs += [one._repr_mimebundle_()[0] for one in (*shown, notebook.viewer(cube))]
    given = nbformat.v4.new_code_cell(f"layouts = {{{name!r}: 1}}")
    given.metadata["tags"] = ["injected-parameters"]
    cells = [nbformat.v4.new_markdown_cell("# Title\n\n$a$"), given]
    for data in outputs:
        cell = nbformat.v4.new_code_cell("1")
        cell.outputs = [nbformat.v4.new_output("display_data", data)]
        cells.append(cell)
    assert len(shown) == 1
    page = nbformat.v4.new_notebook(cells=[*cells, build_figures_cell(shown)])
    postprocess.place_figures(page)  # as text of a caption, beside that of a front end
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "n.ipynb"
        add_provenance(page, request, cube, Path(folder) / "cube.nc")
        nbformat.write(page, path)
        return pages.export_notebook(path, name)


@pytest.mark.few(3)
@pytest.mark.parametrize("kind", NAMES)
def test_a_name_adds_no_tag_to_a_page(kind):
    name = NAMES[kind][:40].strip()
    hostile = Tags(page_of(name))
    plain = Tags(page_of(PLAIN))
    ours = [tag for tag in hostile.tags if tag[0] != "span"]  # of the coloured program
    assert ours == [tag for tag in plain.tags if tag[0] != "span"]
    assert name in hostile.text


def test_what_a_program_puts_out_is_no_markup():
    said = "\n\n".join(["**bold**", *NAMES.values()])
    found = Tags(pages._render_markdown(said, html=False)).tags
    assert ("strong",) in found
    assert not {"script", "img", "form", "input", "a", "b"} & {tag[0] for tag in found}


@pytest.mark.nightly
def test_no_name_becomes_a_script_or_a_link_in_a_browser(chromium, tmp_path):
    if not (pages.mathjax_path()).is_file():
        pytest.skip("no build/assets: render the book first")
    for number, name in enumerate(NAMES.values()):
        path = tmp_path / f"{number}.html"
        path.write_text(page_of(name[:40].strip()), encoding="utf-8")
        page = chromium.new_page()
        page.add_init_script("window.hits = 0; window.hit = () => { window.hits += 1; };")
        page.goto(f"file://{quote(str(path))}")
        page.wait_for_function("document.querySelector('mjx-container')")
        links = page.evaluate("[...document.querySelectorAll('a')].map(a => String(a.href))")
        links += page.evaluate(
            "[...document.querySelectorAll('svg a')].map(a => a.getAttribute('xlink:href') || '')"
        )
        assert page.evaluate("window.hits") == 0, name
        assert not [link for link in links if "javascript" in link], name
        assert page.evaluate("document.querySelectorAll('mjx-container').length") == 1, name
        page.close()
