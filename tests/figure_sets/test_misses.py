"""The search for what explains the misses of chapter 3: its model, its rule, what it would find."""

import numpy as np
import pytest
from refused import refusal

from thesis_lib.facts.claims import claims_of
from thesis_lib.figure_sets.misses import compute, scores, tables
from thesis_lib.figure_sets.misses import model as chapter
from thesis_lib.figure_sets.misses.changes import CHANGES
from thesis_lib.figure_sets.misses.model import Model
from thesis_lib.figure_sets.misses.parameters import Misses
from thesis_lib.figure_sets.parametric import compute as studies
from thesis_lib.figure_sets.registry import validate
from thesis_lib.ledger import verdicts
from thesis_lib.studies.attributes import with_provenance

TRIALS = 30
FEW = {"topics": ["lens", "rounding", "mean error"], "trials": 15, "theses": 8}
BY_NAME = {change.name: change for change in CHANGES}


@pytest.fixture(scope="module")
def cubes():
    names = chapter.STUDIES
    return {name: studies.run(validate(name, {"trials": TRIALS})) for name in names}


@pytest.fixture(scope="module")
def few():
    request = validate("misses", FEW)
    return with_provenance(compute.run(request), request, 0.0)


def ends_of(model, seed=0, trials=TRIALS, first=0):
    return scores.ends(model, *chapter.simulate(model, seed, trials, first))


def test_what_this_book_takes_is_what_the_chapter_computes(cubes):
    adopted = Model()
    found = chapter.errors(adopted, *chapter.simulate(adopted, 0, TRIALS))
    for claim in chapter.claims():
        expected = verdicts.errors(cubes[claim.figure_set], claim)
        own = chapter.of_claim(claim, found)
        np.testing.assert_allclose(own, expected.transpose("setting", "trial"), rtol=1e-5)


def test_misses_are_those_of_the_ledger(cubes, monkeypatch):
    monkeypatch.setattr(compute, "OWN_TRIALS", TRIALS)
    met = [
        check.inside
        for name in chapter.STUDIES
        for check in verdicts.check(cubes[name], claims_of(name))
    ]
    assert compute._of_claims(0)["met"] == met


@pytest.mark.parametrize("change", CHANGES, ids=lambda change: change.name)
def test_every_change_changes_something(change):
    adopted, other = ends_of(Model(), trials=2), ends_of(Model().changed(change.values), trials=2)
    assert not np.allclose(adopted.least, other.least, rtol=1e-3)


def test_what_parameters_of_the_chapter_do_changes_do_too(cubes):
    parameters = {
        "28 mm lens": {"focal_length_mm": 28.0},
        "rest position known": {"rest": "known"},
        "azimuth from X": {"azimuth_zero": "X"},
        "one newton": {"amplitude_mm": "force"},
        "mode 2 by 7.7 mm": {"amplitude_mm": [5.5, 7.7, 5.5]},
        "markers from the clamp on": {"first_marker_mm": 0.0},
    }
    claims = [claim for claim in chapter.claims() if claim.figure_set == "beam-aperture"]
    for name, values in parameters.items():
        cube = studies.run(validate("beam-aperture", {"trials": 4, **values}))
        changed = Model().changed(BY_NAME[name].values)
        found = chapter.errors(changed, *chapter.simulate(changed, 0, 4))
        for claim in claims:
            expected = verdicts.errors(cube, claim).transpose("setting", "trial")
            np.testing.assert_allclose(chapter.of_claim(claim, found), expected, rtol=1e-4)


def test_whole_pixels_by_hand():
    """Rules of rounding for one coordinate on one grid, worked out by hand."""
    uv, shift = np.full((1, 2, 1, 1, 1), 10.3), np.full((1, 2, 1, 1, 1), 0.4)
    middle = np.full((1, 2, 1, 1, 1), 160.0)
    by_hand = {"nearest": 10.6, "down": 9.6, "towards the middle": 10.6, 0.5: 10.1, 2.0: 9.6}
    for how, expected in by_hand.items():
        found = chapter.rounded(how, uv, shift, middle)
        np.testing.assert_allclose(found, expected, atol=1e-9)
    np.testing.assert_allclose(chapter.rounded("v", uv, shift, middle).ravel(), [10.3, 10.6])
    np.testing.assert_allclose(chapter.rounded("u", uv, shift, middle).ravel(), [10.6, 10.3])


