"""The rule for stated values, and the file that they stand in."""

import csv
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

from thesis_lib.facts import claims, setups
from thesis_lib.ledger import verdicts

CLAIMS = claims.read_claims()
ROW = {
    "id": "one", "figure_set": "beam-distance", "section": "3.3.1", "figure": "3.4", "panel": "d",
    "case": "1", "mode": "1", "quantity": "mean_error", "value": "500", "relation": "about",
    "low": "10", "high": "10", "excepted": "0", "pair_order": "", "conflicts": "",
    "conflict_why": "",
}  # fmt: skip


@pytest.fixture
def stated(tmp_path, monkeypatch):
    """Claims read from a file with one row for each of the given changes."""

    def read(*changes):
        with (tmp_path / "claims.csv").open("w", encoding="utf-8", newline="") as file:
            rows = csv.DictWriter(file, ROW)
            rows.writeheader()
            rows.writerows({**ROW, **change} for change in changes)
        monkeypatch.setattr(claims, "data_folder", lambda: tmp_path)
        return claims.read_claims()

    return read


def cube_with(literal, bands, case="1", values=(500.0, 1000.0), medians=None, trials=21):
    """A cube whose settings have these nominal runs, and bands and medians of the trials.

    Of 21 trials the 5 % quantile is the second and the median the eleventh.
    """
    errors = []
    for number, (first, (low, high)) in enumerate(zip(literal, bands, strict=True)):
        middle = (low + high) / 2 if medians is None else medians[number]
        errors.append([first, *[low] * 10, middle, *[high] * 10][: trials + 1])
    count = len(errors)
    errors = np.array(errors)[:, None]
    return xr.Dataset(
        {
            "mean_error": (("setting", "mode", "trial"), errors),
            "max_point_error": (("setting", "mode", "trial"), 2 * errors),
        },
        coords={
            "case": ("setting", [case] * count),
            "value": ("setting", list(values)[:count]),
            "pair_order": ("setting", [""] * count),
            "mode": [1],
        },
    )


def checked(cube, claim):
    (check,) = verdicts.check_claims(cube, [claim])
    return check


# -- The rule --


FAR = (90, 95)
EXACT = [
    ("about", "10", "10", 10.5, True),
    ("about", "10", "10", 10.51, False),
    ("about", "10.0", "10.0", 10.06, False),
    ("range", "10", "15", 15.5, True),
    ("range", "0.5", "4", 0.45, True),
    ("range", "0.5", "4", 0.44, False),
    ("max", "40", "40", 40.5, True),
    ("max", "40", "40", 40.6, False),
    ("less_than", "1.5", "1.5", 1.499, True),
    ("less_than", "1.5", "1.5", 1.5, False),
    ("min", "40", "40", 39.5, True),
    ("min", "40", "40", 39.4, False),
]


@pytest.mark.parametrize(("relation", "low", "high", "literal", "agrees"), EXACT)
def test_a_nominal_run_agrees_to_the_printed_digits_whatever_the_band(
    stated, relation, low, high, literal, agrees
):
    (claim,) = stated({"relation": relation, "low": low, "high": high})
    band = (-50, -40) if relation == "min" else FAR
    check = checked(cube_with([literal], [band]), claim)
    assert check.exact == agrees
    assert not check.inside
    assert check.verdict == ("agrees" if agrees else "differs")


BANDS = [  # the margin is half a point below 10 %, and one point from there on
    ("about", "10", "10", (11, 14), True),
    ("about", "10", "10", (11.01, 14), False),
    ("about", "9.5", "9.5", (10.01, 14), False),
    ("range", "8", "18", (2, 7), True),
    ("range", "8", "18", (2, 6.99), False),
    ("range", "2", "4", (0, 100), True),
    ("max", "40", "40", (41, 60), True),
    ("max", "40", "40", (41.01, 60), False),
    ("less_than", "5", "5", (5.5, 60), True),
    ("less_than", "5", "5", (5.51, 60), False),
    ("min", "40", "40", (10, 39), True),
    ("min", "40", "40", (10, 38.99), False),
]


@pytest.mark.parametrize(("relation", "low", "high", "band", "meets"), BANDS)
def test_the_widened_band_of_the_trials_decides_between_scatter_and_difference(
    stated, relation, low, high, band, meets
):
    (claim,) = stated({"relation": relation, "low": low, "high": high})
    off = -10.0 if relation == "min" else 99.0
    check = checked(cube_with([off], [band]), claim)
    assert not check.exact
    assert check.verdict == ("within scatter" if meets else "differs")
    assert (check.low, check.high) == band


def test_band_is_from_5_to_95_percent_of_the_trials_without_the_nominal_run(stated):
    (claim,) = stated({})
    errors = np.random.default_rng(0).permutation(np.arange(101.0))
    cube = cube_with([0], [(0, 0)]).isel(trial=[0] * 102).copy(deep=True)
    cube["mean_error"][0, 0] = [1e6, *errors]
    check = checked(cube, claim)
    assert (check.literal, check.low, check.median, check.high) == (1e6, 5, 50, 95)


def test_a_claim_about_all_settings_holds_if_it_holds_for_each(stated):
    (claim,) = stated({"value": "all"})
    good, near, bad = (9, 11), (10.5, 12), (12, 13)
    for bands, literal, verdict in (
        ([bad, bad], [10, 10], "agrees"),
        ([good, near], [10, 11], "within scatter"),
        ([good, bad], [10, 11], "differs"),
    ):
        assert checked(cube_with(literal, bands), claim).verdict == verdict


