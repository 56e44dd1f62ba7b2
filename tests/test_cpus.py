"""What `make test-cpus` calls the same: a comparison that sees nothing would pass everything."""

import re
from pathlib import Path

import cpus
import numpy as np
import pytest
import xarray as xr

VALUES = np.array([1.0, np.nan, -4.0])


@pytest.mark.parametrize(
    ("other", "same"),
    [
        (VALUES, True),
        (VALUES + [0, 0, 3e-9], True),
        (VALUES + [0, 0, 8e-9], False),
        (np.array([1.0, np.inf, -4.0]), False),
        (VALUES[:2], False),
    ],
)
def test_numbers_are_the_same_within_a_billionth_of_the_largest(other, same):
    assert cpus.close(VALUES, other, exact=False) == same
    assert cpus.close(VALUES, other, exact=True) == (other is VALUES)


def test_every_variable_and_coordinate_counts(tmp_path):
    whole = xr.Dataset({"a": ("x", [1.0, 2.0]), "b": ("x", ["u", "v"])}, {"x": [0, 1]})
    whole.to_netcdf(tmp_path / "whole.nc")
    assert cpus.compare_files(tmp_path / "whole.nc", tmp_path / "whole.nc", exact=True) == []
    for name in ("a", "b", "x"):
        whole.drop_vars(name).to_netcdf(tmp_path / "other.nc")
        assert cpus.compare_files(tmp_path / "whole.nc", tmp_path / "other.nc") == [name]


def test_the_conventions_promise_what_is_compared():
    text = (Path(__file__).parents[1] / "book" / "glossary.md").read_text(encoding="utf-8")
    section = text.partition("(the-same-on-every-machine)=")[2].partition("\n## ")[2]
    (power,) = re.findall(r"more than 10⁻([⁰¹²³⁴-⁹]) of its largest value", section)
    assert 10.0 ** -"⁰¹²³⁴⁵⁶⁷⁸⁹".index(power) == cpus.MAX_DIFFERENCE
    (bits,) = re.findall(r"stored to (\d+) bits", section)
    assert 2.0 ** (1 - int(bits)) == cpus.MAX_SINGLE_DIFFERENCE
