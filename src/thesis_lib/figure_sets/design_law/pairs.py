"""Part (c) of ``design-law``: what the aperture of a pair is worth, to rounding and to noise."""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from thesis_lib.figure_sets.design_law.parameters import DesignLaw
from thesis_lib.figure_sets.design_law.share_tables import asked, sampling
from thesis_lib.vision.cone_law import MOTION_PX, pair_deflection_error, pair_noise_error
from thesis_lib.vision.estimators import rms_with_std
from thesis_lib.vision.pinhole import hemisphere_cameras, pixelate, project
from thesis_lib.vision.triangulation import triangulate
from thesis_lib.web.markdown import table

TILTS = (10.0, 25.0, 60.0)  # degrees, elevations
OPENINGS = (16.0, 60.0, 120.0, 180.0)  # degrees, apertures
SWING_PX = 1.0  # range of random motions: every fraction of a pixel alike
DRAWS = 20  # for each trial


def pairs(study: DesignLaw) -> dict[str, ArrayLike]:
    """Deflections of the centre, seen by a pair: closed forms, and drawn by triangulation.

    Rounded on grids that rest and moved image share, and with noise of the same 1/6 px² that every
    image coordinate has by itself.
    """
    distance, size = study.cone_distance_mm / 1000, study.resolution_px
    focal = study.focal_length_mm / study.sensor_width_mm * size[0]
    shape = (len(TILTS), len(OPENINGS))
    closed, noisy = np.empty((2, *shape))
    drawn, drawn_noisy = np.empty((2, 2, *shape))  # rms and its standard error
    random = np.random.default_rng([study.seed, 2])
    n = DRAWS * study.trials
    for at in np.ndindex(shape):
        tilt, opening = np.radians(TILTS[at[0]]), np.radians(OPENINGS[at[1]])
        P = hemisphere_cameras(distance, [opening / 2, -opening / 2], [tilt, tilt], focal, size).P
        moved = np.zeros((3, 2, n))
        moved[2, 1] = random.uniform(0, SWING_PX * distance / focal / np.cos(tilt), n)
        images = project(P, moved)
        shift = random.uniform(-0.5, 0.5, (2, 2, 1, n))
        # Half of 1/6 px² in each of the two images.
        noise = MOTION_PX / np.sqrt(2) * random.standard_normal(images.shape)
        for found, seen in (
            (drawn, pixelate(images + shift) - shift),
            (drawn_noisy, images + noise),
        ):
            height = triangulate(P, seen)[2]
            found[:, *at] = rms_with_std(height[1] - height[0] - moved[2, 1])
        closed[at] = pair_deflection_error(distance, focal, opening, tilt)
        noisy[at] = pair_noise_error(distance, focal, opening, tilt)
    return {
        "pair_error": closed,
        "drawn_pair_error": drawn[0],
        "drawn_pair_error_std": drawn[1],
        "pair_noise_error": noisy,
        "drawn_pair_noise_error": drawn_noisy[0],
        "drawn_pair_noise_error_std": drawn_noisy[1],
    }


def paired(cube: xr.Dataset) -> str:
    """Rounding and independent noise side by side, by elevation and aperture."""
    names = ("pair_error", "drawn_pair_error", "pair_noise_error", "drawn_pair_noise_error")
    rows = [
        [
            f"{tilt:g}°",
            f"{opening:g}°",
            *(f"{1000 * float(cube[name].sel(tilt=tilt, opening=opening)):.2f}" for name in names),
        ]
        for tilt in cube["tilt"].values
        for opening in cube["opening"].values
    ]
    header = [
        "elevation",
        "aperture",
        "rounded, mm",
        "drawn, mm",
        "independent noise, mm",
        "drawn, mm",
    ]
    distance = asked(cube, "cone_distance_mm")
    return table(header, rows) + (
        f"\nA deflection of the centre, {distance:g} mm from two cameras, over one pixel "
        "of motions; the noise is as large in every coordinate as rounding is in one that moves. "
        f"{sampling(cube, 'drawn_pair_error', 'drawn_pair_noise_error')}\n"
    )
