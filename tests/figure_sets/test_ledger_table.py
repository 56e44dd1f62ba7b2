"""The table of claims: safe to inline, and usable in a real browser from a local file."""

import re

import pytest
from browser import focused, open_offline, tab_through, write_page

from thesis_lib.figure_sets.claims.figures import LedgerTable
from thesis_lib.ledger.verdicts import VERDICTS

EVIL = "</script><script>alert(1)</script><!-- \u2028 <img src=x onerror=alert(2)> & ]]>"
KINDS = ("figure", "trend", "number")
CASES = ("", "1", "2a", "2b, 2c", "4a'")
COUNT = 408


def row(i):
    """A plausible claim by formula."""
    kind, verdict = KINDS[i % 7 % 3], VERDICTS[i % 11 % 5]
    chapter = 2 + i * 4 // COUNT
    stated = f"{3 + i % 100} %"
    return {
        "id": f"ch{chapter}-claim-{i}", "kind": kind, "chapter": chapter, "case": CASES[i % 5],
        "modes": [[1], [2], [1, 2, 3], []][i % 4],
        "what": f"mean error at d = {100 * i} mm" if kind != "trend" else
                "The mean error falls significantly when pairs of larger aperture are added.",
        "stated": stated, "got": "" if verdict == "undefined" else f"{4 + i % 100}.4 (3.1–12.9)",
        "verdict": verdict, "ratio": None if verdict == "undefined" else 0.5 + i * 37 % 101 / 50,
        "note": "The text and the figure name different pairs." if i % 3 == 0 else "",
        "href": f"beam-distance.html#fig-{chapter}-{i}",
        "place": f"figure {chapter}.{1 + i * 7 % 40}",
        "command": "thesis run beam-distance" if i % 2 == 0 else "", "counted": chapter != 5,
        "note_href": "../errata.html#errata-a6" if i % 6 == 3 else "",
        "step_back": "2.16 at 1280 but 2.41 at 1920" if i % 50 == 7 else "",
    }  # fmt: skip


ROWS = [row(i) for i in range(COUNT)]


# --- in a browser


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    file = tmp_path_factory.mktemp("ledger") / "the claims.html"
    return write_page(file, "<h1 id='top'>Claims</h1>", LedgerTable(data={"rows": ROWS}))


def box(opened, label):
    kind = "searchbox" if label == "Search" else "combobox"
    return opened.page.get_by_role(kind, name=label, exact=True)


def pick(opened, label, value):
    box(opened, label).select_option(value)


def shown(opened):
    """Numbers of the rows in sight, in their order."""
    ids = opened.page.evaluate(
        "[...document.querySelectorAll('.tl-ledger tbody')].filter(e => e.offsetHeight)"
        ".map(e => e.id)"
    )
    return [int(re.sub(r".*-", "", one)) for one in ids]


def count(opened):
    return opened.page.locator(".tl-ledger-count").inner_text()


def those(**wanted):
    return [i for i, one in enumerate(ROWS) if all(one[k] == v for k, v in wanted.items())]


def is_counted(opened, numbers):
    """Whether what is said of the rows in sight has their number, by verdict, and not counted."""
    counted = [ROWS[i]["verdict"] for i in numbers if ROWS[i]["counted"]]
    told = [len(numbers), COUNT, *(counted.count(verdict) for verdict in VERDICTS)]
    if len(counted) < len(numbers):
        told.append(len(numbers) - len(counted))
    return [int(one) for one in re.findall(r"\d+", count(opened))] == told


def claim(opened, i):
    return opened.page.locator(f"[id='claim-{ROWS[i]['id']}']")


def test_filters_and_a_search_combine_and_are_counted(chromium, path):
    with open_offline(chromium, path) as opened:
        everything = list(range(COUNT))
        assert shown(opened) == everything
        assert is_counted(opened, everything)
        pick(opened, "Chapter", "3")
        assert is_counted(opened, those(chapter=3))
        pick(opened, "Verdict", "differs")
        pick(opened, "Case", "2c")  # one of several
        assert shown(opened) == those(chapter=3, verdict="differs", case="2b, 2c")
        pick(opened, "Mode", "3")
        wanted = those(chapter=3, verdict="differs", case="2b, 2c", modes=[1, 2, 3])
        assert shown(opened) == wanted
        opened.page.get_by_role("button", name="Reset").click()
        assert shown(opened) == everything
        search = box(opened, "Search")
        for words, found in (
            ("CH3-Claim-150", [150]),  # id
            ("d = 40100", [401]),  # what
            ("text AND the figure", [i for i in range(COUNT) if i % 3 == 0]),  # note
            ("thesis run", []),  # not the command
            ("mm 5 %", []),  # not across texts
        ):
            search.fill(words)
            assert shown(opened) == found, words
        search.fill("")
        assert shown(opened) == everything
        assert opened.page.url == path.resolve().as_uri()


