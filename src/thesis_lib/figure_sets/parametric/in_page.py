"""Data with which a page computes a study of chapter 3 or 4, as plain JSON values.

The model is in ``web/assets/physics.js``; structures, camera setups, and the published errors
that are compared with a new run come from here.
"""

from collections.abc import Iterable
from typing import Any

import numpy as np

from thesis_lib.facts import setups
from thesis_lib.figure_sets.parametric.camera_study import CAMERA_CONDITIONS, COINCIDENT_TEXT
from thesis_lib.figure_sets.parametric.figure_set import CAMERA_STUDIES, camera_study
from thesis_lib.plotting.selection import LENS_FIELDS
from thesis_lib.plotting.style import CYCLE_COLORS, DIVERGING_COLORS
from thesis_lib.studies import cubes, fields, request
from thesis_lib.vibration.structure import Beam, Plate, Structure, cantilever_roots, peak_deflection

COMPUTED_SETS = tuple(one for one in CAMERA_STUDIES if not one.startswith("sound"))
"""Figure sets that a page computes."""
MAX_MODE = 30  # the highest mode that a request may have


def structure_model(structure: Structure, modes: int) -> dict[str, Any]:
    """Return the data of a structure's markers, mode shapes and frequencies, up to a mode."""
    length, width = structure.extent
    hertz = structure.angular_frequencies(modes) / (2 * np.pi)
    common = {"length": length, "width": width, "hertz": hertz.tolist()}
    if isinstance(structure, Beam):
        row = {
            "count": structure.n_markers,
            "spacing": structure.marker_spacing,
            "first": structure.first_marker,
        }
        # As text: widgets transfer numbers with 6 digits, but these need all.
        roots = [repr(float(root)) for root in cantilever_roots(modes)]
        return {"kind": "beam", **common, "row": row, "roots": roots}
    assert isinstance(structure, Plate)
    indices = structure.mode_indices(modes).tolist()
    return {"kind": "plate", **common, "grid": list(structure.grid), "indices": indices}


def page_facts(names: Iterable[str] = COMPUTED_SETS) -> dict[str, Any]:
    """Return the data that figure sets of :data:`COMPUTED_SETS` need besides their parameters.

    Returns
    -------
    dict
        ``structures`` by :func:`structure_model`, with ``peaks``, the deflection of each mode by a
        force of 1 N in m; the cases' ``pairs``, ``order``, ``centres`` and ``opposite``;
        ``conditions``, messages about inconsistent values; colours and ``lens`` fields for a
        viewer; and ``sets``: varied parameter, titles of cases, and ``published`` rows of case,
        value, order of pairs, mode, nominal mean error, median, 5 and 95 % in percent.
    """
    studies = {name: camera_study(name) for name in names}
    structures = {one.subject: one.structure for one in studies.values()}
    return {
        "structures": {
            subject: structure_model(one, MAX_MODE)
            | {"peaks": [repr(peak_deflection(one, mode + 1)) for mode in range(MAX_MODE)]}
            for subject, one in structures.items()
        },
        "pairs": setups.camera_pairs(),
        "order": setups.assumed_values("beam")["pair_order"],
        "centres": setups.CENTRES_DEG,
        "opposite": {case: list(pair) for case, pair in setups.OPPOSITE_DEG.items()},
        "colors": list(CYCLE_COLORS),
        "colormap": list(DIVERGING_COLORS),
        "lens": list(LENS_FIELDS),
        "conditions": CAMERA_CONDITIONS
        | {"reach": request.distance_limit("{}"), "places": COINCIDENT_TEXT},
        "sets": {
            name: {
                "subject": one.subject,
                "study": one.study,
                "parameter": {
                    "name": one.varied,
                    "label": one.varied_label,
                    "unit": fields.unit_of_field(one.varied),
                },
                "titles": {
                    case: setups.case_title(one.subject, one.study, case)
                    for case in dict.fromkeys(setting.case for setting in one.settings())
                },
                "published": _published_errors(name),
            }
            for name, one in studies.items()
        },
    }


def _published_errors(name: str) -> list[list[Any]]:
    table = cubes.read_published(name)
    if table is None:
        return []
    columns = ["case", "value", "pair_order", "mode", *cubes.STATISTIC_NAMES]
    return list(table.loc[table["error"] == "mean_error", columns].values.tolist())
