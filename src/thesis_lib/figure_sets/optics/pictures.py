"""Drawn image of the beam: the effect of coarse pixels and colour filters on its markers.

Only the strip of the picture that holds the beam is drawn. Pictures are ``(rows, columns)`` or
``(rows, columns, 3)`` with values from 0 to 1.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thesis_lib.arrays import Array
from thesis_lib.vibration.beam import Beam
from thesis_lib.vision import optics
from thesis_lib.vision.pinhole import CameraArray, hemisphere_cameras, project

FINEST_SIZE_PX = (1280, 720)  # px, of the picture that all others are means of
STRIP_STEP_PX = 80  # px of it: rows of the strip are a multiple, so that every block fits
RAYS_PER_PIXEL = 2  # rays across a pixel of it, in both directions
TABLE_COLOUR, BEAM_COLOUR, MARKER_COLOUR = np.array(
    [[0.10, 0.16, 0.28], [0.84, 0.80, 0.72], [0.07, 0.06, 0.06]]
)
CELL_RATIO = 2 / 3  # part of spacing and beam's width in which a marker's centre is sought
CROP_SIZE_PX = (24, 36)  # rows and columns of the part that is shown


@dataclass(frozen=True)
class BeamPicture:
    """Image of a beam in a camera, pixel by pixel."""

    #: Share of each pixel that the beam and its markers cover, shape (rows, columns)
    beam: Array
    markers: Array
    camera: CameraArray  #: The camera, with ``FINEST`` pixels
    structure: Beam  #: What it sees
    top: int  #: Row of the camera's picture at which the strip begins

    def colours(self, block: int) -> Array:
        """Return the image with pixels of `block` by `block` finest ones, (rows, columns, 3)."""
        beam, markers = (
            optics.block_means(part, block)[..., None] for part in (self.beam, self.markers)
        )
        return (1 - beam) * TABLE_COLOUR + (beam - markers) * BEAM_COLOUR + markers * MARKER_COLOUR

    def images(self, x: Array, block: int) -> Array:
        """Return coordinates (u, v) in the strip of points (n,) on the axis, shape (2, n)."""
        middle = np.array([self.structure.length / 2, 0.0])
        axis = np.stack([x - middle[0], np.zeros_like(x), np.zeros_like(x)])
        return np.asarray((project(self.camera.P, axis)[0] - [[0], [self.top]]) / block)

    def contrast(self, block: int) -> float:
        """Return how much darker a pixel on a marker is than one midway, 1 for large markers.

        The mean over the markers and gaps that are in the picture.
        """
        cover = optics.block_means(self.markers, block)
        x = self.structure.markers[0]
        on, off = (
            _values_at(cover, self.images(places, block)) for places in (x, (x[1:] + x[:-1]) / 2)
        )
        return float(on.mean() - off.mean()) if len(on) and len(off) else np.nan

    def cells(self, block: int) -> NDArray[np.int_]:
        """Return the index of the marker in whose cell each pixel's centre lies, -1 for none."""
        shape = (self.beam.shape[0] // block, self.beam.shape[1] // block)
        x, y = _plane_points(self.camera, self.top, shape, block)
        markers = self.structure.markers[0] - self.structure.length / 2
        nearest = np.searchsorted((markers[1:] + markers[:-1]) / 2, x)
        inside = np.abs(y) < CELL_RATIO / 2 * self.structure.width
        inside &= np.abs(x - markers[nearest]) < CELL_RATIO / 2 * self.structure.marker_spacing
        return np.where(inside, nearest, -1)

    def centroids(self, picture: Array, block: int) -> Array:
        """Return the centres of the dark spots of an image (rows, columns, 3), (markers, 2), px."""
        dark = (BEAM_COLOUR - picture).mean(axis=-1)
        cells, n = self.cells(block), self.structure.n_markers
        v, u = np.indices(dark.shape) + 0.5
        inside = cells >= 0
        sums = [
            np.bincount(cells[inside], (dark * by)[inside], n) for by in (np.ones_like(u), u, v)
        ]
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.stack([sums[1] / sums[0], sums[2] / sums[0]], axis=-1)


def draw_beam(
    structure: Beam, distance: float, azimuth: float, elevation: float, focal: float, marker: float
) -> BeamPicture:
    """Draw a beam at rest as a camera on the hemisphere sees it.

    Parameters
    ----------
    structure : Beam
        The beam, with round markers on its axis.
    distance : float
        Distance of the camera from its centre, m.
    azimuth, elevation : float
        Direction of the camera, rad.
    focal : float
        Focal length over the sensor's width.
    marker : float
        Diameter of the markers, m.
    """
    camera = hemisphere_cameras(
        distance, [azimuth], [elevation], focal * FINEST_SIZE_PX[0], FINEST_SIZE_PX
    )
    length, width = structure.extent
    corners = np.array([[-1, -1, 1, 1], [-1, 1, -1, 1], [0, 0, 0, 0]]) / 2
    v = project(camera.P, corners * [[length], [width], [0]])[0, 1]
    top = (
        int(np.clip(np.floor(v.min() / STRIP_STEP_PX), 0, FINEST_SIZE_PX[1] // STRIP_STEP_PX - 1))
        * STRIP_STEP_PX
    )
    bottom = int(
        np.clip(
            np.ceil(v.max() / STRIP_STEP_PX) * STRIP_STEP_PX, top + STRIP_STEP_PX, FINEST_SIZE_PX[1]
        )
    )
    shape = ((bottom - top) * RAYS_PER_PIXEL, FINEST_SIZE_PX[0] * RAYS_PER_PIXEL)
    x, y = _plane_points(camera, top, shape, 1 / RAYS_PER_PIXEL)
    on_beam = (np.abs(x) <= length / 2) & (np.abs(y) <= width / 2)
    places = structure.markers[0] - length / 2
    nearest = places[np.searchsorted((places[1:] + places[:-1]) / 2, x)]
    on_marker = on_beam & (np.hypot(x - nearest, y) <= marker / 2)
    beam, markers = (optics.block_means(part, RAYS_PER_PIXEL) for part in (on_beam, on_marker))
    return BeamPicture(beam, markers, camera, structure, top)


def _plane_points(
    camera: CameraArray, top: int, shape: tuple[int, int], size: float
) -> tuple[Array, Array]:
    """Return X and Y in m where rays through pixels meet the plane Z = 0, NaN if behind."""
    v, u = (np.indices(shape) + 0.5) * size
    to_image = camera.P[0][:, [0, 1, 3]]
    flat = np.linalg.inv(to_image) @ np.stack([u.ravel(), v.ravel() + top, np.ones(u.size)])
    x, y = (flat[:2] / flat[2]).reshape(2, *shape)
    behind = to_image[2] @ np.stack([x.ravel(), y.ravel(), np.ones(x.size)]) <= 0
    x[behind.reshape(shape)] = np.nan
    return x, y


def _values_at(picture: Array, places: Array) -> Array:
    """Return the values of the pixels that hold places (2, n), of those in the image."""
    column, row = np.floor(places).astype(int)
    inside = (row >= 0) & (row < picture.shape[0]) & (column >= 0) & (column < picture.shape[1])
    return np.asarray(picture[row[inside], column[inside]])


@dataclass(frozen=True)
class ColourLoss:
    """Loss of an image by colour filters."""

    #: Rms and largest difference of the interpolated colours from the true ones, on the beam, as a
    #: share of full scale
    error: float
    largest: float
    shift: float  #: Rms shift of the markers' centres by it, px of each coordinate
    #: The part around the largest marker; in the mosaic each pixel has its filter's colour alone,
    #: shape (rows, columns, 3)
    true: Array
    mosaic: Array
    interpolated: Array


def colour_loss(picture: BeamPicture, block: int, pattern: str) -> ColourLoss:
    """Pass an image through colour filters and interpolate it back bilinearly.

    Parameters
    ----------
    picture : BeamPicture
        What the camera sees.
    block : int
        Side of the sensor's pixels in finest ones.
    pattern : str
        Colours of the top-left two by two pixels.
    """
    true = picture.colours(block)
    raw = optics.bayer_mosaic(true, pattern)
    found = optics.demosaic_image(raw, pattern)
    masks = optics.bayer_masks(raw.shape, pattern)
    difference = (found - true)[optics.block_means(picture.beam, block) > 0]
    moved = picture.centroids(found, block) - picture.centroids(true, block)
    moved = moved[np.isfinite(moved).all(axis=1)]
    sizes = np.bincount(picture.cells(block).ravel() + 1, minlength=2)[1:]
    part = _crop(picture, block, int(np.argmax(sizes)))
    return ColourLoss(
        float(np.sqrt(np.mean(difference**2))),
        float(np.max(np.abs(difference))),
        float(np.sqrt(np.mean(moved**2))) if len(moved) else np.nan,
        true[part],
        np.where(masks, raw[..., None], 0.0)[part],
        found[part],
    )


def _crop(picture: BeamPicture, block: int, marker: int) -> tuple[slice, slice]:
    shape = (picture.beam.shape[0] // block, picture.beam.shape[1] // block)
    u, v = picture.images(picture.structure.markers[0][[marker]], block)[:, 0]
    parts = []
    for middle, size, whole in zip((v, u), CROP_SIZE_PX, shape, strict=True):
        start = int(np.clip(round(middle - size / 2), 0, max(whole - size, 0)))
        start -= start % 2  # so that the filters' pattern begins as the sensor's does
        parts.append(slice(start, min(start + size, whole)))
    return parts[0], parts[1]
