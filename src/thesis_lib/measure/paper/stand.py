"""Where cameras stand, on paper: a protractor for under the structure's centre, and a table."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from thesis_lib.measure.paper.page import PaperError, area, write
from thesis_lib.measure.recordings.manifest_model import CameraFiles
from thesis_lib.plotting.style import color, drawable

PLACE = ("azimuth_deg", "elevation_deg", "distance_mm")
MIDDLE: dict[str, Any] = {"ha": "center", "va": "center"}


def write_stand(path: Path, cameras: Sequence[CameraFiles], paper: str = "A4") -> None:
    """Write a protractor with a ray to each camera, and how far and how high it stands.

    Parameters
    ----------
    path : Path
        The file.
    cameras : sequence of CameraFiles
        With ``azimuth_deg``, ``elevation_deg`` and ``distance_mm``.
    paper : str
        Size of the page.

    Raises
    ------
    PaperError
        If a camera has no place.
    """
    for camera in cameras:
        for name in PLACE:
            if getattr(camera, name) is None:
                raise PaperError(f"camera {camera.name}: {name} is not given, allowed: a number")
    wide, high = area(paper, landscape=False)
    radius = min(wide, high) / 2 - 12

    def draw(axes: Axes) -> None:
        centre = np.array([wide / 2, high - radius - 10])

        def to(azimuth: float, length: float) -> tuple[float, float]:
            angle = np.radians(azimuth)  # from +Y, upward on the sheet, towards +X
            x, y = centre + length * np.array([np.sin(angle), np.cos(angle)])
            return float(x), float(y)

        for azimuth in map(float, range(-180, 180, 5)):
            ends = to(azimuth, radius - (6 if azimuth % 10 == 0 else 3)), to(azimuth, radius)
            axes.plot(*np.transpose(ends), "k-", lw=0.4)
            if azimuth % 30 == 0:
                axes.text(*to(azimuth, radius + 5), f"{azimuth:g}°", size=7, **MIDDLE)
        for name, azimuth in (("X", 90.0), ("Y", 0.0)):
            axes.annotate("", to(azimuth, 26), to(0, 0), arrowprops={"arrowstyle": "->", "lw": 0.8})
            axes.text(*to(azimuth, 30), name, size=9, **MIDDLE)
        lines = [
            "Lay the sheet under the structure's centre, X along its length.",
            "Each camera stands on its ray, so far and so high with the middle of its lens:",
        ]
        names = drawable([camera.name for camera in cameras], "camera")
        for k, camera in enumerate(cameras):
            azimuth, elevation, distance = (float(getattr(camera, name) or 0.0) for name in PLACE)
            axes.plot(*np.transpose([centre, to(azimuth, radius)]), color=color(k), lw=1.2)
            axes.text(*to(azimuth, 0.8 * radius), names[k], size=10, color=color(k))
            away, above = (distance * f(np.radians(elevation)) for f in (np.cos, np.sin))
            lines.append(
                f"{names[k]}: azimuth {azimuth:g}°, elevation {elevation:g}°; {away:.0f} mm "
                f"along its ray, {above:.0f} mm above the structure; {distance:g} mm from its "
                "centre"
            )
        for k, line in enumerate(lines):
            axes.text(4, high - 2 * radius - 24 - 6 * k, line, size=8)

    write(path, paper, False, [(draw, "")])
