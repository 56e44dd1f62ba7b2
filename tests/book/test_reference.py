"""The pages on own recordings tell of every field, warning, note and error."""

import ast
import re
from string import Formatter

import numpy as np
import pytest
import yaml

from thesis_lib.book.pieces import manifest as reference
from thesis_lib.files import project_root
from thesis_lib.measure.feasibility.assess import assess_manifest
from thesis_lib.measure.messages import ALL_MESSAGES, CHECK_GROUPS, NOTE_GROUPS
from thesis_lib.measure.recordings.manifest import read_manifest
from thesis_lib.studies import fields

NAMES = ("recordings", "recordings-filming", "recordings-results", "recordings-warnings",
         "recordings-reference")  # fmt: skip
PAGE = "".join((project_root() / "book" / f"{name}.md").read_text("utf-8") for name in NAMES)
SOURCES = project_root() / "src" / "thesis_lib"


def terms(part):
    """Terms and explanations of a Markdown definition list."""
    return re.findall(r"^(\S.*)\n: (.*(?:\n  .*)*)", part, flags=re.MULTILINE)


def made():
    """Every note and warning that is put together in the source: code, variant, names of values."""
    for path in sorted((SOURCES / "measure").rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and ast.unparse(node.func) in ("make_note", "_warn"):
                texts = [one.value for one in node.args if isinstance(one, ast.Constant)]
                variant = texts[-1] if len(texts) > 1 and texts[-1] not in ALL_MESSAGES else ""
                names = {one.arg for one in node.keywords}
                if texts and None not in names:
                    yield texts[0], variant, names


@pytest.mark.parametrize("part", reference.MANIFEST_PARTS)
def test_every_field_is_told_with_its_default(part):
    model = reference.MANIFEST_PARTS[part]
    listed = dict(terms(reference.list_fields(part)))
    names = {re.match(r"`(\w+)` · ", term).group(1): term for term in listed}
    assert list(names) == list(model.model_fields)
    for name, field in model.model_fields.items():
        term = names[name].split(" · ")[1]
        assert term.startswith("required") == field.is_required()
        assert fields.describe_field(model, name)[1:] in listed[names[name]]


def test_defaults_are_those_that_an_empty_manifest_gets():
    for part in ("structure", "markers", "board", "excitation"):
        made = reference.MANIFEST_PARTS[part]().model_dump(mode="json")
        for term, _ in terms(reference.list_fields(part)):
            name, shown = re.match(r"`(\w+)` · (.*)", term).groups()
            if shown != "its fields below":
                unit = re.escape(fields.unit_of_field(name))
                text = re.sub(rf"( {unit}|, else in {unit})$", "", shown) if unit else shown
                assert yaml.safe_load(text) == made[name], term


def test_messages_and_their_values_fit():
    told = list(made())
    assert len(told) > 40  # those of tables are made one by one in test_feasibility
    for code, variant, names in told:
        message = ALL_MESSAGES[code]
        text = message.variants.get(variant, message.text)
        fields = {name for _, name, _, _ in Formatter().parse(text) if name} - {"limit"}
        assert fields <= names, code
    words = " ".join(path.read_text("utf-8") for path in (SOURCES / "measure").rglob("*.py"))
    assert [code for code in ALL_MESSAGES if f'"{code}"' not in words] == []


def test_the_book_lists_every_message_once_with_meaning_limit_and_remedy():
    anchors = re.findall(r"\{#([\w-]+)\}", "".join(piece() for piece in reference.PIECES.values()))
    assert sorted(anchors) == sorted(ALL_MESSAGES)
    groups = [*NOTE_GROUPS.values(), *CHECK_GROUPS.values()]
    assert len(ALL_MESSAGES) == sum(map(len, groups))  # none twice
    listed = {
        re.match(r"\[`([\w-]+)`\]", term)[1]: (term, words)
        for name in reference.PIECES
        for term, words in terms(reference.PIECES[name]())
        if term.startswith("[`")
    }
    for code, message in ALL_MESSAGES.items():
        term, words = listed[code]
        assert message.meaning in words
        assert words.endswith(message.remedy)
        assert not message.unit or f" {message.limit:g}" in term


def test_the_manifest_on_the_page_is_valid_and_brings_no_warning(tmp_path):
    text, plate = re.findall(r"```yaml\n(.*?)```", PAGE, flags=re.DOTALL)
    path = tmp_path / "manifest.yaml"
    path.write_text(text, encoding="utf-8")
    manifest = read_manifest(path, check_files=False)
    assessment = assess_manifest(manifest)
    assert assessment.warnings == ()
    assert np.isfinite(assessment.rig.smallest_mm)
    assert manifest.structure.youngs_modulus_pa == 2.1e11

    with_plate = tmp_path / "plate.yaml"
    with_plate.write_text(plate + text[text.index("cameras:") :], encoding="utf-8")
    structure = read_manifest(with_plate, check_files=False).structure
    assert structure.kind == "plate"
    assert structure.markers.rows * structure.markers.columns == 96
    for number in ("210e9", "2.1E+11"):  # a power of ten, as the page says
        path.write_text(text.replace("2.1e+11", number), encoding="utf-8")
        assert read_manifest(path, check_files=False).structure.youngs_modulus_pa == 2.1e11


def test_what_the_page_says_of_fields_is_in_the_models():
    fields = {name for model in reference.MANIFEST_PARTS.values() for name in model.model_fields}
    parts = set(reference.MANIFEST_PARTS) | {"structure.markers"}
    for name in re.findall(r"`([a-z]+_[a-z_]+)(?:: \w+)?`", PAGE):
        if name not in {"without_camera", "standard_error", "cameras_seen"}:  # of the results
            assert name in fields | parts, name


def test_sides_and_elevations_are_as_the_page_says():
    one_side = reference.assess_layout((-10, 10), 25.0).rig.one_frame[0]
    opposite = reference.assess_layout((0, 180), 25.0).rig.one_frame[0]
    assert one_side > 2 * opposite
    low, high = (reference.assess_layout((0, 180), phi).table[0] for phi in (15.0, 35.0))
    assert low.across_px < high.across_px
    assert low.move_spacings > high.move_spacings
