"""What a notebook shows of a cube, put into a notebook as its kernel and a run put it."""

import nbformat
import pytest

from thesis_lib.files import sha256
from thesis_lib.notebook import show
from thesis_lib.runs import postprocess
from thesis_lib.studies import storage
from thesis_lib.studies.effort import Effort


def display_figures(cube):
    """Return the figures that a notebook displays of a cube."""
    shown = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(show, "display", shown.append)
        show.figures(cube)
    return shown


def build_figures_cell(shown):
    cell = nbformat.v4.new_code_cell("notebook.figures(result)")
    for data, about in (one._repr_mimebundle_() for one in shown):
        cell.outputs.append(nbformat.v4.new_output("display_data", data, metadata=about))
    return cell


def add_provenance(page, request, cube, file):
    """Write a cube, and add to a notebook what a run tells of it."""
    storage.write_netcdf(cube, file, compact=True)
    cost = Effort(7.4, 312.0, 1.25)
    postprocess.add_provenance(page, request, cube, sha256(file), cost, in_book=False)
