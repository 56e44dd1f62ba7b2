"""The README's example runs as it stands."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[1]


def test_library_example_runs_and_its_prediction_is_the_law(capsys):
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)
    assert len([line for line in code.splitlines() if line.strip()]) <= 10
    names: dict[str, object] = {}
    exec(code, names)
    measured, expected = map(float, re.findall(r"([\d.]+) mm", capsys.readouterr().out))
    assert abs(measured - 2) < 5 * expected


def test_commands_of_the_readme_exist():
    from thesis_lib.cli import cli

    text = (ROOT / "README.md").read_text(encoding="utf-8")
    commands = set(re.findall(r"thesis (list|run|book|claims|pdf|plan|measure|compare)\b", text))
    assert commands == set(cli.commands)
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    for target in re.findall(r"make (\w+)", text):
        assert re.search(rf"^{target}:", makefile, flags=re.MULTILINE), target
