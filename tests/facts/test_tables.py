"""The contract of the tables of facts: each fault of a row is refused with its line and field."""

import csv

import pytest

from thesis_lib.facts import claims, setups
from thesis_lib.facts.claims import read_numbers

READ = {
    "claims.csv": claims.read_claims,
    "trends.csv": claims.read_trends,
    "numbers.csv": read_numbers,
    "reasons.csv": claims.read_reasons,
    "index.csv": claims.read_index,
}
BAD = {  # texts that a field does not take
    "claims.csv": {
        "id": [""], "figure_set": [""], "section": [""], "mode": ["two", "1.0", ""],
        "quantity": ["error", ""], "value": ["every", "500;", "nan", "500;inf"],
        "relation": ["above", ""], "low": ["", "ten", "nan"], "high": ["inf", "10 %"],
        "excepted": ["one", ""],
    },
    "trends.csv": {
        "id": [""], "chapter": ["three", ""], "section": [""], "modes": ["", "1;two", "1.5"],
        "quantities": [""], "words": [""], "source": [""],
        "test": ["", "drops", "fall", "falls 3", "below x", "below 40 soon", "peaks"],
    },
    "numbers.csv": {
        "id": [""], "chapter": ["8", "three"], "place": [""], "words": [""],
        "stated": ["", "some", "nan", "1e999999", "1/0", "1/2/3", "1.5×2"], "value_of": ["top"],
    },
    "reasons.csv": {"id": [""], "reason": ["No stop", ""], "page": ["not a page", ""]},
    "index.csv": {
        "item": ["fig 3.4", "figure 3.4c", "equation 3.20 a", ""], "what": ["", " "],
        "page": ["beam.md", "beam#", "the beam"],
        "function": ["structures.beam", "thesis_lib", "thesis_lib.a;thesis_lib.b"],
        "cube": ["mean_error", "beam-distance:mean_error", "beam-distance: "],
        "test": ["test_x.py::test_x", "tests/test_x.py", "tests/test_x.py::test_x; "],
        "reason": [" "], "errata": ["b2", "errata#errata-b"],
    },
}  # fmt: skip


@pytest.fixture
def refused(tmp_path, monkeypatch):
    """Return the refusal of a table with some header and rows."""
    monkeypatch.setattr(claims, "data_folder", lambda: tmp_path)

    def refuse(name, *rows):
        with (tmp_path / name).open("w", encoding="utf-8", newline="") as file:
            csv.writer(file).writerows(rows)
        with pytest.raises(ValueError, match=name) as refusal:
            list(READ[name]())
        assert "\n" not in str(refusal.value)
        return str(refusal.value)

    return refuse


def real_rows(name):
    with (setups.data_folder() / name).open(encoding="utf-8", newline="") as file:
        header, first, second, *_ = csv.reader(file)
    return header, first, second


@pytest.mark.parametrize("name", READ)
def test_real_table_is_read(name):
    assert len(list(READ[name]())) > 10


@pytest.mark.parametrize(
    ("name", "field", "text"),
    [(name, field, text) for name, fields in BAD.items() for field, texts in fields.items()
     for text in texts],
)  # fmt: skip
def test_malformed_field_is_named_with_its_line(refused, name, field, text):
    header, first, second = real_rows(name)
    second[header.index(field)] = text
    assert refused(name, header, first, second) == f"{name}, line 3: {field}: given {text!r}"


@pytest.mark.parametrize("name", READ)
def test_second_row_with_one_name_is_refused(refused, name):
    header, first, _ = real_rows(name)
    expected = f"{name}, line 3: {header[0]}: given {first[0]!r} a second time"
    assert refused(name, header, first, first) == expected


@pytest.mark.parametrize("name", READ)
def test_row_that_is_too_short_or_too_long_is_refused(refused, name):
    header, first, _ = real_rows(name)
    for kept in range(1, len(header)):
        expected = f"{name}, line 2: {header[kept]}: given None"
        assert refused(name, header, first[:kept]) == expected
    assert refused(name, header, [*first, "more"]) == f"{name}, line 2: more: given ['more']"


@pytest.mark.parametrize("name", READ)
def test_other_columns_are_refused(refused, name):
    header, *_ = real_rows(name)
    for given in ([], header[:-1], [*header, "more"], header[::-1]):
        assert refused(name, given).startswith(f"{name}, line 1: given ")
