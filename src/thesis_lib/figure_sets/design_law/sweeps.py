"""Part (c) of ``design-law``: the thesis's findings in expectation, one parameter at a time."""

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from thesis_lib.arrays import Array, ArrayLike
from thesis_lib.facts import setups
from thesis_lib.figure_sets.design_law.figure_set import DesignLaw
from thesis_lib.figure_sets.parametric.figure_set import camera_study
from thesis_lib.vibration.structure import Structure, deflection_shape, world_points
from thesis_lib.vision import cone_law, rounding, simulation, triangulation
from thesis_lib.vision.pinhole import CameraArray, hemisphere_cameras, pixelate, project

SWEPT_MODES = (1, 2, 3)
STRUCTURES: dict[str, Callable[[], Structure]] = {
    "beam": setups.thesis_beam,
    "plate": setups.thesis_plate,
}
SWEPT_FINDINGS = ("distance", "resolution", "number", "elevation", "aperture")
SWEEP_STEPS = 61
WIDE_DEG = 60.0  # aperture whose error is compared with the least
CONE_MOTION_PX = 4.0  # range of random motions on the cone; fractions of a px are equally likely
AMPLITUDE_RANGE = (0.5, 1.5)  # of averaged amplitudes, relative to the thesis's


def sweep_values(structure: str, finding: str) -> Array:
    """Return the values of a sweep over the range of the thesis: mm, px, cameras or degrees."""
    if finding == "number":
        return np.arange(3.0, SWEEP_STEPS + 3.0)
    printed = setups.setup_table(structure, "aperture" if finding == "elevation" else finding)
    if finding == "aperture":
        return np.linspace(2.0 * min(printed["half_apertures_deg"]), 180.0, SWEEP_STEPS)
    names = {"elevation": "elevations_deg", "distance": "distances_mm", "resolution": "widths_px"}
    ends = min(printed[names[finding]]), max(printed[names[finding]])
    if finding == "elevation":
        return np.linspace(*ends, SWEEP_STEPS)
    values: Array = np.geomspace(*ends, SWEEP_STEPS)
    return np.rint(values) if finding == "resolution" else values


def step_rig(
    study: DesignLaw, structure: str, finding: str, value: float
) -> tuple[CameraArray, float, float]:
    """Return the cameras of one step, otherwise as in the thesis, and two closed-form errors.

    These are errors of a deflection at the centre in m: by rounding with averaged amplitudes, and
    by independent noise of the same size in every coordinate.
    """
    size = study.resolution_px
    if finding == "resolution":
        size = int(value), round(value * 9 / 16)
    focal = study.focal_length_mm / study.sensor_width_mm * size[0]
    if finding == "number":
        angle, distance = np.radians(study.cone_deg), study.cone_distance_mm / 1000
        error = cone_law.cone_deflection_error(distance, focal, int(value), angle)
        cone = cone_law.cone_cameras(distance, angle, int(value), focal, size)
        return cone, float(error), float(error)
    printed = setups.setup_table(structure, "aperture" if finding == "elevation" else finding)
    distance = (value if finding == "distance" else printed["distance_mm"]) / 1000
    aperture = value if finding == "aperture" else 2 * printed.get("azimuth_deg", 90.0)
    elevation = value if finding == "elevation" else printed["elevation_deg"]
    opening, tilt = np.radians([aperture, elevation])
    azimuth = np.array([opening, -opening]) / 2
    pair = hemisphere_cameras(distance, azimuth, np.full(2, tilt), focal, size)
    laws = cone_law.pair_deflection_error, cone_law.pair_noise_error
    rounding_error, noise = (float(law(distance, focal, opening, tilt)) for law in laws)
    return pair, rounding_error, noise


def mode_shapes(structure: Structure, peak: float) -> Array:
    """Return the markers (3, 1 + modes, m) in m at rest and in each mode with a peak in m."""
    bent = [deflection_shape(structure, mode, structure.markers, peak) for mode in SWEPT_MODES]
    return world_points(structure, np.array([np.zeros_like(bent[0]), *bent]))


