"""The library in the book: a page for each room, in the order in which rooms import."""

import pkgutil
import re
import tomllib
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parents[2]
INDEX = (ROOT / "book" / "api.md").read_text(encoding="utf-8")
ROWS = re.findall(
    r"^\| (\d+) \| (?:\[(\w+)\]\(api/([\w-]+)\.rst\)|`(\w+)`) \|", INDEX, re.MULTILINE
)
PAGES = {room: ROOT / "book" / "api" / f"{page}.rst" for _, room, page, _ in ROWS if room}
DIRECTIVE = re.compile(r"^\.\. auto\w+:: ([\w.]+)(?:\(\))?\n(?:   :members:(.*)\n)?", re.MULTILINE)
RENDERED = ROOT / "build" / "html" / "api"


def test_rooms_stand_in_the_order_in_which_they_import() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    layers = project["tool"]["importlinter"]["contracts"][0]["layers"]
    rooms = [{r for r in layer.split(" | ") if (ROOT / "src/thesis_lib" / r).is_dir()}
             for layer in reversed(layers)]  # fmt: skip
    told: dict[str, set[str]] = {}
    for number, linked, _, plain in ROWS:
        told.setdefault(number, set()).add(linked or plain)
    assert list(told.values()) == [layer for layer in rooms if layer]


def test_every_page_is_in_the_book() -> None:
    toc = yaml.safe_load((ROOT / "book" / "_toc.yml").read_text(encoding="utf-8"))
    (api,) = (c for part in toc["parts"] for c in part["chapters"] if c["file"] == "api")
    assert {one["file"] for one in api["sections"]} == {f"api/{p.stem}" for p in PAGES.values()}
    assert {*PAGES.values()} == {*(ROOT / "book" / "api").iterdir()}


@pytest.mark.parametrize("page", sorted({*PAGES.values()}), ids=lambda page: page.stem)
def test_what_a_page_shows_is_in_its_rooms(page: Path) -> None:
    for name, members in DIRECTIVE.findall(page.read_text(encoding="utf-8")):
        assert PAGES[name.split(".")[1]] == page
        shown = pkgutil.resolve_name(name)
        assert [one for one in re.findall(r"\w+", members) if not hasattr(shown, one)] == []
