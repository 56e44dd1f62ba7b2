"""Corners of the board in an image, to a few thousandths of a pixel (Appendix D, step 3).

OpenCV finds the grid; a least-squares fit of the grey levels locates each corner. The blurred image
of two edges that cross at the corner c is, with the distances dᵢ from the edges,

    I = a + b · erf(d₁/s) · erf(d₂/s),   dᵢ = nᵢ·(p − c) − κᵢ (tᵢ·(p − c))²/2.

This is exact for edges at right angles under a Gaussian blur; other edges have the same centre of
symmetry. The lens bends the edges by curvatures κᵢ, too weak to be estimated in one window but
worth 0.005 px on a corner; they are computed from the neighbouring corners. ArUco marks in light
tiles do not touch the edges; the fit excludes the pixels that they reach.

Real edges deviate from the model: cameras sharpen them, which leaves halos, and overexposed tiles
grow. These deviations are symmetric about the corner and do not move it. Only the asymmetric part
of the residual can move it; that part therefore decides whether the corner is accepted.
"""

from itertools import product
from operator import itemgetter
from typing import Any

import cv2
import numpy as np
import scipy

from thesis_lib.arrays import Array, Image, Mask
from thesis_lib.measure.recordings.board import Board
from thesis_lib.vision.pinhole import HALF_PIXEL

_MIN_BORDER_PX = 4.0  # least distance of a corner from the image's border, px
# Visible corners that a board with marks needs; a small board needs half of its corners
_MIN_MARKED_CORNERS = 12
_DICTIONARY_SIZES = (50, 100, 250, 1000)  # of OpenCV's dictionaries, which share the first marks
_REDUCED_PX = 640  # longer side of the reduced image in which large tiles are detected
_COMMON_DICTIONARIES = ("4X4_250", "5X5_250", "6X6_250", "7X7_250", "ARUCO_ORIGINAL",
                        "APRILTAG_36H11")  # fmt: skip
# Contrast beyond the outermost tiles, relative to theirs, above which the board continues there.
# Margins and backgrounds have up to 0.2.
_MIN_CONTINUED_SHARE = 0.5


class BoardNotFound(ValueError):  # noqa: N818 - no error, an image without a board
    """An image without a reliably detected board; the message gives the reason."""


# Each detector returns the inner corners, shape (2, rows − 1, columns − 1), px from the image's
# top-left corner, with x and y as seen from the printed side. Corners of a board with marks that
# are not visible are NaN; a checkerboard must be visible as a whole.


def _find_by_quads(image: Image, board: Board) -> Array:
    flags = cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE
    # No fast check: it rejects most views that are oblique or have a narrow margin.
    return _order_corners(*cv2.findChessboardCorners(image, board.shape, flags=flags), image, board)


def _find_by_reduced_quads(image: Image, board: Board) -> Array:
    """Find large tiles in a reduced image; noise and texture hide their edges at full size."""
    height, width = image.shape
    factor = max(image.shape) / _REDUCED_PX
    if factor <= 1:
        raise BoardNotFound("no checkerboard seen")
    size = round(width / factor), round(height / factor)
    small = cv2.resize(image, size, interpolation=cv2.INTER_AREA).astype(np.uint8)
    scale = np.array([width / size[0], height / size[1]])
    return scale[:, None, None] * _find_by_quads(small, board)


def _find_by_sectors(image: Image, board: Board) -> Array:
    """Find corners by OpenCV's other detector, reliable for large tiles but not for small ones."""
    return _order_corners(*cv2.findChessboardCornersSB(image, board.shape), image, board)


def _order_corners(found: bool, raw: Any, image: Image, board: Board) -> Array:
    """Return a detector's corners, ordered so that y points up where x points right."""
    if not found:
        raise BoardNotFound("no checkerboard seen")
    nx, ny = board.shape
    corners = np.asarray(raw, float).reshape(ny, nx, 2).transpose(2, 0, 1) + HALF_PIXEL
    nearest = float(_border_distances(corners, image).min())
    if nearest < _MIN_BORDER_PX:
        raise BoardNotFound(
            f"a corner is {nearest:.1f} px from the border, needs {_MIN_BORDER_PX:.0f}"
        )
    (xu, xv), (yu, yv) = (np.gradient(corners, axis=axis).mean((1, 2)) for axis in (2, 1))
    corners = corners if xu * yv - xv * yu < 0 else corners[:, ::-1]
    if _tiles_continue(image, corners):
        raise BoardNotFound(
            f"the tiles go on beyond a board of {nx + 1} × {ny + 1}: are there more than that?"
        )
    return corners


