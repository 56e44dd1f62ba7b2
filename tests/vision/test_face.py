"""The public names of the library and its rooms: names to start from, and quick to import."""

import subprocess
import sys
from importlib import import_module

import pytest

import thesis_lib


@pytest.mark.parametrize("room", ["vibration", "vision", "acoustics"])
def test_a_face_has_what_it_names_and_loads_no_scipy(room):
    code = (
        f"import sys, thesis_lib.{room} as face; print('scipy' in sys.modules); "
        "print([name for name in face.__all__ if not getattr(face, name).__doc__])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split("\n")[:2] == ["False", "[]"]


def test_the_library_has_the_names_of_its_rooms_and_loads_them_when_they_are_used():
    for room, names in thesis_lib.PUBLIC_NAMES.items():
        face = import_module(f"thesis_lib.{room}")
        assert sorted(face.__all__) == sorted(names.split())
        for name in face.__all__:
            assert getattr(thesis_lib, name) is getattr(face, name)
            assert getattr(face, name).__doc__, name
    assert len(set(thesis_lib.__all__)) == len(thesis_lib.__all__)
    with pytest.raises(AttributeError, match="module 'thesis_lib' has no attribute 'cube'"):
        _ = thesis_lib.cube
    code = "import sys, thesis_lib, thesis_lib.measure; print('numpy' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "False\n"
