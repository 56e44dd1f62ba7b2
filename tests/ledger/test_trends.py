"""What the words for trends mean, and how sure one is of them."""

from math import sqrt

import numpy as np
import pytest

from thesis_lib.facts import claims
from thesis_lib.ledger import trends
from thesis_lib.ledger.trends import Finding, judge_trend
from thesis_lib.ledger.verdicts import Series

MEAN, XZ, YZ = "mean_error", "plane_error_xz", "plane_error_yz"
NAN = float("nan")


def trend(test, cases=("a",), modes=(1,), quantities=(MEAN,)):
    return claims.Trend("t", 3, "3.3", cases, modes, quantities, "", "", "words", ("s",), test)


def series(errors, quantity=MEAN, case="a", mode=1, values=None):
    """A series from errors of shape (settings, trials)."""
    errors = np.asarray(errors, float)
    values = np.arange(len(errors)) if values is None else values
    return Series(quantity, case, mode, np.array(values, float), errors)


def scene(by, trials=1, noise=0.0, seed=0, values=None):
    """Series with these expected errors by (quantity, case, mode), or by some of the three."""
    rng = np.random.default_rng(seed)
    plain = {"quantity": MEAN, "case": "a", "mode": 1}
    made = []
    for key, expected in by.items():
        given = dict(zip(plain, key, strict=True)) if isinstance(key, tuple) else {"case": key}
        errors = np.array(expected, float)[:, None] * np.exp(
            noise * rng.standard_normal((len(expected), trials))
        )
        at = (values or {}).get(given["case"])
        made.append(series(errors, **{**plain, **given}, values=at))
    return made


def modes(*expected):
    return {(MEAN, "a", mode): errors for mode, errors in enumerate(expected, 1)}


def planes(xz, yz, mode=1):
    return {(XZ, "a", mode): xz, (YZ, "a", mode): yz}


