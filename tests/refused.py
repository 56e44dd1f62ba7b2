"""What the library says to a request that it refuses."""

import pytest

from thesis_lib.figure_sets.registry import validate_request
from thesis_lib.studies.request import ParameterError


def line_of(error, call, *given):
    """The one line of an error that a call raises."""
    with pytest.raises(error) as caught:
        call(*given)
    line = str(caught.value)
    assert line.isprintable(), line
    return line


def refusal(name, /, **values):
    """The one line by which a figure set's request is refused."""
    message = line_of(ParameterError, validate_request, name, values)
    assert message.startswith(f"{name}: ")
    return message
