"""What `make test-cpus` calls the same is what the book promises."""

import re
from pathlib import Path

import cpus


def test_the_conventions_promise_what_is_compared():
    text = (Path(__file__).parents[1] / "book" / "glossary.md").read_text(encoding="utf-8")
    section = text.partition("(the-same-on-every-machine)=")[2].partition("\n## ")[2]
    (power,) = re.findall(r"more than 10⁻([⁰¹²³⁴-⁹]) of its largest value", section)
    assert 10.0 ** -"⁰¹²³⁴⁵⁶⁷⁸⁹".index(power) == cpus.MAX_DIFFERENCE
    (bits,) = re.findall(r"stored to (\d+) bits", section)
    assert 2.0 ** (1 - int(bits)) == cpus.MAX_SINGLE_DIFFERENCE