ALL, BOTH = {"modes": (1, 2, 3)}, {"modes": (1, 2)}
PLANES = {"quantities": (XZ, YZ)}
TWO = {"cases": ("a", "b")}
EVERY = {"cases": ()}
SILENT = planes([NAN, NAN], [2, 3], 2)
# Test, what is expected of the errors, whether it holds, and how the trend differs from the plain.
CLEAR = [
    ("falls", {"a": [4, 3, 2]}, True, {}),
    ("falls", {"a": [4, 5, 6, 3]}, False, {}),  # last below first, but half the pairs grow
    ("falls", modes([4, 3], [4, 3], [3, 4]), False, ALL),
    ("falls", modes([4, 3], [4, 3], [3, 4]), True, BOTH),
    ("rises", {"a": [2, 3, 4]}, True, {}),
    ("rises", {"a": [4, 3, 2]}, False, {}),
    ("falls_steadily", {"a": [4, 3, 2]}, True, {}),
    ("falls_steadily", {"a": [4, 1, 3]}, False, {}),
    ("falls_irregularly", {"a": [4, 1, 3]}, True, {}),
    ("falls_irregularly", {"a": [4, 3, 2]}, False, {}),
    ("falls", {"a": [4, 3.8]}, False, {}),  # by less than the smallest effect
    ("flat", {"a": [1.02, 1, 1.05]}, True, {}),
    ("flat", {"a": [1.02, 1, 2.2]}, False, {}),
    ("no_trend", {"a": [4, 3.9, 3.8]}, True, {}),  # falls, by less than the smallest effect
    ("no_trend", {"a": [8, 5, 2]}, False, {}),
    ("no_trend", {"a": [3, 9, 8, 7, 4]}, True, {}),  # last above first, most pairs fall
    ("mostly_no_trend", {"a": [1, 1.05], "b": [8, 2]}, False, TWO),  # half is not most
    ("mostly_no_trend", modes([1, 1.05], [1, 1.05], [8, 2]), True, ALL),
    ("same_pattern", modes([4, 2], [8, 1]), True, BOTH),
    ("same_pattern", modes([2, 4], [8, 1]), False, BOTH),
    ("same_trends", {"a at 1": [4, 2], "a at 2": [9, 5], "b at 1": [2, 4]}, True, EVERY),
    ("same_trends", {"a at 1": [4, 2], "a at 2": [9, 2]}, False, EVERY),  # factors 2 and 4.5
    ("below 40", {"a": [20, 38]}, True, {}),
    ("below 40", {"a": [45, 20]}, False, {}),
    ("at_most 40 last", {"a": [60, 20]}, True, {}),
    ("at_most 40 last", {"a": [20, 60]}, False, {}),
    ("within 1 4", {"a": [2, 3]}, True, {}),
    ("within 1 4", {"a": [0.5, 3]}, False, {}),
    ("within 1 4 5 8", modes([2, 3], [6, 7]), True, BOTH),
    ("flat 1 4", {"a": [2, 2.1]}, True, {}),
    ("flat 1 4", {"a": [5, 5.2]}, False, {}),
    ("above 5 first", {"a": [7, 1]}, True, {}),
    ("above 5 first", {"a": [1, 7]}, False, {}),
    ("peaks 750", {"a": [1, 3, 2]}, True, {}),
    ("peaks 750", {"a": [3, 2, 1]}, False, {}),
    ("highest_last", {"a": [2, 1, 3]}, True, {}),
    ("highest_last", {"a": [1, 3, 2]}, False, {}),
    ("modes_alike", modes([1, 2], [1.3, 2.6]), True, BOTH),
    ("modes_alike", modes([1, 4], [2, 2]), True, BOTH),  # the geometric means are
    ("modes_alike", modes([1, 1], [1.3, 1.3], [1.7, 1.7]), False, ALL),  # first and last are not
    ("worst_mode 3", modes([2, 1], [1, 2], [2, 2]), True, {"modes": (3,)}),
    ("worst_mode 3", modes([2, 1], [3, 3], [2, 2]), False, {"modes": (3,)}),
    ("best_mode 3", modes([2, 1], [4, 2], [1, 0.5]), True, {"modes": (3,)}),
    ("best_mode 3", modes([2, 1], [4, 2], [0.5, 1]), False, {"modes": (3,)}),  # does not fall
    ("planes_alike", planes([1, 2], [1.3, 2.6]), True, PLANES),
    ("planes_alike", planes([1, 2], [1.7, 3.4]), False, PLANES),
    ("planes_alike YZ 2 1", planes([1, 1], [2, 2]) | SILENT, True, PLANES | {"modes": (2,)}),
    ("planes_alike YZ 2 1", planes([1, 1], [1, 1]) | SILENT, False, PLANES | {"modes": (2,)}),
    ("planes_alike YZ 2 1", planes([1, 1], [2, 2]) | planes([1, 1], [2, 2], 2), False,
     PLANES | {"modes": (2,)}),  # no plane is nodal
    ("like_case b", {"a": [1, 4], "b": [2, 2]}, True, {}),
    ("like_case b", {"a": [1, 4], "b": [4, 4]}, False, {}),
    ("below_case b first", {"a": [1, 9], "b": [2, 3]}, True, {}),
    ("below_case b first", {"a": [2, 1], "b": [1, 9]}, False, {}),
    ("below_case b common", {"a": [9, 5, 5], "b": [9, 6, 1]}, True, {}),  # at 750 and 1000
    ("below_case b common", {"a": [1, 5, 7], "b": [9, 6, 9]}, False, {}),
    ("gentler b", {"a": [4, 3], "b": [8, 2]}, True, {}),
    ("gentler b", {"a": [40, 20], "b": [4, 1]}, True, {}),  # factors, not differences
    ("gentler b", {"a": [8, 2], "b": [4, 3]}, False, {}),
    ("best_case a", {"a": [1, 4], "b": [3, 3]}, True, TWO),
    ("best_case a", {"a": [1, 4], "b": [1.7, 1.7]}, False, TWO),
    ("unrelated of", {(MEAN, "a", 1): [1, 2, 3, 4], ("of", "a", 1): [2, 4, 1, 3]}, True, {}),
    ("unrelated of", {(MEAN, "a", 1): [1, 2, 3, 4], ("of", "a", 1): [2, 3, 5, 9]}, False, {}),
    ("unrelated of", {(MEAN, "a", 1): [1, 2, 3, 4], ("of", "a", 1): [9, 5, 3, 2]}, False, {}),
]  # fmt: skip
VALUES = {"a": [500, 750, 1000], "b": [750, 1000, 1500]}  # where there are three settings
EDGES = [
    ("falls", {"a": [1, 1 - trends.MIN_MATERIAL_FALL]}, False, {}),
    ("falls", {"a": [1, 1 - trends.MIN_MATERIAL_FALL - 1e-9]}, True, {}),
    ("modes_alike", modes([1, 1], [trends.MAX_ALIKE_RATIO, trends.MAX_ALIKE_RATIO]), True, BOTH),
    ("modes_alike", modes([1, 1], [trends.MAX_ALIKE_RATIO + 1e-9] * 2), False, BOTH),
    ("below 40", {"a": [40, 1]}, False, {}),
    ("at_most 40", {"a": [40.5, 1]}, True, {}),  # would be printed as 40
    ("at_most 40", {"a": [40.6, 1]}, False, {}),
    ("within 10 20", {"a": [9.1, 21.9]}, True, {}),
    ("unrelated of", {(MEAN, "a", 1): [1, 2, 3], ("of", "a", 1): [2, 1, 3]}, True, {}),  # just ½
]


