"""Tables of ``cameras``, from its cube: whole ones beside the figures, short ones in the text."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
import xarray as xr
from IPython.display import Markdown

from thesis_lib.facts import setups
from thesis_lib.facts.numbers import StatedNumber, read_numbers
from thesis_lib.vision.optics import picture_height
from thesis_lib.web.markdown import columns, escape, table

NORMAL_MM = 50  # the lens of eq. 2.20
PRINTED = {  # stated numbers of eq. 2.20 by side
    "width": "view-across",
    "height": "view-up",
    "diagonal": "view-diagonal",
}
WORDS = {"width": "across", "height": "up", "diagonal": "diagonally"}


def show(cube: xr.Dataset, name: str) -> Markdown:
    """One of :data:`TABLES`, for a notebook."""
    return Markdown(TABLES[name](cube))


def _asked(cube: xr.Dataset, name: str) -> Any:
    """A parameter of the run."""
    return json.loads(cube.attrs["parameters"])[name]


def _at_distances(cube: xr.Dataset, short: bool = False) -> list[xr.Dataset]:
    """The cube at each of the distances that were asked for, or at the first and the last."""
    places = cube["shown_distance"].values
    parts = [cube.sel(distance=place, shown_distance=place) for place in places]
    return parts[:: max(len(parts) - 1, 1)] if short else parts


def _mm(metres: xr.DataArray, digits: int = 0) -> str:
    value = 1000 * float(metres)
    return "∞" if np.isinf(value) else "–" if np.isnan(value) else f"{value:.{digits}f}"


def _depths(part: xr.Dataset) -> str:
    return f"{_mm(part['nearest_depth'])}–{_mm(part['farthest_depth'])}"


def _three(metres: xr.DataArray) -> str:
    """Millimetres with three digits that count."""
    value = 1000 * float(metres)
    return "–" if np.isnan(value) else f"{value:.{max(0, 2 - int(np.floor(np.log10(value))))}f}"


def _stated(name: str) -> StatedNumber:
    return next(number for number in read_numbers() if number.id == name)


def angles(cube: xr.Dataset) -> str:
    """Angles of view across, of every sensor and focal length."""
    focal = cube["focal_length"].values
    rows = [
        [
            escape(str(sensor)),
            *(
                f"{float(cube['angle_of_view'].sel(sensor=sensor, side='width')[i]):.1f}"
                for i in range(len(focal))
            ),
        ]
        for sensor in cube["sensor"].values
    ]
    return table(["sensor", *(f"{1000 * f:g} mm" for f in focal)], rows) + (
        "\nAngle of view across the width of the sensor, in degrees.\n"
    )


def sensors(cube: xr.Dataset) -> str:
    """Sizes, crop factors, and what the book's lens sees on each sensor."""
    focal = _asked(cube, "focal_length_mm")
    at = int(np.argmin(np.abs(cube["focal_length"].values - focal / 1000)))
    focal = 1000 * float(cube["focal_length"][at])
    rows = []
    for sensor in cube["sensor"].values:
        one = cube.sel(sensor=sensor)
        width, height, diagonal = one["sensor_size"].values * 1000
        crop = float(one["crop_factor"])
        angle = float(one["angle_of_view"].sel(side="width")[at])
        rows.append(
            {
                "sensor": escape(str(sensor)),
                "size, mm": f"{width:g}×{height:g}",
                "diagonal, mm": f"{diagonal:.1f}",
                "crop factor": f"{crop:.2f}",
                f"{focal:g} mm sees, °": f"{angle:.1f}",
                "acts like, mm": f"{crop * focal:.0f}",
            }
        )
    return columns(rows)


