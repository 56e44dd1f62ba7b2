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
BAD = [  # texts that a field does not take
    ("claims.csv", "id", ""), ("claims.csv", "mode", "two"), ("claims.csv", "mode", "1.0"),
    ("claims.csv", "quantity", "error"), ("claims.csv", "value", "500;inf"),
    ("claims.csv", "relation", "above"), ("claims.csv", "low", "nan"),
    ("trends.csv", "modes", "1;two"), ("numbers.csv", "chapter", "8"),
    ("reasons.csv", "reason", "No stop"), ("index.csv", "item", ""),
]  # fmt: skip


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


@pytest.mark.parametrize(("name", "field", "text"), BAD)
def test_malformed_field_is_named_with_its_line(refused, name, field, text):
    header, first, second = real_rows(name)
    second[header.index(field)] = text
    assert refused(name, header, first, second) == f"{name}, line 3: {field}: given {text!r}"


@pytest.mark.parametrize("name", READ)
def test_rows_twice_too_short_or_too_long_and_other_columns_are_refused(refused, name):
    header, first, _ = real_rows(name)
    expected = f"{name}, line 3: given {first[0]!r} a second time"
    assert refused(name, header, first, first) == expected
    for given in (first[:-1], [*first, "more"]):
        assert refused(name, header, given).startswith(f"{name}, line 2: given {given}")
    for given in ([], header[:-1], [*header, "more"], header[::-1]):
        assert refused(name, given).startswith(f"{name}, line 1: given ")
