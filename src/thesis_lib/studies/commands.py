"""Requests as the commands that run them."""

from __future__ import annotations

import json
import shlex
from collections.abc import Mapping
from typing import Any

from thesis_lib.studies.request import Study


def given(study: Study) -> dict[str, Any]:
    """Return the parameters that differ from the defaults.

    Examples
    --------
    >>> from thesis_lib.figure_sets.parametric.parameters import camera_study
    >>> given(camera_study("beam-distance", {"modes": [1], "seed": 0}))
    {'modes': [1]}
    """
    defaults = type(study)().request
    return {key: value for key, value in study.request.items() if value != defaults[key]}


def command(study: Study) -> str:
    """Return the command that runs a study.

    Examples
    --------
    >>> from thesis_lib.figure_sets.parametric.parameters import camera_study
    >>> command(camera_study("beam-distance", {"modes": [1]}))
    "thesis run beam-distance -p 'modes=[1]'"
    """
    return join_command(["thesis", "run", study.folder or study.name], given(study))


def join_command(words: list[str], parameters: Mapping[str, Any]) -> str:
    """Return words and parameters as a line for a shell.

    Examples
    --------
    >>> join_command(["thesis", "plan"], {"body": "plate", "counts": [2, 3]})
    "thesis plan -p body=plate -p 'counts=[2, 3]'"
    """
    options = (
        f"-p {shlex.quote(f'{key}={value if isinstance(value, str) else json.dumps(value)}')}"
        for key, value in parameters.items()
    )
    return " ".join([shlex.join(words), *options])
