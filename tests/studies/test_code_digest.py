"""Comments and docstrings do not change the digest of code; text in it does."""

import pytest

from thesis_lib import files


@pytest.mark.parametrize(
    ("edit", "same"),
    [
        ('"""Other."""\nimport os\n\n\ndef f(x):\n    """One.\n\n    Two."""\n    return x\n', 1),
        ("import os\n# a note\ndef f(x):  # another\n\n    return x\n", 1),
        ("import os\ndef f(x):\n    return x + 0\n", 0),
        ('import os\ndef f(x):\n    return "# x"\n', 0),
        ('import os\ndef f(x):\n    y = """no docstring"""\n    return x\n', 0),
    ],
)  # fmt: skip
def test_comments_do_not_change_the_code(tmp_path, edit, same):
    path, other = tmp_path / "a.py", tmp_path / "b.py"
    path.write_text('"""Words."""\n\nimport os\n\n\ndef f(x):\n    return x\n')
    other.write_text(edit)
    assert (files.code(path) == files.code(other)) is bool(same)


def test_text_in_the_code_counts(tmp_path):
    path = tmp_path / "a.py"
    for text in ("x = '# a'\n", "x = '# b'\n", 'x = f"{1}#{2}"\n', 'x = """a\n# b\n"""\n'):
        path.write_text(text)
        assert files.code(path) == text.encode()
