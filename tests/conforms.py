"""Checks of numbers that fail as an assert does, and that pytest records for the book.

A test takes the fixture `conforms` and names the kind of check::

    conforms.closed_form(beam.angular_frequencies(3), expected, rtol=1e-13)
    conforms.order(orders(errors), 2, atol=0.05)
    conforms.sampled(scatter / predicted, above=0.95, below=1.05)

``pytest -m conforms --junitxml FILE.xml`` writes the worst value of each check.
"""

import json
import sys
from functools import partialmethod

import numpy as np
import pytest


def compare(value, expected=None, *, rtol=None, atol=None, above=None, below=None):
    """Compare real or complex numbers with what is expected, or with open bounds.

    Allowed is |value - expected| <= atol + rtol |expected|, or else above < value < below. The
    record holds whether all values ``passed``, their ``count``, the worst one, and its ``share`` of
    the tolerance, None where that has no scale.
    """
    bounded = above is not None or below is not None
    if (expected is None) != bounded or bounded == (rtol is not None or atol is not None):
        raise TypeError("conforms: needs an expected value with rtol or atol, or else bounds")
    given = {"value": value, "expected": expected, "above": above, "below": below}
    sides = {name: 1.0 * np.asarray(side) for name, side in given.items() if side is not None}
    shapes = {side.shape for side in sides.values() if side.shape}
    if len(shapes) > 1 or any(0 in shape for shape in shapes):
        raise ValueError(f"conforms: given shapes {sorted(shapes)}, allowed: one, not empty")
    sides = dict(zip(sides, np.broadcast_arrays(*sides.values()), strict=True))
    with np.errstate(all="ignore"):
        if bounded:
            low, high = sides.get("above", -np.inf), sides.get("below", np.inf)
            passed = (sides["value"] > low) & (sides["value"] < high)
            middle = np.where(np.isfinite(low + high) & (low != 0), (low + high) / 2, 0)
            scaled = np.isfinite(high) & (high > middle)
            share = np.abs(sides["value"] - middle) / np.where(scaled, high - middle, np.nan)
        else:
            scale = np.abs(sides["expected"])
            allowed = (0 if atol is None else atol) + (0 if rtol is None else rtol) * scale
            apart = np.abs(sides["value"] - sides["expected"])
            passed, share = apart <= allowed, np.where(apart == 0, 0, apart / allowed)
            sides["allowed"] = np.broadcast_to(allowed, apart.shape)
    worst = np.argmax(np.where(np.isfinite(share), share, np.where(passed, 0, np.inf)))
    fraction = float(share.flat[worst]) if np.isfinite(share.flat[worst]) else None
    shown = {name: f"{side.flat[worst]:.6g}" for name, side in sides.items()}
    return {"passed": bool(passed.all()), "count": passed.size, "share": fraction, **shown}


class Conforms:
    """Make checks, and keep the worst outcome of each line of the running test."""

    def __init__(self):
        self.records = {}

    def _check(self, kind, value, expected=None, **allowed):
        __tracebackhide__ = True
        record = {"kind": kind, **compare(value, expected, **allowed)}
        line = sys._getframe(1).f_lineno
        known = self.records.get(line, {**record, "count": 0})
        worse = max(known, record, key=lambda one: (not one["passed"], one["share"] or 0))
        self.records[line] = {**worse, "count": known["count"] + record["count"]}
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
        for line, record in RECORDER.records.items():
            item.user_properties.append(("conforms", json.dumps({"line": line, **record})))
