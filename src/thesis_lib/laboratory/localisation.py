"""How well the centre of a round marker can be found: the law of its edge."""

from __future__ import annotations

import numpy as np

from thesis_lib.arrays import Array
from thesis_lib.laboratory.render import Sensor

NODES = 256  # of the sum around the edge


def edge_scatter(width: float, height: float, sensor: Sensor) -> Array:
    """Least standard deviation of a disc's centre along u and v, shape (2,), px.

    An edge of contrast c that is blurred by s, seen by pixels with noise σ, tells a shift along its
    normal n with the information c² / (2√π s σ²) per length. Around the whole edge

        σ_u² = 2√π s σ² / (c² ∮ n_u² dl),  σ_v² = 2√π s σ² / (c² ∮ n_v² dl).

    A flat image has long edges above and below and hardly any at its ends: σ_v stays, σ_u grows.
    The law holds while opposite edges are farther apart than they are blurred.

    Parameters
    ----------
    width, height : float
        Axes of the disc's image along u and v in px.
    sensor : Sensor
        Grey levels, noise and spread; s has the pixel's own area in it, and σ is that of the level
        between dark and white, rounding included.

    Examples
    --------
    >>> edge_scatter(11.2, 4.2, Sensor()).round(4)
    array([0.0109, 0.0052])
    """
    blur = np.sqrt(sensor.spread**2 + 1 / 12)
    noise = sensor.shot * (sensor.white + sensor.dark) / 2 + sensor.read**2 + 1 / 12
    turn = (np.arange(NODES) + 0.5) * 2 * np.pi / NODES
    # With (a cos t, b sin t) an edge has n dl = (b cos t, a sin t) dt.
    normal = np.stack([height / 2 * np.cos(turn), width / 2 * np.sin(turn)])
    around = 2 * np.pi * np.mean(normal**2 / np.hypot(*normal), axis=1)
    contrast = sensor.white - sensor.dark
    return np.asarray(np.sqrt(2 * np.sqrt(np.pi) * blur * noise / (contrast**2 * around)), float)
