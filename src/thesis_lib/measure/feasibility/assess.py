"""What a manifest's recordings can reach, and what they cannot, before anything is measured.

What the manifest does not say is NaN; no warning follows from it.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations

import numpy as np

from thesis_lib.arrays import Array, Mask
from thesis_lib.measure.feasibility.limits import DEVIATIONS, LIMIT, Assessment, Warning
from thesis_lib.measure.feasibility.outlook import (
    CameraOutlook,
    RigOutlook,
    Sight,
    errors_of,
    outlook,
    rms_and_worst,
    sight_of,
    steady_seconds,
)
from thesis_lib.measure.feasibility.predictions import alias
from thesis_lib.measure.feasibility.unchecked import unchecked
from thesis_lib.measure.fitting.models import model_of
from thesis_lib.measure.recordings.manifest_model import CameraFiles, Manifest

CENTRE_NOISE_PX = 0.03  # rendered recordings scatter 0.016 px lossless to 0.03 px in H.264
MODES = 3  # natural frequencies above the driven one that are looked at: what rings longest
MANY = 100  # natural frequencies among which these are sought
OTHER_MODE = 1.2  # of the driven frequency, from which a natural one is that of another mode


def assess(manifest: Manifest, noise_px: float = CENTRE_NOISE_PX) -> Assessment:
    """What the manifest's recordings can reach, what they cannot, and what it does not tell.

    Parameters
    ----------
    manifest : Manifest
        The manifest; no file is read.
    noise_px : float
        Scatter of the centres that the standard errors assume, px.
    """
    amplitude = float(manifest.excitation.amplitude_mm or np.nan) / 1000
    steady, slowest = steady_seconds(manifest), min(c.rate_hz for c in manifest.cameras)
    with np.errstate(all="ignore"):  # what is not given is NaN
        sight = sight_of(manifest, float(np.nan_to_num(amplitude)))
        table = [outlook(manifest, sight, i, amplitude) for i in range(len(manifest.cameras))]
        errors = errors_of(manifest, sight, amplitude, noise_px)
        one, fit, rounding = map(rms_and_worst, errors)
        rig = RigOutlook(
            int(sight.located.sum()),
            noise_px,
            steady,
            int(steady * slowest + 1e-9),
            one,
            fit,
            rounding,
            DEVIATIONS * fit[1],
        )
        warnings = _of_times(manifest)
        for i, (camera, row) in enumerate(zip(manifest.cameras, table, strict=True)):
            where = f"cameras[{i}]"
            warnings += _of_rate(manifest, camera.rate_hz, f"{where}.frame_rate_hz")
            warnings += _of_camera(manifest, camera, row, where)
            warnings += _of_view(manifest, camera, row, where, sight.corners[i])
        warnings += _of_rig(manifest, sight, rig, errors[0])
    return Assessment(tuple(warnings), tuple(unchecked(manifest)), tuple(table), rig)


def _those(where: str, texts: Mapping[str, object]) -> list[Warning]:
    """Warnings by code, or by field and code; those without a text do not hold."""
    found = []
    for key, text in texts.items():
        *field, code = key.split()
        if text:
            found.append(Warning(code, ".".join(filter(None, [where, *field])), str(text)))
    return found


def _of_times(manifest: Manifest) -> list[Warning]:
    """Rest and steady part, for the slowest camera."""
    e, steady = manifest.excitation, steady_seconds(manifest)
    rate = min(c.rate_hz for c in manifest.cameras)
    rest, given, f = e.rest_s, e.steady_s, np.float64(e.frequency_hz or np.nan)
    least, few, turns = (LIMIT[c] for c in ("few-rest-frames", "few-frames", "few-periods"))
    begin = given[0] if given else np.inf
    rest_given, part = f"given {rest:g} s, ", f"given {steady:g} s, "
    texts = {
        "rest_s short-rest": rest < LIMIT["short-rest"]
        and f"{rest_given}allowed: {LIMIT['short-rest']:g} s or more",
        "rest_s few-rest-frames": rest * rate < least
        and (
            f"{rest_given}{rest * rate:.3g} frames at {rate:g} Hz, allowed: {least / rate:.3g} s "
            "or more"
        ),
        "steady_s few-frames": given
        and steady * rate < few
        and f"{part}{steady * rate:.3g} frames at {rate:g} Hz, allowed: {few / rate:.3g} s or more",
        "steady_s few-periods": given
        and steady * f < turns
        and f"{part}{steady * f:.2g} periods, allowed: {turns / f:.3g} s or more",
        "steady_s steady-at-rest": rest - begin > LIMIT["steady-at-rest"]
        and f"given from {begin:g} s, allowed: not before the rest's end, {rest:g} s",
    }
    return _those("excitation", texts)


def _of_rate(manifest: Manifest, rate: float, where: str) -> list[Warning]:
    """One frame rate against the vibration and the structure's own frequencies."""
    s, steady, f = manifest.structure, steady_seconds(manifest), manifest.excitation.frequency_hz
    if f is None:
        return []
    seen, known = alias(f, rate), manifest.excitation.undersampled
    given = f"given {rate:g} Hz, {rate / f:.3g} frames a period of {f:.6g} Hz"
    folded = f >= LIMIT["undersampled"] * rate
    near = f > LIMIT["near-nyquist"] * rate
    edge, off, turns = min(seen, rate / 2 - seen), LIMIT["alias"] / steady, LIMIT["alias-edge"]
    texts = {
        "undersampled": folded
        and not known
        and (
            f"{given}, seen at {seen:.4g} Hz; allowed: above {2 * f:.6g} Hz, or "
            "excitation.undersampled: true for a frequency that is known well"
        ),
        "alias": folded
        and known
        and (
            f"{given}, seen at {seen:.4g} Hz; in {steady:g} s the frequency must be known to "
            f"{off:.2g} Hz and the camera's clock to {off / f:.1g} of the time"
        ),
        "alias-edge": folded
        and known
        and edge * steady < turns
        and (
            f"{given}, seen {edge:.3g} Hz from 0 or half the rate; allowed: {turns / steady:.3g} "
            "Hz or more, by another rate or a longer steady part"
        ),
        "near-nyquist": near
        and not folded
        and f"{given}; allowed: {f / LIMIT['near-nyquist']:.6g} Hz or more",
        "few-samples": rate < LIMIT["few-samples"] * f
        and not near
        and f"{given}; allowed: {LIMIT['few-samples'] * f:.6g} Hz or more",
    }
    found = _those(where, texts)
    model = model_of(s)
    if model is None:
        return found
    many = model.angular_frequencies(MANY) / (2 * np.pi)
    others = many[many > OTHER_MODE * f][:MODES]
    for k, own in enumerate(others):
        rings = alias(own, rate)
        if own >= rate / 2 and (k == 0 or abs(rings - seen) * steady < LIMIT["higher-modes"]):
            text = (
                f"given {rate:g} Hz; what rings at the structure's {own:.4g} Hz is seen at "
                f"{rings:.3g} Hz, the vibration at {seen:.3g} Hz; to see it where it is: above "
                f"{2 * own:.4g} Hz"
            )
            return [*found, Warning("higher-modes", where, text)]
    return found


