"""What the ledger is judged by, with few trials and, for sound, few points."""

from functools import cache

from laboratory_scene import recordings
from layout_scene import layouts

from thesis_lib import claims, cubes, ledger, ledger_runs, sound, studies, trends
from thesis_lib.experiment import lab_layout_study, study
from thesis_lib.ledger_requests import OwnRuns
from thesis_lib.parameters import STUDIES, validate

TRIALS = 12


@cache
def sets():
    """Figure sets that claims or trends speak of, plates before their sounds."""
    named = {claim.figure_set for claim in claims.read_claims()}
    named |= {name for trend in trends.read_trends() for name in trend.source}
    return [name for name in STUDIES if name in named]


@cache
def cube_of(name):
    """The cube of a figure set."""
    request = validate(name, {"trials": TRIALS})
    if request.subject == "experiment":
        cube = study.run(request, recordings(request.recordings, sigma=0.02))
    elif request.subject == "lab":
        cube = lab_layout_study.run(request, layouts(request, sigma=0.02))
    elif request.subject == "sound":
        request = validate(name, {"trials": TRIALS, "plane_shape": [9, 7]})
        cube = sound.run(request, cube_of(name.replace("sound", "plate")))
    else:
        cube = studies.run(request)
    return cubes.with_provenance(cube, request, 0.0)


@cache
def own_cube():
    """The ledger's own runs."""
    return ledger_runs.run(OwnRuns(trials=TRIALS))


@cache
def own():
    """Their series."""
    return ledger_runs.read_own(own_cube())


def entries(own_series=None, **instead):
    """The ledger; `instead` holds other cubes, or reasons, by figure set with underscores."""

    def open_cube(request):
        return instead.get(request.name.replace("-", "_"), cube_of(request.name))

    return ledger.entries(open_cube, own() if own_series is None else own_series)
