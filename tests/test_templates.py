"""Templates: values stand where the template names them, and one that is missing is an error."""

import jinja2
import pytest
import xarray as xr

from thesis_lib import templates


@pytest.fixture
def fill(tmp_path):
    """Render a text as the template next to a module."""

    def render(text: str, **values: object) -> str:
        (tmp_path / "templates").mkdir(exist_ok=True)
        (tmp_path / "templates" / "piece.md").write_text(text, encoding="utf-8")
        templates._environment.cache_clear()
        return templates.render(tmp_path / "module.py", "piece", **values)

    return render


def test_arrays_of_one_value_are_formatted(fill):
    cube = xr.Dataset({"tone": ("structure", [12.345, 50.0])}, {"structure": ["plate", "disc"]})
    text = (
        "{{ cube.tone.sel(structure='plate') | number('.1f') }} Hz, {{ cube.tone | rms | number }}"
    )
    assert fill(text, cube=cube) == "12.3 Hz, 36"


def test_missing_value_is_an_error(fill):
    with pytest.raises(jinja2.UndefinedError, match="power"):
        fill("The power is {{ power }}.")
