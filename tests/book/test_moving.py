"""The README's moving picture is made of the explorer, moves, and is small."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from browser import find_browser
from PIL import Image

from thesis_lib.book import moving
from thesis_lib.book.explorer import explorer_html
from thesis_lib.files import project_root


@pytest.mark.slow
@pytest.mark.skipif(find_browser() is None, reason="no Chromium or Chrome on this machine")
def test_a_page_becomes_a_moving_picture(tmp_path: Path) -> None:
    page, picture = tmp_path / "page.html", tmp_path / "moving.gif"
    page.write_text('<meta charset="utf-8">' + explorer_html(compact=True), encoding="utf-8")
    act = (
        "import sys; from pathlib import Path; from thesis_lib.book import moving;"
        "moving.write(*map(Path, sys.argv[1:]))"
    )
    subprocess.run([sys.executable, "-c", act, page, picture], check=True, timeout=120)
    is_moving(picture)


def test_the_published_picture_moves() -> None:
    is_moving(project_root() / moving.PICTURE)


def is_moving(picture: Path) -> None:
    assert picture.stat().st_size <= 400_000
    with Image.open(picture) as drawn:
        assert (drawn.n_frames, drawn.info["loop"]) == (moving.FRAMES, 0)  # type: ignore[attr-defined]
        seen = set()
        for i in range(moving.FRAMES):
            drawn.seek(i)
            seen.add(drawn.convert("RGB").tobytes())
    assert len(seen) > moving.FRAMES / 3