def _of_camera(
    manifest: Manifest, camera: CameraFiles, row: CameraOutlook, where: str
) -> list[Warning]:
    """Exposure and lens of one camera."""
    f, exposure = np.float64(manifest.excitation.frequency_hz or np.nan), camera.exposure_s
    focal, distance = camera.focal_length_mm or np.nan, camera.distance_mm or np.nan
    stop, most = camera.f_number or np.nan, LIMIT["motion-blur"] * np.float64(row.across_px)
    limit, sharp = LIMIT["long-exposure"], LIMIT["depth-of-field"]
    given = f"given {exposure:.4g} s, which "
    texts = {
        "exposure_s long-exposure": f * exposure > limit
        and f"{given}takes {row.lost:.1%} of the amplitude, allowed: {limit / f:.2g} s or less",
        "exposure_s motion-blur": row.blur_px > most
        and (
            f"given {exposure:.4g} s, in which an image moves {row.blur_px:.3g} px, allowed: "
            f"{most:.2g} px, so {exposure * most / row.blur_px:.2g} s or less"
        ),
        "distance_mm too-near": distance <= LIMIT["too-near"] * focal
        and f"given {distance:g}, allowed: more than focal_length_mm, {focal:g}",
        "f_number depth-of-field": row.defocus_px > sharp
        and (
            f"given {stop:g}, sharp from {row.near_mm:.0f} to {row.far_mm:.0f} mm; markers lie "
            f"from {row.nearest_mm:.0f} to {row.farthest_mm:.0f} mm, spread by up to "
            f"{row.defocus_px:.2g} px; allowed: {stop * row.defocus_px / sharp:.3g} or more, or a "
            "greater distance"
        ),
    }
    return _those(where, texts)


