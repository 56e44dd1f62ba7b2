"""A small book from end to end: downloads, research object, one zip, and what fails."""

import json
import re
import shutil
import zipfile

import nbformat
import pytest

pytest.importorskip("jupyter_book", reason="the book needs jupyter-book")
pytest.importorskip("rocrate", reason="the book's description needs rocrate")

from rocrate.rocrate import ROCrate
from small_book import BAD, GOOD, make

from thesis_lib.book import rendering
from thesis_lib.book.pieces.opened import SETS_IN_CHAPTERS
from thesis_lib.figure_sets import cube_file
from thesis_lib.figure_sets.registry import validate_request
from thesis_lib.files import sha256


@pytest.fixture(scope="module")
def whole(small):
    done = make(small)
    assert done.returncode == 0, done.stdout + done.stderr
    copy = shutil.copytree(small.root / "build" / "html", small.root / "whole")
    shutil.copy(small.root / "build" / f"{rendering.ARCHIVE_NAME}.zip", small.root)
    return copy


def page(book, name):
    return (book / "executed" / f"{name}.html").read_text(encoding="utf-8")


@pytest.mark.book
def test_every_download_is_there_and_is_what_the_page_says(whole):
    for name in (GOOD, BAD):
        text = page(whole, name)
        links = re.findall(r'download="[^"]+" href="\.\./([^"]+)"', text)
        assert len(links) == 3 + 2
        assert all((whole / link).stat().st_size > 100 for link in links)
        digest = sha256(whole / "data" / f"{name}.nc")
        assert digest in text
        cube = cube_file.read_cube(whole / "data" / f"{name}.nc")
        assert cube.attrs["figure_set"] == name
        assert f'id="provenance-{name}"' in text
        assert text.count(f'href="#provenance-{name}"') == 3


@pytest.mark.book
def test_offered_notebooks_hold_their_text_and_no_pictures(whole):
    for path in (whole / "_sources" / "executed").glob("*.ipynb"):
        document = nbformat.read(path, as_version=4)
        kinds = {k for c in document.cells for o in c.get("outputs", []) for k in o.get("data", {})}
        assert kinds == {"text/plain", "text/markdown"}
        assert path.stat().st_size < 100_000


@pytest.mark.book
def test_research_object_reads_back_and_tells_every_run(whole, monkeypatch):
    found = ROCrate(whole)
    root = found.root_dataset
    assert root["conformsTo"].id == rendering.CRATE_PROFILE
    assert root["license"].id == rendering.LICENSE_ADDRESS
    assert re.match(r"20\d\d-", str(root["datePublished"]))
    actions = root["mentions"]
    assert {action.id for action in actions} == {f"#run-{name}" for name in (GOOD, BAD)}
    for action in actions:
        name = action.id.removeprefix("#run-")
        assert action.type == "CreateAction"
        assert action["startTime"] < action["endTime"]
        tool = action["instrument"]
        assert tool.type == "SoftwareApplication"
        assert "commit" in tool["softwareVersion"]
        values = {e["name"]: e["value"] for e in action["object"] if e.type == "PropertyValue"}
        request = validate_request(name, {}).request
        assert set(values) == set(request)
        assert json.loads(values["modes"]) == request["modes"]
        results = {entity.id for entity in action["result"]}
        assert {f"data/{name}.nc", f"executed/{name}.html"} <= results
        for entity in action["result"]:
            assert (whole / entity.id).is_file()
            if entity.id.endswith(".nc"):
                assert entity["sha256"] == sha256(whole / entity.id)
    document = json.loads((whole / rendering.CRATE_NAME).read_text(encoding="utf-8"))
    described = {entity["@id"] for entity in document["@graph"]}
    for entity in document["@graph"]:  # whatever is referred to is described
        for value in entity.values():
            for one in value if isinstance(value, list) else [value]:
                if isinstance(one, dict) and not one["@id"].startswith("https://w3id.org/ro/crate"):
                    assert one["@id"] in described
    monkeypatch.setitem(SETS_IN_CHAPTERS, GOOD, "intro")  # as a set without a page of its own
    ran = whole / "_sources" / "executed" / f"{GOOD}.ipynb", whole / "data" / f"{GOOD}.nc"
    assert rendering._describe_run(whole, *ran)["files"][-1]["place"] == "intro.html"


