"""A study as the command that runs it."""

from __future__ import annotations

import json
import shlex
from typing import Any

from thesis_lib.studies.request import Study


def given(study: Study) -> dict[str, Any]:
    """The parameters that differ from the defaults.

    Examples
    --------
    >>> from thesis_lib.figure_sets.parametric.parameters import camera_study
    >>> given(camera_study("beam-distance", {"modes": [1], "seed": 0}))
    {'modes': [1]}
    """
    defaults = type(study)().request
    return {key: value for key, value in study.request.items() if value != defaults[key]}


def command(study: Study) -> str:
    """The command that runs a study.

    Examples
    --------
    >>> from thesis_lib.figure_sets.parametric.parameters import camera_study
    >>> command(camera_study("beam-distance", {"modes": [1]}))
    "thesis run beam-distance -p 'modes=[1]'"
    """
    words = [
        f"-p {shlex.quote(f'{key}={value if isinstance(value, str) else json.dumps(value)}')}"
        for key, value in given(study).items()
    ]
    return " ".join(["thesis run", shlex.quote(study.folder or study.name), *words])
