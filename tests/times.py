"""What files of tests take: kept for the book's page of benchmarks, and the longest begin first.

``pytest --times`` keeps it. ``--longest-first`` goes by what is published: of several workers none
then has a long file left when the others are through.
"""

from __future__ import annotations

from collections import defaultdict

import pytest


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--times", action="store_true", help="keep what each file took")
    parser.addoption("--longest-first", action="store_true", help="by the published times")


def pytest_configure(config: pytest.Config) -> None:
    if config.getoption("--times") and not hasattr(config, "workerinput"):
        config.pluginmanager.register(_Times())


@pytest.hookimpl(trylast=True)  # what -m and -k leave out is gone
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    if config.getoption("--longest-first"):
        from thesis_lib.studies import times

        known = times.read(times.published_path())["tests"]
        items.sort(key=lambda item: -known.get(item.nodeid.partition("::")[0], (0.0,))[0])


class _Times:
    def __init__(self) -> None:
        self.seconds: defaultdict[str, float] = defaultdict(float)

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        self.seconds[report.nodeid.partition("::")[0]] += report.duration

    def pytest_sessionfinish(self, exitstatus: int) -> None:
        from thesis_lib.studies import times

        if exitstatus in (pytest.ExitCode.OK, pytest.ExitCode.TESTS_FAILED):
            times.note("tests", self.seconds)
