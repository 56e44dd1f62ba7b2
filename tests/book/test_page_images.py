"""Pictures of pages: loaded when needed, with sizes that their files tell."""

from __future__ import annotations

import base64
import io
import re
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from numpy.testing import assert_allclose
from PIL import Image

from thesis_lib.book.drawings import paletted, rowed
from thesis_lib.book.images import (
    classed,
    in_files,
    in_the_dark,
    lazy,
    luminance,
    relative,
    size_px,
    squeeze,
    themed,
    worded,
)
from thesis_lib.plotting.style import STYLE, svg

SVG = '<?xml version="1.0"?>\n<svg xmlns="x" width="72pt" height="36.75pt" viewBox="0 0 1 1"/>'


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "a b.svg").write_text(SVG, encoding="utf-8")
    Image.new("L", (640, 360)).save(tmp_path / "c.webp")
    (tmp_path / "d.svg").write_text('<svg viewBox="0 0 4 3"/>', encoding="utf-8")
    return tmp_path


def test_sizes_are_those_of_the_files(folder: Path) -> None:
    assert size_px(folder / "a b.svg") == (96, 49)
    assert size_px(folder / "c.webp") == (640, 360)
    assert size_px(folder / "d.svg") is None
    assert size_px(folder / "none.webp") is None
    assert size_px(folder) is None


def test_pictures_wait_with_their_size(folder: Path) -> None:
    page = '<p><img alt="a &gt; b" src="a%20b.svg" /></p><img src="c.webp" alt="">'
    assert lazy(page, folder) == (
        '<p><img alt="a &gt; b" src="a%20b.svg" width="96" height="49" loading="lazy" /></p>'
        '<img src="c.webp" alt="" width="640" height="360" loading="lazy">'
    )
    assert lazy(lazy(page, folder), folder) == lazy(page, folder)


def test_long_drawings_become_files(folder: Path) -> None:
    """Twice the same is one file; what is short stays; the page finds it from where it stands."""
    drawing = SVG.replace("/>", f"><!--{'x' * 20_000}--></svg>")
    long, short = (base64.b64encode(text.encode()).decode() for text in (drawing, SVG))
    page = "".join(
        f'<img alt="a" src="data:image/svg+xml;base64,{c}">' for c in (long, long, short)
    )
    deep, images = folder / "executed", folder / "_images"
    deep.mkdir()
    images.mkdir()
    mended = in_files(page, deep, images)
    (file,) = images.iterdir()
    assert file.read_text(encoding="utf-8") == drawing
    assert mended.count(f'src="../_images/{file.name}"') == 2
    assert short in mended
    assert long not in mended
    assert lazy(mended, deep).count('width="96" height="49" loading="lazy"') == 2


@pytest.mark.parametrize(
    "image", ['<img src="d.svg">', '<img src="none.svg">', '<img src="data:image/png;base64,a">',
              '<img src="c.webp" loading="eager">']
)  # fmt: skip
def test_what_is_not_known_stays(folder: Path, image: str) -> None:
    assert lazy(image, folder) == image


def test_a_width_of_the_page_stays(folder: Path) -> None:
    page = '<img src="c.webp" style="width: 100%;" />'
    styled = lazy(page, folder)
    assert 'style="width: 100%;"' in styled
    assert (
        lazy('<img src="c.webp" width="9">', folder)
        == '<img src="c.webp" width="9" loading="lazy">'
    )


def squeezed(drawn: str) -> str:
    """A drawing in fewer letters, of which no more can be spared."""
    found = squeeze(drawn)
    assert squeeze(found) == found
    return found


def test_a_drawing_is_the_same_in_fewer_letters() -> None:
    drawn = (
        '<svg>\n  <metadata>\n when </metadata>\n <g style="stroke-width: 0.123456"\n'
        ' transform="scale(0.015625)">\n <path d="M 1234567.891 -0.004 \nL 2 0.126" x="1.005"/>'
        "</g></svg>"
    )
    assert squeezed(drawn) == (
        '<svg><g style="stroke-width:0.123456"\n transform="scale(0.015625)">'
        '<path d="M1234567.89 0L2 0.13" x="1"/></g></svg>'
    )