def test_errors_of_one_row_by_hand():
    """Deflections of 1, −2 and 4 mm, measured as 2, −2 and 3, with 1 mm sideways at the last."""
    true = np.array([[1.0, -2.0, 4.0]]) / 1000
    measured = np.zeros((1, 3, 1, 1, 3))
    measured[0, 2, 0, 0] = np.array([2.0, -2.0, 3.0]) / 1000
    measured[0, 0, 0, 0, 2] = 1 / 1000

    def of(**values):
        return chapter.errors(Model(peaks_mm=(5.0,), **values), true, measured)[:, 0, 0, 0]

    np.testing.assert_allclose(of(), [25 * np.sqrt(2 / 3), 25, 25])
    np.testing.assert_allclose(of(mean="absolute")[0], 50 / 3)
    np.testing.assert_allclose(of(mean="median")[0], 25)
    np.testing.assert_allclose(of(mean="std")[0], 25 * np.sqrt(2) / 3)
    np.testing.assert_allclose(of(reference="tip")[1], 20)
    np.testing.assert_allclose(of(reference="measured")[1], 100 / 3)
    np.testing.assert_allclose(of(reference="peak to peak")[1], 100 / 6)
    np.testing.assert_allclose(of(reference="rms")[1], 100 / np.sqrt(7))
    np.testing.assert_allclose(of(deflection="place")[1], 25 * np.sqrt(2))
    np.testing.assert_allclose(of(deflection="length")[1], 25)
    np.testing.assert_allclose(of(largest="over")[1], 25)
    np.testing.assert_allclose(of(largest="under")[1], 25)
    np.testing.assert_allclose(of(largest="second")[1], 25)
    np.testing.assert_allclose(of(largest="peak")[1], 25)


def test_a_chance_is_the_share_of_draws_that_the_ledger_would_call_true():
    draws = ends_of(Model()).of(slice(1, None))
    counted = [
        sum(
            verdicts.meets(claim, low, low) and verdicts.meets(claim, high, high)
            for low, high in zip(*ends, strict=True)
        )
        for claim, *ends in zip(chapter.claims(), draws.least, draws.most, strict=True)
    ]
    found = scores.chances(draws, scores.bounds(chapter.claims()))
    np.testing.assert_allclose(found, (np.array(counted) + 0.5) / (TRIALS + 1))


def test_the_search_finds_what_was_planted(few):
    """A thesis that is invented with a 35 mm lens scores best with it, by 20 other trials."""
    changes = ("35 mm lens", "20 mm lens", "to half pixels", "median")
    models = [Model(), *(Model().changed(BY_NAME[name].values) for name in changes)]
    every = scores.together([ends_of(model).of(slice(1, None)) for model in models])
    for planted, model in enumerate(models):
        theses = ends_of(model, trials=TRIALS + 20, first=TRIALS + 1)
        best = [
            int(np.argmax(scores.score(every, scores.invented(theses.of(one)))))
            for one in range(20)
        ]
        assert best.count(planted) >= 14, (planted, best)


def test_a_literal_run_meets_the_thesis_that_printed_it():
    literal = ends_of(Model(), trials=2).of(0)
    low, high = scores.invented(literal)
    assert (literal.least >= low).all()
    assert (literal.most <= high).all()


def test_theses_of_the_model_itself_gain_little_and_score_as_expected(few):
    assert (few["chance_gain"] >= 0).all()
    assert few["own_score"].mean() > few["score"]
    topics = dict(zip(few["change"].values, few["topic"].values, strict=True))
    for pair in few["pair"].values:
        one, other = pair.split(" + ")
        assert topics[one] != topics[other]


def test_groups_are_corrected_for_their_number():
    np.testing.assert_allclose(tables._holm(np.array([0.01, 0.04, 0.03])), [0.03, 0.06, 0.06])


def test_the_page_says_what_the_cube_holds(few):
    told = tables.verdict(few).data
    gains = np.concatenate([few["gain"].values, few["pair_gain"].values])
    assert f"gains {gains.max():.0f}" in told
    assert "not enough" in told
    good = few.assign(best_own_score=few["best_own_score"] * 0 + float(few["score"]))
    assert "It would be enough" in tables.verdict(good).data
    lucky = few.assign(chance_gain=few["chance_gain"] * 0 + 1000)
    assert "Not beyond chance" in tables.verdict(lucky).data
    missed = int((~few["met"].values.astype(bool)).sum())
    assert str(missed) in tables.common(few).data


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"topics": []}, "one at least"),
        ({"topics": ["luck"]}, '"luck"'),
        ({"trials": 1}, "trials"),
        ({"theses": 0}, "theses"),
        ({"together": 3}, "together"),
    ],
)
def test_what_says_nothing_is_refused_in_a_line(values, words):
    assert words in refusal("misses", **values)


def test_without_pairs_there_are_none():
    cube = compute.run(Misses(topics=["rest"], trials=4, theses=3, together=1))
    assert cube.sizes["pair"] == 0