def normal_lens(cube: xr.Dataset) -> str:
    """Equation 2.20 computed, and how much of the beam such a lens and the book's see."""
    one = cube.isel(sensor=0).sel(focal_length=NORMAL_MM / 1000)
    rows = []
    for side, name in PRINTED.items():
        angle, stated = float(one["angle_of_view"].sel(side=side)), _stated(name)
        mark = "" if stated.low <= angle <= stated.high else " (a misprint)"
        size = 1000 * float(one["sensor_size"].sel(side=side))
        rows.append([WORDS[side], f"{size:.2f}", f"{angle:.1f}", stated.stated + mark])
    nearest = min(_asked(cube, "distances_mm"))
    half = np.radians(float(one["angle_of_view"].sel(side="width"))) / 2
    used, width = _asked(cube, "focal_length_mm"), _asked(cube, "sensor_width_mm")
    return table(["side", "length, mm", "angle of view, °", "printed, °"], rows) + (
        f"\nFrom {nearest:g} mm this lens sees {2 * nearest * np.tan(half):.0f} mm of what lies "
        f"across its axis, and the beam is {1000 * setups.beam().length:.0f} mm long. The "
        f"{used:g} mm lens of this book, on a sensor {width:g} mm wide, sees "
        f"{nearest * width / used:.0f} mm.\n"
    )


def formats(cube: xr.Dataset) -> str:
    """Table 2.1: heights of usual pictures, and their numbers of pixels."""
    heights = cube["format_height"]
    names = [str(ratio) for ratio in heights["ratio"].values]
    rows = []
    for width in heights["format_width"].values.tolist():
        rows_of = [int(heights.sel(ratio=ratio, format_width=width)) for ratio in names]
        rows.append(
            [
                str(width),
                *(f"{width}×{height}" for height in rows_of),
                f"{width * rows_of[0] / 1e6:.2f}",
            ]
        )
    return table(["width, px", *names, f"million pixels, {names[0]}"], rows)


def projections(cube: xr.Dataset, short: bool = False) -> str:
    """What one depth for all markers does to their images."""
    rows = [
        {
            "distance, mm": _mm(part["distance"]),
            "depths of the markers, mm": _depths(part),
            "spread, ± %": f"{float(part['depth_range']):.1f}",
            "largest error of one depth, px": f"{float(part['projection_error']):.1f}",
            "in % of the row": f"{float(part['relative_projection_error']):.1f}",
        }
        for part in _at_distances(cube, short)
    ]
    return columns(rows)


def pixels(cube: xr.Dataset) -> str:
    """Size of a pixel on the beam, contrast of the markers, variance kept."""
    size = _asked(cube, "marker_mm") / 1000
    rows = [
        {
            "pixels across": str(int(part["width"])),
            "pixel, mm": f"{1000 * float(part['pixel_size']):.2f}",
            "across a marker": f"{size / float(part['pixel_size']):.1f}",
            "contrast, %": f"{float(part['marker_contrast']):.0f}",
            "variance kept, %": f"{float(part['variance_kept']):.0f}",
        }
        for part in (cube.isel(width=i) for i in range(cube.sizes["width"]))
    ]
    return columns(rows)


def colours(cube: xr.Dataset) -> str:
    """What colour filters cost."""
    width = max(_asked(cube, "widths_px"))
    rows = [
        ["rms error of the colours on the beam", f"{float(cube['colour_error']):.1f} %"],
        ["largest error", f"{float(cube['largest_colour_error']):.0f} %"],
        ["rms shift of the markers' centres", f"{float(cube['centre_shift']):.3f} px"],
    ]
    return table([f"interpolated colours, {width} pixels across", ""], rows)


def focus(cube: xr.Dataset, short: bool = False) -> str:
    """Sharp depths at each distance, beside those of the markers."""
    numbers = cube["f_number"].values
    rows = []
    for part in _at_distances(cube, short):
        sharp = [
            f"{_mm(part['near_limit'][i])}–{_mm(part['far_limit'][i])}" for i in range(len(numbers))
        ]
        rows.append([_mm(part["distance"]), *sharp, _depths(part)])
    header = ["focused at, mm", *(f"f/{N:g}" for N in numbers), "the markers lie at"]
    far = ", ".join(
        f"{float(h):.1f} m at f/{N:g}"
        for N, h in zip(numbers, cube["hyperfocal_distance"].values, strict=True)
    )
    nearest = _at_distances(cube)[int(np.argmin(cube["shown_distance"].values))]
    return table(header, rows) + (
        f"\nDepths in mm that a {_asked(cube, 'focal_length_mm'):g} mm lens keeps sharp, with a "
        f"circle of confusion of {_asked(cube, 'circle_mm'):g} mm, or {float(cube['circle']):.2f} "
        f"px of a picture {_asked(cube, 'resolution_px')[0]} px wide. Focused at {far} or farther, "
        f"infinity is sharp. From {_mm(nearest['distance'])} mm an image is "
        f"{100 * float(nearest['magnification']):.1f} % of its object's size, and its plane as "
        "many percent farther from the lens than the focal length.\n"
    )