def noise_error(cameras: CameraArray, points: Array) -> float:
    """Return the rms error in m of markers (3, m) by independent noise, 1/6 px² per coordinate."""
    g = triangulation.triangulation_gain(cameras.P, points)[2]
    return float(cone_law.MOTION_PX * np.sqrt(np.mean(np.sum(g**2, axis=(0, 1)))))


def predicted_rms(cameras: CameraArray, points: Array) -> float:
    """Return the rms deflection error in m of markers (3, 1 + modes, m) by the law of rounding.

    It is averaged over 0.5 to 1.5 times their amplitudes; the first markers are at rest.
    """
    g = triangulation.triangulation_gain(cameras.P, points[:, 0])[2]
    images = project(cameras.P, points)
    moved = images[:, :, 1:] - images[:, :, :1]
    variance = rounding.mean_difference_variance(moved, *AMPLITUDE_RANGE)
    return float(np.sqrt(np.mean(np.sum(g[:, :, None] ** 2 * variance, axis=(0, 1)))))


def exact_rms(cameras: CameraArray, points: Array) -> float:
    """Return the rms error in m of markers (3, 1 + modes, m), the first of which are at rest."""
    variance = rounding.deflection_variance(cameras.P, points[:, :1], points[:, 1:])
    return float(np.sqrt(np.mean(variance)))


def with_std(name: str, found: Iterable[ArrayLike]) -> dict[str, ArrayLike]:
    """Return rms errors and their standard errors as two variables by name."""
    return dict(zip((name, f"{name}_std"), found, strict=True))


def fit_findings(study: DesignLaw) -> dict[str, ArrayLike]:
    """Compute errors and exponents by distance, resolution, number, elevation and aperture."""
    values = np.empty((len(SWEPT_FINDINGS), len(STRUCTURES), SWEEP_STEPS))
    kinds = ("expected", "exact", "centre", "noisy", "noisy_centre", "small")
    found = np.empty((len(kinds), *values.shape))
    errors = dict(zip(kinds, found, strict=True))
    # Exponents are of cos φ for elevations; the aperture has none
    exponents = {
        kind: np.full(values.shape[:2], np.nan) for kind in ("expected", "centre", "small")
    }
    best, gained = np.empty((2, 2, len(STRUCTURES)))
    for s, (name, make) in enumerate(STRUCTURES.items()):
        peak = float(setups.assumed_values(name)["amplitude_mm"]) / 1000
        tiny_peak = study.small_amplitude_mm / 1000
        points, tiny = mode_shapes(make(), peak), mode_shapes(make(), tiny_peak)
        peaks = np.array([peak] * 5 + [tiny_peak])
        for f, finding in enumerate(SWEPT_FINDINGS):
            values[f, s] = sweep_values(name, finding)
            for i, value in enumerate(values[f, s]):
                cameras, centre, noisy_centre = step_rig(study, name, finding, value)
                rounded = predicted_rms(cameras, points), exact_rms(cameras, points), centre
                noisy = noise_error(cameras, points[:, 0]), noisy_centre
                metres = np.array([*rounded, *noisy, exact_rms(cameras, tiny)])
                found[:, f, s, i] = 100 * metres / peaks
            if finding != "aperture":
                low = finding == "elevation"
                base = np.cos(np.radians(values[f, s])) if low else values[f, s]
                for kind, powers in exponents.items():
                    powers[f, s] = simulation.fit_exponent(base, errors[kind][f, s])
        # Every degree, since at a single amplitude the law has many dips
        apertures = np.arange(10.0, 181.0)
        tried = [step_rig(study, name, "aperture", one)[0] for one in (*apertures, WIDE_DEG)]
        for k, law in enumerate((exact_rms, predicted_rms)):
            *each, wide = [law(cameras, points) for cameras in tried]
            least = int(np.argmin(each))
            best[k, s], gained[k, s] = apertures[least], wide / each[least]
    return {
        "swept": values,
        **{f"{kind}_error": errors[kind] for kind in kinds if kind != "small"},
        **{f"{kind}_exponent": powers for kind, powers in exponents.items()},
        "best_aperture": best,
        "wide_gain": gained,
    }


