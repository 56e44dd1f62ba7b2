"""Optics of a single camera and of a parallel pair (thesis 2, Appendices A–C).

Lengths are in one unit of the caller's choice, metres elsewhere in the library; angles in rad;
image coordinates in px. Everything broadcasts. Images are ``(rows, columns)`` or
``(rows, columns, colours)``, the first row on top.
"""

import numpy as np

from thesis_lib.arrays import Array, ArrayLike, Mask
from thesis_lib.vision.pinhole import CameraArray, pixelate

FULL_FRAME = (36.0, 24.0)  # mm, the reference of crop factors
_RED_OR_BLUE = np.array([[1.0, 2.0, 1.0], [2.0, 4.0, 2.0], [1.0, 2.0, 1.0]]) / 4
_GREEN_WEIGHTS = np.array([[0.0, 1.0, 0.0], [1.0, 4.0, 1.0], [0.0, 1.0, 0.0]]) / 4


# Formats and angles (2.2.3, 2.4).


def angle_of_view(size: ArrayLike, focal: ArrayLike) -> Array:
    """Return the angle 2 arctan(d / 2f) in rad seen across a length d of the sensor (eq. 2.19)."""
    return 2 * np.arctan2(np.asarray(size, float), 2 * np.asarray(focal, float))


def crop_factor(sensor: ArrayLike, reference: ArrayLike = FULL_FRAME) -> Array:
    """Return the diagonal of a reference over that of a sensor (2.4).

    A lens of focal length f has the same diagonal angle of view on the sensor as one of f times
    this factor on the reference.

    Parameters
    ----------
    sensor, reference : array_like, shape (..., 2)
        Width and height, both in one unit.
    """
    return np.asarray(np.linalg.norm(reference, axis=-1) / np.linalg.norm(sensor, axis=-1))


def picture_height(width: int, across: int, up: int) -> int:
    """Return whole rows of an image `width` px wide in the proportion across : up (Table 2.1)."""
    return width * up // across


# A thin lens (Appendix A).


def image_distance(focal: ArrayLike, distance: ArrayLike) -> Array:
    """Return Z′ at which a thin lens images an object at Z sharply (eq. A.1), with Z > f."""
    f, z = np.asarray(focal, float), np.asarray(distance, float)
    return f * z / (z - f)


def image_magnification(focal: ArrayLike, distance: ArrayLike) -> Array:
    """Return the size of a sharp image over that of its object, Z′/Z = f/(Z − f) (Appendix A)."""
    f, z = np.asarray(focal, float), np.asarray(distance, float)
    return f / (z - f)


def blur_circle(
    focal: ArrayLike, f_number: ArrayLike, focused: ArrayLike, distance: ArrayLike
) -> Array:
    """Return the diameter on the sensor of the image of a point that is not in focus (Appendix A).

    With a lens of diameter f/N focused at d, a point at Z spreads over
    (f/N) · f/(d − f) · |Z − d| / Z.
    """
    z, d = np.asarray(distance, float), np.asarray(focused, float)
    return np.asarray(focal, float) / f_number * image_magnification(focal, d) * np.abs(z - d) / z


def hyperfocal_distance(focal: ArrayLike, f_number: ArrayLike, circle: ArrayLike) -> Array:
    """Return H = f²/(Nc) + f, the least focus at which infinity is sharp (Appendix A)."""
    f = np.asarray(focal, float)
    return f**2 / (np.asarray(f_number, float) * np.asarray(circle, float)) + f


def depth_of_field(
    focal: ArrayLike, f_number: ArrayLike, distance: ArrayLike, circle: ArrayLike
) -> tuple[Array, Array]:
    """Return nearest and farthest sharp depth of a thin lens, all lengths in one unit (Appendix A).

    With the hyperfocal distance H = f²/(Nc) + f, near is d(H − f)/(H + d − 2f), and far is
    d(H − f)/(H − d), or infinite from d = H on. NaN unless d > f.

    Parameters
    ----------
    focal, f_number : array_like
        Focal length f, and N.
    distance, circle : array_like
        Focused distance d, and largest circle of confusion c on the sensor.
    """
    f, d = np.asarray(focal, float), np.asarray(distance, float)
    H = hyperfocal_distance(f, f_number, circle)
    d = np.where((d > f) & np.isfinite(H), d, np.nan)
    with np.errstate(divide="ignore", invalid="ignore"):
        near = d * (H - f) / (H + d - 2 * f)
        far = np.where(d >= H, np.inf, d * (H - f) / (H - d))
    return near[()], far[()]


# Two parallel cameras (Appendix B).


def stereo_disparity(depth: ArrayLike, baseline: ArrayLike, focal_px: ArrayLike) -> Array:
    """Return u₁ − u₂ = b f / Z in px, the disparity of a point at depth Z (Appendix B)."""
    return np.asarray(baseline, float) * focal_px / np.asarray(depth, float)


def stereo_depth(disparity_px: ArrayLike, baseline: ArrayLike, focal_px: ArrayLike) -> Array:
    """Return Z = b f / (u₁ − u₂), a point's depth in the baseline's unit, parallel cameras."""
    return np.asarray(baseline, float) * focal_px / np.asarray(disparity_px, float)


