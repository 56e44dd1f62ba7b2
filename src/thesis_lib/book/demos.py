"""The small experiments of the page on the law of rounding, which compute in the page itself.

They use the explorer's model (``assets/explorer_model.js``), which the tests hold against the
library.
"""

from __future__ import annotations

from thesis_lib.book.explorer import explorer_data
from thesis_lib.web.fragment import VIEWER_CSS, asset, joined, static_html

WITHOUT = "This experiment needs JavaScript; the text below tells what it shows."
NAMES = ("rounding_marker", "rounding_point", "rounding_beam")


def html(name: str) -> str:
    """Write one of :data:`NAMES` as a self-contained HTML fragment."""
    data = explorer_data()
    state = {"structure": data["structures"]["beam"], "sensorWidth": data["sensor_width_mm"]}
    state["structure"] = {k: v for k, v in state["structure"].items() if k != "setups"}
    traits = {"data": state} if name == "rounding_beam" else {}
    css = VIEWER_CSS + asset("demo.css")
    return static_html(joined(name), css, traits, WITHOUT, prints=True)