def _tiles_continue(image: Image, corners: Array) -> bool:
    """Return whether the tile pattern continues beyond the corners (2, ny, nx) on any side."""
    _, ny, nx = corners.shape
    y, x = np.mgrid[:ny, :nx].astype(float)
    H, _ = cv2.findHomography(np.stack([x.ravel(), y.ravel()], 1), corners.reshape(2, -1).T)
    if H is None:
        return False
    # Five points around the centre of each tile, including one row of tiles beyond the board
    spread = 0.2 * np.array([[-1, 1, -1, 1, 0], [-1, -1, 1, 1, 0]])
    y, x = np.mgrid[: ny + 3, : nx + 3][..., None] - 1.5
    x, y = x + spread[0], y + spread[1]
    u, v, w = np.tensordot(np.asarray(H, float), np.stack([x, y, np.ones_like(x)]), axes=1)
    column, row = (
        np.where(w > 0, side / w - HALF_PIXEL, -9).reshape(len(w), -1).astype(np.float32)
        for side in (u, v)
    )
    grey = cv2.remap(image.astype(np.float32), column, row, cv2.INTER_NEAREST, borderValue=np.nan)
    tiles = grey.reshape(w.shape).mean(axis=2)
    for sides in (tiles[:, 1:-1], tiles[1:-1].T):
        parity = (-1.0) ** np.arange(sides.shape[1])
        outside, last, *_, other_last, beyond = sides @ (parity - parity.mean())
        for inner, outer in ((last, outside), (other_last, beyond)):
            if -outer * np.sign(inner) > _MIN_CONTINUED_SHARE * abs(inner):
                return True
    return False


def _find_marks(image: Image, board: Board) -> Array:
    """Return the visible corners between marks; the marks identify the corners."""
    count = board.columns * board.rows // 2
    bits = board.dictionary.rpartition("_")[0]
    # A smaller dictionary corrects more bit errors.
    size = next(size for size in _DICTIONARY_SIZES if size >= count)
    dictionary, marks, numbers = _read_marks(image, f"{bits}_{size}")
    nx, ny = board.shape
    corners = np.full((nx * ny, 2), np.nan)
    # Before OpenCV 4.6 a board began with a light tile. OpenCV's check rejects some oblique views.
    for legacy, checked in ((False, True), (True, True), (False, False)):
        layout = cv2.aruco.CharucoBoard((nx + 1, ny + 1), board.tile, board.mark, dictionary)
        layout.setLegacyPattern(legacy)
        parameters = cv2.aruco.CharucoParameters()
        parameters.checkMarkers = checked
        detector = cv2.aruco.CharucoDetector(layout, parameters)
        places, which, _, _ = detector.detectBoard(image, None, None, marks, numbers)
        if which is not None:
            corners[np.ravel(which)] = np.reshape(places, (-1, 2)) + HALF_PIXEL
            break
    corners = corners.reshape(ny, nx, 2).transpose(2, 0, 1)[:, ::-1]  # OpenCV's rows run down
    corners[:, _border_distances(corners, image) < _MIN_BORDER_PX] = np.nan
    corners[:, _find_off_plane(corners, board)] = np.nan
    seen, least = int(np.isfinite(corners[0]).sum()), min(_MIN_MARKED_CORNERS, nx * ny // 2)
    if seen < least:
        few = 2 * len(marks) < count
        others = _describe_other_marks(image, f"{bits}_{size}", count) if few else ""
        raise BoardNotFound(
            f"{len(marks)} marks of {board.dictionary} seen{others}; {seen} corners between them "
            f"as on a board of {nx + 1} × {ny + 1} tiles, needs {least}"
        )
    return corners


def _find_off_plane(corners: Array, board: Board) -> Mask:
    """Return the mask of visible corners (2, ny, nx) off their common plane; all, if most are."""
    off = np.isfinite(corners[0])
    if np.count_nonzero(off) > 4:
        plane = board.corners[:2].reshape(corners.shape)[:, off]
        _, right = cv2.findHomography(corners[:, off].T, plane.T, cv2.RANSAC, board.tile / 4)
        if 2 * np.count_nonzero(right) > right.size:
            off[off] = np.ravel(right) == 0
    return off


def _read_marks(image: Image, name: str) -> tuple[cv2.aruco.Dictionary, Any, Any]:
    """Return a dictionary, and the corners and numbers of its visible marks."""
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name))
    parameters = cv2.aruco.DetectorParameters()
    parameters.errorCorrectionRate = 1.0  # the maximum: false marks do not fit the board anyway
    marks, numbers, _ = cv2.aruco.ArucoDetector(dictionary, parameters).detectMarkers(image)
    return dictionary, marks, numbers


