"""Checks of numbers that fail as an assert does, and that pytest records for the book.

A test takes the fixture `conforms` and names the kind of check::

    conforms.closed_form(beam.angular_frequencies(3), expected, rtol=1e-13)
    conforms.order(orders(errors), 2, atol=0.05)
    conforms.sampled(scatter / predicted, above=0.95, below=1.05)

``pytest -m conforms --junitxml FILE.xml`` writes the outcome of each check.
"""

import json
import sys
from functools import partialmethod

import numpy as np
import pytest


def compare(value, expected=None, *, rtol=0.0, atol=0.0, above=None, below=None):
    """Compare real or complex numbers with what is expected, or with open bounds.

    Allowed is |value - expected| <= atol + rtol |expected|, or else above < value < below. The
    record holds whether all values ``passed``, their ``count``, the worst one, and its ``share`` of
    the tolerance, None where that has no scale.
    """
    if (expected is None) == (above is None and below is None):
        raise TypeError("conforms: needs an expected value, or else bounds")
    given = {"value": value, "expected": expected, "above": above, "below": below}
    sides = {name: 1.0 * np.asarray(side) for name, side in given.items() if side is not None}
    shapes = {side.shape for side in sides.values() if side.shape}
    if len(shapes) > 1 or any(0 in shape for shape in shapes):
        raise ValueError(f"conforms: given shapes {sorted(shapes)}, allowed: one, not empty")
    sides = dict(zip(sides, np.broadcast_arrays(*sides.values()), strict=True))
    with np.errstate(all="ignore"):
        if expected is None:
            low, high = sides.get("above", -np.inf), sides.get("below", np.inf)
            passed = (sides["value"] > low) & (sides["value"] < high)
            middle = np.where(np.isfinite(low + high) & (low != 0), (low + high) / 2, 0)
            allowed = np.where(np.isfinite(high) & (high > middle), high - middle, np.nan)
        else:
            middle = sides["expected"]
            sides["allowed"] = allowed = atol + rtol * np.abs(middle)
            passed = np.abs(sides["value"] - middle) <= allowed
        share = np.where(passed & (allowed == 0), 0, np.abs(sides["value"] - middle) / allowed)
    worst = np.argmax(np.where(np.isfinite(share), share, np.where(passed, 0, np.inf)))
    fraction = float(share.flat[worst]) if np.isfinite(share.flat[worst]) else None
    shown = {name: f"{side.flat[worst]:.6g}" for name, side in sides.items()}
    return {"passed": bool(passed.all()), "count": passed.size, "share": fraction, **shown}


class Conforms:
    """Make checks, and keep their outcomes in the running test."""

    def __init__(self):
        self.records = []

    def _check(self, kind, value, expected=None, **allowed):
        __tracebackhide__ = True
        line = sys._getframe(1).f_lineno
        record = {"line": line, "kind": kind, **compare(value, expected, **allowed)}
        self.records.append(record)
        assert record["passed"], f"line {line}: {record}"

    closed_form = partialmethod(_check, "closed form")
    order = partialmethod(_check, "order")
    invariance = partialmethod(_check, "invariance")
    sampled = partialmethod(_check, "sampled")
    independent = partialmethod(_check, "independent")


RECORDER = Conforms()


@pytest.fixture(scope="session")  # the same for all examples of hypothesis
def conforms():
    """Return the checks by kind: closed form, order, invariance, sampled, independent."""
    return RECORDER


def pytest_configure(config):
    config.addinivalue_line("markers", "conforms: uses the fixture `conforms`; set by itself")


@pytest.hookimpl(tryfirst=True)  # before -m chooses
def pytest_collection_modifyitems(items):
    for item in items:
        if "conforms" in getattr(item, "fixturenames", ()):
            item.add_marker("conforms")


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item):
    RECORDER.records.clear()
    try:
        return (yield)
    finally:
        for record in RECORDER.records:
            item.user_properties.append(("conforms", json.dumps(record)))
