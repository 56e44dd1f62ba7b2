"""Packages in other versions than the lock's are reported; what they computed is not trusted."""

from thesis_lib.figure_sets import cube_file
from thesis_lib.figure_sets.registry import FIGURE_SETS
from thesis_lib.files import shipped
from thesis_lib.studies import storage

OTHER = {"numpy": "0.1"}


def test_packages_other_than_the_locks_are_reported(monkeypatch):
    assert storage.differing_packages() == []
    monkeypatch.setattr(storage, "package_versions", lambda: OTHER)
    assert storage.differing_packages()[0].startswith("numpy 0.1 is installed, the lock has ")


def test_what_results_rest_on_is_installed_for_the_book():
    """Else the tests' packages, installed after a book, would make its cubes outdated."""
    pins = (shipped() / "requirements" / "book.txt").read_text(encoding="utf-8")
    assert [one for one in storage.RESULT_PACKAGES if f"\n{one}==" not in f"\n{pins}"] == []


def test_what_other_packages_computed_is_not_trusted(monkeypatch):
    """Neither a figure set's cube nor a step of a measurement."""

    def trusted():
        cube_file.code_digest.cache_clear()
        return cube_file.code_digest(FIGURE_SETS["beam-distance"]), storage.key_of([1])

    before = trusted()
    assert trusted() == before
    monkeypatch.setattr(storage, "package_versions", lambda: OTHER)
    cube, step = trusted()
    cube_file.code_digest.cache_clear()
    assert cube != before[0]
    assert step != before[1]
