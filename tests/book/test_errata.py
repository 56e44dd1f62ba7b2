"""The page of errata: its code runs, its items are complete, its links lead somewhere."""

import doctest
import re
from pathlib import Path

import pytest

BOOK = Path(__file__).parents[2] / "book"
PAGE = BOOK / "errata.md"
TEXT = PAGE.read_text(encoding="utf-8")
ITEM = re.compile(
    r"^\(errata-([aebc]\d+)\)=\n### (\w+)\. ([^\n]+)\n(.*?)(?=^\(errata-|\Z)", re.M | re.S
)
ITEMS = ITEM.findall(TEXT)


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
    stated = re.findall(r"^\| (\w)\. .*?\| (\d+) \| (\d+) \|$", TEXT, re.M)
    for group, items, unsettled in stated:
        titles = [title for _, label, title, _ in ITEMS if label[0] == group]
        assert len(titles) == int(items), group
        assert sum(title.endswith("(open)") for title in titles) == int(unsettled), group
    assert len(stated) == 4
