"""Frames under uneven or flickering light, evened so that one threshold finds the structure."""

from __future__ import annotations

from collections.abc import Iterator

import cv2
import numpy as np

from thesis_lib.arrays import Array, Image

GROUND_QUANTILE = 0.2  # of a row or column that the structure leaves free, at least
ROW_BLUR_PX = 2.0  # px over which the light of rows varies little, standard deviation
COARSE_STEP_PX = 8  # px of the frame in one of those in which its ground is looked for
# Of the frame's width, beyond which ground is seen from everywhere on the structure
GROUND_REACH = 0.12
MIN_GROUND_LEVEL = 4.0  # grey levels of a ground that tell its light
WHITE_LEVEL = 250.0  # grey level of the brightest hundredth of an evened frame


def even_light(image: Image) -> Iterator[Image]:
    """Yield a frame as it is, and divided by three estimates of its light.

    Light that flickers brightens rows of a rolling shutter unevenly, or columns in an upright
    frame; a lamp at the side brightens one part more. Each estimate is the brightness of the ground
    that the structure lies on: of each row, of each column, or around each place.
    """
    yield image
    grey = image.astype(float)
    for axis in (1, 0):
        along = np.quantile(grey, GROUND_QUANTILE, axis=axis)
        along = cv2.GaussianBlur(along[:, None], (1, 0), sigmaX=0.1, sigmaY=ROW_BLUR_PX)[:, 0]
        yield _divide(grey, along[:, None] if axis else along[None])
    height, width = image.shape
    coarse = cv2.resize(
        image,
        (max(1, width // COARSE_STEP_PX), max(1, height // COARSE_STEP_PX)),
        interpolation=cv2.INTER_AREA,
    )
    side = 2 * max(1, round(GROUND_REACH * coarse.shape[1])) + 1
    ground = cv2.erode(coarse, np.ones((side, side), np.uint8))
    ground = cv2.GaussianBlur(ground.astype(np.float32), (0, 0), side / 4)
    yield _divide(grey, np.asarray(cv2.resize(ground, (width, height)), float))


def _divide(grey: Array, light: Array) -> Image:
    """Return the grey levels over those of the light, so that the brightest are nearly white."""
    ratio = grey / np.maximum(light, MIN_GROUND_LEVEL)
    white = max(float(np.quantile(ratio, 0.99)), 1e-9)
    return np.asarray(np.clip(WHITE_LEVEL * ratio / white, 0, 255), np.uint8)
