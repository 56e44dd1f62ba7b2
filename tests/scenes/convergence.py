"""How errors fall with finer steps."""

import numpy as np


def orders(errors):
    """Convergence orders of errors at halved steps or doubled numbers, one after the other."""
    errors = np.abs(errors)
    return np.log2(errors[:-1] / errors[1:])
