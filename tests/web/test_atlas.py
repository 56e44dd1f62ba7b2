"""The switch of the mode between the figures of one case, on a page as a browser has it."""

import pytest
from browser import open_offline, write_page

from conftest import PROJECT

ASSETS = PROJECT / "book" / "assets"
FIGURE = """<div class="cell"><div class="cell_output"><figure id="fig-{name}"><svg height="700">
</svg></figure></div></div><p class="tl-under-figure" data-case="{case}" data-mode="{mode}">CSV</p>
"""
SHOWN = """() => [...document.querySelectorAll('figure')]
    .filter(one => one.checkVisibility()).map(one => one.id)"""


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """Two cases of two and three modes, one of one mode, and a figure without either."""
    cases = {"2a": (1, 2, 3), "4a'": (1, 2), "own": (1,)}
    figures = [
        FIGURE.format(case=case, mode=mode, name=f"{case.strip(chr(39))}-{mode}")
        for case, modes in cases.items()
        for mode in modes
    ]
    style = f"<style>{(ASSETS / 'book.css').read_text(encoding='utf-8')}</style>"
    scripts = [
        f'<script defer src="{(ASSETS / name).as_uri()}"></script>'
        for name in ("reader.js", "figures.js")
    ]
    link, other = '<a href="#fig-4a-2">figure 4a, 2</a>', '<figure id="else">x</figure>'
    file = tmp_path_factory.mktemp("atlas") / "page.html"
    return write_page(file, style, *scripts, link, *figures, other)


@pytest.mark.slow
def test_one_mode_of_each_case_is_seen_and_the_keyboard_changes_it(chromium, page):
    with open_offline(chromium, page, fresh=True) as opened:
        seen = opened.page
        assert seen.evaluate(SHOWN) == ["fig-2a-1", "fig-4a-1", "fig-own-1", "else"]
        assert seen.get_by_role("group").count() == 2
        seen.get_by_role("group", name="Case 2a, mode").get_by_label("1").focus()
        seen.keyboard.press("ArrowRight")
        assert seen.evaluate(SHOWN) == ["fig-2a-2", "fig-4a-1", "fig-own-1", "else"]
        seen.get_by_role("group", name="Case 4a′, mode").get_by_text("2").click()
        assert seen.evaluate(SHOWN)[:2] == ["fig-2a-2", "fig-4a-2"]
        seen.emulate_media(media="print")
        assert len(seen.evaluate(SHOWN)) == 7
        assert seen.locator(".tl-atlas:visible").count() == 0


def test_a_link_to_a_figure_leads_to_its_mode(chromium, page):
    with open_offline(chromium, page, fresh=True) as opened:
        seen = opened.page
        seen.get_by_role("link").click()
        seen.wait_for_function("() => document.getElementById('fig-4a-2').checkVisibility()")
        assert seen.evaluate(SHOWN)[:2] == ["fig-2a-1", "fig-4a-2"]
        seen.goto(f"{page.as_uri()}#fig-2a-3")
        seen.reload()
        assert seen.evaluate(SHOWN)[0] == "fig-2a-3"
        seen.goto(f"{page.as_uri()}#%E0%A4%A")


def test_without_scripts_all_modes_are_seen(chromium, page):
    context = chromium.new_context(java_script_enabled=False)
    seen = context.new_page()
    seen.goto(page.as_uri())
    assert seen.locator("figure:visible").count() == 7
    assert seen.locator("fieldset").count() == 0
    context.close()
