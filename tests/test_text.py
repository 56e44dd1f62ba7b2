"""Names and messages are text: nothing hidden in them, nothing that acts on a screen."""

from __future__ import annotations

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from thesis_lib import cli, text
from thesis_lib.figure_sets.registry import validate
from thesis_lib.measure.recordings.manifest import ManifestError, read_manifest
from thesis_lib.planning.structure_file import MeshError, read_body
from thesis_lib.runs.requested import Refused, assigned_values
from thesis_lib.studies.request import ParameterError

HIDDEN = {
    "\0": "U+0000", "\x1b": "U+001B", "\t": "U+0009", "\x9b": "U+009B", "\u202e": "U+202E",
    "\u200b": "U+200B", "\u2060": "U+2060", "\ufeff": "U+FEFF", "\u2028": "U+2028",
    "\u2029": "U+2029", "\u00ad": "U+00AD", "\ue000": "U+E000", "\udc80": r"a\udc80b",
    "\u3164": "U+3164", "\u2800": "U+2800", "\ufe0f": "U+FE0F", "\U000e0041": "U+E0041",
    "\U0010ffff": "U+10FFFF", "\u034f": "U+034F",
}  # fmt: skip
LAYOUT = [[[80, 10], [-80, 10]]]


@pytest.mark.parametrize("character", HIDDEN)
def test_what_nobody_sees_is_refused_by_its_number(character):
    hiding = {f"a{character}b": LAYOUT}
    for layouts, words in (hiding, HIDDEN[character]), ({"a": character}, "allowed: "):
        with pytest.raises(ParameterError, match=r"layouts") as refused:
            validate("beam-arrays", {"layouts": layouts})
        assert words in str(refused.value)
        assert str(refused.value).isprintable()


@pytest.mark.parametrize("name", ["é ∅ ü", "梁の形", "a b", "Ω₁", "naïve", "e\u0301"])
def test_what_everybody_sees_is_a_name(name):
    assert name in validate("beam-arrays", {"layouts": {name: LAYOUT}}).layouts


def test_hidden_parts_of_a_manifest_are_refused(tmp_path):
    path = tmp_path / "m.yaml"
    for line in ('a: ["x", "\\u200b"]', '"\\e[31m": 1', "cameras: [{name: 'a\u202eb'}]"):
        path.write_text(line, encoding="utf-8")
        with pytest.raises(ManifestError, match=r"U\+") as refused:
            read_manifest(path)
        assert str(refused.value).isprintable()


def test_a_structure_file_whose_name_hides_something_is_refused(tmp_path):
    with pytest.raises(MeshError, match=r"U\+202E"):
        read_body(tmp_path / "a\u202eb.nc", [1])


@pytest.mark.parametrize(
    "given_json",
    ['{"a": 1, "a": 2}', '{"a": {"b": 1, "b": 2}}', '[{"a": 1}, {"\\u0061": 1, "a": 2}]'],
)
def test_a_key_twice_is_refused_at_any_depth(given_json):
    with pytest.raises(Refused, match="twice"):
        assigned_values([f"layouts={given_json}"])
    assert assigned_values(["layouts={}"]) == {"layouts": {}}


@given(st.text(st.characters(exclude_categories=[]), max_size=2000))
def test_a_message_is_one_short_line_that_acts_on_nothing(said):
    shown = text.message(said)
    assert shown.isprintable()
    assert len(shown) <= text.LONGEST
    assert len(text.one_line(said)) <= 60
    problem = text.first_hidden({said: [said]})
    assert problem.isprintable()
    assert bool(problem) == bool(text.hidden(said))


@given(st.recursive(st.text(), lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner)))
def test_every_text_in_plain_values_is_looked_at(values):
    said = json.dumps(values, ensure_ascii=False)
    assert all(json.dumps(t, ensure_ascii=False)[1:-1] in said for _, t in text.strings(values)
               if t != "a field's name")  # fmt: skip


def test_a_package_that_is_missing_is_told_with_what_installs_it():
    said = cli._said(ModuleNotFoundError("No module named 'lxml'", name="lxml.html"))
    assert said == "needs the package lxml: pip install 'thesis-lib[book]'"
    assert cli._said(KeyError("case")) == "KeyError: 'case'"
