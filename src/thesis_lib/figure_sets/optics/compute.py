"""The cube of ``cameras``: angles of view, projections, pixels, colours, sharpness, parallel pairs.

Every variable is a closed form of :mod:`thesis_lib.vision.optics`, except the depths of a parallel
pair with whole pixels, which are simulated, and the images. Only the strip of an image that holds
the beam is rendered. Images are ``(rows, columns)`` or ``(rows, columns, 3)`` with values from 0 to
1.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from thesis_lib.arrays import Array, ArrayLike, IntArray
from thesis_lib.facts import setups
from thesis_lib.figure_sets.optics.figure_set import MAX_DISTANCE_RATIO, Cameras
from thesis_lib.studies.schema import label_values, list_quantities, read_variables
from thesis_lib.vibration.structure import Beam, world_points
from thesis_lib.vision import cone_law, optics, rounding
from thesis_lib.vision.pinhole import CameraArray, hemisphere_cameras, project

CURVE_POINTS = 121  # places of a curve over distance
ASPECT_RATIOS = {"4:3": (4, 3), "3:2": (3, 2)}
SENSOR_SIDES = ("width", "height", "diagonal")

VARIABLES = read_variables(__file__, "cube")


def run(study: Cameras) -> xr.Dataset:
    """Compute the cube of ``cameras``: lengths in m, angles in degrees, images in px.

    ``distance`` includes the requested distances. Runs are compared by ``quantity``, ``value`` and
    ``unit``.
    """
    cube = xr.Dataset(coords=_coordinates(study))
    for part in (_views, _projections, _horizons, _pictures, _sharpness, _stereo, _summary):
        cube = cube.assign(label_values(part(cube, study), VARIABLES))
    return cube


def focal_px(study: Cameras) -> float:
    """Return the focal length in px of the images that are not drawn."""
    return study.focal_length_mm * study.resolution_px[0] / study.sensor_width_mm


def _aim_at_beam(study: Cameras, distances: Array) -> CameraArray:
    """Return the cameras that look at the beam from some distances in m."""
    angles = np.radians([[study.azimuth_deg], [study.elevation_deg]])
    azimuth, elevation = np.broadcast_to(angles, (2, len(distances)))
    return hemisphere_cameras(distances, azimuth, elevation, focal_px(study), study.resolution_px)


def _coordinates(study: Cameras) -> dict[str, Any]:
    asked = np.array(study.distances_mm) / 1000
    curve = np.geomspace(asked.min(), MAX_DISTANCE_RATIO * asked.max(), CURVE_POINTS)
    every = np.unique(np.round(np.concatenate([curve, asked]), 9))
    values = {
        "sensor": list(study.sensors_mm),
        "side": list(SENSOR_SIDES),
        "focal_length": np.array(study.focal_lengths_mm) / 1000,
        "ratio": list(ASPECT_RATIOS),
        "format_width": study.format_widths_px,
        "distance": every,
        "shown_distance": np.round(asked, 9),
        "projection": ["pinhole", "one depth"],
        "axis": ["u", "v"],
        "x": setups.thesis_beam().markers[0],
        "width": study.widths_px,
        "colour": ["red", "green", "blue"],
        "stage": ["true", "mosaic", "interpolated"],
        "f_number": study.f_numbers,
        "baseline": np.array(study.baselines_mm) / 1000,
    }
    return label_values(values, VARIABLES)


def _views(cube: xr.Dataset, study: Cameras) -> dict[str, ArrayLike]:
    """Compute angles of view, crop factors, heights of formats (2.2.3, 2.4)."""
    sensors = np.array(list(study.sensors_mm.values())) / 1000
    sides = np.concatenate([sensors, np.linalg.norm(sensors, axis=1, keepdims=True)], axis=1)
    angles = optics.angle_of_view(sides[:, :, None], cube["focal_length"].values)
    return {
        "sensor_size": sides,
        "angle_of_view": np.degrees(angles),
        "crop_factor": optics.crop_factor(1000 * sensors),
        "format_height": [
            [optics.picture_height(width, *ratio) for width in study.format_widths_px]
            for ratio in ASPECT_RATIOS.values()
        ],
    }


def _projections(cube: xr.Dataset, study: Cameras) -> dict[str, ArrayLike]:
    """Project the markers by a pinhole, and with one depth for all of them (2.1)."""
    beam = setups.thesis_beam()
    points = world_points(beam, np.zeros(beam.n_markers))
    cameras = _aim_at_beam(study, cube["distance"].values)
    both = project(cameras.P, points), optics.weak_perspective(cameras, points)
    image = np.stack(both, axis=1)
    depth = (cameras.R_camera_world[:, 2:] @ (points - cameras.centres[:, :, None]))[:, 0]
    error = np.linalg.norm(image[:, 1] - image[:, 0], axis=1).max(axis=1)
    length = np.linalg.norm(image[:, 0, :, -1] - image[:, 0, :, 0], axis=1)
    shown = np.searchsorted(cube["distance"].values, cube["shown_distance"].values)
    return {
        "projection_error": error,
        "relative_projection_error": 100 * error / length,
        "nearest_depth": depth.min(axis=1),
        "farthest_depth": depth.max(axis=1),
        "depth_range": 100 * np.abs(depth / depth.mean(axis=1, keepdims=True) - 1).max(axis=1),
        "image": image[shown],
    }


def _horizons(cube: xr.Dataset, study: Cameras) -> dict[str, ArrayLike]:
    """Find the vanishing point of parallel edges by homogeneous coordinates (Appendix C)."""
    length, width = setups.thesis_beam().extent
    corners = np.array([[[-1, 1], [-1, 1]], [[-1, -1], [1, 1]], [[0, 0], [0, 0]]]) / 2
    corners = corners * np.array([length, width, 0])[:, None, None]  # coordinate, edge, end
    images = project(_aim_at_beam(study, cube["shown_distance"].values).P, corners)
    ends = optics.to_homogeneous(np.moveaxis(images, 1, -1))  # distance, edge, end, coordinate
    lines = optics.join_homogeneous(ends[:, :, 0], ends[:, :, 1])
    normals = lines[..., :2] / np.linalg.norm(lines[..., :2], axis=-1, keepdims=True)
    meeting = optics.from_homogeneous(optics.join_homogeneous(lines[:, 0], lines[:, 1]))
    angle = np.degrees(np.arcsin(abs(np.linalg.det(normals))))
    return {"vanishing_point": meeting, "edge_angle": angle}


def _pictures(cube: xr.Dataset, study: Cameras) -> dict[str, ArrayLike]:
    """Draw the beam with coarser and coarser pixels, and through colour filters (2.2)."""
    nearest, focal = min(study.distances_mm) / 1000, study.focal_length_mm / study.sensor_width_mm
    theta, phi = np.radians([study.azimuth_deg, study.elevation_deg])
    picture = draw_beam(setups.thesis_beam(), nearest, theta, phi, focal, study.marker_mm / 1000)
    blocks = [FINEST_SIZE_PX[0] // width for width in study.widths_px]
    least = min(blocks)
    finest = picture.colours(1).mean(axis=-1)
    grey = [optics.block_means(finest, block) for block in blocks]
    shown = [
        np.kron(one, np.ones((block, block)))[::least, ::least]
        for one, block in zip(grey, blocks, strict=True)
    ]
    return {
        "pixelated": np.rint(255 * np.array(shown)).astype("u1"),
        "pixel_size": nearest / focal / np.array(study.widths_px),
        "marker_contrast": [100 * picture.contrast(block) for block in blocks],
        "variance_kept": [100 * one.var() / finest.var() for one in grey],
        **colour_loss(picture, least, study.bayer_pattern),
    }


def _sharpness(cube: xr.Dataset, study: Cameras) -> dict[str, ArrayLike]:
    """Compute the depth of field of a lens (Appendix A)."""
    focal, circle = study.focal_length_mm / 1000, study.circle_mm / 1000
    d, N = cube["distance"].values, cube["f_number"].values
    near, far = optics.depth_of_field(focal, N[:, None], d, circle)
    return {
        "near_limit": near,
        "far_limit": far,
        "hyperfocal_distance": optics.hyperfocal_distance(focal, N, circle),
        "circle": study.circle_mm * study.resolution_px[0] / study.sensor_width_mm,
        "magnification": optics.image_magnification(focal, d),
    }


def _stereo(cube: xr.Dataset, study: Cameras) -> dict[str, ArrayLike]:
    """Compute the depth error of two parallel cameras (Appendix B)."""
    z, b, f = cube["distance"].values, cube["baseline"].values[:, None], focal_px(study)
    shifts = rounding.grid_shifts(study.seed, study.trials, 2)[1:, :, 0]
    found = optics.round_depth(z, b, f, shifts)
    return {
        "disparity": optics.stereo_disparity(z, b, f),
        "depth_error": optics.depth_error(z, b, f, study.disparity_error_px),
        "rounding_depth_error": optics.depth_error(z, b, f, cone_law.MOTION_PX),
        "rounded_depth_error": np.sqrt(np.mean((found - z) ** 2, axis=0)),
    }


def _summary(cube: xr.Dataset, study: Cameras) -> dict[str, ArrayLike]:
    """Return the published quantities: one number and unit for every entry of the tables."""
    rows: list[tuple[str, float, str]] = []

    def add_quantity(words: str, value: xr.DataArray, unit: str) -> None:
        rows.append((words, (1000 if unit == "mm" else 1) * float(value), unit))

    for sensor in study.sensors_mm:
        add_quantity(f"crop factor, {sensor}", cube["crop_factor"].sel(sensor=sensor), "1")
        across = cube["angle_of_view"].sel(sensor=sensor, side="width")
        for focal, angle in zip(study.focal_lengths_mm, across, strict=True):
            add_quantity(f"angle of view across, {sensor}, {focal:g} mm", angle, "degree")
    for i, width in enumerate(study.widths_px):
        add_quantity(f"marker contrast, {width} px", cube["marker_contrast"][i], "percent")
        add_quantity(f"variance kept, {width} px", cube["variance_kept"][i], "percent")
    add_quantity("colour error", cube["colour_error"], "percent")
    add_quantity("largest colour error", cube["largest_colour_error"], "percent")
    add_quantity("centre shift by colour", cube["centre_shift"], "px")
    for i, N in enumerate(study.f_numbers):
        add_quantity(f"hyperfocal distance, f/{N:g}", cube["hyperfocal_distance"][i], "mm")
    for distance in study.distances_mm:
        at, here = cube.sel(distance=round(distance / 1000, 9)), f"{distance:g} mm"
        add_quantity(f"error of one depth, {here}", at["projection_error"], "px")
        for i, N in enumerate(study.f_numbers):
            for words in ("near", "far"):
                add_quantity(f"{words} limit, f/{N:g}, {here}", at[f"{words}_limit"][i], "mm")
        for i, b in enumerate(study.baselines_mm):
            for words, name in (("", "depth_error"), (" in whole pixels", "rounded_depth_error")):
                add_quantity(f"depth error{words}, {b:g} mm apart, {here}", at[name][i], "mm")
    return list_quantities(rows)


FINEST_SIZE_PX = (1280, 720)  # px, of the image from which all others are averaged
STRIP_STEP_PX = 80  # px of it; the rows of the strip are a multiple, so that every block fits
RAYS_PER_PIXEL = 2  # rays across a pixel of it, in both directions
TABLE_COLOUR, BEAM_COLOUR, MARKER_COLOUR = np.array(
    [[0.10, 0.16, 0.28], [0.84, 0.80, 0.72], [0.07, 0.06, 0.06]]
)
CELL_RATIO = 2 / 3  # part of spacing and beam's width that is searched for a marker's centre
CROP_SIZE_PX = (24, 36)  # rows and columns of the part that is shown


@dataclass(frozen=True)
class BeamPicture:
    """Image of a beam in a camera, pixel by pixel."""

    #: Share of each pixel that the beam and its markers cover, shape (rows, columns)
    beam: Array
    markers: Array
    camera: CameraArray  #: The camera, with ``FINEST_SIZE_PX`` pixels
    structure: Beam  #: The beam
    top: int  #: Row of the camera's image at which the strip begins

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
        """Return the contrast of a pixel on a marker to one midway, 1 for large markers.

        It is the mean over the markers and gaps in the image.
        """
        cover = optics.block_means(self.markers, block)
        x, found = self.structure.markers[0], []
        for places in (x, (x[1:] + x[:-1]) / 2):
            column, row = np.floor(self.images(places, block)).astype(int)
            inside = (row >= 0) & (row < len(cover)) & (column >= 0) & (column < cover.shape[1])
            found.append(cover[row[inside], column[inside]])
        on, off = found
        return float(on.mean() - off.mean()) if len(on) and len(off) else np.nan

    def cells(self, block: int) -> IntArray:
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
        whole, across, down = (
            np.bincount(cells[inside], (dark * by)[inside], n) for by in (np.ones_like(u), u, v)
        )
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.stack([across / whole, down / whole], axis=-1)


def draw_beam(
    structure: Beam, distance: float, azimuth: float, elevation: float, focal: float, marker: float
) -> BeamPicture:
    """Draw a beam at rest, with round markers on its axis, as a camera on the hemisphere sees it.

    The camera stands at a `distance` in m from its centre, in the direction `azimuth`, `elevation`
    in rad; `focal` is its focal length over the sensor's width, `marker` a diameter in m.
    """
    camera = hemisphere_cameras(
        distance, [azimuth], [elevation], focal * FINEST_SIZE_PX[0], FINEST_SIZE_PX
    )
    length, width = structure.extent
    corners = np.array([[-1, -1, 1, 1], [-1, 1, -1, 1], [0, 0, 0, 0]]) / 2
    v = project(camera.P, corners * [[length], [width], [0]])[0, 1] / STRIP_STEP_PX
    steps = FINEST_SIZE_PX[1] // STRIP_STEP_PX
    first = np.clip(np.floor(v.min()), 0, steps - 1)
    last = np.clip(np.ceil(v.max()), first + 1, steps)
    top, rows = int(first) * STRIP_STEP_PX, int(last - first) * STRIP_STEP_PX
    shape = (rows * RAYS_PER_PIXEL, FINEST_SIZE_PX[0] * RAYS_PER_PIXEL)
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


def colour_loss(picture: BeamPicture, block: int, pattern: str) -> dict[str, ArrayLike]:
    """Pass an image through colour filters and interpolate it back bilinearly.

    `block` is the side of the sensor's pixels in finest ones, `pattern` has the colours of the
    top-left two by two pixels. ``colour_picture`` (stage, rows, columns, 3) is the part around the
    largest marker: as it is, with each pixel in its filter's colour alone, and interpolated. The
    errors are the rms and the largest difference of the interpolated colours from the true ones on
    the beam, in % of full scale; ``centre_shift`` is the rms shift of the markers' centres by it,
    in px of each coordinate.
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
    stages = true, np.where(masks, raw[..., None], 0.0), found
    return {
        "colour_picture": np.array([stage[part] for stage in stages], "f4"),
        "colour_error": 100 * float(np.sqrt(np.mean(difference**2))),
        "largest_colour_error": 100 * float(np.max(np.abs(difference))),
        "centre_shift": float(np.sqrt(np.mean(moved**2))) if len(moved) else np.nan,
    }


def _crop(picture: BeamPicture, block: int, marker: int) -> tuple[slice, slice]:
    shape = (picture.beam.shape[0] // block, picture.beam.shape[1] // block)
    u, v = picture.images(picture.structure.markers[0][[marker]], block)[:, 0]
    parts = []
    for middle, size, whole in zip((v, u), CROP_SIZE_PX, shape, strict=True):
        start = int(np.clip(round(middle - size / 2), 0, max(whole - size, 0)))
        start -= start % 2  # so that the filters' pattern begins as the sensor's does
        parts.append(slice(start, min(start + size, whole)))
    return parts[0], parts[1]
