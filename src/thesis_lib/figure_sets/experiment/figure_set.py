"""Chapter 5: the beam, filmed by four cameras."""

from thesis_lib.figure_sets.experiment.parameters import (
    Experiment,
    ExperimentCameras,
    ExperimentResolution,
)
from thesis_lib.figure_sets.figure_set import FigureSet, Inputs, Product

RECORDINGS = Product(module=f"{__package__}.recordings", recorded=True)


def needs(asked: Experiment) -> Inputs:
    """The recordings, measured once for both."""
    return {"data": (RECORDINGS, asked.recordings)}


FIGURE_SETS = [
    FigureSet(
        request=request,
        chapter="ch5",
        module=f"{__package__}.compute",
        needs=needs,
        figure="thesis_lib.plotting.curves:beam_figure",
    )
    for request in (ExperimentResolution, ExperimentCameras)
]
