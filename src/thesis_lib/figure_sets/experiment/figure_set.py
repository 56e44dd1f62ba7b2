"""Chapter 5: the beam, rendered for four cameras, measured once for both."""

from thesis_lib.figure_sets.experiment.parameters import ExperimentCameras, ExperimentResolution
from thesis_lib.figure_sets.figure_set import filmed

FIGURE_SETS = [
    filmed(
        __package__,
        request=request,
        chapter="ch5",
        figure="thesis_lib.plotting.curves:beam_figure",
    )
    for request in (ExperimentResolution, ExperimentCameras)
]