def test_the_last_are_folded_until_asked_for(chromium, tmp_path):
    table = LedgerTable(data={"rows": ROWS[:30], "folded": 10})
    with open_offline(chromium, write_page(tmp_path / "folded.html", table)) as opened:
        fold = opened.page.locator(".tl-ledger-fold")
        assert shown(opened) == list(range(20))
        fold.click()
        assert shown(opened) == list(range(30))
        fold.click()
        box(opened, "Search").fill(f"d = {100 * 28} mm")  # a search looks everywhere
        assert shown(opened) == [28]


def test_sorting(chromium, path):
    with open_offline(chromium, path) as opened:
        pick(opened, "Chapter", "3")
        rows = those(chapter=3)

        def press(name):
            button = opened.page.get_by_role("button", name=name, exact=True)
            button.click()
            states = opened.page.locator("th[aria-sort]").evaluate_all(
                "all => all.map(e => e.ariaSort)"
            )
            return shown(opened), states

        number = {i: int(ROWS[i]["place"].split(".")[1]) for i in rows}
        by_place = sorted(rows, key=number.__getitem__)
        assert press("Place") == (by_place, ["ascending", "none", "none"])
        known = [i for i in rows if ROWS[i]["ratio"] is not None]
        unknown = those(chapter=3, ratio=None)
        assert unknown
        up = sorted(known, key=lambda i: ROWS[i]["ratio"]) + unknown
        assert press("Ratio") == (up, ["none", "none", "ascending"])
        down = sorted(known, key=lambda i: -ROWS[i]["ratio"]) + unknown
        assert press("Ratio") == (down, ["none", "none", "descending"])
        pick(opened, "Verdict", "differs")  # a filter keeps the order
        assert shown(opened) == [i for i in down if ROWS[i]["verdict"] == "differs"]
        opened.page.get_by_role("button", name="Reset").click()
        assert shown(opened) == list(range(COUNT))


def test_the_address_keeps_the_filters(chromium, path):
    start = path.resolve().as_uri()
    with open_offline(chromium, path, query="chapter=3&other=1#top") as opened:
        assert shown(opened) == those(chapter=3)
        pick(opened, "Verdict", "within scatter")
        pick(opened, "Case", "4a'")
        search = box(opened, "Search")
        search.fill("mm & “ü”")
        search.press("Enter")
        search.blur()
        address = opened.page.url
        assert re.fullmatch(
            r".*\?chapter=3&case=4a%27&verdict=within\+scatter&search=mm\+%26\+.*&other=1#top",
            address,
        )
        search.fill("mm")
        search.blur()
        wanted = shown(opened)
        assert wanted == [i for i in those(chapter=3, verdict="within scatter", case="4a'")
                          if "mm" in ROWS[i]["what"]]  # fmt: skip
        opened.page.reload()
        assert shown(opened) == wanted
        assert search.input_value() == "mm"
        ratio = opened.page.get_by_role("columnheader", name="Ratio")
        ratio.get_by_role("button").click(click_count=2)
        opened.page.reload()
        assert ratio.get_attribute("aria-sort") == "descending"
        opened.page.get_by_role("button", name="Reset").click()
        assert opened.page.url == f"{start}?other=1#top"


def test_a_link_to_a_claim_shows_it(chromium, path):
    query = f"chapter=2&verdict=agrees#claim-{ROWS[333]['id']}"
    with open_offline(chromium, path, query=query, width=390) as opened:
        assert shown(opened) == [*those(chapter=2, verdict="agrees"), 333]
        assert count(opened).endswith("; one is shown by its link")
        place = claim(opened, 333).bounding_box()
        assert 0 < place["y"] < 850
        pick(opened, "Verdict", "")  # the reader's own choice ends the exception
        assert shown(opened) == those(chapter=2)
        assert opened.page.url.endswith("?chapter=2")
        opened.page.evaluate("name => { location.hash = `claim-${name}`; }", ROWS[400]["id"])
        claim(opened, 400).and_(opened.page.locator("[aria-current=true]")).wait_for()
        assert shown(opened) == [*those(chapter=2), 400]
    with open_offline(chromium, path, query=f"#claim-{ROWS[207]['id']}") as opened:
        place = claim(opened, 207).bounding_box()  # among rows that were never drawn
        assert 0 < place["y"] < 850