def _describe_other_marks(image: Image, name: str, count: int) -> str:
    """Describe the marks that are visible instead; fewer than half of `count` may be by chance."""
    mirrored = "mirrored: it is seen from the back, or the camera mirrors"
    tries = [(np.ascontiguousarray(image[:, ::-1]), name, mirrored)]
    tries += [(image, f"DICT_{other}", f"of DICT_{other}") for other in _COMMON_DICTIONARIES]
    for shown, dictionary, what in tries:
        if 2 * (seen := len(_read_marks(shown, dictionary)[1])) >= count:
            return f", but {seen} {what}"
    return ""


def _border_distances(corners: Array, image: Image) -> Array:
    """Return the distances (ny, nx) of corners from the image's border, px; NaN for NaN corners."""
    (u, v), (height, width) = corners, image.shape
    return np.minimum.reduce([u, v, width - u, height - v])


_WINDOW_RATIO = 0.35  # half-size of the window over the distance to the neighbouring corners
# Largest distance from a corner to its window's edge, px; more pixels hardly improve the precision
_MAX_WINDOW_PX = 14
_OFF_MARK = 2.0  # least distance of a window's pixel from an ArUco mark, px: the reach of its blur
# Largest distance of a corner from a smooth grid, over the corner spacing, as detected and as
# fitted. OpenCV's detectors are off by up to 0.09. Fitted corners: 0.019 on a bent paper board,
# 0.005 on flat ones; the nearest false corner, that of a mark of 0.8 tiles, is at 0.14.
_MAX_FOUND_OFFSET = 0.25
_MAX_FITTED_OFFSET = 0.05
# Largest rms of the residual's asymmetric part about the corner, over the half contrast: up to 0.21
# on a webcam that sharpens, 0.27 under an unsharp mask of amount 4, 0.18 elsewhere.
_MAX_ASYMMETRY = 0.35
_MAX_MISFIT = 0.6  # same for the whole residual: up to 0.45 under such a mask, 0.41 on the webcam
# Largest median of the whole residual in an image whose edges are softer than _SOFT_PX, and so have
# no halos. Overexposure causes 0.19, motion blur over 21 px 0.18 to 0.33.
_MAX_SOFT_MISFIT = 0.22
_SOFT_PX = 2.0  # width s of an edge; 0.5 to 1.4 on cameras that sharpen, 3 at 11 px of motion blur
# Least and largest width s of an edge, px. A pixel's own area spreads edges along its sides by 0.5.
# A window shows only a part of an edge wider than 8 px: images blurred more put f 1 % off.
_MIN_BLUR_PX, _MAX_BLUR_PX = 0.5, 8.0
_LARGE_TILE_PX = 100.0  # corners of larger tiles are first fitted in a reduced image
_MAX_STEPS = 8
_CORNERS_AT_ONCE = 16  # the pixels and derivatives of so many fit into the processor's cache
_CONVERGED_PX = 1e-4  # change of all corners below which the fit stops, converged to 5e-6 px
_REFINEMENT_ROUNDS = 3  # each takes curvatures, and starts for stray corners, from the one before


