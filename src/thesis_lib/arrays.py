"""Array types by element type; the functions that use them document the shapes."""

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike as ArrayLike, NDArray as NDArray

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
IntArray = NDArray[np.int64]
Mask = NDArray[np.bool_]
Image = NDArray[np.uint8]
Signal = NDArray[np.floating[Any]]


def stack_padded(arrays: Iterable[ArrayLike], fill: float = np.nan) -> NDArray[Any]:
    """Stack arrays along a new first dimension, filled up to the size of the largest.

    Examples
    --------
    >>> stack_padded([[1, 2], [3]], fill=0)
    array([[1, 2],
           [3, 0]])
    """
    every = [np.asarray(one) for one in arrays]
    size = np.max([one.shape for one in every], axis=0)
    beyond = [[(0, n) for n in size - one.shape] for one in every]
    pairs = zip(every, beyond, strict=True)
    return np.stack([np.pad(one, more, constant_values=fill) for one, more in pairs])
