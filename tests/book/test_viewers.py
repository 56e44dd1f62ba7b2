"""Programs and styles of viewers as files that pages share."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from browser import open_offline

from thesis_lib.book.viewers import FOLDER, shared
from thesis_lib.web.fragment import static_html

if TYPE_CHECKING:
    from playwright.sync_api import Browser

# Its own name for something is that of the page's data, and stands at the beginning of a line.
ESM = """function told(model) {
const state = model.get("a");
return state;
}
export default { render({ model, el }) { el.textContent = told(model); } };
"""
CSS = ".tl-fragment { color: rgb(1, 2, 3); }"
HEAD = '<!doctype html><meta charset="utf-8"><title>a</title>'


def test_pages_of_a_folder_share_them(chromium: Browser, tmp_path: Path) -> None:
    """Two with other data on one page, and one on a page in a folder below."""
    one, other = (static_html(ESM, CSS, {"a": text}) for text in ("one", "other"))
    (tmp_path / "below").mkdir()
    for name, fragments in {"a.html": [one, other], "below/b.html": [other]}.items():
        file = tmp_path / name
        html = shared(HEAD + "".join(fragments), file.parent, tmp_path)
        assert "told(" not in html
        assert "rgb" not in html
        file.write_text(html, encoding="utf-8")
        with open_offline(chromium, file) as opened:
            shown = opened.page.locator(".tl-fragment")
            assert shown.all_inner_texts() == ["one", "other"][-len(fragments) :]
            assert shown.last.evaluate("e => getComputedStyle(e).color") == "rgb(1, 2, 3)"
            assert opened.trouble == []
    assert sorted(file.suffix for file in (tmp_path / FOLDER).iterdir()) == [".css", ".js"]


def test_other_programs_stay() -> None:
    page = '<style>a{}</style><script type="module">\nconst a = 1;\n</script>'
    assert shared(page, Path("a"), Path("a")) == page
