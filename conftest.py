"""What every pytest run needs, plain or with ``--nbval``, from whatever folder it is started."""

import os

import hypothesis
import pytest

hypothesis.settings.register_profile("project", deadline=None)  # other jobs may have the machine
hypothesis.settings.load_profile("project")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # of the notebooks' kernels, as in every run

SLOW_NOTEBOOKS = ["claims", "design-law", "planner", "experiment-*", "lab-*", "shape-holes"]
SLOW_NOTEBOOKS += ["*-arrays", "*-aperture"]


def pytest_configure(config: pytest.Config) -> None:
    """Sanitise the notebooks' outputs: an option with a relative path works in one folder only."""
    if config.getoption("nbval_sanitize_with", None) is None:
        file = config.rootpath / "tests" / "nbval_sanitize.cfg"
        config.option.nbval_sanitize_with = str(file)


@pytest.hookimpl(tryfirst=True)  # before -m chooses
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark the notebooks that take long, and those whose like is quicker."""
    for item in items:
        if any(item.path.match(f"{name}.ipynb") for name in SLOW_NOTEBOOKS):
            item.add_marker("slow")
