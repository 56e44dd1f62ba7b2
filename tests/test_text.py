"""Names and messages are text: nothing hidden in them, nothing acts on a screen or is missing."""

import jinja2
import pytest
from hypothesis import given, strategies as st

from thesis_lib import templates, text
from thesis_lib.figure_sets.registry import validate_request
from thesis_lib.planning.structure_file import StructureFileError, read_body
from thesis_lib.runs.command_line import parse_assignments
from thesis_lib.studies.request import ParameterError
from thesis_lib.text import RefusedError

LAYOUT = [[[80, 10], [-80, 10]]]
HIDDEN = ["\0", "\x1b", "\u202e", "\u200b", "\u2028", "\ue000", "\udc80"]


@pytest.mark.parametrize("character", HIDDEN)
def test_a_name_has_no_hidden_character(character):
    for name in (character, f"a{character}b"):
        with pytest.raises(ParameterError, match=r"layouts") as refused:
            validate_request("beam-arrays", {"layouts": {name: LAYOUT}})
        assert str(refused.value).isprintable()
        assert text.has_hidden(name)


def test_what_everybody_sees_is_a_name():
    layouts = dict.fromkeys(["é ∅ ü", "梁の形", "Ω₁", "e\u0301"], LAYOUT)
    assert {*validate_request("beam-arrays", {"layouts": layouts}).layouts} == {*layouts}


def test_a_structure_file_whose_name_hides_something_is_refused(tmp_path):
    with pytest.raises(StructureFileError, match="a visible name"):
        read_body(tmp_path / "a\u202eb.nc", [1])


@pytest.mark.parametrize(
    "given_json",
    ['{"a": 1, "a": 2}', '{"a": {"b": 1, "b": 2}}', '[{"a": 1}, {"\\u0061": 1, "a": 2}]'],
)
def test_a_key_twice_is_refused_at_any_depth(given_json):
    with pytest.raises(RefusedError, match="twice"):
        parse_assignments([f"layouts={given_json}"])


@given(st.text(st.characters(exclude_categories=[]), max_size=2000))
def test_a_message_is_one_short_line_that_acts_on_nothing(said):
    shown = text.message(said)
    assert shown.isprintable()
    assert len(shown) <= text.MAX_MESSAGE_LENGTH
    assert len(text.one_line(said)) <= 60


def test_missing_value_is_an_error(tmp_path):
    (tmp_path / "templates").mkdir()
    (tmp_path / "templates" / "piece.md").write_text("The power is {{ power }}.", encoding="utf-8")
    templates._environment.cache_clear()
    with pytest.raises(jinja2.UndefinedError, match="power"):
        templates.render(tmp_path / "module.py", "piece")