def test_marks_of_one_style_share_it() -> None:
    marks = [
        f'<use xlink:href="#m" x="{x}" y="2" style="fill: {c}; stroke: {c}"/>'
        for x, c in ((1, "#009e73"), (2, "#009e73"), (3, "red"))
    ]
    drawn = "<svg>" + "\n".join(marks) + "</svg>"
    assert squeezed(drawn) == (
        '<svg><g style="fill:#009e73;stroke:#009e73"><use href="#m" x="1" y="2"/>'
        '<use href="#m" x="2" y="2"/></g>'
        '<use href="#m" x="3" y="2" style="fill:red;stroke:red"/></svg>'
    )


def test_only_parts_used_again_are_named_and_shortly() -> None:
    drawn = (
        '<svg><g id="figure_1"><path id="DejaVuSans-31" d="M0 0"/><clipPath id="p7f"/>'
        '<use xlink:href="#DejaVuSans-31"/><g clip-path="url(#p7f)"/></g></svg>'
    )
    assert squeezed(drawn) == (
        '<svg><path id="a" d="M0 0"/><clipPath id="b"/>'
        '<use href="#a"/><g clip-path="url(#b)"/></svg>'
    )


def test_words_in_a_drawing_keep_their_spaces() -> None:
    words = "<text>a <tspan>b</tspan>\n <tspan>c</tspan></text>"
    assert squeezed(f"<svg>\n {words}\n</svg>") == f"<svg>{words}</svg>"


def test_parts_of_a_formula_that_have_places_need_no_spaces() -> None:
    drawn = '<svg><text>\n <tspan x="1">a</tspan>\n <tspan x="2"> </tspan>\n</text></svg>'
    assert squeezed(drawn) == '<svg><text><tspan x="1">a</tspan><tspan x="2"> </tspan></text></svg>'


def test_the_font_of_words_is_told_once() -> None:
    """Whoever has no DejaVu Sans has Verdana, which is as wide, or some font."""
    figure = Figure(figsize=(3, 2))
    figure.text(0.5, 0.5, "a < b")
    figure.text(0.5, 0.2, "up", rotation=90)
    drawn = svg(figure)
    told = worded(drawn)
    assert drawn.count("font-family") == 2
    assert told.count("font-family") == 1
    assert "svg{font-family:'DejaVu Sans',Verdana,sans-serif}" in told
    assert STYLE["font.sans-serif"] == ["DejaVu Sans", "Verdana", "sans-serif"]  # the same
    assert "rotate(-90)" in told
    assert "rotate(-0" not in told
    assert ">a &lt; b</text>" in told
    assert worded("<svg><text>a</text></svg>") == "<svg><text>a</text></svg>"


def test_colours_of_a_drawing_are_variables_with_another_value_in_the_dark() -> None:
    drawn = '<svg width="1"><path style="fill:#ffffff;stroke: #0072B2"/><rect fill="#000"/></svg>'
    made = themed(drawn)
    assert "fill:var(--cffffff);stroke: var(--c0072b2)" in made
    assert 'fill="var(--c000000)"' in made
    light, _, dark = made.partition("@media (prefers-color-scheme:dark)")
    assert "--c0072b2:#0072b2;" in light
    assert "--cffffff:#121212;" in dark
    assert "fill:var(--c000000)}" in light  # what has no colour of its own


@pytest.mark.parametrize("colour", ["#0072b2", "#b22222", "#009e73", "#cc79a7", "#1d3557"])
def test_colours_are_seen_on_the_dark_ground_and_keep_their_order_of_parts(colour: str) -> None:
    def parts(one: str) -> list[int]:
        return [int(one[i : i + 2], 16) for i in (1, 3, 5)]

    dark, ground = parts(in_the_dark(colour)), parts(in_the_dark("#ffffff"))
    assert (luminance(dark) + 0.05) / (luminance(ground) + 0.05) >= 4.4
    assert sorted(range(3), key=parts(colour).__getitem__) == sorted(range(3), key=dark.__getitem__)


