"""Figures of the plate and of its sound: maps of deflection and pressure beside setup and bars."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap

from thesis_lib.arrays import Array


def _diverging(count: int = 129) -> tuple[str, ...]:
    """Blue to orange over near-white, even in lightness and told apart with any colour vision.

    Straight lines in Oklab from the ends to the middle; `count` is odd, the middle is zero.
    """
    ends = {-1: (0.42, -0.045, -0.145), 1: (0.47, 0.105, 0.09)}
    middle = np.array([0.97, 0.0, 0.002])
    steps = np.linspace(-1, 1, count)
    lab = np.array([middle + abs(t) * (np.array(ends[1 if t > 0 else -1]) - middle) for t in steps])
    to_lms = np.array(
        [
            [1, 0.3963377774, 0.2158037573],
            [1, -0.1055613458, -0.0638541728],
            [1, -0.0894841775, -1.2914855480],
        ]
    )
    to_rgb = np.array(
        [
            [4.0767416621, -3.3077115913, 0.2309699292],
            [-1.2684380046, 2.6097574011, -0.3413193965],
            [-0.0041960863, -0.7034186147, 1.7076147010],
        ]
    )
    linear = np.clip((lab @ to_lms.T) ** 3 @ to_rgb.T, 0, 1)
    srgb = np.where(linear > 0.0031308, 1.055 * linear ** (1 / 2.4) - 0.055, 12.92 * linear)
    return tuple("#" + "".join(f"{round(255 * c):02x}" for c in color) for color in srgb)


DIVERGING = _diverging()
_CMAP = ListedColormap(list(DIVERGING), "diverging")


def draw_map(axes: Axes, values: Array, across: Array, up: Array, limit: float) -> Any:
    """A map to scale: values (up, across) at the centres of their cells, zero in the middle."""
    half = [(a[1] - a[0]) / 2 for a in (across, up)]
    extent = (across[0] - half[0], across[-1] + half[0], up[0] - half[1], up[-1] + half[1])
    picture = axes.imshow(
        values,
        _CMAP,
        vmin=-limit,
        vmax=limit,
        extent=extent,
        origin="lower",
        interpolation="nearest",
    )
    axes.grid(visible=False)
    return picture
