"""Limits and scenes of the planner, and bodies that its cameras look at."""

from dataclasses import replace

import numpy as np

from thesis_lib.facts import setups
from thesis_lib.planning import positions
from thesis_lib.planning.positions import Body, build_body

NONE = {"boxes": np.zeros((0, 3, 2)), "spheres": np.zeros((0, 4)), "sectors": np.zeros((0, 4))}
FREE = positions.Rules(  # which hold nothing back
    (1.0, 1.0), (-np.pi, np.pi), np.radians((5.0, 90.0)), np.pi / 2, 1.0, 0.0, **NONE
)


def scene_of(body, focals=(24 / 36,), peak=1e-3, **changed):
    """A scene with limits other than those that hold nothing back."""
    peaks = (peak,) * len(body.modes)
    return positions.Scene(body, peaks, replace(FREE, **changed), focals, 9 / 16)


def plate(modes=(1, 2)):
    return build_body(setups.thesis_plate((5, 4)), "plate", list(modes))


def body(name, points, normals, shape):
    """A body of one mode, with all its points measured and without an outline."""
    return Body(name, points, normals, shape[None], np.array([10.0]), (1,), np.zeros((3, 0)))
