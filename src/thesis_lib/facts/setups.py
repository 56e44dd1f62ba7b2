"""The thesis's structures, camera setups and open assumptions, read from ``data/thesis``.

Structures are those of Tables 3.1 and 4.1, setups those of Tables 3.3, 3.4, 4.3, 4.4, 6.1 and 6.2.

A *setting* is one entry of a parametric study: some cameras at given directions, one distance and
one resolution, with the value of the parameter that is varied. A study is a list of settings in
the order of the thesis's tables.

*Assumptions* fill gaps of the thesis; a *reading* in the code is another interpretation of it.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import accumulate
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from thesis_lib.files import shipped
from thesis_lib.vibration.structure import Beam, Plate

if TYPE_CHECKING:
    from thesis_lib.vision.pinhole import CameraArray


Direction = tuple[float, float]  # azimuth, elevation in degrees
CENTRES_DEG = {"2a": 0.0, "2c": -90.0}  # middle of the arc at constant elevation
MIN_CAMERA_ANGLE_RAD = 1e-6  # least angle between directions of two cameras
OPPOSITE_DEG = {"2b": (90.0, -90.0), "2d": (0.0, 180.0)}  # the two sides of the arc overhead


@dataclass(frozen=True)
class Setting:
    """One camera setup of a study."""

    case: str  #: The thesis's case, such as ``2a``, or the name of a layout
    value: float  #: Value of the varied parameter
    label: str  #: The value as printed in figures and tables
    distance_mm: float  #: Distance of all cameras from the structure's centre
    directions_deg: tuple[Direction, ...]  #: Azimuth and elevation of each camera
    resolution_px: tuple[int, int]  #: Width and height of the sensor
    #: ``printed``, ``reversed``, or empty where the order of adding pairs has no meaning
    pair_order: str = ""

    def swap_axes(self) -> Setting:
        """Return the setting with its azimuths measured from +X towards +Y."""
        directions = tuple((90 - azimuth, elevation) for azimuth, elevation in self.directions_deg)
        return replace(self, directions_deg=directions)

    def cameras(self, focal_length_mm: float, sensor_width_mm: float) -> CameraArray:
        """Return the setting's cameras; the pixels are square and fill the sensor's width."""
        from thesis_lib.vision.pinhole import hemisphere_cameras  # late: files are read without it

        azimuth, elevation = np.radians(self.directions_deg).T
        distance, size = self.distance_mm / 1000, self.resolution_px
        focal_px = focal_length_mm * size[0] / sensor_width_mm
        return hemisphere_cameras(distance, azimuth, elevation, focal_px, size)

    def coincident_cameras(self) -> list[list[Direction]]:
        """Return the directions of each two cameras that stand at one place."""
        from thesis_lib.vision.pinhole import hemisphere_directions

        places = hemisphere_directions(*np.radians(self.directions_deg).T)
        apart = np.linalg.norm(places[:, None] - places, axis=2)
        pairs = np.argwhere(np.triu(apart < MIN_CAMERA_ANGLE_RAD, k=1))
        return [[self.directions_deg[camera] for camera in pair] for pair in pairs]


def data_folder() -> Path:
    """Return the folder with the data of the thesis."""
    return shipped() / "data" / "thesis"


@cache
def read_toml(name: str) -> dict[str, Any]:
    """Read a TOML file of :func:`data_folder`, as plain values."""
    return tomllib.loads((data_folder() / name).read_text(encoding="utf-8"))


def thesis_beam(first_marker: float | None = None) -> Beam:
    """Return the thesis's cantilever beam (Table 3.1), perhaps with another first marker (m)."""
    return Beam(**read_toml("structures.toml")["beam"], first_marker=first_marker)


def thesis_plate(grid: tuple[int, int] | None = None) -> Plate:
    """Return the thesis's plate (Table 4.1), with another grid of markers if one is given."""
    facts = dict(read_toml("structures.toml")["plate"])
    facts["force_position"] = tuple(facts["force_position"])
    facts["grid"] = tuple(grid or facts["grid"])
    return Plate(**facts)


def setup_table(structure: str, study: str) -> dict[str, Any]:
    """Return one study's entry of the tables: its printed parameters and figure numbers."""
    return dict(read_toml("setups.toml")[structure][study])


def camera_pairs() -> dict[str, list[list[Direction]]]:
    """Return the camera pairs of Table 3.4 by case, in printed order."""
    return read_toml("setups.toml")["pairs"]


def figure_number(structure: str, study: str, case: str, mode: int) -> str:
    """Return the number of the thesis's figure for a case and mode, or empty if it has none.

    Examples
    --------
    >>> figure_number("beam", "aperture", "2b", 3)
    '3.12'
    """
    first = _of_cases(structure, study, "figures").get(case)
    if first is None or mode not in (1, 2, 3):
        return ""
    chapter, number = first.split(".")
    return f"{chapter}.{int(number) + mode - 1}"


