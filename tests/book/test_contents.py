"""The contents in the margin: parts that fold."""

from __future__ import annotations

from thesis_lib.book.contents import fold

HEAD = '<p aria-level="2" class="caption" role="heading"><span class="caption-text">{}</span></p>\n'
ITEM = '\n<li class="toctree-l1">b</li>'
PAGES = f'<ul class="{{}}nav bd-sidenav">\n<li class="toctree-l1">a</li>{ITEM}</ul>\n'


def test_parts_fold_but_for_the_one_that_is_read() -> None:
    one = PAGES.replace(ITEM, "").format("")
    html = "<div>" + HEAD.format("A &amp; b") + PAGES.format("current ") + HEAD.format("C")
    html += PAGES.format("") + HEAD.format("Alone") + one + "</div>"
    made = fold(html)
    assert made.count("<details") == 2
    opened, closed = made.split('<details class="tl-part"')[1:]
    assert opened.startswith(" open>")
    assert '<span class="caption-text">A &amp; b</span></summary><ul class="current nav' in opened
    assert closed.startswith("><summary")
    assert closed.count("<ul") == 2  # the last part is its page
    assert "Alone" not in made
    assert fold("<p>none</p>") == "<p>none</p>"
