"""Pieces of pages that compute in the browser: explorer, rerun form and small experiments.

The experiments of the page on the law of rounding use the explorer's model
(``assets/physics.js``), which the tests hold against the library.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

from thesis_lib.book.explorer import explorer_data, explorer_html
from thesis_lib.files import whole_text
from thesis_lib.notebook.form import form_data
from thesis_lib.web.fragment import VIEWER_CSS, join_modules, read_asset, static_html
from thesis_lib.web.viewer import FORM_CSS, form_esm

NO_SCRIPT_TEXT = "This experiment needs JavaScript; the text below describes what it shows."
FORM_WITHOUT = "This form needs JavaScript; `thesis list NAME` lists the same of a figure set."
DEMO_NAMES = ("rounding_marker", "rounding_point", "rounding_beam")


def write_experiment(name: str) -> str:
    """Write one of :data:`DEMO_NAMES` as a self-contained HTML fragment."""
    data = explorer_data()
    state = {"structure": data["structures"]["beam"], "sensorWidth": data["sensor_width_mm"]}
    state["structure"] = {k: v for k, v in state["structure"].items() if k != "setups"}
    traits = {"experiment": name} | ({"data": state} if name == "rounding_beam" else {})
    css = VIEWER_CSS + read_asset("rounding.css")
    return static_html(join_modules("rounding"), css, traits, NO_SCRIPT_TEXT, prints=True)


def rerun_form_html() -> str:
    """Write the form with every parameter of every figure set as a self-contained fragment."""
    state = {"form": form_data(), "page": True}
    return static_html(form_esm("beam", "plate"), FORM_CSS, state, FORM_WITHOUT)


DEMO_PAGES: dict[str, Callable[[], str]] = {
    "explorer": explorer_html,
    "explorer-home": partial(explorer_html, "s=beam&m=3&t=4a-8", compact=True),
    "rerun-form": rerun_form_html,
    **{name.replace("_", "-"): partial(write_experiment, name) for name in DEMO_NAMES},
}
"""Pieces of pages that depend on the library, and what is published, alone."""


def write_demos(folder: Path) -> None:
    """Write all of :data:`DEMO_PAGES` into a folder."""
    for name, page in DEMO_PAGES.items():
        whole_text(folder / f"{name}.html", page())