def test_what_one_run_shows_of_a_flat_error_is_what_the_thesis_calls_flat():
    """A printed interval, or a factor of 2; in expectation it is flat or not by the one effect."""
    for expected, words, single in (
        ([1, trends.ONE_RUN_FLAT], "flat", 1),
        ([1, trends.ONE_RUN_FLAT + 1e-9], "flat", 0),
        ([8, 18], "flat 8 18", 1),
        ([8, 21], "flat 8 18", 0),
        ([8, 8], "flat 10 18", 0),
    ):
        assert judge_trend(trend(words), scene({"a": expected})) == Finding(0, single)
    assert judge_trend(trend("no_trend"), scene({"a": [4, 3, 2.5]})) == Finding(0, 1)


def values_of(by):
    return VALUES if all(len(expected) == 3 for expected in by.values()) else None


@pytest.mark.parametrize(("test", "by", "holds", "more"), CLEAR + EDGES)
def test_what_the_words_mean(test, by, holds, more):
    found = judge_trend(trend(test, **more), scene(by, values=values_of(by)))
    assert found == Finding(float(holds), float(holds))


@pytest.mark.parametrize(("test", "by", "holds", "more"), CLEAR)
def test_a_clear_trend_is_found_under_noise(test, by, holds, more):
    """Single runs scatter by 5 %, means over 100 of them by 0.5 %."""
    made = scene(by, trials=100, noise=0.05, seed=1, values=values_of(by))
    found = judge_trend(trend(test, **more), made)
    assert found.confidence > 0.99 if holds else found.confidence < 0.01


def test_every_word_is_tried_both_ways():
    used = {one.test.partition(" ")[0] for one in claims.read_trends()}
    assert used <= set(trends.TREND_TESTS)
    for holds in (True, False):
        assert {test.partition(" ")[0] for test, _, held, _ in CLEAR if held == holds} == set(
            trends.TREND_TESTS
        )


# -- Confidence --


def test_confidence_is_calibrated_where_nothing_is_to_be_found(conforms):
    """Where the second error is lower by just the smallest effect that counts, it is uniform.

    95 % are reached by chance in 5 %.
    """
    count, rng = 600, np.random.default_rng(0)
    least = np.array([[1], [1 - trends.MIN_MATERIAL_FALL]])
    made = [series(least * (10 + rng.standard_normal((2, 100)))) for _ in range(count)]
    found = np.array([judge_trend(trend("falls"), [one]).confidence for one in made])
    conforms.sampled(abs(found.mean() - 0.5), below=4 / sqrt(12 * count))
    for share in (found >= trends.MIN_CONFIDENCE, found <= 1 - trends.MIN_CONFIDENCE):
        conforms.sampled(abs(share.mean() - 0.05), below=4 * sqrt(0.05 * 0.95 / count))
    deciles = np.quantile(found, np.arange(1, 10) / 10)
    conforms.sampled(deciles, np.arange(1, 10) / 10, atol=4 * 0.5 / sqrt(count))