def depth_error(
    depth: ArrayLike, baseline: ArrayLike, focal_px: ArrayLike, disparity_error: ArrayLike
) -> Array:
    """Return first-order error Z²/(b f) · δ of a depth for an error δ in px of the disparity."""
    z = np.asarray(depth, float)
    return z**2 / (np.asarray(baseline, float) * focal_px) * np.asarray(disparity_error, float)


def round_depth(
    depth: ArrayLike, baseline: ArrayLike, focal_px: ArrayLike, shifts: ArrayLike
) -> Array:
    """Return depths of a point midway between two parallel cameras, from whole pixels.

    Parameters
    ----------
    depth, baseline, focal_px : array_like
        Depth Z and baseline b in one unit, focal length f in px.
    shifts : array_like, shape (trials, 2)
        Shift of either camera's pixel grid along its rows, in px.

    Returns
    -------
    ndarray, shape (trials, ...)
        Depths in the unit of Z; NaN where the disparity is at most 1 px.
    """
    true = stereo_disparity(depth, baseline, focal_px)
    images = np.stack([true, -true]) / 2
    shift = np.reshape(shifts, (*np.shape(shifts), *(1,) * true.ndim))
    left, right = np.moveaxis(pixelate(images + shift) - shift, 1, 0)
    return stereo_depth(np.where(true > 1, left - right, np.nan), baseline, focal_px)


# Projections (2.1) and homogeneous coordinates (Appendix C).


def weak_perspective(cameras: CameraArray, points: ArrayLike) -> Array:
    """Return images (cameras, 2, points) in px with the mean depth for all points.

    World points (3, points) are in m (eq. 2.6, 2.7).
    """
    X = np.asarray(points, float)
    seen = cameras.R_camera_world @ (X - cameras.centres[:, :, None])
    seen[:, 2] = seen[:, 2].mean(axis=1, keepdims=True)
    flat = cameras.K @ seen
    return flat[:, :2] / flat[:, 2:]


def to_homogeneous(points: ArrayLike) -> Array:
    """Append a coordinate of 1 to (..., n), shape (..., n + 1) (eq. 2.10, C.1)."""
    x = np.asarray(points, float)
    return np.concatenate([x, np.ones_like(x[..., :1])], axis=-1)


def from_homogeneous(points: ArrayLike) -> Array:
    """Divide by the last coordinate and drop it (eq. C.1); points at infinity give inf or NaN."""
    x = np.asarray(points, float)
    with np.errstate(divide="ignore", invalid="ignore"):
        return x[..., :-1] / x[..., -1:]


def join_homogeneous(first: ArrayLike, second: ArrayLike) -> Array:
    """Return the line through two points, or the point of two lines (Appendix C).

    Both are triples: a point lies on a line if their product is zero. Parallel lines meet in a
    point whose last coordinate is zero.
    """
    return np.cross(np.asarray(first, float), np.asarray(second, float))


# Images: pixels and colours (2.2.3, 2.3).


def block_means(picture: ArrayLike, block: int) -> Array:
    """Average an image over blocks of `block` by `block` pixels, which must fill it."""
    fine = np.asarray(picture, float)
    rows, columns = fine.shape[:2]
    split = fine.reshape(rows // block, block, columns // block, block, *fine.shape[2:])
    return np.asarray(split.mean(axis=(1, 3)))


def bayer_masks(shape: tuple[int, int], pattern: str = "RGGB") -> Mask:
    """Return the masks of red, green and blue pixels, shape (rows, columns, 3) (Fig. 2.4).

    Parameters
    ----------
    shape : tuple of int
        Rows and columns.
    pattern : str
        Colours of the top-left two by two pixels, row by row.
    """
    row, column = np.indices(shape)
    place = 2 * (row % 2) + column % 2
    colours = np.array(["RGB".index(colour) for colour in pattern])[place]
    return colours[..., None] == np.arange(3)


def bayer_mosaic(picture: ArrayLike, pattern: str = "RGGB") -> Array:
    """Sample an image (rows, columns, 3) by colour filters: one colour for each pixel."""
    rgb = np.asarray(picture, float)
    return np.where(bayer_masks(rgb.shape[:2], pattern), rgb, 0.0).sum(axis=-1)


def demosaic_image(mosaic: ArrayLike, pattern: str = "RGGB") -> Array:
    """Return three colours at every pixel, by bilinear interpolation, shape (rows, columns, 3).

    Missing values are means of the two or four nearest pixels of their colour, at the border of
    those that exist; recorded values stay. Exact for linearly changing colours, except at the
    border.
    """
    from scipy.signal import convolve2d  # late: all else needs NumPy alone

    raw = np.asarray(mosaic, float)
    masks = bayer_masks(raw.shape, pattern)
    result = np.empty((*raw.shape, 3))
    for colour in range(3):
        kernel = _GREEN_WEIGHTS if colour == 1 else _RED_OR_BLUE
        mask = masks[..., colour].astype(float)
        with np.errstate(invalid="ignore"):  # an image of one row lacks a colour: NaN
            mean = convolve2d(raw * mask, kernel, "same") / convolve2d(mask, kernel, "same")
        result[..., colour] = np.where(masks[..., colour], raw, mean)
    return result