def find_corners(image: Image, board: Board) -> Array:
    """Return the inner corners of the board in an image.

    Parameters
    ----------
    image : ndarray of uint8, shape (h, w)
        Grey levels.
    board : Board
        The board to look for.

    Returns
    -------
    ndarray, shape (2, corners)
        Pixels from the image's top-left corner, in the order of ``board.corners`` as seen from the
        printed side. On a checkerboard the first corner is ambiguous: it is one of those that look
        alike. Marks resolve the ambiguity; with marks, corners that are not visible are NaN.

    Raises
    ------
    ValueError
        If the image does not have 8-bit grey levels.
    BoardNotFound
        If the image shows no board, only part of it, or false corners.
    """
    if image.ndim != 2 or image.dtype != np.uint8:
        raise ValueError(f"image: given {image.dtype} of shape {image.shape}, needs uint8 (h, w)")
    plain = _find_by_quads, _find_by_reduced_quads, _find_by_sectors
    failures = []
    for negative, find in product((False, True), (_find_marks,) if board.mark else plain):
        shown, found = 255 - image if negative else image, None  # for boards in white on black
        try:
            found = find(shown, board)
            return _fit_grid(shown, found, board)
        except BoardNotFound as error:
            failures.append((found is None, error))
    raise min(failures, key=itemgetter(0))[1]  # preferably of an attempt that detected a grid


