"""The page of errata: its code runs, its items are complete, its links lead somewhere."""

import doctest
import re
from pathlib import Path

BOOK = Path(__file__).parents[2] / "book"
PAGE = BOOK / "errata.md"
TEXT = PAGE.read_text(encoding="utf-8")
ITEM = re.compile(
    r"^\(errata-([aebc]\d+)\)=\n### (\w+)\. ([^\n]+)\n(.*?)(?=^\(errata-|\Z)", re.M | re.S
)
ITEMS = ITEM.findall(TEXT)


def code_only(text: str) -> str:
    """The page's pycon blocks on the lines where they stand, all other lines empty."""
    kept, inside = [], False
    for line in text.splitlines():
        fence = line.startswith("```")
        inside = line == "```pycon" if fence else inside
        kept.append(line if inside and not fence else "")
    return "\n".join(kept) + "\n"


def test_code_prints_what_the_page_says():
    test = doctest.DocTestParser().get_doctest(code_only(TEXT), {}, PAGE.name, str(PAGE), 0)
    report: list[str] = []
    result = doctest.DocTestRunner(verbose=False).run(test, out=report.append)
    assert result.attempted > 60
    assert not result.failed, "".join(report)


def test_no_code_is_left_out_and_none_is_wider_than_a_phone():
    code = code_only(TEXT).splitlines()
    assert TEXT.count("\n>>> ") == sum(line.startswith(">>> ") for line in code)
    assert [line for line in code if len(line) > 72] == []


def test_every_heading_of_an_item_has_its_anchor():
    assert len(ITEMS) == len(re.findall(r"^###", TEXT, re.M)) > 50
    assert [anchor for anchor, label, *_ in ITEMS if anchor != label.lower()] == []


def test_anchors_are_unique_in_the_book():
    pages = "\n".join(page.read_text(encoding="utf-8") for page in BOOK.glob("*.md"))
    anchors = re.findall(r"^\(([\w-]+)\)=$", pages, re.M)
    assert len(anchors) == len(set(anchors))


def test_items_say_where_what_is_printed_what_it_should_be_why_and_what_it_does():
    leads = ["Place", "Printed", "Should be", "Why", "Effect"]
    for _, label, _, body in ITEMS:
        words = re.findall(r"\*\*([\w\s]+)\.\*\*", body)
        assert [" ".join(word.split()) for word in words] == leads, label


def test_links_within_the_page_lead_somewhere():
    anchors = set(re.findall(r"^\((errata-[\w-]+)\)=$", TEXT, re.M))
    assert set(re.findall(r"\]\((errata-[^)]*)\)", TEXT)) <= anchors
    for page in re.findall(r"\]\((\w[\w./-]*\.md)\)", TEXT):
        assert (BOOK / page).is_file(), page


def test_table_counts_the_items():
    stated = re.findall(r"^\| (\w)\. .*?\| (\d+) \| (\d+) \|$", TEXT, re.M)
    for group, items, unsettled in stated:
        titles = [title for _, label, title, _ in ITEMS if label[0] == group]
        assert len(titles) == int(items), group
        assert sum(title.endswith("(open)") for title in titles) == int(unsettled), group
    assert len(stated) == 4
