"""What every pytest run needs, plain or with ``--nbval``, from whatever folder it is started."""

import os

import hypothesis
import pytest

hypothesis.settings.register_profile("project", deadline=None)  # other jobs may have the machine
hypothesis.settings.load_profile("project")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # of the notebooks' kernels, as in every run

SLOW_NOTEBOOKS = ("claims", "design-law", "experiment-", "lab-", "planner")  # the start of a name


def pytest_configure(config: pytest.Config) -> None:
    """Sanitise the notebooks' outputs: an option with a relative path works in one folder only."""
    if config.getoption("nbval_sanitize_with", None) is None:
        file = config.rootpath / "tests" / "nbval_sanitize.cfg"
        config.option.nbval_sanitize_with = str(file)


@pytest.hookimpl(tryfirst=True)  # before -m chooses
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark what takes long among the notebooks: recordings to film, and wide searches."""
    for item in items:
        if item.path.suffix == ".ipynb" and item.path.stem.startswith(SLOW_NOTEBOOKS):
            item.add_marker("slow")
