"""What a manifest's recordings can reach, and what they cannot, before anything is measured.

What the manifest does not say is NaN; no warning follows from it.
"""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from itertools import combinations

import numpy as np

from thesis_lib.arrays import Array, Mask
from thesis_lib.measure.feasibility.limits import DEVIATIONS, LIMIT, Assessment, Warning
from thesis_lib.measure.feasibility.outlook import (
    OPTICS,
    STEADY_S,
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
from thesis_lib.measure.recordings.manifest_model import CameraFiles, Manifest

COLUMNS = 100
_HEAD = ("camera", "mm/px", "size px", "gap px", "blur px", "lost", "sharp mm", "depths mm",
         "view", "px/frame", "spacings")  # fmt: skip


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
    steady, slowest = steady_seconds(manifest), min(c.frame_rate_hz for c in manifest.cameras)
    with np.errstate(all="ignore"):  # what is not given is NaN
        sight = sight_of(manifest, float(np.nan_to_num(amplitude)))
        table = [outlook(manifest, sight, i, amplitude) for i in range(len(manifest.cameras))]
        errors = errors_of(manifest, sight, amplitude, noise_px)
        one, fit, rounding = map(rms_and_worst, errors)
        rig = RigOutlook(int(sight.located.sum()), noise_px, steady, int(steady * slowest + 1e-9),
                         one, fit, rounding, DEVIATIONS * fit[1])  # fmt: skip
        warnings = _of_times(manifest)
        for i, (camera, row) in enumerate(zip(manifest.cameras, table, strict=True)):
            where = f"cameras[{i}]"
            warnings += _of_rate(manifest, camera.frame_rate_hz, f"{where}.frame_rate_hz")
            warnings += _of_camera(manifest, camera, row, where)
            warnings += _of_view(manifest, camera, row, where, sight.corners[i])
        warnings += _of_rig(manifest, sight, rig, errors[0])
    return Assessment(tuple(warnings), tuple(_unknown(manifest)), tuple(table), rig)


_Case = tuple[object, str, str, str]  # whether it holds, code, field, text


def _those(*cases: _Case) -> list[Warning]:
    return [Warning(code, where, text) for holds, code, where, text in cases if holds]


def _of_times(manifest: Manifest) -> list[Warning]:
    """Rest and steady part, for the slowest camera."""
    e, steady, rate = manifest.excitation, steady_seconds(manifest), min(
        c.frame_rate_hz for c in manifest.cameras
    )  # fmt: skip
    rest, given, f = e.rest_s, e.steady_s, np.float64(e.frequency_hz or np.nan)
    least, few, turns = (LIMIT[c] for c in ("few-rest-frames", "few-frames", "few-periods"))
    begin = given[0] if given else np.inf
    rest_given, part = f"given {rest:g} s, ", f"given {steady:g} s, "
    return _those(
        (rest < LIMIT["short-rest"], "short-rest", "excitation.rest_s",
         f"{rest_given}allowed: {LIMIT['short-rest']:g} s or more"),
        (rest * rate < least, "few-rest-frames", "excitation.rest_s",
         f"{rest_given}{rest * rate:.3g} frames at {rate:g} Hz, allowed: {least / rate:.3g} s or "
         "more"),
        (given and steady * rate < few, "few-frames", "excitation.steady_s",
         f"{part}{steady * rate:.3g} frames at {rate:g} Hz, allowed: {few / rate:.3g} s or more"),
        (given and steady * f < turns, "few-periods", "excitation.steady_s",
         f"{part}{steady * f:.2g} periods, allowed: {turns / f:.3g} s or more"),
        (rest - begin > LIMIT["steady-at-rest"], "steady-at-rest", "excitation.steady_s",
         f"given from {begin:g} s, allowed: not before the rest's end, {rest:g} s"),
    )  # fmt: skip


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
    found = _those(
        (folded and not known, "undersampled", where,
         f"{given}, seen at {seen:.4g} Hz; allowed: above {2 * f:.6g} Hz, or "
         "excitation.undersampled: true for a frequency that is known well"),
        (folded and known, "alias", where,
         f"{given}, seen at {seen:.4g} Hz; in {steady:g} s the frequency must be known to "
         f"{off:.2g} Hz and the camera's clock to {off / f:.1g} of the time"),
        (folded and known and edge * steady < turns, "alias-edge", where,
         f"{given}, seen {edge:.3g} Hz from 0 or half the rate; allowed: {turns / steady:.3g} Hz "
         "or more, by another rate or a longer steady part"),
        (near and not folded, "near-nyquist", where,
         f"{given}; allowed: {f / LIMIT['near-nyquist']:.6g} Hz or more"),
        (rate < LIMIT["few-samples"] * f and not near, "few-samples", where,
         f"{given}; allowed: {LIMIT['few-samples'] * f:.6g} Hz or more"),
    )  # fmt: skip
    if s.kind == "flat":
        return found
    model = s.beam if s.kind == "beam" else s.plate
    many = model.angular_frequencies(MANY) / (2 * np.pi)
    others = many[many > OTHER_MODE * f][:MODES]
    for k, own in enumerate(others):
        rings = alias(own, rate)
        if own >= rate / 2 and (k == 0 or abs(rings - seen) * steady < LIMIT["higher-modes"]):
            text = (f"given {rate:g} Hz; what rings at the structure's {own:.4g} Hz is seen at "
                    f"{rings:.3g} Hz, the vibration at {seen:.3g} Hz; to see it where it is: above "
                    f"{2 * own:.4g} Hz")  # fmt: skip
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
    given = f"given {exposure:.4g} s, "
    return _those(
        (f * exposure > limit, "long-exposure", f"{where}.exposure_s",
         f"{given}which takes {row.lost:.1%} of the amplitude, allowed: {limit / f:.2g} s or less"),
        (row.blur_px > most, "motion-blur", f"{where}.exposure_s",
         f"{given}in which an image moves {row.blur_px:.3g} px, allowed: {most:.2g} px, so "
         f"{exposure * most / row.blur_px:.2g} s or less"),
        (distance <= LIMIT["too-near"] * focal, "too-near", f"{where}.distance_mm",
         f"given {distance:g}, allowed: more than focal_length_mm, {focal:g}"),
        (row.defocus_px > sharp, "depth-of-field", f"{where}.f_number",
         f"given {stop:g}, sharp from {row.near_mm:.0f} to {row.far_mm:.0f} mm; markers lie from "
         f"{row.nearest_mm:.0f} to {row.farthest_mm:.0f} mm, spread by up to "
         f"{row.defocus_px:.2g} px; allowed: {stop * row.defocus_px / sharp:.3g} or more, or a "
         "greater distance"),
    )  # fmt: skip


def _of_view(
    manifest: Manifest, camera: CameraFiles, row: CameraOutlook, where: str, corners: Mask
) -> list[Warning]:
    """Place of one camera, and how it sees markers and corners."""
    elevation, distance = camera.elevation_deg or np.nan, camera.distance_mm or np.nan
    low, high, coarse = LIMIT["shallow-view"], LIMIT["steep-view"], LIMIT["coarse"]
    thin, free, gate = (LIMIT[c] for c in ("foreshortened", "crowded-markers", "large-move"))
    lost = camera.corners_px is None and not np.isnan(row.in_view) and not corners.all()
    diameter, tilt = manifest.structure.markers.diameter_mm, f"given {elevation:g}, allowed: "
    return _those(
        (row.along_px < coarse, "coarse", f"{where}.distance_mm",
         f"given {distance:g}, markers are {row.along_px:.2g} px wide, allowed: {coarse:g} px, "
         f"from {distance * row.along_px / coarse:.3g} mm or with more pixels"),
        (row.across_px < thin, "foreshortened", f"{where}.elevation_deg",
         f"given {elevation:g}, markers are {row.across_px:.2g} px high, allowed: {thin:g} px; "
         "raise the camera, come nearer, or take larger markers"),
        (elevation < low, "shallow-view", f"{where}.elevation_deg", f"{tilt}{low:g} or more"),
        (elevation > high, "steep-view", f"{where}.elevation_deg",
         f"{tilt}{high:g} or less; deflection hardly moves the images"),
        (row.gap_px < free, "crowded-markers", f"{where}.elevation_deg",
         f"given {elevation:g}, images of neighbours are {row.gap_px:.2g} px apart, allowed: "
         f"{free:g} px; raise the camera, come nearer, or use markers below {diameter:g} mm"),
        (row.in_view < LIMIT["out-of-view"], "out-of-view", f"{where}.distance_mm",
         f"given {distance:g}, {row.in_view:.0%} of the markers stay in the picture; go farther "
         "or take a shorter lens"),
        (lost, "out-of-view", f"{where}.corners_px",
         f"given null, {4 - np.count_nonzero(corners)} of the structure's corners are not in the "
         "picture; go farther, or give where they would be"),
        (row.move_spacings > gate, "large-move", f"{where}.frame_rate_hz",
         f"given {camera.frame_rate_hz:g} Hz, markers move {row.move_spacings:.2g} of a spacing a "
         f"frame, allowed: {gate:g} until the tracker knows the motion; begin gently or film "
         "faster"),
    )  # fmt: skip


def _of_rig(manifest: Manifest, sight: Sight, rig: RigOutlook, errors: Array) -> list[Warning]:
    """All cameras together."""
    on, least = np.flatnonzero(sight.located), LIMIT["same-line"]
    found = []
    for i, j in combinations(on, 2):
        angle = np.degrees(np.arccos(min(abs(sight.directions[i] @ sight.directions[j]), 1.0)))
        found += _those((angle < least, "same-line", f"cameras[{j}].azimuth_deg",
                         f"given {manifest.cameras[j].azimuth_deg:g}, {angle:.2g}° from the line "
                         f"of sight of cameras[{i}], allowed: {least:g}° or more"))  # fmt: skip
    if len(on) < max(len(sight.located), 2):  # the others may see more
        return found
    amplitude, most = manifest.excitation.amplitude_mm or np.nan, LIMIT["weak-markers"]
    lost, best = int(np.isnan(errors).sum()), np.fmin.reduce(errors)
    weak = np.count_nonzero(errors > most * best)
    return found + _those(
        (lost, "lost-markers", "cameras",
         f"{lost} of {len(errors)} markers stay in the picture of fewer than two cameras"),
        (weak, "weak-markers", "cameras",
         f"{weak} of {len(errors)} markers err up to {rig.one_frame[1] / best:.3g} times as much "
         f"as the best, allowed: {most:g} times; see them from more sides"),
        (amplitude < rig.smallest_mm < np.inf, "below-noise", "excitation.amplitude_mm",
         f"given {amplitude:g}, allowed: {rig.smallest_mm:.2g} or more at {rig.steady_s:g} s of "
         "steady recording; come nearer or record longer"),
    )  # fmt: skip


def _unknown(manifest: Manifest) -> list[str]:
    """Checks that could not be made, and the fields that they need."""
    needs = {
        "ground sample distance": OPTICS[:3],
        "view": OPTICS,
        "errors": OPTICS,
        "depth of field": (*OPTICS, "f_number"),
    }
    groups: dict[tuple[str, str], list[str]] = {}
    for camera in manifest.cameras:
        lacks: dict[str, list[str]] = {}
        for what, fields in needs.items():
            missing = [name for name in fields if getattr(camera, name) is None]
            lacks.setdefault(_list(missing), []).append(what)
        for fields_text, whats in lacks.items():
            groups.setdefault((fields_text, _list(whats)), []).append(camera.name)
    lines = [
        f"{what} of camera{'s' * (len(names) > 1)} {_list(names)}: give {missing_text}"
        for (missing_text, what), names in groups.items()
        if missing_text
    ]
    e = manifest.excitation
    if e.frequency_hz is None:
        lines.append("frame rate, exposure, blur and movement: give excitation.frequency_hz")
    if e.amplitude_mm is None:
        lines.append("blur, movement and whole pixels: give excitation.amplitude_mm")
    if e.steady_s is None:
        lines.append(
            f"length of the steady part, taken as {STEADY_S:g} s: give excitation.steady_s"
        )
    if e.sound == "room":
        lines.append("a clap: no field tells whether every sound track has one")
    if manifest.structure.kind == "flat":
        lines.append('natural frequencies: give structure.kind "beam" or "plate" if it is one')
    return lines


def _list(names: Sequence[str]) -> str:
    return " and ".join(filter(None, [", ".join(names[:-1]), *names[-1:]]))


def describe(assessment: Assessment) -> list[str]:
    """Lines to print: tables, then warnings, then what was not checked; 100 columns."""
    rows = [_HEAD] + [_row(one) for one in assessment.table]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    widths[0] = min(widths[0], max(6, COLUMNS - sum(widths[1:]) - 2 * len(widths[1:])))
    lines = [
        "  ".join([_cut(row[0], widths[0]), *map(str.rjust, row[1:], widths[1:])]) for row in rows
    ]
    rig = assessment.rig
    lines += ["", f"{'standard error of the deflection, mm':<52}{'rms':>10}{'worst':>10}"]
    for what, values in (
        (f"one frame, centres that scatter {rig.noise_px:g} px", rig.one_frame),
        (f"harmonic fit of {rig.steady_s:g} s, {rig.frames} frames", rig.fit),
        ("whole-pixel centres, one frame near a maximum", rig.rounding),
    ):
        lines.append(f"  {what:<50}{_number(values[0]):>10}{_number(values[1]):>10}")
    lines.append(
        f"{'smallest deflection, three errors of the fit, mm':<62}{_number(rig.smallest_mm):>10}"
    )
    alike: dict[tuple[str, ...], list[str]] = {}
    for one in assessment.warnings:
        alike.setdefault((one.code, one.text, one.where.split("]")[-1]), []).append(one.where)
    notes = []
    for (code, text, _), where in alike.items():
        more = f" and {len(where) - 1} more" if len(where) > 1 else ""
        notes.append(f"warning: {where[0]}{more}: {text} [{code}]")
    notes += [f"not checked: {line}" for line in assessment.unknown]
    for note in notes:
        lines += textwrap.wrap(note, COLUMNS, subsequent_indent="  ", break_on_hyphens=False)
    return lines


def _cut(text: str, width: int) -> str:
    return text.ljust(width) if len(text) <= width else text[: width - 1] + "…"


def _row(one: CameraOutlook) -> tuple[str, ...]:
    return (
        one.name, _number(one.ground_sample_mm), _pair(one.along_px, one.across_px, "x", 1),
        _number(one.gap_px), _number(one.blur_px), _share(one.lost, 1),
        _pair(one.near_mm, one.far_mm), _pair(one.nearest_mm, one.farthest_mm),
        _share(one.in_view), _number(one.move_px), _number(one.move_spacings),
    )  # fmt: skip


def _number(value: float) -> str:
    return "-" if np.isnan(value) else f"{value:.3g}"


def _pair(low: float, high: float, between: str = "-", digits: int = 0) -> str:
    known = [f"{v:.{digits}f}" for v in (low, high) if not np.isnan(v)]
    return between.join(known) or "-"


def _share(value: float, digits: int = 0) -> str:
    return "-" if np.isnan(value) else f"{value:.{digits}%}"