def stereo(cube: xr.Dataset, short: bool = False) -> str:
    """Depth errors of parallel cameras, with fine centres and with whole pixels."""
    baselines = cube["baseline"].values
    rows = []
    for part in _at_distances(cube, short):
        cells = [
            f"{_three(part['depth_error'][i])} / {_three(part['rounded_depth_error'][i])}"
            for i in range(len(baselines))
        ]
        rows.append([_mm(part["distance"]), *cells])
    ratio = cube["rounded_depth_error"] / cube["rounding_depth_error"]
    header = ["distance, mm", *(f"b = {1000 * b:g} mm" for b in baselines)]
    return table(header, rows) + (
        "\nErrors of the depth in mm: of first order, if the disparity is wrong by "
        f"{_asked(cube, 'disparity_error_px'):g} px / rms of {_asked(cube, 'trials')} drawings, if "
        "it is the difference of whole pixels. For whole pixels the drawn errors are "
        f"{float(ratio.min()):.2f} to {float(ratio.max()):.2f} times those of first order.\n"
    )


def horizons(cube: xr.Dataset) -> str:
    """Where the images of the beam's parallel edges meet."""
    rows = []
    for part in _at_distances(cube):
        u, v = part["vanishing_point"].values
        rows.append(
            [_mm(part["distance"]), f"({u:.1f}, {v:.1f})", f"{float(part['edge_angle']):.2f}"]
        )
    width, height = _asked(cube, "resolution_px")
    header = ["distance, mm", "the edges meet at (u, v), px", "angle between them, °"]
    return table(header, rows) + f"\nThe picture is {width}×{height} px.\n"


def flows() -> list[tuple[int, int, float]]:
    """Width and pixels of a frame, and frames per second, at a chapter 5 camera's pixel rate."""
    widths = setups.table("beam", "resolution")["widths_px"]
    rate = setups.table("experiment", "rig")["frame_rate_hz"]
    pixels = {width: width * picture_height(width, 16, 9) for width in widths}
    most = max(pixels.values())
    return [(width, number, rate * most / number) for width, number in pixels.items()]


def flow(cube: xr.Dataset) -> str:
    """What the pixels per second of a camera of chapter 5 are worth at other resolutions."""
    rows = [
        {
            "frames, px": f"{width}×{number // width}",
            "million pixels": f"{number / 1e6:.2f}",
            "frames per second": f"{rate:.0f}",
            "highest frequency, Hz": f"{rate / 2:.0f}",
        }
        for width, number, rate in flows()
    ]
    _, number, rate = flows()[0]
    return columns(rows) + (
        f"\nAll at {rate * number / 1e6:.0f} million pixels per second; two frames are the least "
        "for a period.\n"
    )


TABLES: dict[str, Callable[[xr.Dataset], str]] = {
    "angles": angles,
    "projections": projections,
    "pixels": pixels,
    "colours": colours,
    "focus": focus,
    "stereo": stereo,
}
SHORT: Sequence[Callable[..., str]] = (projections, focus, stereo)
PIECES: dict[str, Callable[[xr.Dataset], str]] = {
    "flow": flow,
    "formats": formats,
    "sensors": sensors,
    "lens": normal_lens,
    "pixels": pixels,
    "colours": colours,
    "horizons": horizons,
    **{made.__name__: partial(made, short=True) for made in SHORT},
}