@pytest.mark.book
def test_zip_is_the_book_and_the_same_for_the_same_book(whole, small, tmp_path):
    made = small.root / f"{rendering.ARCHIVE_NAME}.zip"
    again = tmp_path / "again.zip"
    rendering.pack_book(whole, again)
    assert again.read_bytes() == made.read_bytes()
    with zipfile.ZipFile(made) as packed:
        names = packed.namelist()
        assert names == sorted(names)
        assert len({entry.date_time for entry in packed.infolist()}) == 1
        assert f"{rendering.ARCHIVE_NAME}/index.html" in names
        assert f"{rendering.ARCHIVE_NAME}/{rendering.CRATE_NAME}" in names
        inside = packed.read(f"{rendering.ARCHIVE_NAME}/data/{GOOD}.nc")
    assert inside == (whole / "data" / f"{GOOD}.nc").read_bytes()


@pytest.mark.nightly
@pytest.mark.book
def test_failing_set_says_so_in_its_page_and_the_rest_is_built(whole, small):
    def breaks(document):
        viewer = next(cell for cell in document.cells if cell.id == "beam-distance-04")
        viewer.source = "raise RuntimeError('<b>the lamp</b> went out')"

    kept = small.notebook(BAD).read_bytes()
    small.change(BAD, breaks)
    failed = make(small)
    book = small.root / "build" / "html"
    assert failed.returncode == 1
    last = failed.stderr.strip().splitlines()[-2:]
    assert last[0].startswith(f"thesis: {BAD}: cell ")
    assert last[1] == f"the book without these is {book / 'index.html'}"
    text = page(book, BAD)
    assert "<title>Distance" in text
    assert "&lt;b&gt;the lamp&lt;/b&gt; went out" in text
    assert f"thesis run {BAD}" in re.sub(r"<[^>]+>", "", text)
    assert str(small.root) not in text
    assert 'id="fig-3-4"' in text
    assert f"{BAD}.nc" not in text
    assert "provenance" in page(book, GOOD)
    assert not (book / "data" / f"{BAD}.nc").exists()
    assert (book / "data" / f"{GOOD}.nc").exists()
    intro = (book / "intro.html").read_text(encoding="utf-8")
    assert re.search(f"did not run: .*{BAD}", intro)
    assert [one.id for one in ROCrate(book).root_dataset["mentions"]] == [f"#run-{GOOD}"]
    small.notebook(BAD).write_bytes(kept)
    mended = make(small)
    assert mended.returncode == 0, mended.stdout + mended.stderr
    assert f"{GOOD}: running" not in mended.stderr
    assert "went out" not in page(book, BAD)
    assert (book / "data" / f"{BAD}.nc").exists()


@pytest.mark.nightly
@pytest.mark.book
def test_a_lost_reference_is_reported_until_it_is_mended_and_edits_show(whole, small):
    intro, made = (small.root / name for name in ("book/intro.md", "build/html/intro.html"))
    text, before = intro.read_text(encoding="utf-8"), made.read_bytes()
    intro.write_text(f"{text}\n[Lost](nowhere)\n", encoding="utf-8")
    for _ in range(2):  # nor is it forgotten
        lost = make(small)
        assert lost.returncode == 1
        assert re.search(r"intro\.md.*nowhere", lost.stderr)
        assert made.read_bytes() == before
    intro.write_text(f"{text}\nNew words\n", encoding="utf-8")
    assert make(small).returncode == 0
    assert "New words" in made.read_text(encoding="utf-8")
