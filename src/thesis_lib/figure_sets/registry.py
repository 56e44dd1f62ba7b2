"""All figure sets by name, their chapters, and requests by name."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from thesis_lib.figure_sets.claims.parameters import Claims
from thesis_lib.figure_sets.design_law.parameters import DesignLaw
from thesis_lib.figure_sets.experiment.parameters import ExperimentCameras, ExperimentResolution
from thesis_lib.figure_sets.lab_layout.parameters import LabElevation, LabLayout
from thesis_lib.figure_sets.lab_modes.parameters import LabModes
from thesis_lib.figure_sets.lab_plate.parameters import LabPlate
from thesis_lib.figure_sets.optics.parameters import Cameras
from thesis_lib.figure_sets.parametric.parameters import CAMERA_STUDIES, OfL, Perforated, figure_set
from thesis_lib.figure_sets.parametric.shapes import ShapeMarkers
from thesis_lib.figure_sets.planner.parameters import Planner
from thesis_lib.studies.request import ParameterError, Study, suggestion, validated
from thesis_lib.text import listed, one_line

_SUBJECTS = {"ch2": "cameras", "ch3": "beam", "ch4": "plate", "ch5": "experiment", "lab": "lab",
             "ch6": "sound", "beyond": "design", "shapes": "shape", "": "claims"}  # fmt: skip
_ALL: list[type[Study]] = [
    Cameras, *CAMERA_STUDIES.values(), ExperimentResolution, ExperimentCameras,
    LabElevation, LabLayout, LabModes, LabPlate, DesignLaw, Planner,
    *(figure_set("shape", kind, ShapeMarkers) for kind in (OfL, Perforated)), Claims,
]  # fmt: skip
STUDIES: dict[str, type[Study]] = {
    study.name: study
    for subject in _SUBJECTS.values()
    for study in _ALL
    if study.subject == subject
}
CHAPTERS = {
    chapter: [name for name, study in STUDIES.items() if study.subject == subject]
    for chapter, subject in _SUBJECTS.items()
    if chapter
}


def chapter_title(name: str) -> str:
    """What a name of :data:`CHAPTERS` stands for.

    Examples
    --------
    >>> chapter_title("ch3"), chapter_title("lab")
    ('Chapter 3', 'Beyond chapter 5')
    """
    titles = {
        "lab": "Beyond chapter 5",
        "beyond": "Beyond the thesis",
        "shapes": "Shapes without symmetry",
    }
    return titles.get(name, f"Chapter {name.removeprefix('ch')}")


def validate(name: str, values: Mapping[str, Any]) -> Study:
    """Parameters of a figure set from plain values.

    Raises
    ------
    ParameterError
        In one line: the set and field, what was given, what is allowed and in which unit.
    """
    if name not in STUDIES:
        raise ParameterError(
            f"{one_line(name)}: no such figure set{suggestion(name, [*STUDIES, *CHAPTERS])}; "
            f"{listed([*STUDIES, *CHAPTERS], 'thesis list')}"
        )
    return validated(STUDIES[name], values)