def test_resamples_are_the_same_in_every_setting_and_case():
    """What is lower in each trial by a hair is lower in expectation, whatever the scatter."""
    scatter = 10 * np.random.default_rng(2).gamma(2, size=(1, 30))
    found = judge_trend(trend("falls"), [series(np.vstack([scatter, scatter * 0.899]))])
    assert found == Finding(1, 1)
    cases = [series(0.999 * scatter), series(scatter, case="b")]
    assert judge_trend(trend("below_case b first"), cases) == Finding(1, 1)


def test_trials_are_paired_as_far_as_both_sources_have_them():
    """Twenty trials beside thirty: only the first twenty can tell in how many single runs."""
    scatter = 10 * np.random.default_rng(2).gamma(2, size=(1, 30))
    shorter = scatter[:, :20].copy()
    shorter[0, :15] *= 1.001
    shorter[0, 15:] *= 0.999
    scatter[0, 20:] = 1e6
    cases = [series(scatter), series(shorter, case="b")]
    found = judge_trend(trend("below_case b first"), cases)
    assert found == Finding(0, 0.75)
    assert judge_trend(trend("below_case b first"), cases[::-1]) == found


def test_what_has_no_trials_of_its_own_does_not_shorten_the_others():
    """Failures of tracking are counted once for all trials."""
    errors = np.array([[2.0] * 9 + [1], [1.0] * 9 + [2]])
    once = series([[3], [1]], quantity="tracking_failures")
    assert judge_trend(trend("falls"), [series(errors), once]).single == 0.9
    both = trend("falls", quantities=(MEAN, "tracking_failures"))
    assert judge_trend(both, [series(errors), once]).single == 0.9
    alone = trend("falls", quantities=("tracking_failures",))
    assert judge_trend(alone, [series(errors), once]) == Finding(1, 1)


@pytest.mark.parametrize(
    ("confidence", "single", "verdict"),
    [
        (0.95, 0, "agrees"),
        (0.949, 0, "within scatter"),
        (0, 0.06, "within scatter"),
        (0.05, 0.05, "differs"),
    ],
)
def test_verdict(confidence, single, verdict):
    assert Finding(confidence, single).verdict == verdict


@pytest.mark.parametrize(
    ("test", "by", "more", "effect", "step"),
    [
        ("falls", {"a": [4, 3, 2]}, {}, 0.5, ""),
        ("falls", modes([4, 2], [4, 3.8]), BOTH, 0.95, ""),  # that which changes least
        ("falls_steadily", {"a": [4, 3, 1]}, {}, 0.25, ""),
        ("flat", {"a": [4, 3]}, {}, NAN, ""),
        ("falls", {"a": [0, 3]}, {}, NAN, "0 at 0 but 3 at 1"),
        ("falls", {"a": [4, 2, 2.2]}, {}, 0.55, ""),  # less than the smallest effect
        ("falls_steadily", {"a": [4, 2, 2.4]}, {}, 0.6, "2 at 1 but 2.4 at 2"),
        ("rises", {"a": [2, 3, 2.4, 5]}, {}, 2.5, "3 at 1 but 2.4 at 2"),
        ("flat", {"a": [2, 3, 1]}, {}, NAN, ""),
    ],
)
def test_least_change_and_largest_step_against_a_trend_are_told(test, by, more, effect, step):
    found = judge_trend(trend(test, **more), scene(by))
    np.testing.assert_allclose(found.effect, effect, rtol=1e-12)
    assert found.step_back == step


@pytest.mark.parametrize(
    ("by", "verdict"),
    [
        (modes([100, 98], [100, 91]), "no material change"),
        (modes([100, 98], [100, 60]), "differs"),  # one changes, one does not
    ],
)
def test_no_material_change_is_said_if_no_error_changes_by_more_than_a_tenth(by, verdict):
    assert judge_trend(trend("falls", **BOTH), scene(by, trials=9)).verdict == verdict


