"""The faces of the physics rooms: names to start from, and quick to import."""

import subprocess
import sys

import pytest


@pytest.mark.parametrize("room", ["vibration", "vision", "acoustics"])
def test_a_face_has_what_it_names_and_loads_no_scipy(room):
    code = (
        f"import sys, thesis_lib.{room} as face; print('scipy' in sys.modules); "
        "print([name for name in face.__all__ if not getattr(face, name).__doc__])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split("\n")[:2] == ["False", "[]"]
