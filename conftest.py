"""What every pytest run needs, plain or with ``--nbval``, from whatever folder it is started."""

import os

import hypothesis
import pytest

hypothesis.settings.register_profile("project", deadline=None)  # other jobs may have the machine
hypothesis.settings.load_profile("project")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # of the notebooks' kernels, as in every run


def pytest_configure(config: pytest.Config) -> None:
    """Sanitise the notebooks' outputs: an option with a relative path works in one folder only."""
    if config.getoption("nbval_sanitize_with", None) is None:
        file = config.rootpath / "tests" / "nbval_sanitize.cfg"
        config.option.nbval_sanitize_with = str(file)
