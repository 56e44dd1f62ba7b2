"""What the ledger is judged by, with few trials and, for sound, few points."""

from functools import cache

from scenes.shared import shared

from thesis_lib.facts import claims
from thesis_lib.figure_sets import cube_file
from thesis_lib.figure_sets.claims import compute
from thesis_lib.figure_sets.claims.compute import judge_claims
from thesis_lib.figure_sets.claims.figure_set import Claims
from thesis_lib.figure_sets.parametric import compute as studies, sound
from thesis_lib.figure_sets.registry import FIGURE_SETS, STUDIES, validate_request
from thesis_lib.studies.schema import with_provenance

TRIALS = 12


@cache
def sets():
    """Figure sets that claims or trends speak of, plates before their sounds."""
    named = {claim.figure_set for claim in claims.read_claims()}
    named |= {name for trend in claims.read_trends() for name in trend.source}
    return [name for name in STUDIES if name in named]


@shared
def cube_of(name):
    if STUDIES[name].subject in ("experiment", "lab"):
        return cube_file.cube_of(STUDIES[name]())  # from the recordings that are stored
    few = {"plane_shape": [9, 7]} if STUDIES[name].subject == "sound" else {}
    request = validate_request(name, {"trials": TRIALS, **few})
    if few:
        cube = sound.run(request, cube_of(name.replace("sound", "plate")))
    else:
        cube = studies.run(request)
    return with_provenance(cube, request, 0.0, cube_file.code_digest(FIGURE_SETS[name]))


@shared
def own_cube():
    """The ledger's own runs."""
    return compute.run_layouts(Claims(trials=TRIALS))


@shared
def own():
    """Their series."""
    return compute.read_own(own_cube())


def entries(own_series=None, **instead):
    """The ledger; `instead` holds other cubes, or reasons, by figure set with underscores."""

    def open_cube(request):
        return instead.get(request.name.replace("-", "_"), cube_of(request.name))

    return judge_claims(open_cube, own() if own_series is None else own_series)
