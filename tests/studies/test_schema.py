"""Variables of cubes are declared in tables, and come with their dimensions and units."""

import dataclasses
import tomllib

import pytest

from thesis_lib.figure_sets.cube_file import PACKAGE_FOLDER
from thesis_lib.ledger.entries import LEDGER_COLUMNS, Entry
from thesis_lib.studies.schema import VARIABLES_FILE

FILES = sorted(PACKAGE_FOLDER.rglob(VARIABLES_FILE))


def test_every_field_of_the_ledger_is_declared():
    assert list(LEDGER_COLUMNS) == [field.name for field in dataclasses.fields(Entry)]


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.parent.name)
def test_every_row_is_whole_and_every_table_is_read(path):
    code = "".join(one.read_text(encoding="utf-8") for one in path.parent.glob("*.py"))
    for table, rows in tomllib.loads(path.read_text(encoding="utf-8")).items():
        assert f'read_variables(__file__, "{table}")' in code
        for name, (dims, units, words) in rows.items():
            assert all(map(str.isidentifier, [name, *filter(None, dims.split(", "))])), name
            assert units.strip(), name
            assert words.strip(), name