# -- One effect for all, and trends that are not monotonic --


def test_an_error_that_turns_is_not_monotonic_and_one_that_rises_in_too_many_draws_is_not_sure():
    """Errors of the rendered experiment at 640, 1280 and 1920 px: least at 1280."""
    means, widths = [2.80, 2.16, 2.41], [640, 1280, 1920]
    found = judge_trend(trend("falls"), [series(np.c_[means, means], values=widths)])
    assert (found.verdict, round(found.effect, 2)) == ("agrees", 0.86)
    scatter = np.random.default_rng(0).standard_normal((3, 19))  # of 19 recordings, paired
    scatter -= scatter.mean(axis=1, keepdims=True)
    made = [series(np.array(means)[:, None] + 0.35 * scatter, values=widths)]
    found = judge_trend(trend("falls"), made)
    assert 0.5 < found.confidence < 0.95  # any fall at all: 99 %
    assert (found.verdict, found.step_back) == ("within scatter", "2.16 at 1280 but 2.41 at 1920")


# -- Invariances --


BOUNDED = {"below", "above", "at_most", "within"}


@pytest.mark.parametrize(("test", "by", "more"), [(t, by, more) for t, by, _, more in CLEAR])
def test_only_bounds_depend_on_the_size_of_errors_and_nothing_on_what_a_trend_does_not_speak_of(
    test, by, more
):
    made = scene(by, trials=11, noise=0.4, seed=4, values=values_of(by))
    found = judge_trend(trend(test, **more), made)
    others = [
        series([[5] * 11, [1] * 11], quantity="power_error"),
        series([[1] * 11, [5] * 11], case="elsewhere"),
        series([[NAN] * 11, [1] * 11], quantity="power_error", mode=2),
    ]
    assert judge_trend(trend(test, **more), others + made) == found
    if not set(test.split()) & BOUNDED and test != "flat 1 4":
        larger = [Series(s.quantity, s.case, s.mode, s.values, 1024 * s.errors) for s in made]
        assert judge_trend(trend(test, **more), larger) == found


def test_what_falls_does_not_rise_and_rises_backwards():
    for seed in range(5):
        made = [series(np.random.default_rng(seed).gamma(2, size=(5, 40)))]
        falls, rises = (judge_trend(trend(test), made) for test in ("falls", "rises"))
        assert falls.single + rises.single <= 1
        assert judge_trend(trend("rises"), [series(made[0].errors[::-1])]) == falls


@pytest.mark.parametrize("gaps", [slice(None), slice(0, 1)])
def test_series_without_a_reference_are_left_out(gaps):
    good, bad = [[4, 4, 4], [3, 3, 2]], np.ones((2, 3))
    bad[:, gaps] = NAN
    both = trend("falls", **PLANES)
    for test in ("falls", "flat", "no_trend", "below 4", "same_pattern", "highest_last"):
        one = trend(test, **PLANES)
        alone = judge_trend(one, [series(good, XZ)])
        assert judge_trend(one, [series(good, XZ), series(bad, YZ)]) == alone
    assert judge_trend(both, [series(bad, XZ), series(bad, YZ)]) is None
    pair = trend("like_case b", **PLANES)
    cases = [series(good, XZ, "a"), series(good, XZ, "b"), series(bad, YZ, "a")]
    assert judge_trend(pair, [*cases, series(good, YZ, "b")]) == Finding(1, 1)


@pytest.mark.parametrize(
    ("one", "by"),
    [
        (trend("falls", quantities=(XZ,)), {"a": [2, 1]}),
        (trend("like_case b"), {"a": [2, 1]}),
        (trend("modes_alike", modes=(1, 2)), {"a": [2, 1]}),
        (trend("falls"), {}),
    ],
)
def test_nothing_is_found_where_there_is_nothing_to_compare(one, by):
    assert judge_trend(one, scene(by)) is None


def test_a_run_without_random_trials_finds_nothing():
    assert judge_trend(trend("falls"), [series(np.empty((3, 0)))]) is None
    assert judge_trend(trend("falls"), [series([[2], [1]])]) == Finding(1, 1)
