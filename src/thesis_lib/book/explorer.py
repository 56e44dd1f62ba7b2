"""Pieces of pages that compute in the browser: explorer, rerun form and small experiments.

The explorer shows a beam or plate with cameras to drag around it, and the resulting accuracy. Its
forward model runs in the page itself (``assets/physics.js``), without a kernel, and so do the
experiments on the law of rounding. This module adds the data: the structures' constants, the
thesis's setups, their published errors, and the claimed values.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

from thesis_lib.facts import setups
from thesis_lib.facts.claims import Claim, claims_of
from thesis_lib.figure_sets.parametric.camera_study import CameraStudy
from thesis_lib.figure_sets.parametric.figure_set import CAMERA_STUDIES, camera_study
from thesis_lib.figure_sets.parametric.in_page import structure_model
from thesis_lib.notebook.show import form_data
from thesis_lib.plotting.style import CYCLE_COLORS, DIVERGING_COLORS
from thesis_lib.studies import cubes
from thesis_lib.web.html import VIEWER_CSS, join_modules, read_asset, static_html
from thesis_lib.web.viewer import FORM_CSS

EXPLORER_MODES = (1, 2, 3)
ERROR_NAMES = ("mean_error", "max_point_error")
EXPLORER_FALLBACK = (
    "The explorer needs JavaScript; `thesis run beam-arrays` measures layouts of your own."
)


def explorer_data() -> dict[str, Any]:
    """Collect what the page needs in addition to its model, as plain JSON values.

    ``structures`` are beam and plate with their constants, the interpretation that the published
    errors hold for, and ``setups``, the settings of the thesis's tables. A setup has ``errors`` and
    ``stated``, each by the error's name with one entry per mode: the published
    ``[nominal run, median, 5 %, 95 %]`` in % or None, and the text of the claims or "".
    """
    structures = {}
    for subject in ("beam", "plate"):
        studies = [one for one in map(camera_study, CAMERA_STUDIES) if one.subject == subject]
        arrays = next(one for one in studies if one.study == "arrays")
        structures[subject] = {
            **structure_model(arrays.structure, max(EXPLORER_MODES)),
            "reading": {"f": arrays.focal_length_mm, "a": arrays.amplitude_mm, "r": arrays.rest},
            "setups": [one for study in studies for one in _list_setups(study)],
        }
    return {
        "colors": list(CYCLE_COLORS),
        "colormap": list(DIVERGING_COLORS[::4]),
        "sensor_width_mm": camera_study("beam-arrays").sensor_width_mm,
        "structures": structures,
    }


def _list_setups(study: CameraStudy) -> list[dict[str, Any]]:
    published, claims = cubes.read_published(study.name), claims_of(study.name)
    found: dict[tuple[object, ...], list[float]] = {}
    if published is not None:
        numbers = published.set_index([*cubes.ROW_KEYS, "error"])[cubes.STATISTIC_NAMES]
        found = dict(zip(numbers.index, numbers.values.tolist(), strict=True))

    def errors(setting: setups.Setting, error: str) -> list[list[float] | None]:
        key = (setting.case, setting.value, setting.label, setting.pair_order)
        return [found.get((*key, mode, error)) for mode in EXPLORER_MODES]

    return [
        {
            "id": f"{setting.case}-{setting.value:g}",
            "case": setting.case,
            "title": setups.case_title(study.subject, study.study, setting.case),
            "label": setting.label,
            "d": setting.distance_mm,
            "w": list(setting.resolution_px),
            "c": [list(direction) for direction in setting.directions_deg],
            "errors": {error: errors(setting, error) for error in ERROR_NAMES},
            "stated": {
                error: [_quote_claims(claims, setting, mode, error) for mode in EXPLORER_MODES]
                for error in ERROR_NAMES
            },
        }
        for setting in study.settings()
    ]


def _quote_claims(claims: tuple[Claim, ...], setting: setups.Setting, mode: int, error: str) -> str:
    """Return the claimed value of an error, such as ``10 % (figure 3.4 d)``."""
    return "; ".join(
        claim.stated
        + (f" but for {claim.excepted}" if claim.excepted else "")
        + ("" if claim.values else " for all of the case")
        + f" (figure {claim.figure} {claim.panel})"
        for claim in claims
        if (claim.mode, claim.quantity) == (mode, error)
        and claim.applies_to(setting.case, setting.value, setting.pair_order)
    )


def explorer_html(address: str = "", compact: bool = False) -> str:
    """Write the explorer as a self-contained HTML fragment for a page without a kernel.

    `address` selects what to show first, unless the query of the page's URL does:
    ``s`` beam or plate, ``m`` mode, and ``t`` a setup of the thesis such as ``4a-6`` (its case and
    value) or else ``w`` width in px (or ``400x300``), ``f`` focal length, ``d`` distance and ``a``
    amplitude in mm, ``r`` rest position ``rebuilt`` or ``known``, and ``c`` azimuth and elevation
    of the cameras in degrees: ``s=beam&m=3&w=320&f=24&d=500&c=7,15;-7,15``. Unknown or invalid
    values are ignored. `compact` shows the view, the shapes and the main controls, with a link to
    the page ``explorer.html``, which has all controls.
    """
    traits = {"data": explorer_data(), "address": address, "compact": compact}
    script, style = join_modules("explorer"), VIEWER_CSS + read_asset("explorer.css")
    return static_html(script, style, traits, EXPLORER_FALLBACK, prints=True)


EXPERIMENT_FALLBACK = "This experiment needs JavaScript; the text below describes what it shows."
FORM_FALLBACK = "This form needs JavaScript; `thesis list NAME` lists the same of a figure set."
DEMO_NAMES = ("rounding_marker", "rounding_point", "rounding_beam")


def write_experiment(name: str) -> str:
    """Write one of :data:`DEMO_NAMES` as a self-contained HTML fragment."""
    traits: dict[str, Any] = {"experiment": name}
    if name == "rounding_beam":
        data = explorer_data()
        beam = {k: v for k, v in data["structures"]["beam"].items() if k != "setups"}
        traits["data"] = {"structure": beam, "sensorWidth": data["sensor_width_mm"]}
    css = VIEWER_CSS + read_asset("rounding.css")
    return static_html(join_modules("rounding"), css, traits, EXPERIMENT_FALLBACK, prints=True)


def rerun_form_html() -> str:
    """Write the form with every parameter of every figure set as a self-contained fragment."""
    state = {"form": form_data(), "page": True}
    return static_html(join_modules("rerun", "beam", "plate"), FORM_CSS, state, FORM_FALLBACK)


DEMO_PAGES: dict[str, Callable[[], str]] = {
    "explorer": explorer_html,
    "explorer-home": partial(explorer_html, "s=beam&m=3&t=4a-8", compact=True),
    "rerun-form": rerun_form_html,
    **{name.replace("_", "-"): partial(write_experiment, name) for name in DEMO_NAMES},
}
"""Pieces of pages that depend only on the library and the published results."""
