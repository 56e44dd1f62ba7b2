"""Texts from strangers are read, or refused in one line, within a second."""

import gc
import time

import pytest
from refused import line_of

from thesis_lib.measure.exchange.cameras import read_cameras
from thesis_lib.measure.recordings import text_files
from thesis_lib.measure.recordings.manifest import ManifestError, read_manifest

N = text_files.MAX_BYTES - 10
ALIASES = "a: &a [x, x]\n" + "".join(f"a{k}: &a{k} [*a{k or ''}, *a{k or ''}]\n" for k in range(30))
HOSTILE = {
    "aliases": (text_files.parse_yaml, ALIASES),
    "300,000 values": (text_files.parse_yaml, "a: [" + "1," * 300_000 + "]"),
    "a list in a list": (text_files.parse_yaml, "[" * N),
    "sexagesimal digits": (text_files.parse_yaml, "a: 1" + ":59" * (N // 3 - 2)),
    "an object of Python": (text_files.parse_yaml, "a: !!python/object/apply:os.system [ls]"),
    "a day that is none": (text_files.parse_yaml, "a: 2026-99-99"),
    "TOML: a list in a list": (text_files.parse_toml, "a=" + "[" * N),
    "TOML: quoted parts": (text_files.parse_toml, "a" + '.","' * (N // 4 - 5) + "=1"),
    "TOML: tables in tables": (text_files.parse_toml, ("[" + "a." * 500 + "b]\n") * 900),
    "JSON: a list in a list": (text_files.parse_json, "[" * N),
    "JSON: digits": (text_files.parse_json, "9" * 9000),
    "XML: an element in an element": (text_files.parse_xml, "<a>" * (N // 7) + "</a>" * (N // 7)),
    "XML: entities": (text_files.parse_xml, "<!DOCTYPE a [<!ENTITY b 'c'>]><a>&b;</a>"),
}  # fmt: skip


@pytest.mark.parametrize("kind", HOSTILE)
def test_hostile_texts_are_refused_at_once(kind):
    parse, text = HOSTILE[kind]
    gc.disable()  # nor is garbage of other tests collected meanwhile
    try:
        began = time.process_time()
        said = line_of(text_files.TextFileError, parse, text)
        taken = time.process_time() - began
    finally:
        gc.enable()
    assert taken < 1
    assert len(said) < 200
    assert not any(word in said for word in ("Error", "recursion", "<class", "object at"))


def test_a_calibration_and_a_manifest_are_read_within_these_bounds(tmp_path):
    for name, text in [("a.yaml", ALIASES), ("a.toml", "a=" + "[" * N), ("b.yaml", "x" * 2 * N)]:
        (tmp_path / name).write_text(text)
        with pytest.raises(ManifestError, match=name):
            read_cameras(tmp_path / name)
        with pytest.raises(ManifestError, match=name):
            read_manifest(tmp_path / name)


def test_no_more_than_a_megabyte_is_read(tmp_path):
    with (tmp_path / "large.yaml").open("wb") as file:
        file.truncate(5_000_000_000)  # takes no room
    with pytest.raises(text_files.TextFileError, match="larger than 1 MB"):
        text_files.read_text(tmp_path / "large.yaml")


def test_a_byte_order_mark_and_foreign_line_ends_are_read(tmp_path):
    (tmp_path / "a.yaml").write_bytes(b"\xef\xbb\xbf%YAML:1.0\r\n---\r\na: 1e3\r\n")
    assert text_files.parse_yaml(text_files.read_text(tmp_path / "a.yaml")) == {"a": 1000.0}
