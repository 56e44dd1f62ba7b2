"""Results that tests look at and none changes: computed once for all of pytest's workers."""

import os
import pickle
from functools import cache, wraps
from hashlib import sha256

import pytest
from filelock import FileLock

folders = []  # of this run, where it has several workers


@pytest.fixture(scope="session", autouse=True)
def between_workers(tmp_path_factory):
    """Name a folder that all workers of a run have in common, and no other run."""
    if "PYTEST_XDIST_WORKER" in os.environ:
        folders.append(tmp_path_factory.getbasetemp().parent / "shared")
        folders[0].mkdir(exist_ok=True)


def shared(function):
    """Cache what a function returns, in the process and between the workers of a run."""

    @cache
    @wraps(function)
    def remembered(*given, **named):
        if not folders:
            return function(*given, **named)
        key = f"{function.__module__}.{function.__qualname__} {given} {named}"
        file = folders[0] / f"{sha256(key.encode()).hexdigest()}.pickle"
        with FileLock(file.with_suffix(".lock")):
            if not file.exists():
                file.write_bytes(pickle.dumps(function(*given, **named)))
        return pickle.loads(file.read_bytes())

    return remembered
