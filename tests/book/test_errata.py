"""The page of errata: its code runs, its items are complete, its links lead somewhere."""

import doctest
import re
from pathlib import Path

import pytest

BOOK = Path(__file__).parents[2] / "book"
PAGE = BOOK / "errata.md"
TEXT = PAGE.read_text(encoding="utf-8")


@pytest.mark.slow
def test_code_prints_what_the_page_says():
    """In pycon blocks, on the lines where they stand; all other lines are empty."""
    kept, inside = [], False
    for line in TEXT.splitlines():
        fence = line.startswith("```")
        inside = line == "```pycon" if fence else inside
        kept.append(line if inside and not fence else "")
    code = "\n".join(kept) + "\n"
    assert TEXT.count("\n>>> ") == code.count("\n>>> ")  # none is left out
    test = doctest.DocTestParser().get_doctest(code, {}, PAGE.name, str(PAGE), 0)
    report = []
    result = doctest.DocTestRunner(verbose=False).run(test, out=report.append)
    assert result.attempted > 60
    assert not result.failed, "".join(report)


def test_table_counts_the_items():
    items = re.findall(r"^\(errata-([aebc])\d+\)=\n### .*?(\(open\))?$", TEXT, re.M)
    stated = re.findall(r"^\| (\w)\. .*?\| (\d+) \| (\d+) \|$", TEXT, re.M)
    assert len(stated) == 4
    for group, number, unsettled in stated:
        marks = [mark for name, mark in items if name == group.lower()]
        assert (len(marks), len([*filter(None, marks)])) == (int(number), int(unsettled)), group
