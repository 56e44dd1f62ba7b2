"""Arrays by what they hold; their shapes stand where they are used."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = [
    "Array", "ArrayLike", "ComplexArray", "Image", "IntArray", "Mask", "NDArray", "Signal",
]  # fmt: skip

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
IntArray = NDArray[np.int64]
Mask = NDArray[np.bool_]
Image = NDArray[np.uint8]
Signal = NDArray[np.floating[Any]]
