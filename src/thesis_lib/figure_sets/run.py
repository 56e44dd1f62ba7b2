"""The cube of a request, whatever figure set it is of."""

from __future__ import annotations

import warnings
from functools import partial

import xarray as xr

from thesis_lib.figure_sets.claims.parameters import Claims
from thesis_lib.figure_sets.design_law import compute as design_study
from thesis_lib.figure_sets.design_law.parameters import DesignLaw
from thesis_lib.figure_sets.experiment.parameters import Experiment
from thesis_lib.figure_sets.lab_layout.parameters import Layouts
from thesis_lib.figure_sets.lab_modes.parameters import LabModes
from thesis_lib.figure_sets.lab_plate.parameters import LabPlate
from thesis_lib.figure_sets.optics import compute as optics_study
from thesis_lib.figure_sets.optics.parameters import Cameras
from thesis_lib.figure_sets.parametric import compute as studies
from thesis_lib.figure_sets.parametric import sound
from thesis_lib.figure_sets.parametric.parameters import CameraStudy, camera_study
from thesis_lib.figure_sets.planner import compute as planner_study
from thesis_lib.figure_sets.planner.parameters import Planner
from thesis_lib.studies import effort
from thesis_lib.studies.attributes import with_provenance
from thesis_lib.studies.cache import cached
from thesis_lib.studies.request import Study


def computed(request: Study) -> xr.Dataset:
    """The cube of a request, without provenance; what it rests on comes from the cache."""
    from thesis_lib.figure_sets.claims.compute import ledger_of

    if isinstance(request, Experiment | Layouts | LabModes | LabPlate):
        return _of_recordings(request)
    if isinstance(request, Claims):
        return ledger_of(request)
    if isinstance(request, Cameras):
        return optics_study.run(request)
    if isinstance(request, DesignLaw):
        return design_study.run(request)
    if isinstance(request, Planner):
        return planner_study.run(request)
    assert isinstance(request, CameraStudy)
    return camera_cube(request)


def _of_recordings(request: Study) -> xr.Dataset:
    """A figure set of chapter 5, whose modules need video and picture libraries."""
    from thesis_lib.figure_sets import recorded
    from thesis_lib.figure_sets.experiment import compute as study
    from thesis_lib.figure_sets.lab_layout import compute as lab_layout_study
    from thesis_lib.figure_sets.lab_modes import compute as lab_modes_study
    from thesis_lib.figure_sets.lab_plate import compute as lab_plate_study

    data = recorded.measured(recorded.laboratory(request))
    if isinstance(request, Experiment):
        return study.run(request, data)
    if isinstance(request, Layouts):
        return lab_layout_study.run(request, data)
    if isinstance(request, LabModes):
        return lab_modes_study.run(request, data)
    assert isinstance(request, LabPlate)
    return lab_plate_study.run(request, data)


def camera_cube(request: CameraStudy, scheduler: str = "") -> xr.Dataset:
    """The cube of a camera study or, from the plate's deflections, of a sound study.

    What is too large to be held, and the plate's cubes, which sound needs, are kept in a cache.
    """
    if request.subject == "plate":
        return cached(request, partial(studies.outline, scheduler=scheduler))
    seconds = effort.stopwatch()
    if request.subject == "sound":
        plate = camera_study(request.name.replace("sound", "plate"), request.plate_request)  # type: ignore[attr-defined]
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "k times the size of a piston")  # the table says so
            made = sound.outline(request, camera_cube(plate, scheduler), scheduler)
    else:
        made = studies.outline(request, scheduler)
    if not made.is_held:
        return cached(request, lambda _: made)
    cube = made.in_memory()
    return with_provenance(cube, request, seconds())
