"""CITATION.cff: what the format asks for, and nothing invented."""

import datetime
from pathlib import Path

import yaml

from thesis_lib import __version__

ROOT = Path(__file__).parents[1]


def test_citation_file_is_valid():
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert {"cff-version", "message", "title", "authors"} <= set(cited)
    assert str(cited["version"]) == __version__
    assert isinstance(cited["date-released"], datetime.date)
    assert cited["license"] == "MIT"
    for author in cited["authors"]:  # a group: no person's name is known
        assert "name" in author
