"""Of the cases of one test that prove alike, some are run by day, the others at night.

``@pytest.mark.few(3)`` leaves three, evenly spread over the cases; the others are nightly. What
needs a browser is slow: ``make test-all`` runs it, ``make test`` leaves it out.
"""

from collections import defaultdict

import pytest


@pytest.hookimpl(tryfirst=True)  # before -m leaves out what is nightly
def pytest_collection_modifyitems(items):
    cases = defaultdict(list)
    for item in items:
        if "chromium" in getattr(item, "fixturenames", ()):
            item.add_marker(pytest.mark.slow)
        if item.get_closest_marker("few"):
            cases[item.nodeid.partition("[")[0]].append(item)
    for alike in cases.values():
        (count,) = alike[0].get_closest_marker("few").args
        spread = {round(i * (len(alike) - 1) / max(count - 1, 1)) for i in range(count)}
        for index, item in enumerate(alike):
            if index not in spread:
                item.add_marker(pytest.mark.nightly)
