"""Variables of cubes are declared in tables, and come with their dimensions and units."""

import dataclasses
import tomllib

import numpy as np
import pytest

from thesis_lib.figure_sets.cube_file import PACKAGE_FOLDER
from thesis_lib.ledger.entries import LEDGER_COLUMNS, Entry
from thesis_lib.studies.schema import VARIABLES_FILE, label_values, read_variables

FILES = sorted(PACKAGE_FOLDER.rglob(VARIABLES_FILE))
TABLE = """
[first]
rate = ["camera", "Hz", "frames per second"]
tracks = ["camera, frame", "px", "centres of the markers"]
size = ["", "m s-1 N-1", "one number"]
"""


@pytest.fixture
def module(tmp_path):
    """A module beside which variables are declared."""
    (tmp_path / VARIABLES_FILE).write_text(TABLE, encoding="utf-8")
    return str(tmp_path / "compute.py")


def test_rows_declare_dimensions_units_and_words(module):
    found = read_variables(module, "first")
    assert list(found) == ["rate", "tracks", "size"]
    assert found["tracks"].dims == ("camera", "frame")
    assert found["size"].dims == ()
    assert found["size"].attributes == {"units": "m s-1 N-1", "long_name": "one number"}


def test_every_field_of_the_ledger_is_declared():
    assert list(LEDGER_COLUMNS) == [field.name for field in dataclasses.fields(Entry)]


def test_values_come_in_their_order_over_what_they_have_beside(module):
    made = label_values({"size": 2.0, "rate": [1, 2]}, read_variables(module, "first"), ["setting"])
    assert list(made) == ["size", "rate"]
    dims, values, about = made["rate"]
    assert dims == ("setting", "camera")
    assert np.array_equal(values, [1, 2])
    assert about["units"] == "Hz"


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.parent.name)
def test_every_row_is_whole_and_every_table_is_read(path):
    code = "".join(one.read_text(encoding="utf-8") for one in path.parent.glob("*.py"))
    for table, rows in tomllib.loads(path.read_text(encoding="utf-8")).items():
        assert f'read_variables(__file__, "{table}")' in code
        for name, (dims, units, words) in rows.items():
            assert all(map(str.isidentifier, [name, *filter(None, dims.split(", "))])), name
            assert units.strip(), name
            assert words.strip(), name