def _of_view(
    manifest: Manifest, camera: CameraFiles, row: CameraOutlook, where: str, corners: Mask
) -> list[Warning]:
    """Place of one camera, and how it sees markers and corners."""
    elevation, distance = camera.elevation_deg or np.nan, camera.distance_mm or np.nan
    low, high, coarse = LIMIT["shallow-view"], LIMIT["steep-view"], LIMIT["coarse"]
    thin, free, gate = (LIMIT[c] for c in ("foreshortened", "crowded-markers", "large-move"))
    still = LIMIT["small-motion"]
    lost = camera.corners_px is None and not np.isnan(row.in_view) and not corners.all()
    diameter, tilt = manifest.structure.markers.diameter_mm, f"given {elevation:g}, allowed: "
    texts = {
        "distance_mm coarse": row.along_px < coarse
        and (
            f"given {distance:g}, markers are {row.along_px:.2g} px wide, allowed: {coarse:g} px, "
            f"from {distance * row.along_px / coarse:.3g} mm or with more pixels"
        ),
        "elevation_deg foreshortened": row.across_px < thin
        and (
            f"given {elevation:g}, markers are {row.across_px:.2g} px high, allowed: {thin:g} px; "
            "raise the camera, come nearer, or take larger markers"
        ),
        "elevation_deg shallow-view": elevation < low and f"{tilt}{low:g} or more",
        "elevation_deg steep-view": elevation > high
        and f"{tilt}{high:g} or less; deflection hardly moves the images",
        "elevation_deg crowded-markers": row.gap_px < free
        and (
            f"given {elevation:g}, images of neighbours are {row.gap_px:.2g} px apart, allowed: "
            f"{free:g} px; raise the camera, come nearer, or use markers below {diameter:g} mm"
        ),
        "distance_mm small-motion": row.motion_px < still
        and (
            f"given {distance:g}, images move {row.motion_px:.2g} px, of which compressed films "
            f"lose a tenth or more; allowed: {still:g} px, from "
            f"{distance * row.motion_px / still:.3g} mm, with more pixels, or without loss"
        ),
        "distance_mm out-of-view": row.in_view < LIMIT["out-of-view"]
        and (
            f"given {distance:g}, {row.in_view:.0%} of the markers stay in the picture; go farther "
            "or take a shorter lens"
        ),
        "corners_px out-of-view": lost
        and (
            f"given null, {4 - np.count_nonzero(corners)} of the structure's corners are not in "
            "the picture; go farther, or give where they would be"
        ),
        "frame_rate_hz large-move": row.move_spacings > gate
        and (
            f"given {camera.rate_hz:g} Hz, markers move {row.move_spacings:.2g} of a spacing "
            f"a frame, allowed: {gate:g} until the tracker knows the motion; begin gently or film "
            "faster"
        ),
    }
    return _those(where, texts)


def _of_rig(manifest: Manifest, sight: Sight, rig: RigOutlook, errors: Array) -> list[Warning]:
    """All cameras together."""
    on, least = np.flatnonzero(sight.located), LIMIT["same-line"]
    found = []
    for i, j in combinations(on, 2):
        angle = np.degrees(np.arccos(min(abs(sight.directions[i] @ sight.directions[j]), 1.0)))
        found += _those(
            f"cameras[{j}].azimuth_deg",
            {
                "same-line": angle < least
                and (
                    f"given {manifest.cameras[j].azimuth_deg:g}, {angle:.2g}° from the line "
                    f"of sight of cameras[{i}], allowed: {least:g}° or more"
                ),
            },
        )
    if len(on) < max(len(sight.located), 2):  # the others may see more
        return found
    amplitude, most = manifest.excitation.amplitude_mm or np.nan, LIMIT["weak-markers"]
    lost, best = int(np.isnan(errors).sum()), np.fmin.reduce(errors)
    weak = np.count_nonzero(errors > most * best)
    texts = {
        "cameras lost-markers": lost
        and f"{lost} of {len(errors)} markers stay in the picture of fewer than two cameras",
        "cameras weak-markers": weak
        and (
            f"{weak} of {len(errors)} markers err up to {rig.one_frame[1] / best:.3g} times as "
            f"much as the best, allowed: {most:g} times; see them from more sides"
        ),
        "excitation.amplitude_mm below-noise": amplitude < rig.smallest_mm < np.inf
        and (
            f"given {amplitude:g}, allowed: {rig.smallest_mm:.2g} or more at {rig.steady_s:g} s of "
            "steady recording; come nearer or record longer"
        ),
    }
    return found + _those("", texts)
