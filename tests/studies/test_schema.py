"""Variables of cubes are declared in lines, and come with their dimensions and units."""

from __future__ import annotations

import numpy as np
import pytest

from thesis_lib.studies.schema import label_values, parse_variables

TABLE = """
    rate(camera) [Hz] frames per second
    tracks(camera, frame) [px] centres of the markers, where they
        were found
    size() [m s-1 N-1] one number
"""


def test_lines_declare_dimensions_units_and_words():
    found = parse_variables(TABLE)
    assert list(found) == ["rate", "tracks", "size"]
    assert found["tracks"].dims == ("camera", "frame")
    assert found["tracks"].long_name == "centres of the markers, where they were found"
    assert found["size"].dims == ()
    assert found["size"].attributes == {"units": "m s-1 N-1", "long_name": "one number"}


def test_values_come_in_their_order_over_what_they_have_beside():
    made = label_values({"size": 2.0, "rate": [1, 2]}, parse_variables(TABLE), over=["setting"])
    assert list(made) == ["size", "rate"]
    dims, values, about = made["rate"]
    assert dims == ("setting", "camera")
    assert np.array_equal(values, [1, 2])
    assert about["units"] == "Hz"


@pytest.mark.parametrize(
    "line",
    ["rate [Hz] x", "rate(camera) x", "rate(camera) [] x", "rate(c) [1]", "a() [1] x\na() [1] y"],
)
def test_what_declares_nothing_is_named(line):
    with pytest.raises(ValueError, match=r"given .*allowed: name"):
        parse_variables(line)
