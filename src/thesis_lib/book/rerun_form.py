"""The form of the rerun page: every parameter of every figure set, and the commands they make."""

from __future__ import annotations

from thesis_lib.notebook.form import form_data
from thesis_lib.web.fragment import static_html
from thesis_lib.web.viewer import FORM_CSS, form_esm

WITHOUT = "This form needs JavaScript; `thesis list NAME` tells the same of a figure set."


def page() -> str:
    """The form as a piece of HTML that needs no kernel, server or network."""
    state = {"form": form_data(), "page": True}
    return static_html(form_esm("beam", "plate"), FORM_CSS, state, WITHOUT)
