"""Templates: a value that is missing is an error."""

import jinja2
import pytest

from thesis_lib import templates


def test_missing_value_is_an_error(tmp_path):
    (tmp_path / "templates").mkdir()
    (tmp_path / "templates" / "piece.md").write_text("The power is {{ power }}.", encoding="utf-8")
    templates._environment.cache_clear()
    with pytest.raises(jinja2.UndefinedError, match="power"):
        templates.render(tmp_path / "module.py", "piece")