def _fit_grid(image: Image, found: Array, board: Board) -> Array:
    """Refine the corners (2, ny, nx) that a detector found, NaN where not visible; check them."""
    seen = np.isfinite(found[0])
    smooth = _smooth_grid(found, seen, board)
    grid = np.where(seen, found, smooth)
    _check_grid(grid, smooth, _MAX_FOUND_OFFSET)
    size = np.median(_corner_spacing(grid)) / _LARGE_TILE_PX
    reduction = int(2 ** max(np.floor(np.log2(size)) + 1, 0))
    while reduction > 1:
        height, width = (side // reduction for side in image.shape)
        part = image[: height * reduction, : width * reduction]
        small = cv2.resize(part, (width, height), interpolation=cv2.INTER_AREA).astype(np.uint8)
        grid = reduction * _refine_grid(small, grid / reduction, seen, board)[0]
        reduction //= 2
    grid, start, state, residual, weight = _refine_grid(image, grid, seen, board)
    moved, spacing = np.linalg.norm(state[:2] - start[:, seen], axis=0), _corner_spacing(grid)[seen]
    worst = int(np.argmax(moved / spacing))
    if not moved[worst] <= _MAX_FITTED_OFFSET * spacing[worst]:
        raise BoardNotFound(f"a corner's fit ends {moved[worst]:.1f} px from where it starts")
    parity = np.indices(seen.shape).sum(0)[seen] % 2
    if len(np.unique(np.sign(state[5]) * (1 - 2 * parity))) != 1:
        raise BoardNotFound("false grid: light and dark tiles do not alternate")
    with np.errstate(invalid="ignore", divide="ignore"):  # NaN for a corner without pixels
        misfit = np.sqrt(np.sum(weight * residual**2, axis=1) / weight.sum(axis=1))
    asymmetry = _rms_asymmetry(residual, weight, state[:2] - np.floor(start[:, seen]))
    _check_residuals(misfit / np.abs(state[5]), asymmetry / np.abs(state[5]), state[6])
    smooth = _smooth_grid(grid, seen, board)
    _check_grid(np.where(seen, grid, smooth), smooth, _MAX_FITTED_OFFSET)
    return np.where(seen, grid, np.nan).reshape(2, -1)


def _corner_spacing(grid: Array) -> Array:
    """Return the distance (ny, nx) of each corner (2, ny, nx) from its nearest neighbour, px."""
    y, x = (
        np.linalg.norm(np.diff(grid, axis=axis, prepend=np.inf, append=np.inf), axis=0)
        for axis in (1, 2)
    )
    return np.minimum.reduce([x[:, 1:], x[:, :-1], y[1:], y[:-1]])


def _smooth_grid(grid: Array, seen: Mask, board: Board) -> Array:
    """Fit a plane seen through a lens to the visible corners; return its grid (2, ny, nx).

    The model is a homography plus a cubic polynomial of the image coordinates for the lens.
    """
    plane, part = board.corners[:2], seen.ravel()
    flat = grid[:, seen]
    H, _ = cv2.findHomography(plane[:, part].T, flat.T)
    if H is None:
        raise BoardNotFound("false grid: the corners lie on a line")
    image = H @ np.vstack([plane, np.ones_like(plane[:1])])
    image = image[:2] / image[2]
    x, y = (image - image.mean(axis=1, keepdims=True)) / image.std()
    cubic = np.stack([x**i * y**j for i in range(4) for j in range(4 - i)])
    shift = np.linalg.lstsq(cubic[:, part].T, (flat - image[:, part]).T, rcond=None)[0].T @ cubic
    return (image + shift).reshape(grid.shape)


def _check_grid(grid: Array, smooth: Array, allowed: float) -> None:
    """Refuse corners that are off a smooth grid by more than the fraction `allowed` of spacing."""
    off, spacing = np.linalg.norm(grid - smooth, axis=0), _corner_spacing(grid)
    worst = int(np.argmax(off / spacing))
    if not off.flat[worst] <= allowed * spacing.flat[worst]:
        raise BoardNotFound(
            f"false grid: a corner is {off.flat[worst]:.1f} px off a plane under a lens, allowed "
            f"{allowed:.0%} of the {spacing.flat[worst]:.0f} px between corners"
        )


def _refine_grid(
    image: Image, grid: Array, seen: Mask, board: Board
) -> tuple[Array, Array, Array, Array, Array]:
    """Fit the corners in several rounds.

    Returns the grid (2, ny, nx), and from the last round the start, the states (7, corners) of
    :func:`_model_edges`, and the residuals in grey levels and weights (corners, n) of the windows.
    """
    beside = (1 - board.mark / board.tile) / 2 if board.mark else np.inf
    state, unsettled = np.empty((7, np.count_nonzero(seen))), np.ones(np.count_nonzero(seen), bool)
    for _ in range(_REFINEMENT_ROUNDS):
        smooth = _smooth_grid(grid, seen, board)
        grid = np.where(seen, grid, smooth)
        astray = np.linalg.norm(grid - smooth, axis=0) > _MAX_FITTED_OFFSET * _corner_spacing(grid)
        start = np.where(astray, smooth, grid)
        steps = np.stack([np.gradient(start, axis=axis) for axis in (2, 1)])[:, :, seen]
        bend = np.stack([_grid_curvature(start), _grid_curvature(start.swapaxes(1, 2)).T])[:, seen]
        pixels, weight, grey = _cut_windows(image, start[:, seen], steps, beside)
        unsettled |= astray[seen]
        if unsettled.any():  # else from where the round before ended
            angles = np.arctan2(steps[:, 1], steps[:, 0])
            guess = _guess_states(pixels, weight, grey, start[:, seen], angles, bend)
            state = np.where(unsettled, guess, state)
        state, unsettled = _fit_corners(pixels, weight, grey, state, bend)
        grid = start.copy()
        grid[:, seen] = state[:2]
    return grid, start, state, grey - _model_edges(pixels, state, bend, False)[0], weight


def _guess_states(
    pixels: Array, weight: Array, grey: Array, start: Array, angles: Array, bend: Array
) -> Array:
    """Return initial states (7, corners) of :func:`_model_edges` from start and angles."""
    light, dark = np.quantile(grey, [0.9, 0.1], axis=1)
    centre, half = (light + dark) / 2, (light - dark) / 2
    state = np.stack([*start, *angles, centre, half, np.ones_like(half)])
    pattern = _model_edges(pixels, state, bend, False)[0] - centre[:, None]
    state[5] *= np.sign(np.sum(weight * pattern * (grey - centre[:, None]), axis=1))
    return state


def _fit_corners(
    pixels: Array, weight: Array, grey: Array, state: Array, bend: Array
) -> tuple[Array, Mask]:
    """Fit the corners to the grey levels of their windows by Gauss–Newton, all at once.

    The fit starts from states (7, corners) of :func:`_model_edges`. Returns the final states, and
    which corners have not converged.
    """
    used = weight.any(axis=0)  # pixels in the window of any corner
    pixels, weight, grey = pixels[:, :, used], weight[:, used], grey[:, used]
    normal, right = np.empty((len(grey), 7, 7)), np.empty((len(grey), 7))
    for _ in range(_MAX_STEPS):
        for k in range(0, len(grey), _CORNERS_AT_ONCE):
            p = slice(k, k + _CORNERS_AT_ONCE)
            model, J = _model_edges(pixels[:, p], state[:, p], bend[:, p])
            A = J * weight[p]
            normal[p] = A.transpose(1, 0, 2) @ J.transpose(1, 2, 0)
            right[p] = np.einsum("ipn,pn->pi", A, grey[p] - model)
        scale = np.sqrt(np.einsum("pii->pi", normal)) + 1e-12
        normal /= scale[:, :, None] * scale[:, None, :]
        normal += 1e-9 * np.eye(7)
        step = (np.linalg.solve(normal, (right / scale)[..., None])[..., 0] / scale).T
        state = state + step
        state[6] = np.clip(np.abs(state[6]), _MIN_BLUR_PX, _MAX_BLUR_PX)
        unsettled = ~(np.abs(step[:2]).max(axis=0) < _CONVERGED_PX)
        if not unsettled.any():
            break
    return state, unsettled


def _rms_asymmetry(residual: Array, weight: Array, corner: Array) -> Array:
    """Return the rms (corners,) of the residuals' asymmetric part about the corner.

    Residuals and weights (corners, n) are those of square windows; `corner` (2, corners) is counted
    from the middle pixel's top-left corner, px. Pixels without an opposite pixel are ignored.
    """
    side = 2 * _MAX_WINDOW_PX + 1
    asymmetry = np.full(len(residual), np.nan)
    for k, (r, w) in enumerate(zip(residual, weight, strict=True)):
        shift = np.array([[1, 0, 2 * corner[0, k] - 1], [0, 1, 2 * corner[1, k] - 1]])
        r, w = r.reshape(side, side), w.reshape(side, side)
        opposite, there = (
            cv2.warpAffine(np.ascontiguousarray(a[::-1, ::-1]), shift, (side, side)) for a in (r, w)
        )
        both = (w > 0) & (there > 0.999)
        if both.any():
            asymmetry[k] = np.sqrt(np.mean((r - opposite)[both] ** 2)) / 2
    return asymmetry


def _grid_curvature(grid: Array) -> Array:
    """Return the signed curvature (ny, nx) of the grid's lines along the last axis, 1/px."""
    a, b = grid[:, :, 1:-1] - grid[:, :, :-2], grid[:, :, 2:] - grid[:, :, 1:-1]
    chord = a + b
    turn = a[0] * b[1] - a[1] * b[0]
    lengths = [np.linalg.norm(side, axis=0) for side in (a, b, chord)]
    return np.pad(2 * turn / np.prod(lengths, axis=0), ((0, 0), (1, 1)), mode="edge")


def _cut_windows(
    image: Image, corners: Array, steps: Array, beside: float
) -> tuple[Array, Array, Array]:
    """Return the pixels around each corner.

    Returns their coordinates (2, corners, n), weights (1 inside the window, a parallelogram along
    the steps to the neighbours, else 0) and grey levels, both (corners, n). `beside` is the
    distance of marks from the edges in tiles.
    """
    side = np.arange(-_MAX_WINDOW_PX, _MAX_WINDOW_PX + 1)
    column, row = (np.floor(c).astype(int)[:, None] for c in corners)
    column, row = column + np.tile(side, len(side)), row + np.repeat(side, len(side))
    height, width = image.shape
    inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    pixels = np.stack([column, row]) + HALF_PIXEL
    du, dv = pixels - corners[:, :, None]
    (au, av), (bu, bv) = steps[..., None]
    determinant = au * bv - av * bu
    off = np.stack([du * bv - dv * bu, dv * au - du * av]) / determinant
    inside &= (abs(off).max(axis=0) <= _WINDOW_RATIO) & (du**2 + dv**2 <= _MAX_WINDOW_PX**2)
    grey = image[np.clip(row, 0, height - 1), np.clip(column, 0, width - 1)].astype(float)
    if np.isfinite(beside):  # leave out pixels that a mark reaches; marks are in the lighter tiles
        px = abs(determinant) / np.stack([np.hypot(bu, bv), np.hypot(au, av)])  # per unit of off
        across = off[0] * off[1] > 0
        one, other = (
            np.mean(grey, axis=1, where=inside & part, keepdims=True) for part in (across, ~across)
        )
        clear = np.any((beside - abs(off)) * px >= _OFF_MARK, axis=0)
        inside &= clear | (across == (one < other))
    return pixels, inside.astype(float), grey


def _model_edges(
    pixels: Array, state: Array, bend: Array, derivatives: bool = True
) -> tuple[Array, Array]:
    """Return the modelled grey levels (corners, n) and their `derivatives` (7, corners, n) if True.

    The state (7, corners) is u, v, the angles of the edges along x and y, the mean grey level, the
    signed half contrast and the blur's width s.
    """
    u, v, *angles, mean, half, s = state[:, :, None]
    du, dv = pixels[0] - u, pixels[1] - v
    edges = []
    for angle, kappa in zip(angles, bend[:, :, None], strict=True):
        cos, sin = np.cos(angle), np.sin(angle)
        t, d = cos * du + sin * dv, cos * dv - sin * du
        curved = d - kappa * t**2 / 2
        scaled, bent = curved / s, kappa * t
        edge = [scipy.special.erf(scaled)]
        if derivatives:
            slope = 2 / np.sqrt(np.pi) * np.exp(-(scaled**2)) / s
            edge += [slope, curved, sin + bent * cos, -cos + bent * sin, -t - bent * d]
        edges.append(edge)
    (f, *by_f), (g, *by_g) = edges
    levels = mean + half * f * g
    if not derivatives:
        return levels, np.empty(0)
    (df, x, *f_centre, f_angle), (dg, y, *g_centre, g_angle) = by_f, by_g
    fg, gf = half * g * df, half * f * dg
    centre = [fg * one + gf * other for one, other in zip(f_centre, g_centre, strict=True)]
    turned = [fg * f_angle, gf * g_angle]
    J = np.stack([*centre, *turned, np.ones_like(f), f * g, -(fg * x + gf * y) / s])
    return levels, J


def _check_residuals(misfit: Array, asymmetry: Array, blur: Array) -> None:
    """Refuse corners whose residuals, over the half contrast, do not fit two crossing edges."""
    width, typical = float(np.median(blur)), float(np.median(misfit))
    worst, uneven = float(np.max(misfit)), float(np.max(asymmetry))
    if np.isnan(uneven):
        problem = "the tiles about a corner are too narrow to fit their edges"
    elif width >= _MAX_BLUR_PX:
        problem = f"the image is blurred: edges are wider than {_MAX_BLUR_PX:.0f} px; focus the "
        problem += "camera, or hold the board still"
    elif uneven > _MAX_ASYMMETRY:
        problem = f"a corner's edges are unlike on opposite sides by {uneven:.0%} of the contrast, "
        problem += f"allowed {_MAX_ASYMMETRY:.0%}"
    elif worst > _MAX_MISFIT:
        problem = (
            f"a corner's edges misfit by {worst:.0%} of the contrast, allowed {_MAX_MISFIT:.0%}"
        )
    elif width > _SOFT_PX and typical > _MAX_SOFT_MISFIT:
        problem = f"the edges are blurred unevenly, as by motion: they misfit by {typical:.0%} of "
        problem += f"the contrast, allowed {_MAX_SOFT_MISFIT:.0%}; hold the board still"
    else:
        return
    raise BoardNotFound(problem)