@pytest.mark.parametrize("worst", [0, 2])
def test_the_setting_that_is_farthest_off_is_shown(stated, worst):
    (claim,) = stated({"value": "all", "relation": "range", "low": "10", "high": "12"})
    bands = [(13, 14), (7, 9), (13.5, 20)]
    bands[worst] = (2, 5)
    cube = cube_with([1.0, 2.0, 3.0], bands, values=(1.0, 2.0, 3.0))
    check = checked(cube, claim)
    assert (check.literal, check.low, check.high) == (worst + 1, 2, 5)


def test_a_claim_about_some_settings_leaves_out_the_others_and_other_cases(stated):
    cube = cube_with([10, 50, 10], [(9, 11), (50, 51), (9, 11)], values=(1.0, 2.0, 3.0))
    other = cube_with([99], [FAR], case="2a")
    for made in (cube, xr.concat([other, cube], "setting")):
        for value, verdict in (("1", "agrees"), ("1;3", "agrees"), ("2;3", "differs")):
            (claim,) = stated({"value": value})
            assert checked(made, claim).verdict == verdict


@pytest.mark.parametrize(
    ("relation", "low", "high", "median", "ratio"),
    [
        ("about", "10", "10", 10, 1),
        ("about", "10", "10", 5, 0.5),
        ("range", "8", "18", 12, 1),
        ("range", "8", "18", 2, 0.25),
        ("max", "40", "40", 1, 1),
        ("less_than", "40", "40", 60, 1.5),
        ("min", "40", "40", 20, 0.5),
    ],
)
def test_ratio_is_to_the_nearest_value_that_is_allowed(stated, relation, low, high, median, ratio):
    (claim,) = stated({"relation": relation, "low": low, "high": high})
    check = checked(cube_with([1], [(0, 100)], medians=[median]), claim)
    assert check.ratio == pytest.approx(ratio)


# -- Where the text leaves out one marker --


def markers(errors_percent, trials=3):
    """A cube of four markers, of which the third moves most, with these errors in every trial."""
    reference = 1e-3 * np.array([0.0, 1.0, -4.0, 3.0])
    measured = reference + np.array(errors_percent) / 100 * 4e-3
    cube = cube_with([0], [(0, 0)], trials=trials)
    measured = np.broadcast_to(measured, (1, 1, trials + 1, 4))
    return cube.assign(
        reference_deflection=(("mode", "point"), [reference]),
        measured_deflection=(("setting", "mode", "trial", "point"), measured),
    )


def test_excepting_a_marker_means_the_second_largest_error(stated):
    change = {"quantity": "max_point_error", "excepted": "1", "relation": "max",
              "low": "5", "high": "5"}  # fmt: skip
    (claim,) = stated(change)
    for errors, shown, verdict in (
        ([1, -80, 3, 2], 3, "agrees"),
        ([0, 0, 0, 100], 0, "agrees"),
        ([1, -80, 3, -20], 20, "differs"),
        ([-5, 4, 3, 2], 4, "agrees"),
    ):
        check = checked(markers(errors), claim)
        assert check.median == pytest.approx(shown, abs=1e-9)
        assert check.verdict == verdict


# -- What cannot be judged --


def test_what_is_undefined_has_a_reason_and_no_check(stated):
    (claim,) = stated({})
    cube = cube_with([10, 10], [(9, 11), (9, 11)])
    nodal = cube.copy(deep=True)
    nodal["mean_error"][0] = np.nan
    for made, one, reason in (
        (cube, replace(claim, mode=2), "mode 2 was not run"),
        (cube, replace(claim, case="2a"), "case 2a was not run at 500"),
        (cube, replace(claim, case="2a", values=()), "case 2a was not run"),
        (cube, replace(claim, values=(500.0, 510.0, 7.5)), "case 1 was not run at 510, 7.5"),
        (cube, replace(claim, pair_order="printed"), "case 1 was not run at 500"),
        (cube.isel(trial=[0]), claim, "the cube has no random trials"),
        (nodal, claim, "the reference is zero: a nodal plane"),
    ):
        assert verdicts.judge_claim(made, one) == reason
        assert verdicts.check_claims(made, [one]) == []
    assert isinstance(verdicts.judge_claim(cube, claim), verdicts.Check)
    assert isinstance(verdicts.judge_claim(nodal, replace(claim, values=(1000.0,))), verdicts.Check)


# -- The file --


def test_every_statement_has_one_name_in_all_three_files():
    names = [
        one.id
        for read in (claims.read_claims, claims.read_trends, claims.read_numbers)
        for one in read()
    ]
    assert [name for name, times in Counter(names).items() if times > 1] == []
    claimed = {claim.id for claim in CLAIMS}
    assert all(claimed - {claim.id} >= set(claim.conflicts) for claim in CLAIMS)


def test_figures_are_those_of_their_sets_and_sections_of_their_chapters():
    chapters = {"beam": 3, "plate": 4, "experiment": 5, "sound": 6}
    for claim in CLAIMS:
        subject, _, study = claim.figure_set.partition("-")
        assert claim.chapter == chapters[subject], claim.id
        assert claim.figure == setups.figure_number(subject, study, claim.case, claim.mode)
        assert claim.figure.startswith(f"{claim.chapter}."), claim.id


def test_intervals_are_ordered_and_single_unless_they_are_ranges():
    for claim in CLAIMS:
        assert 0 <= claim.low <= claim.high, claim.id
        assert claim.low == claim.high or claim.relation == "range", claim.id
        assert claim.excepted in (0, 1), claim.id
        assert not claim.excepted or claim.quantity == "max_point_error", claim.id