def thesis_study(study: DesignLaw, structure: str, part: str) -> Any:
    """Return one of the studies of chapters 3 and 4, with this study's lens, trials and seed."""
    names = ("focal_length_mm", "sensor_width_mm", "trials", "seed")
    return camera_study(f"{structure}-{part}", {name: getattr(study, name) for name in names})


def fit_arrays(study: DesignLaw) -> dict[str, ArrayLike]:
    """Fit the exponent of the error in the number of cameras, for the thesis's growing arrays."""
    found = np.empty((len(setups.camera_pairs()), len(STRUCTURES)))
    for s, (name, make) in enumerate(STRUCTURES.items()):
        points = mode_shapes(make(), float(setups.assumed_values(name)["amplitude_mm"]) / 1000)
        settings = thesis_study(study, name, "arrays").settings()
        for c, case in enumerate(setups.camera_pairs()):
            grown = [setting for setting in settings if setting.case == case]
            lens = study.focal_length_mm, study.sensor_width_mm
            errors = [predicted_rms(one.cameras(*lens), points) for one in grown]
            found[c, s] = simulation.fit_exponent(
                [len(one.directions_deg) for one in grown], errors
            )
    return {"array_exponent": found}


ELEVATIONS_DEG = (10.0, 25.0, 60.0)
APERTURES_DEG = (16.0, 60.0, 120.0, 180.0)
SWING_PX = 1.0  # range of random motions; all fractions of a pixel are equally likely
DRAWS_PER_TRIAL = 20


def pair_errors(study: DesignLaw) -> dict[str, ArrayLike]:
    """Return deflection errors of the centre by a pair of cameras: closed forms and simulated.

    Images at rest and moved are rounded on the same grid, or have independent noise, whose
    difference has the same variance, 1/6 px² per coordinate.
    """
    distance, size = study.cone_distance_mm / 1000, study.resolution_px
    focal = study.focal_length_mm / study.sensor_width_mm * size[0]
    shape = (len(ELEVATIONS_DEG), len(APERTURES_DEG))
    closed, noisy = np.empty((2, *shape))
    drawn, drawn_noisy = np.empty((2, 2, *shape))  # rms and its standard error
    random = np.random.default_rng([study.seed, 2])
    n = DRAWS_PER_TRIAL * study.trials
    for at in np.ndindex(shape):
        tilt, opening = np.radians(ELEVATIONS_DEG[at[0]]), np.radians(APERTURES_DEG[at[1]])
        P = hemisphere_cameras(distance, [opening / 2, -opening / 2], [tilt, tilt], focal, size).P
        moved = np.zeros((3, 2, n))
        moved[2, 1] = random.uniform(0, SWING_PX * distance / focal / np.cos(tilt), n)
        images = project(P, moved)
        shift = random.uniform(-0.5, 0.5, (2, 2, 1, n))
        # Half of 1/6 px² in each of the two images.
        noise = cone_law.MOTION_PX / np.sqrt(2) * random.standard_normal(images.shape)
        rounded = pixelate(images + shift) - shift
        for found, seen in ((drawn, rounded), (drawn_noisy, images + noise)):
            height = triangulation.triangulate(P, seen)[2]
            found[:, *at] = simulation.rms_with_std(height[1] - height[0] - moved[2, 1])
        closed[at] = cone_law.pair_deflection_error(distance, focal, opening, tilt)
        noisy[at] = cone_law.pair_noise_error(distance, focal, opening, tilt)
    return {
        "pair_error": closed,
        **with_std("drawn_pair_error", drawn),
        "pair_noise_error": noisy,
        **with_std("drawn_pair_noise_error", drawn_noisy),
    }
