"""What a page says of itself: a button to run it, where a repository is configured."""

from __future__ import annotations

from pathlib import Path

import pytest

from thesis_lib.book import edition

PAGE = (
    '<div class="article-header-buttons"><button>x</button></div>'
    '<details class="tl-provenance" id="provenance-beam-distance"></details>'
)


@pytest.mark.parametrize(
    ("repository", "expected"),
    [
        ('{url: "https://github.com/a/b", branch: "main"}', "/v2/gh/a/b/main?"),
        ('{url: "https://github.com/a/b.git/", branch: ""}', "/v2/gh/a/b/main?"),
        ('{url: "https://git.example/a", branch: "x"}', "/v2/git/https%3A%2F%2Fgit.example%2Fa/x?"),
        ('{url: "", branch: ""}', None),
        ("{}", None),
    ],
)  # fmt: skip
def test_a_configured_repository_gives_a_button(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, repository: str, expected: str | None
) -> None:
    (tmp_path / "_config.yml").write_text(f"repository: {repository}\n", encoding="utf-8")
    monkeypatch.setattr(edition, "project_root", lambda: tmp_path)
    made = edition.launched(PAGE)
    if expected is None:
        assert made == PAGE
    else:
        assert made.count("<a ") == 1
        assert f'{expected}urlpath=lab/tree/notebooks/beam-distance.ipynb"' in made
        assert 'aria-label="Run on Binder"' in made
    assert edition.launched("<p>prose</p>") == "<p>prose</p>"
