"""Chapters 3, 4 and 6, and shapes without symmetry: one parameter is varied at a time."""

from typing import Any

from thesis_lib.figure_sets.figure_set import FigureSet, Inputs
from thesis_lib.figure_sets.parametric.parameters import CAMERA_STUDIES, SHAPE_STUDIES, camera_study

CHAPTER_NAMES = {"beam": "ch3", "plate": "ch4", "shape": "shapes", "sound": "ch6"}
FIGURE_NUMBERS = {
    "beam": "thesis_lib.plotting.panels:beam_figure",
    "plate": f"{__package__}.figures:plate_figure",
    "shape": f"{__package__}.figures:plate_figure",
    "sound": f"{__package__}.figures:sound_figure",
}


def plate_input(asked: Any) -> Inputs:
    """Return the input of sound: the plate's study with the same cameras."""
    plate = camera_study(f"plate-{asked.study}", asked.plate_request)
    return {"plate_cube": (SIMULATED_SETS[plate.name], plate)}


def aperture_inputs(asked: Any) -> Inputs:
    """Return the inputs of the aperture's study: also pairs turned by a few degrees."""
    from thesis_lib.figure_sets.parametric.sound_turn import turn_pairs

    return {**plate_input(asked), "turned": (RADIATED_SETS["sound-arrays"], turn_pairs(asked))}


SIMULATED_SETS = {
    name: FigureSet(
        request=request,
        chapter=CHAPTER_NAMES[request.subject],
        module=f"{__package__}.compute",
        figure=FIGURE_NUMBERS[request.subject],
        kept=request.subject == "plate",
        in_pieces=True,
    )
    for name, request in {**CAMERA_STUDIES, **SHAPE_STUDIES}.items()
    if request.subject != "sound"
}
RADIATED_SETS = {
    name: FigureSet(
        request=request,
        chapter=CHAPTER_NAMES["sound"],
        module=f"{__package__}.{'sound_turn' if name == 'sound-aperture' else 'sound'}",
        needs=aperture_inputs if name == "sound-aperture" else plate_input,
        figure=FIGURE_NUMBERS["sound"],
        in_pieces=True,
    )
    for name, request in CAMERA_STUDIES.items()
    if request.subject == "sound"
}
FIGURE_SETS = [*SIMULATED_SETS.values(), *RADIATED_SETS.values()]