def case_title(structure: str, study: str, case: str) -> str:
    """Describe a case of the thesis in a few words; empty for a user's layout."""
    return _of_cases(structure, study, "titles").get(case, "")


def _of_cases(structure: str, study: str, what: str) -> dict[str, str]:
    """Return an entry of the tables by case; empty for a study that is not the thesis's."""
    return read_toml("setups.toml").get(structure, {}).get(study, {}).get(what, {})


def distance_settings(
    distances_mm: Sequence[float],
    azimuth_deg: float,
    elevation_deg: float,
    resolution_px: tuple[int, int],
) -> list[Setting]:
    """Return the settings of case 1: a pair at ± azimuth and growing distance."""
    pair = ((azimuth_deg, elevation_deg), (-azimuth_deg, elevation_deg))
    return [Setting("1", d, f"{d:g} mm", d, pair, resolution_px) for d in distances_mm]


def aperture_settings(
    cases: Sequence[str],
    half_apertures_deg: Sequence[float],
    elevations_deg: Sequence[float],
    elevation_deg: float,
    distance_mm: float,
    resolution_px: tuple[int, int],
) -> list[Setting]:
    """Return cases 2a, 2c (arc at constant elevation) and 2b, 2d (arc overhead: α = 180° − 2φ)."""
    settings = []
    for case in cases:
        if case in CENTRES_DEG:
            centre = CENTRES_DEG[case]
            pairs_of_case = [
                (2 * half, ((centre + half, elevation_deg), (centre - half, elevation_deg)))
                for half in half_apertures_deg
            ]
        else:
            one, other = OPPOSITE_DEG[case]
            pairs_of_case = [(180 - 2 * phi, ((one, phi), (other, phi))) for phi in elevations_deg]
        settings += [
            Setting(case, alpha, f"{alpha:g}°", distance_mm, pair, resolution_px)
            for alpha, pair in pairs_of_case
        ]
    return settings


def resolution_settings(
    widths_px: Sequence[int], distance_mm: float, azimuth_deg: float, elevation_deg: float
) -> list[Setting]:
    """Return the settings of case 3: one pair, growing 16:9 resolution."""
    pair = ((azimuth_deg, elevation_deg), (-azimuth_deg, elevation_deg))
    sizes = [(w, round(w * 9 / 16)) for w in widths_px]
    return [Setting("3", w, f"{w}×{h}", distance_mm, pair, (w, h)) for w, h in sizes]


def array_settings(
    cases: Sequence[str],
    pair_order: Mapping[str, str],
    layouts: Mapping[str, Sequence[Sequence[Direction]]],
    distance_mm: float,
    resolution_px: tuple[int, int],
) -> list[Setting]:
    """Return the settings of cases 4a–4e, pairs added one by one; then those of a user's layouts.

    Parameters
    ----------
    cases : sequence of str
        Cases of Table 3.4.
    pair_order : mapping
        ``printed`` or ``reversed`` by case; cases not named are taken as printed.
    layouts : mapping
        By name: a list of growing sets of ``(azimuth, elevation)`` in degrees.
    distance_mm : float
        Distance of all cameras.
    resolution_px : tuple of int
        Width and height of the sensor.
    """
    grown: list[tuple[str, str, Sequence[Sequence[Direction]]]] = []
    for case in cases:
        order = pair_order.get(case, "printed")
        pairs = camera_pairs()[case][:: -1 if order == "reversed" else 1]
        grown.append((case, order, list(accumulate(pairs))))
    grown += [(name, "", sets) for name, sets in layouts.items()]
    settings = []
    for case, order, sets in grown:
        for cameras in sets:
            n, directions = len(cameras), tuple((float(a), float(e)) for a, e in cameras)
            at = distance_mm, directions, resolution_px
            settings.append(Setting(case, n, f"{n} cameras", *at, order))
    return settings


ADOPTED_READING = "adopted"


READINGS: dict[str, dict[str, Any]] = {
    one["name"]: one["values"] for one in read_toml("assumptions.toml")["interpretation"]
}
"""By interpretation of the thesis: the parameters that differ; a study uses those that it has."""


def list_assumptions() -> list[dict[str, Any]]:
    """Return the assumptions made where the thesis states nothing, item by item."""
    return read_toml("assumptions.toml")["assumption"]


def assumed_values(subject: str) -> dict[str, Any]:
    """Return the assumed parameters for beam, plate, sound, experiment or lab."""
    return {
        name: value
        for item in list_assumptions()
        if subject in item["subjects"]
        for name, value in item.get("parameters", {}).items()
    }
