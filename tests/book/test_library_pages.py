"""The library in the book: a page for each room, in the order in which rooms import."""

import re
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[2]
INDEX = (ROOT / "book" / "api.md").read_text(encoding="utf-8")
ROWS = re.findall(
    r"^\| (\d+) \| (?:\[(\w+)\]\(api/([\w-]+)\.rst\)|`(\w+)`) \|", INDEX, re.MULTILINE
)


def test_rooms_stand_in_the_order_in_which_they_import() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    layers = project["tool"]["importlinter"]["contracts"][0]["layers"]
    rooms = [{r for r in layer.split(" | ") if (ROOT / "src/thesis_lib" / r).is_dir()}
             for layer in reversed(layers)]  # fmt: skip
    told: dict[str, set[str]] = {}
    for number, linked, _, plain in ROWS:
        told.setdefault(number, set()).add(linked or plain)
    assert list(told.values()) == [layer for layer in rooms if layer]
