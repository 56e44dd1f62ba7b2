"""The numbers in the book's prose are those of its cubes, and of `make test-cpus`."""

import re
from functools import cache

import cpus
import pytest

from thesis_lib import files
from thesis_lib.book.pieces import benchmarks, write as pieces_write
from thesis_lib.book.pieces.opened import Opened, select_subject
from thesis_lib.facts import claims
from thesis_lib.ledger import verdicts


@pytest.fixture(scope="module")
def opened():
    return Opened(sorted((files.project_root() / "data" / "results").glob("*.nc")))


@pytest.fixture(scope="module")
def text(opened):
    """Text of a piece by its name, as the book has it."""
    return cache(lambda name: pieces_write.PIECES[name](opened))


@pytest.mark.book
def test_pieces_have_numbers_and_no_gaps():
    for name in (*pieces_write.PIECES, *benchmarks.PIECES):
        piece = files.project_root() / "book" / "executed" / f"{name}.md"
        text = piece.read_text(encoding="utf-8")
        assert len(re.findall(r"\d", text)) > 2, name
        assert not re.search(r"\bnan\b", text, re.IGNORECASE), name


@pytest.mark.book
def test_agreement_counts_the_checks(opened, text):
    (met, total) = map(int, re.search(r"\*\*(\d+) of (\d+)\*\*", text("beam-results")).groups())
    checks = [
        check
        for cube in select_subject(opened, "beam")
        for check in verdicts.check_claims(cube, claims.claims_of(cube.attrs["figure_set"]))
        if check.claim.quantity == "mean_error"
    ]
    assert (met, total) == (sum(check.inside for check in checks), len(checks))


def test_the_conventions_promise_what_is_compared():
    text = (files.project_root() / "book" / "glossary.md").read_text(encoding="utf-8")
    section = text.partition("(the-same-on-every-machine)=")[2].partition("\n## ")[2]
    (power,) = re.findall(r"more than 10⁻([⁰¹²³⁴-⁹]) of its largest value", section)
    assert 10.0 ** -"⁰¹²³⁴⁵⁶⁷⁸⁹".index(power) == cpus.MAX_DIFFERENCES["float64"]
    (bits,) = re.findall(r"stored to (\d+) bits", section)
    assert 2.0 ** (1 - int(bits)) == cpus.MAX_DIFFERENCES["float32"]
