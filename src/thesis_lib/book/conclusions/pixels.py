"""An array of the thesis against the best of its own pairs, made sharper until pixels are equal.

Whether more cameras or finer ones measure better cannot be told from arrays that grow from a poor
pair: there the number and the places change together. Here they are apart. All cameras of a case
have N W H pixels; each of its pairs gets as many, so W is √(N/2) times as wide; and the law of
rounding says what either measures.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from thesis_lib.arrays import Array
from thesis_lib.facts import readings, setups
from thesis_lib.facts.setups import Direction, Setting
from thesis_lib.figure_sets.design_law.sweeps import STRUCTURES, shapes
from thesis_lib.figure_sets.parametric.parameters import camera_study
from thesis_lib.ledger.trends import MATERIAL
from thesis_lib.vision.pinhole import CameraArray, hemisphere_cameras
from thesis_lib.vision.rounding import deflection_variance
from thesis_lib.web.markdown import columns


@dataclass(frozen=True)
class Equal:
    """Errors by the law in %, rms over markers and modes, at equal pixels."""

    #: What is measured, and the growing array of the thesis
    structure: str
    case: str
    n_cameras: int  #: All cameras of the case
    #: Error of all of them, and of the best of its pairs with as many pixels
    array: float
    pair: float

    @property
    def ratio(self) -> float:
        """The pair's error over the array's."""
        return self.pair / self.array


def equal_pixels() -> Iterator[Equal]:
    """Every growing array of chapters 3 and 4, with the lens and amplitude of the studies."""
    for name, make in STRUCTURES.items():
        study = camera_study(f"{name}-arrays")
        settings, points = study.settings(), shapes(make(), study.peaks_m[0])
        for case in setups.pairs():
            whole = [one for one in settings if one.case == case][-1]
            directions, n = whole.directions_deg, len(whole.directions_deg)
            pairs = [directions[i : i + 2] for i in range(0, n, 2)]
            array = _error(_rig(whole, directions, 1), points)
            best = min(_error(_rig(whole, pair, np.sqrt(n / 2)), points) for pair in pairs)
            yield Equal(name, case, n, array, best)


def _error(rig: CameraArray, points: Array) -> float:
    """Rms over the modes of the error of markers (3, 1 + modes, m), in % of each mode's largest."""
    variance = deflection_variance(rig.P, points[:, :1], points[:, 1:])
    largest = np.max(np.abs(points[2, 1:]), axis=1)
    return float(100 * np.sqrt(np.mean(variance / largest[:, None] ** 2)))


def _rig(setting: Setting, directions: Sequence[Direction], finer: float) -> CameraArray:
    """Cameras of a setting in some directions, with `finer` times its pixels across."""
    reading = readings.reading("beam")
    across = finer * setting.resolution_px[0]
    focal = reading["focal_length_mm"] / reading["sensor_width_mm"] * across
    width, height = (round(finer * side) for side in setting.resolution_px)
    azimuth, elevation = np.radians(directions).T
    return hemisphere_cameras(
        setting.distance_mm / 1000, azimuth, elevation, focal, (width, height)
    )


def pixels() -> str:
    """Arrays and pairs at equal pixels, as a table and a sentence."""
    found = list(equal_pixels())
    rows = [
        {
            "": one.structure,
            "case": one.case,
            "cameras": str(one.n_cameras),
            "all of them, %": f"{one.array:.1f}",
            "its best pair, sharper, %": f"{one.pair:.1f}",
            "pair over all": f"×{one.ratio:.2f}",
        }
        for one in found
    ]
    ratios = np.array([one.ratio for one in found])
    worse = [f"{one.structure} {one.case}" for one in found if one.ratio > 1 + MATERIAL]
    better = int(np.sum(ratios < 1 - MATERIAL))
    words = f", {', '.join(worse)}" if worse else ""
    return columns(rows) + (
        "\nRms over markers and the three modes, by the law of rounding, at equal pixels in all. "
        "So an array's error differs a little from the medians of trials, mode by mode, that the "
        "[beam](beam.md#what-comes-out) and the [plate](plate.md) have.\n\n"
        f"Of {len(found)} pairs {len(worse)} {'is' if len(worse) == 1 else 'are'} worse by more "
        f"than {MATERIAL:.0%}{words}; {better} "
        f"are better by more than that; the median ratio is ×{np.median(ratios):.2f}.\n"
    )
