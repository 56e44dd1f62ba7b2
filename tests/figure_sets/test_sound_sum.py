"""The sum of pistons against Rayleigh's integral by other sums, beside the cameras' errors."""

from dataclasses import replace

import numpy as np
import pytest

from thesis_lib.acoustics.planes import plane_operator, plate_pistons
from thesis_lib.acoustics.radiation import rayleigh_pressure
from thesis_lib.facts import setups
from thesis_lib.figure_sets.cube_file import cube_of
from thesis_lib.figure_sets.registry import validate_request
from thesis_lib.vibration.structure import resonance_frequency

HEARD = [(1, "XZ"), (1, "YZ"), (2, "XZ"), (3, "YZ")]
FEW = {"trials": 0, "plane_shape": [31, 21]}


@pytest.fixture(scope="module")
def cube():
    return cube_of(validate_request("sound-resolution", FEW))


def finer(mode, plane):
    """Where sums of ever smaller pistons lead to, of which each is off by the square of theirs."""
    plate, fields = setups.thesis_plate(), []
    for grid in ((60, 40), (90, 60)):
        many = replace(plate, grid=grid)
        moving = many.mode_shapes([mode], many.markers)[0] / plate.shape_peak(mode)
        fields.append(
            rayleigh_pressure(
                plate_pistons(many), moving, plane.points, resonance_frequency(plate, mode)
            )
        )
    return fields[1] + (fields[1] - fields[0]) / (1.5**2 - 1)


@pytest.mark.parametrize(("mode", "name"), [HEARD[0], HEARD[3]])
def test_error_of_the_sum_is_that_against_ever_finer_ones(conforms, cube, mode, name):
    study, plate = validate_request("sound-resolution", FEW), setups.thesis_plate()
    (plane,) = (one for one in study.planes if one.name == name)
    moving = plate.mode_shapes([mode], plate.markers)[0] / plate.shape_peak(mode)
    few = plane_operator(plate, plane, resonance_frequency(plate, mode)).field(moving)
    off = 100 * np.abs(few - finer(mode, plane)) / np.max(np.abs(few))
    own = cube.sel(mode=mode, plane=name)
    conforms.independent(own["sum_error"], np.sqrt(np.mean(off**2)), rtol=0.01)
    conforms.independent(own["sum_error_largest"], np.max(off), rtol=0.01)


def test_nodal_planes_and_planes_too_near_have_none(cube):
    for name in ("sum_error", "sum_error_largest"):
        there = cube[name].notnull()
        heard = [(m, p) for m in (1, 2, 3) for p in ("XZ", "YZ") if there.sel(mode=m, plane=p)]
        assert heard == HEARD
    near = cube_of(
        validate_request(
            "sound-distance", FEW | {"plane_bottom_mm": 2.0, "modes": [1], "distances_mm": [750.0]}
        )
    )
    assert np.all(np.isnan(near["sum_error"]))
    assert np.all(np.isfinite(near["predicted_error"]))
