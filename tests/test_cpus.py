"""What `make test-cpus` calls the same: a comparison that sees nothing would pass everything."""

from __future__ import annotations

import re
from pathlib import Path

import cpus
import numpy as np
import pytest
import xarray as xr

VALUES = np.array([1.0, np.nan, -4.0])


@pytest.mark.parametrize(
    ("other", "expected"),
    [
        (VALUES, 0.0),
        (VALUES + [0, 0, 8e-9], 2e-9),
        (VALUES[[1, 0, 2]], np.inf),
        (np.array([1.0, np.inf, -4.0]), np.inf),
        (VALUES[:2], np.inf),
        (VALUES.astype(np.float32), np.inf),
        (VALUES.astype(str), np.inf),
    ],
)
def test_how_far_values_are_apart(other, expected):
    assert cpus.apart(VALUES, other) == pytest.approx(expected, rel=1e-6)


def test_words_and_counts_are_the_same_or_not():
    for one, other in (("a", "b"), (1, 2)):
        assert cpus.apart(np.array([one]), np.array([one])) == 0
        assert cpus.apart(np.array([one]), np.array([other])) == np.inf


def test_every_variable_and_coordinate_counts(tmp_path):
    whole = xr.Dataset({"a": ("x", [1.0, 2.0]), "b": ("x", np.float32([1, 2]))}, {"x": [0, 1]})
    whole.to_netcdf(tmp_path / "whole.nc")
    for name in ("a", "b", "x"):
        whole.drop_vars(name).to_netcdf(tmp_path / "other.nc")
        found = cpus.differences(tmp_path / "whole.nc", tmp_path / "other.nc")
        assert found.pop(name)[0] == np.inf
        assert all(far <= bound for far, bound in found.values())
    found = cpus.differences(tmp_path / "whole.nc", tmp_path / "whole.nc")
    assert {name: bound for name, (_, bound) in found.items()} == {
        "a": cpus.BOUND, "b": cpus.DRAWN, "x": cpus.BOUND,
    }  # fmt: skip


def test_the_conventions_promise_what_is_compared():
    text = (Path(__file__).parents[1] / "book" / "conventions.md").read_text(encoding="utf-8")
    section = text.partition("(the-same-on-every-machine)=")[2].partition("\n## ")[2]
    (power,) = re.findall(r"more than 10⁻([⁰¹²³⁴-⁹]) of its largest value", section)
    assert 10.0 ** -"⁰¹²³⁴⁵⁶⁷⁸⁹".index(power) == cpus.BOUND
    (bits,) = re.findall(r"stored to (\d+) bits", section)
    assert 2.0 ** (1 - int(bits)) == cpus.DRAWN
