"""Tables of ``cameras``, from its cube: whole ones next to the figures, short ones in the text."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import xarray as xr
from IPython.display import Markdown

from thesis_lib.facts import setups
from thesis_lib.facts.numbers import read_numbers
from thesis_lib.templates import render
from thesis_lib.vision.optics import picture_height

NORMAL_MM = 50  # the lens of eq. 2.20
CLAIMED_NUMBERS = {  # claimed numbers of eq. 2.20 by side
    "width": "view-across",
    "height": "view-up",
    "diagonal": "view-diagonal",
}
SIDE_WORDS = {"width": "across", "height": "up", "diagonal": "diagonally"}


def show_table(cube: xr.Dataset, name: str) -> Markdown:
    """Show one of :data:`TABLES` in a notebook."""
    return Markdown(TABLES[name](cube))


def _table_parameter(cube: xr.Dataset, name: str) -> Any:
    """Return a parameter of the run."""
    return json.loads(cube.attrs["parameters"])[name]


def _at_distances(cube: xr.Dataset, short: bool = False) -> list[xr.Dataset]:
    """Return the cube at each of the distances asked for, or at the first and the last."""
    places = cube["shown_distance"].values
    parts = [cube.sel(distance=place, shown_distance=place) for place in places]
    return parts[:: max(len(parts) - 1, 1)] if short else parts


def _fill(name: str, cube: xr.Dataset, **values: Any) -> str:
    return render(__file__, name, cube=cube, asked=json.loads(cube.attrs["parameters"]), **values)


def list_sensors(cube: xr.Dataset) -> str:
    """List sizes, crop factors, and the view of the book's lens on each sensor."""
    at = int(
        np.argmin(
            np.abs(cube["focal_length"].values - _table_parameter(cube, "focal_length_mm") / 1000)
        )
    )
    focal = 1000 * float(cube["focal_length"][at])
    parts = [cube.isel(sensor=i, focal_length=at) for i in range(cube.sizes["sensor"])]
    return _fill("sensors", cube, sensors=parts, focal=focal)


def normal_lens(cube: xr.Dataset) -> str:
    """Compute equation 2.20, and the length of beam that such a lens and the book's see."""
    one = cube.isel(sensor=0).sel(focal_length=NORMAL_MM / 1000)
    numbers = {number.id: number for number in read_numbers()}
    rows = [
        (SIDE_WORDS[side], one.sel(side=side), numbers[name])
        for side, name in CLAIMED_NUMBERS.items()
    ]
    nearest = min(_table_parameter(cube, "distances_mm"))
    half = np.radians(float(one["angle_of_view"].sel(side="width"))) / 2
    return _fill(
        "lens",
        cube,
        rows=rows,
        nearest=nearest,
        seen=2 * nearest * np.tan(half),
        beam=1000 * setups.thesis_beam().length,
    )


def list_focus(cube: xr.Dataset, short: bool = False) -> str:
    """List sharp depths at each distance, and those of the markers."""
    nearest = _at_distances(cube)[int(np.argmin(cube["shown_distance"].values))]
    return _fill("focus", cube, parts=_at_distances(cube, short), nearest=nearest)


def list_stereo(cube: xr.Dataset, short: bool = False) -> str:
    """List depth errors of parallel cameras, with fine centres and with whole pixels."""
    ratio = cube["rounded_depth_error"] / cube["rounding_depth_error"]
    return _fill(
        "stereo", cube, parts=_at_distances(cube, short), ratio=ratio, digits=_three_digits
    )


def _three_digits(metres: xr.DataArray) -> str:
    """Format a length in millimetres with three significant digits."""
    value = 1000 * float(metres)
    return "–" if np.isnan(value) else f"{value:.{max(0, 2 - int(np.floor(np.log10(value))))}f}"


def _along_distances(name: str, cube: xr.Dataset, short: bool = False) -> str:
    return _fill(name, cube, parts=_at_distances(cube, short))


def list_pixels(cube: xr.Dataset) -> str:
    """List the size of a pixel on the beam, contrast of the markers, variance kept."""
    return _fill("pixels", cube, parts=[cube.isel(width=i) for i in range(cube.sizes["width"])])


def pixel_flows() -> list[tuple[int, int, float]]:
    """Return width and pixels of a frame, and frames per second, at a chapter 5 pixel rate."""
    widths = setups.setup_table("beam", "resolution")["widths_px"]
    rate = setups.setup_table("experiment", "rig")["frame_rate_hz"]
    pixels = {width: width * picture_height(width, 16, 9) for width in widths}
    most = max(pixels.values())
    return [(width, number, rate * most / number) for width, number in pixels.items()]


def list_flow(cube: xr.Dataset) -> str:
    """Show what the pixels per second of a chapter 5 camera give at other resolutions."""
    return _fill("flow", cube, flows=pixel_flows())


Table = Callable[[xr.Dataset], str]
projections = partial(_along_distances, "projections")
TABLES: dict[str, Table] = {
    "angles": partial(_fill, "angles"),
    "projections": projections,
    "pixels": list_pixels,
    "colours": partial(_fill, "colours"),
    "focus": list_focus,
    "stereo": list_stereo,
}
PIECES: dict[str, Table] = {
    "flow": list_flow,
    "formats": partial(_fill, "formats"),
    "sensors": list_sensors,
    "lens": normal_lens,
    "pixels": list_pixels,
    "colours": partial(_fill, "colours"),
    "horizons": partial(_along_distances, "horizons"),
    "projections": partial(projections, short=True),
    "focus": partial(list_focus, short=True),
    "stereo": partial(list_stereo, short=True),
}
