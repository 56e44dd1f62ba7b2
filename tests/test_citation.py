"""CITATION.cff: what the format asks for, and nothing invented."""

import datetime
from pathlib import Path

import yaml

from thesis_lib import __version__

ROOT = Path(__file__).parents[1]
KEYS = {  # of the format's version 1.2.0, as far as they may be wanted here
    "abstract", "authors", "cff-version", "commit", "contact", "date-released", "doi",
    "identifiers", "keywords", "license", "license-url", "message", "preferred-citation",
    "references", "repository", "repository-artifact", "repository-code", "title", "type", "url",
    "version",
}  # fmt: skip
ENTITY = {"name", "address", "alias", "city", "country", "date-end", "date-start", "email", "fax",
          "location", "orcid", "post-code", "region", "tel", "website"}  # fmt: skip


def test_citation_file_is_valid():
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert {"cff-version", "message", "title", "authors"} <= set(cited) <= KEYS
    assert cited["cff-version"] == "1.2.0"
    assert cited["type"] in {"software", "dataset"}
    assert str(cited["version"]) == __version__
    assert isinstance(cited["date-released"], datetime.date)
    assert cited["license"] == "MIT"
    for name in ("title", "message", "abstract"):
        assert isinstance(cited[name], str)
        assert cited[name].strip()
    assert len(set(cited["keywords"])) == len(cited["keywords"]) > 0
    assert cited["authors"]
    for author in cited["authors"]:  # a group: no person's name is known
        assert "name" in author
        assert set(author) <= ENTITY
