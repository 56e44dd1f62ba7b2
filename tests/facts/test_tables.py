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
        "id": [""], "mode": ["two", "1.0"], "quantity": ["error"], "value": ["every", "500;inf"],
        "relation": ["above"], "low": ["", "nan"], "excepted": ["one"],
    },
    "trends.csv": {
        "chapter": ["three"], "modes": ["1;two"],
        "test": ["", "drops", "fall", "falls 3", "below x", "below 40 soon", "peaks"],
    },
    "numbers.csv": {"chapter": ["8"], "stated": ["some", "1/0", "1.5×2"], "value_of": ["top"]},
    "reasons.csv": {"reason": ["No stop"], "page": ["not a page"]},
    "index.csv": {
        "item": ["fig 3.4", "equation 3.20 a"], "page": ["beam.md", "beam#"],
        "function": ["structures.beam", "thesis_lib.a;thesis_lib.b"],
        "cube": ["mean_error", "beam-distance: "], "test": ["tests/test_x.py"], "errata": ["b2"],
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
def test_rows_twice_too_short_or_too_long_and_other_columns_are_refused(refused, name):
    header, first, _ = real_rows(name)
    expected = f"{name}, line 3: {header[0]}: given {first[0]!r} a second time"
    assert refused(name, header, first, first) == expected
    expected = f"{name}, line 2: {header[-1]}: given None"
    assert refused(name, header, first[:-1]) == expected
    assert refused(name, header, [*first, "more"]) == f"{name}, line 2: more: given ['more']"
    for given in ([], header[:-1], [*header, "more"], header[::-1]):
        assert refused(name, given).startswith(f"{name}, line 1: given ")