def test_words_of_the_data_stay_words(chromium, tmp_path):
    texts = ("case", "what", "stated", "got", "note", "place", "command", "kind")
    evil = {**ROWS[0], **dict.fromkeys(texts, EVIL), "href": "java\nscript:alert(3)"}
    rows = [evil, {**ROWS[1], "href": "", "place": "section 2"}]
    file = write_page(tmp_path / "evil.html", LedgerTable(data={"rows": rows}))
    with open_offline(chromium, file, query="search=%3Cscript%3E") as opened:
        opened.page.on("dialog", lambda dialog: opened.console.append(dialog.message))
        first, second = opened.page.locator("tbody").all()
        assert first.is_visible()
        assert not second.is_visible()
        first.locator(".tl-ledger-more button").click()
        for name in ("what", "stated", "got", "place", "case"):
            assert first.locator(f".tl-ledger-{name}").text_content() == EVIL
        assert EVIL in str(first.locator(".tl-ledger-second").text_content())
        assert first.locator("img, script").count() == 0
        assert first.locator(".tl-ledger-place a").count() == 0
        assert second.locator(".tl-ledger-place").text_content() == "section 2"
        assert second.locator(".tl-ledger-place a").count() == 0
        assert opened.page.locator(".tl-ledger").inner_html().count("<script") == 0


def test_a_row_says_what_is_stated_and_why_it_differs(chromium, path):
    with open_offline(chromium, path) as opened:
        cells = claim(opened, 6).locator("td, th")
        assert [one.strip() for one in cells.all_inner_texts()] == [
            ROWS[6]["place"], "1", "1, 2, 3", ROWS[6]["what"], "9 %", "10.4 (3.1–12.9)",
            ROWS[6]["verdict"], f"{ROWS[6]['ratio']:.2f}", "note",
        ]  # fmt: skip
        assert cells.first.locator("a").get_attribute("href") == ROWS[6]["href"]
        assert claim(opened, 400).locator("sup").text_content() == "†"  # not counted
        shapes = {
            verdict: claim(opened, those(verdict=verdict)[0])
            .locator(".tl-ledger-verdict path")
            .get_attribute("d")
            for verdict in VERDICTS
        }
        assert len(set(shapes.values())) == len(VERDICTS)  # never by colour alone
        one = claim(opened, 3)
        one.get_by_role("button", name=re.compile("^why about ")).click()
        second = one.locator(".tl-ledger-second")
        assert ROWS[3]["note"] in second.inner_text()
        more = second.get_by_role("link", name="More on this")
        assert more.get_attribute("href") == ROWS[3]["note_href"]
        verdict = claim(opened, 7).locator(".tl-ledger-verdict")
        assert verdict.inner_text().strip() == f"{ROWS[7]['verdict']}, not monotonic"


def test_everything_by_keyboard(chromium, path):
    with open_offline(chromium, path) as opened:
        seen = tab_through(opened, 13)
        controls = ["Chapter", "Case", "Mode", "Verdict", "Kind", "Search", "Reset", "Copy link"]
        place, what = ROWS[0]["place"], ROWS[0]["what"]
        note = f"note about {place}: {what}"
        assert seen == [*controls, "Place", "Verdict", "Ratio", place, note]
        opened.page.keyboard.press("Enter")
        assert claim(opened, 0).locator(".tl-ledger-second").is_visible()
        assert tab_through(opened, 1) == ["Copy"]
        box(opened, "Chapter").focus()
        opened.page.keyboard.press("4")
        assert shown(opened) == those(chapter=4)
        opened.page.get_by_role("button", name="Ratio").focus()
        opened.page.keyboard.press("Space")
        assert focused(opened) == "Ratio"  # sorting leaves the focus


def test_paper_gets_what_the_filters_leave(chromium, path):
    with open_offline(chromium, path, dark=True, width=700, query="chapter=3") as opened:
        opened.page.emulate_media(media="print", color_scheme="dark")
        assert shown(opened) == those(chapter=3)
        assert not box(opened, "Search").is_visible()
        assert opened.page.locator(".tl-ledger-more:visible").count() == 0
        ground = "e => getComputedStyle(e).backgroundColor"
        assert opened.page.locator(".tl-ledger").evaluate(ground) == "rgb(255, 255, 255)"
