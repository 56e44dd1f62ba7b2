"""Small cubes of figure sets, computed once."""

from scenes import ledger
from scenes.shared import shared

from thesis_lib.figure_sets.registry import FIGURE_SETS, validate_request
from thesis_lib.studies.schema import with_provenance

REQUESTS = {
    "cameras": {},
    "design-law": {"trials": 60, "counts": [2, 3, 8, 24], "frame_rates_hz": [60, 480]},
    "planner": {
        "counts": [2, 4], "resolutions_px": [[320, 180]], "starts": 0, "step_deg": 30, "trials": 5,
        "target_percent": 40,
    },
}  # fmt: skip
OF_LEDGER = ("beam-arrays", "plate-aperture", "sound-distance", "experiment-cameras")


@shared
def small_cube(name, **values):
    """The cube of a figure set with few trials, and other values if they are given."""
    if name in OF_LEDGER:
        return ledger.cube_of(name)
    request = validate_request(name, REQUESTS[name] | values)
    return with_provenance(FIGURE_SETS[name].compute(request), request, 0.0)
