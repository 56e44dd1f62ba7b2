"""What the stated values could have told: draws of the model, and errors of other sizes."""

import dataclasses
import json
import re

import numpy as np
import pytest

from thesis_lib import files
from thesis_lib.facts import claims
from thesis_lib.figure_sets.claims import compute as ledger_power
from thesis_lib.figure_sets.cube_file import cube_of
from thesis_lib.figure_sets.registry import validate_request
from thesis_lib.ledger import verdicts

CLAIMS = claims.claims_of("beam-distance")


@pytest.fixture(scope="module")
def cube():
    return cube_of(validate_request("beam-distance", {"trials": 60}))


@pytest.fixture(scope="module")
def power(cube):
    return ledger_power.compute_power(lambda _: cube, CLAIMS)


@pytest.mark.parametrize(
    ("relation", "digits", "values", "low", "high"),
    [
        ("about", "10", [12.4], 12, 12),
        ("about", "1.2", [3.14, 3.46], 3.3, 3.3),
        ("range", "10", [8.4, 17.6], 8, 18),
        ("max", "10", [8.4, 17.1], 8, 18),
        ("less_than", "1", [0.2, 2.0], 0, 3),
        ("min", "10", [8.9, 17.1], 8, 17),
    ],
)
def test_a_draw_is_printed_with_the_claims_digits(relation, digits, values, low, high):
    rounding = (claims.half_digit(digits),) * 2
    changed = {"relation": relation, "low": 1, "high": 1, "rounding": rounding, "excepted": 0}
    one = dataclasses.replace(CLAIMS[0], **changed)
    made = verdicts.claim_from_errors(one, np.array(values))
    assert (made.low, made.high) == pytest.approx((low, high))
    assert all(verdicts.meets_claim(made, value, value) for value in values if relation != "about")


def test_figures_met_by_errors_as_they_are_are_those_of_the_ledger(power, cube):
    met = sum(check.inside for check in verdicts.check_claims(cube, CLAIMS))
    assert int(power["power_scaled"].sel(chapter=3, factor=1)) == met
    assert int(power["power_claims"].sel(chapter=3)) == len(verdicts.check_claims(cube, CLAIMS))
    assert int(power["power_claims"].sel(chapter=[4, 6]).sum()) == 0


def test_what_is_stated_by_the_model_itself_is_met_as_often_as_expected(conforms, cube, power):
    """Each trial in the thesis's place, by the ledger's own judge."""
    shares = []
    for trial in range(1, 41):
        stated = []
        for one in CLAIMS:
            values = verdicts.claim_errors(cube, one).transpose("setting", "trial").values[:, trial]
            stated.append(verdicts.claim_from_errors(one, values))
        shares.append(np.mean([check.inside for check in verdicts.check_claims(cube, stated)]))
    expected = float(power["power_expected"].sel(chapter=3)) / len(CLAIMS)
    conforms.sampled(np.mean(shares), expected, atol=0.03)
    conforms.sampled(expected, above=0.9, below=1)


def test_the_page_says_what_the_numbers_of_the_ledger_say():
    """Its words on chapters 3, 4 and 6, from the table that its notebook holds."""
    notebook = json.loads((files.project_root() / "notebooks/claims.ipynb").read_text("utf-8"))
    (cell,) = [c for c in notebook["cells"] if '"power")' in "".join(c["source"])]
    text = "".join(cell["outputs"][0]["data"]["text/markdown"])
    rows = [[one.strip() for one in line.split("|")[1:-1]] for line in text.splitlines()]
    found = {row[0]: dict(zip(rows[0][1:], row[1:], strict=True)) for row in rows[2:5]}
    share = {
        (chapter, name): float(cell.rstrip("%"))
        for chapter, row in found.items()
        for name, cell in row.items()
        if cell.endswith("%")
    }
    misses, expected = map(int, re.findall(r"\d+", found["chapter 3"]["misses (expected)"]))
    assert misses > 5 * expected
    assert max(share["chapter 4", f"errors ×{f}"] for f in ("0.7", "1.5")) < 30
    assert share["chapter 6", "errors ×1"] - share["chapter 6", "errors ×2"] < 5