def points(path: str) -> list[tuple[float, float]]:
    """Where a path's points are, of absolute and of relative steps alike."""
    told = re.findall(r"[A-Za-z]|-?\d*\.?\d+", path)
    at, start, places, name = np.zeros(2), np.zeros(2), [], ""
    while told:
        if told[0].isalpha():
            name = told.pop(0)
        if name == "z":
            at = start
            continue
        many = {"m": 1, "l": 1, "q": 2, "c": 3}[name.lower()]
        step = np.array([float(told.pop(0)) for _ in range(2 * many)]).reshape(many, 2)
        step = step + at if name.islower() else step
        places += [(float(x), float(y)) for x, y in step]
        at = step[-1]
        start = at if name == "M" else start
    return places


def test_paths_of_steps_pass_through_the_same_points() -> None:
    """Thousands of steps do not drift, whatever they are; a path may begin again where it ended."""
    rng = np.random.default_rng(3)
    parts = ["M10 20"]
    for name in rng.choice([*"MLQCz"], 3000):
        count = {"M": 2, "L": 2, "Q": 4, "C": 6, "z": 0}[name]
        parts.append(name + " ".join(f"{x:.2f}" for x in rng.uniform(-300, 300, count)))
    drawn = f'<path d="{"".join(parts)}"/>'
    shorter = relative(drawn)
    assert len(shorter) < len(drawn)
    assert_allclose(points(shorter[9:-3]), points(drawn[9:-3]), atol=1e-9)


def test_styles_are_told_once() -> None:
    """A drawing that has classes of its own keeps its styles; one alone stays where it is."""
    twice = (
        '<svg width="1"><g style="fill:red"/><g style="stroke: red"/><g style="fill:red"/></svg>'
    )
    told = classed(twice)
    assert told.count("fill:red") == 1
    assert told.count('class="s0"') == 2
    assert 'style="stroke: red"' in told
    own = twice.replace("<g style", '<g class="own" style', 1)
    assert classed(own) == own


def test_a_map_of_few_colours_keeps_every_pixel_as_an_index() -> None:
    """One with too many colours, or that one sees through, stays as it is."""
    rng = np.random.default_rng(1)
    few = rng.integers(0, 255, (9, 3), dtype=np.uint8)[rng.integers(0, 9, (40, 60))]
    many = rng.integers(0, 255, (40, 60, 3), dtype=np.uint8)

    def drawn(pixels: np.ndarray, alpha: int = 255) -> str:
        image = io.BytesIO()
        picture = Image.fromarray(pixels).convert("RGBA")
        picture.putalpha(alpha)
        picture.save(image, "PNG")
        text = base64.b64encode(image.getvalue()).decode()
        return f'<svg><image href="data:image/png;base64,{text}"/></svg>'

    shorter = paletted(drawn(few))
    assert len(shorter) < len(drawn(few))
    told = base64.b64decode(re.findall(r'base64,([^"]*)"', shorter)[0])
    assert np.array_equal(np.asarray(Image.open(io.BytesIO(told)).convert("RGB")), few)
    for other in (drawn(many), drawn(few, alpha=9)):
        assert paletted(other) == other


def test_rows_of_marks_are_paths_with_the_mark_at_every_point() -> None:
    """Two rows of one mark and style share it; what is no row stays."""
    marks = [f'<use href="#a" x="{x}" y="{x * x}"/>' for x in range(5)]
    row, pair = (f'<g style="fill:red">{"".join(some)}</g>' for some in (marks, marks[:2]))
    told = rowed(f"<svg>{row}{pair}{row}</svg>")
    assert told.count('<marker id="m0"') == told.count("<marker") == 1
    assert told.count("marker:url(#m0)") == 2
    assert told.count('d="M0 0L1 1L2 4L3 9L4 16"') == 2
    assert pair in told
